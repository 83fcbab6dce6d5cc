"""Springs and rotational springs in Exudyn; the forces of driven ones and of laws are user functions."""

from collections.abc import Callable
from math import dist
from typing import Any

from anctmm.errors import AnctmmError, unknown_kind
from anctmm.model.connectors import CONNECTORS, Connector, ends_of, free_of, law_value, name_of
from anctmm.model.places import Place
from anctmm.model.scene import RotationalSpring, Spring
from reference.exudyn.histories import FAILED, undrifted
from reference.exudyn.places import Model, angle_of, axes, ground_marker, point_marker, rigid_marker

Pull = Callable[[float, float, float], float]
"""(t of Exudyn's, distance or angle, its rate) → tension or moment."""


def add_connector(model: Model, connector: Connector) -> None:
    """Add a spring."""
    match connector:
        case Spring():
            item = _spring(model, connector)
        case RotationalSpring():
            item = _rotational_spring(model, connector)
        case _:
            raise unknown_kind("connector", connector, CONNECTORS)
    model.mbs.AddObject(item)


def _spring(model: Model, connector: Spring) -> Any:
    first, second = ends_of(model.scene, connector)
    assert second is not None  # a spring has two ends
    other = second.position if isinstance(second, Place) else second
    placed = dist(first.position, other)
    free = free_of(connector, placed, 0.0)[0]
    item = model.items.ObjectConnectorSpringDamper(
        markerNumbers=[
            point_marker(model, first),
            point_marker(model, second) if isinstance(second, Place) else ground_marker(model, second),
        ],
        referenceLength=free,
        stiffness=connector.stiffness,
        damping=connector.damping,
        force=connector.preload,
    )
    if not _plain(model, connector):
        pull = _pull(model, connector, placed)
        # Exudyn gives the distance less its reference length
        item.springForceUserFunction = lambda mbs, t, item, e, rate, k, d, f: pull(t, e + free, rate)
    return item


def _rotational_spring(model: Model, connector: RotationalSpring) -> Any:
    first, second = ends_of(model.scene, connector)
    assert second is None or isinstance(second, Place)
    # Exudyn's angle is that of its second marker against its first, and the moment works against it
    fixed, moving = (None, first) if second is None else (first, second)
    items, start = model.items, free_of(connector, 0.0, 0.0)[0]
    marker = ground_marker(model, (0.0, 0.0)) if fixed is None else rigid_marker(model, fixed)
    data = items.NodeGenericData(numberOfDataCoordinates=1, initialCoordinates=[0.0])
    item = items.ObjectConnectorTorsionalSpringDamper(
        markerNumbers=[marker, rigid_marker(model, moving)],
        nodeNumber=model.mbs.AddNode(data),  # keeps the number of turns
        stiffness=connector.stiffness,
        damping=connector.damping,
        rotationMarker0=axes(-angle_of(fixed)),
        rotationMarker1=axes(-angle_of(moving)),
        offset=start,
        torque=connector.preload,
    )
    if not _plain(model, connector):
        pull = _pull(model, connector, 0.0)
        item.springTorqueUserFunction = lambda mbs, t, item, angle, rate, k, d, offset: pull(t, angle, rate)
    return item


def _plain(model: Model, connector: Connector) -> bool:
    """Whether Exudyn's own formula does."""
    free = connector.length if isinstance(connector, Spring) else connector.angle
    return connector.law is None and not callable(free) and not model.static


def _pull(model: Model, connector: Connector, placed: float) -> Pull:
    """Tension or moment of a driven connector, of one with a law, or of any in statics.

    In statics a part f of the load meets N − (1 − f) N₀, N₀ that of the reference without damping: as in the other
    solvers, the reference is in equilibrium before anything is loaded. Exudyn's t is f there.
    """
    at_start = free_of(connector, placed, 0.0)
    still = 0.0 if connector.law is not None else at_start[1]

    def force(value: float, rate: float, t: float) -> float:
        free, free_rate = free_of(connector, placed, t)
        e, r = value - free, rate - free_rate
        if connector.law is not None:
            return law_value(name_of(connector), connector.law, e, r, t)
        return connector.stiffness * e + connector.damping * r + connector.preload

    def pull(t: float, value: float, rate: float) -> float:
        try:
            if model.static:
                return force(value, 0.0, 0.0) - (1.0 - t) * force(placed, still, 0.0)
            return force(value, rate, t if model.run is None else undrifted(t, model.run))
        except AnctmmError as error:
            FAILED.append(error)
            raise

    return pull
