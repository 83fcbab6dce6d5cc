"""The linear system of one Newton iteration, assembled into a fixed sparse pattern by a compiled kernel."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.discretise.assembly import block_tangents, unpack_tangent
from anctmm.elements.tangent_blocks import TANGENT_BLOCK
from anctmm.jit.compiling import allocating_kernel, kernel
from reference.global_dae.loads import Loads
from reference.global_dae.lu import Index
from reference.global_dae.model import Matrix, Model, Parts, kkt

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Integers = NDArray[np.integer[Any]]


class System(NamedTuple):
    """Numbers of [c M + K, sΦᵀ; sΦ, 0] by columns.

    `mass` and `joints` are the numbers of M and of the sΦ blocks in that pattern, given by `column` and `row`;
    `element` (elements, 2 rows, 2 rows) and `load` (loads, 4) are the places of the entries of tangents. One number
    behind the pattern's takes the entries of components that a cable does not have.
    """

    column: Index
    row: Index
    mass: Array
    joints: Array
    element: Index
    load: Index


def system_of(model: Model, scale: float) -> System:
    """Pattern and constant numbers of the linear system; `scale` is that of the constraint rows."""
    n = model.dofs
    numbers = _component_numbers(model)
    element, load = _element_numbers(model, numbers), _load_numbers(model, numbers)
    used = np.concatenate([element.reshape(-1, 2), load.reshape(-1, 2)])
    used = used[(used >= 0).all(axis=1)]
    block = sparse.csc_array((np.ones(len(used)), (used[:, 0], used[:, 1])), shape=(n, n))
    full = kkt(Matrix(block + sparse.eye_array(n)), abs(model.constraints), scale)
    full.sort_indices()
    index = sparse.csc_array((np.arange(1, full.nnz + 1), full.indices, full.indptr), shape=full.shape)

    def numbers_of(A: Matrix) -> Array:
        entries = sparse.coo_array(A)
        data = np.zeros(full.nnz)
        data[_lookup(index, entries.row, entries.col)] = entries.data
        return data

    return System(
        full.indptr.astype(np.uint32),
        full.indices.astype(np.uint32),
        numbers_of(kkt(model.mass, model.constraints, 0.0)),
        numbers_of(kkt(Matrix((n, n)), model.constraints, scale)),
        _targets(index, element),
        _targets(index, load),
    )


def matrix_of(system: System, data: Array) -> Matrix:
    """The linear system as a sparse matrix."""
    n = len(system.column) - 1
    where = system.row.astype(np.int64), system.column.astype(np.int64)
    return Matrix((data[: len(system.row)], *where), shape=(n, n))


def _component_numbers(model: Model) -> Ints:
    """Number of every component, (rows, nodes), −1 where there is none."""
    numbers = np.repeat(2 * model.numbers, 2, axis=0)
    numbers[1::2] += 1
    numbers[numbers < 0] = -1
    return numbers


def _element_numbers(model: Model, numbers: Ints) -> Ints:
    """Component numbers of each entry of each element's tangent, (elements, 2 rows, 2 rows, 2)."""
    first = np.concatenate([f + np.arange(e) for f, e in zip(model.bodies.first, model.bodies.elements)])  # noqa: B905
    own = np.concatenate([numbers[:, first], numbers[:, first + 1]]).T
    return np.stack(np.broadcast_arrays(own[:, :, None], own[:, None, :]), axis=-1)


def _load_numbers(model: Model, numbers: Ints) -> Ints:
    """Component numbers of each entry of each varying load's tangent, (loads, 4, 2)."""
    x = numbers.reshape(-1)[model.loads.place]
    pairs = [(x, x), (x, x + 1), (x + 1, x), (x + 1, x + 1)]
    return np.stack([np.stack(pair, axis=-1) for pair in pairs], axis=1)


def _targets(index: Matrix, pairs: Ints) -> Index:
    """Places of entries (…, 2) in the numbers of a matrix; behind its last where there is no such entry."""
    there = (pairs >= 0).all(axis=-1)
    targets = np.full(pairs.shape[:-1], index.nnz, dtype=np.uint32)
    targets[there] = _lookup(index, pairs[there][:, 0], pairs[there][:, 1])
    return targets


def _lookup(index: Matrix, row: Integers, column: Integers) -> Ints:
    """Position of entries in the numbers of `index`, whose indices are sorted."""
    keys = np.repeat(np.arange(index.shape[1]), np.diff(index.indptr)).astype(np.int64) * index.shape[0]
    return np.searchsorted(keys + index.indices, column.astype(np.int64) * index.shape[0] + row)


@kernel
def assemble(
    system: System,
    coefficient: float,
    parts: Parts,
    loads: Loads,
    value: Array,
    q: Array,
    small: Array,
    K: Array,
    data: Array,
) -> None:
    """Numbers of [c M + K(q), sΦᵀ; sΦ, 0], K with the tangent of the torques.

    Parameters
    ----------
    coefficient : float
        c, 1/s².
    value : ndarray, shape (loads, 2)
        Of the varying loads.
    q : ndarray, shape (rows, nodes)
    small, K : ndarray, shapes (TANGENT_BUFFER,) and (2 rows, 2 rows)
        Scratch.
    data : ndarray
        Written; one longer than the pattern.
    """
    for i in range(len(system.mass)):
        data[i] = coefficient * system.mass[i] + system.joints[i]
    e = 0
    for b in range(len(parts.kinds)):
        elements = parts.first[b + 1] - 1 - parts.first[b]
        for k in range(elements):
            if k % TANGENT_BLOCK == 0:
                count = min(TANGENT_BLOCK, elements - k)
                block_tangents(
                    parts.formulations,
                    q,
                    parts.first[b] + k,
                    count,
                    parts.kinds[b],
                    parts.constants[b],
                    small,
                )
            unpack_tangent(small, k % TANGENT_BLOCK, parts.kinds[b], K)
            for i in range(K.shape[0]):
                for j in range(K.shape[1]):
                    data[system.element[e, i, j]] += K[i, j]
            e += 1
    for k in range(len(loads.place)):
        if loads.torque[k] == 1:
            row, node = loads.place[k] // loads.nodes, loads.place[k] % loads.nodes
            x, y = q[row, node], q[row + 1, node]
            s = x * x + y * y
            m = value[k, 0] / (s * s)  # −M times the second derivatives of atan2(y, x)
            data[system.load[k, 0]] -= 2.0 * m * x * y
            data[system.load[k, 1]] -= m * (y * y - x * x)
            data[system.load[k, 2]] -= m * (y * y - x * x)
            data[system.load[k, 3]] += 2.0 * m * x * y


@kernel
def fill_dense(column: Index, row: Index, data: Array, A: Array) -> None:
    """A sparse matrix, given by columns, as a dense one, written into A."""
    A[:] = 0.0
    for j in range(len(column) - 1):
        for t in range(column[j], column[j + 1]):
            A[row[t], j] = data[t]


@allocating_kernel
def solve_dense(A: Array, source: Index, right: Array, left: Array) -> None:
    """Solve with a dense matrix by LAPACK; places of the unknowns in the flat vectors in `source`."""
    x = np.linalg.solve(A, right[source])
    for i in range(len(source)):
        left[source[i]] = x[i]
