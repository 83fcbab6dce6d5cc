"""The continuum the paper's shear-deformable element tends to, as a boundary value problem.

The motion is r(s, y) = c(s) + y d(s) with any centre line c and director d, and the energy that of the element (method,
section 1): Saint Venant-Kirchhoff's, in Green strains of f = c' + y d' and d,

    ε_xx = ½ (f·f − 1),   ε_yy = ½ (d·d − 1),   ε_xy = ½ f·d.

The section is replaced by three fibres, y = 0 and ±√(J/I), that have its moments A, 0, I, 0, J. So nothing here is
shared with the element but the physics. With W(p, q, d) the energy per length at p = c' and q = d',

    ∂W/∂p = n(s),   ∂W/∂q = m,   m' = ∂W/∂d,   d(0) held,   m(L) the end moment over the director's turn:

the first two determine p and q point by point. The energy contains c' but no derivative of it, so a clamp that holds
the full gradient, as an element's does, has the same limit as one that holds c(0) and d(0) only. An element's c' cannot
jump, which costs the element its second order where c'(0) is held.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp

from anctmm.errors import DiscretisationError, SolverError
from anctmm.model.scene import Material
from anctmm.model.sections import Section
from anctmm.validation import within
from reference.exact.cantilever import Cantilever
from reference.exact.legendre import gauss
from reference.exact.rods import Rigidity, RodShape, solve_rod

Array = NDArray[np.float64]

#: Newton iterations of p and q at a point at most, and the correction that ends them; nodes of the mesh at most, and
#: Gauss points of an interval.
ITERATIONS, ENOUGH, NODES, POINTS = 30, 1e-15, 50_000, 5


@dataclass(frozen=True)
class Fibres:
    """Section and material as three fibres; vectors are (2, n), at n places of the beam.

    Parameters
    ----------
    section : Section
    material : Material
    """

    section: Section
    material: Material

    @cached_property
    def fibres(self) -> tuple[tuple[float, float], ...]:
        """Their y, m, and areas, m²; the middle one's may be zero."""
        y = sqrt(self.section.fourth_moment / self.section.second_moment)
        outer = self.section.second_moment**2 / self.section.fourth_moment
        return (-y, 0.5 * outer), (0.0, self.section.area - outer), (y, 0.5 * outer)

    def stresses(self, f: Array, d: Array) -> tuple[Array, Array, Array]:
        """Second Piola-Kirchhoff stresses xx, yy and xy of a fibre, (n,), Pa."""
        lame, G = self.material.lame
        xx, yy = 0.5 * (_dot(f, f) - 1.0), 0.5 * (_dot(d, d) - 1.0)
        mean = lame * (xx + yy)
        return mean + 2.0 * G * xx, mean + 2.0 * G * yy, G * _dot(f, d)

    def energy(self, p: Array, q: Array, d: Array) -> Array:
        """Strain energy per length, (n,), J/m."""
        total = np.zeros(p.shape[1], dtype=p.dtype)
        for y, area in self.fibres:
            f = p + y * q
            xx, yy, xy = self.stresses(f, d)
            total += 0.25 * area * (xx * (_dot(f, f) - 1.0) + yy * (_dot(d, d) - 1.0) + 2.0 * xy * _dot(f, d))
        return total

    def forces(self, p: Array, q: Array, d: Array) -> tuple[Array, Array, Array]:
        """Derivatives of the energy by p, q and d, each (2, n)."""
        by_p, by_q, by_d = (np.zeros_like(p) for _ in range(3))
        for y, area in self.fibres:
            f = p + y * q
            xx, yy, xy = self.stresses(f, d)
            stress = area * (xx * f + xy * d)
            by_p, by_q, by_d = by_p + stress, by_q + y * stress, by_d + area * (xy * f + yy * d)
        return by_p, by_q, by_d

    def stiffness(self, p: Array, q: Array, d: Array) -> Array:
        """Second derivatives of the energy by p and q, (n, 4, 4)."""
        (lame, G), total = self.material.lame, np.zeros((p.shape[1], 4, 4))
        for y, area in self.fibres:
            f = p + y * q
            H = (lame + 2.0 * G) * _outer(f) + G * _outer(d)
            H += self.stresses(f, d)[0][:, None, None] * np.eye(2)
            total += np.kron(area * np.array([[1.0, y], [y, y * y]]), H)
        return total

    def gradients(self, n: Array, m: Array, d: Array) -> tuple[Array, Array]:
        """p and q where ∂W/∂p = n and ∂W/∂q = m, each (2, n): by Newton from the section without strain."""
        p, q = np.stack([d[1], -d[0]]) / np.sqrt(_dot(d, d)), np.zeros_like(d)
        for _ in range(ITERATIONS):
            by_p, by_q, _ = self.forces(p, q, d)
            misfit = np.concatenate([n - by_p, m - by_q]).T[..., None]
            step = np.linalg.solve(self.stiffness(p, q, d), misfit)[..., 0].T
            p, q = p + step[:2], q + step[2:]
            if not np.abs(step[:2]).max() > ENOUGH:
                break
        return p, q


