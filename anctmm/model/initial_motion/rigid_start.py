"""Initial velocities of rigid motions that satisfy joints and drives, with the least kinetic energy."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.errors import JointGapError, SceneError, listed, shown, unknown_kind
from anctmm.model.bodies import BODIES, Beam, Body
from anctmm.model.checks.start import EQUAL, drive_rate
from anctmm.model.initial_motion.least_norm import MANY, least_norm
from anctmm.model.joints import Clamp, Guide, Pin, Prismatic, Slider, Weld, built_in, unknown_joint
from anctmm.model.places import Written
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Scene, checked_scene, scene_that_does_not_start
from anctmm.model.velocities import Point, RigidVelocity

Array = NDArray[np.float64]
Row = dict[int, float]
"""Factors of an equation by the numbers of what they multiply: vx, vy of the centre and spin, of each body."""

#: Bodies of which the rank of the joints' equations is found, at most: its cost grows with their cube.
FEW = 30


def consistent_velocities(scene: Scene | None = None, **parts: Any) -> Scene:
    """The scene with initial velocities of rigid motions that satisfy its joints and drives.

    A driven clamp that rotates at t = 0 sets the bodies that it holds in motion. If the joints leave some freedom, the
    kinetic energy is the smallest possible, as after a sudden start. Previous velocities of the bodies are replaced.

    Parameters
    ----------
    scene : Scene, optional
    **parts
        The arguments of `Scene` (name, bodies, joints, …) instead of a scene: `Scene` refuses rigid bodies whose
        velocities do not satisfy joints and drives.

    Returns
    -------
    Scene

    Raises
    ------
    JointGapError
        If no rigid motions satisfy them.
    SceneError
        If a scene is given beside parts of one.

    Examples
    --------
    >>> import anctmm as at
    >>> wheel = at.RigidBody("wheel", mass=1.0, inertia=0.1, center=(0, 0))
    >>> motor = at.Clamp("wheel.center", angle=lambda t: (2.0 * t, 2.0, 0.0))
    >>> at.consistent_velocities(name="motor", bodies=[wheel], joints=[motor]).body("wheel").spin
    2.0
    """
    if parts:
        if scene is not None:
            raise SceneError(
                f"scene is {shown(scene)} beside {listed(sorted(parts))}; a scene, or what it is made of, is allowed"
            )
        scene = scene_that_does_not_start(**parts)
    scene = checked_scene(scene)
    rows, rates = _rigid_constraints(scene)
    motion, missed = _least_motion(rows, rates, _scales(scene))
    if missed > EQUAL * float(np.abs(rates).max(initial=0.0)):
        raise JointGapError(
            f"scene {scene.name!r} has no velocities of rigid bodies that fit its joints and drives: the best "
            f"are off by {missed:.3g} m/s; flexible bodies need velocities of their own"
        )
    motions = motion.reshape(-1, 3).tolist()
    bodies = tuple(
        _moved(body, (vx, vy), spin) for body, (vx, vy, spin) in zip(scene.bodies, motions, strict=True)
    )
    return replace(scene, bodies=bodies)


def _least_motion(rows: Sequence[Row], rates: Array, scale: Array) -> tuple[Array, float]:
    """The motion of least kinetic energy that misses the rates least, and by how much, m/s."""
    sparse = _sparsely(rows, rates, scale) if len(rows) >= MANY else None
    if sparse is not None:
        return sparse
    A = _dense(rows, len(scale))
    # least norm of the motion times the root of its inertia: least kinetic energy
    motion = np.linalg.lstsq(A / scale, rates, rcond=None)[0] / scale
    return motion, float(np.abs(A @ motion - rates).max(initial=0.0))


def _sparsely(rows: Sequence[Row], rates: Array, scale: Array) -> tuple[Array, float] | None:
    """The same of many equations; None where these nearly depend on each other."""
    if not rates.any():
        return np.zeros(len(scale)), 0.0
    counts = [len(row) for row in rows]
    values = np.array([value for row in rows for value in row.values()])
    columns = np.array([column for row in rows for column in row], dtype=np.int64)
    at = np.repeat(np.arange(len(rows)), counts), columns
    A = scipy.sparse.csr_array((values, at), shape=(len(rows), len(scale)))
    mass = scipy.sparse.csc_array(scipy.sparse.diags_array(scale**2))
    found = least_norm(mass, A, rates)
    if found is not None and np.abs(found.left).max() > EQUAL * np.abs(rates).max():
        found = least_norm(mass, A, rates, scaled=False)  # equations count as they are written
    return None if found is None else (found.x, float(np.abs(found.left).max()))


def _dense(rows: Sequence[Row], size: int) -> Array:
    """Equations with their zeros: where they are few, they are there much sooner."""
    found = np.zeros((len(rows), size))
    for number, row in enumerate(rows):
        for column, value in row.items():
            found[number, column] = value
    return found


def _moved(body: Body, velocity: Point, spin: float) -> Body:
    """The body with a velocity of its centre and a spin."""
    match body:
        case Beam():
            rigid = RigidVelocity(body.start, body.end, _center(body), spin, velocity)
            return replace(body, velocity=rigid if any(velocity) or spin else None)
        case RigidBody():
            return replace(body, velocity=velocity, spin=spin)
        case PointMass():
            return replace(body, velocity=velocity)
        case _:
            raise unknown_kind("body", body, BODIES)


def _center(body: Body) -> Point:
    match body:
        case Beam():
            return 0.5 * (body.start[0] + body.end[0]), 0.5 * (body.start[1] + body.end[1])
        case RigidBody():
            return body.center
        case PointMass():
            return body.position
        case _:
            raise unknown_kind("body", body, BODIES)


def _root_inertias(body: Body) -> Array:
    """Roots of mass, mass and moment of inertia about the centre of a body, by its velocity and its spin."""
    match body:
        case Beam():
            inertia = body.mass * (body.length**2 / 12.0 + body.section.second_moment / body.section.area)
        case RigidBody():
            inertia = body.inertia
        case PointMass():
            inertia = body.mass  # it has no spin: any inertia will do
        case _:
            raise unknown_kind("body", body, BODIES)
    return np.sqrt([body.mass, body.mass, inertia])


def _scales(scene: Scene) -> Array:
    """The same of all bodies."""
    return np.concatenate([_root_inertias(body) for body in scene.bodies])


class _Rows:
    """Rows of the velocities of places, by the motions of all bodies."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.first = {body.name: 3 * i for i, body in enumerate(scene.bodies)}

    def at(self, body: Body, point: Point) -> tuple[Row, Row, Row]:
        """Velocity of a body at a point of the plane, and its spin."""
        (cx, cy), i = _center(body), self.first[body.name]
        return {i: 1.0, i + 2: cy - point[1]}, {i + 1: 1.0, i + 2: point[0] - cx}, {i + 2: 1.0}

    def of(self, written: Written) -> tuple[Row, Row, Row]:
        """The same of a place."""
        place = self.scene.place(written)
        return self.at(place.body, place.position)

    def extent(self, *places: Written) -> float:
        """The least of the bodies' extents, m, that makes a rate a velocity; 1 where there is none."""
        extents = [self.scene.place(place).body.extent for place in places]
        return min((extent for extent in extents if extent > 0.0), default=1.0)

    def guided(self, guide: Guide) -> list[tuple[Row, float]]:
        """Equations of a guide."""
        place, (x, y) = self.scene.place(guide.place), guide.direction
        rows = self.of(guide.place)
        if guide.body is not None:
            carried = self.at(self.scene.body(guide.body), place.position)
            rows = _less(rows[0], carried[0]), _less(rows[1], carried[1]), _less(rows[2], carried[2])
        found = [(_less(_times(x, rows[1]), _times(y, rows[0])), 0.0)]
        if guide.position is not None:
            found.append((_less(_times(x, rows[0]), _times(-y, rows[1])), drive_rate(guide)))
        if guide.holds_direction:
            found.append((_times(self.extent(guide.place), rows[2]), 0.0))
        return found


