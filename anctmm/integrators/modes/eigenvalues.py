"""Eigenvalues of small motions, by the sweeps of the recursion, without a global matrix.

If joints and rigid bodies require J u = 0, the solve S of a force gives displacements that satisfy it. S M then has the
eigenvalues 1/(λ + σ) of the free motions, and 0 for all others, which ARPACK does not search for.

Without damping and spin the problem is K x = −λ² M x, with a symmetric K unless there are follower forces. Otherwise it
is the quadratic problem in the form of Tisseur & Meerbergen 2001 (10.1137/S0036144500381988): with z = (u, λu/ω),
A z = λ B z, where A⁻¹B needs only a solve with the shifted stiffness. The frequency ω, of the order of the lowest one,
makes both parts of z alike in size, and no result depends on the unit of time; with units of positions and gradients
none depends on that of length.

Of up to 300 unknowns all eigenvalues are found. Of more, those of the smallest |λ|, among which what grows or swings
may be missing: softer parts of the scene have their own, and a material that damps much has a rate near −1/τ for each
motion that it keeps from swinging. So motions are also looked for from the places of forces that may make some grow,
and among the softest undamped ones.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.errors import DiscretisationError, SolverError
from anctmm.integrators.modes.repeated import Operator, deflated, missing, uncertain, with_copies
from anctmm.integrators.modes.shapes import GROWING
from anctmm.integrators.modes.shifted_stiffness import ShiftedStiffness
from anctmm.integrators.modes.small_motions import SmallMotions
from anctmm.integrators.statics import soft_motions
from anctmm.integrators.statics.equilibrium_stability import damped_motions, damped_space
from anctmm.integrators.statics.static_system import StaticSystem

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Unknowns up to which matrices are built column by column: of symmetric ones, and of others.
DENSE, ALL = 60, soft_motions.DENSE
#: Eigenvalues of the quadratic problem that are found beyond two for each mode: those of a body that is free to move
#: are 0, twice each, and as near as STILL to it, of the largest one found that swings.
FREE, STILL = 8, 1e-7
#: Imaginary part of a rate, of its size, that is rounding; eigenvalues found beyond those asked for, so that none of a
#: pair is left out.
REAL, SPARE = 1e-9, 2
#: Elements of a beam above which a coarse mesh tells the size of frequencies, and its elements; part of a square, and
#: how far beyond rounding those are of what moves.
FINE, COARSE, PART, MOVING = 400, 4, 0.1, 1e4
#: Square of the lowest frequency, in parts of that of the coarse mesh, above which rounding has spoilt it.
SPOILT = 4.0 / PART
#: Part of the rounding of squares above which the stiffness of slow motions is no rounding: that of free beams of up
#: to 128 cables is at most 3e-5 of it.
ACTING = 1e-3
#: Default number of modes.
USUAL = 10
#: Difference of two rates, relative, of one motion found twice; what a motion may miss of its equation, relative; how
#: often a space is made larger by what is missed, and motions of it that are looked at.
SAME, MISSED, ROUNDS, NEAR = 1e-6, 1e-7, 8, 40
#: Square of the part, of its size, by which a motion differs from others, below which it repeats them; against division
#: by zero.
REPEATED, TINY = 1e-6, 1e-300
#: Restarts of ARPACK for damped motions: beside hundreds of rates near −1/τ it ends with a part of them.
RESTARTS = 300


def lowest(problem: SmallMotions, count: int | None) -> tuple[Complex, Complex]:
    """Rates λ of the lowest modes, with Im λ ≥ 0, and their vectors of unknowns.

    Motions that grow come first, the fastest of them first; then those that oscillate, or need no force, by ascending
    |λ|; at last those that decay without oscillation, by ascending |λ|.

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
    few = problem.size <= (DENSE if problem.symmetric and not problem.damped else ALL)
    most = 2 * free if problem.damped else free
    most = most if few else min(most, problem.size - 2)
    name = problem.system.chain.scene.name
    if most < 1:
        raise DiscretisationError(f"scene {name!r} has nothing that can move; it has no modes")
    if count is not None and count > most:
        raise _too_many(count, most, problem)
    wanted = count or min(USUAL, most)
    problem.enough, still = _enough(problem)
    values, vectors = _find(problem, few)(problem, wanted)
    if count is not None and len(values) < count:
        raise _too_many(count, len(values), problem) if few else _lost(problem, count, len(values))
    squares = np.sort(np.abs(values) ** 2)[still : still + 1]
    if squares.size and np.isfinite(problem.enough) and not 1.0 < squares[0] / problem.enough < SPOILT:
        raise SolverError(
            f"no digit of the lowest modes of scene {name!r} can be trusted on this mesh: rounding grows with the "
            f"fourth power of the number of elements; a coarser mesh is needed"
        )
    return values, vectors


