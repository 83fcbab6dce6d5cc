"""The linear system of one Newton iteration, assembled into a fixed sparse pattern by a compiled kernel."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.assembly import element_tangent
from anctmm.compiling import kernel
from reference.global_dae.loads import Loads
from reference.global_dae.model import Matrix, Model, Parts, kkt

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class System(NamedTuple):
    """Numbers of [c M + K, sΦᵀ; sΦ, 0] by columns.

    `mass` and `joints` are the numbers of M and of the sΦ blocks in that pattern; `element` (elements, (2 rows)²) and
    `load` (loads, 4) say where the entries of tangents go, −1: nowhere. `column` and `row` are the pattern.
    """

    column: Ints
    row: Ints
    mass: Array
    joints: Array
    element: Ints
    load: Ints


def system_of(model: Model, scale: float, stiffness: bool = True) -> System:
    """Pattern and constant numbers of the linear system; without stiffness the constant [M, sΦᵀ; sΦ, 0], all in `mass`."""
    n = model.dofs
    numbers = _component_numbers(model)
    element = _element_numbers(model, numbers)
    places = model.loads.place
    x = numbers.reshape(-1)[places] if len(places) else np.zeros(0, dtype=np.int64)
    load = np.stack([np.stack([x, x], 1), np.stack([x, x + 1], 1), np.stack([x + 1, x], 1), np.stack([x + 1] * 2, 1)])
    pairs = [element.reshape(-1, 2), load.reshape(-1, 2)] if stiffness else []
    used = np.concatenate([*pairs, np.zeros((0, 2), dtype=np.int64)])
    used = used[(used >= 0).all(axis=1)]
    block = sparse.csc_array((np.ones(len(used)), (used[:, 0], used[:, 1])), shape=(n, n))
    full = kkt(abs(block) + abs(model.mass) + sparse.eye_array(n), abs(model.constraints), scale)
    full.sort_indices()
    index = sparse.csc_array((np.arange(1, full.nnz + 1), full.indices, full.indptr), shape=full.shape)

    def numbers_of(A: Matrix) -> Array:
        entries = sparse.coo_array(A)
        data = np.zeros(full.nnz)
        data[_lookup(index, entries.row, entries.col)] = entries.data
        return data

    mass = numbers_of(kkt(model.mass, model.constraints, 0.0))
    joints = numbers_of(kkt(Matrix((n, n)), model.constraints, scale))
    return System(
        full.indptr.astype(np.int64),
        full.indices.astype(np.int64),
        mass if stiffness else mass + joints,
        joints,
        _targets(index, element) if stiffness else np.zeros((0, 0), dtype=np.int64),
        _targets(index, load.transpose(1, 0, 2)) if stiffness else np.zeros((0, 0), dtype=np.int64),
    )


def matrix_of(system: System, data: Array) -> Matrix:
    """The linear system as a sparse matrix."""
    n = len(system.column) - 1
    return Matrix((data, system.row, system.column), shape=(n, n))


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


def _targets(index: Matrix, pairs: Ints) -> Ints:
    flat = pairs.reshape(-1, 2)
    there = (flat >= 0).all(axis=1)
    targets = np.full(len(flat), -1, dtype=np.int64)
    targets[there] = _lookup(index, flat[there, 0], flat[there, 1])
    return targets.reshape(len(pairs), int(np.prod(pairs.shape[1:-1])))


def _lookup(index: Matrix, row: Ints, column: Ints) -> Ints:
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
    small, K : ndarray, shapes (8, 8) and (2 rows, 2 rows)
        Scratch.
    data : ndarray
        Written.
    """
    for i in range(len(data)):
        data[i] = coefficient * system.mass[i] + system.joints[i]
    e, entries = 0, K.size
    for b in range(len(parts.elements)):
        for k in range(parts.elements[b]):
            element_tangent(q, parts.first[b] + k, parts.kinds[b], parts.constants[b], small, K)
            for i in range(entries):
                at = system.element[e, i]
                if at >= 0:
                    data[at] += K[i // K.shape[1], i % K.shape[1]]
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
def fill_dense(system: System, data: Array, A: Array) -> None:
    """The linear system as a dense matrix, written into A."""
    A[:] = 0.0
    for j in range(len(system.column) - 1):
        for t in range(system.column[j], system.column[j + 1]):
            A[system.row[t], j] = data[t]


@kernel
def solve_dense(A: Array, source: Ints, right: Array, left: Array) -> None:
    """Solve with a dense matrix by LAPACK; places of the unknowns in the flat vectors in `source`."""
    x = np.linalg.solve(A, right[source])
    for i in range(len(source)):
        left[source[i]] = x[i]
