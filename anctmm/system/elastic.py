"""Elastic forces, inertia, tangents and energies of all elements and rigid bodies, body after body."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.compiled import MODULES, address
from anctmm.elements.force_blocks import BLOCK
from anctmm.elements.tangent_blocks import TANGENT_BLOCK, TANGENT_BUFFER
from anctmm.kernels.by_address import by_address
from anctmm.kernels.intrinsics import call, call_number
from anctmm.kernels.options import ONE, part
from anctmm.system.body_meshes import BeamMesh
from anctmm.system.matrix import add
from anctmm.system.mesh import Mesh
from anctmm.system.numbering import Numbering

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
#: As many zeros as vectors have components or blocks have rows: constants for the compiler.
Zeros = tuple[int, ...]

#: Columns of the addresses of kernels.
FORCES, DAMPING, TANGENTS, ENERGY = range(4)


@by_address
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
    constants : ndarray, shape (beams, numbers)
        Of the element kernels.
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
    entry : ndarray of int, shape (12, 12)
        Where the entries of a tangent stand among those of the first element of a block.
    """

    first: Ints
    number: Ints
    kernels: Ints
    vectors: Ints
    constants: Array
    masses: Array
    damping: Array
    pairs: Ints
    nodes: Ints
    mass: Array
    node_pairs: Ints
    buffer: Array
    tangents: Array
    entry: Ints


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
        constants, masses, np.array([m.element.damping for m in beams], dtype=float),
        _pairs(numbering, elements, 2 * mesh.slots), nodes, mass, _pairs(numbering, nodes, mesh.slots),
        np.zeros(12 * BLOCK), np.zeros(TANGENT_BUFFER), _entries(),
    )  # fmt: skip


