"""Small motions of a scene about a configuration: products with its mass and damping, and a solve.

About a configuration q small motions u obey M ü + C u̇ + (K_T + σ M) u = 0 and J u = 0: C of the Kelvin-Voigt damping
and of dampers, σ = 0, J of the constraints of rigid bodies and joints, whose forces stiffen K_T. In a frame that turns
with Ω all coordinates are vectors q' with q̈ = R (q̈' + 2 Ω S q̇' − Ω² q'), S the turn by +90°. So a steady spin adds
2 Ω M S to C, and σ = −Ω².
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables
from anctmm.errors import SolverError
from anctmm.integrators.connected import Connected
from anctmm.integrators.statics.damping import Damping
from anctmm.integrators.statics.equilibrium_stability import growing_forces, largest_square, least_shift
from anctmm.integrators.statics.static_system import StaticSystem
from anctmm.recursion.kept.ranks import independent

Array = NDArray[np.float64]

EPS = float(np.finfo(np.float64).eps)
#: Largest square that counts as 0, and the shift that makes the stiffness of a free body definite, in units of its
#: rounding.
NOISE, FIRST_SHIFT = 10.0, 1e4
#: The same in units of the stiffness of connectors between distant nodes: of their low-rank matrix digits are lost
#: where the shift alone holds the rest of the scene.
NOISE_APART, SHIFT_APART = 1e-12, 1e-6
#: A shift in units of the largest square that no stiffness asks for.
BEYOND = 1e12


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
        self.join, self.mass = system.joined, system.mass
        self.damping = Damping(system, q, factor)
        apart = Connected(system.chain).bounds()[0]
        self._noise, self._first_shift = _roundings(system, apart)
        self._largest = largest_square(system) + apart
        #: A shift that is large enough to keep motions that need no force apart from others, 1/s².
        self.enough = np.inf
        self.damped = self.damping.there or spin != 0.0

    @property
    def symmetric(self) -> bool:
        """Whether the stiffness is: forces that turn with their place, which have no potential, make it none."""
        return self.system.conservative

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.join.size

    def units(self) -> Array:
        """Sizes of the unknowns: the scene's length of positions, 1 of gradients and directions."""
        positions = self.join.masters < 2 * self.join.shape[1]
        return np.where(positions, self.system.chain.length, 1.0)

    @cached_property
    def freedoms(self) -> int:
        """Number of free motions: unknowns less constraints that do not repeat others."""
        loops = self.system.loops
        return self.size - (0 if loops is None else independent(loops.rows, self.q, self.join.matrix))

    def followed(self) -> list[Array]:
        """Displacements by forces that may make motions grow, to search from; with the matrix factored last."""
        forces = growing_forces(self.system, self.damping)
        return [] if forces is None else [self.solve(self.join.gather(forces))]

    def spread(self, x: Array) -> Array:
        """Displacements of all nodes, (rows, nodes), from the unknowns; of complex ones, too."""
        if np.iscomplexobj(x):
            return np.asarray(self.join.spread(x.real) + 1j * self.join.spread(x.imag))
        return self.join.spread(x)

    def damping_forces(self, x: Array) -> Array:
        """C x, with what a turning frame adds."""
        u = self.join.spread(x)
        total = self.damping.forces(u)
        if self.spin:
            turned = np.empty_like(u)
            turned[::2], turned[1::2] = -u[1::2], u[::2]
            total += 2.0 * self.spin * self.system.inertia(turned)
        return self.join.gather(total)

    @property
    def rounding(self) -> float:
        """Square of a rate or frequency below which it is no more than rounding, 1/s²."""
        return min(self._noise, 0.1 * self.enough)

    @property
    def first_shift(self) -> float:
        """A shift that makes the stiffness of a free body definite, 1/s²."""
        return min(self._first_shift, self.enough)

    def factorize(self, shift: float, tables: Tables | None = None) -> int:
        """Factor K_T + shift · M, with the stiffness of other `tables` if given; the number of negative pivots."""
        return self.system.factorize(self.q, self.factor, shift, tables)

    def negative(self) -> int:
        """Number of motions against which the stiffness acts."""
        return self.factorize(-(self.spin**2))

    def definite(self) -> float:
        """A small shift with which K_T + shift · M is positive definite: a free body has K_T singular.

        Raises
        ------
        SolverError
            If there is none.
        """
        shift = self.first_shift
        while self.factorize(shift) > 0:
            shift *= 4.0
            if not shift < BEYOND * self._largest:
                raise SolverError(
                    f"the stiffness of scene {self.system.chain.scene.name!r} has no digit that can be trusted: no "
                    f"multiple of the mass makes it positive; bodies or springs of more similar stiffness are needed"
                )
        return shift

    def solve(self, force: Array) -> Array:
        """Displacements under forces that keep the constraints, with the matrix factored last."""
        return self.join.unknowns(self.system.solve(self.join.load(force)))


def _roundings(system: StaticSystem, stiff: float) -> tuple[float, float]:
    """Largest square that counts as 0, and a first shift, 1/s²; `stiff` is that of connectors."""
    least = least_shift(system)
    noise, shift = NOISE * EPS, FIRST_SHIFT * EPS
    if system.loads.border is not None:
        noise, shift = NOISE_APART, SHIFT_APART
    return NOISE * least + noise * stiff, FIRST_SHIFT * least + shift * stiff
