"""Section forces of beams, from the equilibrium of an element and not from differentiated strains.

The generalized forces that hold an element in its motion are R = f(q) + M q̈ − g, f elastic and damping forces, g those
of what acts on it. At its outboard node they are what lies beyond exerts: a force R_r, and the moment Σ g × R_g over
all other vectors g of the node. Shape functions contain every rigid motion, so these are in equilibrium with the
inertia ρA r̈ of the element's own motion, and a section in between follows from that of the part beyond it, exactly:

    F(x) = R_r + Σ F_k + ∫_x^l (p − ρA r̈) ds,
    M(x) = M_O + (r_O − r) × R_r + Σ ((r_k − r) × F_k + M_k) + ∫_x^l ((r(s) − r) × (p − ρA r̈) − ρI d × d̈) ds.

F_k, M_k act at or beyond the section; what acts on the very start acts before it.
"""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import kind_of
from anctmm.elements.shapes import gauss
from anctmm.elements.shear import ShearElement
from anctmm.errors import ResultError
from anctmm.results.fields import HermiteField, InterpolatedField, cross
from anctmm.results.internal_forces.actions import Action, actions_on, along, turned

Array = NDArray[np.float64]


def section_force(solution: Any, body: str, fraction: float) -> Array:
    """N, Q, M of the part beyond a section on the part before it, (n, 3); see `Solution.section_force`."""
    beam = HeldBeam(solution, body)
    number, x = beam.element_at(float(fraction))
    force, moment = beam.beyond(number, x)
    tangent = np.einsum("i,nic->nc", beam.element.axis(x, 1)[0], beam.of_element(beam.q, number))
    tangent = tangent / np.hypot(*tangent.T)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    return np.stack([(tangent * force).sum(axis=1), (normal * force).sum(axis=1), moment], axis=1)


class HeldBeam:
    """A beam of elements that bend over all outputs, and what holds its nodes.

    ResultError if the solution does not have what section forces are found from.
    """

    def __init__(self, solution: Any, name: str) -> None:
        self.solution, self.name, self.body = solution, name, solution.scene.beam(name)
        field = solution.fields.get(name)
        ours = isinstance(field, HermiteField) and not isinstance(field, InterpolatedField)
        unknown = f"section forces of {name!r} are not known by solver {solution.solver!r}"
        if not ours or solution.run is None:
            raise ResultError(f"{unknown}: ANCF elements are needed")
        self.count, kind = field.coordinates.shape[1] - 1, kind_of(solution.run.of(solution.scene)[name][1])
        if kind.rigid:
            raise ResultError(f"{unknown}: it is rigid; elements that bend are needed")
        if field.accelerations is None and not solution.static:
            raise ResultError(f"{unknown}: accelerations are needed, which it does not keep")
        self.element = kind.element_of(self.body, self.count, solution.run.quadrature)
        #: Coordinates and their rates, (n, nodes, vectors, dim), 0 where there is none.
        self.q = field.coordinates
        rates = (field.velocities, field.accelerations)
        self.v, self.a = (np.zeros_like(self.q) if x is None else x for x in rates)
        self._holding = dict[int, Array]()

    def element_at(self, fraction: float) -> tuple[int, float]:
        """Element of a place and ξ there, 0 or 1 at a node; at one between two elements the first."""
        along = fraction * self.count
        node = round(along)
        if abs(along - node) <= 1e-9:
            return max(node - 1, 0), float(node > 0)
        return int(along), along - int(along)

    def mass_of(self, node: int) -> Array:
        """Mass of each vector of a node, (vectors,), kg for its position."""
        first, last = np.split(np.diag(self.element.mass), 2)
        return np.asarray(last * (node > 0) + first * (node < self.count))

    def of_element(self, series: Array, number: int) -> Array:
        """Vectors of both nodes of an element, (n, vectors, dim)."""
        return series[:, number : number + 2].reshape(len(series), -1, series.shape[-1])

    @cached_property
    def actions(self) -> dict[int, list[tuple[float, Action]]]:
        """What acts on places of each element, with ξ."""
        found: dict[int, list[tuple[float, Action]]] = {}
        for action in actions_on(self.solution, self.name):
            number, x = self.element_at(float(action.place.key))
            found.setdefault(number, []).append((x, action))
        return found

    @cached_property
    def load(self) -> Array:
        """Forces along the beam, (n, dim), N/m."""
        return along(self.solution, self.name)

    def holding(self, number: int) -> Array:
        """R: generalized forces that hold an element in its motion, (n, vectors, dim)."""
        if number in self._holding:
            return self._holding[number]
        element = self.element
        q, v, a = (self.of_element(x, number) for x in (self.q, self.v, self.a))
        R = np.stack([element.force(x) for x in q])
        if element.damping and not self.solution.static:
            R += np.stack([element.damping_force(x, y) for x, y in zip(q, v, strict=True)])
        R += np.einsum("ij,njc->nic", element.mass, a) - np.einsum("i,nc->nic", element.load, self.load)
        for x, action in self.actions.get(number, []):
            R -= np.einsum("i,nc->nic", element.axis(x)[0], action.force)
            weight = element.turning(x)[0]
            g = np.einsum("i,nic->nc", weight, q)
            pull = turned(action.moment, g) / np.einsum("nc,nc->n", g, g)[:, None]
            R -= np.einsum("i,nc->nic", weight, pull)
        self._holding[number] = R
        return R

    def at_node(self, node: int) -> Array:
        """Generalized forces on a node of all but its beam, (n, vectors, dim)."""
        half = self.q.shape[2]
        before = self.holding(node - 1)[:, half:] if node > 0 else 0.0
        return np.asarray(before + (self.holding(node)[:, :half] if node < self.count else 0.0))

    def beyond(self, number: int, x: float) -> tuple[Array, Array]:
        """Force (n, 2) and moment (n,) of what lies beyond ξ = x of an element on what lies before."""
        q, a = self.of_element(self.q, number), self.of_element(self.a, number)
        half, element, section = self.q.shape[2], self.element, self.body.section

        def axis(series: Array, y: float) -> Array:
            return np.einsum("i,nic->nc", element.axis(y)[0], series)

        here, end, R = axis(q, x), q[:, half:], self.holding(number)[:, half:]
        total = R[:, 0].copy()
        turning = cross(end[:, 0] - here, R[:, 0]) + sum(cross(end[:, k], R[:, k]) for k in range(1, half))
        for y, action in self.actions.get(number, []):
            if y >= x - 1e-12 and y > 0.0:
                total += action.force
                turning = turning + action.moment[:, 0] + cross(axis(q, y) - here, action.force)
        density = self.body.material.density
        for y, w in zip(*gauss(element.degree + 1), strict=True):  # r × r̈ is of twice the degree of the axis
            s, ds = x + (1.0 - x) * y, (1.0 - x) * w * element.l
            pull = self.load - density * section.area * axis(a, s)
            total += ds * pull
            turning = turning + ds * cross(axis(q, s) - here, pull)
            if isinstance(element, ShearElement):
                d, dd = ((1.0 - s) * z[:, 2] + s * z[:, 5] for z in (q, a))
                turning = turning - ds * density * section.second_moment * cross(d, dd)
        return total, turning
