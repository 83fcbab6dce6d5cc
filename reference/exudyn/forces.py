"""Springs and loads in Exudyn; what depends on time is set at the beginning of each step, only laws are called."""

import math
from collections.abc import Callable
from math import dist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import AnctmmError, unknown_kind
from anctmm.model.connectors import Connector, Spring, ends_of, free_name, free_of, law_value, name_of
from anctmm.model.drives import Pulse
from anctmm.model.loads import LOADS, LineLoad, load_text, width_of
from anctmm.model.places import Place
from anctmm.model.scene import Force, Load, Torque
from reference.exudyn.model import FAILED, Model, angle_of, axes

Array = NDArray[np.float64]


def add_connector(model: Model, connector: Connector) -> None:
    """Add a spring.

    In statics a part f of the load meets N − (1 − f) N₀, N₀ that of the reference without damping: as in the other
    solvers, the reference is in equilibrium before anything is loaded.
    """
    first, second = ends_of(model.scene, connector)
    if isinstance(connector, Spring):
        placed = dist(first.position, second.position if isinstance(second, Place) else second)  # type: ignore[arg-type]
        item = _spring(model, connector, first, second)
        names = "referenceLength", "velocityOffset", "force"
    else:
        placed = 0.0
        item = _rotational_spring(model, first, second)  # type: ignore[arg-type]
        names = "offset", "velocityOffset", "torque"
    free = connector.length if isinstance(connector, Spring) else connector.angle
    if connector.law is not None:
        _law(model, connector, item, placed)
        model.mbs.AddObject(item)
        return
    item.stiffness, item.damping = connector.stiffness, connector.damping
    start, rate = free_of(connector, placed, 0.0)
    setattr(item, names[0], start)
    setattr(item, names[1], rate)
    setattr(item, names[2], connector.preload)
    number = model.mbs.AddObject(item)
    if model.static:
        held = connector.stiffness * (placed - start) + connector.preload

        def unload(step: int, t: float) -> None:
            model.mbs.SetObjectParameter(number, names[2], connector.preload - (1.0 - t) * held)

        model.each_step(unload)
    elif callable(free):
        table = model.history(f"{name_of(connector)} {free_name(connector)}", free, 2)

        def drive(step: int, t: float) -> None:
            for name, value in zip(names[:2], table[step].tolist(), strict=True):
                model.mbs.SetObjectParameter(number, name, value)

        model.each_step(drive)


def _spring(model: Model, connector: Spring, first: Place, second: Any) -> Any:
    other = model.point(second) if isinstance(second, Place) else model.on_body(None, second)
    return model.items.ObjectConnectorSpringDamper(markerNumbers=[model.point(first), other])


def _rotational_spring(model: Model, first: Place, second: Place | None) -> Any:
    """Exudyn's angle is that of its second marker against its first, and the moment works against it."""
    fixed, moving = (None, first) if second is None else (first, second)
    marker = model.on_body(None, (0.0, 0.0)) if fixed is None else model.rigid(fixed)
    turns = model.items.NodeGenericData(numberOfDataCoordinates=1, initialCoordinates=[0.0])
    return model.items.ObjectConnectorTorsionalSpringDamper(
        markerNumbers=[marker, model.rigid(moving)],
        nodeNumber=model.mbs.AddNode(turns),
        rotationMarker0=axes(-angle_of(fixed)),
        rotationMarker1=axes(-angle_of(moving)),
    )


def _law(model: Model, connector: Connector, item: Any, placed: float) -> None:
    """The force of a law as a user function, of the distance less the reference length or of the angle."""
    name, law = name_of(connector), connector.law
    start = free_of(connector, placed, 0.0)[0]

    def pull(t: float, value: float, rate: float) -> float:
        assert law is not None
        try:
            if model.static:
                return law_value(name, law, value - start, 0.0, 0.0) - (1.0 - t) * law_value(
                    name, law, placed - start, 0.0, 0.0
                )
            t = float(model.run.times(np.array(min(round(t / model.run.exact_dt), model.run.steps))))
            free, free_rate = free_of(connector, placed, t)
            return law_value(name, law, value - free, rate - free_rate, t)
        except AnctmmError as error:
            FAILED.append(error)
            raise

    if isinstance(connector, Spring):
        item.referenceLength = start
        item.springForceUserFunction = lambda mbs, t, item, e, rate, k, d, f: pull(t, e + start, rate)
    else:
        item.springTorqueUserFunction = lambda mbs, t, item, angle, rate, k, d, offset: pull(t, angle, rate)


def add_load(model: Model, load: Load) -> None:
    """Add a load."""
    name, width, value = load_text(load), width_of(load), load.value
    table = (
        model.history(name, value, width)
        if callable(value)
        else np.atleast_2d(np.asarray(value, dtype=float))
    )
    match load:
        case Force() | Torque():
            _at_place(model, load, table)
        case LineLoad():
            _along(model, load, table)
        case _:
            raise unknown_kind("load", load, LOADS)


def _at_place(model: Model, load: Force | Torque, table: Array) -> None:
    items, place = model.items, model.scene.place(load.end)
    follows = isinstance(load, Force) and load.follower
    marker = (model.rigid if follows or isinstance(load, Torque) else model.point)(place)
    if isinstance(load, Force):
        # a follower's components are those of the marker's axes
        turn = np.array(axes(-angle_of(place) if follows else 0.0))
        vectors = np.column_stack([table, np.zeros(len(table))]) @ turn.T
        item = items.LoadForceVector(markerNumber=marker, loadVector=vectors[0], bodyFixed=follows)
    else:
        vectors = np.column_stack([np.zeros((len(table), 2)), table])
        item = items.LoadTorqueVector(markerNumber=marker, loadVector=vectors[0])
    number = model.mbs.AddLoad(item)
    if isinstance(load, Torque) and type(load.value) is Pulse and not model.static:
        compiled = _symbolic_pulse(model.exu.symbolic, load.value)
        model.compiled.append((number, "loadVectorUserFunction", compiled))
    elif len(vectors) > 1:
        model.each_step(lambda k, t: model.mbs.SetLoadParameter(number, "loadVector", vectors[k]))


def _along(model: Model, load: LineLoad, table: Array) -> None:
    """Consistent forces on the nodes of a beam."""
    body = model.scene.beam(load.body)
    parts = np.stack([model.beams.uniform(body, unit) for unit in np.eye(2)])
    nodes = model.nodes[load.body]
    loads = model.add_forces(nodes, np.abs(parts).sum(axis=0))  # all that can be loaded

    def update(step: int, t: float) -> None:
        value = table[min(step, len(table) - 1)]
        for number, k, index in loads:
            model.mbs.SetLoadParameter(number, "load", float(value @ parts[:, k, index]))

    update(0, 0.0)
    if len(table) > 1:
        model.updates.append(update)


def _symbolic_pulse(esym: Any, pulse: Pulse) -> Callable[..., Any]:
    real = esym.Real

    def vector(mbs: Any, t: Any, constant: Any) -> Any:
        x = esym.min(t * real(1.0 / pulse.duration), real(1.0))
        wave = esym.sin(real(math.pi) * x)
        return esym.Vector([real(0.0), real(0.0), real(pulse.amplitude) * wave * wave])

    return vector
