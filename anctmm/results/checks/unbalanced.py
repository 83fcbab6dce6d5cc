"""Loads that no equilibrium can balance: along a translation that needs no force, however far it goes.

Bodies that joints and connectors connect to each other, but not to the ground, can be translated as one: no joint
parts and no energy changes. If guides alone connect them to the ground, the same holds along the line of these. Dead
forces do the work F · d of a translation d, wherever the bodies are: where the sum F has a part along it, there is no
equilibrium.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import listed
from anctmm.model.connectors import Connector, RotationalSpring, ends_of
from anctmm.model.joints import Guide
from anctmm.model.loads import Force, LineLoad, tabulated
from anctmm.model.places import Place
from anctmm.model.scene import Scene
from anctmm.model.topology import GROUND, Sets, joined_bodies
from anctmm.results.status import Status

Array = NDArray[np.float64]


def never_balanced(scene: Scene) -> Status | None:
    """Status of a search for an equilibrium that cannot be, as the loads do work in a motion without end; or None."""
    acting = [c for c in scene.connectors if c.law is not None or c.stiffness != 0.0 or c.preload != 0.0]
    sets = Sets()
    for one, two in joined_bodies(scene, acting):
        if two is not GROUND:
            sets.unite(one, two)
    held, forces = defaultdict[str, list[Array]](list), defaultdict[str, list[Array]](list)
    for name, rows in _held(scene, acting):
        held[sets.of(name)].append(rows)
    for name, force in _forces(scene):
        forces[sets.of(name)].append(force)
    for names in sets.among(body.name for body in scene.bodies):
        one = sets.of(names[0])
        _, sizes, directions = np.linalg.svd(np.vstack([np.zeros((2, 2)), *held[one]]), full_matrices=False)
        free = directions[sizes <= 1e-12]
        along = np.round(free.T @ free, 12) @ np.sum(forces[one], axis=0)
        size = float(np.linalg.norm(along))
        if size > 1e-9 * float(np.linalg.norm(forces[one], axis=1).sum()):
            x, y = along / size + 0.0
            who = f"bodies {listed(names)}, which are connected, are"
            who = f"body {names[0]!r} is" if len(names) == 1 else who
            message = (
                f"no equilibrium found beyond 0 of the load: {who} free to move along ({x:.4g}, {y:.4g}) without end, "
                f"and a force of {size:.4g} N acts; a joint or a spring to the ground, or another load, is needed"
            )
            return Status("diverged", message, time=0.0, body=names[0])
    return None


def _held(scene: Scene, acting: Sequence[Connector]) -> Iterator[tuple[str, Array]]:
    """Bodies that the ground holds or a force follows, and the directions in which that is, as rows."""
    for joint in scene.joints:
        body = scene.place(joint.places[0]).body.name
        if joint.grounded:
            yield body, np.eye(2)
        if isinstance(joint, Guide) and joint.body is None:
            x, y = joint.direction
            yield body, np.array([[-y, x]]) if joint.position is None else np.eye(2)
    for connector in acting:
        first, second = ends_of(scene, connector)
        if not isinstance(second, Place) and not isinstance(connector, RotationalSpring):
            yield first.body.name, np.eye(2)
    for load in scene.loads:
        if isinstance(load, Force) and load.follower:
            yield scene.place(load.end).body.name, np.eye(2)


def _forces(scene: Scene) -> Iterator[tuple[str, Array]]:
    """Bodies and dead forces on them, N."""
    for body in scene.bodies:
        yield body.name, body.mass * np.array(scene.gravity)
    for load, value in zip(scene.loads, tabulated(scene.loads, np.zeros(1))[0], strict=True):
        if isinstance(load, LineLoad):
            yield load.body, scene.beam(load.body).length * value
        elif isinstance(load, Force):
            yield scene.place(load.end).body.name, value
