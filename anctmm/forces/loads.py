"""Loads whose generalized force varies: functions of time, moments, follower forces.

Each acts on a vector of the coordinates (`anctmm.discretise.maps`): a force on a place or, per length, on the sum of
all places of a beam; a moment on the direction that it rotates.
"""

from collections.abc import Collection
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.maps import (
    Map,
    Maps,
    direction_of,
    maps,
    position_of,
    push,
    rate_at,
    sum_along,
    vector_at,
)
from anctmm.errors import unknown_kind
from anctmm.forces.connectors import Connectors, connectors_of, connectors_power, connectors_work
from anctmm.forces.stiffness import Border, Local, follower_at, stiffness_of
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, merged, uncompiled
from anctmm.jit.copies import writes
from anctmm.model.loads import LOADS
from anctmm.model.scene import Force, LineLoad, Load, Scene, Torque

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

DEAD, TORQUE, FOLLOWER = 0, 1, 2


@writes("memory", "connectors", "local", "border")
@by_address
class Loads(NamedTuple):
    """What acts on a scene beside gravity, constant dead loads and driven clamps, for kernels.

    Parameters
    ----------
    touched : ndarray of int, shape (k,)
        Nodes that loads and connectors act on.
    kinds : ndarray of int, shape (loads,)
        DEAD, TORQUE or FOLLOWER.
    targets : Maps
        Vectors that they act on.
    directions : Maps
        Of followers the vector that they turn with.
    rest : ndarray, shape (loads, 2)
        That vector in the reference, of length 1.
    memory : ndarray, shape (2, loads, 2)
        Forces and targets at the last call of `loads_work`.
    connectors : Connectors or None
    local : Local
        Stiffness of torques and connectors within elements.
    border : Border or None
        What couples distant nodes, and the stiffness of followers.
    """

    touched: Ints
    kinds: Ints
    targets: Maps
    directions: Maps
    rest: Array
    memory: Array
    connectors: Connectors | None
    local: Local
    border: Border | None


def loads_of(scene: Scene, bodies: Bodies, varying: list[Load], coupled: Collection[int] = ()) -> Loads:
    """Loads and connectors of a scene for kernels, with a memory of their own; `coupled`: as of `stiffness_of`."""
    if not varying and not scene.connectors:
        return no_loads(bodies)
    found = [_vectors(scene, bodies, load) for load in varying]
    targets, directions = maps([t for _, t, _ in found]), maps([d for _, _, d in found])
    q, rest = bodies.reference(), np.zeros((len(found), 2))
    for n, (kind, _, _) in enumerate(found):
        if kind == FOLLOWER:
            rest[n] = uncompiled(vector_at)(directions, n, q)
            rest[n] /= np.hypot(*rest[n])
    connectors = connectors_of(scene, bodies, len(varying))
    turning = [(n, kind == FOLLOWER, t, d) for n, (kind, t, d) in enumerate(found) if kind != DEAD]
    local, border = stiffness_of(scene, bodies, turning, len(varying), coupled)
    nodes = [targets.node, *((connectors.first.node, connectors.second.node) if connectors else ())]
    return Loads(
        np.unique(np.concatenate(nodes)).astype(np.int64),
        np.array([kind for kind, _, _ in found], dtype=np.int64),
        targets,
        directions,
        rest,
        np.zeros((2, len(found), 2)),
        connectors,
        local,
        border,
    )


def no_loads(bodies: Bodies) -> Loads:
    """What stands in their place where nothing acts."""
    return _nothing(bodies.rows)


@lru_cache
def _nothing(rows: int) -> Loads:
    """The same for so many components of a node: there is nothing in it that runs could write into."""
    nothing = maps([])
    empty, blocks = np.empty(0, np.int64), np.empty((0, 2 * rows, 2 * rows))
    local = Local(empty, blocks, empty, np.empty((2, 0), np.int64), np.empty(0, bool))
    return Loads(
        empty, empty, nothing, nothing, np.empty((0, 2)), np.empty((2, 0, 2)), None, local, None,
    )  # fmt: skip


def _vectors(scene: Scene, bodies: Bodies, load: Load) -> tuple[int, Map, Map]:
    """Kind of a load, and the vectors that it acts on and turns with."""
    match load:
        case Force():
            place = scene.place(load.end)
            if load.follower:
                return FOLLOWER, position_of(bodies, place), direction_of(bodies, place)
            return DEAD, position_of(bodies, place), Map()
        case Torque():
            return TORQUE, direction_of(bodies, scene.place(load.end)), Map()
        case LineLoad():
            return DEAD, sum_along(bodies, load.body), Map()
        case _:
            raise unknown_kind("load", load, LOADS)


@embedded
def load_at(loads, n, q, x, y):  # type: ignore[no-untyped-def]
    """Force on the vector that load n acts on, of its value (x, y), or of a moment x.

    δθ = (g × δg)/|g|², so a moment M on the direction g gives M (−g_y, g_x)/|g|².
    """
    if loads.kinds[n] == DEAD:
        return x, y
    if loads.kinds[n] == FOLLOWER:
        return follower_at(loads, n, q, x, y)
    gx, gy = vector_at(loads.targets, n, q)
    m = x / (gx * gx + gy * gy)
    return -m * gy, m * gx


@merged
def set_loads(q: Array, f: Array, dead: Array, loads: Loads, values: Array) -> None:
    """Make f, (rows, nodes), at the nodes that anything acts on the dead load and the varying loads.

    Parameters
    ----------
    values : ndarray, shape (rows of the table, 2)
        Of loads, driven connectors, and the time.
    """
    for i in loads.touched:
        for k in range(f.shape[0]):
            f[k, i] = dead[k, i]
    for n in range(len(loads.kinds)):
        x, y = load_at(loads, n, q, values[n, 0], values[n, 1])
        push(loads.targets, n, x, y, f)


@embedded
def loads_work(moving, q, loads, values):  # type: ignore[no-untyped-def]
    """Work of loads and connectors since the last call, and that of damping, by the trapezoidal rule, J.

    Both are 0 unless `moving`.
    """
    work, lost = connectors_work(loads.connectors, moving, values)
    for n in range(len(loads.kinds)):
        fx, fy = load_at(loads, n, q, values[n, 0], values[n, 1])
        x, y = vector_at(loads.targets, n, q)
        if moving:
            work += 0.5 * (fx + loads.memory[0, n, 0]) * (x - loads.memory[1, n, 0])
            work += 0.5 * (fy + loads.memory[0, n, 1]) * (y - loads.memory[1, n, 1])
        loads.memory[0, n, 0], loads.memory[0, n, 1] = fx, fy
        loads.memory[1, n, 0], loads.memory[1, n, 1] = x, y
    return work, lost


@embedded
def loads_power(q, v, loads, values):  # type: ignore[no-untyped-def]
    """Power of loads, and of connectors beside the rate of their energy; and that of damping; at velocities v, W."""
    power, lost = connectors_power(loads.connectors, q, v, values)
    for n in range(len(loads.kinds)):
        fx, fy = load_at(loads, n, q, values[n, 0], values[n, 1])
        x, y = rate_at(loads.targets, n, v)
        power += fx * x + fy * y
    return power, lost
