"""What acts on a scene in time, tabulated for the kernels: driven clamps, forces that vary in time, torques."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies, Tables
from anctmm.discretise.mesh import varying_loads
from anctmm.elements.dispatch import components, element_forces
from anctmm.elements.shear_kernel import BLOCK
from anctmm.errors import unknown_kind
from anctmm.jit.compiling import kernel
from anctmm.jit.copies import writes
from anctmm.model.drives import tabulate
from anctmm.model.joints import Clamp
from anctmm.model.loads import LOADS, tabulated
from anctmm.model.needs import not_offered
from anctmm.model.places import End
from anctmm.model.scene import Force, LineLoad, Load, Scene, Torque
from anctmm.model.topology import junctions_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@writes("motion", "reaction", "memory")
class Hubs(NamedTuple):
    """Turning clamps, for kernels.

    Parameters
    ----------
    nodes : ndarray of int, shape (hubs,)
    of : ndarray of int, shape (2, bodies)
        Driven clamp at the first and at the last node of each body, or −1.
    reference : ndarray, shape (hubs, rows)
        Coordinates of the nodes before they turn.
    motion : ndarray, shape (3, hubs, rows)
        Coordinates and their two derivatives now.
    reaction : ndarray, shape (hubs, rows)
        Generalized forces that turn them now.
    memory : ndarray, shape (2, hubs, rows)
        Forces and coordinates at the last call of `work_done`.
    """

    nodes: Ints
    of: Ints
    reference: Array
    motion: Array
    reaction: Array
    memory: Array


@writes("memory")
class Loads(NamedTuple):
    """Loads whose generalized force varies, for kernels.

    Parameters
    ----------
    nodes : ndarray of int, shape (loads,)
    rows : ndarray of int, shape (loads,)
        0 for a force; for a torque the first row of the vector it turns.
    memory : ndarray, shape (2, loads, 2)
        Forces and coordinates at the last call of `work_done`.
    """

    nodes: Ints
    rows: Ints
    memory: Array


@dataclass(frozen=True)
class Actuation:
    """Driven clamps (hubs, in names) and varying loads of a scene.

    Parameters
    ----------
    scene : Scene
    bodies : Bodies
    """

    scene: Scene
    bodies: Bodies

    @cached_property
    def driven(self) -> list[tuple[End, Clamp]]:
        """Ends that a driven clamp holds, directly or through welds."""
        return [
            (end, clamp)
            for junction in junctions_of(self.scene)
            for group, clamp in zip(junction.groups, junction.clamps, strict=True)
            if clamp is not None and clamp.angle is not None
            for end in group
        ]

    @property
    def width(self) -> int:
        """Numbers that the tables of driven clamps and loads hold for each time."""
        return 3 * len(self.driven) + 2 * len(varying_loads(self.scene))

    def hubs(self) -> Hubs:
        """Driven clamps for kernels, with a memory of their own."""
        first, rows, n = self.bodies.first, self.bodies.rows, len(self.driven)
        nodes = np.array([self.bodies.node(*end) for end, _ in self.driven], dtype=np.int64)
        ends = np.stack([first[:-1], first[1:] - 1])
        of = np.full(ends.shape, -1, dtype=np.int64)
        for hub, node in enumerate(nodes):
            of[ends == node] = hub
        reference = np.ascontiguousarray(self.bodies.reference()[:, nodes].T)
        return Hubs(nodes, of, reference, np.zeros((3, n, rows)), np.zeros((n, rows)), np.zeros((2, n, rows)))

    def loads(self) -> Loads:
        """Varying loads for kernels, with a memory of their own."""
        loads = varying_loads(self.scene)
        nodes = np.array([self._node(load) for load in loads], dtype=np.int64)
        rows = [self._row(load) for load in loads]
        return Loads(nodes, np.array(rows, dtype=np.int64), np.zeros((2, len(loads), 2)))

    def hub_table(self, t: Array) -> Array:
        """Angle, rate and acceleration of each driven clamp at times `t`, (n, hubs, 3)."""
        tables = [tabulate(f"clamp {c.end!r} angle", c.angle, t, 3) for _, c in self.driven]  # type: ignore[arg-type]
        return np.stack(tables, axis=1) if tables else np.zeros((len(t), 0, 3))

    def load_table(self, t: Array) -> Array:
        """Force (x, y), or moment and 0, of each varying load at times `t`, (n, loads, 2)."""
        return tabulated(varying_loads(self.scene), t)

    def _row(self, load: Load) -> int:
        """First of the components a load acts on."""
        match load:
            case Force():
                return 0
            case Torque():
                return self.bodies.turning_row(self.scene.body_end(load.end)[0].name)
            case LineLoad():
                raise not_offered(load)
            case _:
                raise unknown_kind("load", load, LOADS)

    def _node(self, load: Load) -> int:
        if isinstance(load, LineLoad):
            raise not_offered(load)
        body, side = self.scene.body_end(load.end)
        return self.bodies.node(body.name, side)


@kernel
def load_at(q: Array, node: int, row: int, x: float, y: float) -> tuple[float, float]:
    """Generalized force of a load on rows `row`, `row` + 1: a force (x, y), or a moment x on the vector g there.

    δθ = (g × δg)/|g|², so a moment M gives M (−g_y, g_x)/|g|².
    """
    if row == 0:
        return x, y
    gx, gy = q[row, node], q[row + 1, node]
    m = x / (gx * gx + gy * gy)
    return -m * gy, m * gx


@kernel
def set_loads(q: Array, f: Array, dead: Array, loads: Loads, values: Array) -> None:
    """Make f, (rows, nodes), at the loaded nodes the dead load and the varying loads of values, (loads, 2)."""
    for n in range(len(loads.nodes)):
        for k in range(f.shape[0]):
            f[k, loads.nodes[n]] = dead[k, loads.nodes[n]]
    for n in range(len(loads.nodes)):
        node, row = loads.nodes[n], loads.rows[n]
        x, y = load_at(q, node, row, values[n, 0], values[n, 1])
        f[row, node] += x
        f[row + 1, node] += y


@kernel
def turn_hubs(hubs: Hubs, drives: Array) -> None:
    """Motion of the driven clamps' nodes from angle, rate and acceleration, (hubs, 3)."""
    for h in range(len(hubs.nodes)):
        c, s = np.cos(drives[h, 0]), np.sin(drives[h, 0])
        w, a = drives[h, 1], drives[h, 2]
        for k in range(2):
            hubs.motion[0, h, k] = hubs.reference[h, k]
        for k in range(2, hubs.reference.shape[1], 2):
            x, y = hubs.reference[h, k], hubs.reference[h, k + 1]
            gx, gy = c * x - s * y, s * x + c * y
            hubs.motion[0, h, k], hubs.motion[0, h, k + 1] = gx, gy
            hubs.motion[1, h, k], hubs.motion[1, h, k + 1] = -w * gy, w * gx
            hubs.motion[2, h, k], hubs.motion[2, h, k + 1] = -a * gy - w * w * gx, a * gx - w * w * gy


