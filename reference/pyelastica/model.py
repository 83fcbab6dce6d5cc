"""A scene as PyElastica has it: each body a Cosserat rod of its own, ends held by constraints and half-element springs.

PyElastica: Gazzola et al. 2018, doi:10.1098/rsos.171628. Positions and masses stand at the nodes, directors at the
elements between them, curvatures at the inner nodes. Its rods are round and move in space; here section and
inertia are overwritten with the beam's own, and nothing drives a rod out of the plane.
"""

from dataclasses import dataclass
from math import hypot, sqrt
from typing import Any

import elastica as ea
import numpy as np
from numpy.typing import NDArray

from anctmm.model.scene import Beam, Clamp, Force, Scene, Torque

Array = NDArray[np.float64]


class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):  # type: ignore[misc]
    """PyElastica's collection of rods with what acts on them."""


class EndsAndWeight(ea.NoForces):  # type: ignore[misc]
    """Weight, dead forces and moments on the ends, and the springs of clamps.

    A clamp holds the first director only, half an element away from the end, so that an element's rotation is lost
    (first order). Instead the curvature of that half element acts, as any other of the rod: 2EI/l times its angle.
    """

    def __init__(self, rod: "Rod") -> None:
        super().__init__()
        self.rod = rod

    def apply_forces(self, system: Any, time: Any = 0.0) -> None:
        """Add the forces on nodes, N."""
        system.external_forces[:2] += self.rod.factor * self.rod.forces

    def apply_torques(self, system: Any, time: Any = 0.0) -> None:
        """Add the moments on the outer elements, N m; the first director stands across the plane."""
        for end, moment in self.rod.moments.items():
            system.external_torques[0, end] += self.rod.factor * moment
        for end, spring in self.rod.springs.items():
            system.external_torques[0, end] -= spring * self.rod.angle(end)


@dataclass
class Rod:
    """One body as a Cosserat rod, with PyElastica's own (`rod`) inside.

    `relaxed`: whether masses are fictitious, chosen so that all parts of the rod have one largest frequency.
    """

    scene: Scene
    body: Beam
    elements: int
    shear_factor: float = 1.0
    relaxed: bool = False
    factor: float = 1.0

    def __post_init__(self) -> None:
        body, section, material = self.body, self.body.section, self.body.material
        self.l = body.length / self.elements  # of an element, m
        self.EA, self.EI = material.E * section.area, material.E * section.second_moment
        self.GA = self.shear_factor * material.lame[1] * section.area
        # of an inner node, kg, and of an element, kg m²
        self.mass, self.inertia = (
            material.density * x * self.l for x in (section.area, section.second_moment)
        )
        self.held: dict[int, str] = {}
        for joint in self.scene.joints:
            held, side = self.scene.body_end(joint.ends[0])
            if held is body:
                self.held[-1 if side else 0] = "clamp" if isinstance(joint, Clamp) else "pin"
        nodal = np.full(self.elements + 1, self.mass)
        nodal[[0, -1]] *= 0.5
        self.forces = np.outer(np.asarray(self.scene.gravity), nodal)
        self.springs = {
            end: 2.0 * self.EI / self.l for end, held in self.held.items() if held == "clamp"
        }  # N m/rad
        self.moments = {0: 0.0, -1: 0.0}
        self._load()
        if self.relaxed:  # every diagonal of the stiffness over its inertia is at most 1 s⁻²
            self.mass = 4.0 * max(self.EA, 2.0 * self.GA) / self.l
            self.inertia = 2.0 * self.GA * self.l + 4.0 * self.EI / self.l
        self.rod = self._straight()

    def _load(self) -> None:
        """Add the loads on both ends."""
        for load in self.scene.loads:
            assert isinstance(load, Force | Torque)  # others are refused
            body, side = self.scene.body_end(load.end)
            end = -1 if side else 0
            if body is self.body and isinstance(load, Force):
                self.forces[:, end] += load.value
            elif body is self.body:
                self.moments[end] += float(load.value)  # type: ignore[arg-type]

    @property
    def largest_frequency(self) -> float:
        """Of the straight grid, rad/s.

        The shortest wave, of two elements, has the axial frequency √(4EA/(l m)); across, w at the nodes and θ at the
        elements are coupled by the shear strain (w₊ − w₋)/l − θ.
        """
        mass, inertia = self.mass, self.inertia
        a, c = 4.0 * self.GA / (self.l * mass), 2.0 * self.GA / sqrt(mass * inertia)
        d = (self.GA * self.l + 4.0 * self.EI / self.l) / inertia
        across = 0.5 * (a + d + hypot(a - d, 2.0 * c))
        return sqrt(max(across, 4.0 * self.EA / (self.l * mass)))

    @property
    def axis(self) -> Array:
        """Direction of the undeformed rod, (2,)."""
        return np.array([np.cos(self.body.angle), np.sin(self.body.angle)])

    def angle(self, element: int) -> float:
        """Turn of an element's section from the reference, rad."""
        x, y = self.rod.director_collection[2, :2, element]
        along, across = self.axis
        return float(np.arctan2(along * y - across * x, along * x + across * y))

    def add_to(self, simulator: Simulator) -> None:
        """Put the rod, its supports and its loads into a simulator."""
        simulator.append(self.rod)
        for end in self.held:
            node = self.elements if end else 0
            simulator.constrain(self.rod).using(ea.FixedConstraint, constrained_position_idx=(node,))
        simulator.add_forcing_to(self.rod).using(EndsAndWeight, self)

    def energies(self) -> tuple[float, float, float]:
        """Kinetic and strain energy by PyElastica's own rules, with that of the clamps' springs, and potential, J."""
        rod = self.rod
        kinetic = rod.compute_translational_energy() + rod.compute_rotational_energy()
        springs = sum(0.5 * k * self.angle(end) ** 2 for end, k in self.springs.items())
        strain = rod.compute_bending_energy() + rod.compute_shear_energy() + springs
        return float(kinetic), float(strain), -float(np.sum(self.forces * rod.position_collection[:2]))

    def _straight(self) -> Any:
        """PyElastica's rod, with the beam's stiffness and inertia about every axis of its section."""
        body = self.body
        rod = ea.CosseratRod.straight_rod(
            self.elements, np.array([*body.start, 0.0]), np.array([*self.axis, 0.0]), np.array([0.0, 0.0, 1.0]),
            body.length, sqrt(body.section.area / np.pi), body.material.density,
            youngs_modulus=body.material.E, shear_modulus=body.material.lame[1],
        )  # fmt: skip
        rod.shear_matrix[:] = np.diag([self.GA, self.GA, self.EA])[..., None]
        rod.bend_matrix[:] = (self.EI * np.eye(3))[..., None]
        rod.mass_second_moment_of_inertia[:] = (self.inertia * np.eye(3))[..., None]
        rod.inv_mass_second_moment_of_inertia[:] = (np.eye(3) / self.inertia)[..., None]
        rod.mass[:] = self.mass
        rod.mass[[0, -1]] *= 0.5
        if body.velocity is not None and not self.relaxed:
            v = np.array([body.velocity_at(x) for x in np.linspace(0.0, 1.0, self.elements + 1)]).T
            rod.velocity_collection[:2] = v
            normal = np.array([-self.axis[1], self.axis[0]])
            rod.omega_collection[0] = normal @ np.diff(v, axis=1) / self.l
        return rod
