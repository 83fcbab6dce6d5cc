"""Loads in Exudyn; functions of time become user functions."""

import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import unknown_kind
from anctmm.model.drives import Pulse, value_at
from anctmm.model.loads import LOADS, load_text, width_of
from anctmm.model.scene import Force, LineLoad, Load, Torque
from reference.exudyn.histories import remembered
from reference.exudyn.places import angle_of, axes, point_marker, rigid_marker

Vector = Callable[[Any, float, Any], list[float]]


def add_load(model: Any, load: Load) -> None:
    """Add a load.

    Parameters
    ----------
    model : reference.exudyn.model.Model
    load : Load
    """
    match load:
        case Force() | Torque():
            _add_at_place(model, load)
        case LineLoad():
            _add_along(model, load)
        case _:
            raise unknown_kind("load", load, LOADS)


def _add_at_place(model: Any, load: Force | Torque) -> None:
    items, place, value = model.items, model.scene.place(load.end), load.value
    turning = isinstance(load, Torque) or load.follower
    marker = (rigid_marker if turning else point_marker)(model, place)
    # a follower's components are those of the marker's axes
    axis = -angle_of(place) if isinstance(load, Force) and load.follower else 0.0
    vector = _vector(load, None, axis)(model.mbs, 0.0, None)
    if isinstance(load, Force):
        item = items.LoadForceVector(markerNumber=marker, loadVector=vector, bodyFixed=load.follower)
    else:
        item = items.LoadTorqueVector(markerNumber=marker, loadVector=vector)
    history = value if callable(value) and not model.static else None
    if history is not None:
        item.loadVectorUserFunction = _vector(load, model.run, axis)
    number = model.mbs.AddLoad(item)
    if isinstance(load, Torque) and type(history) is Pulse:  # what a subclass of the user's does is not known
        compiled = _symbolic_pulse(model.exu.symbolic, history)
        model.symbolic.append((number, "loadVectorUserFunction", compiled))


def _add_along(model: Any, load: LineLoad) -> None:
    """Consistent forces on the nodes of a beam."""
    body, value = model.scene.beam(load.body), _vector(load, model.run, 0.0)
    parts = np.stack([model.beams.uniform(body, unit) for unit in np.eye(2)])
    start = np.array(value(None, 0.0, None)[:2])
    for node, shares in zip(model.nodes[body.name], np.moveaxis(parts, 0, -1), strict=True):
        for index in np.flatnonzero(np.abs(shares).max(axis=1)):
            share = shares[index]
            item = model.items.LoadCoordinate(
                markerNumber=model.coordinate(node, int(index)), load=float(share @ start)
            )
            if callable(load.value) and not model.static:
                item.loadUserFunction = lambda mbs, t, load, s=share: float(s @ value(mbs, t, None)[:2])
            model.mbs.AddLoad(item)


def _vector(load: Load, run: Discretisation | None, axis: float) -> Vector:
    """Exudyn's vector of a load by (system, t, constant vector), turned by the angle of its axes."""
    name, width, value = load_text(load), width_of(load), load.value
    turn = np.array(axes(axis))

    def plain(t: float) -> list[float]:
        found = value_at(name, value, t, width) if callable(value) else np.atleast_1d(cast(Any, value))
        vector = [0.0, 0.0, *found] if width == 1 else [*found, 0.0]
        return [float(x) for x in turn @ vector] if axis else [float(x) for x in vector]

    known = remembered(plain, run)
    return lambda mbs, t, constant: known(t)  # type: ignore[no-any-return]


def _symbolic_pulse(esym: Any, pulse: Pulse) -> Callable[..., Any]:
    real = esym.Real

    def vector(mbs: Any, t: Any, constant: Any) -> Any:
        x = esym.min(t * real(1.0 / pulse.duration), real(1.0))
        wave = esym.sin(real(math.pi) * x)
        return esym.Vector([real(0.0), real(0.0), real(pulse.amplitude) * wave * wave])

    return vector
