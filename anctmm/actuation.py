"""What acts on a scene in time, tabulated for the kernels: turning hubs, forces of time, torques."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anctmm.assembly import SHEAR, Bodies
from anctmm.compiling import kernel
from anctmm.drives import tabulate
from anctmm.elements import cable_kernel, shear_kernel
from anctmm.elements.shear_kernel import BLOCK
from anctmm.mesh import varying_loads
from anctmm.scene import Clamp, Force, Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Actuation:
    """Hubs and varying loads of a scene.

    Parameters
    ----------
    scene : Scene
    bodies : Bodies
    """

    scene: Scene
    bodies: Bodies

    @property
    def clamps(self) -> list[Clamp]:
        """Clamps that turn."""
        return [j for j in self.scene.joints if isinstance(j, Clamp) and j.angle is not None]

    @property
    def hub_nodes(self) -> Ints:
        """Node of each turning clamp."""
        return np.array([self._node(c.end) for c in self.clamps], dtype=np.int64)

    def hub_reference(self) -> Array:
        """Coordinates of the hubs' nodes before they turn, (hubs, rows)."""
        return np.ascontiguousarray(self.bodies.reference()[:, self.hub_nodes].T)

    def hub_table(self, t: Array) -> Array:
        """Angle, rate and acceleration of each hub at times `t`, (n, hubs, 3)."""
        tables = [tabulate(f"clamp {c.end!r} angle", c.angle, t, 3) for c in self.clamps]  # type: ignore[arg-type]
        return np.stack(tables, axis=1) if tables else np.zeros((len(t), 0, 3))

    def hub_of_bodies(self) -> Ints:
        """Hub at the first and at the last node of each body, or −1, (2, bodies)."""
        first = self.bodies.first
        ends = np.stack([first[:-1], first[1:] - 1])
        table = np.full(ends.shape, -1, dtype=np.int64)
        for hub, node in enumerate(self.hub_nodes):
            table[ends == node] = hub
        return table

    def memory(self) -> tuple[Array, Array, Array, Array]:
        """Room for the hubs' motion, (3, hubs, rows), their reactions, (hubs, rows), and what `work_done` remembers."""
        hubs, loads, rows = len(self.clamps), len(varying_loads(self.scene)), self.bodies.rows
        return np.zeros((3, hubs, rows)), np.zeros((hubs, rows)), np.zeros((2, hubs, rows)), np.zeros((2, loads, 2))

    @property
    def load_nodes(self) -> Ints:
        """Node of each varying load."""
        return np.array([self._node(load.end) for load in varying_loads(self.scene)], dtype=np.int64)

    @property
    def load_rows(self) -> Ints:
        """0 for a force; for a torque the first row of the vector it turns."""
        return np.array(
            [
                0 if isinstance(load, Force) else self.bodies.turning_row(self.scene.body_end(load.end)[0].name)
                for load in varying_loads(self.scene)
            ],
            dtype=np.int64,
        )

    def load_table(self, t: Array) -> Array:
        """Force (x, y), or moment and 0, of each varying load at times `t`, (n, loads, 2)."""
        loads = varying_loads(self.scene)
        table = np.zeros((len(t), len(loads), 2))
        for i, load in enumerate(loads):
            width = 2 if isinstance(load, Force) else 1
            if callable(load.value):
                table[:, i, :width] = tabulate(f"load on {load.end!r}", load.value, t, width)
            else:
                table[:, i, :width] = load.value
        return table

    def _node(self, end: str) -> int:
        body, side = self.scene.body_end(end)
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
def set_loads(q: Array, f: Array, dead: Array, nodes: Ints, rows: Ints, values: Array) -> None:
    """Make f, (rows, nodes), at the loaded nodes the dead load and the varying loads of values, (loads, 2)."""
    for n in range(len(nodes)):
        for k in range(f.shape[0]):
            f[k, nodes[n]] = dead[k, nodes[n]]
    for n in range(len(nodes)):
        x, y = load_at(q, nodes[n], rows[n], values[n, 0], values[n, 1])
        f[rows[n], nodes[n]] += x
        f[rows[n] + 1, nodes[n]] += y


