"""Extensible elastica and Reissner's rod as cantilevers, solved to rounding.

With the director angle θ(s), a = (cos θ, sin θ), b = (−sin θ, cos θ), and per undeformed length (Reissner
1972, DOI 10.1007/BF01602645; Simo & Vu-Quoc 1986)

    r' = (1 + Γ₁) a + Γ₂ b,   N = n·a = EA Γ₁,   V = n·b = GA Γ₂,   M = EI θ',   M' + (1 + Γ₁) V − Γ₂ N = 0.

A cantilever's force n(s) is known beforehand, so one equation for θ remains,

    EI θ'' + V (1 + (1/EA − 1/GA) N) = 0,   θ(0) = θ₀,   EI θ'(L) = M_L.

GA = ∞ is the Euler-Bernoulli rod with energy ½ EA ε² + ½ EI κ², ε = |r'| − 1. Then r' = (1 + ε) a and
κ = (r' × r'')/|r'|² = θ': the cable element's continuum. Both ∞ is Euler's elastica.

The equation is integrated twice and solved at Gauss nodes by Newton. Elasticas have several equilibria under
one load; the one that grows from the unloaded rod is followed, the load growing in steps, as long as it is
stable.
"""

from dataclasses import dataclass
from math import inf, isnan

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray

from anctmm.errors import PropertyError, SolverError
from anctmm.model.scene import Material
from anctmm.model.sections import Section
from anctmm.validation import positive
from reference.exact.cantilever import Cantilever
from reference.exact.legendre import gauss, integration, interpolant, tail

Array = NDArray[np.float64]
NODES = (32, 64, 128, 256, 512)
#: Truncation up to which more nodes are tried (relative to the rod's length; angles in rad).
TRUNCATION = 2e-14
#: Largest change of an angle in one load step, rad: small enough not to leave the branch.
TURN = 0.3
NEWTON_ITERATIONS = 15


@dataclass(frozen=True)
class Rigidity:
    """EI (N m²), EA and the shear factor times GA (N); an infinite one forbids its strain."""

    bending: float
    axial: float = inf
    shear: float = inf

    def __post_init__(self) -> None:
        positive("bending rigidity (N m²)", self.bending)
        for name, value in (("axial", self.axial), ("shear", self.shear)):
            if isnan(value) or value <= 0.0:
                raise PropertyError(f"{name} rigidity (N) is {value!r}; a number greater than 0 is needed")

    @classmethod
    def euler_bernoulli(cls, section: Section, material: Material) -> "Rigidity":
        """Extensible, without shear: what the cable element discretises."""
        return cls(material.E * section.second_moment, material.E * section.area)

    @classmethod
    def timoshenko(cls, section: Section, material: Material) -> "Rigidity":
        """Extensible with shear, of factor 1, for uniaxial stress."""
        area = section.area
        return cls(material.E * section.second_moment, material.E * area, material.lame[1] * area)

    @classmethod
    def shear_element(cls, section: Section, material: Material) -> "Rigidity":
        """What the paper's shear-deformable element has at small strain: its Poisson locking included.

        ε_yy is constant over the section. So it can relax an axial strain, EA/(1 − ν²) remaining (plane
        strain), but not a bending strain: (λ + 2G) I remains, see `poisson_locking_factor`.
        """
        lame, G = material.lame
        axial = material.E / (1.0 - material.poisson**2)
        return cls((lame + 2.0 * G) * section.second_moment, axial * section.area, G * section.area)


@dataclass(frozen=True)
class RodShape:
    """Deformed cantilever rod.

    `theta` is the director angle, rad, and `bending_moment` the moment, N m, over the fraction of the length, `axis` x
    and y, m. `uncertainty` estimates the error of a position, m: truncation and rounding.
    """

    problem: Cantilever
    rigidity: Rigidity
    theta: Legendre
    bending_moment: Legendre
    axis: tuple[Legendre, Legendre]
    uncertainty: float

    def position(self, fraction: float) -> Array:
        """Position at a fraction of the undeformed length, (2,), m."""
        return np.array([self.axis[0](fraction), self.axis[1](fraction)])

    def angle(self, fraction: float) -> float:
        """Angle of the section's normal (without shear: of the tangent) from the x axis, rad, not wrapped."""
        return float(self.theta(fraction))

    def moment(self, fraction: float) -> float:
        """Bending moment EI θ', N m."""
        return float(self.bending_moment(fraction))

    @property
    def strain_energy(self) -> float:
        """∫ ½ N²/EA + ½ V²/GA + ½ M²/EI ds, J."""
        x, w = gauss(len(self.theta.coef))
        N, V = _in_frame(self.problem.internal_force(x), self.theta(x))
        M = self.bending_moment(x)
        energy = N**2 / self.rigidity.axial + V**2 / self.rigidity.shear + M**2 / self.rigidity.bending
        return float(0.5 * self.problem.length * w @ energy)

    @property
    def load_potential(self) -> float:
        """Potential of force and weight, zero before the loads, J."""
        x, w = gauss(len(self.axis[0].coef))
        moved = np.array([self.position(f) - self.problem.undeformed(f) for f in (*x, 1.0)])
        weighed = self.problem.length * w @ (moved[:-1] @ np.asarray(self.problem.weight))
        return -float(moved[-1] @ np.asarray(self.problem.force) + weighed)

    @property
    def moment_work(self) -> float:
        """End moment times the end's turn, J."""
        return self.problem.moment * (self.angle(1.0) - self.problem.angle)


