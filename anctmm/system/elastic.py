"""Elastic forces, inertia, tangents and energies of all elements and rigid bodies, body after body."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.compiled import MODULES, address
from anctmm.elements.force_blocks import BLOCK
from anctmm.elements.tangent_blocks import TANGENT_BLOCK, TANGENT_BUFFER
from anctmm.kernels.options import part
from anctmm.kernels.scratch import call_element
from anctmm.system.body_meshes import BeamMesh
from anctmm.system.matrix import add
from anctmm.system.mesh import Mesh
from anctmm.system.numbering import Numbering

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Columns of the addresses of kernels.
FORCES, DAMPING, TANGENTS, ENERGY = 0, 1, 2, 3


class Elements(NamedTuple):
    """Bodies as tables, for kernels.

    Parameters
    ----------
    first, number : ndarray of int, shape (beams,)
        First node of each beam, and number of its elements.
    kernels : ndarray of int, shape (beams, 4)
        Addresses of its kernels: forces, damping forces (0 without damping), tangents, energy.
    vectors : ndarray of int, shape (beams,)
        Coordinate vectors of a node.
    constants, stiff : ndarray, shape (beams, numbers)
        Of the element kernels: those of the forces, and those of the matrix, where damping adds to the stiffness.
    masses : ndarray, shape (beams, vectors, vectors)
        Scalar mass of an element, by nodal vectors.
    damping : ndarray, shape (beams,)
        Kelvin-Voigt damping, s.
    pairs : ndarray of int, shape (elements, pairs)
        Codes of the pairs of nodal vectors of each element: (k, m ≤ k) at k (k + 1)/2 + m.
    nodes : ndarray of int, shape (rigid,)
        Nodes of rigid bodies and point masses.
    mass : ndarray, shape (rigid, rows, rows)
    node_pairs : ndarray of int, shape (rigid, pairs)
        As `pairs`, of the vectors of one node.
    buffer, tangents : ndarray
        Scratch of the element kernels.
    """

    first: Ints
    number: Ints
    kernels: Ints
    vectors: Ints
    constants: Array
    stiff: Array
    masses: Array
    damping: Array
    pairs: Ints
    nodes: Ints
    mass: Array
    node_pairs: Ints
    buffer: Array
    tangents: Array


def elements_of(numbering: Numbering) -> Elements:
    """Tables of a scene."""
    mesh = numbering.mesh
    beams = mesh.beams
    first = np.array([mesh.first[m.body.name] for m in beams], dtype=np.int64)
    count = np.array([m.elements for m in beams], dtype=np.int64)
    constants = _table([_kernels(m).constants(m.element) for m in beams])
    masses = np.zeros((len(beams), 2 * mesh.slots, 2 * mesh.slots))
    for table, m in zip(masses, beams, strict=True):
        at = np.concatenate([np.arange(m.vectors), mesh.slots + np.arange(m.vectors)])
        table[np.ix_(at, at)] = m.element.mass
    starts = [f + np.arange(n) for f, n in zip(first, count, strict=True)]
    elements = np.concatenate([np.empty(0, np.int64), *starts])
    nodes, mass = _rigid(mesh)
    return Elements(
        first, count, np.array([_addresses(m) for m in beams], dtype=np.int64).reshape(-1, 4),
        np.array([m.vectors for m in beams], dtype=np.int64),
        constants, constants.copy(), masses, np.array([m.element.damping for m in beams], dtype=float),
        _pairs(numbering, elements, 2 * mesh.slots), nodes, mass, _pairs(numbering, nodes, mesh.slots),
        np.zeros(12 * BLOCK), np.zeros(TANGENT_BUFFER),
    )  # fmt: skip


def stiffened(mesh: Mesh, elements: Elements, rate: float) -> None:
    """Set the constants of the matrix for dv/dq = `rate`, 1/s: damping adds τ times this to the stiffness.

    The stresses in the matrix stay those of the strains alone.
    """
    for n, m in enumerate(mesh.beams):
        if m.element.damping:
            element = m.element.stiffened(1.0 + m.element.damping * rate, False)
            row = _kernels(m).constants(element)
            elements.stiff[n, : len(row)] = row


def _addresses(mesh: BeamMesh) -> list[int]:
    """Addresses of the kernels of a beam's elements."""
    damped = bool(mesh.element.damping)
    kinds = ("forces", "damping", "tangents", "energy")
    return [address(_kernel_name(mesh), what) if what != "damping" or damped else 0 for what in kinds]


def _kernel_name(mesh: BeamMesh) -> str:
    """The kernels of a beam's elements, by their name in `MODULES`."""
    return mesh.kind.name if len(mesh.along) == 2 else f"spatial_{mesh.kind.name}"


