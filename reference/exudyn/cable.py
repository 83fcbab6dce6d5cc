"""Exudyn with cables: `NodePoint2DSlope1`, `ObjectANCFCable2D`, the same element as `anctmm.elements.cable`.

Whatever element a discretisation names, this solver uses cables; their quadrature is the discretisation's.
The cost is that of Exudyn's `SolveDynamic` or `SolveStatic` alone: building and assembling the model and
reading the history are outside.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation, discretise, parts_of_load
from anctmm.discretise.mesh import BodyMesh, build
from anctmm.elements.kinds import optional_beside
from anctmm.model.scene import Beam, Scene, checked_scene
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution
from anctmm.solvers.capabilities import Offer
from reference.exudyn.mechanisms import LACKS
from reference.exudyn.model import Model
from reference.exudyn.run import CHOICES, ELEMENTS, check_room, dynamics, statics

Array = NDArray[np.float64]

OFFER = Offer(
    lacks=optional_beside(ELEMENTS) | {"zhai + joints", "zhai + drives"} | LACKS,
    element="cable",
    limits={"cable": "elastica"},
    choices=CHOICES,
)
#: Exudyn's numbers of the quadratures.
QUADRATURE = {"full": 0, "reduced": 1, "lobatto": 2}
#: Elements times output times whose energies are computed at once.
BATCH = 100_000


def solve(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    tolerances: tuple[float, float] | None = None,
    newton: str = "modified",
    **options: Any,
) -> Solution:
    """Motion of a scene by Exudyn with cables.

    Parameters
    ----------
    scene : Scene
        Beams joined in any way: chains, trees, loops, several components.
    run : Discretisation, optional
        "generalized-alpha" is Exudyn's, with fixed steps; "zhai" with ψ = φ = ½ is its
        VelocityVerlet, which has the same positions, for beams without joints between them or drives.
        `newton_tolerance` is not used: Exudyn bounds residuals.
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
    return _of_cables(dynamics(Cables(scene, run), scene, run, tolerances, newton))


def solve_static(
    scene: Scene, run: Discretisation | None = None, *, load_steps: int = 10, **options: Any
) -> Solution:
    """Equilibrium of a scene by Exudyn with cables; `t` of the solution are load factors.

    Parameters
    ----------
    scene : Scene
        Loads and drives as they are at t = 0.
    run : Discretisation, optional
        Its mesh and quadrature are used.
    load_steps : int
        Equal steps of the load; Exudyn takes smaller ones where Newton fails.
    **options
        The fields of the discretisation, in its place.
    """
    run = discretise(run, options)
    check_room(scene, run, parts_of_load(load_steps) + 1)
    return _of_cables(statics(Cables(scene, run), scene, run, load_steps))


def _of_cables(found: Solution) -> Solution:
    """The same with the element that was used, by which forces are found from it."""
    return found if found.run is None else replace(found, run=replace(found.run, element="cable"))


