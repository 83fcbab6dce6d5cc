"""Natural modes of a scene about its start, an equilibrium or a steady spin.

About a configuration q small motions u obey M ü + C u̇ + (K_T + σ M) u = 0: C of the Kelvin-Voigt damping, σ = 0. In a
frame that turns with Ω all coordinates are vectors q' with q̈ = R (q̈' + 2 Ω S q̇' − Ω² q'), S the turn by +90°. So a
steady spin adds 2 Ω M S to C, and σ = −Ω².

The lowest modes come from ARPACK by shift and invert. The inverse is the Riccati recursion with its sweeps, so nothing
global is assembled. Without damping and spin the problem is symmetric, K x = λ M x. Else it is the quadratic one in the
form of Tisseur & Meerbergen 2001 (10.1137/S0036144500381988): with z = (u, λu), A z = λ B z, of which A⁻¹B needs a
solve with the shifted stiffness alone.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs, eigsh

from anctmm.discretise.assembly import resist
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation, discretise
from anctmm.discretise.joined import Joined
from anctmm.elements.kinds import check_kinds, flexible, kind_of
from anctmm.errors import DiscretisationError, SolverError, shown
from anctmm.integrators.statics.equilibrium_stability import least_shift
from anctmm.integrators.statics.static_system import StaticSystem
from anctmm.model.joints import Clamp
from anctmm.model.needs import MECHANISMS, refuse
from anctmm.model.scene import Probe, Scene, checked_scene
from anctmm.recursion.riccati import factorize
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution
from anctmm.validation import number, whole

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Parts of the square of the spin by which the steady state is approached, and Newton's corrections in each.
PARTS, ITERATIONS = 4, 25
#: Size of the last correction of a steady state.
CONVERGED = 1e-11
#: Shift that makes the stiffness of a free body definite, in units of its rounding.
FIRST_SHIFT = 1e4
#: Eigenvalues of the quadratic problem that are found beyond two for each mode: those of a body that is free to move
#: are 0, twice each, and as near as STILL to it, of the largest one found.
FREE, STILL = 8, 1e-5
#: Modes at most.
MOST = 10_000


@dataclass(frozen=True)
class Modes:
    """Natural modes, by ascending frequency.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    frequencies : ndarray, shape (count,)
        Of the damped motion, Hz. Motions that need no force, as of a free body, have about 0.
    damping : ndarray, shape (count,)
        Ratio to the critical damping: decay rate over undamped angular frequency.
    shapes : mapping of body name to ndarray, shape (count, nodes, vectors, 2)
        Complex: the motion is the real part of shape × exp(iωt). The largest displacement is 1 m and real.
    equilibrium : mapping of body name to ndarray, shape (nodes, vectors, 2)
        The configuration about which they move.
    """

    scene: Scene
    run: Discretisation
    frequencies: Array
    damping: Array
    shapes: Mapping[str, Complex]
    equilibrium: Mapping[str, Array]

    def displacement(self, place: Probe, fractions: Sequence[float] | Array | None = None) -> Complex:
        """Displacements of a place in each mode, (count, 2); of k fractions (count, k, 2).

        Raises
        ------
        UnknownNameError
            If there is no such place.
        """
        if fractions is not None:
            return np.stack([self.displacement((str(place), float(x))) for x in fractions], axis=1)
        name, at = self.scene.probe(place)
        length = self.scene.beam(name).length
        shape = self.shapes[name]
        parts = [HermiteField(part, length).position(float(at)) for part in (shape.real, shape.imag)]
        return np.asarray(parts[0] + 1j * parts[1])

    def __repr__(self) -> str:
        """Frequencies and damping, a line a mode."""
        rows = [
            f"  {k + 1:3d}  {f:14.6g} Hz  {z:10.3g}"
            for k, (f, z) in enumerate(zip(self.frequencies, self.damping, strict=True))
        ]
        return "\n".join(
            [f"Modes of scene {self.scene.name!r}:", "  mode       frequency     damping", *rows]
        )


def modes(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    count: int = 10,
    about: Solution | None = None,
    spin: float = 0.0,
    **options: Any,
) -> Modes:
    """Lowest natural modes of a scene.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its fields as keywords; only mesh, element and quadrature matter.
    count : int
        How many; 1 or more, and less than there are unknowns.
    about : Solution, optional
        Whose last output is linearised, such as an equilibrium of `solve_static` of the same scene and mesh, with the
        loads there. The start without it, without loads.
    spin : float
        Rate, rad/s, of a steady turn of the whole scene with its one clamp, as of a blade on a hub; the steady state
        is found first. Only without `about`, gravity and loads.

    Returns
    -------
    Modes

    Raises
    ------
    DiscretisationError
        If the options are wrong, or do not fit the scene or each other.
    SolverError
        If no steady state, or not all modes, are found.
    """
    refuse(checked_scene(scene), MECHANISMS, "a search for modes")
    run = discretise(run, options)
    chain = Chain(scene, run)
    check_kinds(run.of(scene), flexible(), "a search for modes")
    count, spin = (
        whole("count", count, MOST, DiscretisationError),
        number("spin (rad/s)", spin, DiscretisationError),
    )
    system, factor = StaticSystem(chain), 0.0
    if spin:
        q = _steady(system, spin, _centre(scene, about))
    elif about is not None:
        q, factor = _last(chain, about), float(about.t[-1]) if about.static else 1.0
    else:
        q = system.reference.copy()
    problem = _Problem(system, q, factor, spin, about is None)
    size = problem.join.size
    if count >= (size - 1 if problem.symmetric else 2 * size - 2):
        raise DiscretisationError(
            f"count is {count}; scene {scene.name!r} has {size} unknowns: fewer are needed"
        )
    values, vectors = problem.symmetric_modes(count) if problem.symmetric else problem.general_modes(count)
    rates = np.abs(values)
    fields = np.stack([_normalised(problem.spread(x)) for x in vectors.T])
    real, imaginary = chain.by_body(fields.real), chain.by_body(fields.imag)
    return Modes(
        scene,
        run,
        np.abs(values.imag) / (2.0 * np.pi),
        np.divide(-values.real, rates, out=np.zeros(count), where=rates > 0.0),
        {name: real[name] + 1j * imaginary[name] for name in real},
        chain.by_body(q),
    )


class _Problem:
    """Matrices of small motions about q, as products and one solve."""

    def __init__(self, system: StaticSystem, q: Array, factor: float, spin: float, unstressed: bool) -> None:
        self.system, self.q, self.factor, self.spin = system, q, factor, spin
        self.unstressed = unstressed and spin == 0.0
        self.join = Joined(system.chain)
        self.damping = system.chain.bodies.damping
        self.symmetric = self.damping is None and spin == 0.0

    def mass(self, x: Array) -> Array:
        """M x."""
        return self.join.gather(self.system.inertia(self.join.spread(x)))

    def spread(self, x: Array) -> Array:
        """Displacements of all nodes, (rows, nodes), from the unknowns; of complex ones, too."""
        if np.iscomplexobj(x):
            return np.asarray(self.join.spread(x.real) + 1j * self.join.spread(x.imag))
        return self.join.spread(x)

    def resist(self, x: Array) -> Array:
        """C x, with what a turning frame adds."""
        u, system = self.join.spread(x), self.system
        total = np.zeros_like(u)
        if self.damping is not None:
            lost = np.zeros_like(u)  # damping forces, linear in the velocities
            t = system.tables
            resist(t.blend, self.q, u, t.first, t.kinds, t.constants, self.damping, t.buffer, lost)
            total -= lost
        if self.spin:
            turned = np.empty_like(u)
            turned[::2], turned[1::2] = -u[1::2], u[::2]
            total += 2.0 * self.spin * system.inertia(turned)
        return self.join.gather(total)

    def definite(self) -> float:
        """A small shift with which K_T + shift · M is positive definite: a free body has K_T singular."""
        shift = FIRST_SHIFT * least_shift(self.system)
        while self.system.factorize(self.q, self.factor, shift) > 0:
            shift *= 4.0
        return shift

    def solver(self) -> Callable[[Array], Array]:
        """Solve with the matrix factored last."""
        return lambda force: self.join.unknowns(self.system.solve(self.join.load(force)))

    def symmetric_modes(self, count: int) -> tuple[Complex, Array]:
        """iω and vectors of the lowest frequencies."""
        n = self.join.size
        shift, solved = self.definite(), self.solver()
        # the matrix itself is not asked for in this mode of ARPACK
        A = LinearOperator((n, n), matvec=lambda x: x, dtype=float)
        M = LinearOperator((n, n), matvec=self.mass, dtype=float)
        inverse = LinearOperator((n, n), matvec=solved, dtype=float)
        try:
            squares, vectors = eigsh(A, count, M, sigma=-shift, OPinv=inverse, v0=self._start(solved))
        except ArpackNoConvergence as error:
            raise self._lost(count, error) from error
        order = np.argsort(squares)
        squares = squares[order]
        return np.sqrt(squares.astype(complex)) * 1j, vectors[:, order]

    def general_modes(self, count: int) -> tuple[Complex, Complex]:
        """λ with Im λ ≥ 0, and vectors, of the smallest |λ|.

        With λ = ν + s the matrix to solve with is K + s C + s² M, definite for a small s > 0 where K of an unstressed
        scene that is free to move is not.
        """
        n, s = self.join.size, 0.0
        if self.unstressed:
            s = self._factor_shifted()
        else:
            self.system.factorize(self.q, self.factor, -(self.spin**2))
        solved = self.solver()

        def product(z: Array) -> Array:
            u, v = z[:n], z[n:]
            return np.concatenate([-solved(self.resist(u) + self.mass(2.0 * s * u + v)), u])

        wanted = min(2 * count + FREE, 2 * n - 2)
        try:
            values, vectors = eigs(
                LinearOperator((2 * n, 2 * n), matvec=product, dtype=float),
                wanted,
                v0=np.tile(self._start(solved), 2),
            )
        except ArpackNoConvergence as error:
            raise self._lost(count, error) from error
        values = 1.0 / values + s
        still = np.abs(values) < STILL * max(s, float(np.abs(values).max()))
        values[still] = 0.0
        kept = np.concatenate([np.flatnonzero(still)[::2], np.flatnonzero(~still & (values.imag >= 0.0))])
        kept = kept[np.argsort(np.abs(values[kept]), kind="stable")][:count]
        if len(kept) < count:
            raise self._lost(count, None)
        return values[kept], vectors[:n, kept]

    def _factor_shifted(self) -> float:
        """Factor K + s C + s² M for a small s, which is returned; C is τ times the stiffness of unstressed elements."""
        s = float(np.sqrt(self.definite()))
        bodies, system = self.system.chain.bodies, self.system
        stiff = bodies.stiffened(1.0 + s * np.asarray(self.damping)).tables()
        loads = self.factor * system.values
        factorize(self.q, stiff, system.links, s * s, 1.0, system.loads, loads, system.factors)
        return s

    def _start(self, solved: Callable[[Array], Array]) -> Array:
        return solved(self.mass(np.random.default_rng(0).standard_normal(self.join.size)))

    def _lost(self, count: int, error: ArpackNoConvergence | None) -> SolverError:
        found = "" if error is None else f" ({len(error.eigenvalues)} were found)"
        return SolverError(
            f"the {count} lowest modes of scene {self.system.chain.scene.name!r} did not converge{found}; "
            f"fewer may do"
        )


def _normalised(u: Complex | Array) -> Complex:
    """A mode, (rows, nodes), whose largest displacement is 1 and real."""
    places = u[:2].astype(complex)
    k = np.unravel_index(int(np.abs(places).argmax()), places.shape)
    return np.asarray(u / places[k])


def _steady(system: StaticSystem, spin: float, centre: Array) -> Array:
    """Coordinates of a steady spin in the frame that turns: f(q) = Ω² M (q − centre), by Newton's iteration."""
    q = system.reference.copy()
    away = np.zeros_like(q)
    away[:2] = centre[:, None]
    for part in np.arange(1, PARTS + 1) / PARTS:
        square = part * spin**2
        for _ in range(ITERATIONS):
            residual = square * system.inertia(q - away) - system.elastic_forces(q)
            system.factorize(q, 0.0, -square)
            step = system.solve(residual)
            q += step
            if not np.isfinite(step).all() or system.size(step) < CONVERGED:
                break
        if not np.isfinite(q).all() or not system.size(step) < CONVERGED:
            raise SolverError(
                f"no steady state of scene {system.chain.scene.name!r} at a spin of {spin!r} rad/s was found beyond "
                f"{np.sqrt(square):.6g} rad/s; a finer mesh or a slower spin may do"
            )
    return q


