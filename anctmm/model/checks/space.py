"""Whether all of a scene has the same number of components, and in space only what is offered there.

In space are offered: cables with a circular section and without damping, clamped, pinned or free, rigid bodies, point
masses, pins (ball joints), revolute joints of rigid bodies, joints of a user's own, springs, forces, line loads and
gravity. All else is refused by name.
"""

from collections.abc import Iterable
from typing import Any

from anctmm.errors import ResultError, SceneError, UnsupportedError, shown
from anctmm.model.bodies import Beam
from anctmm.model.connectors import Spring
from anctmm.model.joints import JOINTS, Clamp, Pin, Revolute
from anctmm.model.loads import Force, LineLoad
from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.sections import Circle

#: Kinds that are of the plane alone are all others of this package.
IN_SPACE = (Pin, Clamp, Revolute, Force, LineLoad, Spring)


def check_dimension(scene: Any) -> None:
    """Refuse what does not fit the number of components of a scene's first body.

    Raises
    ------
    SceneError
        If a place or a vector has another number of components.
    UnsupportedError
        If something is not offered in space, or a revolute joint is in the plane.
    """
    dim = scene.dim
    for thing, count in _components(scene):
        if count != dim:
            raise SceneError(
                f"{shown(thing)} has {count} components; {dim} are needed, as body {scene.bodies[0].name!r} of scene "
                f"{scene.name!r} has"
            )
    if dim == 2:
        _refuse(
            (j for j in scene.joints if isinstance(j, Revolute)), "is for space; a Pin is one in the plane"
        )
        return
    built_in = [j for j in scene.joints if type(j) in JOINTS]
    things = [*built_in, *scene.loads, *scene.connectors]
    _refuse((x for x in things if not isinstance(x, IN_SPACE)), "is for the plane alone")
    for beam in scene.beams:
        _check_beam(beam)
    bending = (
        joint
        for joint in scene.joints
        if isinstance(joint, Revolute)
        and not all(isinstance(scene.place(end).body, RigidBody) for end in joint.ends)
    )
    _refuse(bending, "holds a place of another body; places of rigid bodies are allowed")
    clamps = (
        j for j in scene.joints if isinstance(j, Clamp) and (j.angle is not None or j.stretch == "free")
    )
    _refuse(clamps, "is in space; a fixed clamp that holds the stretch is allowed")
    followers = (load for load in scene.loads if isinstance(load, Force) and load.follower)
    _refuse(followers, "is a follower; forces of fixed direction are allowed in space")


def check_plane(scene: Any, what: str) -> None:
    """Refuse a result that is offered in the plane alone.

    Raises
    ------
    ResultError
        If the scene is in space.
    """
    if scene.dim == 3:
        raise ResultError(
            f"{what} are offered in the plane, and scene {scene.name!r} is in space; there are positions, velocities, "
            f"energies, reactions, tensions, saved files, and the `rotation` of rigid bodies"
        )


def _components(scene: Any) -> Iterable[tuple[Any, int]]:
    """Things with a number of components, and the number."""
    for body in scene.bodies:
        yield body, body.dim
    for load in scene.loads:
        if isinstance(load, Force | LineLoad) and not callable(load.value):
            yield load, len(load.value)
    for connector in scene.connectors:
        if isinstance(connector, Spring) and connector.ground is not None:
            yield connector, len(connector.ground)


def _check_beam(beam: Beam) -> None:
    """Refuse a beam that is not offered in space."""
    if not isinstance(beam.section, Circle):
        raise UnsupportedError(
            f"beam {beam.name!r} has section {shown(beam.section)}; a Circle is needed in space, whose bending does "
            f"not depend on torsion"
        )
    if beam.material.damping:
        raise UnsupportedError(
            f"beam {beam.name!r} has damping {beam.material.damping!r} s; 0 is needed in space"
        )


def _refuse(things: Iterable[Any], why: str) -> None:
    for thing in things:
        raise UnsupportedError(f"{shown(thing)} {why}")