@dataclass(frozen=True)
class DirectorShape:
    """Deformed cantilever of the two-director continuum.

    Parameters
    ----------
    problem : Cantilever
    fibres : Fibres
    state : callable
        Fraction of the length, (n,), to d, m over `unit` and c over the length, (6, n).
    breaks : ndarray
        Fractions between which it is a polynomial.
    unit : float
        N m.
    uncertainty : float
        Change of the tip since the last larger tolerance, m; NaN where there was none.
    """

    problem: Cantilever
    fibres: Fibres
    state: Any
    breaks: Array
    unit: float
    uncertainty: float = float("nan")

    def position(self, fraction: float) -> Array:
        """Position of the centre line at a fraction of the undeformed length, (2,), m."""
        return np.asarray(self.problem.start) + self.problem.length * np.asarray(self.state(fraction))[4:]

    def director(self, fraction: float) -> Array:
        """d, (2,)."""
        return np.asarray(self.state(fraction))[:2]

    def gradients(self, fraction: Array) -> tuple[Array, Array]:
        """c' and d' at fractions, (2, n) each."""
        y = self.state(fraction)
        return self.fibres.gradients(self.problem.internal_force(fraction).T, self.unit * y[2:4], y[:2])

    def angle(self, fraction: float) -> float:
        """Angle of the section's normal (of d less a right angle) from the x axis, rad, not wrapped."""
        x, y = self.state(np.linspace(0.0, fraction, 257))[:2]
        turn = np.unwrap(np.arctan2(y, x))
        return self.problem.angle + float(turn[-1] - turn[0])

    @property
    def strain_energy(self) -> float:
        """∫W ds, J."""
        x, w = self._quadrature()
        return float(w @ self.fibres.energy(*self.gradients(x), self.state(x)[:2]))

    @property
    def load_potential(self) -> float:
        """Potential of force and weight, zero before the loads, J."""
        x, w = self._quadrature()
        undeformed = np.array([[np.cos(self.problem.angle)], [np.sin(self.problem.angle)]])
        return -float(w @ _dot(self.problem.internal_force(x).T, self.gradients(x)[0] - undeformed))

    @property
    def moment_work(self) -> float:
        """End moment times the end director's turn, J."""
        return self.problem.moment * (self.angle(1.0) - self.problem.angle)

    def _quadrature(self) -> tuple[Array, Array]:
        """Fractions and weights, m, over the length."""
        x, w = gauss(POINTS)
        parts = np.diff(self.breaks)[:, None]
        return (self.breaks[:-1, None] + parts * x).ravel(), (self.problem.length * parts * w).ravel()


def solve_director(
    problem: Cantilever, section: Section, material: Material, *, tolerance: float = 1e-9
) -> DirectorShape:
    """Equilibrium of the continuum behind the paper's shear-deformable element.

    Parameters
    ----------
    problem : Cantilever
        Length and loads; the torque turns the end's d.
    section : Section
        Area, second and fourth moment.
    material : Material
        Poisson's ratio included.
    tolerance : float
        Relative residual of the equations, at least 1e-13; errors are a small part of it.

    Raises
    ------
    DiscretisationError
        If the tolerance cannot be used.
    SolverError
        If no equilibrium is found near that of the rod with the same rigidities.
    """
    tolerance = within("tolerance", tolerance, 1e-13, 1e-2, "[]", DiscretisationError)
    rod = solve_rod(problem, Rigidity.shear_element(section, material))
    fibres = Fibres(section, material)
    coarse = _solved(problem, fibres, *_near(problem, section, rod), tolerance=100.0 * tolerance)
    fine = _solved(
        problem, fibres, coarse.unit, coarse.breaks, coarse.state(coarse.breaks), tolerance=tolerance
    )
    return replace(fine, uncertainty=float(np.abs(fine.position(1.0) - coarse.position(1.0)).max()))


def _near(problem: Cantilever, section: Section, rod: RodShape) -> tuple[float, Array, Array]:
    """Unit of moments, a mesh that is fine within the section's size of both ends, and the rod's state there."""
    first = sqrt(section.second_moment / section.area) / problem.length
    growing = first * 1.5 ** np.arange(-4, 60)
    left = np.concatenate([[0.0], growing[growing < 0.02], np.linspace(0.02, 0.5, 25)])
    x = np.unique(np.concatenate([left, 1.0 - left]))
    theta, unit = rod.theta(x), rod.rigidity.bending / problem.length
    d = np.stack([-np.sin(theta), np.cos(theta)])
    m = rod.bending_moment(x) / unit * np.stack([-d[1], d[0]])
    c = np.stack(
        [(axis(x) - start) / problem.length for axis, start in zip(rod.axis, problem.start, strict=True)]
    )
    return unit, x, np.concatenate([d, m, c])


def _solved(
    problem: Cantilever, fibres: Fibres, unit: float, x: Array, y: Array, tolerance: float
) -> DirectorShape:
    L, clamped = problem.length, np.array([-np.sin(problem.angle), np.cos(problem.angle)])

    def rates(x: Array, y: Array) -> Array:
        d, m = y[:2], unit * y[2:4]
        p, q = fibres.gradients(problem.internal_force(x).T, m, d)
        return np.concatenate([L * q, L / unit * fibres.forces(p, q, d)[2], p])

    def ends(start: Array, end: Array) -> Array:
        d = end[:2]
        moment = problem.moment / unit / (d @ d) * np.array([-d[1], d[0]])
        return np.concatenate([start[:2] - clamped, end[2:4] - moment, start[4:]])

    with np.errstate(all="ignore"):  # of trials that are far off
        found = solve_bvp(rates, ends, x, y, tol=tolerance, max_nodes=NODES)
    if not found.success or not np.isfinite(found.y).all():
        raise SolverError(
            f"two-director cantilever of {problem!r} finds no equilibrium near the rod's: {found.message}"
        )
    return DirectorShape(problem, fibres, found.sol, found.x, unit)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=0))


def _outer(a: Array) -> Array:
    """a ⊗ a of vectors (2, n), (n, 2, 2)."""
    return np.asarray(a.T[:, :, None] * a.T[:, None, :])
