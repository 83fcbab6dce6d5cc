"""Small motions of a scene about a configuration: products with its mass and damping, and a solve.

About a configuration q small motions u obey M ü + C u̇ + (K_T + σ M) u = 0 and J u = 0: C of the Kelvin-Voigt damping
and of dampers, σ = 0, J of the constraints of rigid bodies and joints, whose forces stiffen K_T. In a frame that turns
with Ω all coordinates are vectors q' with q̈ = R (q̈' + 2 Ω S q̇' − Ω² q'), S the turn by +90°. So a steady spin adds
2 Ω M S to C, and σ = −Ω².
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import damping_forces
from anctmm.discretise.joined import Joined
from anctmm.errors import SolverError
from anctmm.integrators.connected import Connected
from anctmm.integrators.statics.equilibrium_stability import least_shift
from anctmm.integrators.statics.static_system import StaticSystem

Array = NDArray[np.float64]

EPS = float(np.finfo(np.float64).eps)
#: Largest square that counts as 0, and the shift that makes the stiffness of a free body definite, in units of its
#: rounding.
NOISE, FIRST_SHIFT = 10.0, 1e4
#: The same in units of the stiffness of connectors between distant nodes: of their low-rank matrix digits are lost
#: where the shift alone holds the rest of the scene.
NOISE_APART, SHIFT_APART = 1e-12, 1e-6
#: Velocity by which laws of springs are differentiated, of the scene's length a second.
VELOCITY = 1e-6


#: Parts of Ω² that are tried where one is singular; asymmetry of the inverse that counts as none, and its error where
#: it is not symmetric (some 1e-8 of bars of a slenderness of 5,000).
BESIDE, TRUSTED, USABLE = (1.0 + 1e-8, 1.0 - 1e-7, 1.0 + 1e-6), 1e-8, 1e-5
#: Solutions at most that add C, their change at which they end, and the largest that rounding may leave; steps of
#: inverse iteration.
ADDED, EXACT, LEFT, INVERSE = 60, 1e-14, 1e-6, 4


class SmallMotions:
    """Matrices of small motions, as products and one solve.

    Parameters
    ----------
    system : StaticSystem
    q : ndarray, shape (rows, nodes)
        The configuration.
    factor : float
        Part of the loads.
    spin : float
        rad/s.
    unstressed : bool
        Whether it is the start without loads.
    """

    def __init__(self, system: StaticSystem, q: Array, factor: float, spin: float, unstressed: bool) -> None:
        self.system, self.q, self.factor, self.spin = system, q, factor, spin
        self.unstressed = unstressed and spin == 0.0
        self.join = Joined(system.chain)
        self.damping = system.chain.bodies.damping
        connected = Connected(system.chain)
        self.dampers = connected if connected.damped else None
        self._noise, self._first_shift = _roundings(system, connected.bounds()[0])
        #: A shift that is large enough to keep motions that need no force apart from others, 1/s².
        self.enough = np.inf
        #: s of K + s² M, where that is factored and C is to be added.
        self._beside = 0.0
        self.damped = self.damping is not None or self.dampers is not None or spin != 0.0

    @property
    def symmetric(self) -> bool:
        """Whether the stiffness is: forces that turn with their place, which have no potential, make it none."""
        return self.system.conservative

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.join.size

    @property
    def freedoms(self) -> int:
        """Number of free motions: unknowns less constraints."""
        return self.size - (0 if self.system.loops is None else len(self.system.loops.rows.number))

    def mass(self, x: Array) -> Array:
        """M x."""
        return self.join.gather(self.system.inertia(self.join.spread(x)))

    def spread(self, x: Array) -> Array:
        """Displacements of all nodes, (rows, nodes), from the unknowns; of complex ones, too."""
        if np.iscomplexobj(x):
            return np.asarray(self.join.spread(x.real) + 1j * self.join.spread(x.imag))
        return self.join.spread(x)

    def damping_forces(self, x: Array) -> Array:
        """C x, with what a turning frame adds."""
        u, system = self.join.spread(x), self.system
        total = np.zeros_like(u)
        if self.damping is not None:
            lost = np.zeros_like(u)  # damping forces, linear in the velocities
            t = system.tables
            damping_forces(
                t.formulations, self.q, u, t.first, t.kinds, t.constants, self.damping, t.buffer, lost
            )
            total -= lost
        if self.dampers is not None:
            size = float(np.abs(u).max(initial=0.0))
            v = u * (VELOCITY * system.chain.length / size) if size > 0.0 else u
            up, down = np.zeros_like(u), np.zeros_like(u)
            self.dampers.subtract(self.q, self.q + v, True, up)
            self.dampers.subtract(self.q, self.q - v, True, down)
            total += (up - down) * (0.5 * size / (VELOCITY * system.chain.length))
        if self.spin:
            turned = np.empty_like(u)
            turned[::2], turned[1::2] = -u[1::2], u[::2]
            total += 2.0 * self.spin * system.inertia(turned)
        return self.join.gather(total)

    @property
    def rounding(self) -> float:
        """Square of a rate or frequency below which it is no more than rounding, 1/s²."""
        return min(self._noise, 0.1 * self.enough)

    def negative(self) -> int:
        """Number of motions against which the stiffness acts."""
        return self.system.factorize(self.q, self.factor, -(self.spin**2))

    def definite(self) -> float:
        """A small shift with which K_T + shift · M is positive definite: a free body has K_T singular."""
        shift = min(self._first_shift, self.enough)
        while self.system.factorize(self.q, self.factor, shift) > 0:
            shift *= 4.0
        return shift

    def solve(self, force: Array) -> Array:
        """Displacements under forces that keep the constraints, with the matrix factored last."""
        return self.join.unknowns(self.system.solve(self.join.load(force)))

    def factor_shifted(self) -> float:
        """Factor K + s C + s² M for a small s ≥ 0, which is returned; s = 0 where spin or stress does not allow it.

        C is τ times the stiffness of unstressed elements, and what dampers add to the tangent of connectors. Of
        stressed elements it is no tangent: where K is singular, `solve_shifted` adds it.
        """
        if self.spin:
            self._factor_spinning()
            return 0.0
        if self.damping is not None and not self.unstressed:
            self.system.factorize(self.q, self.factor)
            if not self._singular():
                self._factor_spinning()
                return 0.0
            return self._factor_beside()
        s = float(np.sqrt(self.definite()))
        tables, connectors = None, self.system.loads.connectors
        if self.damping is not None:
            tables = self.system.chain.bodies.stiffened(1.0 + s * np.asarray(self.damping)).tables()
        if connectors is not None:
            connectors.part[1] = s
        self.system.factorize(self.q, self.factor, s * s, tables)
        if connectors is not None:
            connectors.part[1] = 0.0
        return s

    def solve_shifted(self, force: Array) -> Array:
        """Displacements under forces by K + s C + s² M.

        Raises
        ------
        SolverError
            If C is too large beside K + s² M, which alone was factored.
        """
        x, change = self.solve(force), np.inf
        if not self._beside:
            return x
        for _ in range(ADDED):
            before, x = x, self.solve(force - self._beside * self.damping_forces(x))
            last, change = change, float(np.linalg.norm(x - before))
            if not EXACT * np.linalg.norm(x) < change < 0.5 * last:  # converged, or as far as rounding allows
                break
        if not change <= LEFT * np.linalg.norm(x):
            raise self._refused()
        return x

    def _factor_beside(self) -> float:
        """Factor K + s² M of a stressed scene that damps, for a small s, which is returned."""
        self._beside = float(np.sqrt(min(self._first_shift, self.enough)))
        self.system.factorize(self.q, self.factor, self._beside**2)
        return self._beside

    def _singular(self) -> bool:
        """Whether the matrix factored last is singular but for rounding, by inverse iteration."""
        force = self.mass(np.random.default_rng(2).standard_normal(self.size))
        for _ in range(INVERSE):
            x = self.solve(force)
            before, force = force, self.mass(x)
            square = float(x @ before) / float(x @ force)
            force = force / np.linalg.norm(force)
        return not abs(square) > self.rounding  # nor where it is NaN

    def _factor_spinning(self) -> None:
        """Factor K − Ω² M; where a part of it happens to be singular, with an Ω² beside that."""
        for part in (1.0, *BESIDE):
            shift = -part * self.spin**2
            self.system.factorize(self.q, self.factor, shift)
            kept = self._asymmetry() < TRUSTED if self.symmetric else self._lost_digits(shift) < USABLE
            if kept:
                return
        raise self._refused()

    def _refused(self) -> SolverError:
        return SolverError(
            f"the equations of small motions of scene {self.system.chain.scene.name!r} are singular {self._where()}"
        )

    def _where(self) -> str:
        """Where the equations are singular, and what to try."""
        if self.spin:
            return f"at a spin of {self.spin!r} rad/s; another spin or mesh is needed"
        return (
            "there: some motion needs no force, as of a body that nothing holds, or at a critical load, and materials "
            "damp much; less damping, another load, or joints or springs that hold it are needed"
        )

    def _lost_digits(self, shift: float) -> float:
        """How far the inverse S of the matrix factored last is from S' + (σ' − σ) S M S' of another shift σ'.

        The matrix is factored anew.
        """
        other = shift + self._first_shift
        one = self.mass(np.random.default_rng(1).standard_normal(self.size))
        here = self.solve(one)
        self.system.factorize(self.q, self.factor, other)
        there = self.solve(one)
        self.system.factorize(self.q, self.factor, shift)
        apart = here - there - (other - shift) * self.solve(self.mass(there))
        size = float(np.linalg.norm(here))
        return float(np.linalg.norm(apart)) / size if np.isfinite(size) and size > 0.0 else np.inf

    def _asymmetry(self) -> float:
        """How far the inverse of the matrix factored last is from symmetric, as a part of it."""
        draw = np.random.default_rng(1)
        one, two = (self.mass(draw.standard_normal(self.size)) for _ in range(2))
        there, back = self.solve(one), self.solve(two)
        size = float(np.linalg.norm(there) * np.linalg.norm(two))
        apart = abs(float(two @ there - one @ back))
        return apart / size if np.isfinite(size) and size > 0.0 else np.inf


def _roundings(system: StaticSystem, stiff: float) -> tuple[float, float]:
    """Largest square that counts as 0, and a first shift, 1/s²; `stiff` is that of connectors."""
    least = least_shift(system)
    noise, shift = NOISE * EPS, FIRST_SHIFT * EPS
    if system.loads.border is not None:
        noise, shift = NOISE_APART, SHIFT_APART
    return NOISE * least + noise * stiff, FIRST_SHIFT * least + shift * stiff
