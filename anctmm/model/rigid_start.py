"""Initial velocities that fit joints and drives: those of rigid bodies, with the least kinetic energy."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import JointGapError, unknown_kind
from anctmm.model.bodies import Beam
from anctmm.model.joints import JOINTS, Clamp, Pin, Weld
from anctmm.model.scene import Scene, checked_scene
from anctmm.model.start import EQUAL, turning_rate
from anctmm.model.velocities import Point, RigidVelocity

Array = NDArray[np.float64]


def consistent_velocities(scene: Scene) -> Scene:
    """The scene with initial velocities that fit its joints and drives, each body moving as a rigid one.

    A driven clamp that turns at t = 0 sets what it holds in motion. Where joints leave freedom, the kinetic energy is
    the least, as after a sudden start. Velocities that bodies had are replaced.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Scene

    Raises
    ------
    JointGapError
        If bodies would have to bend at once.
    """
    rows, rates = _rigid_constraints(checked_scene(scene))
    scale = np.concatenate([_root_inertias(body) for body in scene.bodies])
    # least norm of the motion times the root of its inertia: least kinetic energy
    motion = np.linalg.lstsq(rows / scale, rates, rcond=None)[0] / scale
    missed = float(np.abs(rows @ motion - rates).max(initial=0.0))
    if missed > EQUAL * float(np.abs(rates).max(initial=0.0)):
        raise JointGapError(
            f"scene {scene.name!r} has no velocities of rigid bodies that fit its joints and drives: {missed:.3g} m/s "
            f"are missed; bodies that bend need velocities of their own"
        )
    bodies = []
    for body, (vx, vy, spin) in zip(scene.bodies, motion.reshape(-1, 3).tolist(), strict=True):
        rigid = RigidVelocity(body.start, body.end, _center(body), spin, (vx, vy))
        bodies.append(replace(body, velocity=rigid if vx or vy or spin else None))
    return replace(scene, bodies=tuple(bodies))


def _center(body: Beam) -> Point:
    return 0.5 * (body.start[0] + body.end[0]), 0.5 * (body.start[1] + body.end[1])


def _root_inertias(body: Beam) -> Array:
    """Roots of mass, mass and moment of inertia about the centre of a body, by its velocity and its spin."""
    line = body.material.density * body.section.area * body.length
    inertia = line * (body.length**2 / 12.0 + body.section.second_moment / body.section.area)
    return np.sqrt([line, line, inertia])


def _rigid_constraints(scene: Scene) -> tuple[Array, Array]:
    """Joints' equations for the velocities of rigid bodies (vx, vy of the centre, spin): rows and right sides, m/s."""
    place = {body.name: 3 * i for i, body in enumerate(scene.bodies)}
    size = 3 * len(scene.bodies)

    def of_end(name: str) -> Array:
        """(3, size): velocity of an end, and the spin times the body's length."""
        body, side = scene.body_end(name)
        (x, y), (cx, cy), rows = (body.start, body.end)[side], _center(body), np.zeros((3, size))
        i = place[body.name]
        rows[0, i], rows[0, i + 2] = 1.0, cy - y
        rows[1, i + 1], rows[1, i + 2] = 1.0, x - cx
        rows[2, i + 2] = body.length
        return rows

    found: list[tuple[Array, float]] = []
    for joint in scene.joints:
        rows = [of_end(end) for end in joint.ends]
        lengths = [scene.body_end(end)[0].length for end in joint.ends]
        found += [(row, 0.0) for other in rows[1:] for row in other[:2] - rows[0][:2]]
        if joint.grounded:
            found += [(row, 0.0) for row in rows[0][:2]]
        match joint:
            case Pin():
                pass
            case Weld():
                spins = [row[2] / length for row, length in zip(rows, lengths, strict=True)]
                found += [(min(lengths) * (spin - spins[0]), 0.0) for spin in spins[1:]]
            case Clamp():
                found.append((rows[0][2], turning_rate(joint) * lengths[0]))
            case _:
                raise unknown_kind("joint", joint, JOINTS)
    return np.array([row for row, _ in found]).reshape(-1, size), np.array([rate for _, rate in found])
