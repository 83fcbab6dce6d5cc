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
from anctmm.small_motions.linearised import SmallMotions
from anctmm.validation import EPS

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Product = Callable[[Any], Any]

#: Unknowns of dense matrices at most.
DENSE = 1200
#: Part of the largest of the constraints below which one repeats others.
REPEATED = 1e-10
#: Squares that count as zero, in roundings; shift, in roundings, and in parts of the lowest square that is not zero.
NOISE, SHIFT, SHIFTED = 30.0, 1e3, 0.01
#: Part of the size of a rate that is rounding of its imaginary part.
REAL = 1e-9
#: Part of the size of a rate, with the other sign a damping, beyond which a motion grows.
GROWING = 1e-6
#: Eigenvalues found beyond those asked for, so that none of a pair is left out.
SPARE = 8


def lowest(problem: SmallMotions, count: int | None) -> tuple[Complex, Complex]:
    """Rates λ of the lowest modes, with Im λ ≥ 0, in the order of `Modes`, and their displacements, (size, modes).

    `count`: number of modes; None: ten, or all if there are fewer. DiscretisationError if there are not so many,
    SolverError if they are not found.
    """
    name, each = problem.system.scene.name, 2 if problem.damped else 1
    dense = each * problem.size <= DENSE
    space = (_Dense if dense else _Sparse)(problem) if problem.size else None
    if space is None or space.count < 1:
        raise DiscretisationError(f"scene {name!r} has nothing that can move; it has no modes")
    most = each * space.count
    if count is not None and count > most:
        raise _too_many(space, count, most)
    wanted = min(count or 10, most)
    squares, shapes = _squares(space, wanted)
    rates = _rates(squares)
    if problem.damped:
        rates, shapes = _damped(space, wanted, squares, shapes)
    order = _order(rates)[:wanted]
    if not len(order) or (count is not None and len(order) < count):
        raise _too_many(space, wanted, len(order)) if dense else _lost(problem, wanted, len(order))
    return rates[order].astype(complex), space.spread(shapes[:, order].astype(complex))


class _Dense:
    """Free motions by a basis of those that constraints allow, in units of the root of the mass."""

    def __init__(self, problem: SmallMotions) -> None:
        self.problem = problem
        weights = 1.0 / np.sqrt(problem.M.diagonal())
        A = (problem.J @ sparse.diags(weights)).toarray()
        A /= np.maximum(np.linalg.norm(A, axis=1, keepdims=True), 1e-300)
        Q, R, _ = linalg.qr(A.T, pivoting=True)
        diagonal = np.abs(np.diag(R))
        rank = int((diagonal > REPEATED * diagonal.max(initial=0.0)).sum())
        self.Z, self.count = weights[:, None] * Q[:, rank:], problem.size - rank
        self.M, self.K = self.reduced(problem.M), self.reduced(problem.K)

    def reduced(self, A: Any) -> Array:
        """A matrix of all coordinates as one of the free motions."""
        return np.asarray(self.Z.T @ (A @ self.Z))

    def spread(self, x: Any) -> Any:
        """Displacements of all coordinates."""
        return self.Z @ x

    def solver(self, P: Any, shift: float) -> Product:
        """Solves P x = f, P about K + shift · M."""
        factors = linalg.lu_factor(self.reduced(P))
        return lambda f: linalg.lu_solve(factors, f)

    def symmetric(self, count: int, shift: float) -> tuple[Array, Array]:
        """Lowest squares of a symmetric stiffness, ascending, and shapes; K + shift · M is positive."""
        inverse, x = linalg.eigh(self.M, self.K + shift * self.M)
        return 1.0 / inverse[::-1][:count] - shift, x[:, ::-1][:, :count]

    def largest(self, product: Product, size: int, count: int) -> tuple[Any, Any]:
        """Largest eigenvalues of a product, the largest first, and vectors."""
        values, x = linalg.eig(product(np.eye(size)))
        order = np.argsort(-np.abs(values))
        return values[order], x[:, order]