@kernel
def hub_motion(reference: Array, drive: Array, motion: Array) -> None:
    """Coordinates of a turning hub's node and their first two derivatives, written into motion, (3, rows).

    Parameters
    ----------
    reference : ndarray, shape (rows,)
    drive : ndarray, shape (3,)
        θ, θ', θ''.
    """
    c, s = np.cos(drive[0]), np.sin(drive[0])
    w, a = drive[1], drive[2]
    for k in range(2):
        motion[0, k], motion[1, k], motion[2, k] = reference[k], 0.0, 0.0
    for k in range(2, len(reference), 2):
        x, y = reference[k], reference[k + 1]
        gx, gy = c * x - s * y, s * x + c * y
        motion[0, k], motion[0, k + 1] = gx, gy
        motion[1, k], motion[1, k + 1] = -w * gy, w * gx
        motion[2, k], motion[2, k + 1] = -a * gy - w * w * gx, a * gx - w * w * gy


@kernel
def set_hubs(q: Array, v: Array, nodes: Ints, reference: Array, drives: Array, motion: Array) -> None:
    """Give the hubs' nodes their known positions and velocities; their accelerations go to motion[2]."""
    for h in range(len(nodes)):
        hub_motion(reference[h], drives[h], motion[:, h])
        for k in range(q.shape[0]):
            q[k, nodes[h]] = motion[0, h, k]
            v[k, nodes[h]] = motion[1, h, k]


@kernel
def hub_reactions(
    q: Array,
    a: Array,
    f: Array,
    first: Ints,
    kinds: Ints,
    constants: Array,
    masses: Array,
    buffer: Array,
    hub_of: Ints,
    reaction: Array,
) -> None:
    """Generalized forces that turn the hubs, M a + F_elastic − f of their nodes, written, (hubs, rows)."""
    for b in range(len(kinds)):
        for side in range(2):
            hub = hub_of[side, b]
            if hub < 0:
                continue
            node = first[b] if side == 0 else first[b + 1] - 1
            i = node - side
            if kinds[b] == SHEAR:
                shear_kernel.forces(q, i, 1, constants[b], buffer)
            else:
                cable_kernel.forces(q, i, 1, constants[b], buffer)
            for k in range(4 if kinds[b] != SHEAR else 6):
                r = buffer[(6 * side + k) * BLOCK] - f[k, node]
                for n in range(k % 2, q.shape[0], 2):
                    r += masses[b, 3 * side + k // 2, n // 2] * a[n, i]
                    r += masses[b, 3 * side + k // 2, 3 + n // 2] * a[n, i + 1]
                reaction[hub, k] = r


@kernel
def work_done(
    moving: bool,
    q: Array,
    hub_nodes: Ints,
    reaction: Array,
    hub_memory: Array,
    load_nodes: Ints,
    load_rows: Ints,
    load_values: Array,
    load_memory: Array,
) -> float:
    """Work of hubs and varying loads since the last call, by the trapezoidal rule, J; 0 unless `moving`.

    The memories hold force and position of the last call, (2, hubs, rows) and (2, loads, 2).
    """
    work = 0.0
    for h in range(len(hub_nodes)):
        for k in range(q.shape[0]):
            force, place = reaction[h, k], q[k, hub_nodes[h]]
            if moving:
                work += 0.5 * (force + hub_memory[0, h, k]) * (place - hub_memory[1, h, k])
            hub_memory[0, h, k], hub_memory[1, h, k] = force, place
    for n in range(len(load_nodes)):
        forces = load_at(q, load_nodes[n], load_rows[n], load_values[n, 0], load_values[n, 1])
        for c in range(2):
            place = q[load_rows[n] + c, load_nodes[n]]
            if moving:
                work += 0.5 * (forces[c] + load_memory[0, n, c]) * (place - load_memory[1, n, c])
            load_memory[0, n, c], load_memory[1, n, c] = forces[c], place
    return work
