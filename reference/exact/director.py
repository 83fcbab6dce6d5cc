"""The continuum the paper's shear-deformable element tends to, solved by its own high-order Ritz method.

The motion is r(s, y) = c(s) + y d(s) with any centre line c and director d, and the energy that of the
element (method, section 1): Saint Venant-Kirchhoff's, in Green strains of f = c' + y d' and d,

    ε_xx = ½ (f·f − 1),   ε_yy = ½ (d·d − 1),   ε_xy = ½ f·d.

The section is replaced by three fibres, y = 0 and ±√(J/I), that have its moments A, 0, I, 0, J. So nothing
here is shared with the element but the physics.

The energy contains c' but no derivative of it: force balance determines c' point by point, ∂W/∂p = n(s), and a clamp
that holds the full gradient, as an element's does, has the same limit as one that holds c(0) and d(0) only. An
element's c' cannot jump, which costs the element its second order where c'(0) is held.

The director has boundary layers of about the section's height at clamp and loaded end, so breaks are graded
there.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legint, legval, legvander
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from anctmm.errors import SolverError
from anctmm.model.scene import Material
from anctmm.model.sections import Section
from reference.exact.cantilever import Cantilever
from reference.exact.legendre import gauss
from reference.exact.rods import Rigidity, RodShape, solve_rod

Array = NDArray[np.float64]
#: Degrees of c' in each part, whose answers are compared; d has one more.
DEGREES = (11, 14)
NEWTON_ITERATIONS = 40


@dataclass(frozen=True)
class Fibres:
    """Section and material as three fibres."""

    section: Section
    material: Material

    @cached_property
    def places(self) -> Array:
        """Their y, m."""
        y = sqrt(self.section.fourth_moment / self.section.second_moment)
        return np.array([-y, 0.0, y])

    @cached_property
    def areas(self) -> Array:
        """Area of each, m²; the middle one's may be zero."""
        outer = self.section.second_moment**2 / self.section.fourth_moment
        return np.array([0.5 * outer, self.section.area - outer, 0.5 * outer])

    @cached_property
    def moduli(self) -> Array:
        """Derivatives of the stresses by (ε_xx, ε_yy, 2 ε_xy), (3, 3), Pa."""
        lame, G = self.material.lame
        return np.array([[lame + 2 * G, lame, 0.0], [lame, lame + 2 * G, 0.0], [0.0, 0.0, G]])

    def strains(self, gradient: Array) -> Array:
        """ε_xx, ε_yy, 2 ε_xy of the gradients (f, d), (..., 2, 2)."""
        f, d = gradient[..., 0, :], gradient[..., 1, :]
        return np.stack([0.5 * (_dot(f, f) - 1.0), 0.5 * (_dot(d, d) - 1.0), _dot(f, d)], axis=-1)

    def energy(self, gradient: Array) -> Array:
        """Strain energy per volume, J/m³."""
        e = self.strains(gradient)
        return 0.5 * np.einsum("...i,ij,...j->...", e, self.moduli, e)

    def stress(self, gradient: Array) -> Array:
        """First Piola-Kirchhoff stresses, the energy's derivatives by f and d, (..., 2, 2), Pa."""
        return _symmetric(self.strains(gradient) @ self.moduli) @ gradient

    def tangent(self, gradient: Array) -> Array:
        """The energy's second derivatives by f and d, (..., 4, 4), Pa."""
        f, d = gradient[..., 0, :], gradient[..., 1, :]
        zero = np.zeros_like(f)
        rows = [np.concatenate(pair, axis=-1) for pair in ((f, zero), (zero, d), (d, f))]
        E = np.stack(rows, axis=-2)
        geometric = np.kron(_symmetric(self.strains(gradient) @ self.moduli), np.eye(2))
        return np.swapaxes(E, -1, -2) @ self.moduli @ E + geometric


@dataclass(frozen=True)
class DirectorShape:
    """Deformed cantilever of the two-director continuum.

    `breaks` are fractions of the length, (elements + 1,); `slopes` and `directors` the Legendre coefficients of c' and
    d in each part, (elements, degree + 1 or 2, 2). `load_potential` is that of
    force and weight, zero before the loads, J; `uncertainty` the change of the tip from a lower degree, m.
    """

    problem: Cantilever
    breaks: Array
    slopes: Array
    directors: Array
    strain_energy: float
    load_potential: float
    uncertainty: float = float("nan")

    def _part(self, fraction: float) -> tuple[int, float]:
        e = int(np.clip(np.searchsorted(self.breaks, fraction, side="right") - 1, 0, len(self.slopes) - 1))
        a, b = self.breaks[e : e + 2]
        return e, 2.0 * (fraction - a) / (b - a) - 1.0

    def position(self, fraction: float) -> Array:
        """Position of the centre line at a fraction of the undeformed length, (2,), m."""
        e, x = self._part(fraction)
        lengths = np.diff(self.breaks) * self.problem.length
        before = lengths[:e] @ self.slopes[:e, 0]
        within = 0.5 * lengths[e] * legval(x, legint(self.slopes[e], lbnd=-1))
        return np.asarray(self.problem.start) + before + within

    def slope(self, fraction: float) -> Array:
        """c', (2,)."""
        e, x = self._part(fraction)
        return np.asarray(legval(x, self.slopes[e]))

    def director(self, fraction: float) -> Array:
        """d, (2,)."""
        e, x = self._part(fraction)
        return np.asarray(legval(x, self.directors[e]))

    def angle(self, fraction: float) -> float:
        """Angle of the section's normal (of d less a right angle) from the x axis, rad, not wrapped."""
        d = np.array([self.director(f) for f in np.linspace(0.0, fraction, 257)])
        turn = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
        return self.problem.angle + float(turn[-1] - turn[0])

    @property
    def moment_work(self) -> float:
        """End moment times the end director's turn, J."""
        return self.problem.moment * (self.angle(1.0) - self.problem.angle)


