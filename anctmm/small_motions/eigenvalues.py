"""Rates λ and shapes of the lowest modes: dense matrices of small scenes, ARPACK by shift and invert of larger ones.

Without damping K x = −λ² M x. Otherwise (K + λ D + λ² M) x = 0 is solved in the form of Tisseur & Meerbergen 2001
(10.1137/S0036144500381988) by z = (x, λ x/ω); ω, of the order of the lowest frequency, makes both parts alike in size.
Both are inverted about a small shift, with which the matrix of a scene that is free to move is regular, and which keeps
the digits of low frequencies that those of the stiffest motions would take.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse
from scipy.sparse import linalg as iterative

from anctmm.errors import DiscretisationError, SolverError
from anctmm.small_motions.linearised import EPS, SmallMotions

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Product = Callable[[Any], Any]

#: Unknowns up to which constraints are eliminated by a basis of the motions that they allow; up to how many free
#: motions matrices are dense: symmetric ones, and the rows of others.
ELIMINATED, DENSE, DENSE_OTHERS = 1500, 400, 1200
#: Part of the largest of the constraints below which one repeats others.
REPEATED = 1e-10
#: In units of `SmallMotions.rounding`: squares that count as zero, and the shift.
NOISE, SHIFT = 30.0, 1e3
#: Shift of damped motions, in parts of the lowest square that is not zero; size beside its root that is zero.
SHIFTED, STILL = 0.01, 1e-3
#: Restarts of ARPACK for damped motions: beside hundreds of rates near −1/τ it ends with a part of them.
RESTARTS = 100
#: A shift, in the same units, that no stiffness asks for.
BEYOND = 1e28
#: Part of the size of a rate that is rounding: of its imaginary part; and of a real part, beside which nothing grows.
REAL, GROWING = 1e-9, 1e-6
#: Default number of modes; eigenvalues found beyond those asked for, so that none of a pair is left out.
USUAL, SPARE = 10, 8
#: A little more than 1, for shifts between eigenvalues.
ABOVE = 1.0 + 1e-6


def lowest(problem: SmallMotions, count: int | None) -> tuple[Complex, Complex]:
    """Rates λ of the lowest modes, with Im λ ≥ 0, in the order of `Modes`, and their displacements, (size, modes).

    Parameters
    ----------
    problem : SmallMotions
    count : int or None
        Number of modes; None: ten, or all if there are fewer.

    Raises
    ------
    DiscretisationError
        If there are not so many.
    SolverError
        If they are not found.
    """
    name = problem.system.scene.name
    motions = _Free(problem) if problem.size else None
    if motions is None or motions.count < 1:
        raise DiscretisationError(f"scene {name!r} has nothing that can move; it has no modes")
    free = motions.count
    most = (2 if problem.damped else 1) * free
    if count is not None and count > most:
        raise _too_many(name, count, most, free)
    wanted = min(count or USUAL, most)
    squares, shapes = _undamped(motions, wanted)
    still = squares == 0.0
    if problem.damped:
        lowest_square = np.abs(squares[~still]).min(initial=np.inf)
        shift = SHIFTED * lowest_square if np.isfinite(lowest_square) else SHIFT * problem.rounding
        asked = wanted + int((squares.real < 0.0).sum())
        rates, moving = _damped(motions, asked, int(still.sum()), np.sqrt(shift))
        rates = np.concatenate([np.zeros(still.sum()), rates])
        shapes = np.hstack([shapes[:, still], moving])
    else:
        rates = _rates(squares)
    order = _order(rates)[:wanted]
    if count is not None and len(order) < count:
        raise _too_many(name, count, len(order), free) if motions.dense else _lost(problem, count, len(order))
    return rates[order].astype(complex), motions.spread(shapes[:, order].astype(complex))


class _Free:
    """Motions that constraints allow: by a basis of them, or by multipliers beside all coordinates."""

    def __init__(self, problem: SmallMotions) -> None:
        self.problem, J = problem, problem.J
        weights = 1.0 / np.sqrt(problem.M.diagonal())
        sizes = np.sqrt(np.asarray(J.multiply(J) @ weights**2).ravel())
        self.J, self.Z = sparse.diags(1.0 / np.maximum(sizes, 1e-300)) @ J, sparse.diags(weights)  # units
        self.count = problem.size - J.shape[0]
        if problem.size <= ELIMINATED and J.shape[0]:
            Q, R, _ = linalg.qr((self.J @ sparse.diags(weights)).T.toarray(), pivoting=True)
            diagonal = np.abs(np.diag(R))
            rank = int((diagonal > REPEATED * diagonal.max(initial=0.0)).sum())
            self.Z, self.count = weights[:, None] * Q[:, rank:], problem.size - rank
        self._most = DENSE if problem.symmetric else DENSE_OTHERS
        if problem.damped:
            self._most = DENSE_OTHERS // 2

    @property
    def dense(self) -> bool:
        """Whether matrices are."""
        return self.problem.size <= ELIMINATED and self.count <= self._most

    def reduced(self, A: Any) -> Array:
        """A matrix of all coordinates as one of the free motions."""
        found: Any = self.Z.T @ (A @ self.Z)
        return np.asarray(found.toarray() if sparse.issparse(found) else found)  # type: ignore[attr-defined]

    def spread(self, x: Any) -> Any:
        """Displacements of all coordinates."""
        return self.Z @ x if self.dense else x

    def solver(self, P: Any, shift: float) -> Product:
        """Solves P x + Jᵀμ = f, J x = 0 for x; P is about K + shift · M."""
        solve, size = self.problem.solver(P, shift), self.problem.size
        rows = np.zeros(self.problem.J.shape[0])
        return lambda f: solve(np.concatenate([f, rows]))[:size]


def _undamped(motions: _Free, count: int) -> tuple[Any, Any]:
    """Squares −λ² of K x = −λ² M x and shapes of the lowest ones, ascending; all of small scenes."""
    shift = SHIFT * motions.problem.rounding
    squares, shapes = _shifted(motions, count, shift)
    held = squares != 0.0
    if held.all() or not held.any():
        return squares, shapes
    # with a small shift motions without stiffness take digits of others
    return _shifted(motions, count, max(shift, SHIFTED * float(np.abs(squares[held]).min())))


def _shifted(motions: _Free, count: int, shift: float) -> tuple[Any, Any]:
    """The same with a shift, or a larger one with which the stiffness is positive; 0 where nothing holds a motion."""
    problem = motions.problem
    while problem.symmetric and problem.negative(shift) > 0:
        shift *= 4.0
        if not shift < BEYOND * problem.rounding:
            raise SolverError(
                f"the stiffness of scene {problem.system.scene.name!r} has no digit that can be trusted: no multiple "
                f"of the mass makes it positive; bodies or springs of more similar stiffness are needed"
            )
    squares: Any
    x: Any
    if not problem.symmetric:
        squares, x = _unsymmetric(motions, count, shift)
    elif motions.dense:
        M = motions.reduced(problem.M)
        inverse, x = linalg.eigh(M, motions.reduced(problem.K) + shift * M)
        squares, x = 1.0 / inverse[::-1] - shift, x[:, ::-1]
    else:
        squares, x = _sparse(motions, count, shift)
    noise = NOISE * (problem.roundings(motions.spread(x)) + EPS * shift)
    return np.where(np.abs(squares) > noise, squares, 0.0), x


def _sparse(motions: _Free, count: int, shift: float) -> tuple[Array, Array]:
    """The same by ARPACK, until no square is missing that the inertia counts."""
    problem = motions.problem
    squares, shapes = np.zeros(0), np.zeros((problem.size, 0))
    missing = count
    while missing > 0:
        more, found = _softest(motions, missing, shift, shapes)
        if len(squares) and not more.min() < squares[count - 1]:
            break  # what the inertia counts is rounding
        squares, shapes = np.concatenate([squares, more]), np.hstack([shapes, found])
        order = np.argsort(squares)
        squares, shapes = squares[order], shapes[:, order]
        last = squares[count - 1]
        below = last - 1e-6 * abs(last) - NOISE * problem.rounding
        missing = problem.negative(-below) - int((squares < below).sum())
    return squares[:count], shapes[:, :count]


def _softest(motions: _Free, count: int, shift: float, known: Array) -> tuple[Array, Array]:
    """Squares and shapes that are orthogonal by the mass to those known."""
    problem, n = motions.problem, motions.problem.size
    solve, heavy = motions.solver(problem.K + shift * problem.M, shift), problem.M @ known

    def deflated(f: Array) -> Array:
        x = solve(f - heavy @ (known.T @ f))
        return np.asarray(x - known @ (heavy.T @ x))

    start = deflated(problem.M @ np.random.default_rng(known.shape[1]).standard_normal(n))
    inverse = iterative.LinearOperator((n, n), matvec=deflated, dtype=float)
    try:
        squares, shapes = iterative.eigsh(problem.K, count, problem.M, sigma=-shift, OPinv=inverse, v0=start)
    except iterative.ArpackNoConvergence as error:
        raise _lost(problem, count, len(error.eigenvalues)) from error
    return squares, shapes


def _unsymmetric(motions: _Free, count: int, shift: float) -> tuple[Any, Any]:
    """Squares of a stiffness that is not symmetric: two that have become one are a pair that grows and decays."""
    problem = motions.problem
    if motions.dense:
        M = motions.reduced(problem.M)
        inverse, x = linalg.eig(np.linalg.solve(motions.reduced(problem.K) + shift * M, M))
    else:
        solve = motions.solver(problem.K + shift * problem.M, shift)
        inverse, x = _largest(motions, lambda f: solve(problem.M @ f), problem.size, count + SPARE)
    order = np.argsort(-np.abs(inverse))
    return 1.0 / inverse[order] - shift, x[:, order]


def _largest(motions: _Free, product: Product, size: int, count: int) -> tuple[Any, Any]:
    """Largest eigenvalues of a product, and their vectors."""
    operator = iterative.LinearOperator((size, size), matvec=product, dtype=float)
    start = product(np.random.default_rng(0).standard_normal(size))
    try:
        return iterative.eigs(operator, min(count, size - 2), v0=start, maxiter=RESTARTS)  # type: ignore[no-any-return]
    except iterative.ArpackNoConvergence as error:  # what was not found may not be needed
        if not len(error.eigenvalues):
            raise _lost(motions.problem, count, 0) from error
        return error.eigenvalues, error.eigenvectors


def _damped(motions: _Free, count: int, still: int, s: float) -> tuple[Complex, Complex]:
    """λ, one of each pair of conjugates, and shapes; without the zeros of so many motions that need no force.

    s: shift of λ, 1/s, beside the lowest frequency.
    """
    problem = motions.problem
    least = max(np.sqrt(NOISE * problem.rounding), STILL * s)
    if motions.dense:
        M, D, K = map(motions.reduced, (problem.M, problem.D, problem.K))
        one, P = np.eye(len(M)), linalg.lu_factor(K + s * D + s * s * M)
        lost, heavy = linalg.lu_solve(P, D + s * M), linalg.lu_solve(P, M)
        scale = 1.0 / np.sqrt(np.abs(heavy).max())
        inverse, z = linalg.eig(np.block([[-lost, -scale * heavy], [(one - s * lost) / scale, -s * heavy]]))
    else:
        M, D, solve = (
            problem.M,
            problem.D,
            motions.solver(problem.K + s * problem.D + s * s * problem.M, s * s),
        )
        x = solve(M @ np.random.default_rng(0).standard_normal(problem.size))
        scale = float(np.sqrt(np.linalg.norm(x) / np.linalg.norm(solve(M @ x))))

        def product(z: Array) -> Array:
            u, v = np.split(z, 2)
            x = -solve(D @ u + M @ (s * u + scale * v))
            return np.concatenate([x, (u + s * x) / scale])

        inverse, z = _largest(motions, product, 2 * problem.size, 2 * count + SPARE)
    order = np.argsort(-np.abs(inverse))
    rates, shapes = s + 1.0 / inverse[order], z[: len(z) // 2, order]
    zeros = np.argsort(np.abs(rates))[: 2 * still]
    kept = (rates.imag > REAL * np.abs(rates)) | (np.abs(rates.imag) <= REAL * np.abs(rates))
    kept[zeros[np.abs(rates[zeros]) < least]] = False
    return rates[kept], shapes[:, kept]


def _rates(squares: Any) -> Complex:
    """λ of λ² = −ω², with Im λ ≥ 0: of two conjugate ω² one is of a λ that grows, the other of one that decays."""
    squares = np.where(np.abs(squares.imag) <= REAL * np.abs(squares), squares.real, squares)
    found = np.sqrt(0.0 - squares.astype(complex))
    return np.where(found.imag < 0.0, -found, found)


def _order(rates: Complex) -> NDArray[np.int64]:
    """That of modes: what grows, the fastest first; what swings or stays, by |λ|; what decays without swinging."""
    sizes = np.abs(rates)
    grow = rates.real > GROWING * sizes
    decay = (np.abs(rates.imag) <= REAL * sizes) & (rates.real < 0.0)
    kind = np.where(grow, 0, np.where(decay, 2, 1))
    return np.lexsort((np.where(grow, -rates.real, sizes), kind))


def _too_many(name: str, count: int, most: int, free: int) -> DiscretisationError:
    return DiscretisationError(
        f"count is {count}; scene {name!r} has {free} free motion{'s' * (free > 1)}: at most {most} "
        f"mode{'s are' if most > 1 else ' is'} allowed"
    )


def _lost(problem: SmallMotions, count: int, found: int) -> SolverError:
    return SolverError(
        f"the {count} lowest modes of scene {problem.system.scene.name!r} did not converge ({found} were found); "
        f"fewer may help"
    )
