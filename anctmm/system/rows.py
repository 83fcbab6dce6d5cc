"""Constraint rows as tables: values, rates, Jacobian, curvature and forces of all of them.

A row is Σ w x·C y + Σ w c·x + Σ w n = 0 over vectors x, y with signals w(t): see `anctmm.model.expressions`.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.by_address import by_address
from anctmm.kernels.options import ONE, TWO, part
from anctmm.model.expressions import Signal
from anctmm.system.body_meshes import SpatialMesh
from anctmm.system.numbering import Numbering

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@by_address
class Rows(NamedTuple):
    """Tables of rows, for kernels; vectors as (node, first component), signals by number, 0 is the one that is 1.

    Parameters
    ----------
    pairs : ndarray of int, shape (n, 8)
        Row, node and component of x, of y, signal, and the entries of J by x and y.
    C : ndarray, shape (n, dim, dim)
    terms : ndarray of int, shape (n, 5)
        Row, node, component, signal and entry of J.
    c : ndarray, shape (n, dim)
    constants : ndarray of int, shape (n, 2)
        Row and signal.
    n : ndarray, shape (n,)
    entries : ndarray of int, shape (n, 3)
        Of J: row, node, component of the vector.
    J : ndarray, shape (n, dim)
        Written by `set_jacobian`.
    at : ndarray of int, shape (rows,)
        Places of the multipliers in the unknowns.
    codes, curvature : ndarray of int
        Of the entries of J, and of the pairs, in the matrix.
    compliance : ndarray, shape (rows,)
        δ of each row over the factor of the mass in the matrix: see `regularisation`.
    g, multiplier : ndarray, shape (rows,)
        Values of the rows, and their multipliers: written by runs.
    stiff, weight : ndarray, shape (rows,)
        s of each row, 0 of most, and s times the factor of the mass in the matrix: see `augment`.
    squares : ndarray of int, shape (n, 3)
        Pairs of entries of J whose products stand in s JᵀJ, and where these are in the matrix.
    """

    pairs: Ints
    C: Array
    terms: Ints
    c: Array
    constants: Ints
    n: Array
    entries: Ints
    J: Array
    at: Ints
    codes: Ints
    curvature: Ints
    compliance: Array
    g: Array
    multiplier: Array
    stiff: Array
    weight: Array
    squares: Ints


#: δ of a row, over ΣJ²/(c m): large beside rounding, small beside what a correction by Newton's method mends.
REGULARISATION = 1e-12


def rows_of(numbering: Numbering, signals: Sequence[Signal], mass: Array) -> Rows:
    """Tables of the rows of a scene.

    signals: all, from number 1 on; mass: of each vector, kg, (vectors,), for the regularisation.
    """
    mesh, dim = numbering.mesh, numbering.mesh.dim
    number: dict[Signal | None, int] = {None: 0, **{w: k + 1 for k, w in enumerate(signals)}}
    entry: dict[tuple[int, int], int] = {}
    pairs, C, terms, c, constants, n = [], [], [], [], [], []

    def place(x: int) -> tuple[int, int]:
        return x // mesh.slots, x % mesh.slots * dim

    def of(row: int, x: int) -> int:
        return entry.setdefault((row, x), len(entry))

    for k, row in enumerate(numbering.rows):
        for (x, y, w), matrix in row.equation.pairs.items():
            pairs.append((k, *place(x), *place(y), number[w], of(k, x), of(k, y)))
            C.append(matrix)
        for (x, w), vector in row.equation.terms.items():
            terms.append((k, *place(x), number[w], of(k, x)))
            c.append(vector)
        for w, value in row.equation.constants.items():
            constants.append((k, number[w]))
            n.append(value)
    stiff = _stiff(numbering)
    rows, vectors = (np.array([key[i] for key in entry], dtype=np.int64) for i in (0, 1))
    found = Rows(
        _table(pairs, 8), np.array(C).reshape(-1, dim, dim), _table(terms, 5), np.array(c).reshape(-1, dim),
        _table(constants, 2), np.array(n, dtype=float),
        np.stack([rows, vectors // mesh.slots, vectors % mesh.slots * dim], axis=1),
        np.zeros((len(entry), dim)), numbering.multiplier, numbering.row_codes(rows, vectors),
        numbering.codes(*_vectors(_table(pairs, 8), mesh.slots, dim)), np.zeros(len(numbering.rows)),
        np.zeros(len(numbering.rows)), np.zeros(len(numbering.rows)),
        stiff, np.zeros(len(numbering.rows)), _squares(numbering, entry, stiff),
    )  # fmt: skip
    set_jacobian(found, mesh.reference, _at_start(signals))
    unknown = numbering.root[vectors]
    size = (found.J**2).sum(axis=1) / mass[unknown]
    unknowns = np.isin(rows, rows[found.codes >= 0])  # a row of driven vectors alone has no other pivot
    part = np.where(unknowns, np.where(found.codes >= 0, REGULARISATION, 0.0), 1.0)
    np.add.at(found.compliance, rows, part * size)
    return found


def _stiff(numbering: Numbering) -> Array:
    """s of each row that keeps the shape of a rigid body in space, whose mass matrix may be singular; 0 of others."""
    mesh, found = numbering.mesh, np.zeros(len(numbering.rows))
    body_at = {
        mesh.first[name] + k: body
        for name, body in mesh.bodies.items()
        if isinstance(body, SpatialMesh)
        for k in range(body.nodes)
    }
    for k, row in enumerate(numbering.rows) if body_at else ():
        bodies = [body_at.get(x // mesh.slots) for x in row.vectors]
        if numbering.curved(row) and bodies[0] is not None and all(body is bodies[0] for body in bodies):
            found[k] = bodies[0].moments.max()
    return found


def _squares(numbering: Numbering, entry: Mapping[tuple[int, int], int], stiff: Array) -> Ints:
    """Pairs of entries of each row that has an s, and the codes of their vectors."""
    of_row: dict[int, list[tuple[int, int]]] = {}
    for (row, x), e in entry.items():
        if stiff[row] > 0.0:
            of_row.setdefault(row, []).append((e, x))
    found = list[tuple[int, int, int]]()
    for pairs in of_row.values():
        for n, (e, x) in enumerate(pairs):
            for d, y in pairs[: n + 1]:
                code = int(numbering.codes(np.array([x]), np.array([y]))[0])
                found.append((e, d, code & ~3 if e == d and code >= 0 else code))
    return _table(found, 3)


def _at_start(signals: Sequence[Signal]) -> Array:
    values = [w.at(np.array(w.history(0.0), dtype=float).reshape(3, 1))[:, 0] for w in signals]
    return np.array([[1.0, 0.0, 0.0], *values])


def _table(lines: Sequence[tuple[int, ...]], width: int) -> Ints:
    return np.array(lines, dtype=np.int64).reshape(-1, width)


def _vectors(pairs: Ints, slots: int, dim: int) -> tuple[Ints, Ints]:
    """Numbers of x and y of pairs."""
    return pairs[:, 1] * slots + pairs[:, 2] // dim, pairs[:, 3] * slots + pairs[:, 4] // dim


def set_rows(rows: Rows, q: Array, signals: Array) -> float:
    """Values g of all rows at coordinates q and signals, (signals, 3); the largest of them."""
    g, dim = rows.g, rows.C.shape[1]
    g[:] = 0.0
    for t in range(len(rows.pairs)):
        row, i, a, j, b, w, _, _ = rows.pairs[t]
        s = 0.0
        for k in range(dim):
            for m in range(dim):
                s += q[a + k, i] * rows.C[t, k, m] * q[b + m, j]
        g[row] += signals[w, 0] * s
    for t in range(len(rows.terms)):
        row, i, a, w, _ = rows.terms[t]
        s = 0.0
        for k in range(dim):
            s += rows.c[t, k] * q[a + k, i]
        g[row] += signals[w, 0] * s
    largest = 0.0
    for t in range(len(rows.constants)):
        row, w = rows.constants[t]
        g[row] += signals[w, 0] * rows.n[t]
    for k in range(len(g)):
        largest = max(largest, abs(g[k]))
    return largest


def set_jacobian(rows: Rows, q: Array, signals: Array) -> None:
    """J at coordinates q."""
    J, dim = rows.J, rows.C.shape[1]
    J[:] = 0.0
    for t in range(len(rows.pairs)):
        _, i, a, j, b, w, x, y = rows.pairs[t]
        for k in range(dim):
            for m in range(dim):
                J[x, k] += signals[w, 0] * rows.C[t, k, m] * q[b + m, j]
                J[y, m] += signals[w, 0] * rows.C[t, k, m] * q[a + k, i]
    for t in range(len(rows.terms)):
        _, _, _, w, x = rows.terms[t]
        for k in range(dim):
            J[x, k] += signals[w, 0] * rows.c[t, k]


def set_rates(rows: Rows, q: Array, v: Array, signals: Array) -> float:
    """Rates ġ = J v + ∂g/∂t in place of the values, with the J of `set_jacobian`; the largest of them."""
    multiply(rows, v)
    add_time_parts(rows, q, v, signals, ONE)
    largest = 0.0
    for k in range(len(rows.g)):
        largest = max(largest, abs(rows.g[k]))
    return largest


def set_accelerations(rows: Rows, q: Array, v: Array, w: Array, signals: Array) -> None:
    """Second derivatives J w + … in place of the values, with the J of `set_jacobian`."""
    multiply(rows, w)
    add_time_parts(rows, q, v, signals, TWO)


@part
def multiply(rows: Rows, x: Array) -> None:
    """J x in place of the values; x, (rows of nodes, nodes)."""
    rows.g[:] = 0.0
    for e in range(len(rows.entries)):
        row, i, a = rows.entries[e]
        for k in range(rows.J.shape[1]):
            rows.g[row] += rows.J[e, k] * x[a + k, i]


@part
def add_time_parts(rows: Rows, q: Array, v: Array, signals: Array, order: int) -> None:
    """Add to g what its first time derivative has beside J v, or its second one beside J v̇."""
    g, dim = rows.g, rows.C.shape[1]
    for t in range(len(rows.pairs)):
        row, i, a, j, b, w, _, _ = rows.pairs[t]
        still, mixed, moving = 0.0, 0.0, 0.0
        for k in range(dim):
            for m in range(dim):
                C = rows.C[t, k, m]
                still += q[a + k, i] * C * q[b + m, j]
                mixed += v[a + k, i] * C * q[b + m, j] + q[a + k, i] * C * v[b + m, j]
                moving += v[a + k, i] * C * v[b + m, j]
        if order == 1:
            g[row] += signals[w, 1] * still
        else:
            g[row] += signals[w, 2] * still + 2.0 * signals[w, 1] * mixed + 2.0 * signals[w, 0] * moving
    for t in range(len(rows.terms)):
        row, i, a, w, _ = rows.terms[t]
        still, moving = 0.0, 0.0
        for k in range(dim):
            still += rows.c[t, k] * q[a + k, i]
            moving += rows.c[t, k] * v[a + k, i]
        g[row] += (
            signals[w, 1] * still if order == 1 else signals[w, 2] * still + 2.0 * signals[w, 1] * moving
        )
    for t in range(len(rows.constants)):
        row, w = rows.constants[t]
        g[row] += signals[w, order] * rows.n[t]


@part
def add_row_forces(rows: Rows, f: Array) -> None:
    """Add −Jᵀλ to f, (rows of nodes, nodes)."""
    for e in range(len(rows.entries)):
        row, i, a = rows.entries[e]
        for k in range(rows.J.shape[1]):
            f[a + k, i] -= rows.J[e, k] * rows.multiplier[row]


def drive_power(rows: Rows, q: Array, signals: Array) -> float:
    """Power of what drives rows, W: λ ∂g/∂t."""
    rows.g[:] = 0.0
    add_time_parts(rows, q, q, signals, ONE)
    power = 0.0
    for k in range(len(rows.g)):
        power += rows.multiplier[k] * rows.g[k]
    return power


def drive_work(rows: Rows, q: Array, signals: Array, moving: bool, memory: Array) -> float:
    """Work of what drives rows since the last call, J: mean force λ ∂g/∂w of each signal w times its change.

    Memory, (3, signals): forces and values at the last call, and scratch. There is no work yet unless `moving`.
    """
    dim = rows.C.shape[1]
    for w in range(memory.shape[1]):
        memory[2, w] = 0.0
    for t in range(len(rows.pairs)):
        row, i, a, j, b, w, _, _ = rows.pairs[t]
        for k in range(dim):
            for m in range(dim):
                memory[2, w] += rows.multiplier[row] * q[a + k, i] * rows.C[t, k, m] * q[b + m, j]
    for t in range(len(rows.terms)):
        row, i, a, w, _ = rows.terms[t]
        for k in range(dim):
            memory[2, w] += rows.multiplier[row] * rows.c[t, k] * q[a + k, i]
    for t in range(len(rows.constants)):
        row, w = rows.constants[t]
        memory[2, w] += rows.multiplier[row] * rows.n[t]
    work = 0.0
    for w in range(1, memory.shape[1]):
        if moving:
            work += 0.5 * (memory[0, w] + memory[2, w]) * (signals[w, 0] - memory[1, w])
        memory[0, w], memory[1, w] = memory[2, w], signals[w, 0]
    return work