def _too_many(count: int, most: int, problem: SmallMotions) -> DiscretisationError:
    free = problem.freedoms
    return DiscretisationError(
        f"count is {count}; scene {problem.system.chain.scene.name!r} has {free} free motion{'s' * (free > 1)}: "
        f"at most {most} mode{'s are' if most > 1 else ' is'} allowed"
    )


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
    """iω and vectors of the lowest frequencies, with all copies of repeated ones."""
    shift = problem.definite()
    squares, vectors = _softest(problem, count, shift, np.zeros((problem.size, 0)))
    while True:
        left, at = missing(problem, squares)
        if left <= 0:
            break
        problem.factorize(shift)
        more, shapes = _softest(problem, min(left, problem.size - count - 1), shift, vectors)
        if not (more < at).any():
            if uncertain(problem, squares):
                break
            raise _lost(problem, count, int(np.count_nonzero(squares < at)))
        squares, vectors = np.concatenate([squares, more]), np.hstack([vectors, shapes])
        order = np.argsort(squares)[:count]
        squares, vectors = squares[order], vectors[:, order]
    return _rates(squares, problem.rounding), vectors.astype(complex)


def _softest(problem: SmallMotions, count: int, shift: float, known: Array) -> tuple[Array, Array]:
    """ω², ascending, and vectors that are orthogonal by the mass to those known; K + shift · M is factored last."""
    n = problem.size
    heavy = np.stack([problem.mass(x) for x in known.T], axis=1) if known.size else known
    solve = deflated(problem.solve, known, heavy)
    start = solve(problem.mass(np.random.default_rng(known.shape[1]).standard_normal(n)))
    # the matrix itself is not asked for in this mode of ARPACK
    A = scipy.sparse.linalg.LinearOperator((n, n), matvec=lambda x: x, dtype=float)
    M = scipy.sparse.linalg.LinearOperator((n, n), matvec=problem.mass, dtype=float)
    inverse = scipy.sparse.linalg.LinearOperator((n, n), matvec=solve, dtype=float)
    try:
        squares, vectors = scipy.sparse.linalg.eigsh(A, count, M, sigma=-shift, OPinv=inverse, v0=start)
    except scipy.sparse.linalg.ArpackNoConvergence as error:
        raise _lost(problem, count, len(error.eigenvalues)) from error
    order = np.argsort(squares)
    return squares[order], vectors[:, order]


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
            raise _lost(problem, count, len(error.eigenvalues)) from error
        least = np.sort(np.abs(values))[::-1][:count][-1] * (1.0 + SAME)
        values, vectors = with_copies(
            Operator(soften, problem.mass), values, vectors, lambda found: np.abs(found) > least
        )
        followed = problem.followed()
        if followed:
            values, vectors = _joined((values, vectors), soft_motions.softest(soften, problem.mass, followed))
    return _first(problem, _rates(1.0 / values - shift, problem.rounding), vectors, count, few)


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
    """λ with Im λ ≥ 0, and vectors.

    With λ = ν + s the matrix to solve with is K + s C + s² M, definite for a small s > 0 where K of a scene that is
    free to move is not.
    """
    n = problem.size
    asked = count + problem.negative()  # motions that grow without oscillation may not be the slowest
    inverse = ShiftedStiffness(problem)
    s, unit, scale = inverse.s, np.tile(problem.units(), 2), _frequency_scale(problem)

    def product(z: Array) -> Array:
        u, v = np.split(unit * z, 2)
        forces = problem.damping_forces(u) + problem.mass(2.0 * s * u + scale * v)
        return np.concatenate([-inverse.solve(forces), u / scale]) / unit

    if few:
        values, vectors = scipy.linalg.eig(_columns(product, np.eye(2 * n)))
        kept = np.argsort(-np.abs(values))[: 2 * problem.freedoms]
        values, vectors = values[kept], problem.units()[:, None] * vectors[:n, kept]
    else:
        values, vectors = _slowest(problem, inverse, product, asked)
    values = 1.0 / values + s
    swinging = np.sort(np.abs(values[~_real(values)]))  # a rate that much damping makes large tells nothing
    largest = max([s, *swinging[: 2 * asked + FREE].tolist()])
    least = max(np.sqrt(problem.rounding), STILL * largest)
    still = np.abs(values) < least
    kept = _swinging(values, ~still)
    slow = _slow(problem, inverse, values[still], vectors[:, still], least)
    found = _joined(slow, (values[kept], vectors[:, kept]))
    if not few:
        found = _joined(found, _projected(problem, inverse, least))
    return _first(problem, *found, count, few)


