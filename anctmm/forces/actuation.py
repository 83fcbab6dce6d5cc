"""Driven clamps, loads and connectors of a scene, tabulated in time for the kernels."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies, Tables
from anctmm.discretise.chain import Chain, Start
from anctmm.discretise.junctions.as_written import as_written
from anctmm.discretise.junctions.constraints import Drive, drive_as_written
from anctmm.discretise.mesh import varying_loads
from anctmm.elements.dispatch import element_forces
from anctmm.elements.force_blocks import BLOCK
from anctmm.forces.connectors import count_turns, driven_connectors, free_of, has_clock
from anctmm.forces.loads import Loads, loads_of, loads_power, loads_work
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import merged
from anctmm.jit.copies import writes
from anctmm.model.connectors import free_name, name_of
from anctmm.model.drives import tabulate
from anctmm.model.joints import Clamp
from anctmm.model.loads import tabulated
from anctmm.model.places import End
from anctmm.model.scene import Scene
from anctmm.model.topology import junctions_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@writes("motion", "reaction", "memory")
@by_address
class DrivenClamps(NamedTuple):
    """Turning clamps, for kernels.

    Parameters
    ----------
    nodes : ndarray of int, shape (clamps,)
    of : ndarray of int, shape (2, bodies)
        Driven clamp at the first and at the last node of each body, or −1.
    held : ndarray of int, shape (clamps,)
        Components of the nodes that are held, the first ones.
    reference : ndarray, shape (clamps, rows)
        Coordinates of the nodes before they turn.
    motion : ndarray, shape (3, clamps, rows)
        Coordinates and their two derivatives now.
    reaction : ndarray, shape (clamps, rows)
        Generalized forces that turn them now.
    memory : ndarray, shape (2, clamps, rows)
        Forces and coordinates at the last call of `work_done`.
    """

    nodes: Ints
    of: Ints
    held: Ints
    reference: Array
    motion: Array
    reaction: Array
    memory: Array


@dataclass(frozen=True)
class Actuation:
    """Driven clamps and varying loads of a scene.

    Parameters
    ----------
    scene : Scene
    bodies : Bodies
    start : Start, optional
        The equilibrium that a motion starts from: rotational springs have turned there.
    coupled : collection of int
        Connectors between kept nodes (`Segments.coupled`).
    """

    scene: Scene
    bodies: Bodies
    start: Start | None = None
    coupled: Collection[int] = ()

    @cached_property
    def driven(self) -> list[tuple[End, Clamp]]:
        """Ends of beams that a driven clamp holds, directly or through welds."""
        return [
            (end, clamp)
            for junction in junctions_of(self.scene)
            for group, clamp in zip(junction.groups, junction.clamps, strict=True)
            if clamp is not None and clamp.angle is not None
            for end in group
            if self.bodies.mesh(end[0]).elements
        ]

    @cached_property
    def drives(self) -> list[Drive]:
        """What turns them."""
        return [drive_as_written(self.scene, clamp) for _, clamp in self.driven]

    @cached_property
    def width(self) -> int:
        """Numbers that the tables of driven clamps and loads hold for each time."""
        rows = len(varying_loads(self.scene)) + len(driven_connectors(self.scene)) + has_clock(self.scene)
        return 3 * len(self.driven) + 2 * rows

    def clamps(self) -> DrivenClamps:
        """Driven clamps for kernels, with a memory of their own."""
        if not self.driven:
            return _no_clamps(self.bodies.rows, len(self.bodies.meshes))
        first, rows, n = self.bodies.first, self.bodies.rows, len(self.driven)
        nodes = np.array([self.bodies.node(*end) for end, _ in self.driven], dtype=np.int64)
        ends = np.stack([first[:-1], first[1:] - 1])
        of = np.full(ends.shape, -1, dtype=np.int64)
        for clamp, node in enumerate(nodes):
            of[ends == node] = clamp
        held = np.array([self.bodies.mesh(name).held for (name, _), _ in self.driven], dtype=np.int64)
        reference = np.ascontiguousarray(self.bodies.reference()[:, nodes].T)
        return DrivenClamps(
            nodes, of, held, reference, np.zeros((3, n, rows)), np.zeros((n, rows)), np.zeros((2, n, rows))
        )

    def loads(self) -> Loads:
        """Varying loads and connectors for kernels, with a memory of their own."""
        loads = loads_of(self.scene, self.bodies, varying_loads(self.scene), self.coupled)
        if self.start is not None:
            count_turns(loads.connectors, self.start.q, self.start.turned)
        return loads

    def load_table(self, t: Array) -> Array:
        """What acts at times `t`, (n, rows, 2).

        Force (x, y), or moment and 0, of each varying load; free measure of each driven connector and its rate; where
        there are laws, at last the time and 0.
        """
        loads = tabulated([as_written(self.scene, load) for load in varying_loads(self.scene)], t)
        driven = [
            tabulate(f"{name_of(connector)} {free_name(connector)}", free_of(connector), t, 2)[:, None]
            for connector in (as_written(self.scene, one) for one in driven_connectors(self.scene))
        ]
        clock = [_clock(t)] if has_clock(self.scene) else []
        return np.concatenate([loads, *driven, *clock], axis=1) if driven or clock else loads


def actuation_of(chain: Chain) -> Actuation:
    """What acts on a chain in time."""
    return Actuation(chain.parts, chain.bodies, chain.start, chain.segments.coupled)


@lru_cache
def _no_clamps(rows: int, bodies: int) -> DrivenClamps:
    """What stands for them where nothing is driven: there is nothing in it that runs could write into."""
    none, of = np.empty(0, np.int64), np.full((2, bodies), -1, dtype=np.int64)
    empty, twice, motion = (np.empty((*k, 0, rows)) for k in ((), (2,), (3,)))
    return DrivenClamps(none, of, none, empty, motion, empty, twice)


def _clock(t: Array) -> Array:
    return np.stack([t, np.zeros_like(t)], axis=1)[:, None]


@merged
def turn_clamps(clamps: DrivenClamps, drives: Array) -> None:
    """Motion of the driven clamps' nodes from angle, rate and acceleration, (clamps, 3)."""
    for h in range(len(clamps.nodes)):
        c, s = np.cos(drives[h, 0]), np.sin(drives[h, 0])
        w, a = drives[h, 1], drives[h, 2]
        for k in range(2):
            clamps.motion[0, h, k] = clamps.reference[h, k]
        for k in range(2, clamps.held[h], 2):
            x, y = clamps.reference[h, k], clamps.reference[h, k + 1]
            gx, gy = c * x - s * y, s * x + c * y
            clamps.motion[0, h, k], clamps.motion[0, h, k + 1] = gx, gy
            clamps.motion[1, h, k], clamps.motion[1, h, k + 1] = -w * gy, w * gx
            clamps.motion[2, h, k], clamps.motion[2, h, k + 1] = -a * gy - w * w * gx, a * gx - w * w * gy