def _kernels(mesh: BeamMesh) -> Any:
    return MODULES[_kernel_name(mesh)]


def _table(rows: list[Array]) -> Array:
    found = np.zeros((len(rows), max(1, *map(len, rows), 1) if rows else 1))
    for line, row in zip(found, rows, strict=True):
        line[: len(row)] = row
    return found


def _rigid(mesh: Mesh) -> tuple[Ints, Array]:
    """Nodes of rigid bodies and masses, and the mass matrix of each."""
    nodes, masses = list[int](), list[Array]()
    for name, body in mesh.bodies.items():
        if isinstance(body, BeamMesh):
            continue
        whole = body.mass_matrix
        width = mesh.dim * body.vectors
        for k in range(body.nodes):
            mass = np.zeros((mesh.rows, mesh.rows))
            mass[:width, :width] = whole[k * width : (k + 1) * width, k * width : (k + 1) * width]
            nodes.append(mesh.first[name] + k)
            masses.append(mass)
    return np.array(nodes, dtype=np.int64), np.array(masses).reshape(-1, mesh.rows, mesh.rows)


def _pairs(numbering: Numbering, nodes: Ints, vectors: int) -> Ints:
    """Codes of all pairs of so many vectors from each node on."""
    columns, base = list[Ints](), nodes * numbering.mesh.slots
    for k in range(vectors):
        for m in range(k + 1):
            codes = numbering.codes(base + k, base + m)
            columns.append(np.where(codes >= 0, codes & ~np.int64(3), codes) if k == m else codes)
    return np.stack(columns, axis=1)


def vector_masses(numbering: Numbering) -> Array:
    """A mass of each vector, kg: its diagonal entry of the mass matrix, (vectors,), summed over shared ones."""
    mesh = numbering.mesh
    found = np.zeros(mesh.nodes * mesh.slots)
    for name, body in mesh.bodies.items():
        grid = found.reshape(mesh.nodes, mesh.slots)[mesh.first[name] : mesh.first[name] + body.nodes]
        if isinstance(body, BeamMesh):
            grid[:, : body.vectors] = body.spread(np.diag(body.element.mass))
        else:
            diagonal = np.diag(body.mass_matrix)[:: mesh.dim]
            grid[:, : body.vectors] = diagonal.reshape(body.nodes, body.vectors)
    total = np.zeros_like(found)
    np.add.at(total, numbering.root, found)
    return np.where(total > 0.0, total, 1.0)


@part
def take_forces(out, vectors, dim, first, count, f):  # type: ignore[no-untyped-def]
    """Take the forces of a row of elements from f, (rows, nodes): both nodes of each."""
    for k in range(vectors * dim):
        for j in range(count):
            f[k, first + j] -= out[k * BLOCK + j]
        for j in range(count):
            f[k, first + j + 1] -= out[(6 + k) * BLOCK + j]


@part
def subtract_elastic(elements: Elements, q: Array, dim: int, f: Array) -> None:
    """Subtract the elastic forces, the gradient of the strain energy, from f, (rows, nodes)."""
    for b in range(len(elements.first)):
        done, first = 0, elements.first[b]
        while done < elements.number[b]:
            some = min(BLOCK, elements.number[b] - done)
            call_element(
                elements.kernels[b, FORCES],
                q,
                q,
                first + done,
                some,
                elements.constants[b],
                0.0,
                elements.buffer,
            )
            take_forces(elements.buffer, elements.vectors[b], dim, first + done, some, f)
            done += some


@part
def subtract_damping(elements: Elements, q: Array, v: Array, dim: int, f: Array) -> None:
    """Subtract the damping forces at velocities v from f."""
    for b in range(len(elements.first)):
        if elements.damping[b] > 0.0:
            done, first = 0, elements.first[b]
            while done < elements.number[b]:
                some = min(BLOCK, elements.number[b] - done)
                call_element(
                    elements.kernels[b, DAMPING], q, v, first + done, some, elements.constants[b],
                    elements.damping[b], elements.buffer,
                )  # fmt: skip
                take_forces(elements.buffer, elements.vectors[b], dim, first + done, some, f)
                done += some


@part
def subtract_inertia(elements: Elements, w: Array, dim: int, f: Array) -> None:
    """Subtract M w from f."""
    for b in range(len(elements.first)):
        _row_inertia(elements.masses[b], w, elements.first[b], elements.number[b], dim, f)
    subtract_rigid_inertia(elements, w, f)


