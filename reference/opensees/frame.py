"""A scene as a model in OpenSees: nodes with two displacements and a rotation, joined by corotational beams.

Welded ends share a node; hinged ends have separate nodes with equal displacements. A driven clamp is a support with a
prescribed rotation.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.accepted import Point
from anctmm.model.drives import Angle, tabulate, value_at
from anctmm.model.loads import load_text, width_of
from anctmm.model.places import End
from anctmm.model.scene import Beam, Force, Scene, Torque
from anctmm.model.topology import Junction, junctions_of
from reference.adapters import nodes_of, slopes_of

Array = NDArray[np.float64]

#: Bound of Newton's last correction that rounding allows, of the scene's extent.
ROUNDING = 1e-11
#: Kinds of beams: OpenSees' element and its mass.
BEAMS = {
    "elastic": "elasticBeamColumn, linear between its ends, with a consistent mass",
    "elastic-lumped": "the same with masses at its nodes",
    "nonlinear": "dispBeamColumnNL, whose rotations stretch the axis, with masses at its nodes",
}


@dataclass
class Frame:
    """Nodes and elements over a scene, of a kind of `BEAMS`.

    `static`: whether loads are held as at t = 0 and drives at their start. `nodes` are numbered from 1, `of_body` has
    those of each body from its start to its end.
    """

    scene: Scene
    run: Discretisation
    beam: str
    static: bool = False
    nodes: list[tuple[float, float]] = field(default_factory=list)
    of_body: dict[str, list[int]] = field(default_factory=dict)
    supports: list[tuple[int, list[int]]] = field(default_factory=list)
    hinges: list[tuple[int, int]] = field(default_factory=list)
    driven: list[tuple[int, str, Angle]] = field(default_factory=list)
    """Node, its drive's name, and the drive."""

    def __post_init__(self) -> None:
        self.counts = {name: count for name, (count, _) in self.run.of(self.scene).items()}
        ends: dict[End, int] = {}
        for junction in junctions_of(self.scene):
            self._add_junction(junction, ends)
        for body in self.scene.beams:
            places, _ = nodes_of(body, self.counts[body.name])
            inner = [self._add_node(tuple(map(float, place))) for place in places[1:-1]]
            self.of_body[body.name] = [ends[body.name, 0], *inner, ends[body.name, 1]]

    @property
    def consistent(self) -> bool:
        """Whether the elements' mass is consistent; that of statics, by which their weight acts, always is."""
        return self.static or self.beam == "elastic"

    @property
    def dofs(self) -> int:
        """Coordinates that are free."""
        held = sum(sum(components) for _, components in self.supports)
        return 3 * len(self.nodes) - held - 2 * len(self.hinges) - len(self.driven)

    def element_length(self, body: Beam) -> float:
        """Of each of a body's elements, m."""
        return body.length / self.counts[body.name]

    def weights(self) -> Array:
        """Forces and moments of gravity on all nodes, (nodes, 3): what accelerates a free beam without bending it.

        OpenSees keeps the mass matrix of an element at rest, so that the moments do not turn with the element either.
        """
        loads, g = np.zeros((len(self.nodes), 3)), np.array(self.scene.gravity)
        for body in self.scene.beams:
            l = self.element_length(body)  # noqa: E741
            share = 0.5 * l * body.material.density * body.section.area
            across = g @ [-np.sin(body.angle), np.cos(body.angle)] * l / 6.0 * self.consistent
            tags = np.array(self.of_body[body.name]) - 1
            loads[tags[:-1]] += share * np.array([*g, across])
            loads[tags[1:]] += share * np.array([*g, -across])
        return loads

    def velocities(self) -> Array:
        """Velocities of all nodes at t = 0 that supports and drives allow, (nodes, 3)."""
        found, seen = np.zeros((len(self.nodes), 3)), np.zeros(len(self.nodes))
        for body in self.scene.beams:
            count, tags = self.counts[body.name], np.array(self.of_body[body.name]) - 1
            normal = np.array([-np.sin(body.angle), np.cos(body.angle)])
            rates = slopes_of(body, count) @ normal
            found[tags] += np.column_stack([nodes_of(body, count)[1], rates])
            seen[tags] += 1.0
        found /= seen[:, None]  # ends that are welded turn with the mean of their rates
        for tag, held in self.supports:
            found[tag - 1, np.flatnonzero(held)] = 0.0
        for tag, name, drive in self.driven:
            found[tag - 1, 2] = value_at(name, drive, 0.0, 3)[1]
        return found

    def job(self, algorithm: str, steps: int) -> dict[str, Any]:
        """What `reference.opensees.worker` is to do, as data for JSON."""
        extent = float(np.hypot(*np.ptp(np.array(self.nodes), axis=0)))
        constant, histories = self._loads()
        job: dict[str, Any] = {
            "static": self.static,
            "nonlinear": self.beam == "nonlinear",
            "consistent": self.consistent,
            "nodes": self.nodes,
            "supports": self.supports,
            "hinges": self.hinges,
            "beams": [self._beam(body) for body in self.scene.beams],
            "loads": [(tag, load.tolist()) for tag, load in enumerate(constant, 1) if load.any()],
            "system": "BandGeneral" if self.static else "ProfileSPD",
            "algorithm": algorithm,
            "bound": max(self.run.newton_tolerance, ROUNDING) * min(1.0, extent),
            "steps": steps,
        }
        if self.static:
            return job
        return job | {
            "dt": self.run.exact_dt,
            "stride": self.run.stride,
            "spectral_radius": self.run.spectral_radius,
            "velocities": self.velocities().tolist(),
            "histories": histories,
            "drives": [self._drive(*driven) for driven in self.driven],
        }

    def _add_node(self, place: Point) -> int:
        self.nodes.append((float(place[0]), float(place[1])))
        return len(self.nodes)

    def _add_junction(self, junction: Junction, ends: dict[End, int]) -> None:
        first = 0
        for group, clamp in zip(junction.groups, junction.clamps, strict=True):
            body, key = group[0]
            tag = self._add_node(self.scene.beam(body).position_at(float(key)))
            ends.update(dict.fromkeys(group, tag))
            turns = clamp is not None and clamp.angle is not None and not self.static
            if clamp is not None and turns:
                self.driven.append((tag, f"clamp {clamp.end!r} angle", cast(Angle, clamp.angle)))
            if junction.grounded:
                self.supports.append((tag, [1, 1, int(clamp is not None and not turns)]))
            elif first:
                self.hinges.append((first, tag))
            first = first or tag

    def _beam(self, body: Beam) -> tuple[Any, ...]:
        section, material = body.section, body.material
        per_length = material.density * section.area
        return material.E, section.area, section.second_moment, per_length, self.of_body[body.name]

    def _loads(self) -> tuple[Array, list[tuple[int, int, list[float]]]]:
        """Constant forces and moments on all nodes, (nodes, 3), and those that vary: node, component, values."""
        constant, histories = self.weights(), []
        for load in self.scene.loads:
            assert isinstance(load, Force | Torque)  # others are refused
            components = [0, 1] if isinstance(load, Force) else [2]
            body, side = self.scene.body_end(load.end)
            tag, value = self.of_body[body.name][-1 if side else 0], load.value
            if not callable(value):
                constant[tag - 1, components] += np.atleast_1d(value)
            elif self.static:
                constant[tag - 1, components] += value_at(load_text(load), value, 0.0, width_of(load))
            else:
                table = self._table(load_text(load), value, width_of(load))
                histories += [
                    (tag, k, column.tolist()) for k, column in zip(components, table.T, strict=True)
                ]
        return constant, histories

    def _table(self, name: str, history: Callable[[Any], Any], width: int) -> Array:
        """Values at the steps, and the last of them twice more: OpenSees' times may exceed the end by rounding."""
        values = tabulate(name, history, self.run.times(np.arange(self.run.steps + 1)), width)
        return np.concatenate([values, values[-1:], values[-1:]])

    def _drive(self, tag: int, name: str, drive: Angle) -> tuple[int, list[float], list[float]]:
        """Node, angles at the steps, and rate and acceleration at t = 0."""
        table = self._table(name, drive, 3)
        return tag, table[:, 0].tolist(), table[0, 1:].tolist()
