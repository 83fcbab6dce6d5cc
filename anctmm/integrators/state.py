"""What the steps of all integrators work on."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.by_address import by_address
from anctmm.system.body_meshes import RigidMesh, SpatialMesh
from anctmm.system.mesh import Mesh
from anctmm.system.system import System
from anctmm.validation import EPS

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@by_address
class State(NamedTuple):
    """Coordinates of all nodes and what belongs to them, for kernels; each (rows, nodes).

    Parameters
    ----------
    q, v, w : ndarray
        Coordinates, velocities and accelerations: w satisfies the equations of motion.
    a : ndarray
        Accelerations of the formulas of generalized-α, which are means of w.
    base, rate, before : ndarray
        Of an implicit step: coordinates and velocities at its end without the part of w, and w at its start.
    f : ndarray
        Forces, and then the residual.
    scratch : ndarray
    counts : ndarray of int, shape (4,)
        Newton corrections and factorizations; whether the matrix is to be renewed; corrections of the last solution.
    limits : ndarray of int, shape (3,)
        Corrections of a solution at most, how often it is tried, and how many of its corrections may grow.
    sizes : ndarray, shape (ITERATIONS,)
        Corrections of the last solution, times `unit`.
    unit : ndarray
        What corrections are compared by: 1 over the length of the scene (1/m) for positions, 1 for others.
    weight : ndarray
        Of a component in errors: 1 of positions, the radius of gyration (m) of an axis of a rigid body, 0 of the
        gradients of a beam.
    scale : ndarray, shape (2,)
        Length that corrections of positions are compared with, m, and the bound of the last correction.
    """

    q: Array
    v: Array
    w: Array
    a: Array
    base: Array
    rate: Array
    before: Array
    f: Array
    scratch: Array
    counts: Ints
    limits: Ints
    sizes: Array
    unit: Array
    weight: Array
    scale: Array


#: Newton corrections of a solution at most. With a tolerance they are fewer, and only one of them may grow: many may
#: lead to a solution far from the motion, and a shorter step can be tried instead.
ITERATIONS, FEW = 30, 10
#: Error that Newton's corrections of all fixed steps may leave: that of one lasts as a velocity, so that they add up by
#: the square of their number; and roundings of a position below which no bound lies.
ADDED, ROUNDINGS = 1e-4, 64


def new_state(system: System, q: Array, v: Array) -> State:
    """The state that a run starts from."""
    zeros: Any = [np.zeros_like(q) for _ in range(7)]
    limits = (ITERATIONS, 2, ITERATIONS) if system.run.tolerance is None else (FEW, 1, 1)
    return State(  # type: ignore[call-arg]
        q.copy(), v.copy(), *zeros, np.zeros(4, np.int64), np.array(limits, dtype=np.int64), np.zeros(ITERATIONS),
        system.mesh.units, _weights(system.mesh), np.array([system.scene.length, _bound(system, q)]),
    )  # fmt: skip


def _bound(system: System, q: Array) -> float:
    """Bound of the last correction."""
    run = system.run
    if run.newton_given or run.tolerance is not None:
        return float(run.newton_tolerance)
    far = float(np.abs(q[system.mesh.lengths]).max()) / system.scene.length
    return min(float(run.newton_tolerance), max(ADDED / run.steps**2, ROUNDINGS * EPS * max(1.0, far)))


def _weights(mesh: Mesh) -> Array:
    """`State.weight`."""
    found = {}
    for name, body in mesh.bodies.items():
        weight = np.zeros((body.nodes, body.vectors, mesh.dim))
        weight[:, 0] = 1.0
        if isinstance(body, RigidMesh):
            weight[:, 1] = np.sqrt(body.inertia / body.mass) if body.anchors is None else 1.0
        elif isinstance(body, SpatialMesh):
            axes = np.sqrt(np.maximum(0.0, body.second_moments) / body.body.mass)
            weight[:] = np.array([1.0, *axes]).reshape(2, 2, 1)
        found[name] = weight
    return mesh.flat(found)
