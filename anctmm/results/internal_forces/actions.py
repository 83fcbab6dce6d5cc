"""Loads on the bodies of a solution at each output: loads and connectors as forces and moments, weights."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import unknown_kind
from anctmm.model.connectors import CONNECTORS, Connector, RotationalSpring, Spring, ends_of, free_of, name_of
from anctmm.model.drives import tabulate
from anctmm.model.loads import LOADS, Force, LineLoad, Load, Torque, load_text, width_of
from anctmm.model.places import Place

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Action:
    """A force and a moment on a place.

    Parameters
    ----------
    place : Place
    force : ndarray, shape (n, 2)
        N.
    moment : ndarray, shape (n,)
        N m, counter-clockwise.
    """

    place: Place
    force: Array
    moment: Array


def actions_on(solution: Any, body: str) -> list[Action]:
    """Loads and connectors on places of a body."""
    return [action for action in actions_of(solution) if action.place.body.name == body]


def actions_of(solution: Any) -> Iterator[Action]:
    """Loads on places, and connectors, of a whole solution."""
    for load in solution.scene.loads:
        match load:
            case Force():
                place, values = solution.scene.place(load.end), values_of(solution, load)
                if load.follower:
                    values = _turned(values, turn_since_placed(solution, load.end))
                yield Action(place, values, np.zeros(len(values)))
            case Torque():
                values = values_of(solution, load)
                yield Action(solution.scene.place(load.end), np.zeros((len(values), 2)), values[:, 0])
            case LineLoad():
                pass  # not on a place: `along`
            case _:
                raise unknown_kind("load", load, LOADS)
    for connector in solution.scene.connectors:
        yield from _of_connector(solution, connector)


def along(solution: Any, body: str) -> Array:
    """Forces per undeformed length of a beam: its weight and line loads, (n, 2), N/m."""
    scene, beam = solution.scene, solution.scene.beam(body)
    density = beam.material.density * beam.section.area
    total = np.outer(_factors(solution), density * np.asarray(scene.gravity))
    for load in scene.loads:
        if isinstance(load, LineLoad) and load.body == body:
            total += values_of(solution, load)
    return total


def values_of(solution: Any, load: Load) -> Array:
    """Value of a load at each output, (n, numbers); in statics a part of what it is at t = 0."""
    width, n = width_of(load), len(solution.t)
    if callable(load.value):
        t = np.zeros(n) if solution.static else solution.t
        values = tabulate(load_text(load), load.value, t, width).reshape(n, width)
    else:
        values = np.tile(np.atleast_1d(np.asarray(load.value, dtype=float)), (n, 1))
    return values * _factors(solution)[:, None]


def tension_of(solution: Any, connector: Connector) -> Array:
    """Tension of a spring (N), or the moment of a rotational spring against its angle (N m), (n,).

    In statics the reference is an equilibrium at the load factor 0: what a connector has there grows with the load.
    """
    value, rate = _stretch(solution, connector)
    reference = _as_placed(solution, connector)
    if not solution.static:
        return np.array(
            [_answer(connector, reference, *x) for x in zip(value, rate, solution.t, strict=True)]
        )
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


def _of_connector(solution: Any, connector: Connector) -> Iterator[Action]:
    tension, (first, second) = tension_of(solution, connector), ends_of(solution.scene, connector)
    none = np.zeros(len(tension))
    match connector:
        case Spring():
            pull = tension[:, None] * _line(solution, connector)[2]
            yield Action(first, pull, none)
            if isinstance(second, Place):
                yield Action(second, -pull, none)
        case RotationalSpring():
            still = np.zeros((len(tension), 2))
            if isinstance(second, Place):
                yield Action(first, still, tension)
                yield Action(second, still, -tension)
            else:
                yield Action(first, still, -tension)
        case _:
            raise unknown_kind("connector", connector, CONNECTORS)


def _line(solution: Any, spring: Spring) -> tuple[Array, Array, Array]:
    """Distance of a spring's places, its rate, and the direction from the first to the second.

    At distance 0 there is no direction, and no rate: it jumps there from −v to v. The solver has the same.
    """
    here, speed = _motion(solution, spring.first)
    if spring.ground is not None:
        there, faster = np.asarray(spring.ground), np.zeros_like(speed)
    else:
        there, faster = _motion(solution, spring.second)
    apart = there - here
    distance = np.hypot(*apart.T)
    direction = np.divide(apart, distance[:, None], out=np.zeros_like(apart), where=distance[:, None] > 0.0)
    return distance, np.einsum("nc,nc->n", direction, faster - speed), direction


def _motion(solution: Any, place: Any) -> tuple[Array, Array]:
    position = solution.position(place)
    return position, np.zeros_like(position) if solution.static else solution.velocity(place)


def _stretch(solution: Any, connector: Connector) -> tuple[Array, Array]:
    """What a connector's law works on, before its free value is taken off, and its rate, each (n,)."""
    match connector:
        case Spring():
            distance, rate, _ = _line(solution, connector)
            return distance, rate
        case RotationalSpring():
            found = [_turn(solution, place) for place in connector.places]
            if len(found) == 1:
                return found[0]
            return found[1][0] - found[0][0], found[1][1] - found[0][1]
        case _:
            raise unknown_kind("connector", connector, CONNECTORS)


def _turn(solution: Any, place: Any) -> tuple[Array, Array]:
    angle = turn_since_placed(solution, place)
    return angle, np.zeros_like(angle) if solution.static else solution.spin(place)


def turn_since_placed(solution: Any, place: Any) -> Array:
    """Angle of a place since the undeformed scene, (n,), rad: a motion may start from an equilibrium."""
    name, at = solution.scene.probe(place)
    return np.asarray(solution.whole_turns.angle(name, at))


def _as_placed(solution: Any, connector: Connector) -> float:
    """Length of a spring in the reference, m; angles are counted from there."""
    if isinstance(connector, RotationalSpring):
        return 0.0
    first, second = ends_of(solution.scene, connector)
    there = second.position if isinstance(second, Place) else second
    assert there is not None, name_of(connector)
    return float(np.hypot(*np.subtract(there, first.position)))


def _factors(solution: Any) -> Array:
    return np.asarray(solution.t) if solution.static else np.ones(len(solution.t))


def _turned(vectors: Array, angle: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1)
