"""Exudyn with Reissner's shear-flexible beam: `NodeRigidBody2D` and `ObjectBeamGeometricallyExact2D`.

Whatever element a discretisation names, this solver uses these. Poisson's ratio enters only by the shear stiffness kGA.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import optional_beside
from anctmm.errors import DiscretisationError, shown
from anctmm.model.scene import Beam, Scene
from anctmm.results.accounting import accounted
from anctmm.results.fields import LagrangeField
from anctmm.results.solution import Solution
from anctmm.solvers.capabilities import Offer
from anctmm.validation import positive
from reference.adapters import nodes_of, slopes_of
from reference.exudyn.model import Model
from reference.exudyn.run import CHOICES, LACKS, ExudynAdapter, python_callbacks

__all__ = ["OFFER", "python_callbacks", "solve", "solve_static"]

Array = NDArray[np.float64]

#: Exudyn's beams do not give rotations between nodes.
OFFER = Offer(
    lacks=optional_beside(("cable", "shear")) | LACKS | {"interior-loads"},
    element="reissner",
    order=4.0,
    limits={"shear": "reissner"},
    choices=CHOICES,
)
#: ∫N dx over a length of 1, by order.
WEIGHT = {1: np.array([1.0, 1.0]) / 2, 2: np.array([1.0, 4.0, 1.0]) / 6}


@accounted
def solve(scene: Scene, run: Discretisation | None = None, **options: Any) -> Solution:
    """Motion of a scene by Exudyn with Reissner beams; own options are those of `ReissnerBeams`.

    `element` and `quadrature` are not used.
    """
    return ReissnerBeams.of(scene, run, options).solution()


@accounted
def solve_static(
    scene: Scene, run: Discretisation | None = None, *, load_steps: int = 10, **options: Any
) -> Solution:
    """Equilibrium of a scene by Exudyn with Reissner beams, as by `exudyn_cable.solve_static`."""
    return ReissnerBeams.of(scene, run, options, load_steps).solution()


@dataclass
class ReissnerBeams(ExudynAdapter):
    """A scene with `ObjectBeamGeometricallyExact2D`s; a node has x, y and the angle of its section.

    `order` 1: two nodes and one Gauss point an element; 2: three nodes and two points. `shear_factor`: k of the shear
    stiffness kGA; 1 is what the paper's element tends to.
    """

    order: int = 2
    shear_factor: float = 1.0
    name: ClassVar[str] = "exudyn-reissner"
    offer: ClassVar[Offer] = OFFER
    width: ClassVar[int] = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        if type(self.order) is not int or self.order not in WEIGHT:
            raise DiscretisationError(f"order is {shown(self.order)}; 1 or 2 is allowed")
        self.shear_factor = positive("shear_factor", self.shear_factor, DiscretisationError)

    def reference(self, body: Beam) -> Array:
        places, _ = nodes_of(body, self.order * self.counts[body.name])
        return np.column_stack([places, np.full(len(places), body.angle)])

    def velocity(self, body: Beam) -> Array:
        """Velocities at t = 0, (nodes, 3); sections turn with the axis."""
        intervals = self.order * self.counts[body.name]
        normal = np.array([-np.sin(body.angle), np.cos(body.angle)])
        return np.column_stack([nodes_of(body, intervals)[1], slopes_of(body, intervals) @ normal])

    def spin(self, body: Beam, rate: float) -> Array:
        return np.array([0.0, 0.0, rate])

    def uniform(self, body: Beam, force: Array) -> Array:
        nodal = np.zeros(self.order * self.counts[body.name] + 1)
        for k, share in enumerate(WEIGHT[self.order]):
            nodal[k : len(nodal) - self.order + k : self.order] += share
        return np.column_stack([self.length(body) * np.outer(nodal, force), 0.0 * nodal])

    def inside(self, body: Beam, fraction: float) -> tuple[int, float]:
        """Places between nodes are refused."""
        raise AssertionError(f"no place at {fraction} of {body.name!r}")

    def add(self, model: Model, body: Beam, velocity: Array) -> tuple[list[Any], list[Any]]:
        items, section, material = model.items, body.section, body.material
        nodes = [
            model.mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=q, initialVelocities=v))
            for q, v in zip(self.reference(body), velocity, strict=True)
        ]
        stiffness = {
            "axial": material.E * section.area,
            "shear": self.shear_factor * material.lame[1] * section.area,
            "bending": material.E * section.second_moment,
        }
        constants = {
            "length": self.length(body),
            "massPerLength": material.density * section.area,
            "crossSectionInertia": material.density * section.second_moment,
            **{f"{name}Stiffness": value for name, value in stiffness.items()},
            **{f"{name}Damping": material.damping * value for name, value in stiffness.items()},
        }
        ends = [nodes[k : k + self.order + 1] for k in range(0, len(nodes) - 1, self.order)]
        elements = [items.ObjectBeamGeometricallyExact2D(nodeNumbers=own, **constants) for own in ends]
        return nodes, [model.mbs.AddObject(element) for element in elements]

    def welded(self, angle: float) -> Array:
        """All displacements are equal, at any angle."""
        return np.eye(3)

    def turned(self, body: Beam) -> dict[int, Any]:
        return {2: lambda angle, m: angle}

    def field(self, body: Beam, coordinates: Array, rates: Sequence[Array]) -> LagrangeField:
        velocities = rates[0][..., :2] if rates else None
        return LagrangeField(coordinates[..., :2], self.order, velocities, coordinates[..., 2])
