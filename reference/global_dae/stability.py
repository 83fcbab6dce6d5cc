"""Stability of explicit steps and of equilibria, from tangent and mass on the null space of the constraints."""

from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space
from scipy.sparse.linalg import LinearOperator, eigsh

from anctmm.errors import StabilityError
from reference.global_dae.elements import Matrix
from reference.global_dae.saddle import Saddle
from reference.global_dae.system import System

Array = NDArray[np.float64]

#: Part of the largest eigenvalue below which one is none; of J's singular values, below which a row is void.
NOTHING, VOID = 1e-11, 1e-10
#: Coordinates up to which dense eigenvalue solvers are used, and eigenvalues next to zero that are looked at beyond.
DENSE, NEAREST = 600, 6


class Stability(NamedTuple):
    """Negative eigenvalues among free motions; whether one is zero; the body that moves most, where it is known."""

    negative: int
    singular: bool
    body: str | None = None


def highest(system: System) -> tuple[float, float]:
    """Largest angular frequency of the undeformed scene, rad/s, and largest rate of damping, 1/s."""
    q, still = system.layout.reference, system.still
    K = system.tangents(q, still, 0.0)
    D = Matrix(system.tangents(q, still, 0.0, by_velocity=1.0) - K)
    return sqrt(max(_largest(system, K), 0.0)), max(_largest(system, D), 0.0)


def _largest(system: System, A: Matrix) -> float:
    """Largest eigenvalue of A x = λ M x among free motions."""
    q, M, p = system.layout.reference, system.mass, system.constraints.parameters(0.0)
    A = Matrix(0.5 * (A + A.T))
    if not A.nnz:
        return 0.0
    if system.size <= DENSE:
        Z = free_motions(system, q, p)
        return float(eigh(Z.T @ (A @ Z), Z.T @ (M @ Z), eigvals_only=True)[-1]) if Z.shape[1] else 0.0
    inverse = _constrained_inverse(M, system, q, p)
    start = inverse @ np.random.default_rng(0).standard_normal(system.size)
    options: Any = {"M": M, "Minv": inverse, "v0": start, "tol": 1e-8}
    return float(eigsh(A, 1, return_eigenvectors=False, **options)[0])


def check_step(system: System) -> None:
    """Refuse a step above the stability limit, by StabilityError."""
    run = system.run
    frequency, largest = largest_step(system)
    if run.dt > largest * (1.0 + 1e-9):
        raise StabilityError(
            f"dt is {run.dt!r} s; at most {largest:.6g} s is stable, for the highest frequency of scene "
            f"{system.layout.scene.name!r} as discretised is {frequency:.6g} rad/s (check_stability=False runs it all "
            f"the same)"
        )


def largest_step(system: System) -> tuple[float, float]:
    """Highest angular frequency, rad/s, and the largest stable step of Zhai's integrator, s.

    Without damping h ω is at most √(2/ψ) for ψ = φ ≥ ½. An oscillation about rest changes sign in a step at
    ½ψ(hω)² + (½ + φ)hc = 1, c the highest rate of damping.

    Raises
    ------
    StabilityError
        If no step is stable with its parameters.
    """
    run = system.run
    if not run.psi == run.phi >= 0.5:
        raise StabilityError(
            f"psi is {run.psi!r} and phi is {run.phi!r}; psi = phi >= 0.5 is needed; other pairs are unstable "
            f"at any step or have no larger stable step (check_stability=False runs it all the same)"
        )
    frequency, damping = highest(system)
    rate = (0.5 + run.phi) * damping
    both = rate + sqrt(rate * rate + 2.0 * run.psi * frequency**2)
    return frequency, 2.0 / both if both > 0.0 else inf


def free_motions(system: System, q: Array, p: Array) -> Array:
    """Z with J Z = 0, (size, free), of columns without a unit: the same for small and large scenes."""
    unit = system.layout.unit
    J = system.constraints.jacobian(q, p).toarray() * unit
    if not len(J):
        return np.diag(unit)
    sizes = np.linalg.norm(J, axis=1, keepdims=True)
    return np.asarray(unit[:, None] * null_space(J / np.where(sizes > 0.0, sizes, 1.0), rcond=VOID))


def stability(system: System, A: Matrix, q: Array, p: Array) -> Stability:
    """Stability of an equilibrium q by its tangent; of a large scene by the eigenvalues next to zero alone."""
    A = Matrix(0.5 * (A + A.T))
    if system.size > DENSE:
        inverse = _constrained_inverse(A, system, q, p)
        options: Any = {"M": system.mass, "sigma": 0.0, "OPinv": inverse, "v0": np.ones(system.size)}
        nearest = eigsh(A, NEAREST, return_eigenvectors=False, **options)
        return Stability(int((nearest < 0.0).sum()), False)
    Z = free_motions(system, q, p)
    if not Z.shape[1]:
        return Stability(0, False)
    B = Z.T @ (A @ Z)
    scale = np.abs(np.diagonal(B))
    scale = 1.0 / np.sqrt(np.where(scale > 0.0, scale, max(float(scale.max()), 1e-300)))
    values, modes = np.linalg.eigh(scale[:, None] * B * scale)
    nothing = NOTHING * max(float(np.abs(values).max()), 1e-300)
    place = int(np.abs((Z @ (scale * modes[:, 0])) / system.layout.unit).argmax())
    body = system.layout.owner(place)[0]
    return Stability(int((values < -nothing).sum()), bool((np.abs(values) <= nothing).any()), body)


def _constrained_inverse(A: Matrix, system: System, q: Array, p: Array) -> LinearOperator:
    """f ↦ x with A x + Jᵀλ = f and J x = 0."""
    saddle = Saddle(A, system.constraints.jacobian(q, p))
    none = np.zeros(system.constraints.count)
    return LinearOperator(A.shape, matvec=lambda f: saddle.solve(f, none)[0], dtype=float)