def solve_rod(problem: Cantilever, rigidity: Rigidity) -> RodShape:
    """Stable equilibrium of a cantilever rod on the branch that starts at the unloaded rod.

    `Rigidity.euler_bernoulli` makes it the extensible elastica, `Rigidity.timoshenko` Reissner's rod.

    Raises
    ------
    SolverError
        If the branch ends before the whole load is on, or needs more than the largest number of nodes.
    """
    equation = _Equation(problem, rigidity, NODES[0])
    theta = _follow(equation)
    for n in NODES:
        equation = _Equation(problem, rigidity, n)
        solved = equation.newton(theta(equation.nodes), 1.0)
        if solved is None:
            break
        theta = interpolant(solved)
        shape = equation.shape(theta)
        if shape is not None:
            return shape
    raise SolverError(
        f"cantilever of {problem!r} and {rigidity!r} is not resolved by {NODES[-1]} nodes: its loads bend it "
        f"within less than about 1/{NODES[-1]} of its length"
    )


class _Equation:
    """θ = θ₀ + (L/EI) ∫₀ (M_L + L ∫¹ τ), τ = V (1 + cN), c = 1/EA − 1/GA, at the Gauss nodes."""

    def __init__(self, problem: Cantilever, rigidity: Rigidity, n: int) -> None:
        self.problem, self.rigidity = problem, rigidity
        self.nodes, weights = gauss(n)
        self.inward = integration(n)
        self.outward = weights - self.inward
        self.twice = self.inward @ self.outward * (problem.length**2 / rigidity.bending)
        self.once = self.nodes * problem.length / rigidity.bending * problem.moment
        self.force = problem.internal_force(self.nodes)
        self.compliance = 1.0 / rigidity.axial - 1.0 / rigidity.shear

    def torque(self, N: Array, V: Array) -> Array:
        """τ, N m per undeformed length."""
        return V * (1.0 + self.compliance * N)

    def tangent(self, theta: Array, load: float) -> Array:
        """Derivative of the equation by the angles."""
        N, V = _in_frame(load * self.force, theta)
        slope = -N * (1.0 + self.compliance * N) + self.compliance * V**2
        return np.eye(len(theta)) - self.twice * slope

    def is_stable(self, theta: Array, load: float) -> bool:
        """Whether the potential has a minimum: its second variation has the signs of these eigenvalues."""
        return bool(np.linalg.eigvals(self.tangent(theta, load)).real.min() > 0.0)

    def newton(self, theta: Array, load: float) -> Array | None:
        """Angles at the nodes under a fraction of the loads; None without convergence."""
        for _ in range(NEWTON_ITERATIONS):
            torque = self.torque(*_in_frame(load * self.force, theta))
            residual = theta - self.problem.angle - load * self.once - self.twice @ torque
            step = np.linalg.solve(self.tangent(theta, load), residual)
            theta = theta - step
            if not np.abs(step).max() < 1e3:
                return None
            if np.abs(step).max() < 1e-13 * (1.0 + np.abs(theta).max()):
                return theta
        return None

    def shape(self, theta: Legendre) -> RodShape | None:
        """The shape that angles make; None if these nodes are too few for it."""
        angle = theta(self.nodes)
        N, V = _in_frame(self.force, angle)
        stretch, shear = 1.0 + N / self.rigidity.axial, V / self.rigidity.shear
        if stretch.min() <= 0.0:
            raise SolverError(
                f"cantilever is squeezed to 1 + N/EA = {stretch.min():.3g} of its length; "
                f"more than 0 is needed"
            )
        slopes = [
            interpolant(stretch * np.cos(angle) - shear * np.sin(angle)),
            interpolant(stretch * np.sin(angle) + shear * np.cos(angle)),
        ]
        truncation, scale = max(map(tail, (theta, *slopes))), (1.0 + np.abs(angle).max()) * stretch.max()
        if truncation > TRUNCATION * scale:
            return None
        length = self.problem.length
        x, y = ((length * s).integ(lbnd=0.0, k=k) for s, k in zip(slopes, self.problem.start, strict=True))
        moment = interpolant(self.problem.moment + length * self.outward @ self.torque(N, V))
        theta = (length / self.rigidity.bending * moment).integ(lbnd=0.0, k=self.problem.angle)
        rounding = 16 * np.finfo(float).eps * scale
        return RodShape(self.problem, self.rigidity, theta, moment, (x, y), length * (truncation + rounding))


def _follow(equation: _Equation) -> Legendre:
    """Load in steps of at most `TURN` anywhere, from one stable equilibrium to the next.

    A step past a limit or bifurcation point would land on another branch; that one is not stable next to it.
    """
    theta = np.full(len(equation.nodes), equation.problem.angle)
    load, step = 0.0, 1.0
    while load < 1.0:
        trial = min(load + step, 1.0)
        solved = equation.newton(theta, trial)
        if solved is None or np.abs(solved - theta).max() > TURN or not equation.is_stable(solved, trial):
            step *= 0.5
            if step < 1e-9:
                raise SolverError(
                    f"cantilever of {equation.problem!r} has no stable equilibrium that grows from the unloaded "
                    f"one beyond {load:.6g} of its loads: it buckles or snaps there"
                )
            continue
        theta, load, step = solved, trial, 1.5 * step
    return interpolant(theta)


def _in_frame(force: Array, angle: Array) -> tuple[Array, Array]:
    c, s = np.cos(angle), np.sin(angle)
    return force[:, 0] * c + force[:, 1] * s, force[:, 1] * c - force[:, 0] * s
