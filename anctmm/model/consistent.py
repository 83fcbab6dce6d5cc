"""Initial velocities of rigid motions that satisfy joints and drives, with the least kinetic energy."""

from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.errors import JointGapError, SceneError, listed, shown
from anctmm.model.bodies import Beam, Body
from anctmm.model.checks.conditions import axes_of, conditions_of
from anctmm.model.checks.start import EQUAL
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.scene import Scene, SceneToBeStarted, checked_scene
from anctmm.model.velocities import RigidVelocity, turned

Array = NDArray[np.float64]

#: Regularisation of equations whose rows have the length 1: a step leaves REGULARISED / (σ² + REGULARISED) of what a
#: singular value σ takes part in.
REGULARISED = 1e-10


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
                f"scene is {shown(scene)} beside {listed(sorted(parts))}; one of both is allowed"
            )
        scene = SceneToBeStarted(**parts)
    else:
        scene = checked_scene(scene, space=True)
    J, rates = _equations(scene)
    mass: Any = scipy.sparse.block_diag([_inertia(body, scene.dim) for body in scene.bodies], "csc")
    motion = least_norm(mass, J, rates)
    missed = float(np.abs(J @ motion - rates).max(initial=0.0))
    if missed > EQUAL * float(np.abs(rates).max(initial=0.0)):
        raise JointGapError(
            f"scene {scene.name!r} has no velocities of rigid bodies that fit its joints and drives: the best "
            f"are off by {missed:.3g}; flexible bodies need velocities of their own"
        )
    motions = motion.reshape(len(scene.bodies), -1)
    bodies = tuple(_moved(body, x, scene.dim) for body, x in zip(scene.bodies, motions, strict=True))
    return Scene(scene.name, bodies, scene.joints, scene.loads, scene.gravity, scene.connectors)


def _equations(scene: Scene) -> tuple[Any, Array]:
    """Conditions of all joints for the velocities of centres and spins of all bodies: matrix and right side."""
    width = scene.dim + _spins(scene.dim)
    number = {body.name: k for k, body in enumerate(scene.bodies)}
    conditions = [c for joint in scene.joints for c in conditions_of(scene, joint)]
    shape = sum(len(c.value) for c in conditions), width * len(scene.bodies)
    matrix, first = scipy.sparse.lil_array(shape), 0
    for condition in conditions:
        rows = slice(first, first + len(condition.value))
        for place, axis, J in condition.factors:
            at = width * number[place.body.name]
            matrix[rows, at : at + width] += J @ motion_of(place, axis)
        first = rows.stop
    return matrix.tocsr(), -np.concatenate([np.zeros(0), *(c.driven for c in conditions)])


def motion_of(place: Place, axis: int) -> Array:
    """Velocity of a place (0) or an axis by that of its body's centre and its spin, (dim, dim + spins)."""
    dim = len(place.position)
    moving = axes_of(place)[axis - 1] if axis else np.subtract(place.position, place.body.center)
    units: Any = [1.0] if dim == 2 else np.eye(3)
    turns = np.array([turned(unit, moving) for unit in units]).T
    return np.hstack([np.zeros((dim, dim)) if axis else np.eye(dim), turns])


def _spins(dim: int) -> int:
    return 1 if dim == 2 else 3


def _inertia(body: Body, dim: int) -> Array:
    """Mass and moments of inertia about the centre of a body, (dim + spins, dim + spins)."""
    moments: Any = body.mass * np.eye(_spins(dim))  # a point mass has no spin: any will do
    if isinstance(body, RigidBody):
        moments = np.atleast_2d(body.inertia)
    elif isinstance(body, Beam):
        along, radius = axes_of(Place(body, 0))[0], body.section.second_moment / body.section.area
        across = np.eye(dim) - np.outer(along, along) if dim == 3 else np.eye(1)
        moments = body.mass * (body.length**2 / 12.0 * across + radius * (2.0 * np.eye(_spins(dim)) - across))
    return np.asarray(scipy.linalg.block_diag(body.mass * np.eye(dim), moments))


def _moved(body: Body, motion: Array, dim: int) -> Body:
    """The body with a velocity of its centre and a spin."""
    velocity: Any = tuple(motion[:dim].tolist())
    spin: Any = float(motion[dim]) if dim == 2 else tuple(motion[dim:].tolist())
    if isinstance(body, Beam):
        rigid = RigidVelocity(body.start, body.end, body.center, spin, velocity)
        return replace(body, velocity=rigid if motion.any() else None)
    if isinstance(body, RigidBody):
        return replace(body, velocity=velocity, spin=spin)
    return replace(body, velocity=velocity)


def least_norm(mass: Any, A: Any, right: Array) -> Array:
    """The x of least xᵀ mass x for which |right − A x| is the least; equations may depend on each other.

    Each step solves the regularised equations of the last one's remainders: iterated Tikhonov regularisation (Björck,
    Numerical Methods for Least Squares Problems, 1996, 4.5). The matrix is quasi-definite and has factors in any order
    (Vanderbei, SIAM J. Optim. 5, 1995).
    """
    n = A.shape[1]
    if not right.any():
        return np.zeros(n)
    unit = scipy.sparse.diags_array(1.0 / np.sqrt(mass.diagonal()))
    lengths = np.sqrt(np.asarray((A @ unit).power(2).sum(axis=1)).ravel())
    rows = scipy.sparse.diags_array(1.0 / np.where(lengths > 0.0, lengths, 1.0))
    M, A, b = unit @ mass @ unit, rows @ A @ unit, np.asarray(rows @ right)
    whole = scipy.sparse.block_array([[M, A.T], [A, -REGULARISED * scipy.sparse.eye_array(len(b))]])
    factors = scipy.sparse.linalg.splu(whole.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0)
    x, multipliers = np.zeros(n), np.zeros(len(b))
    for _ in range(40):
        step = factors.solve(np.concatenate([-M @ x - A.T @ multipliers, b - A @ x]))
        x, multipliers = x + step[:n], multipliers + step[n:]
    return np.asarray(unit @ x)
