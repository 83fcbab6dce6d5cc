"""Loads that no equilibrium can balance: along a translation that needs no force, however far it goes.

Bodies that joints and connectors connect to each other, but not to the ground, can be translated as one: no joint
parts and no energy changes. If guides alone connect them to the ground, the same holds along the line of these. Dead
forces do the work F · d of a translation d, wherever the bodies are: where the sum F has a part along it, there is no
equilibrium.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import listed
from anctmm.model.connectors import RotationalSpring, ends_of
from anctmm.model.joints import Guide
from anctmm.model.loads import Force, LineLoad, tabulated
from anctmm.model.places import Place
from anctmm.model.scene import Scene
from anctmm.model.topology import GROUND, Sets, joined_bodies
from anctmm.results.status import Status

Array = NDArray[np.float64]

#: Of the loads of a group of bodies: a sum that counts as none; sine of the angle between parallel lines.
NONE, PARALLEL = 1e-9, 1e-12


@dataclass
class _Group:
    """Bodies that are connected to each other, the lines of the ground on which they move, and dead forces on them.

    They are held if something else connects them to the ground, or a force acts that turns with its place.
    """

    bodies: list[str]
    lines: list[tuple[float, ...]] = field(default_factory=list)
    held: bool = False
    forces: list[Array] = field(default_factory=lambda: [np.zeros(2)])

    def motion(self) -> str | None:
        """Along what they move for ever, in words; None if they do not."""
        parallel = all(abs(x * v - y * u) <= PARALLEL for x, y in self.lines[:1] for u, v in self.lines)
        directions = np.array(self.lines[:1]) if self.lines else np.eye(2)
        along = directions @ np.sum(self.forces, axis=0)
        size = float(np.linalg.norm(along))
        if self.held or not parallel or size <= NONE * float(np.linalg.norm(self.forces, axis=1).sum()):
            return None
        x, y = along @ directions / size
        return f"move along ({x:.4g}, {y:.4g}) without end, and a force of {size:.4g} N acts"


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
    groups = [_Group(names) for names in sets.among(body.name for body in scene.bodies)]
    of = {name: group for group in groups for name in group.bodies}
    for joint in scene.joints:
        group = of[scene.place(joint.places[0]).body.name]
        if isinstance(joint, Guide) and joint.body is None:
            group.lines.append(joint.direction)
            group.held |= joint.position is not None
        group.held |= joint.grounded
    for connector in acting:
        first, second = ends_of(scene, connector)
        if not isinstance(second, Place) and not isinstance(connector, RotationalSpring):
            of[first.body.name].held = True
    for body in scene.bodies:
        of[body.name].forces.append(body.mass * np.array(scene.gravity))
    for load, value in zip(scene.loads, tabulated(scene.loads, np.zeros(1))[0], strict=True):
        if isinstance(load, LineLoad):
            of[load.body].forces.append(scene.beam(load.body).length * value)
        elif isinstance(load, Force):
            of[scene.place(load.end).body.name].forces.append(value)
            of[scene.place(load.end).body.name].held |= load.follower
    return iter(groups)
