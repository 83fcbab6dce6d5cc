"""Section forces of beams, from the equilibrium of an element and not from differentiated strains.

The generalized forces that hold an element in its motion are R = f(q) + M q̈ − g, f elastic and damping forces, g those
of what acts on it. At its outboard node they are what lies beyond exerts: a force R_r, and the moment Σ g × R_g over
all other vectors g of the node. Shape functions contain every rigid motion, so these are in equilibrium with the
inertia ρA r̈ of the element's own motion, and a section in between follows from that of the part beyond it, exactly:

    F(x) = R_r + Σ F_k + ∫_x^l (p − ρA r̈) ds,
    M(x) = M_O + (r_O − r) × R_r + Σ ((r_k − r) × F_k + M_k) + ∫_x^l ((r(s) − r) × (p − ρA r̈) − ρI d × d̈) ds.

F_k, M_k act at or beyond the section; what acts on the very start acts before it.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import Element, kind_of
from anctmm.elements.shapes import gauss
from anctmm.elements.shear import ShearElement
from anctmm.errors import ResultError
from anctmm.results.fields import HermiteField, InterpolatedField
from anctmm.results.internal_forces.actions import Action, actions_on, along

Array = NDArray[np.float64]


def section_force(solution: Any, body: str, fraction: float) -> Array:
    """N, Q, M of the part beyond a section on the part before it, (n, 3): N, N, N m.

    Parameters
    ----------
    solution : Solution
    body : str
    fraction : float
        Of the undeformed length, in [0, 1].

    Returns
    -------
    ndarray, shape (n, 3)
        Along the tangent, along the normal (the tangent turned by +90°), counter-clockwise.

    Raises
    ------
    ResultError
        If the solution is not one of ANCF elements with accelerations, or the body is rigid.
    """
    count = element_count(solution, body)
    number = max(ceil(fraction * count - 1e-12) - 1, 0)
    element = HeldElement(solution, body, number)
    x = fraction * count - number
    force, moment = element.beyond(x)
    tangent = element.slope(x)
    tangent = tangent / np.hypot(*tangent.T)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    return np.stack(
        [np.einsum("nc,nc->n", tangent, force), np.einsum("nc,nc->n", normal, force), moment], axis=1
    )


def element_count(solution: Any, body: str) -> int:
    """Elements of a beam.

    Raises
    ------
    ResultError
        If the solution does not have what section forces are found from.
    """
    field = solution.fields.get(body)
    ours = isinstance(field, HermiteField) and not isinstance(field, InterpolatedField)
    if not ours or solution.run is None:
        raise ResultError(
            f"section forces of {body!r} are not known by solver {solution.solver!r}: ANCF elements are needed"
        )
    kind = kind_of(solution.run.of(solution.scene)[body][1])
    if kind.rigid:
        raise ResultError(
            f"section forces of {body!r} are not known: it is rigid; elements that bend are needed"
        )
    if field.accelerations is None and not solution.static:
        raise ResultError(
            f"section forces of {body!r} need accelerations, which solver {solution.solver!r} does not keep"
        )
    return field.coordinates.shape[1] - 1


@dataclass(frozen=True)
class HeldElement:
    """One element of a beam over all outputs, and what holds it.

    Parameters
    ----------
    solution : Solution
    body : str
    number : int
    """

    solution: Any
    body: str
    number: int

    @cached_property
    def element(self) -> Element:
        """The readable element."""
        run, scene = self.solution.run, self.solution.scene
        count, name = run.of(scene)[self.body]
        return kind_of(name).element_of(scene.beam(self.body), count, run.quadrature)

    def _nodes(self, series: Array | None) -> Array:
        """Of both nodes, (n, rows, 2); 0 where there is none."""
        field = self.solution.fields[self.body]
        found = np.zeros_like(field.coordinates) if series is None else series
        pair = found[:, self.number : self.number + 2]
        return pair.reshape(len(pair), -1, 2)

    @cached_property
    def q(self) -> Array:
        """Coordinates, (n, rows, 2)."""
        return self._nodes(self.solution.fields[self.body].coordinates)

    @cached_property
    def a(self) -> Array:
        """Accelerations, like q."""
        return self._nodes(self.solution.fields[self.body].accelerations)

    @property
    def half(self) -> int:
        """Vectors of a node."""
        return self.q.shape[1] // 2

    @property
    def points(self) -> int:
        """Gauss points of the integrals: (r(s) − r) × r̈ is of twice the degree of the axis."""
        return self.element.degree + 1

    @cached_property
    def actions(self) -> list[tuple[float, Action]]:
        """What acts on places of the element, each with ξ; on a node between two elements it acts on the first."""
        count = element_count(self.solution, self.body)
        found = []
        for action in actions_on(self.solution, self.body):
            place = float(action.place.key) * count
            if max(ceil(place - 1e-12) - 1, 0) == self.number:
                found.append((place - self.number, action))
        return found

    @cached_property
    def load(self) -> Array:
        """Forces along the element, (n, 2), N/m."""
        return along(self.solution, self.body)

    @cached_property
    def holding(self) -> Array:
        """R: generalized forces that hold the element in its motion, (n, rows, 2)."""
        element = self.element
        v = self._nodes(self.solution.fields[self.body].velocities)
        R = np.stack([element.force(q) for q in self.q])
        if element.damping and not self.solution.static:
            R += np.stack([element.damping_force(q, w) for q, w in zip(self.q, v, strict=True)])
        R += np.einsum("ij,njc->nic", element.mass, self.a)
        R -= np.einsum("i,nc->nic", element.load, self.load)
        for x, action in self.actions:
            R -= np.einsum("i,nc->nic", element.axis(x)[0], action.force)
            weight = element.turning(x)[0]
            g = np.einsum("i,nic->nc", weight, self.q)
            turned = np.stack([-g[:, 1], g[:, 0]], axis=1) / np.einsum("nc,nc->n", g, g)[:, None]
            R -= np.einsum("i,n,nc->nic", weight, action.moment, turned)
        return R

    def at_node(self, side: int) -> tuple[Array, Array]:
        """Force (n, 2) and moment (n,) that hold the element at its node I (0) or O (1)."""
        R = self.holding[:, side * self.half : (side + 1) * self.half]
        q = self.q[:, side * self.half : (side + 1) * self.half]
        return R[:, 0], sum(cross(q[:, k], R[:, k]) for k in range(1, self.half))  # type: ignore[return-value]

    def place(self, x: float) -> Array:
        """Positions at ξ, (n, 2)."""
        return self._along(self.q, x)

    def slope(self, x: float) -> Array:
        """Slope of the axis at ξ, (n, 2)."""
        return np.einsum("i,nic->nc", self.element.axis(x, 1)[0], self.q)

    def _along(self, series: Array, x: float) -> Array:
        return np.einsum("i,nic->nc", self.element.axis(x)[0], series)

    def beyond(self, x: float) -> tuple[Array, Array]:
        """Force (n, 2) and moment (n,) of what lies beyond ξ = x on what lies before."""
        element, here = self.element, self.place(x)
        force, moment = self.at_node(1)
        total, turning = force.copy(), moment + cross(self.place(1.0) - here, force)
        for y, action in self.actions:
            if y >= x - 1e-12 and y > 0.0:
                total += action.force
                turning = turning + action.moment + cross(self.place(y) - here, action.force)
        body = self.solution.scene.beam(self.body)
        density, section = body.material.density, body.section
        for y, w in zip(*gauss(self.points), strict=True):
            s, ds = x + (1.0 - x) * y, (1.0 - x) * w * element.l
            pull = self.load - density * section.area * self._along(self.a, s)
            total += ds * pull
            turning = turning + ds * cross(self.place(s) - here, pull)
            if isinstance(element, ShearElement):
                d, dd = ((1.0 - s) * z[:, 2] + s * z[:, 5] for z in (self.q, self.a))
                turning = turning - ds * density * section.second_moment * cross(d, dd)
        return total, turning


def cross(a: Array, b: Array) -> Array:
    """a × b of vectors, (n, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
