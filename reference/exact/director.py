"""The continuum the paper's shear-deformable element tends to, solved by its own high-order Ritz method.

The motion is r(s, y) = c(s) + y d(s) with any centre line c and director d, and the energy that of the
element (method, section 1): Saint Venant-Kirchhoff's, in Green strains of f = c' + y d' and d,

    ε_xx = ½ (f·f − 1),   ε_yy = ½ (d·d − 1),   ε_xy = ½ f·d.

The section is replaced by three fibres, y = 0 and ±√(J/I), that have its moments A, 0, I, 0, J. So nothing
here is shared with the element but the physics.

The energy contains c' but no derivative of it: force balance determines c' point by point, ∂W/∂p = n(s), and a clamp
that holds the full gradient, as an element's does, has the same limit as one that holds c(0) and d(0) only. An
element's c' cannot jump, which costs the element its second order where c'(0) is held.

Unknowns are c' and L d' at the Gauss nodes of each part of the length, where the energy is summed; d is the integral of
d'. The director has boundary layers of about the section's height at clamp and loaded end, so parts are graded there.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt

import numpy as np
from numpy.polynomial.legendre import legint, legval
from numpy.typing import NDArray

from anctmm.errors import SolverError
from anctmm.model.scene import Material
from anctmm.model.sections import Section
from reference.exact.cantilever import Cantilever
from reference.exact.legendre import analysis, gauss, integration
from reference.exact.rods import Rigidity, RodShape, solve_rod

Array = NDArray[np.float64]
#: Nodes of each part, whose answers are compared.
NODES = (13, 16)
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
        products = gradient @ np.swapaxes(gradient, -1, -2)
        xx, yy = 0.5 * (products[..., 0, 0] - 1.0), 0.5 * (products[..., 1, 1] - 1.0)
        return np.stack([xx, yy, products[..., 0, 1]], axis=-1)

    def energy(self, gradient: Array) -> Array:
        """Strain energy per volume, J/m³."""
        e = self.strains(gradient)
        return 0.5 * np.einsum("...i,ij,...j->...", e, self.moduli, e)

    def stress(self, gradient: Array) -> Array:
        """First Piola-Kirchhoff stresses, the energy's derivatives by f and d, (..., 2, 2), Pa."""
        return self._second(gradient) @ gradient

    def tangent(self, gradient: Array) -> Array:
        """The energy's second derivatives by f and d, (..., 4, 4), Pa."""
        f, d = gradient[..., 0, :], gradient[..., 1, :]
        zero = np.zeros_like(f)
        rows = [np.concatenate(pair, axis=-1) for pair in ((f, zero), (zero, d), (d, f))]
        E = np.stack(rows, axis=-2)
        return np.swapaxes(E, -1, -2) @ self.moduli @ E + np.kron(self._second(gradient), np.eye(2))

    def _second(self, gradient: Array) -> Array:
        """Second Piola-Kirchhoff stresses as matrices, (..., 2, 2), Pa."""
        stress = self.strains(gradient) @ self.moduli
        return stress[..., [[0, 2], [2, 1]]]


@dataclass(frozen=True)
class DirectorShape:
    """Deformed cantilever of the two-director continuum.

    `breaks` are fractions of the length, (parts + 1,); `starts` c and d at the beginning of each part, (parts, 2, 2),
    and `rates` the Legendre coefficients of c' and d' in it, (parts, nodes, 2, 2). `load_potential` is that of force
    and weight, zero before the loads, J; `uncertainty` the change of the tip from fewer nodes, m.
    """

    problem: Cantilever
    breaks: Array
    starts: Array
    rates: Array
    strain_energy: float
    load_potential: float
    uncertainty: float = float("nan")

    def fields(self, fraction: float) -> tuple[Array, Array]:
        """(c, d) and (c', d') at a fraction of the undeformed length, (2, 2)."""
        e = int(np.clip(np.searchsorted(self.breaks, fraction, side="right") - 1, 0, len(self.rates) - 1))
        half = 0.5 * (self.breaks[e + 1] - self.breaks[e])
        x = (fraction - self.breaks[e]) / half - 1.0
        within = half * self.problem.length * legval(x, legint(self.rates[e], lbnd=-1))
        return self.starts[e] + within, np.asarray(legval(x, self.rates[e]))

    def position(self, fraction: float) -> Array:
        """Position of the centre line, (2,), m."""
        return self.fields(fraction)[0][0]

    def angle(self, fraction: float) -> float:
        """Angle of the section's normal (of d less a right angle) from the x axis, rad, not wrapped."""
        d = np.array([self.fields(f)[0][1] for f in np.linspace(0.0, fraction, 257)])
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
    coarse, fine = (_Ritz(problem, fibres, breaks, nodes).solve(rod) for nodes in NODES)
    change = float(np.abs(fine.position(1.0) - coarse.position(1.0)).max())
    return replace(fine, uncertainty=change)