def _frequency_scale(problem: SmallMotions) -> float:
    """A frequency of the order of the lowest one, rad/s: a step of inverse iteration with the matrix factored last."""
    x = _start(problem)
    both = np.stack([x, problem.solve(problem.mass(x))], axis=1)
    before, after = _sizes(problem, both.astype(complex))
    return float((max(before, TINY) / max(after, TINY)) ** 0.5)


def _slow(
    problem: SmallMotions, inverse: ShiftedStiffness, rates: Complex, vectors: Complex, least: float
) -> tuple[Complex, Complex]:
    """Rates and vectors of motions whose eigenvalues are below `least`: 0 of those whose stiffness is rounding.

    A square ω² of the size of its rounding has no digits; a rate −k/c of a motion that is damped much may be far
    smaller than the root of that, and has some. So the problem is solved again in the space of these motions.
    """
    nothing = _still(problem, vectors)
    if problem.spin or not vectors.size:
        return nothing
    basis, stiffness, loss = _of_slow(problem, inverse, rates, vectors)
    squares, turn = np.linalg.eigh(0.5 * (stiffness + stiffness.T))
    apart = problem.system.loads.border is not None  # of a low-rank matrix digits are lost
    rounding = problem.rounding * (1.0 if apart else ACTING)
    held = np.abs(squares) > rounding
    if not held.any():
        return nothing
    part = turn[:, held] @ turn[:, held].T
    stiffness = part @ stiffness @ part
    n = len(squares)
    values, shapes = np.linalg.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -loss]]))
    values, shapes = values.astype(complex), shapes[:n].astype(complex)
    acting = np.abs((shapes.conj() * (stiffness @ shapes)).sum(axis=0))
    kept = (np.abs(values) < least) & (acting > rounding * (np.abs(shapes) ** 2).sum(axis=0))
    kept = _swinging(values, kept)
    free = basis @ turn[:, ~held].astype(complex)
    return _joined((np.zeros(free.shape[1], complex), free), (values[kept], basis @ shapes[:, kept]))


def _of_slow(
    problem: SmallMotions, inverse: ShiftedStiffness, rates: Complex, vectors: Complex
) -> tuple[Array, Array, Array]:
    """A basis of slow motions, orthonormal by the mass, and their stiffness and damping.

    A step of inverse iteration gives the basis, so that its stiffness follows from forces without the stiffness matrix.
    """
    s = inverse.s
    heavy, lost = (
        soft_motions.of_complex(product, vectors) for product in (problem.mass, problem.damping_forces)
    )
    size = np.maximum(soft_motions.sizes(vectors, heavy), TINY)
    forces = ((s - rates) * lost + (s * s - rates * rates) * heavy) / size
    real = np.hstack([forces.real, forces.imag])
    x = np.stack([inverse.solve(f) for f in real.T], axis=1)
    weights, damped = (_columns(product, x.T) for product in (problem.mass, problem.damping_forces))
    squares, turn = np.linalg.eigh(x.T @ weights)
    kept = squares > REPEATED * squares.max()
    turn = turn[:, kept] / np.sqrt(squares[kept])
    basis, held = x @ turn, (real - s * damped - s * s * weights) @ turn
    return basis, basis.T @ held, basis.T @ (damped @ turn)


