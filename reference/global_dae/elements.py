"""Elements of the compiled solver: the compiled kernels of `anctmm.elements`, behind four plain functions.

This is the only module of the solver that knows these kernels. It shares them, so that times compare elimination and
time stepping, not kernels.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.elements import cable_kernel, quintic_kernel, shear_kernel
from anctmm.elements.force_blocks import BLOCK
from anctmm.elements.tangent_blocks import TANGENT_BLOCK, TANGENT_BUFFER
from reference.global_dae.kernels import inlined, kernel
from reference.global_dae.layout import Mesh

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Modules of kernels, by the kind of element; kernels know a kind by its place here.
KINDS = {"cable": cable_kernel, "shear": shear_kernel, "quintic": quintic_kernel}
cable_forces, shear_forces, quintic_forces = (module.forces for module in KINDS.values())
cable_damping, shear_damping, quintic_damping = (module.damping_forces for module in KINDS.values())
cable_tangents, shear_tangents, quintic_tangents = (module.tangents for module in KINDS.values())


class Elements(NamedTuple):
    """Runs of equal elements, of a beam at most BLOCK each.

    kinds, first, counts, vectors: kind, first coordinate, number of elements and vectors of a node, (runs,). tables:
    constants of the kernels; stiffened: the same with the stiffness of Newton's matrix. damping, (runs,), s. q, v: of
    the nodes of a run, (components, nodes); out, small: buffers of the kernels.
    """

    kinds: Ints
    first: Ints
    counts: Ints
    vectors: Ints
    tables: Array
    stiffened: Array
    damping: Array
    q: Array
    v: Array
    out: Array
    small: Array


def elements_of(meshes: Sequence[Mesh], by_velocity: float) -> Elements:
    """The elements of beams for the kernels; `by_velocity` (1/s) is ∂v/∂q of the steps, which stiffens damped ones."""
    runs = [(mesh, e) for mesh in meshes for e in range(0, mesh.elements, BLOCK)]
    names = list(KINDS)
    tables: list[Array] = []
    for factor in (0.0, by_velocity):
        rows = []
        for mesh, _ in runs:
            stiff = mesh.element.stiffened(1.0 + factor * mesh.element.damping, stresses=False)
            rows.append(KINDS[mesh.kind.name].constants(mesh.element if factor == 0.0 else stiff))
        table = np.zeros((len(rows), max(map(len, rows))))
        for line, row in zip(table, rows, strict=True):
            line[: len(row)] = row
        tables.append(table)
    return Elements(  # type: ignore[call-arg]
        np.array([names.index(mesh.kind.name) for mesh, _ in runs]),
        np.array([mesh.number(e, 0) for mesh, e in runs]),
        np.array([min(BLOCK, mesh.elements - e) for mesh, e in runs]),
        np.array([mesh.vectors for mesh, _ in runs]),
        *tables,
        np.array([mesh.element.damping for mesh, _ in runs], dtype=float),
        *np.zeros((2, 6, BLOCK + 1)),
        np.zeros(12 * BLOCK + 6),
        np.zeros(TANGENT_BUFFER),
    )


@kernel
def forces(e: Elements, q: Array, f: Array) -> None:
    """Elastic forces, (size,), written into f."""
    f[:] = 0.0
    for run in range(len(e.kinds)):
        kind, count = e.kinds[run], e.counts[run]
        arranged(e, run, q, e.q)
        if kind == 0:
            cable_forces(e.q, 0, count, e.tables[run], e.out)
        elif kind == 1:
            shear_forces(e.q, 0, count, e.tables[run], e.out)
        else:
            quintic_forces(e.q, 0, count, e.tables[run], e.out)
        add(e, run, f)


@kernel
def damping_forces(e: Elements, q: Array, v: Array, f: Array) -> None:
    """Damping forces, which act on the bodies against v, (size,), written into f."""
    f[:] = 0.0
    for run in range(len(e.kinds)):
        kind, count, tau = e.kinds[run], e.counts[run], -e.damping[run]
        if tau == 0.0:
            continue
        arranged(e, run, q, e.q)
        arranged(e, run, v, e.v)
        if kind == 0:
            cable_damping(e.q, e.v, 0, count, e.tables[run], tau, e.out)
        elif kind == 1:
            shear_damping(e.q, e.v, 0, count, e.tables[run], tau, e.out)
        else:
            quintic_damping(e.q, e.v, 0, count, e.tables[run], tau, e.out)
        add(e, run, f)


@kernel
def add_tangents(e: Elements, q: Array, places: Ints, data: Array) -> None:
    """Add the entries of all tangents to `data`: those of an element, row by row, at the next of `places`."""
    at = 0
    for run in range(len(e.kinds)):
        kind, n = e.kinds[run], 2 * e.vectors[run]
        arranged(e, run, q, e.q)
        for first in range(0, e.counts[run], TANGENT_BLOCK):
            count = min(TANGENT_BLOCK, e.counts[run] - first)
            if kind == 0:
                cable_tangents(e.q, first, count, e.stiffened[run], e.small)
            elif kind == 1:
                shear_tangents(e.q, first, count, e.stiffened[run], e.small)
            else:
                quintic_tangents(e.q, first, count, e.stiffened[run], e.small)
            for j in range(count):
                for k in range(2 * n):
                    for m in range(2 * n):
                        low, high = min(k, m), max(k, m)
                        data[places[at]] += e.small[(high * (high + 1) // 2 + low) * TANGENT_BLOCK + j]
                        at += 1


@inlined
def arranged(e: Elements, run: int, q: Array, nodal: Array) -> None:
    """Coordinates of the nodes of a run, each component a row."""
    n = 2 * e.vectors[run]
    for node in range(e.counts[run] + 1):
        at = e.first[run] + node * n
        for k in range(n):
            nodal[k, node] = q[at + k]


@inlined
def add(e: Elements, run: int, f: Array) -> None:
    """Add the forces on the nodes of a run, which the kernels have left in `out`."""
    n = 2 * e.vectors[run]
    for j in range(e.counts[run]):
        at = e.first[run] + j * n
        for k in range(n):
            f[at + k] += e.out[k * BLOCK + j]
            f[at + n + k] += e.out[(6 + k) * BLOCK + j]
