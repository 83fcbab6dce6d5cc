"""Beams: the compiled elements of `anctmm.elements`, on coordinates in the order of this solver.

This is the only module of the solver that knows these kernels. Both ways to march share them with ANC-TMM, so that
agreement checks joints, loads, elimination and time stepping, and times compare these.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.elements.compiled import MODULES, SIGNATURES, address
from anctmm.elements.force_blocks import BLOCK
from anctmm.elements.tangent_blocks import TANGENT_BLOCK, TANGENT_BUFFER
from anctmm.kernels.intrinsics import call, call_number
from reference.global_dae.kernels import inlined, kernel
from reference.global_dae.layout import Layout, Mesh

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Matrix = sparse.csc_array

#: Columns of the addresses of kernels, in the order of `SIGNATURES`.
FORCES, DAMPING, TANGENTS, ENERGY = range(4)


class Elements(NamedTuple):
    """Runs of equal elements, of a beam at most BLOCK each.

    kernels: addresses, (runs, 4). first, counts, vectors: first coordinate, number of elements and vectors of a node,
    (runs,). constants: of the kernels. damping, (runs,), s. q, v: of the nodes of a run, (components, nodes); out: what
    a kernel has found.
    """

    kernels: Ints
    first: Ints
    counts: Ints
    vectors: Ints
    constants: Array
    damping: Array
    q: Array
    v: Array
    out: Array


def elements_of(meshes: Sequence[Mesh]) -> Elements:
    """The elements of beams for the kernels."""
    runs = [(mesh, e) for mesh in meshes for e in range(0, mesh.elements, BLOCK)]
    constants = [MODULES[mesh.kind.name].constants(mesh.element) for mesh, _ in runs]
    kernels = [[address(mesh.kind.name, name) for name in SIGNATURES] for mesh, _ in runs]
    return Elements(
        np.array(kernels, dtype=np.int64).reshape(-1, len(SIGNATURES)),
        np.array([mesh.number(e, 0) for mesh, e in runs], dtype=np.int64),
        np.array([min(BLOCK, mesh.elements - e) for mesh, e in runs], dtype=np.int64),
        np.array([mesh.vectors for mesh, _ in runs], dtype=np.int64),
        _table(constants), np.array([mesh.element.damping for mesh, _ in runs], dtype=float),
        np.zeros((6, BLOCK + 1)), np.zeros((6, BLOCK + 1)), np.zeros(TANGENT_BUFFER),
    )  # fmt: skip


def _table(rows: list[Array]) -> Array:
    """Rows of different lengths, filled with zeros."""
    found = np.zeros((len(rows), max(map(len, rows), default=1)))
    for line, row in zip(found, rows, strict=True):
        line[: len(row)] = row
    return found


@kernel
def forces(e: Elements, q: Array, f: Array) -> None:
    """Elastic forces, the gradient of the strain energy, (size,), written into f."""
    f[:] = 0.0
    for run in range(len(e.first)):
        arrange(e, run, q, e.q)
        call(e.kernels[run, FORCES], e.q, 0, e.counts[run], e.constants[run], e.out)
        add(e, run, f)


@kernel
def damping_forces(e: Elements, q: Array, v: Array, f: Array) -> None:
    """Damping forces of the materials, which act on the bodies against v, (size,), written into f."""
    f[:] = 0.0
    for run in range(len(e.first)):
        if e.damping[run] > 0.0:
            arrange(e, run, q, e.q)
            arrange(e, run, v, e.v)
            constants, time = e.constants[run], -e.damping[run]
            call(e.kernels[run, DAMPING], e.q, e.v, 0, e.counts[run], constants, time, e.out)
            add(e, run, f)


@kernel
def add_tangents(e: Elements, by_velocity: float, q: Array, places: Ints, data: Array) -> None:
    """Add the entries of all tangents to `data`: those of an element, row by row, at the next of `places`.

    by_velocity: ∂v/∂q of the steps, 1/s, by which damping adds to the stiffness.
    """
    at = 0
    for run in range(len(e.first)):
        arrange(e, run, q, e.q)
        for first in range(0, e.counts[run], TANGENT_BLOCK):
            count = min(TANGENT_BLOCK, e.counts[run] - first)
            material = 1.0 + by_velocity * e.damping[run]
            call(e.kernels[run, TANGENTS], e.q, first, count, e.constants[run], material, 1.0, e.out)
            for j in range(count):
                for k in range(4 * e.vectors[run]):
                    for m in range(4 * e.vectors[run]):
                        low, high = min(k, m), max(k, m)
                        data[places[at]] += e.out[(high * (high + 1) // 2 + low) * TANGENT_BLOCK + j]
                        at += 1


@kernel
def strain_energies(e: Elements, series: Array, found: Array) -> None:
    """Strain energy at each of several states, (n, size), J, written into `found`, (n,)."""
    for n in range(len(series)):
        found[n] = 0.0
        for run in range(len(e.first)):
            arrange(e, run, series[n], e.q)
            found[n] += call_number(e.kernels[run, ENERGY], e.q, 0, e.counts[run], e.constants[run])


@inlined
def arrange(e: Elements, run: int, q: Array, nodal: Array) -> None:
    """Coordinates of the nodes of a run, each component a row."""
    n = 2 * e.vectors[run]
    for node in range(e.counts[run] + 1):
        at = e.first[run] + node * n
        for k in range(n):
            nodal[k, node] = q[at + k]


@inlined
def add(e: Elements, run: int, f: Array) -> None:
    """Add the forces on the nodes of a run, which a kernel has left in `out`."""
    n = 2 * e.vectors[run]
    for j in range(e.counts[run]):
        at = e.first[run] + j * n
        for k in range(n):
            f[at + k] += e.out[k * BLOCK + j]
            f[at + n + k] += e.out[(6 + k) * BLOCK + j]


class Beams:
    """All flexible beams of a layout."""

    def __init__(self, layout: Layout) -> None:
        self.size, self.meshes = layout.size, list(layout.meshes.values())
        self.elements = elements_of(self.meshes)
        self.at = [
            mesh.number(e, 0) + np.arange(4 * mesh.vectors)
            for mesh in self.meshes
            for e in range(mesh.elements)
        ]
        none = np.zeros(0, dtype=np.int64)
        rows = np.concatenate([none, *(np.repeat(at, len(at)) for at in self.at)])
        self.pattern = rows, np.concatenate([none, *(np.tile(at, len(at)) for at in self.at)])

    def mass(self) -> Matrix:
        """Mass matrix, (size, size), of the beams alone."""
        blocks = [np.tile(np.kron(m.element.mass, np.eye(2)).ravel(), m.elements) for m in self.meshes]
        return self._matrix(np.concatenate([np.zeros(0), *blocks]))

    def force(self, q: Array) -> Array:
        """Elastic forces, the gradient of the strain energy."""
        f = np.empty(self.size)
        forces(self.elements, q, f)
        return f

    def damping(self, q: Array, v: Array) -> Array:
        """Damping forces of the materials, which act on the bodies: they work against v."""
        f = np.empty(self.size)
        damping_forces(self.elements, q, v, f)
        return f

    def tangent(self, q: Array, by_velocity: float = 0.0) -> Matrix:
        """Derivative of the elastic forces, and `by_velocity` (1/s) times that of damping by its material part."""
        data = np.zeros(len(self.pattern[0]))
        add_tangents(self.elements, by_velocity, q, np.arange(len(data)), data)
        return self._matrix(data)

    def energy(self, series: Array) -> Array:
        """Strain energy at each of several states, (n, size), J."""
        found = np.zeros(len(series))
        strain_energies(self.elements, np.ascontiguousarray(series), found)
        return found

    def _matrix(self, data: Any) -> Matrix:
        return Matrix((data, self.pattern), shape=(self.size, self.size))