class _Ritz:
    """Stationary potential of u = (c', L d') at the nodes, (2, nodes, 2)."""

    def __init__(self, problem: Cantilever, fibres: Fibres, breaks: Array, nodes: int) -> None:
        self.problem, self.fibres, self.breaks, self.nodes = problem, fibres, breaks, nodes
        (x, w), parts = gauss(nodes), np.diff(breaks)
        self.fractions, self.weights = (
            (breaks[:-1, None] + np.outer(parts, x)).ravel(),
            np.outer(parts, w).ravel(),
        )
        # integrals from 0 to the nodes: over all parts before, and within the own one
        before = np.kron(np.tri(len(parts), k=-1), np.ones((nodes, nodes))) * self.weights
        self.inward = before + np.kron(np.diag(parts), integration(nodes))
        self.start = np.array([-np.sin(problem.angle), np.cos(problem.angle)])
        self.force = problem.internal_force(self.fractions)
        self.volumes = problem.length * np.outer(self.weights, fibres.areas)
        # f = c' + y d' and d of each fibre by (c', L d', d), and these at all nodes by u
        self.of_fibre = np.array([[[1.0, y / problem.length, 0.0], [0.0, 0.0, 1.0]] for y in fibres.places])
        one, none = np.eye(len(self.inward)), np.zeros_like(self.inward)
        by_u = np.stack(
            [np.hstack([one, none]), np.hstack([none, one]), np.hstack([none, self.inward])], axis=1
        )
        self.by_u = np.kron(by_u.reshape(-1, 2 * len(one)), np.eye(2))

    def solve(self, rod: RodShape) -> DirectorShape:
        """Newton's iteration from a rod's shape on to where rounding stops it."""
        theta, moment = rod.theta(self.fractions), rod.bending_moment(self.fractions)
        normal = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
        u = np.stack([normal, -(self.problem.length / rod.rigidity.bending * moment)[:, None] * normal])
        last = np.inf
        for _ in range(NEWTON_ITERATIONS):
            step = np.linalg.solve(self.tangent(u), self.residual(u).ravel()).reshape(u.shape)
            u, size = u - step, float(np.abs(step).max())
            if not size < 1e3:
                break
            if size < 1e-14 or (size < 1e-8 and size > 0.3 * last):
                return self.shape(u)
            last = size
        raise SolverError(
            f"two-director cantilever of {self.problem!r} finds no equilibrium near the rod's: "
            f"last Newton step {size:.3g} after {NEWTON_ITERATIONS} iterations"
        )

    def gradients(self, u: Array) -> Array:
        """(f, d) at the nodes in each fibre, (nodes, 3, 2, 2)."""
        fields = np.stack([u[0], u[1], self.start + self.inward @ u[1]], axis=1)
        return np.einsum("yga,iac->iygc", self.of_fibre, fields)

    def residual(self, u: Array) -> Array:
        """Gradient of the potential, as u."""
        stress = self.fibres.stress(self.gradients(u)) * self.volumes[:, :, None, None]
        by_slope, by_rate, by_director = np.einsum("yga,iygc->aic", self.of_fibre, stress)
        turning = self.problem.moment * _turn(self.start + self.weights @ u[1])[0]
        by_slope = by_slope - self.problem.length * self.weights[:, None] * self.force
        return np.stack([by_slope, by_rate + self.inward.T @ by_director - np.outer(self.weights, turning)])

    def tangent(self, u: Array) -> Array:
        """Hessian of the potential."""
        n, size = len(self.fractions), 2 * u[0].size
        fibres = self.fibres.tangent(self.gradients(u)) * self.volumes[:, :, None, None]
        own = np.einsum(
            "yga,iygchd,yhb->iacbd", self.of_fibre, fibres.reshape(n, 3, 2, 2, 2, 2), self.of_fibre
        )
        K = self.by_u.T @ (own.reshape(n, 6, 6) @ self.by_u.reshape(n, 6, size)).reshape(6 * n, size)
        turning = self.problem.moment * _turn(self.start + self.weights @ u[1])[1]
        K[size // 2 :, size // 2 :] -= np.kron(np.outer(self.weights, self.weights), turning)
        return np.asarray(K)

    def shape(self, u: Array) -> DirectorShape:
        """The shape of the unknowns."""
        length, parts = self.problem.length, len(self.breaks) - 1
        rates = np.stack([u[0], u[1] / length], axis=1)
        change = length * (self.weights[:, None, None] * rates).reshape(parts, self.nodes, 2, 2).sum(axis=1)
        start = np.stack([np.asarray(self.problem.start), self.start])
        starts = start + np.concatenate([np.zeros((1, 2, 2)), np.cumsum(change, axis=0)[:-1]])
        series = np.einsum("kn,enfc->ekfc", analysis(self.nodes), rates.reshape(parts, self.nodes, 2, 2))
        energy = float((self.volumes * self.fibres.energy(self.gradients(u))).sum())
        moved = u[0] - [np.cos(self.problem.angle), np.sin(self.problem.angle)]
        potential = -length * float(self.weights @ (self.force * moved).sum(axis=1))
        return DirectorShape(self.problem, self.breaks, starts, series, energy, potential)


def _turn(d: Array) -> tuple[Array, Array]:
    """First and second derivatives of the angle of d."""
    (x, y), s = d, d @ d
    second = np.array([[2 * x * y, y * y - x * x], [y * y - x * x, -2 * x * y]])
    return np.array([-y, x]) / s, second / s**2
