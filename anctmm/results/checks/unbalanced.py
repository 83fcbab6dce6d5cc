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
from anctmm.model.connectors import RotationalSpring, ends_of
from anctmm.model.joints import Guide, Joint
from anctmm.model.loads import Force, LineLoad, Torque, tabulated
from anctmm.model.places import Place
from anctmm.model.scene import Scene
from anctmm.model.topology import GROUND, Sets, joined_bodies
from anctmm.results.status import Status

Array = NDArray[np.float64]

#: Of the loads of a group of bodies: a sum that counts as none; sine of the angle between parallel lines.
NONE, PARALLEL = 1e-9, 1e-12


@dataclass
class _Group:
    """Bodies that are connected to each other, what connects them to the ground, and dead loads on them.

    Forces have the place where they act, or None along beams.
    """

    bodies: list[str]
    lines: list[tuple[float, float]] = field(default_factory=list)
    pivots: list[Place] = field(default_factory=list)
    #: Whether something else holds them, or acts on them with a force that turns with its place; and their rotation.
    held: bool = False
    turns_held: bool = False
    forces: list[tuple[Place | None, Array]] = field(default_factory=list)
    moments: list[float] = field(default_factory=list)

    def motion(self) -> str | None:
        """How they move for ever, in words; None if they do not."""
        return None if self.held else self._slides() or self._turns()

    def _slides(self) -> str | None:
        parallel = all(abs(x * v - y * u) <= PARALLEL for x, y in self.lines[:1] for u, v in self.lines)
        if self.pivots or not parallel or not self.forces:
            return None
        directions = np.array(self.lines[:1]) if self.lines else np.eye(2)
        along = directions @ np.sum([force for _, force in self.forces], axis=0)
        size = float(np.linalg.norm(along))
        if size <= NONE * sum(float(np.hypot(*force)) for _, force in self.forces):
            return None
        x, y = along @ directions / size
        return f"move along ({x:.4g}, {y:.4g}) without end, and a force of {size:.4g} N acts"

    def _turns(self) -> str | None:
        spots = {place.position for place in self.pivots}
        pivots = {place.canonical for place in self.pivots}
        elsewhere = any(place is None or place.canonical not in pivots for place, _ in self.forces)
        if self.lines or self.turns_held or len(spots) > 1 or elsewhere:
            return None
        moment = sum(self.moments)
        if not abs(moment) > NONE * sum(map(abs, self.moments)):
            return None
        about = f" about {shown(next(iter(spots)))}" if spots else ""
        return f"turn{about} without end, and a moment of {moment:.4g} N m acts"


def never_balanced(scene: Scene) -> Status | None:
    """Status of a search for an equilibrium that cannot be, as the loads do work in a motion without end; or None."""
    for group in _groups(scene):
        if (why := group.motion()) is not None:
            names = f"bodies {listed(group.bodies)}, which are connected, are"
            who, it = (f"body {group.bodies[0]!r} is", "it") if len(group.bodies) == 1 else (names, "them")
            message = (
                f"no equilibrium found beyond 0 of the load: {who} free to {why} that way; a joint or a spring to the "
                f"ground can hold {it}, or another load balance this one"
            )
            return Status("diverged", message, time=0.0, body=group.bodies[0])
    return None


def _groups(scene: Scene) -> Iterator[_Group]:
    """Bodies of a scene by what connects them; a damper has no force at rest."""
    acting = [c for c in scene.connectors if c.law is not None or c.stiffness != 0.0 or c.preload != 0.0]
    sets = Sets[str]()
    for one, two in joined_bodies(scene, acting):
        if two is not GROUND:
            sets.unite(one, two)
    of = dict[str, _Group]()
    for names in sets.among(body.name for body in scene.bodies):
        of |= dict.fromkeys(names, _Group(names))
    for joint in scene.joints:
        _hold(scene, of[scene.place(joint.places[0]).body.name], joint)
    for connector in acting:
        first, second = ends_of(scene, connector)
        if not isinstance(second, Place):
            group, turning = of[first.body.name], isinstance(connector, RotationalSpring)
            group.turns_held |= turning
            group.held |= not turning
    _load(scene, of)
    yield from {id(group): group for group in of.values()}.values()


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
            group.pivots += [scene.place(end) for end in joint.ends]


def _load(scene: Scene, of: dict[str, _Group]) -> None:
    """Write down what acts on each group at t = 0."""
    gravity = np.array(scene.gravity)
    for body in scene.bodies if gravity.any() else ():
        place = None if isinstance(body, Beam) else scene.place(f"{body.name}.center")
        of[body.name].forces.append((place, body.mass * gravity))
    for load, value in zip(scene.loads, tabulated(scene.loads, np.zeros(1))[0], strict=True):
        if isinstance(load, LineLoad):
            if value.any():
                of[load.body].forces.append((None, scene.beam(load.body).length * value))
            continue
        place = scene.place(load.end)
        group = of[place.body.name]
        if isinstance(load, Torque):
            group.moments.append(float(value[0]))
        elif isinstance(load, Force):
            group.held |= load.follower
            group.forces += [(place, value)] if value.any() else []