def _still(problem: SmallMotions, vectors: Complex) -> tuple[Complex, Complex]:
    """Rates 0 and vectors of as many motions as are independent, by the mass.

    A motion that nothing damps is found twice, one that a damper acts on once.
    """
    if not vectors.size:
        return np.zeros(0, complex), vectors
    heavy = soft_motions.of_complex(problem.mass, vectors)
    size = np.maximum(soft_motions.sizes(vectors, heavy), TINY)
    squares, turn = np.linalg.eigh((vectors / size).conj().T @ (heavy / size))
    kept = np.flatnonzero(squares > REPEATED)[::-1]
    return np.zeros(len(kept), complex), vectors / size @ turn[:, kept]


def _slowest(
    problem: SmallMotions, inverse: ShiftedStiffness, product: Callable[[Array], Array], asked: int
) -> tuple[Complex, Complex]:
    """Eigenvalues 1/ν of the smallest |ν| of the quadratic problem, and the displacements of their vectors.

    Those that miss their equation are left out: they are rounding.
    """
    n = problem.size
    operator = scipy.sparse.linalg.LinearOperator((2 * n, 2 * n), matvec=product, dtype=float)
    wanted = min(2 * asked + FREE, 2 * n - 2)
    try:
        start = np.tile(_start(problem) / problem.units(), 2)
        values, vectors = scipy.sparse.linalg.eigs(operator, wanted, v0=start, maxiter=RESTARTS)
    except scipy.sparse.linalg.ArpackNoConvergence as error:  # others are looked for elsewhere, too
        values, vectors = error.eigenvalues.astype(complex), error.eigenvectors.astype(complex)
        if not len(values):
            raise _lost(problem, asked, 0) from error
    fits = _fits(problem, inverse, values, vectors)
    if (
        problem.damping.material is None
    ):  # which makes hundreds of rates near −1/τ, beside which no search ends
        values, vectors = with_copies(
            Operator(product, lambda z: z), values[fits], vectors[:, fits], _wanted(values[fits], asked)
        )
        fits = _fits(problem, inverse, values, vectors)
    return values[fits], problem.units()[:, None] * vectors[:n, fits]


def _fits(
    problem: SmallMotions, inverse: ShiftedStiffness, values: Complex, vectors: Complex
) -> NDArray[np.bool_]:
    """Whether motions, (u, λu/ω) in their units, fulfil their equation."""
    u = problem.units()[:, None] * vectors[: problem.size]
    missed = _sizes(problem, _left(problem, inverse, 1.0 / values, u)) / np.maximum(_sizes(problem, u), TINY)
    return np.asarray(missed <= MISSED)


def _wanted(values: Complex, asked: int) -> Callable[[Complex], NDArray[np.bool_]]:
    """Which of some eigenvalues 1/ν belong to the modes asked for, as far as those found tell."""
    sizes = np.sort(np.abs(values[values.imag >= 0.0]))[::-1][:asked]
    least = sizes.min(initial=np.inf) * (1.0 + SAME)
    return lambda found: np.abs(found) > least


def _left(problem: SmallMotions, inverse: ShiftedStiffness, rates: Complex, vectors: Complex) -> Complex:
    """What motions miss of the quadratic problem, as displacements; rates are those less s."""
    heavy, lost = (
        soft_motions.of_complex(product, vectors) for product in (problem.mass, problem.damping_forces)
    )
    forces = rates * (lost + (rates + 2.0 * inverse.s) * heavy)
    return vectors + soft_motions.of_complex(inverse.solve, forces)


def _sizes(problem: SmallMotions, vectors: Complex) -> Array:
    """Sizes of vectors by the mass."""
    return soft_motions.sizes(vectors, soft_motions.of_complex(problem.mass, vectors))


