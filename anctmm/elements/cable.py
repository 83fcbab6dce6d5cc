"""The gradient-deficient Euler-Bernoulli cable, readable; `cable_kernel` and `spatial_cable_kernel` are its fast twins.

Coordinates q, shape (4, dim): rows r_I, r'_I, r_O, r'_O. Strains (anctmm/elimination/method.md, section 1; to
rounding those of Exudyn's ObjectANCFCable2D, Gerstmayr & Irschik 2008): ε = |r'| − 1, κ = |r' × r''|/|r'|², in the
plane with its sign. No rotary inertia, and in space neither torsion nor damping.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anctmm.elements.frequencies import highest_of
from anctmm.elements.shapes import gauss, hermite, hermite_load, hermite_mass, lobatto
from anctmm.model.scene import Beam

Array = NDArray[np.float64]

#: Rules for the axial and the bending energy, by name: points lie symmetrically, two or three are those for bending.
RULES = {
    "full": (gauss, 5, gauss, 3),
    "reduced": (gauss, 4, gauss, 2),
    "lobatto": (lobatto, 3, gauss, 2),
}
#: a × b = a·(W b) in the plane.
W = np.array([[0.0, 1.0], [-1.0, 0.0]])


@dataclass(frozen=True)
class CableElement:
    """One element.

    Parameters
    ----------
    l : float
        Length, m.
    EA, EI : float
        Axial and bending stiffness, N, N m².
    mass_per_length : float
        kg/m.
    quadrature : str
        "full", "reduced" or "lobatto".
    damping : float
        Kelvin-Voigt damping, s.
    """

    l: float  # noqa: E741
    EA: float
    EI: float
    mass_per_length: float
    quadrature: str = "full"
    damping: float = 0.0

    vectors_per_node = 2
    #: Degree of the axis in ξ.
    degree = 3

    @classmethod
    def of(cls, body: Beam, elements: int, quadrature: str = "full") -> "CableElement":
        """Each of a body's equal elements."""
        s, m = body.section, body.material
        return cls(
            body.length / elements,
            m.E * s.area,
            m.E * s.second_moment,
            m.density * s.area,
            quadrature,
            m.damping,
        )

    def axis(self, xi: ArrayLike, order: int = 0) -> Array:
        """Weights of the coordinates, (points, 4), in the axis at ξ, or in a derivative of it by x."""
        return hermite(xi, self.l, order)

    def turning(self, xi: ArrayLike) -> Array:
        """Weights of the coordinates, (points, 4), in the vector that a torque turns at ξ."""
        return self.axis(xi, 1)

    @cached_property
    def axial_rule(self) -> tuple[Array, Array]:
        """B, (points, 4), with r' = B q, and the weights times l."""
        rule, points, _, _ = RULES[self.quadrature]
        xi, w = rule(points)
        return self.axis(xi, 1), w * self.l

    @cached_property
    def bending_rule(self) -> tuple[Array, Array, Array]:
        """B and C, (points, 4), with r' = B q and r'' = C q, and the weights times l."""
        _, _, rule, points = RULES[self.quadrature]
        xi, w = rule(points)
        return self.axis(xi, 1), self.axis(xi, 2), w * self.l

    def energy(self, q: Array) -> float:
        """Strain energy, J; complex-step safe."""
        B, w = self.axial_rule
        b = B @ q
        strain = np.sqrt((b * b).sum(axis=1)) - 1.0
        B, C, v = self.bending_rule
        b, c = B @ q, C @ q
        s, _, e = self._across(b, c)
        return 0.5 * (self.EA * (w @ strain**2) + self.EI * (v @ ((e * e).sum(axis=1) / s)))  # type: ignore[no-any-return]

    def force(self, q: Array) -> Array:
        """Elastic force, the gradient of the energy, (4, dim); complex-step safe."""
        B, w = self.axial_rule
        b = B @ q
        stretch = np.sqrt((b * b).sum(axis=1))
        force = B.T @ ((self.EA * w * (stretch - 1.0) / stretch)[:, None] * b)
        B, C, v = self.bending_rule
        b, c = B @ q, C @ q
        s, d, e = self._across(b, c)
        moment = (self.EI * v / s)[:, None]
        by_b = -((e * e).sum(axis=1)[:, None] * b + d[:, None] * e) / s[:, None]
        return force + B.T @ (moment * by_b) + C.T @ (moment * e)

    def dissipation(self, q: Array, v: Array) -> float:
        """Rayleigh's dissipation function ½ τ ∫ (EA ε̇² + EI κ̇²) at velocities v, (4, 2), W; complex-step safe."""
        return sum(0.5 * n @ np.einsum("pic,ic->p", s, v) ** 2 for n, s in self._damped(q))

    def damping_force(self, q: Array, v: Array) -> Array:
        """Damping force at the velocities v, the gradient of the dissipation by them, (4, 2)."""
        rates = ((n * np.einsum("pic,ic->p", s, v), s) for n, s in self._damped(q))
        return sum(np.einsum("p,pic->ic", n, s) for n, s in rates)  # type: ignore[return-value]

    def damping_matrix(self, q: Array) -> Array:
        """Derivative of the damping force by the velocities, (4, 2, 4, 2)."""
        return sum(np.einsum("p,pic,pjd->icjd", n, s, s) for n, s in self._damped(q))  # type: ignore[return-value]

    def _damped(self, q: Array) -> Iterator[tuple[Array, Array]]:
        """τ times stiffness and weight, (points,), and slopes of the strain by q, (points, 4, 2): of ε and of κ."""
        B, w = self.axial_rule
        b = B @ q
        t = b / np.sqrt((b * b).sum(axis=1))[:, None]
        yield self.damping * self.EA * w, np.einsum("pi,pc->pic", B, t)
        B, C, w = self.bending_rule
        _, by_b, by_c, _ = self._curvature(B @ q, C @ q)
        yield self.damping * self.EI * w, np.einsum("pi,pc->pic", B, by_b) + np.einsum("pi,pc->pic", C, by_c)

    def tangent(self, q: Array) -> Array:
        """Hessian of the energy, (4, dim, 4, dim)."""
        eye = np.eye(q.shape[1])
        B, w = self.axial_rule
        b = B @ q
        stretch = np.sqrt((b * b).sum(axis=1))
        t = b / stretch[:, None]
        H = np.einsum("p,cd->pcd", 1.0 - 1.0 / stretch, eye)
        H += np.einsum("p,pc,pd->pcd", 1.0 / stretch, t, t)
        K = np.einsum("p,pi,pcd,pj->icjd", self.EA * w, B, H, B)

        B, C, v = self.bending_rule
        b, c = B @ q, C @ q
        s, d, e = self._across(b, c)
        bb, be = np.einsum("pc,pd->pcd", b, b), np.einsum("pc,pd->pcd", b, e)
        ee, n = np.einsum("pc,pd->pcd", e, e), (e * e).sum(axis=1)[:, None, None]
        s, r = s[:, None, None], (d / s)[:, None, None]
        across = eye - bb / s
        by_bb = (
            4.0 * n * bb / s - n * eye - ee + 3.0 * r * (be + be.transpose(0, 2, 1))
        ) / s + r * r * across
        by_bc = -(2.0 * be + be.transpose(0, 2, 1)) / s - r * across
        moment = self.EI * v / s[:, 0, 0]
        K += np.einsum("p,pi,pcd,pj->icjd", moment, B, by_bb, B)
        K += np.einsum("p,pi,pcd,pj->icjd", moment, C, across, C)
        cross = np.einsum("p,pi,pcd,pj->icjd", moment, B, by_bc, C)
        return K + cross + cross.transpose(2, 3, 0, 1)

    @property
    def highest_frequency(self) -> float:
        """Of the free element without strain, rad/s: it stretches or bends, and one does not move the other."""
        stretching, bending = _unit_frequencies(type(self), self.quadrature)  # type: ignore[arg-type]
        speed, stiffness = sqrt(self.EA / self.mass_per_length), sqrt(self.EI / self.mass_per_length)
        return max(stretching * speed / self.l, bending * stiffness / self.l**2)

    @cached_property
    def mass(self) -> Array:
        """Scalar mass matrix m, (4, 4); the element's is m ⊗ I₂."""
        return self.mass_per_length * hermite_mass(self.l)

    @cached_property
    def load(self) -> Array:
        """∫N dx, (4,), m: times a force per length it is the consistent force."""
        return hermite_load(self.l)

    @cached_property
    def gravity(self) -> Array:
        """∫ρN dV, a number for each coordinate vector, kg: times the gravity vector it is the consistent force."""
        return self.mass_per_length * self.load

    @staticmethod
    def _across(b: Array, c: Array) -> tuple[Array, Array, Array]:
        """s = b·b, d = b·c and the part of c across b, of b = r' and c = r''; κ² is its square over s."""
        s, d = (b * b).sum(axis=1), (b * c).sum(axis=1)
        return s, d, c - (d / s)[:, None] * b

    @staticmethod
    def _curvature(b: Array, c: Array) -> tuple[Array, Array, Array, Array]:
        """κ, ∂κ/∂r', ∂κ/∂r'' and |r'|² from b = r' and c = r''."""
        s = (b * b).sum(axis=1)
        curvature = (b * (c @ W.T)).sum(axis=1) / s
        by_b = (c @ W.T - 2.0 * curvature[:, None] * b) / s[:, None]
        return curvature, by_b, (b @ W) / s[:, None], s


@lru_cache
def _unit_frequencies(kind: type[CableElement], quadrature: str) -> tuple[float, float]:
    """Highest frequencies of an element of length and mass 1 that stretches with EA = 1, and that bends with EI = 1."""
    found = []
    for EA, EI in ((1.0, 0.0), (0.0, 1.0)):
        unit = kind(1.0, EA, EI, 1.0, quadrature)
        q = np.zeros((2, kind.vectors_per_node, 2))
        q[:, 1, 0] = q[1, 0, 0] = 1.0
        found.append(highest_of(unit.tangent(q.reshape(-1, 2)), unit.mass))
    return found[0], found[1]
