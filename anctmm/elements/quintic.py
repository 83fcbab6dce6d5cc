"""The quintic cable: the Euler-Bernoulli cable with the second derivative of its axis among its coordinates, readable.

Coordinates q, shape (6, 2): rows r_I, r'_I, l r''_I, r_O, r'_O, l r''_O; with the factor l, the element's length, all
but the places are without a unit. Strains and energy are those of `CableElement`. The axis is a polynomial of degree
five in an element and twice differentiable at the nodes between elements. So nodal places are of order 8 in the
length of an element, 2 (5 + 1 − 2) for bending (Strang & Fix 1973, section 3.4), and places between them of order 6.

Joints hold r and r' of a body's end, never r'': curvature jumps where a moment acts or another section follows.
`quintic_kernel` is the fast twin.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anctmm.elements.cable import CableElement
from anctmm.elements.shapes import gauss, quintic, quintic_load, quintic_mass
from anctmm.model.bodies import Beam

Array = NDArray[np.float64]

#: Gauss points of the axial and of the bending energy: with one less each, errors on coarse meshes are not smaller.
AXIAL, BENDING = 6, 5


@dataclass(frozen=True)
class QuinticElement(CableElement):
    """One element; its parameters are those of `CableElement`, but that there is one rule of quadrature."""

    quadrature: str = "gauss"

    vectors_per_node = 3
    degree = 5

    @classmethod
    def of(cls, body: Beam, elements: int, quadrature: str = "gauss") -> "QuinticElement":
        """Each of a body's equal elements; `quadrature` means nothing to it."""
        cable = CableElement.of(body, elements)
        return cls(cable.l, cable.EA, cable.EI, cable.mass_per_length, damping=cable.damping)

    def axis(self, xi: ArrayLike, order: int = 0) -> Array:
        """Weights of the coordinates, (points, 6), in the axis at ξ, or in a derivative of it by x."""
        return quintic(xi, self.l, order)

    @cached_property
    def axial_rule(self) -> tuple[Array, Array]:
        """B, (points, 6), with r' = B q, and the weights times l."""
        xi, w = gauss(AXIAL)
        return self.axis(xi, 1), w * self.l

    @cached_property
    def bending_rule(self) -> tuple[Array, Array, Array]:
        """B and C, (points, 6), with r' = B q and r'' = C q, and the weights times l."""
        xi, w = gauss(BENDING)
        return self.axis(xi, 1), self.axis(xi, 2), w * self.l

    @cached_property
    def mass(self) -> Array:
        """Scalar mass matrix m, (6, 6); the element's is m ⊗ I₂."""
        return self.mass_per_length * quintic_mass(self.l)

    @cached_property
    def load(self) -> Array:
        """∫N dx, (6,), m: times a force per length it is the consistent force."""
        return quintic_load(self.l)