def _projected(problem: SmallMotions, inverse: ShiftedStiffness, least: float) -> tuple[Complex, Complex]:
    """λ with Im λ > 0 or that grow, and vectors, in a space that begins with the softest motions without damping.

    What those found in it miss of their equations, as displacements, is added to it, until they miss no more (Davidson
    1975, J. Comput. Phys. 17). Those that still do are left out, and those of a size below `least`, which is rounding.
    """
    if problem.spin:
        return np.zeros(0, complex), np.zeros((problem.size, 0), complex)
    softness, shapes = soft_motions.softest(
        lambda x: problem.solve(problem.mass(x)), problem.mass, [_start(problem), *problem.followed()]
    )
    space = damped_space(problem.system, problem.damping, 1.0 / softness, shapes)
    space = space._replace(forces=inverse.of_stiffness(space.x, space.forces))
    for _ in range(ROUNDS):
        rates, vectors, held = damped_motions(space)
        moves = (rates.imag > REAL * np.abs(rates)) | (_real(rates) & (rates.real > 0.0))
        kept = np.flatnonzero(moves & (np.abs(rates) >= least))
        kept = kept[_order(rates[kept])][:NEAR]
        rates, vectors = rates[kept], vectors[:, kept]
        if not len(kept):
            return rates, vectors
        heavy, lost = (soft_motions.of_complex(product, vectors) for product in (space.heavy, space.damped))
        forces = held[:, kept] + rates * lost + rates * rates * heavy
        left = soft_motions.of_complex(problem.solve, forces)
        missed = _sizes(problem, left) / np.maximum(soft_motions.sizes(vectors, heavy), TINY)
        fits = missed <= MISSED
        if fits.all():
            break
        x, by = (np.hstack([one[:, ~fits].real, one[:, ~fits].imag]) for one in (left, forces))
        space = space._replace(
            x=np.hstack([space.x, x]), forces=np.hstack([space.forces, inverse.of_stiffness(x, by)])
        )
    return rates[fits], vectors[:, fits]


def _joined(some: tuple[Complex, Complex], more: tuple[Complex, Complex]) -> tuple[Complex, Complex]:
    """Rates and vectors of two searches."""
    rates, vectors = (np.concatenate(both, axis=-1) for both in zip(some, more, strict=True))
    return rates, vectors


def _first(
    problem: SmallMotions, rates: Complex, vectors: Complex, count: int, once: bool
) -> tuple[Complex, Complex]:
    """The first motions in the order of modes, each once; `once`: whether each is there only once."""
    order = _order(rates)
    if not once:
        order = order[_first_found(problem, rates[order], vectors[:, order])]
    order = order[:count]
    return rates[order], vectors[:, order]


def _first_found(problem: SmallMotions, rates: Complex, vectors: Complex) -> NDArray[np.int64]:
    """Places of the motions, without those that stand there before.

    Motions are alike if their cosine by the mass is 1: sums of squares of unknowns would depend on the unit of length,
    because positions and gradients stand side by side.
    """
    heavy = soft_motions.of_complex(problem.mass, vectors)
    size = soft_motions.sizes(vectors, heavy)
    kept: list[int] = []
    for k, rate in enumerate(rates):
        alike = [n for n in kept if abs(rates[n] - rate) <= SAME * abs(rate)]
        cosines = np.abs(heavy[:, alike].conj().T @ vectors[:, k]) / np.maximum(size[alike] * size[k], TINY)
        if not (cosines >= 1.0 - SAME).any():
            kept.append(k)
    return np.array(kept, dtype=np.int64)


def _swinging(values: Complex, there: NDArray[np.bool_]) -> NDArray[np.int64]:
    """One of each pair of conjugate rates; rates that are real all."""
    return np.flatnonzero(there & (_real(values) | (values.imag > 0.0)))


def _order(rates: Complex) -> NDArray[np.int64]:
    """That of modes: what grows, the fastest first; what swings or stays, by |λ|; what decays without swinging."""
    sizes = np.abs(rates)
    grow = rates.real > GROWING * sizes
    decay = _real(rates) & (rates.real < 0.0)
    kind = np.where(grow, 0, np.where(decay, 2, 1))
    return np.lexsort((np.where(grow, -rates.real, sizes), kind))


def _real(values: Complex) -> NDArray[np.bool_]:
    return np.abs(values.imag) <= REAL * np.abs(values)


def _columns(product: Callable[[Array], Array], one: Array) -> Array:
    """The matrix of a product."""
    return np.stack([product(e) for e in one], axis=1)


def _start(problem: SmallMotions) -> Array:
    return problem.solve(problem.mass(np.random.default_rng(0).standard_normal(problem.size)))


def _lost(problem: SmallMotions, count: int, found: int) -> SolverError:
    return SolverError(
        f"the {count} lowest modes of scene {problem.system.chain.scene.name!r} did not converge ({found} were found); "
        f"fewer may help"
    )
