"""Loads on the bodies of a solution at each output: loads and connectors as forces and moments, weights."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.model.connectors import Connector, Spring, ends_of, free_of
from anctmm.model.drives import tabulate
from anctmm.model.expressions import QUARTER_TURN
from anctmm.model.loads import Force, LineLoad, Load, Torque, load_text, width_of
from anctmm.model.places import Place

Array = NDArray[np.float64]


class Action(NamedTuple):
    """A force, (n, dim), N, and a moment, (n, 1), N m counter-clockwise, in space (n, 3), on a place."""

    place: Place
    force: Any
    moment: Any


def moment_of(arm: Array, force: Array) -> Array:
    """arm × force, (…, 1) of vectors of the plane, (…, 3) of space."""
    if arm.shape[-1] == 3:
        return np.cross(arm, force)
    return arm[..., :1] * force[..., 1:] - arm[..., 1:] * force[..., :1]


def turned(moment: Array, vector: Array) -> Array:
    """moment × vector, (…, dim)."""
    return np.cross(moment, vector) if vector.shape[-1] == 3 else moment * (vector @ QUARTER_TURN.T)


def actions_on(solution: Any, body: str) -> Iterator[Action]:
    """Loads and connectors on places of a body."""
    scene = solution.scene
    for load in scene.loads:
        if not isinstance(load, LineLoad) and scene.place(load.end).body.name == body:  # else see `along`
            yield _of_load(solution, load)
    for connector in scene.connectors:
        places = (end for end in ends_of(scene, connector) if isinstance(end, Place))
        if any(place.body.name == body for place in places):
            yield from (one for one in _of_connector(solution, connector) if one.place.body.name == body)


def along(solution: Any, body: str) -> Array:
    """Forces per undeformed length of a beam: its weight and line loads, (n, dim), N/m."""
    scene, beam = solution.scene, solution.scene.beam(body)
    total = np.outer(load_factors(solution), beam.mass / beam.length * np.asarray(scene.gravity))
    for load in scene.loads:
        if isinstance(load, LineLoad) and load.body == body:
            total += _values(solution, load)
    return total


def _of_load(solution: Any, load: Force | Torque) -> Action:
    values, place = _values(solution, load), solution.scene.place(load.end)
    if isinstance(load, Torque):
        return Action(place, np.zeros((len(values), 2)), values)
    if load.follower:
        angle = turn_since_placed(solution, load.end)[:, None]
        values = np.cos(angle) * values + np.sin(angle) * (values @ QUARTER_TURN.T)
    return Action(place, values, moment_of(0.0 * values, values))


def _values(solution: Any, load: Load) -> Array:
    """Value of a load at each output, (n, numbers); in statics a part of what it is at t = 0."""
    width, n = width_of(load, solution.scene.dim), len(solution.t)
    values: Any = load.value
    if callable(load.value):
        t = 0.0 * solution.t if solution.static else solution.t
        values = tabulate(load_text(load), load.value, t, width)
    return np.broadcast_to(values, (n, width)) * load_factors(solution)[:, None]


def _of_connector(solution: Any, connector: Connector) -> Iterator[Action]:
    tension = tension_of(solution, connector)[:, None]
    first, second = ends_of(solution.scene, connector)
    if isinstance(connector, Spring):
        pull = tension * _line(solution, connector)[2]
        none = moment_of(0.0 * pull, pull)
        yield Action(first, pull, none)
        if isinstance(second, Place):
            yield Action(second, -pull, none)
        return
    none = np.zeros((len(tension), 2))
    if isinstance(second, Place):
        yield Action(first, none, tension)
    yield Action(second if isinstance(second, Place) else first, none, -tension)


def tension_of(solution: Any, connector: Connector) -> Array:
    """Tension of a spring (N), or the moment of a rotational spring against its angle (N m), (n,).

    In statics the reference is an equilibrium at the load factor 0: what a connector has there grows with the load.
    """
    value, rate, reference = _stretch(solution, connector)
    if not solution.static:
        series = zip(value, rate, solution.t, strict=True)
        return np.array([_answer(connector, reference, *x) for x in series])
    before = _answer(connector, reference, reference, 0.0, 0.0)
    found = np.array([_answer(connector, reference, x, 0.0, 0.0) for x in value])
    return found - (1.0 - solution.t) * before


def _answer(connector: Connector, reference: float, value: float, rate: float, t: float) -> float:
    """Tension or moment of a connector, from its length or angle, its rate, and the time."""
    free, faster = free_of(connector, reference, float(t))
    more, rate = float(value) - free, float(rate) - faster
    if connector.law is not None:
        return float(connector.law(more, rate, float(t)))
    return connector.stiffness * more + connector.damping * rate + connector.preload


def _stretch(solution: Any, connector: Connector) -> tuple[Array, Array, float]:
    """Length or angle of a connector, before its free value is taken off, its rate, each (n,), and the reference."""
    if isinstance(connector, Spring):
        first, second = ends_of(solution.scene, connector)
        there: Any = second.position if isinstance(second, Place) else second
        return *_line(solution, connector)[:2], float(np.linalg.norm(np.subtract(there, first.position)))
    value: Any = 0.0
    rate: Any = 0.0
    sign = -1.0 if len(connector.places) == 2 else 1.0
    for place in connector.places:
        value = value + sign * turn_since_placed(solution, place)
        rate = rate + sign * (0.0 if solution.static else solution.spin(place))
        sign = 1.0
    return np.asarray(value), np.broadcast_to(rate, np.shape(value)), 0.0


def _line(solution: Any, spring: Spring) -> tuple[Array, Array, Array]:
    """Distance of a spring's places, its rate, and the direction from the first to the second.

    At distance 0 there is no direction, and no rate: it jumps there from −v to v. The solver has the same.
    """
    here, speed = _motion(solution, spring.first)
    there, faster = (
        _motion(solution, spring.second) if spring.ground is None else (np.asarray(spring.ground), 0.0)
    )
    apart = there - here
    distance = np.linalg.norm(apart, axis=1)
    direction = np.divide(apart, distance[:, None], out=np.zeros_like(apart), where=distance[:, None] > 0.0)
    return distance, np.einsum("nc,nc->n", direction, faster - speed), direction


def _motion(solution: Any, place: Any) -> tuple[Array, Array]:
    position = solution.position(place)
    return position, 0.0 * position if solution.static else solution.velocity(place)


def turn_since_placed(solution: Any, place: Any) -> Array:
    """Angle of a place since the undeformed scene, (n,), rad: a motion may start from an equilibrium."""
    name, at = solution.scene.probe(place)
    return np.asarray(solution.whole_turns.angle(name, at))


def load_factors(solution: Any) -> Array:
    """Parts of the load that act at the outputs, (n,)."""
    return np.asarray(solution.t) if solution.static else np.ones(len(solution.t))
