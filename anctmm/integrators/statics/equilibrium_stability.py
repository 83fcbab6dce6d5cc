"""Stability of an equilibrium: the inertia of its tangent stiffness, and whether that is singular.

Under conservative loads an equilibrium is stable if the potential energy has a strict minimum (Lagrange, Dirichlet): if
K_T is positive definite on the motions that the joints allow. The elimination of the recursion has as many negative
pivots as K_T has negative eigenvalues (Sylvester's law of inertia).
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.maps import push
from anctmm.forces.loads import FOLLOWER
from anctmm.integrators.connected import Connected
from anctmm.integrators.stability import element_bound
from anctmm.integrators.statics.damping import Damping
from anctmm.integrators.statics.soft_motions import of_complex, softest
from anctmm.integrators.statics.static_system import StaticSystem
from anctmm.jit.compiling import uncompiled

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

EPS = float(np.finfo(np.float64).eps)
#: Relative change of coordinates, a few roundings, with which a solve is repeated, and how often.
ROUNDING, TRIALS = 4.0 * EPS, 4
#: Relative change of its answer above which the tangent may be singular within double precision; without elastic
#: bodies, softness over that of the highest frequency above which it may be.
DOUBTFUL, SOFT = 1e-2, 1e12
#: Real or imaginary part that is no rounding.
COMPLEX = 1e-6
#: Shifts that may pass by a zero pivot, of the square of the highest frequency; how far answers beside it may differ.
BESIDE, SAME = 10.0 ** np.arange(-1, -14, -1.0), 1e-2
#: Part of the largest below which a square is that of motions that repeat others; against division by zero.
APART, TINY = 1e-12, 1e-300
#: Damping ratio of a motion below which what its damping displaces is rounding, as of a damper between welded bodies.
FELT = 1e-9
#: Shift, of the square of the highest frequency, that outweighs all stiffness, and answer that is none.
HEAVY, NO_MOTION = 1e12, 1e-6
#: Steps of the inverse iteration, and relative change of the eigenvalue at which it ends.
ITERATIONS, CONVERGED = 300, 1e-12


@dataclass(frozen=True)
class Stability:
    """What is known of an equilibrium.

    Parameters
    ----------
    kind : str
        "stable"; "unstable"; or "singular": a motion needs no force there, that of a mechanism, of a body that nothing
        holds, or at the limit of stability.
    negative : int
        Directions in which the energy falls.
    motion : ndarray, shape (rows, nodes)
        The motion that needs the least force, of any size.
    flutter : bool
        Whether motions grow that swing to and fro, as under forces without a potential.
    """

    kind: Literal["stable", "unstable", "singular"]
    negative: int
    motion: Array
    flutter: bool = False


def stability_of(system: StaticSystem, q: Array, factor: float) -> Stability:
    """Stability of an equilibrium q, (rows, nodes), under a part of the load."""
    if _held(system, q, factor):
        return Stability("stable", 0, np.zeros_like(q))
    if _forceless(system, q, factor):
        return Stability("singular", 0, lowest_mode(system, q, factor)[1])
    motion, doubtful = _softest(system, q, factor)
    shift = _past_zero_pivot(system, q, factor) if doubtful else 0.0
    if shift is None:
        return Stability("singular", system.factorize(q, factor), motion)
    damping = Damping(system, q, factor)
    negative = system.factorize(q, factor, shift)
    if not system.conservative or (damping.feeds and not negative):
        return _by_motions(system, damping, motion, shift)
    return Stability("unstable" if negative else "stable", negative, motion)


def _held(system: StaticSystem, q: Array, factor: float) -> bool:
    """Whether constraints leave no motion at all, as of a rigid body on a pin and a guide.

    As many constraints as unknowns may repeat each other: against an inertia that outweighs all stiffness free motions
    answer forces as if alone, and others do not.
    """
    if system.loops is None or system.joined.size > len(system.loops.rows.number):
        return False
    shift = HEAVY * largest_square(system)
    noise = _noise(system, np.random.default_rng(0))
    system.factorize(q, factor, shift)
    answer = system.solve(system.inertia(noise))
    return bool(shift * system.size(answer) <= NO_MOTION * system.size(noise))


def _forceless(system: StaticSystem, q: Array, factor: float) -> bool:
    """Whether no force acts on rigid bodies: K_T is then 0 in all motions that joints leave, whatever rounding says."""
    c = system.loads.connectors
    springs = c is not None and bool(
        c.laws.any() or c.numbers[:, ::2].any()
    )  # stiffness or preload: no dampers
    return not (springs or element_bound(system.chain) > 0.0 or system.applied(q, factor).any())


def _past_zero_pivot(system: StaticSystem, q: Array, factor: float) -> float | None:
    """A shift, 1/s², with which the elimination passes a pivot that is zero by chance; None if K_T itself is singular.

    Without exchange of rows a pivot may vanish though K_T is regular, as where a load of round numbers just balances
    a spring. With K_T + μ M and K_T − μ M it does not. For a μ much smaller than all eigenvalues both
    have nearly the same answer; the largest such μ leaves the least rounding. A motion that needs no force answers with
    opposite signs.
    """
    force = system.inertia(_noise(system, np.random.default_rng(0)))
    for shift in BESIDE * largest_square(system):
        answers, negative = [], []
        for sign in (1.0, -1.0):
            negative.append(system.factorize(q, factor, sign * shift))
            answers.append(system.solve(force))
        sizes = [system.size(x) for x in (answers[0] - answers[1], *answers)]
        alike = negative[0] == negative[1] or not system.conservative
        if alike and np.isfinite(sizes).all() and sizes[0] <= SAME * max(sizes[1:]):
            return float(shift)
    return None


def _by_motions(system: StaticSystem, damping: Damping, motion: Array, shift: float) -> Stability:
    """Stability by small motions M ẍ + C ẋ + K x = 0, with K + shift · M factored last.

    So where forces have no potential, or feed motions. Without damping motions do not grow where the eigenvalues λ = ω²
    of K x = λ M x are positive: a negative one is a motion that leaves without swinging; a complex pair is two
    frequencies that have become one (flutter). With damping, which may make a scene flutter far earlier (Ziegler),
    the rates λ of the quadratic problem decide.
    """
    values, shapes = softest_of(system, damping, shift)
    if damping.there:
        space = damped_space(system, damping, values, shapes)
        rates, shapes, _ = damped_motions(space)
    else:
        values = np.where(np.abs(values.imag) > COMPLEX * np.abs(values), values, values.real)
        rates = np.sqrt(-values.astype(complex))  # one of each pair ±
    grows = rates.real > COMPLEX * np.abs(rates)
    if not grows.any():
        return Stability("stable", 0, motion)
    leaves = grows & (np.abs(rates.imag) <= COMPLEX * np.abs(rates)) & (not system.conservative)
    worst = system.joined.spread(np.real(shapes[:, int(np.argmin(np.where(grows, np.abs(rates), np.inf)))]))
    return Stability("unstable", int(grows.sum()), worst, flutter=not leaves.any())


class Space(NamedTuple):
    """Motions among which others are looked for.

    Parameters
    ----------
    heavy, damped : callable
        M x and C x, (size,), of unknowns.
    x, forces : ndarray, shape (size, k)
        Unknowns, and K x.
    """

    heavy: Callable[[Array], Array]
    damped: Callable[[Array], Array]
    x: Array
    forces: Array


def damped_space(system: StaticSystem, damping: Damping, values: Complex, shapes: Complex) -> Space:
    """Motions without damping, K x = value · M x, and what their damping forces displace, K⁻¹ C x.

    K is the matrix factored last, or differs from it by a small multiple of the mass.
    """
    joined = system.joined

    def damped(x: Array) -> Array:
        return joined.gather(damping.forces(joined.spread(x)))

    held = of_complex(system.mass, shapes) * values
    x, forces = (np.concatenate([part.real, part.imag], axis=1) for part in (shapes, held))
    there = np.abs(x).max(axis=0) > 0.0  # a real motion has no imaginary part
    x, forces, stiff = x[:, there], forces[:, there], np.tile(values, 2)[there]
    lost = np.stack([damped(one) for one in x.T], axis=1)
    displaced = np.stack([joined.unknowns(system.solve(joined.load(f))) for f in lost.T], axis=1)
    ratios = np.sqrt(np.abs(stiff)) * np.abs(displaced).max(axis=0)
    felt = ratios > FELT * np.abs(x).max(axis=0)
    x = np.concatenate([x, displaced[:, felt]], axis=1)
    return Space(system.mass, damped, x, np.concatenate([forces, lost[:, felt]], axis=1))


def damped_motions(space: Space) -> tuple[Complex, Complex, Complex]:
    """Rates λ of motions M ẍ + C ẋ + K x = 0 in a space, their unknowns x, and K x.

    A Krylov space of the whole problem does not find them beside the many rates −1/τ that a strong Kelvin-Voigt damping
    gives. Those of a pair are both there.
    """
    size = np.maximum(np.abs(space.x).max(axis=0), TINY)
    x, forces = space.x / size, space.forces / size
    squares, turn = np.linalg.eigh(x.T @ np.stack([space.heavy(one) for one in x.T], axis=1))
    kept = squares > APART * squares.max()
    turn = turn[:, kept] / np.sqrt(squares[kept])  # of mass 1, and orthogonal
    basis, held = x @ turn, forces @ turn
    stiffness = basis.T @ held
    loss = basis.T @ np.stack([space.damped(one) for one in basis.T], axis=1)
    n = len(stiffness)
    rates, vectors = np.linalg.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -loss]]))
    return rates.astype(complex), basis @ vectors[:n], held @ vectors[:n]


def softest_of(system: StaticSystem, damping: Damping, shift: float) -> tuple[Complex, Complex]:
    """λ of K x = λ M x, the smallest |λ + shift| first, and x, with K + shift · M factored last."""
    joined, rng = system.joined, np.random.default_rng(0)

    def answer(f: Array) -> Array:
        return joined.unknowns(system.solve(joined.load(f)))

    starts, forces = [rng.standard_normal(joined.size)], growing_forces(system, damping)
    if forces is not None:
        starts.append(answer(joined.gather(forces)))
    inverse, shapes = softest(lambda x: answer(system.mass(x)), system.mass, starts)
    return 1.0 / inverse - shift, shapes


def growing_forces(system: StaticSystem, damping: Damping) -> Array | None:
    """Some forces, (rows, nodes), at the places of those that may make motions grow; None if there are none.

    These are loads that turn with their place, and laws that give energy to a motion.
    """
    loads, shape, rng = system.loads, system.reference.shape, np.random.default_rng(3)
    forces = damping.fed
    for n in map(int, np.flatnonzero(loads.kinds == FOLLOWER)):
        along = np.zeros(shape)
        uncompiled(push)(loads.targets, n, *rng.standard_normal(2), along)
        forces.append(along)
    return np.asarray(np.tensordot(rng.standard_normal(len(forces)), np.stack(forces), 1)) if forces else None


def _softest(system: StaticSystem, q: Array, factor: float) -> tuple[Array, bool]:
    """Answer to random forces, and whether the tangent may be singular: whether the answer is much more than rounding.

    Coordinates and springs changed by a few roundings give another answer, by the condition of the tangent times
    rounding. The stiffness of springs along an axis does not depend on coordinates. A bound from the highest frequency
    would call slender beams and fine meshes singular that still have all their digits: rigid bodies alone have one.
    """
    if system.chain.prescribed.all():
        return np.zeros_like(q), False
    rng = np.random.default_rng(0)
    noise = _noise(system, rng)
    force = system.inertia(noise)
    system.factorize(q, factor)
    first, largest = system.solve(force), 0.0
    for _ in range(TRIALS):
        with _rounded_springs(system, rng):
            system.factorize(q * (1.0 + ROUNDING * rng.uniform(-1.0, 1.0, q.shape)), factor)
        other = system.solve(force)
        sizes = [system.size(x) for x in (other - first, first, other)]
        if not np.isfinite(sizes).all():
            return lowest_mode(system, q, factor)[1], True
        largest = max(largest, sizes[0] / max(sizes[1], sizes[2]))
    soft = element_bound(system.chain) == 0.0 and (
        system.size(first) * largest_square(system) >= SOFT * system.size(noise)
    )
    return first, largest >= DOUBTFUL or soft


@contextmanager
def _rounded_springs(system: StaticSystem, rng: np.random.Generator) -> Iterator[None]:
    """Stiffnesses of springs that differ by a few roundings from those of the scene, as long as it is entered."""
    c = system.loads.connectors
    if c is None:
        yield
        return
    kept = c.numbers.copy()
    c.numbers[:, 0] *= 1.0 + ROUNDING * rng.uniform(-1.0, 1.0, len(kept))
    try:
        yield
    finally:
        c.numbers[:] = kept


def lowest_mode(system: StaticSystem, q: Array, factor: float) -> tuple[float, Array]:
    """Lowest eigenvalue of K_T x = λ M x, 1/s², the square of the lowest frequency; and its mode, of size 1.

    By inverse iteration with K_T + μ M, where μ is little above −λ or, where that is positive, above 0: the matrix is
    positive definite, and every step is a sweep. The sign makes the largest displacement one towards positive y, or x.
    """
    shift = _positive_shift(system, q, factor)
    x, value = _noise(system, np.random.default_rng(0)), np.inf
    for _ in range(ITERATIONS):
        load = system.inertia(x)
        y = system.solve(load)
        before, value = value, float((y * load).sum() / (y * system.inertia(y)).sum())
        x = y / system.size(y)
        if abs(value - before) <= CONVERGED * abs(value):
            break
    return value - shift, _signed(x)


def least_shift(system: StaticSystem) -> float:
    """A shift of the order of the rounding of K_T x = λ M x, 1/s²."""
    return 16.0 * EPS * largest_square(system)


def largest_square(system: StaticSystem) -> float:
    """Order of the largest λ of K_T x = λ M x, 1/s², whatever the unit of time.

    Of beams it is that of their elements; of rigid bodies alone that of their springs, or of the loads that turn them.
    """
    if (bound := element_bound(system.chain)) > 0.0:
        return bound**2
    scene, forces = system.chain.scene, np.abs(system.applied(system.reference, 1.0))
    inertia = sum(body.mass for body in scene.bodies) * scene.length
    turning = float(forces[:2].sum() + forces[2:].sum() / scene.length) / inertia
    return Connected(system.chain).bounds()[0] + turning or 1.0


def _noise(system: StaticSystem, rng: np.random.Generator) -> Array:
    """Random displacements, positions of the scene's length and gradients of 1."""
    x = rng.standard_normal(system.reference.shape)
    x[:2] *= system.chain.length
    return x


def _positive_shift(system: StaticSystem, q: Array, factor: float) -> float:
    """A shift with which K_T + shift · M is positive definite, at most a tenth too large; the matrix is factored."""
    low, high = 0.0, least_shift(system)
    while system.factorize(q, factor, high) > 0:
        low, high = high, 10.0 * high
    while high > 1.1 * low > 0.0:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if system.factorize(q, factor, middle) > 0 else (low, middle)
    system.factorize(q, factor, high)
    return high


def _signed(x: Array) -> Array:
    sizes = np.abs(x[:2]).max(axis=0)
    node = int(np.argmax(sizes > 0.999 * sizes.max()))
    along = x[1, node] if abs(x[1, node]) > 1e-6 * sizes[node] else x[0, node]
    return x if along >= 0.0 else -x