def _centre(scene: Scene, about: Solution | None) -> Array:
    """Place that a scene spins about."""
    if about is not None:
        raise DiscretisationError(
            "spin is given beside about; one of them is allowed: the steady state is found"
        )
    clamps = [joint for joint in scene.joints if isinstance(joint, Clamp)]
    held = [joint for joint in scene.joints if getattr(joint, "grounded", False)]
    if len(clamps) != 1 or len(held) != 1:
        raise DiscretisationError(
            f"spin is given, and scene {scene.name!r} is held by {len(held)} joints, {len(clamps)} of them clamps; "
            f"it turns with one clamp that nothing else holds back"
        )
    if any(scene.gravity) or scene.loads:
        raise DiscretisationError(
            f"spin is given, and scene {scene.name!r} has gravity or loads; no steady state turns with them"
        )
    return np.array(scene.place(clamps[0].end).position)


def _last(chain: Chain, about: Solution) -> Array:
    """Last coordinates of a solution, (rows, nodes)."""
    if not isinstance(about, Solution) or about.scene != chain.scene or not len(about.t):
        raise DiscretisationError(
            f"about is {shown(about)}; a solution of scene {chain.scene.name!r} with an output is needed"
        )
    fields = dict[str, Array]()
    for name, (elements, kind) in chain.run.of(chain.scene).items():
        found = about.fields[name]
        shape = (elements + 1, len(kind_of(kind).vectors), 2)
        if not isinstance(found, HermiteField) or found.coordinates.shape[1:] != shape:
            raise DiscretisationError(
                f"about has another mesh or element of body {name!r}; {elements} of kind {kind!r} are needed"
            )
        fields[name] = found.coordinates[-1]
    return chain.flat(fields)