class _Sparse:
    """Free motions by multipliers beside all coordinates; the same questions as of `_Dense`."""

    def __init__(self, problem: SmallMotions) -> None:
        self.problem = problem
        self.count, self.M, self.K = problem.size - problem.J.shape[0], problem.M, problem.K

    def reduced(self, A: Any) -> Any:
        """The matrix itself."""
        return A

    def spread(self, x: Any) -> Any:
        return x

    def solver(self, P: Any, shift: float) -> Product:
        solve, size = self.problem.solver(P, shift), self.problem.size
        rows = np.zeros(self.problem.J.shape[0])
        return lambda f: solve(np.concatenate([f, rows]))[:size]

    def symmetric(self, count: int, shift: float) -> tuple[Array, Array]:
        """By ARPACK, which may miss copies of a square: as many are asked for as the inertia counts."""
        problem, n, solve = self.problem, self.problem.size, self.solver(self.K + shift * self.M, shift)
        inverse = iterative.LinearOperator((n, n), matvec=solve, dtype=float)
        for asked in (count + SPARE, 2 * count + SPARE, 4 * count + SPARE):
            start = solve(problem.M @ np.random.default_rng(0).standard_normal(n))
            try:
                squares, x = iterative.eigsh(
                    self.K, min(asked, n - 1), self.M, sigma=-shift, OPinv=inverse, v0=start
                )
            except iterative.ArpackNoConvergence as error:
                raise _lost(problem, count, len(error.eigenvalues)) from error
            below = squares[count - 1] - 1e-6 * abs(squares[count - 1]) - NOISE * problem.rounding
            if problem.negative(-below) <= (squares < below).sum():
                return squares[:count], x[:, :count]
        raise _lost(problem, count, int((squares < below).sum()))

    def largest(self, product: Product, size: int, count: int) -> tuple[Any, Any]:
        operator = iterative.LinearOperator((size, size), matvec=product, dtype=float)
        start = product(np.random.default_rng(0).standard_normal(size))
        values: Any
        x: Any
        try:
            values, x = iterative.eigs(operator, min(count, size - 2), v0=start, maxiter=100)
        except iterative.ArpackNoConvergence as error:  # what was not found may not be needed
            values, x = error.eigenvalues, error.eigenvectors
        order = np.argsort(-np.abs(values))
        return values[order], x[:, order]


def _squares(space: _Dense | _Sparse, count: int) -> tuple[Any, Any]:
    """Squares −λ² of K x = −λ² M x and shapes of the lowest ones, ascending; 0 where nothing holds a motion."""
    shift = SHIFT * space.problem.rounding
    squares, shapes = _shifted(space, count, shift)
    held = np.abs(squares[squares != 0.0])
    if 0 < len(held) < len(squares):  # with a small shift motions without stiffness take digits of others
        return _shifted(space, count, max(shift, SHIFTED * float(held.min())))
    return squares, shapes


def _shifted(space: _Dense | _Sparse, count: int, shift: float) -> tuple[Any, Any]:
    """The same with a shift, or a larger one with which the stiffness is positive."""
    problem = space.problem
    if problem.symmetric:
        shifts = (shift * 4.0**n for n in range(50))
        found = next((x for x in shifts if problem.negative(x) <= 0), None)
        if found is None:
            raise SolverError(
                f"the stiffness of scene {problem.system.scene.name!r} has no digit that can be trusted: no multiple "
                f"of the mass makes it positive; bodies or springs of more similar stiffness are needed"
            )
        shift = found
        squares, x = space.symmetric(count, shift)
    else:
        solve = space.solver(problem.K + shift * problem.M, shift)
        inverse, x = space.largest(lambda f: solve(space.M @ f), space.M.shape[0], count + SPARE)
        squares = 1.0 / inverse - shift
    noise = NOISE * (problem.roundings(space.spread(x)) + EPS * shift)
    return np.where(np.abs(squares) > noise, squares, 0.0), x


def _damped(space: _Dense | _Sparse, count: int, squares: Any, shapes: Any) -> tuple[Complex, Any]:
    """λ, one of each pair of conjugates, and shapes. What needs no force is as without damping."""
    problem, still = space.problem, squares == 0.0
    lowest_square = np.abs(squares[~still]).min(initial=np.inf)
    s = float(np.sqrt(SHIFTED * lowest_square if np.isfinite(lowest_square) else SHIFT * problem.rounding))
    M, D, size = space.M, space.reduced(problem.D), space.M.shape[0]
    solve = space.solver(problem.K + s * problem.D + s * s * problem.M, s * s)
    x = solve(M @ np.random.default_rng(0).standard_normal(size))
    scale = float(np.sqrt(np.linalg.norm(x) / np.linalg.norm(solve(M @ x))))

    def product(z: Array) -> Array:
        u, v = np.split(z, 2)
        x = -solve(D @ u + M @ (s * u + scale * v))
        return np.concatenate([x, (u + s * x) / scale])

    asked = count + int((squares.real < 0.0).sum())
    inverse, z = space.largest(product, 2 * size, 2 * asked + SPARE)
    rates = s + 1.0 / inverse
    zeros = np.argsort(np.abs(rates))[: 2 * still.sum()]
    one = rates.imag >= -REAL * np.abs(rates)
    one[zeros[np.abs(rates[zeros]) < max(np.sqrt(NOISE * problem.rounding), 1e-3 * s)]] = False
    found = np.concatenate([np.zeros(still.sum()), rates[one]])
    return found, np.hstack([shapes[:, still], z[:size, one]])


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


def grows(damping: Array) -> NDArray[np.bool_]:
    """Whether motions of a damping −Re λ/|λ| grow by more than rounding."""
    return np.asarray(damping < -GROWING)


def _too_many(space: _Dense | _Sparse, count: int, most: int) -> DiscretisationError:
    return DiscretisationError(
        f"count is {count}; scene {space.problem.system.scene.name!r} has {space.count} free motions: at most {most} "
        f"modes are allowed"
    )


def _lost(problem: SmallMotions, count: int, found: int) -> SolverError:
    return SolverError(
        f"the {count} lowest modes of scene {problem.system.scene.name!r} did not converge ({found} were found); "
        f"fewer may help"
    )
