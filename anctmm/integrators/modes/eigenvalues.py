"""Eigenvalues of small motions, by the sweeps of the recursion, without a global matrix.

If joints and rigid bodies require J u = 0, the solve S of a force gives displacements that satisfy it. S M then has the
eigenvalues 1/(λ + σ) of the free motions, and 0 for all others, which ARPACK does not search for.

Without damping and spin the problem is K x = −λ² M x, with a symmetric K unless there are follower forces. Otherwise it
is the quadratic problem in the form of Tisseur & Meerbergen 2001 (10.1137/S0036144500381988): with z = (u, λu),
A z = λ B z, where A⁻¹B needs only a solve with the shifted stiffness.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.errors import DiscretisationError, SolverError
from anctmm.integrators.modes.shifted_stiffness import ShiftedStiffness
from anctmm.integrators.modes.small_motions import SmallMotions
from anctmm.integrators.statics.static_system import StaticSystem

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Unknowns up to which matrices are built column by column.
DENSE = 60
#: Eigenvalues of the quadratic problem that are found beyond two for each mode: those of a body that is free to move
#: are 0, twice each, and as near as STILL to it, of the largest one found.
FREE, STILL = 8, 1e-7
#: Imaginary part of a rate, of its size, that is rounding; eigenvalues found beyond those asked for, so that none of a
#: pair is left out.
REAL, SPARE = 1e-9, 2
#: Elements of a beam above which a coarse mesh tells the size of frequencies, and its elements; part of a square, and
#: how far beyond rounding those are of what moves.
FINE, COARSE, PART, MOVING = 400, 4, 0.1, 1e4
#: Square of the lowest frequency, in parts of that of the coarse mesh, above which rounding has spoilt it.
SPOILT = 4.0 / PART
#: Default number of modes.
USUAL = 10


def lowest(problem: SmallMotions, count: int | None) -> tuple[Complex, Complex]:
    """Rates λ of the lowest modes, with Im λ ≥ 0, and their vectors of unknowns.

    Motions that grow without oscillation come first, the fastest of them first; all others by ascending |λ|.

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
    free = problem.freedoms
    few = problem.size <= DENSE
    most = free if few else min(free, problem.size - 2)
    name = problem.system.chain.scene.name
    if most < 1:
        raise DiscretisationError(f"scene {name!r} has nothing that can move; it has no modes")
    if count is None:
        count = min(USUAL, most)
    if count > most:
        raise DiscretisationError(
            f"count is {count}; scene {name!r} has {free} free motions: at most {most} are allowed"
        )
    problem.enough, still = _enough(problem)
    values, vectors = _find(problem, few)(problem, count)
    squares = np.sort(np.abs(values) ** 2)[still : still + 1]
    if squares.size and np.isfinite(problem.enough) and not 1.0 < squares[0] / problem.enough < SPOILT:
        raise SolverError(
            f"no digit of the lowest modes of scene {name!r} can be trusted on this mesh: rounding grows with the "
            f"fourth power of the number of elements; a coarser mesh is needed"
        )
    return values, vectors


def _find(problem: SmallMotions, few: bool) -> Callable[[SmallMotions, int], tuple[Complex, Complex]]:
    """What finds rates and vectors of a problem."""
    if problem.damped:
        return partial(_general, few=few)
    if problem.symmetric:
        return _dense_symmetric if few else _symmetric
    return partial(_undamped, few=few)


def _enough(problem: SmallMotions) -> tuple[float, int]:
    """A part of the lowest frequency's square, 1/s², and how many motions need no force.

    Both are found on a coarse mesh, where rounding does not hide them; of meshes that are coarse they are not needed.
    """
    nothing = np.inf, problem.freedoms
    chain = problem.system.chain
    cut = {name: elements for name, (elements, _) in chain.run.of(chain.scene).items()}
    if not problem.unstressed or all(elements <= FINE for elements in cut.values()):
        return nothing
    few = {name: min(elements, COARSE) for name, elements in cut.items()}
    system = StaticSystem(Chain(chain.scene, replace(chain.run, mesh=few)))
    coarse = SmallMotions(system, system.reference.copy(), 0.0, 0.0, True)
    if not 0 < coarse.freedoms <= coarse.size <= 4 * DENSE:
        return nothing
    rates, _ = _dense_symmetric(coarse, coarse.freedoms)
    squares = np.abs(rates) ** 2
    moving = squares[squares > MOVING * coarse.rounding]
    return (PART * float(moving.min()), squares.size - moving.size) if moving.size else nothing


def _dense_symmetric(problem: SmallMotions, count: int) -> tuple[Complex, Complex]:
    """iω and vectors, from the matrix itself."""
    shift = problem.definite()
    one = np.eye(problem.size)
    root = scipy.linalg.cholesky(_columns(problem.mass, one), lower=True)
    soft = root.T @ _columns(problem.solve, one) @ root
    values, vectors = scipy.linalg.eigh(0.5 * (soft + soft.T))
    values, vectors = values[::-1][:count], vectors[:, ::-1][:, :count]
    squares = 1.0 / values - shift
    return _rates(squares, problem.rounding), np.linalg.solve(root.T, vectors).astype(complex)


