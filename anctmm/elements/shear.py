"""The paper's shear-deformable ANCF element (Omar & Shabana 2001), readable; `shear_kernel` is its fast twin.

Coordinates q, shape (6, 2): rows r_I, r_x,I, r_y,I, r_O, r_x,O, r_y,O. With the centre line c (Hermite) and the
director d (linear), r(x, y) = c + y d. All Green strains are the dot products of the three vectors
X = [c', d', d], and the energy per length is a quadratic form of them: anctmm/elimination/method.md, section 1.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anctmm.elements.frequencies import highest_of
from anctmm.elements.shapes import gauss, hermite, hermite_load, hermite_mass
from anctmm.model.scene import Beam

Array = NDArray[np.float64]

#: Rows of q that the Hermite functions and the linear functions multiply.
HERMITE_ROWS = [0, 1, 3, 4]
DIRECTOR_ROWS = [2, 5]
#: Gauss points that integrate the energy exactly: c'·c' is of degree 4 in ξ, its square of degree 8.
POINTS = 5
#: Q_k of each strain s_k = ½ X·Q_k X + const: ε0, κ1, κ2, ε_yy, c'·d, d'·d.
STRAIN_FORMS = np.zeros((6, 3, 3))
for _k, (_a, _b) in enumerate([(0, 0), (0, 1), (1, 1), (2, 2), (0, 2), (1, 2)]):
    STRAIN_FORMS[_k, _a, _b] = STRAIN_FORMS[_k, _b, _a] = 1.0
#: s_k of the undeformed element, where c' and d are orthonormal and d' = 0, is ½ less than ½ X·Q_k X.
STRAIN_OFFSETS = np.array([-0.5, 0.0, 0.0, -0.5, 0.0, 0.0])


@dataclass(frozen=True)
class ShearElement:
    """One element.

    Parameters
    ----------
    l : float
        Length, m.
    A, I, J : float
        ∫dA, ∫y²dA, ∫y⁴dA of the section, m², m⁴, m⁶.
    lam, G : float
        Lamé's parameter and shear modulus, Pa.
    density : float
        kg/m³.
    damping : float
        Kelvin-Voigt damping, s.
    """

    l: float  # noqa: E741
    A: float
    I: float  # noqa: E741
    J: float
    lam: float
    G: float
    density: float
    damping: float = 0.0

    vectors_per_node = 3
    #: Degree of the axis in ξ.
    degree = 3

    @classmethod
    def of(cls, body: Beam, elements: int) -> "ShearElement":
        """Each of a body's equal elements."""
        s, m = body.section, body.material
        return cls(
            body.length / elements, s.area, s.second_moment, s.fourth_moment, *m.lame, m.density, m.damping
        )

    def axis(self, xi: ArrayLike, order: int = 0) -> Array:
        """Weights of the coordinates, (points, 6), in the axis at ξ, or in a derivative of it by x."""
        found = np.zeros((np.size(xi), 6))
        found[:, HERMITE_ROWS] = hermite(xi, self.l, order)
        return found

    def turning(self, xi: ArrayLike) -> Array:
        """Weights of the coordinates, (points, 6), in the vector that a torque turns at ξ."""
        found = np.zeros((np.size(xi), 6))
        found[:, 2], found[:, 5] = 1.0 - np.asarray(xi), xi
        return found

    @cached_property
    def stiffness(self) -> Array:
        """D of the energy per length ½ s·D s in the strains s of `STRAIN_FORMS`, (6, 6)."""
        A, I, J, lam, G = self.A, self.I, self.J, self.lam, self.G  # noqa: E741
        L = lam + 2.0 * G
        D = np.diag([L * A, L * I, L * J, L * A, G * A, G * I])
        D[0, 2] = D[2, 0] = L * I
        D[0, 3] = D[3, 0] = lam * A
        D[2, 3] = D[3, 2] = lam * I
        return D

    @cached_property
    def operators(self) -> tuple[Array, Array]:
        """B, (points, 3, 6), with X = B q at each Gauss point, and the weights times l, (points,)."""
        xi, w = gauss(POINTS)
        B = np.zeros((POINTS, 3, 6))
        B[:, 0, HERMITE_ROWS] = hermite(xi, self.l, 1)
        B[:, 1, DIRECTOR_ROWS] = [-1.0 / self.l, 1.0 / self.l]
        B[:, 2, DIRECTOR_ROWS] = np.stack([1.0 - xi, xi], axis=-1)
        return B, w * self.l

    def energy(self, q: Array) -> float:
        """Strain energy, J; complex-step safe."""
        _, s, _, w = self._state(q)
        return 0.5 * np.einsum("p,pk,kl,pl->", w, s, self.stiffness, s)  # type: ignore[no-any-return]

    def force(self, q: Array) -> Array:
        """Elastic force, the gradient of the energy, (6, 2); complex-step safe."""
        X, s, B, w = self._state(q)
        N = np.einsum("pk,kab->pab", s @ self.stiffness, STRAIN_FORMS)
        return np.einsum("p,pai,pab,pbc->ic", w, B, N, X)

    def dissipation(self, q: Array, v: Array) -> float:
        """Rayleigh's dissipation function ½ τ ∫ ṡ·D ṡ at velocities v, (6, 2), W; complex-step safe."""
        _, rates, w = self._rates(q, v)
        return 0.5 * self.damping * np.einsum("p,pk,kl,pl->", w, rates, self.stiffness, rates)  # type: ignore[no-any-return]

    def damping_force(self, q: Array, v: Array) -> Array:
        """Damping force at the velocities v, the gradient of the dissipation by them, (6, 2)."""
        X, rates, w = self._rates(q, v)
        N = np.einsum("pk,kab->pab", self.damping * rates @ self.stiffness, STRAIN_FORMS)
        return np.einsum("p,pai,pab,pbc->ic", w, self.operators[0], N, X)

    def damping_matrix(self, q: Array) -> Array:
        """Derivative of the damping force by the velocities, (6, 2, 6, 2)."""
        B, w = self.operators
        by_q = np.einsum("kab,pbc,pai->pkic", STRAIN_FORMS, B @ q, B)
        return self.damping * np.einsum("p,pkic,kl,pljd->icjd", w, by_q, self.stiffness, by_q)  # type: ignore[no-any-return]

    def _rates(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """X, the strains' rates ṡ_k = X·Q_k Ẋ, (points, 6), and the weights."""
        B, w = self.operators
        X = B @ q
        return X, np.einsum("pac,kab,pbc->pk", X, STRAIN_FORMS, B @ v), w

    def tangent(self, q: Array) -> Array:
        """Hessian of the energy, (6, 2, 6, 2)."""
        X, s, B, w = self._state(q)
        N = np.einsum("pk,kab->pab", s @ self.stiffness, STRAIN_FORMS)
        E = np.einsum("kab,pbc->pkac", STRAIN_FORMS, X)  # ∂s_k/∂X_a
        H = np.einsum("pkac,kl,plbd->pacbd", E, self.stiffness, E)
        H += np.einsum("pab,cd->pacbd", N, np.eye(2))
        return np.einsum("p,pai,pacbd,pbj->icjd", w, B, H, B)

    @property
    def highest_frequency(self) -> float:
        """Of the free element without strain, rad/s: that of its thickness in a slender one."""
        return _frequency(self)

    @cached_property
    def mass(self) -> Array:
        """Scalar mass matrix m, (6, 6); the element's is m ⊗ I₂."""
        m = np.zeros((6, 6))
        m[np.ix_(HERMITE_ROWS, HERMITE_ROWS)] = self.density * self.A * hermite_mass(self.l)
        linear = np.array([[2.0, 1.0], [1.0, 2.0]]) * self.l / 6.0
        m[np.ix_(DIRECTOR_ROWS, DIRECTOR_ROWS)] = self.density * self.I * linear
        return m

    @cached_property
    def load(self) -> Array:
        """∫N dx of the axis, (6,), m: times a force per length it is the consistent force."""
        found = np.zeros(6)
        found[HERMITE_ROWS] = hermite_load(self.l)
        return found

    @cached_property
    def gravity(self) -> Array:
        """∫ρN dV, (6,), kg: times the gravity vector it is the consistent force."""
        g = np.zeros(6)
        g[HERMITE_ROWS] = self.density * self.A * self.load[HERMITE_ROWS]
        return g

    def _state(self, q: Array) -> tuple[Array, Array, Array, Array]:
        B, w = self.operators
        X = B @ q
        s = 0.5 * np.einsum("pac,kab,pbc->pk", X, STRAIN_FORMS, X) + STRAIN_OFFSETS
        return X, s, B, w


@lru_cache
def _frequency(element: ShearElement) -> float:
    """Highest frequency of an element without strain, rad/s; found once for all of its numbers."""
    along, across = (1.0, 0.0), (0.0, 1.0)
    straight = np.array([(0.0, 0.0), along, across, (element.l, 0.0), along, across])
    return highest_of(element.tangent(straight), element.mass)
