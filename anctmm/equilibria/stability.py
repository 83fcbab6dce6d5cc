"""Whether an equilibrium is stable: by the lowest eigenvalues of K x = λ M x in motions that keep the rows.

An eigenvalue counts as zero where x·K x is no more than the rounding of the sum. Forces without a potential, and laws
that give energy to a motion, may make motions grow that swing: there the rates of M ẍ + C ẋ + K x = 0 decide, of all
motions up to some hundred unknowns, and of the softest ones beyond.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from anctmm.equilibria.balance import Balance, Configuration, Tangent
from anctmm.validation import EPS

Array = NDArray[np.float64]

#: Unknowns up to which all motions are found, of those with rates, and the softest ones that are looked at beyond.
DENSE, RATES, SOFTEST, LOWEST = 1_500, 600, 100, 6
#: Part of the sum of absolute terms of x·K x that is its rounding, for coordinates of the scene's size.
ROUNDING = 16.0 * EPS
#: Part of the largest eigenvalue that the rounding of multipliers gives motions that nothing holds.
NOTHING = 1e-20
#: Size of a row beside the others of a triangular matrix, of rows of size 1, below which it repeats them.
REPEATED = 1e-9
#: Real or imaginary part of a rate that is no rounding; relative step of velocities for derivatives of forces.
COMPLEX, STEP = 1e-6, 1e-6


@dataclass(frozen=True)
class Stability:
    """What is known of an equilibrium.

    Parameters
    ----------
    kind : str
        "stable"; "unstable"; or "singular": a motion needs no force there.
    negative : int
        Directions in which the energy falls.
    motion : ndarray, shape (unknowns,)
        The one in which the energy grows least, of size 1, towards positive y (or x).
    flutter : bool
        Whether oscillations grow.
    """

    kind: Literal["stable", "unstable", "singular"]
    negative: int
    motion: Array
    flutter: bool = False


def stability_of(balance: Balance, at: Configuration, factor: float) -> Stability:
    """Stability of an equilibrium under a part of the loads."""
    tangent = Tangent(balance, at, factor)
    motions = _all(tangent) if balance.size <= DENSE else _lowest(tangent, LOWEST)
    if not motions.shape[1]:
        return Stability("stable", 0, np.zeros(balance.size))
    values, noise = _energies(tangent, motions)
    negative = int((values < -noise).sum())
    motion = _signed(balance, motions[:, 0])
    if balance.conservative and negative:
        return Stability("unstable", negative, motion)
    if balance.conservative and (values <= noise).any():
        return Stability("singular", 0, motion)
    if not balance.conservative or balance.tables.acting.law.any():
        return _by_rates(tangent, motions)
    return Stability("stable", 0, motion)


def _energies(tangent: Tangent, motions: NDArray[Any]) -> tuple[Array, Array]:
    """x·K x of motions, and its rounding."""
    balance = tangent.balance
    values = (motions.conj() * (tangent.K @ motions)).sum(axis=0)
    far = 1.0 + float(np.abs(tangent.at.q * balance.weight).max())
    noise = far * ROUNDING * (abs(motions) * (abs(tangent.K) @ abs(motions))).sum(axis=0)
    noise += NOTHING * balance.largest_square * (motions.conj() * (balance.mass @ motions)).sum(axis=0).real
    return np.where(np.abs(values.imag) > noise, np.abs(values), values.real), noise


def _all(tangent: Tangent) -> Array:
    """All motions that keep the rows, the one of the lowest eigenvalue first, (unknowns, motions)."""
    J = tangent.J.toarray()
    K, M = (0.5 * (A + A.T).toarray() for A in (tangent.K, tangent.balance.mass))
    if not len(J):
        return np.asarray(scipy.linalg.eigh(K, M)[1])
    basis = _null_space(J)
    if not basis.shape[1]:
        return basis
    return np.asarray(basis @ scipy.linalg.eigh(basis.T @ K @ basis, basis.T @ M @ basis)[1])


def _null_space(J: Array) -> Array:
    """An orthonormal basis of the motions that keep rows, (unknowns, motions)."""
    size = np.linalg.norm(J, axis=1)
    J = J[size > 0.0] / size[size > 0.0, None]
    Q, R, _ = scipy.linalg.qr(J.T, pivoting=True)
    rank = int((np.abs(np.diag(R)) > REPEATED).sum())
    return np.asarray(Q[:, rank:])


def _lowest(tangent: Tangent, count: int) -> Array:
    """The motions of the lowest eigenvalues, the lowest first, (unknowns, count): by inverse iteration from below."""
    balance = tangent.balance
    shift = positive_shift(balance, tangent.at, tangent.factor)
    shifted = Tangent(balance, tangent.at, tangent.factor, shift)
    inverse = LinearOperator((balance.size,) * 2, matvec=lambda f: shifted.solve(f.ravel())[0])
    start = inverse @ np.random.default_rng(0).standard_normal(balance.size)
    K = 0.5 * (tangent.K + tangent.K.T)
    values, shapes = eigsh(K, count, balance.mass, sigma=-shift, OPinv=inverse, v0=start)
    return np.asarray(shapes[:, np.argsort(values)])


def positive_shift(balance: Balance, at: Configuration, factor: float) -> float:
    """A shift μ, 1/s², with which K + μ M is positive definite, at most ten times too large."""
    shift = balance.least_shift
    while Tangent(balance, at, factor, shift).negative:
        shift *= 10.0
    return shift


def _signed(balance: Balance, x: Array) -> Array:
    """A motion of size 1 whose largest displacement is towards positive y, or x."""
    moved = balance.spread(x / balance.sizes(x).max())
    sizes = np.abs(moved[: balance.mesh.dim] * balance.weight[: balance.mesh.dim]).max(axis=0)
    node = int(np.argmax(sizes > 0.999 * sizes.max()))
    along = moved[1, node] if abs(moved[1, node]) > 1e-6 * np.abs(moved[:2, node]).max() else moved[0, node]
    return x / balance.sizes(x).max() * (1.0 if along >= 0.0 else -1.0)


def _by_rates(tangent: Tangent, motions: Array) -> Stability:
    """Stability by the rates of small motions M ẍ + C ẋ + K x = 0."""
    balance = tangent.balance
    if balance.size > RATES:
        motions = _lowest(tangent, SOFTEST)
    M, K = motions.T @ (balance.mass @ motions), motions.T @ (tangent.K @ motions)
    lower, n = np.linalg.solve(M, K), len(M)
    if balance.tables.damped[0]:
        C = motions.T @ np.stack([_resisting(tangent, x) for x in motions.T], axis=1)
        damped = np.block([[np.zeros((n, n)), np.eye(n)], [-lower, -np.linalg.solve(M, C)]])
        rates, shapes = np.linalg.eig(damped)
    else:
        values, shapes = np.linalg.eig(lower)
        values = np.where(np.abs(values.imag) > COMPLEX * np.abs(values), values, values.real)
        rates = np.sqrt(-values.astype(complex))  # one of each pair ±
    shapes = motions @ shapes[:n]
    energy, noise = _energies(tangent, shapes[:, [int(np.argmin(np.abs(rates)))]])
    grows = rates.real > COMPLEX * np.abs(rates)
    nearest = int(np.argmin(np.where(grows | ~grows.any(), np.abs(rates), np.inf)))
    shape = shapes[:, nearest]
    motion = _signed(balance, np.real(shape / shape[np.argmax(np.abs(shape))]))
    if abs(energy[0]) <= noise[0]:
        return Stability("singular", 0, motion)
    if not grows.any():
        return Stability("stable", 0, motion)
    leaves = grows & (np.abs(rates.imag) <= COMPLEX * np.abs(rates))
    return Stability("unstable", int(grows.sum()), motion, flutter=not leaves.any())


def _resisting(tangent: Tangent, x: Array) -> Array:
    """C x: what forces lose by velocities x."""
    balance = tangent.balance
    step = STEP / balance.sizes(x).max()
    ahead, back = (
        balance.residual(tangent.at, tangent.factor, sign * step * balance.spread(x))[0]
        for sign in (1.0, -1.0)
    )
    return (back - ahead) / (2.0 * step)