@merged
def place_clamps(q: Array, v: Array, clamps: DrivenClamps) -> None:
    """Give the driven clamps' nodes the positions and velocities of their motion."""
    for h in range(len(clamps.nodes)):
        for k in range(clamps.held[h]):
            q[k, clamps.nodes[h]] = clamps.motion[0, h, k]
            v[k, clamps.nodes[h]] = clamps.motion[1, h, k]


@merged
def clamp_reactions(q: Array, a: Array, f: Array, tables: Tables, clamps: DrivenClamps) -> None:
    """Generalized forces that turn the driven clamps, M a + F_elastic − f of their nodes."""
    # 1, but not as a literal, for which the element kernels would be compiled again
    one = len(tables.first) - len(tables.kinds)
    for b in range(len(tables.kinds) if len(clamps.nodes) > 0 else 0):
        for side in range(2):
            clamp, m = clamps.of[side, b], tables.masses[b]
            if clamp < 0:
                continue
            node = tables.first[b] if side == 0 else tables.first[b + 1] - 1
            i = node - side
            element_forces(
                tables.formulations, tables.kinds[b], q, i, one, tables.constants[b], tables.buffer
            )
            for k in range(clamps.held[clamp]):
                r = tables.buffer[(6 * side + k) * BLOCK] - f[k, node]
                for n in range(k % 2, q.shape[0], 2):
                    r += (
                        m[3 * side + k // 2, n // 2] * a[n, i]
                        + m[3 * side + k // 2, 3 + n // 2] * a[n, i + 1]
                    )
                clamps.reaction[clamp, k] = r


@merged
def work_done(
    moving: bool, q: Array, clamps: DrivenClamps, loads: Loads, values: Array
) -> tuple[float, float]:
    """Work of clamps, loads and connectors since the last call, and that of damping, by the trapezoidal rule, J.

    Both are 0 unless `moving`.
    """
    work = 0.0
    for h in range(len(clamps.nodes)):
        for k in range(q.shape[0]):
            force, place = clamps.reaction[h, k], q[k, clamps.nodes[h]]
            if moving:
                work += 0.5 * (force + clamps.memory[0, h, k]) * (place - clamps.memory[1, h, k])
            clamps.memory[0, h, k], clamps.memory[1, h, k] = force, place
    others, lost = loads_work(moving, q, loads, values)
    return work + others, lost


@merged
def power_of(q: Array, v: Array, clamps: DrivenClamps, loads: Loads, values: Array) -> tuple[float, float]:
    """Power of driven clamps and loads, and of connectors beside their energy; and that of damping; W."""
    power = 0.0
    for h in range(len(clamps.nodes)):
        for k in range(clamps.held[h]):
            power += clamps.reaction[h, k] * clamps.motion[1, h, k]
    others, lost = loads_power(q, v, loads, values)
    return power + others, lost
