"""Stability limit of the explicit integrator, from the highest frequency of the linearised scene."""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import ArpackError, ArpackNoConvergence, LinearOperator, eigsh

from anctmm.elimination.factor import solve
from anctmm.errors import StabilityError
from anctmm.system.assembled import assembled, coordinates_of
from anctmm.system.calls import factorize_matrix
from anctmm.system.equations import set_matrix, set_residual
from anctmm.system.system import System

Array = NDArray[np.float64]

#: Relative accuracy of a frequency, and coordinates up to which Lanczos has too few directions.
ACCURACY, FEW = 1e-6, 3


def zhai_limit(psi: float, phi: float) -> float:
    """Largest stable Δt·ω_max of undamped motion: √(2/ψ) for ψ = φ ≥ ½; 0 for all others, which are refused.

    Some of those have smaller limits, and none a larger one than ½, ½.
    """
    return sqrt(2.0 / psi) if psi == phi and psi >= 0.5 else 0.0


def step_limit(psi: float, phi: float, frequency: float, rate: float = 0.0) -> float:
    """Largest stable step of a mode q̈ + c q̇ + ω² q = 0, s: the h with ½ψ ω²h² + (½ + φ) c h = 1, where q turns sign.

    Parameters
    ----------
    psi, phi : float
        Equal and at least ½.
    frequency, rate : float
        ω, rad/s, and c, 1/s; c = τω² with Kelvin-Voigt damping.
    """
    a, b = 0.5 * psi * frequency**2, (0.5 + phi) * rate
    return 2.0 / (b + sqrt(b * b + 4.0 * a)) if a > 0.0 or b > 0.0 else inf


def element_bound(system: System) -> float:
    """Largest frequency of any single free element, an upper bound of that of all (Irons & Treharne 1971), rad/s."""
    return max((mesh.element.highest_frequency for mesh in system.mesh.beams), default=0.0)


def highest_frequency(system: System, q: Array, damping: bool = False) -> float:
    """Largest ω of K x = ω² M x about coordinates q, rad/s; with `damping` that of the damping matrix in place of K."""
    places = coordinates_of(system)
    if not len(places):
        return 0.0
    K, M = (
        _matrix(system, q, 0.0, float(not damping), float(damping))[places][:, places],
        _matrix(system, q, 1.0, 0.0, 0.0)[places][:, places],
    )
    factorize_matrix(system.size, system.tables)
    matrix = system.tables.matrix

    def divided(f: Array) -> Array:
        """M⁻¹ f among the motions that the rows allow."""
        matrix.unknowns[:] = 0.0
        matrix.unknowns[places] = np.asarray(f).ravel()
        solve(system.size, matrix.plan, matrix.values, matrix.x)
        return matrix.unknowns[places].copy()

    n = len(places)
    if n <= FEW or len(system.numbering.rows):
        columns = np.stack([divided(column) for column in K.toarray()], axis=1)
        return sqrt(max(0.0, float(np.real(np.linalg.eigvals(columns)).max())))
    start = np.random.default_rng(0).standard_normal(n)
    if not np.any(K @ start):  # as without damping
        return 0.0
    inverse = LinearOperator((n, n), matvec=divided, dtype=float)
    try:
        value = eigsh(K, 1, M, Minv=inverse, which="LM", v0=start, tol=ACCURACY, return_eigenvectors=False)[0]
    except ArpackNoConvergence as error:
        value = max(error.eigenvalues, default=0.0)
    return sqrt(max(float(value), 0.0))


def _matrix(system: System, q: Array, mass: float, stiffness: float, damping: float):  # type: ignore[no-untyped-def]
    inputs = system.inputs(np.zeros(1))
    still = np.zeros_like(q)
    set_residual(system.space, system.tables, q, still, still, inputs, 0, np.zeros_like(q))
    set_matrix(system.size, system.space, system.tables, q, still, inputs, 0, mass, stiffness, damping)
    return assembled(system)


def largest_step(system: System, q: Array) -> float:
    """Largest stable step about coordinates q, s; infinite if it is unknown."""
    run = system.run
    if zhai_limit(run.psi, run.phi) == 0.0 or not np.isfinite(q).all():
        return inf
    try:
        return step_limit(run.psi, run.phi, highest_frequency(system, q), highest_rate(system, q))
    except (ArpackError, np.linalg.LinAlgError):
        return inf


def highest_rate(system: System, q: Array) -> float:
    """Largest rate c of decay by damping in q̈ + c q̇ + …, 1/s; 0 without damping."""
    return highest_frequency(system, q, damping=True) ** 2 if system.tables.damped[0] else 0.0


def check_step(system: System, q: Array, preloaded: bool) -> None:
    """Refuse a step above the stability limit.

    Raises
    ------
    StabilityError
        Naming the step and the largest one allowed.
    """
    run = system.run
    if zhai_limit(run.psi, run.phi) == 0.0:
        raise StabilityError(
            f"psi is {run.psi!r} and phi is {run.phi!r}; psi = phi >= 0.5 is needed; other pairs are unstable "
            f"at any step or have no larger stable step (check_stability=False runs it all the same)"
        )
    plain = not (preloaded or system.scene.connectors or system.tables.damped[0])
    if plain and run.dt <= step_limit(run.psi, run.phi, element_bound(system)):
        return
    frequency, rate = highest_frequency(system, q), highest_rate(system, q)
    limit = step_limit(run.psi, run.phi, frequency, rate)
    if run.dt > limit:
        also = f", its highest rate of damping {rate:.6g} 1/s" if rate > 0.0 else ""
        raise StabilityError(
            f"dt is {run.dt!r} s; at most {limit:.6g} s is stable: the highest frequency of scene "
            f"{system.scene.name!r} as discretised is {frequency:.6g} rad/s{also} "
            f"(check_stability=False runs it all the same)"
        )
