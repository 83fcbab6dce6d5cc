"""Loads that no equilibrium can balance: along a motion that needs no force, however far it goes.

Bodies that joints and connectors connect to each other, but not to the ground, can be translated as one: no joint
parts and no energy changes. If guides alone connect them to the ground, the same holds along the line of these. Dead
forces do the work F · d of a translation d, wherever the bodies are: where the sum F has a part along it, there is no
equilibrium. So it is with moments and a rotation about the one place that holds bodies on which no other loads act.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import listed, shown
from anctmm.model.bodies import Beam
from anctmm.model.connectors import Connector, RotationalSpring, ends_of
from anctmm.model.joints import Guide, Joint
from anctmm.model.loads import Force, LineLoad, Torque, tabulated
from anctmm.model.places import Place
from anctmm.model.scene import Scene
from anctmm.model.topology import GROUND, Sets, joined_bodies
from anctmm.model.velocities import Point
from anctmm.results.status import Status

Array = NDArray[np.float64]

#: Of the loads of a group of bodies: a sum that counts as none.
NONE = 1e-9
#: Sine of the angle between lines that count as parallel.
PARALLEL = 1e-12


@dataclass
class _Group:
    """Bodies that are connected to each other, and what connects them to the ground."""

    bodies: list[str]
    #: Directions of lines in the ground on which their places move.
    lines: list[Point] = field(default_factory=list)
    #: Places that pins hold.
    pivots: list[Place] = field(default_factory=list)
    #: Whether something else holds them, or acts on them with a force that turns with its place.
    held: bool = False
    #: Whether something holds their rotation only.
    turns_held: bool = False

    def slides(self) -> Array | None:
        """Directions in which they can be translated, (k, 2); None if there are none."""
        if self.held or self.pivots:
            return None
        if not self.lines:
            return np.eye(2)
        (x, y), *others = self.lines
        parallel = all(abs(x * v - y * u) <= PARALLEL for u, v in others)
        return np.array([(x, y)]) if parallel else None


def never_balanced(scene: Scene) -> Status | None:
    """Status of a search for an equilibrium that cannot be, as the loads do work in a motion without end.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Status or None
        None where there may be an equilibrium.
    """
    values = tabulated(scene.loads, np.zeros(1))[0]
    for group in _groups(scene):
        forces = list(_forces(scene, group, values))
        why = _slides(group, forces) or _turns(scene, group, forces, values)
        if why is not None:
            alone = len(group.bodies) == 1
            what = f"body {group.bodies[0]!r} is" if alone else f"bodies {_names(group)} are"
            return Status(
                "diverged",
                f"no equilibrium found beyond 0 of the load: {what} free to {why} that way; a joint or a "
                f"spring to the ground can hold {'it' if alone else 'them'}, or another load balance this one",
                time=0.0,
                body=group.bodies[0],
            )
    return None


def _names(group: _Group) -> str:
    return f"{listed(group.bodies)}, which are connected,"


def _slides(group: _Group, forces: list[tuple[Place | None, Array]]) -> str | None:
    """Along what the group moves for ever; None if it does not."""
    directions = group.slides()
    if directions is None or not forces:
        return None
    total = np.sum([force for _, force in forces], axis=0)
    along = directions @ total
    size = float(np.linalg.norm(along))
    if size <= NONE * sum(float(np.hypot(*force)) for _, force in forces):
        return None
    x, y = along @ directions / size
    return f"move along ({x:.4g}, {y:.4g}) without end, and a force of {size:.4g} N acts"


def _turns(
    scene: Scene, group: _Group, forces: list[tuple[Place | None, Array]], values: Array
) -> str | None:
    """About what the group turns for ever; None if it does not."""
    if group.held or group.lines or group.turns_held:
        return None
    spots = {pivot.position for pivot in group.pivots}
    pivots = {pivot.end for pivot in group.pivots}
    if len(spots) > 1 or any(place is None or place.canonical not in pivots for place, _ in forces):
        return None
    moments = [
        float(value[0])
        for load, value in zip(scene.loads, values, strict=True)
        if isinstance(load, Torque) and scene.place(load.end).body.name in group.bodies
    ]
    if not abs(sum(moments)) > NONE * sum(map(abs, moments)):
        return None
    about = f" about {shown(next(iter(spots)))}" if spots else ""
    return f"turn{about} without end, and a moment of {sum(moments):.4g} N m acts"


def _forces(scene: Scene, group: _Group, values: Array) -> Iterator[tuple[Place | None, Array]]:
    """Dead forces on a group, N, and the places where they act; None for those along beams."""
    gravity = np.array(scene.gravity)
    for name in group.bodies:
        body = scene.body(name)
        if gravity.any():
            yield (None if isinstance(body, Beam) else scene.place(f"{name}.center")), body.mass * gravity
    for load, value in zip(scene.loads, values, strict=True):
        if isinstance(load, Force) and value.any():
            place = scene.place(load.end)
            if place.body.name in group.bodies:
                yield place, value
        elif isinstance(load, LineLoad) and value.any() and load.body in group.bodies:
            yield None, scene.beam(load.body).length * value


def _groups(scene: Scene) -> list[_Group]:
    """Bodies of a scene by what connects them."""
    sets = Sets[str]()
    acting = [connector for connector in scene.connectors if _acts(connector)]
    for one, two in joined_bodies(scene, acting):
        if two is not GROUND:
            sets.unite(one, two)
    groups = {names[0]: _Group(names) for names in sets.among(body.name for body in scene.bodies)}
    of = {name: group for group in groups.values() for name in group.bodies}
    for joint in scene.joints:
        _hold(scene, of[scene.place(joint.places[0]).body.name], joint)
    for connector in acting:
        first, second = ends_of(scene, connector)
        if not isinstance(second, Place):
            if isinstance(connector, RotationalSpring):
                of[first.body.name].turns_held = True
            else:
                of[first.body.name].held = True
    for load in scene.loads:
        if isinstance(load, Force) and load.follower:
            of[scene.place(load.end).body.name].held = True
    return list(groups.values())


def _hold(scene: Scene, group: _Group, joint: Joint) -> None:
    """Write down how a joint connects a group to the ground."""
    if isinstance(joint, Guide):
        if joint.body is None:
            group.lines.append(joint.direction)
            group.held |= joint.position is not None
    elif joint.grounded:
        if joint.holds_direction or joint in scene.own_joints:
            group.held = True
        else:
            group.pivots += [_first(scene.place(end)) for end in joint.ends]


def _first(place: Place) -> Place:
    """The same place, by the name that stands for all that coincide with it."""
    return Place(place.body, place.canonical[1])


def _acts(connector: Connector) -> bool:
    """Whether a connector has a force at rest: a damper has none."""
    return connector.law is not None or connector.stiffness != 0.0 or connector.preload != 0.0
