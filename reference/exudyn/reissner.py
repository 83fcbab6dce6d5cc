"""Exudyn with Reissner's shear-flexible beam: `NodeRigidBody2D` and `ObjectBeamGeometricallyExact2D`.

Whatever element a discretisation names, this solver uses these. Poisson's ratio enters only by the shear
stiffness kGA. The cost is that of Exudyn's `SolveDynamic` or `SolveStatic` alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation, discretise, parts_of_load
from anctmm.discretise.mesh import BodyMesh, build
from anctmm.elements.kinds import optional_beside
from anctmm.errors import DiscretisationError, shown
from anctmm.model.scene import Beam, Scene, checked_scene
from anctmm.results.fields import LagrangeField
from anctmm.results.solution import Solution
from anctmm.solvers.capabilities import Offer
from anctmm.validation import positive
from reference.exudyn.mechanisms import LACKS
from reference.exudyn.model import Model
from reference.exudyn.run import CHOICES, ELEMENTS, check_room, dynamics, statics

Array = NDArray[np.float64]

OFFER = Offer(
    lacks=optional_beside(ELEMENTS) | {"zhai + joints", "zhai + drives"} | LACKS | {"interior-loads"},
    element="reissner",
    order=4.0,
    limits={"shear": "reissner"},
    choices=CHOICES,
)
#: By order, on [0, 1]: Gauss points and weights of the strains, ∫N dx and ∫N Nᵀ dx over a length of 1.
GAUSS = {1: ([0.5], [1.0]), 2: ([0.5 - 0.75**0.5 / 3, 0.5 + 0.75**0.5 / 3], [0.5, 0.5])}
WEIGHT = {1: np.array([1.0, 1.0]) / 2, 2: np.array([1.0, 4.0, 1.0]) / 6}
MASS = {
    1: np.array([[2.0, 1.0], [1.0, 2.0]]) / 6,
    2: np.array([[4.0, 2.0, -1.0], [2.0, 16.0, 2.0], [-1.0, 2.0, 4.0]]) / 30,
}


def solve(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    order: int = 2,
    shear_factor: float = 1.0,
    tolerances: tuple[float, float] | None = None,
    newton: str = "modified",
    **options: Any,
) -> Solution:
    """Motion of a scene by Exudyn with Reissner beams.

    Parameters
    ----------
    scene : Scene
        Beams joined in any way: chains, trees, loops, several components.
    run : Discretisation, optional
        As for `exudyn_cable.solve`; its `element` and `quadrature` are not used.
    order : int
        1: two nodes and one Gauss point an element; 2: three nodes and two points.
    shear_factor : float
        k of the shear stiffness kGA; 1 is what the paper's element tends to.
    tolerances : (float, float), optional
        Newton's, of the residual: relative to the first one of a step, and absolute, N. By default 1e-7, and
        1e-9 or what rounding leaves, if that is more.
    newton : str
        When Newton's iteration takes a new tangent: "modified", where it converges too slowly; "each-step", at
        the start of each step; "full", at each correction.
    **options
        The fields of the discretisation, in its place.

    Returns
    -------
    Solution
        With status "unsupported" where Exudyn cannot do the scene.
    """
    run = discretise(run, options)
    check_room(scene, run)
    return dynamics(ReissnerBeams(scene, run, order, shear_factor), scene, run, tolerances, newton)


def solve_static(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    load_steps: int = 10,
    order: int = 2,
    shear_factor: float = 1.0,
    **options: Any,
) -> Solution:
    """Equilibrium of a scene by Exudyn with Reissner beams; `t` of the solution are load factors.

    Parameters
    ----------
    scene : Scene
        Loads and drives as they are at t = 0.
    run : Discretisation, optional
        Its mesh is used.
    load_steps : int
        Equal steps of the load; Exudyn takes smaller ones where Newton fails.
    order, shear_factor
        As for `solve`.
    **options
        The fields of the discretisation, in its place.
    """
    run = discretise(run, options)
    check_room(scene, run, parts_of_load(load_steps) + 1)
    return statics(ReissnerBeams(scene, run, order, shear_factor), scene, run, load_steps)


@dataclass
class ReissnerBeams:
    """`ObjectBeamGeometricallyExact2D`s over a scene; a node has x, y and the angle of its section."""

    scene: Scene
    run: Discretisation
    order: int = 2
    shear_factor: float = 1.0
    solver = "exudyn-reissner"
    width = 3
    kind = "turning"
    constant_torques = True
    lacks = LACKS | {"interior-loads"}
    """Features of mechanisms: Exudyn's beams do not give rotations between nodes."""
    meshes: dict[str, BodyMesh] = field(init=False)

    def __post_init__(self) -> None:
        if type(self.order) is not int or self.order not in WEIGHT:
            raise DiscretisationError(f"order is {shown(self.order)}; 1 or 2 is allowed")
        self.shear_factor = positive("shear_factor", self.shear_factor, DiscretisationError)
        checked_scene(self.scene)
        intervals = {name: self.order * count for name, (count, _) in self.run.of(self.scene).items()}
        self.meshes = build(self.scene, replace(self.run, mesh=intervals, element="cable"))

    def length(self, body: Beam) -> float:
        """Length of each of a body's elements, m."""
        return self.order * body.length / self.meshes[body.name].elements

    def reference(self, body: Beam) -> Array:
        """Reference coordinates, (nodes, 3)."""
        q = self.meshes[body.name].reference
        return np.column_stack([q[:, 0], np.full(len(q), body.angle)])

    def velocity(self, body: Beam) -> Array:
        """Velocities at t = 0, (nodes, 3); sections turn with the axis."""
        mesh = self.meshes[body.name]
        along, v = mesh.reference[0, 1], mesh.initial_velocity
        rates = v[:, 1] @ np.array([-along[1], along[0]])
        return np.column_stack([v[:, 0], rates])

    def spin(self, body: Beam, rate: float) -> Array:
        """The rate of the angle."""
        return np.array([0.0, 0.0, rate])

    def weight(self, body: Beam) -> Array:
        """Consistent forces of gravity, (nodes, 3), N."""
        return self.uniform(body, body.material.density * body.section.area * np.array(self.scene.gravity))

    def uniform(self, body: Beam, force: Array) -> Array:
        """Consistent forces of a force per length, (nodes, 3), N."""
        nodal = np.zeros(self.meshes[body.name].nodes)
        for k, share in enumerate(WEIGHT[self.order]):
            nodal[k : len(nodal) - self.order + k : self.order] += share
        return np.column_stack([self.length(body) * np.outer(nodal, force), 0.0 * nodal])

    def stiffness(self, body: Beam) -> Array:
        """EA, kGA and EI, in N, N and N m²."""
        section, E, (_, G) = body.section, body.material.E, body.material.lame
        return np.array([E * section.area, self.shear_factor * G * section.area, E * section.second_moment])

    def inertia(self, body: Beam) -> Array:
        """ρA, ρA and ρI of x, y and the angle, in kg/m, kg/m and kg m."""
        A, I = body.section.area, body.section.second_moment  # noqa: E741
        return body.material.density * np.array([A, A, I])

    def add(self, model: Model, body: Beam, velocity: Array) -> tuple[list[Any], list[Any]]:
        """Add a body's nodes and elements."""
        items, (EA, GA, EI) = model.items, self.stiffness(body).tolist()
        mass, _, inertia = self.inertia(body).tolist()
        nodes = [
            model.mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=q, initialVelocities=v))
            for q, v in zip(self.reference(body), velocity, strict=True)
        ]
        elements = [
            model.mbs.AddObject(
                items.ObjectBeamGeometricallyExact2D(
                    nodeNumbers=nodes[first : first + self.order + 1],
                    length=self.length(body),
                    massPerLength=mass,
                    crossSectionInertia=inertia,
                    axialStiffness=EA,
                    shearStiffness=GA,
                    bendingStiffness=EI,
                    axialDamping=body.material.damping * EA,
                    shearDamping=body.material.damping * GA,
                    bendingDamping=body.material.damping * EI,
                )
            )
            for first in range(0, len(nodes) - 1, self.order)
        ]
        return nodes, elements

    def welded(self, one: Beam, two: Beam) -> Array:
        """All displacements are equal, at any angle."""
        return np.eye(3)

    def turned(self, body: Beam) -> dict[int, Any]:
        """The angle itself."""
        return {2: lambda angle, m: angle}

    def angle(self, coordinates: Array) -> Array:
        """Angle of the section, rad."""
        return coordinates[:, 2]

    def field(self, body: Beam, coordinates: Array, rates: Sequence[Array]) -> LagrangeField:
        """Motion of a body's axis."""
        velocities = rates[0][..., :2] if rates else None
        return LagrangeField(coordinates[..., :2], self.order, velocities, coordinates[..., 2])

    def energies(self, body: Beam, coordinates: Array, velocities: Array) -> tuple[Array, Array]:
        """Kinetic and strain energy, J, by the element's own rules (strains: Simo & Vu-Quoc 1986)."""
        l = self.length(body)  # noqa: E741
        v, q = self._by_element(velocities), self._by_element(coordinates)
        kinetic = 0.5 * l * np.einsum("c,teic,ij,tejc->t", self.inertia(body), v, MASS[self.order], v)
        strain = np.zeros(len(q))
        for x, w in zip(*GAUSS[self.order], strict=True):
            N, D = _lagrange(x, self.order)
            slope = np.einsum("i,teic->tec", D / l, q)
            angle = q[..., 2] @ N
            axial = np.cos(angle) * slope[..., 0] + np.sin(angle) * slope[..., 1] - 1.0
            shear = np.cos(angle) * slope[..., 1] - np.sin(angle) * slope[..., 0]
            strains = np.stack([axial, shear, slope[..., 2]])
            strain += 0.5 * w * l * np.einsum("s,ste->t", self.stiffness(body), strains**2)
        return kinetic, strain

    def _by_element(self, nodal: Array) -> Array:
        """(n, nodes, 3) → (n, elements, nodes of an element, 3)."""
        last = nodal.shape[1] - self.order
        return np.stack([nodal[:, k : last + k : self.order] for k in range(self.order + 1)], axis=2)


def _lagrange(x: float, order: int) -> tuple[Array, Array]:
    """Shape functions and derivatives at x in [0, 1], nodes equally spaced."""
    if order == 1:
        return np.array([1 - x, x]), np.array([-1.0, 1.0])
    shapes = np.array([(1 - x) * (1 - 2 * x), 4 * x * (1 - x), x * (2 * x - 1)])
    return shapes, np.array([4 * x - 3, 4 - 8 * x, 4 * x - 1])