@kernel
def place_hubs(q: Array, v: Array, hubs: Hubs) -> None:
    """Give the driven clamps' nodes the positions and velocities of their motion."""
    for h in range(len(hubs.nodes)):
        for k in range(q.shape[0]):
            q[k, hubs.nodes[h]] = hubs.motion[0, h, k]
            v[k, hubs.nodes[h]] = hubs.motion[1, h, k]


@kernel
def hub_reactions(q: Array, a: Array, f: Array, tables: Tables, hubs: Hubs) -> None:
    """Generalized forces that turn the driven clamps, M a + F_elastic − f of their nodes."""
    one = len(tables.first) - len(
        tables.kinds
    )  # not a literal, for which the element kernels would be compiled again
    for b in range(len(tables.kinds) if len(hubs.nodes) > 0 else 0):
        for side in range(2):
            hub, m = hubs.of[side, b], tables.masses[b]
            if hub < 0:
                continue
            node = tables.first[b] if side == 0 else tables.first[b + 1] - 1
            i = node - side
            element_forces(tables.blend, tables.kinds[b], q, i, one, tables.constants[b], tables.buffer)
            for k in range(components(tables.blend, tables.kinds[b])):
                r = tables.buffer[(6 * side + k) * BLOCK] - f[k, node]
                for n in range(k % 2, q.shape[0], 2):
                    r += (
                        m[3 * side + k // 2, n // 2] * a[n, i]
                        + m[3 * side + k // 2, 3 + n // 2] * a[n, i + 1]
                    )
                hubs.reaction[hub, k] = r


@kernel
def work_done(moving: bool, q: Array, hubs: Hubs, loads: Loads, values: Array) -> float:
    """Work of driven clamps and varying loads since the last call, by the trapezoidal rule, J; 0 unless `moving`."""
    work = 0.0
    for h in range(len(hubs.nodes)):
        for k in range(q.shape[0]):
            force, place = hubs.reaction[h, k], q[k, hubs.nodes[h]]
            if moving:
                work += 0.5 * (force + hubs.memory[0, h, k]) * (place - hubs.memory[1, h, k])
            hubs.memory[0, h, k], hubs.memory[1, h, k] = force, place
    for n in range(len(loads.nodes)):
        forces = load_at(q, loads.nodes[n], loads.rows[n], values[n, 0], values[n, 1])
        for c in range(2):
            place = q[loads.rows[n] + c, loads.nodes[n]]
            if moving:
                work += 0.5 * (forces[c] + loads.memory[0, n, c]) * (place - loads.memory[1, n, c])
            loads.memory[0, n, c], loads.memory[1, n, c] = forces[c], place
    return work
