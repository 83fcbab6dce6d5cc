"""The paper's own evaluation of the shear element's force by invariant matrices (Rong 2014, eqs. 11-13, corrected).

García-Vallejo, Mayo, Escalona & Domínguez (2004), Nonlinear Dynamics 35: every Green strain is a quadratic form of the
coordinates, so the elastic force is K(q) q with K(q) = K₁ + K₂(q), K₂ linear in the products q_k·q_l; all
integrals are constants of the element. With shape functions times I₂ they are scalars over the six rows of q.
Corrected (anctmm/elimination/method.md, section 2): S_xy = S_x^T S_y, and the shear term is the gradient of its energy.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.shapes import gauss, hermite
from anctmm.elements.shear import DIRECTOR_ROWS, HERMITE_ROWS, POINTS, ShearElement

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InvariantShearElement:
    """Force of a `ShearElement` by constant matrices, an independent way to compute it.

    Parameters
    ----------
    element : ShearElement
    """

    element: ShearElement

    @cached_property
    def strain_forms(self) -> tuple[Array, Array]:
        """Forms and volume weights at the points (ξ, y): (points, 3, 6, 6) and (points,).

        ε_xx = ½(q·S_a q − 1), ε_yy = ½(q·S_b q − 1), 2ε_xy = q·S_c q. The section is replaced by five points
        0, ±y₁, ±y₂ with weights that give A, I and J exactly, which is all that the energy needs.
        """
        e = self.element
        y1 = np.sqrt(2.0 * e.J / e.I)
        inner = np.sqrt(e.J / (2.0 * e.I))
        y = np.array([-y1, -inner, 0.0, inner, y1])
        moments = np.array([e.A, e.I, e.J])
        w = np.linalg.solve(np.stack([np.ones(3), y[2:] ** 2, y[2:] ** 4]), moments)
        weights_y = np.array([w[2] / 2, w[1] / 2, w[0], w[1] / 2, w[2] / 2])
        xi, weights_x = gauss(POINTS)
        forms, weights = [], []
        for x, wx in zip(xi, weights_x, strict=True):
            for eta, wy in zip(y, weights_y, strict=True):
                by_x, by_y = np.zeros(6), np.zeros(6)
                by_x[HERMITE_ROWS] = hermite(x, e.l, 1)[0]
                by_x[DIRECTOR_ROWS] = [-eta / e.l, eta / e.l]
                by_y[DIRECTOR_ROWS] = [1.0 - x, x]
                shear = np.outer(by_x, by_y)
                forms.append([np.outer(by_x, by_x), np.outer(by_y, by_y), 0.5 * (shear + shear.T)])
                weights.append(wx * wy * e.l)
        return np.array(forms), np.array(weights)

    @cached_property
    def matrices(self) -> tuple[Array, Array]:
        """K₁, (6, 6), and C, (6, 6, 36), with K₂_ij = Σ_kl C_ij,kl q_k·q_l."""
        e = self.element
        forms, w = self.strain_forms
        L = e.lam + 2.0 * e.G
        D = np.array([[L, e.lam], [e.lam, L]])
        normal, shear = forms[:, :2], forms[:, 2]
        linear = -0.5 * np.einsum("p,pmij,mn->ij", w, normal, D)
        cubic = 0.5 * np.einsum("p,pmij,mn,pnkl->ijkl", w, normal, D, normal)
        # 2G ε_xy² = ½G (2ε_xy)²: its gradient is G (q·S_c q) (S_c + S_c^T) q
        cubic += 2.0 * e.G * np.einsum("p,pij,pkl->ijkl", w, shear, shear)
        return linear, cubic.reshape(6, 6, 36)

    def force(self, q: Array) -> Array:
        """Elastic force, (6, 2)."""
        linear, cubic = self.matrices
        return (linear + cubic @ (q @ q.T).ravel()) @ q  # type: ignore[no-any-return]
