"""Exudyn with cables: `NodePoint2DSlope1`, `ObjectANCFCable2D`, the same element as `anctmm.elements.cable`.

Whatever element a discretisation names, this solver uses cables; their quadrature is the discretisation's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, sin
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import optional_beside
from anctmm.model.scene import Beam, Scene
from anctmm.results.accounting import accounted
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution
from anctmm.solvers.capabilities import Offer
from reference.adapters import nodes_of, slopes_of
from reference.exudyn.model import Model
from reference.exudyn.run import CHOICES, LACKS, ExudynAdapter, python_callbacks

__all__ = ["OFFER", "python_callbacks", "solve", "solve_static"]

Array = NDArray[np.float64]

OFFER = Offer(
    lacks=optional_beside(("cable", "shear")) | LACKS,
    element="cable",
    limits={"cable": "elastica"},
    choices=CHOICES,
)
#: Exudyn's numbers of the quadratures.
QUADRATURE = {"full": 0, "reduced": 1, "lobatto": 2}


@accounted
def solve(scene: Scene, run: Discretisation | None = None, **options: Any) -> Solution:
    """Motion of a scene by Exudyn with cables, with status "unsupported" where Exudyn cannot do it.

    Options are those of a discretisation (`newton_tolerance` is not used: Exudyn bounds residuals), and `tolerances`
    and `newton` of `ExudynAdapter`.
    """
    return Cables.of(scene, run, options).solution()


@accounted
def solve_static(
    scene: Scene, run: Discretisation | None = None, *, load_steps: int = 10, **options: Any
) -> Solution:
    """Equilibrium of a scene by Exudyn with cables, loads and drives as they are at t = 0.

    `t` of the solution are load factors; `load_steps` equal steps of the load, smaller ones where Newton fails.
    """
    return Cables.of(scene, run, options, load_steps).solution()


@dataclass
class Cables(ExudynAdapter):
    """A scene in Exudyn with `ObjectANCFCable2D`s; a node's coordinates are x, y and the gradient's x, y."""

    name: ClassVar[str] = "exudyn-cable"
    offer: ClassVar[Offer] = OFFER
    width: ClassVar[int] = 4

    def solution(self) -> Solution:
        """The answer, with the element that was used, by which forces are found from it."""
        found = super().solution()
        return found if found.run is None else replace(found, run=replace(found.run, element="cable"))

    def reference(self, body: Beam) -> Array:
        places, _ = nodes_of(body, self.counts[body.name])
        along = (np.array(body.end) - body.start) / body.length
        return np.column_stack([places, np.tile(along, (len(places), 1))])

    def velocity(self, body: Beam) -> Array:
        count = self.counts[body.name]
        return np.column_stack([nodes_of(body, count)[1], slopes_of(body, count)])

    def spin(self, body: Beam, rate: float) -> Array:
        return np.array([0.0, 0.0, -rate * sin(body.angle), rate * cos(body.angle)])

    def uniform(self, body: Beam, force: Array) -> Array:
        """∫N dx by the Hermite polynomials: gradients' parts cancel but at the ends."""
        l, forces = self.length(body), np.zeros((self.counts[body.name] + 1, 4))  # noqa: E741
        forces[:-1, :2] += 0.5 * l * force
        forces[1:, :2] += 0.5 * l * force
        forces[0, 2:], forces[-1, 2:] = l * l / 12.0 * force, -l * l / 12.0 * force
        return forces

    def inside(self, body: Beam, fraction: float) -> tuple[int, float]:
        count = self.counts[body.name]
        index = min(int(fraction * count), count - 1)
        return index, (fraction * count - index) * self.length(body)

    def add(self, model: Model, body: Beam, velocity: Array) -> tuple[list[Any], list[Any]]:
        items, material, section = model.items, body.material, body.section
        nodes = [
            model.mbs.AddNode(items.NodePoint2DSlope1(referenceCoordinates=q, initialVelocities=v))
            for q, v in zip(self.reference(body), velocity, strict=True)
        ]
        EA, EI = material.E * section.area, material.E * section.second_moment
        constants = {
            "length": self.length(body),
            "massPerLength": material.density * section.area,
            "axialStiffness": EA,
            "bendingStiffness": EI,
            "axialDamping": material.damping * EA,
            "bendingDamping": material.damping * EI,
            "useReducedOrderIntegration": QUADRATURE[self.run.quadrature],
        }
        elements = [items.ObjectANCFCable2D(nodeNumbers=list(pair), **constants) for pair in pairwise(nodes)]
        return nodes, [model.mbs.AddObject(element) for element in elements]

    def welded(self, angle: float) -> Array:
        """The gradient is turned; positions are equal."""
        matrix = np.eye(4)
        if abs(angle) > 1e-14:
            matrix[2:, 2:] = [[cos(angle), -sin(angle)], [sin(angle), cos(angle)]]
        return matrix

    def turned(self, body: Beam) -> dict[int, Any]:
        """Displacements of a gradient of length 1 turned from the body's direction."""
        start = body.angle
        return {
            2: lambda angle, m: m.cos(angle + start) - cos(start),
            3: lambda angle, m: m.sin(angle + start) - sin(start),
        }

    def field(self, body: Beam, coordinates: Array, rates: Sequence[Array]) -> HermiteField:
        shape = (*coordinates.shape[:2], 2, 2)
        return HermiteField(coordinates.reshape(shape), body.length, *(kept.reshape(shape) for kept in rates))