@part
def _row_inertia(m, w, first, count, dim, f):  # type: ignore[no-untyped-def]
    """Subtract the inertia of a row of elements."""
    slots = w.shape[0] // dim
    for s in range(slots):
        for t in range(slots):
            ii, io, oi, oo = m[s, t], m[s, slots + t], m[slots + s, t], m[slots + s, slots + t]
            if ii != 0.0:
                for c in range(dim):
                    x, y = s * dim + c, t * dim + c
                    for i in range(first, first + count):
                        f[x, i] -= ii * w[y, i] + io * w[y, i + 1]
                    for i in range(first, first + count):
                        f[x, i + 1] -= oi * w[y, i] + oo * w[y, i + 1]


@part
def subtract_rigid_inertia(elements: Elements, w: Array, f: Array) -> None:
    """Subtract that of rigid bodies and point masses."""
    for n in range(len(elements.nodes)):
        i = elements.nodes[n]
        for k in range(w.shape[0]):
            s = 0.0
            for m in range(w.shape[0]):
                s += elements.mass[n, k, m] * w[m, i]
            f[k, i] -= s


@part
def subtract_element(
    elements: Elements, b: int, i: int, q: Array, v: Array, w: Array, dim: int, f: Array
) -> None:
    """Subtract elastic, damping and inertia forces of the element of beam b behind node i."""
    out, constants, vectors = elements.buffer, elements.constants[b], elements.vectors[b]
    one = min(elements.number[b], 1)  # no literal, for which kernels would be compiled again
    call_element(elements.kernels[b, FORCES], q, q, i, one, constants, 0.0, out)
    take_forces(out, vectors, dim, i, one, f)
    if elements.damping[b] > 0.0:
        call_element(elements.kernels[b, DAMPING], q, v, i, one, constants, elements.damping[b], out)
        take_forces(out, vectors, dim, i, one, f)
    _row_inertia(elements.masses[b], w, i, one, dim, f)


@part
def add_mass(elements: Elements, dim: int, factor: float, flat: Array, size: int) -> None:
    """Add factor · M to the matrix."""
    e = 0
    for b in range(len(elements.first)):
        vectors = elements.masses.shape[1]
        for _ in range(elements.number[b]):
            p = 0
            for k in range(vectors):
                for m in range(k + 1):
                    x = factor * elements.masses[b, k, m]
                    if x != 0.0:
                        for c in range(dim):
                            add(flat, size, elements.pairs[e, p], c, c, x)
                    p += 1
            e += 1
    slots = elements.mass.shape[1] // dim
    for n in range(len(elements.nodes)):
        p = 0
        for k in range(slots):
            for m in range(k + 1):
                for c in range(dim):
                    for d in range(dim):
                        x = factor * elements.mass[n, k * dim + c, m * dim + d]
                        add(flat, size, elements.node_pairs[n, p], c, d, x)
                p += 1


@part
def add_tangent(elements: Elements, q: Array, dim: int, factor: float, flat: Array, size: int) -> None:
    """Add factor · K, with the damping of `stiffened`, to the matrix."""
    e, slots, out = 0, elements.masses.shape[1] // 2, elements.tangents
    for b in range(len(elements.first)):
        done, first = 0, elements.first[b]
        while done < elements.number[b]:
            some = min(TANGENT_BLOCK, elements.number[b] - done)
            vectors = elements.vectors[b]
            call_element(elements.kernels[b, TANGENTS], q, q, first + done, some, elements.stiff[b], 0.0, out)
            for j in range(some):
                for k in range(2 * vectors):
                    one = k if k < vectors else k - vectors + slots
                    for m in range(k + 1):
                        two = m if m < vectors else m - vectors + slots
                        code = elements.pairs[e + j, one * (one + 1) // 2 + two]
                        for c in range(dim):
                            row = dim * k + c
                            for d in range(dim):
                                column = dim * m + d
                                if column <= row:
                                    at = row * (row + 1) // 2 + column
                                else:
                                    at = column * (column + 1) // 2 + row
                                add(flat, size, code, c, d, factor * out[at * TANGENT_BLOCK + j])
            done += some
            e += some


@part
def kinetic_energy(elements: Elements, v: Array, dim: int, scratch: Array) -> float:
    """Kinetic energy at velocities v, J."""
    scratch[:] = 0.0
    subtract_inertia(elements, v, dim, scratch)
    total = 0.0
    for k in range(v.shape[0]):
        for i in range(v.shape[1]):
            total -= 0.5 * scratch[k, i] * v[k, i]
    return total


@part
def strain_energy(elements: Elements, q: Array) -> float:
    """Strain energy of all elements, J."""
    total = 0.0
    for b in range(len(elements.first)):
        call_element(
            elements.kernels[b, ENERGY], q, q, elements.first[b], elements.number[b], elements.constants[b], 0.0,
            elements.buffer,
        )  # fmt: skip
        total += elements.buffer[0]
    return total
