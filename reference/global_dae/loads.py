"""Loads and drives that change in time: sampled ahead, applied and accounted for in the kernels."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.mesh import constant_forces, varying_loads
from anctmm.errors import unknown_kind
from anctmm.jit.compiling import inlined
from anctmm.model.drives import tabulate
from anctmm.model.loads import LOADS, tabulated
from anctmm.model.needs import not_offered
from anctmm.model.scene import Force, LineLoad, Scene, Torque
from reference.global_dae.constraints import Rows, drives_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Loads(NamedTuple):
    """Varying loads: flat place of the x component they act on (y at place + nodes), and whether they turn it."""

    place: Ints
    torque: Ints
    nodes: int


def varying(scene: Scene, bodies: Bodies) -> Loads:
    """Loads whose generalized force changes: forces of time, and all torques."""
    places, torques = [], []
    for load in varying_loads(scene):
        if isinstance(load, LineLoad):
            raise not_offered(load)
        body, side = scene.body_end(load.end)
        match load:
            case Force():
                row, torque = 0, 0
            case Torque():
                row, torque = bodies.turning_row(body.name), 1
            case _:
                raise unknown_kind("load", load, LOADS)
        places.append(row * bodies.nodes + bodies.node(body.name, side))
        torques.append(torque)
    return Loads(np.array(places, dtype=np.int64), np.array(torques, dtype=np.int64), bodies.nodes)


def dead_forces(scene: Scene, bodies: Bodies) -> Array:
    """Gravity and constant forces, (rows, nodes), N."""
    f = bodies.weight()
    for name, side, (x, y) in constant_forces(scene):
        f[:2, bodies.node(name, side)] += [x, y]
    return f


def load_table(scene: Scene, t: Array) -> Array:
    """Values of the varying loads at times t, (n, loads, 2): (Fx, Fy) in N, or (moment, 0) in N m."""
    return tabulated(varying_loads(scene), t)


def drive_table(scene: Scene, t: Array) -> Array:
    """cos θ, sin θ, θ' (rad/s), θ'' (rad/s²) of every driven clamp at times t, (n, drives, 4)."""
    drives = drives_of(scene)
    table = np.zeros((len(t), len(drives), 4))
    for k, clamp in enumerate(drives):
        assert clamp.angle is not None
        motion = tabulate(f"clamp {clamp.end!r} angle", clamp.angle, t, 3)
        table[:, k, 0], table[:, k, 1] = np.cos(motion[:, 0]), np.sin(motion[:, 0])
        table[:, k, 2:] = motion[:, 1:]
    return table


@inlined
def load_on(loads: Loads, k: int, table: Array, n: int, q: Array) -> tuple[float, float]:
    """Generalized force of load k on its vector, in row n of the table; of a moment M it is M (−g_y, g_x)/|g|²."""
    if loads.torque[k] == 0:
        return table[n, k, 0], table[n, k, 1]
    i = loads.place[k]
    x, y = q[i], q[i + loads.nodes]
    m = table[n, k, 0] / (x * x + y * y)
    return -m * y, m * x


@inlined
def add_loads(loads: Loads, table: Array, n: int, q: Array, f: Array) -> None:
    """Add all varying loads, in row n of their table, to the forces f; q and f flat."""
    for k in range(len(loads.place)):
        x, y = load_on(loads, k, table, n, q)
        f[loads.place[k]] += x
        f[loads.place[k] + loads.nodes] += y


@inlined
def work_since(
    loads: Loads, table: Array, n: int, rows: Rows, multiplier: Array, at: int, q: Array, trail: Array
) -> float:
    """Work of varying loads and drives since the last call, J: ½ (F_n + F_{n+1}) · (q_{n+1} − q_n).

    As M q̈ + Φᵀμ = F, a drive acts on its vector with −μ.

    Parameters
    ----------
    table : ndarray, shape (steps, loads, 2)
        Values of the loads, those of now in row n.
    multiplier : ndarray
        μ/s of the constraint rows, from its place `at` on.
    trail : ndarray, shape (loads + driven rows, 4)
        Force and vector at the last call, overwritten.
    """
    total = 0.0
    count = len(loads.place)
    for k in range(count + len(rows.driven)):
        if k < count:
            i = loads.place[k]
            fx, fy = load_on(loads, k, table, n, q)
        else:
            j = rows.driven[k - count]
            i = rows.place[rows.first[j]]
            fx, fy = -rows.scale * multiplier[at + 2 * j], -rows.scale * multiplier[at + 2 * j + 1]
        x, y = q[i], q[i + loads.nodes]
        total += 0.5 * ((fx + trail[k, 0]) * (x - trail[k, 2]) + (fy + trail[k, 1]) * (y - trail[k, 3]))
        trail[k, 0], trail[k, 1], trail[k, 2], trail[k, 3] = fx, fy, x, y
    return total