def _symmetric(problem: SmallMotions, count: int) -> tuple[Complex, Complex]:
    """iω and vectors of the lowest frequencies."""
    n = problem.size
    shift = problem.definite()
    # the matrix itself is not asked for in this mode of ARPACK
    A = scipy.sparse.linalg.LinearOperator((n, n), matvec=lambda x: x, dtype=float)
    M = scipy.sparse.linalg.LinearOperator((n, n), matvec=problem.mass, dtype=float)
    inverse = scipy.sparse.linalg.LinearOperator((n, n), matvec=problem.solve, dtype=float)
    try:
        squares, vectors = scipy.sparse.linalg.eigsh(
            A, count, M, sigma=-shift, OPinv=inverse, v0=_start(problem)
        )
    except scipy.sparse.linalg.ArpackNoConvergence as error:
        raise _lost(problem, count, error) from error
    order = np.argsort(squares)
    return _rates(squares[order], problem.rounding), vectors[:, order].astype(complex)


def _undamped(problem: SmallMotions, count: int, few: bool) -> tuple[Complex, Complex]:
    """The same of a stiffness that is not symmetric: two ω that have become one are a pair that grows and decays."""
    n = problem.size
    shift = problem.definite()

    def soften(x: Array) -> Array:
        return problem.solve(problem.mass(x))

    if few:
        values, vectors = scipy.linalg.eig(_columns(soften, np.eye(n)))
        kept = np.argsort(-np.abs(values))[: problem.freedoms]
        values, vectors = values[kept], vectors[:, kept]
    else:
        operator = scipy.sparse.linalg.LinearOperator((n, n), matvec=soften, dtype=float)
        try:
            values, vectors = scipy.sparse.linalg.eigs(
                operator, min(count + SPARE, n - 2), v0=_start(problem)
            )
        except scipy.sparse.linalg.ArpackNoConvergence as error:
            raise _lost(problem, count, error) from error
    rates = _rates(1.0 / values - shift, problem.rounding)
    order = _order(rates)[:count]
    return rates[order], vectors[:, order]


def _rates(squares: Array | Complex, rounding: float) -> Complex:
    """λ of λ² = −ω², with Im λ ≥ 0: where ω² is negative, by more than rounding, a motion grows.

    Of two ω² that are conjugates one is of a λ that grows, the other of one that decays.
    """
    real = np.abs(squares.imag) <= np.maximum(REAL * np.abs(squares), rounding)
    squares = np.where(real, squares.real, squares)
    still = real & (squares.real < 0.0) & (squares.real >= -rounding)
    found = np.sqrt(np.where(still, 0.0, -squares).astype(complex))
    return np.where(found.imag < 0.0, -found, found)


def _general(problem: SmallMotions, count: int, few: bool) -> tuple[Complex, Complex]:
    """λ with Im λ ≥ 0, and vectors, of the smallest |λ|.

    With λ = ν + s the matrix to solve with is K + s C + s² M, definite for a small s > 0 where K of a scene that is
    free to move is not.
    """
    n = problem.size
    asked = count + problem.negative()  # motions that grow without oscillation may not be the slowest
    inverse = ShiftedStiffness(problem)
    s = inverse.s

    def product(z: Array) -> Array:
        u, v = z[:n], z[n:]
        return np.concatenate([-inverse.solve(problem.damping_forces(u) + problem.mass(2.0 * s * u + v)), u])

    try:
        if few:
            values, vectors = scipy.linalg.eig(_columns(product, np.eye(2 * n)))
            kept = np.argsort(-np.abs(values))[: 2 * problem.freedoms]
        else:
            operator = scipy.sparse.linalg.LinearOperator((2 * n, 2 * n), matvec=product, dtype=float)
            wanted = min(2 * asked + FREE, 2 * n - 2)
            values, vectors = scipy.sparse.linalg.eigs(operator, wanted, v0=np.tile(_start(problem), 2))
            kept = np.arange(len(values))
    except scipy.sparse.linalg.ArpackNoConvergence as error:
        raise _lost(problem, count, error) from error
    values, vectors = 1.0 / values[kept] + s, vectors[:n, kept]
    largest = float(np.sort(np.abs(values))[: 2 * asked + FREE][-1])
    still = np.abs(values) < max(np.sqrt(problem.rounding), STILL * max(s, largest))
    values[still] = 0.0
    kept = np.concatenate([np.flatnonzero(still)[::2], _swinging(values, ~still)])
    kept = kept[_order(values[kept])][:count]
    if len(kept) < count:
        raise _lost(problem, count, None)
    return values[kept], vectors[:, kept]


def _swinging(values: Complex, there: NDArray[np.bool_]) -> NDArray[np.int64]:
    """One of each pair of conjugate rates; rates that are real all."""
    return np.flatnonzero(there & (_real(values) | (values.imag > 0.0)))


def _order(rates: Complex) -> NDArray[np.int64]:
    """That of modes: what grows without oscillation, the fastest first; then by |λ|, of two alike what grows."""
    sizes = np.abs(rates)
    leaves = _real(rates) & (rates.real > 0.0)
    return np.lexsort((-rates.real, np.where(leaves, -sizes, sizes)))


def _real(values: Complex) -> NDArray[np.bool_]:
    return np.abs(values.imag) <= REAL * np.abs(values)


def _columns(product: Callable[[Array], Array], one: Array) -> Array:
    """The matrix of a product."""
    return np.stack([product(e) for e in one], axis=1)


def _start(problem: SmallMotions) -> Array:
    return problem.solve(problem.mass(np.random.default_rng(0).standard_normal(problem.size)))


def _lost(
    problem: SmallMotions, count: int, error: "scipy.sparse.linalg.ArpackNoConvergence | None"
) -> SolverError:
    found = "" if error is None else f" ({len(error.eigenvalues)} were found)"
    return SolverError(
        f"the {count} lowest modes of scene {problem.system.chain.scene.name!r} did not converge{found}; fewer may help"
    )