@dataclass
class Cables:
    """`ObjectANCFCable2D`s over a scene; a node's coordinates are x, y and the gradient's x, y."""

    scene: Scene
    run: Discretisation
    solver = "exudyn-cable"
    width = 4
    kind = "cable"
    constant_torques = False
    lacks = LACKS
    meshes: dict[str, BodyMesh] = field(init=False)

    def __post_init__(self) -> None:
        self.run.of(checked_scene(self.scene))
        self.meshes = build(self.scene, replace(self.run, element="cable"))

    def reference(self, body: Beam) -> Array:
        """Reference coordinates, (nodes, 4)."""
        return self.meshes[body.name].reference.reshape(-1, 4)

    def velocity(self, body: Beam) -> Array:
        """Velocities at t = 0, (nodes, 4)."""
        return self.meshes[body.name].initial_velocity.reshape(-1, 4)

    def spin(self, body: Beam, rate: float) -> Array:
        """Velocity of a gradient that turns."""
        return np.array([0.0, 0.0, -rate * sin(body.angle), rate * cos(body.angle)])

    def weight(self, body: Beam) -> Array:
        """Consistent forces of gravity, (nodes, 4), N."""
        return self.meshes[body.name].weight.reshape(-1, 4)

    def uniform(self, body: Beam, force: Array) -> Array:
        """∫N dx by the Hermite polynomials: gradients' parts cancel but at the ends."""
        mesh = self.meshes[body.name]
        l, forces = mesh.element.l, np.zeros((mesh.nodes, 4))  # noqa: E741
        forces[:-1, :2] += 0.5 * l * force
        forces[1:, :2] += 0.5 * l * force
        forces[0, 2:], forces[-1, 2:] = l * l / 12.0 * force, -l * l / 12.0 * force
        return forces

    def inside(self, body: Beam, fraction: float) -> tuple[int, float]:
        """Exudyn counts from the element's start."""
        mesh = self.meshes[body.name]
        index = min(int(fraction * mesh.elements), mesh.elements - 1)
        return index, (fraction * mesh.elements - index) * mesh.element.l

    def add(self, model: Model, body: Beam, velocity: Array) -> tuple[list[Any], list[Any]]:
        """Add a body's nodes and elements."""
        mesh, items = self.meshes[body.name], model.items
        nodes = [
            model.mbs.AddNode(items.NodePoint2DSlope1(referenceCoordinates=q, initialVelocities=v))
            for q, v in zip(self.reference(body), velocity, strict=True)
        ]
        elements = [
            model.mbs.AddObject(
                items.ObjectANCFCable2D(
                    nodeNumbers=list(pair),
                    length=mesh.element.l,
                    massPerLength=body.material.density * body.section.area,
                    axialStiffness=body.material.E * body.section.area,
                    bendingStiffness=body.material.E * body.section.second_moment,
                    axialDamping=body.material.damping * body.material.E * body.section.area,
                    bendingDamping=body.material.damping * body.material.E * body.section.second_moment,
                    useReducedOrderIntegration=QUADRATURE[self.run.quadrature],
                )
            )
            for pair in pairwise(nodes)
        ]
        return nodes, elements

    def welded(self, one: Beam, two: Beam) -> Array:
        """The second's gradient is the first's, turned by the angle between them; positions are equal."""
        angle = two.angle - one.angle
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

    def angle(self, coordinates: Array) -> Array:
        """Direction of the gradient, rad."""
        return np.unwrap(np.arctan2(coordinates[:, 3], coordinates[:, 2]))

    def field(self, body: Beam, coordinates: Array, rates: Sequence[Array]) -> HermiteField:
        """Motion of a body's axis."""
        shape = (*coordinates.shape[:2], 2, 2)
        return HermiteField(coordinates.reshape(shape), body.length, *(kept.reshape(shape) for kept in rates))

    def energies(self, body: Beam, coordinates: Array, velocities: Array) -> tuple[Array, Array]:
        """Kinetic and strain energy, J, by the element's own rules."""
        mesh = self.meshes[body.name]
        kinetic, strain = np.empty(len(coordinates)), np.empty(len(coordinates))
        size = max(1, BATCH // mesh.elements)
        for first in range(0, len(coordinates), size):
            rows = slice(first, first + size)
            v = _by_element(velocities[rows])
            kinetic[rows] = 0.5 * np.einsum("teic,ij,tejc->t", v, mesh.element.mass, v)
            strain[rows] = _strain(mesh, _by_element(coordinates[rows]))
        return kinetic, strain


def _by_element(nodal: Array) -> Array:
    """(n, nodes, 4) → (n, elements, 4, 2): the rows r, r', r, r' of both nodes of an element."""
    return np.concatenate([nodal[:, :-1], nodal[:, 1:]], axis=2).reshape(len(nodal), -1, 4, 2)


def _strain(mesh: BodyMesh, q: Array) -> Array:
    """Strain energy at each time, ½∫EA ε² + EI κ² dx (method, section 1)."""
    element: Any = mesh.element
    B, w = element.axial_rule
    stretch = np.linalg.norm(np.einsum("pi,teic->tepc", B, q), axis=-1)
    axial = np.einsum("p,tep->t", w, (stretch - 1.0) ** 2)
    B, C, w = element.bending_rule
    b, c = np.einsum("pi,teic->tepc", B, q), np.einsum("pi,teic->tepc", C, q)
    curvature = (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0]) / (b * b).sum(axis=-1)
    return 0.5 * (element.EA * axial + element.EI * np.einsum("p,tep->t", w, curvature**2))
