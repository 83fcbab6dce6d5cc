"""Stability of explicit steps and of equilibria, from the tangent on the null space of the constraints."""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space

from anctmm.errors import StabilityError
from reference.global_dae.mechanisms.system import System
from reference.global_dae.stability import limit

Array = NDArray[np.float64]

#: Part of the largest eigenvalue below which one is none; of J's singular values, below which a row is void.
NOTHING, VOID = 1e-11, 1e-10


def free_motions(system: System, q: Array, p: Array) -> Array:
    """Z with J Z = 0, (size, free), of columns without a unit: the same for small and large scenes."""
    unit = system.layout.unit
    J = system.constraints.jacobian(q, p) * unit
    if not len(J):
        return np.diag(unit)
    sizes = np.linalg.norm(J, axis=1, keepdims=True)
    return unit[:, None] * null_space(J / np.where(sizes > 0.0, sizes, 1.0), rcond=VOID)


def highest(system: System) -> tuple[float, float]:
    """Largest angular frequency of the undeformed scene, rad/s, and largest rate of damping, 1/s."""
    q, still = system.layout.reference, system.still
    Z = free_motions(system, q, system.constraints.parameters(0.0))
    if not Z.shape[1]:
        return 0.0, 0.0
    K, D = system.tangents(q, still, 0.0)
    D = D + system.elastic.viscous().toarray()
    M = Z.T @ (system.elastic.mass @ Z)

    def largest(A: Array) -> float:
        A = Z.T @ (0.5 * (A + A.T)) @ Z
        n = len(A)
        return max(0.0, float(eigh(A, M, eigvals_only=True, subset_by_index=[n - 1, n - 1])[0]))

    return sqrt(largest(K)), largest(D)


def check_step(system: System) -> None:
    """Refuse a step above the stability limit.

    Raises
    ------
    StabilityError
        Naming the step and the largest one allowed.
    """
    run = system.layout.run
    if limit(run.psi, run.phi) == 0.0:
        raise StabilityError(
            f"psi is {run.psi!r} and phi is {run.phi!r}; psi = phi >= 0.5 is needed; other pairs are unstable "
            f"at any step or have no larger stable step (check_stability=False runs it all the same)"
        )
    frequency, damping = highest(system)
    # an oscillation about rest changes sign in a step at ½ψ(hω)² + (½ + φ)hc = 1, c the highest rate of damping
    rate = (0.5 + run.phi) * damping
    both = rate + sqrt(rate * rate + 2.0 * run.psi * frequency**2)
    largest = 2.0 / both if both > 0.0 else inf
    if run.dt > largest * (1.0 + 1e-9):
        raise StabilityError(
            f"dt is {run.dt!r} s; at most {largest:.6g} s is stable, for the highest frequency of scene "
            f"{system.layout.scene.name!r} as discretised is {frequency:.6g} rad/s (check_stability=False runs it all "
            f"the same)"
        )


def signs(system: System, A: Array, q: Array, p: Array) -> tuple[int, bool, int]:
    """Negative eigenvalues of a tangent among free motions, whether one is none, and where the lowest one moves."""
    Z = free_motions(system, q, p)
    if not Z.shape[1]:
        return 0, False, -1
    A = Z.T @ (0.5 * (A + A.T)) @ Z
    scale = np.abs(np.diagonal(A))
    scale = 1.0 / np.sqrt(np.where(scale > 0.0, scale, max(float(scale.max()), 1e-300)))
    values, modes = np.linalg.eigh(scale[:, None] * A * scale)
    nothing = NOTHING * max(float(np.abs(values).max()), 1e-300)
    where = int(np.abs((Z @ (scale * modes[:, 0])) / system.layout.unit).argmax())
    return int((values < -nothing).sum()), bool((np.abs(values) <= nothing).any()), where