def _entries() -> Ints:
    """`Elements.entry`: lower triangles, row by row."""
    row, column = np.indices((12, 12))
    high, low = np.maximum(row, column), np.minimum(row, column)
    return np.asarray((high * (high + 1) // 2 + low) * TANGENT_BLOCK)


def _addresses(mesh: BeamMesh) -> list[int]:
    """Addresses of the kernels of a beam's elements."""
    damped = bool(mesh.element.damping)
    kinds = ("forces", "damping_forces", "tangents", "energy")
    return [address(_kernel_name(mesh), what) if what != "damping_forces" or damped else 0 for what in kinds]


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
def take_forces(space, out, vectors, first, count, f):  # type: ignore[no-untyped-def]
    """Take the forces of a row of elements from f, (rows, nodes): both nodes of each."""
    for k in range(vectors * len(space)):
        for j in range(count):
            f[k, first + j] -= out[k * BLOCK + j]
        for j in range(count):
            f[k, first + j + 1] -= out[(6 + k) * BLOCK + j]


def subtract_elastic(space: Zeros, elements: Elements, q: Array, f: Array) -> None:
    """Subtract the elastic forces, the gradient of the strain energy, from f, (rows, nodes)."""
    for b in range(len(elements.first)):
        done, first = 0, elements.first[b]
        while done < elements.number[b]:
            some = min(BLOCK, elements.number[b] - done)
            call(elements.kernels[b, FORCES], q, first + done, some, elements.constants[b], elements.buffer)
            take_forces(space, elements.buffer, elements.vectors[b], first + done, some, f)
            done += some


def subtract_damping(space: Zeros, elements: Elements, q: Array, v: Array, f: Array) -> None:
    """Subtract the damping forces at velocities v from f."""
    for b in range(len(elements.first)):
        if elements.damping[b] > 0.0:
            done, first = 0, elements.first[b]
            while done < elements.number[b]:
                some = min(BLOCK, elements.number[b] - done)
                constants, time = elements.constants[b], elements.damping[b]
                call(elements.kernels[b, DAMPING], q, v, first + done, some, constants, time, elements.buffer)
                take_forces(space, elements.buffer, elements.vectors[b], first + done, some, f)
                done += some


@part
def subtract_inertia(space: Zeros, elements: Elements, w: Array, f: Array) -> None:
    """Subtract M w from f."""
    for b in range(len(elements.first)):
        _row_inertia(space, elements.masses[b], w, elements.first[b], elements.number[b], f)
    subtract_rigid_inertia(elements, w, f)


@part
def subtract_driven_inertia(space: Zeros, elements: Elements, driven: Any, w: Array, f: Array) -> None:
    """The same where w is zero but at driven vectors."""
    for k in range(len(driven.beam)):
        _row_inertia(space, elements.masses[driven.beam[k]], w, driven.element[k], ONE, f)
    subtract_rigid_inertia(elements, w, f)


@part
def _row_inertia(space, m, w, first, count, f):  # type: ignore[no-untyped-def]
    """Subtract the inertia of a row of elements."""
    dim = len(space)
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


def subtract_beside(
    space: Zeros, elements: Elements, driven: Any, q: Array, v: Array, w: Array, f: Array
) -> None:
    """Subtract elastic, damping and inertia forces of the elements next to driven nodes."""
    for k in range(len(driven.beam)):
        _subtract_element(space, elements, driven.beam[k], driven.element[k], q, v, w, f)


@part
def _subtract_element(space, elements, b, i, q, v, w, f):  # type: ignore[no-untyped-def]
    """Subtract those of the element of beam b behind node i."""
    out, constants, vectors = elements.buffer, elements.constants[b], elements.vectors[b]
    call(elements.kernels[b, FORCES], q, i, ONE, constants, out)
    take_forces(space, out, vectors, i, ONE, f)
    if elements.damping[b] > 0.0:
        call(elements.kernels[b, DAMPING], q, v, i, ONE, constants, elements.damping[b], out)
        take_forces(space, out, vectors, i, ONE, f)
    _row_inertia(space, elements.masses[b], w, i, ONE, f)


def add_mass(size: Zeros, space: Zeros, elements: Elements, factor: float, flat: Array) -> None:
    """Add factor · M to the matrix."""
    e, masses, pairs, number = 0, elements.masses, elements.pairs, elements.number
    for b in range(len(number)):
        for _ in range(number[b]):
            p = 0
            for k in range(masses.shape[1]):
                for m in range(k + 1):
                    x = factor * masses[b, k, m]
                    if x != 0.0:
                        for c in range(len(space)):
                            add(flat, len(size), pairs[e, p], c, c, x)
                    p += 1
            e += 1
    dim = len(space)
    slots = elements.mass.shape[1] // dim
    for n in range(len(elements.nodes)):
        p = 0
        for k in range(slots):
            for m in range(k + 1):
                for c in range(dim):
                    for d in range(dim):
                        x = factor * elements.mass[n, k * dim + c, m * dim + d]
                        add(flat, len(size), elements.node_pairs[n, p], c, d, x)
                p += 1


def add_tangent(
    size: Zeros, space: Zeros, elements: Elements, q: Array, stiffness: float, damping: float, flat: Array
) -> None:
    """Add stiffness · K + damping · D to the matrix."""
    e, out = 0, elements.tangents
    for b in range(len(elements.first)):
        done, first, vectors = 0, elements.first[b], elements.vectors[b]
        kernel, constants = elements.kernels[b, TANGENTS], elements.constants[b]
        material = stiffness + damping * elements.damping[b]
        while done < elements.number[b]:
            some = min(TANGENT_BLOCK, elements.number[b] - done)
            call(kernel, q, first + done, some, constants, material, stiffness, out)
            for j in range(some):
                place_tangent(size, space, elements, e + j, vectors, j, flat)
            done += some
            e += some


@part
def place_tangent(size, space, elements, e, vectors, j, flat):  # type: ignore[no-untyped-def]
    """Add the tangent of element e, number j of a block, to the matrix, by pairs of its vectors with their codes."""
    dim, width, slots = len(space), len(size), elements.masses.shape[1] // 2
    pairs, entry, out = elements.pairs, elements.entry, elements.tangents
    for k in range(2 * vectors):
        one = k if k < vectors else k - vectors + slots
        for m in range(k + 1):
            two = m if m < vectors else m - vectors + slots
            code = pairs[e, one * (one + 1) // 2 + two]
            at, stand = code >> 2, code & 3
            if code >= 0 and stand != 1:
                for c in range(dim):
                    for d in range(dim):
                        flat[at + width * c + d] += out[entry[dim * k + c, dim * m + d] + j]
            if code >= 0 and stand != 0:
                for c in range(dim):
                    for d in range(dim):
                        flat[at + width * d + c] += out[entry[dim * k + c, dim * m + d] + j]


def kinetic_energy(space: tuple[int, ...], elements: Elements, v: Array, scratch: Array) -> float:
    """Kinetic energy at velocities v, J."""
    scratch[:] = 0.0
    subtract_inertia(space, elements, v, scratch)
    total = 0.0
    for k in range(v.shape[0]):
        for i in range(v.shape[1]):
            total -= 0.5 * scratch[k, i] * v[k, i]
    return total


def strain_energy(elements: Elements, q: Array) -> float:
    """Strain energy of all elements, J."""
    total = 0.0
    for b in range(len(elements.first)):
        first, number, constants = elements.first[b], elements.number[b], elements.constants[b]
        total += call_number(elements.kernels[b, ENERGY], q, first, number, constants)
    return total