def _times(factor: float, row: Row) -> Row:
    return {column: factor * value for column, value in row.items()}


def _less(row: Row, other: Row) -> Row:
    found = dict(row)
    for column, value in other.items():
        found[column] = found.get(column, 0.0) - value
    return found


def _rigid_constraints(scene: Scene) -> tuple[list[Row], Array]:
    """Joints' equations for the velocities of rigid bodies (vx, vy of the centre, spin): rows and right sides, m/s."""
    of, found = _Rows(scene), list[tuple[Row, float]]()
    for body in scene.bodies:
        if isinstance(body, PointMass):
            found.append((of.at(body, body.position)[2], 0.0))
    for joint in built_in(scene.joints):
        rows = [of.of(end) for end in joint.ends]
        length = of.extent(*joint.ends)
        found += [(_less(other[k], rows[0][k]), 0.0) for other in rows[1:] for k in (0, 1)]
        if joint.grounded:
            found += [(row, 0.0) for row in rows[0][:2]]
        match joint:
            case Pin():
                pass
            case Weld():
                rate = length * drive_rate(joint)
                found += [(_times(length, _less(row[2], rows[0][2])), rate) for row in rows[1:]]
            case Clamp():
                found.append((_times(length, rows[0][2]), length * drive_rate(joint)))
            case Slider() | Prismatic():
                found += of.guided(joint)
            case _:
                raise unknown_joint(joint)
    return [row for row, _ in found], np.array([rate for _, rate in found])