def graded_breaks(problem: Cantilever, section: Section) -> Array:
    """Fractions 0 … 1, fine within the section's size of both ends and growing fourfold inwards."""
    first = sqrt(section.second_moment / section.area) / problem.length
    growing = first * 4.0 ** np.arange(40)
    left = growing[growing < 0.3]
    return np.concatenate([[0.0], left, [0.5], 1.0 - left[::-1], [1.0]])


def solve_director(problem: Cantilever, section: Section, material: Material) -> DirectorShape:
    """Equilibrium of the continuum behind the paper's shear-deformable element; the torque turns the end's d.

    Raises
    ------
    SolverError
        If Newton's iteration finds no equilibrium near that of the rod with the same rigidities.
    """
    breaks, fibres = graded_breaks(problem, section), Fibres(section, material)
    rod = solve_rod(problem, Rigidity.shear_element(section, material))
    ritz = [_Ritz(problem, fibres, breaks, degree) for degree in DEGREES]
    coarse, fine = (each.shape(each.solve(each.guess(rod))) for each in ritz)
    change = float(np.abs(fine.position(1.0) - coarse.position(1.0)).max())
    return replace(fine, uncertainty=change)


class _Ritz:
    """Stationary potential in piecewise polynomials: c' may jump between the parts, d is continuous.

    Coefficients, each a pair: of c' (part by part, Legendre), of d at the breaks, of d's bubbles (Legendre,
    integrated).
    """

    def __init__(self, problem: Cantilever, fibres: Fibres, breaks: Array, degree: int) -> None:
        self.problem, self.fibres, self.breaks, self.degree = problem, fibres, breaks, degree
        self.parts = len(breaks) - 1
        self.lengths = np.diff(breaks) * problem.length
        self.split = np.cumsum([self.parts * (degree + 1), self.parts + 1, self.parts * degree])
        x, w = gauss(2 * degree + 3)
        self.fractions = breaks[:-1, None] + np.diff(breaks)[:, None] * x
        volumes = np.multiply.outer(np.multiply.outer(self.lengths, w), fibres.areas)
        self.weights = volumes.reshape(-1)
        self.operator = sparse.kron(self._gradients(x), sparse.eye_array(2), format="csr")
        self.loads = self._loads(x, w)
        self.free, self.fixed = self._clamped()

    def _shapes(self, x: Array) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """At fractions x of a part: Legendre values; values of hats and bubbles; their derivatives by x."""
        P = legvander(2.0 * x - 1.0, self.degree)
        integrals = legint(np.eye(self.degree + 1), lbnd=-1, scl=0.5)
        bubbles = legvander(2.0 * x - 1.0, self.degree + 1) @ integrals
        hats = np.stack([1.0 - x, x], axis=-1)
        one = np.ones_like(hats)
        return P, np.hstack([hats, bubbles[:, 1:]]), np.hstack([one * [-1.0, 1.0], P[:, 1:]])

    def _columns(self, e: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Coefficients of c' and of d in a part."""
        slope = np.arange(e * (self.degree + 1), (e + 1) * (self.degree + 1))
        bubbles = self.split[1] + np.arange(e * self.degree, (e + 1) * self.degree)
        return slope, np.concatenate([self.split[0] + np.array([e, e + 1]), bubbles])

    def _gradients(self, x: Array) -> sparse.csr_array:
        """Matrix from the coefficients to (f, d) of every part, point and fibre."""
        P, D, dD = self._shapes(x)
        y = self.fibres.places
        shape = (self.parts, len(x), len(y), 2, self.split[2])
        matrix = np.zeros(shape)
        for e in range(self.parts):
            slope, director = self._columns(e)
            matrix[e, :, :, 0, slope] = P.T[:, :, None]
            matrix[e, :, :, 0, director] = dD.T[:, :, None] * y / self.lengths[e]
            matrix[e, :, :, 1, director] = D.T[:, :, None]
        return sparse.csr_array(matrix.reshape(-1, self.split[2]))

    def _loads(self, x: Array, w: Array) -> Array:
        """Generalised force of force and weight, ∫ n·δc' ds, flat."""
        P, _, _ = self._shapes(x)
        n = self.problem.internal_force(self.fractions)
        force = np.zeros((self.split[2], 2))
        force[: self.split[0]] = np.einsum("e,g,gk,egc->ekc", self.lengths, w, P, n).reshape(-1, 2)
        return force.reshape(-1)

    def _clamped(self) -> tuple[sparse.csc_array, Array]:
        """Matrix and constant of all coefficients in terms of the free ones: d at the clamp is fixed."""
        fixed = np.zeros((self.split[2], 2))
        first = int(self.split[0])
        fixed[first] = -np.sin(self.problem.angle), np.cos(self.problem.angle)
        matrix = sparse.csc_array(np.delete(np.eye(self.split[2]), first, axis=1))
        return sparse.kron(matrix, sparse.eye_array(2), format="csc"), fixed.reshape(-1)

    def guess(self, rod: RodShape) -> Array:
        """Coefficients of a rod's fields, flat."""
        x, _ = gauss(self.degree + 1)
        P = np.linalg.inv(legvander(2.0 * x - 1.0, self.degree))
        theta = rod.theta(self.breaks[:-1, None] + np.diff(self.breaks)[:, None] * x)
        moment = rod.bending_moment(self.breaks[:-1, None] + np.diff(self.breaks)[:, None] * x)
        normal = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
        turn = -(self.lengths[:, None] * moment / rod.rigidity.bending)[..., None] * normal
        at_breaks = np.stack([-np.sin(rod.theta(self.breaks)), np.cos(rod.theta(self.breaks))], axis=-1)
        parts = P @ normal, at_breaks, (P @ turn)[:, 1:]
        return np.concatenate([part.reshape(-1) for part in parts])

    def solve(self, guess: Array) -> Array:
        """Newton's iteration to where rounding stops it."""
        u = self.fixed + self.free @ (self.free.T @ guess)
        last = np.inf
        for _ in range(NEWTON_ITERATIONS):
            residual, tangent = self.free.T @ self.residual(u), self.free.T @ self.tangent(u) @ self.free
            step = self.free @ splu(tangent.tocsc()).solve(residual)
            u, size = u - step, float(np.abs(step).max())
            if not size < 1e3:
                break
            if size < 1e-14 or (size < 1e-8 and size > 0.3 * last):
                return u
            last = size
        raise SolverError(
            f"two-director cantilever of {self.problem!r} finds no equilibrium near the rod's: "
            f"last Newton step {size:.3g} after {NEWTON_ITERATIONS} iterations"
        )

    def residual(self, u: Array) -> Array:
        """Gradient of the potential, flat."""
        stress = self.fibres.stress(self._at_points(u)) * self.weights[:, None, None]
        force = self.operator.T @ stress.reshape(-1) - self.loads
        force[self._tip] -= self.problem.moment * _turn_gradient(u[self._tip])
        return force

    def tangent(self, u: Array) -> sparse.csr_array:
        """Hessian of the potential."""
        blocks = self.fibres.tangent(self._at_points(u)) * self.weights[:, None, None]
        n = len(blocks)
        pointwise = sparse.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(4 * n, 4 * n))
        matrix = (self.operator.T @ pointwise @ self.operator).tolil()
        matrix[self._tip, self._tip] -= self.problem.moment * _turn_hessian(u[self._tip])
        return matrix.tocsr()

    @property
    def _tip(self) -> slice:
        last = 2 * int(self.split[1])
        return slice(last - 2, last)

    def _at_points(self, u: Array) -> Array:
        return (self.operator @ u).reshape(-1, 2, 2)

    def shape(self, u: Array) -> DirectorShape:
        """The shape of coefficients."""
        pairs = u.reshape(-1, 2)
        slopes = pairs[: self.split[0]].reshape(self.parts, self.degree + 1, 2)
        directors = np.zeros((self.parts, self.degree + 2, 2))
        for e in range(self.parts):
            _, columns = self._columns(e)
            left, right, *bubbles = pairs[columns]
            series = np.vstack([right - left, bubbles])
            directors[e] = legint(series, lbnd=-1, scl=0.5)
            directors[e, 0] += left
        energy = float(self.weights @ self.fibres.energy(self._at_points(u)))
        moved = slopes.copy()
        moved[:, 0] -= [np.cos(self.problem.angle), np.sin(self.problem.angle)]
        potential = -float(self.loads[: moved.size] @ moved.ravel())
        return DirectorShape(self.problem, self.breaks, slopes, directors, energy, potential)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _symmetric(stress: Array) -> Array:
    """Second Piola-Kirchhoff stresses (xx, yy, xy) as matrices."""
    xx, yy, xy = np.moveaxis(stress, -1, 0)
    return np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-2)


def _turn_gradient(d: Array) -> Array:
    """Derivative of the angle of d."""
    return np.array([-d[1], d[0]]) / (d @ d)


def _turn_hessian(d: Array) -> Array:
    """Second derivative of the angle of d."""
    x, y = d
    return np.array([[2 * x * y, y * y - x * x], [y * y - x * x, -2 * x * y]]) / (d @ d) ** 2
