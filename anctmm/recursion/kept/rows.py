"""Constraints g(x, t) = 0 between kept unknowns, Σ c w x_i x_j each, for kernels.

Their Jacobian J is part of the matrix of the kept unknowns. An explicit step solves J ẍ = −(the rest of g̈), Newton's
iteration J Δx = −g, with −Jᵀλ in the residual and the curvature λ ∂²g in the matrix.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.junctions.constraints import ONE, Constraints
from anctmm.discretise.kept import KeptUnknowns
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, shared
from anctmm.recursion.kept.sparse import Sparse, matrix_places

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Part of the largest entry below which one is taken to be rounding.
ROUNDED = 1e-9
#: Newton's corrections of the positions after an explicit step, at most: from an error of h³ the second reaches
#: rounding; a body that turns by half a radian in a step needs five.
CORRECTIONS = 10
#: Error of the constraints below which it is rounding, and below which its square is, what a correction leaves.
OFF, ENOUGH = 1e-15, 1e-8
#: Error of the constraints, of lengths relative to that of the scene, above which they are not kept.
KEPT = 1e-6


@by_address
class Rows(NamedTuple):
    """Constraints; the last of n + 1 places stands for the number 1.

    Parameters
    ----------
    number : ndarray of int, shape (rows,)
        Which kept unknown is the multiplier of each.
    row, one, two, signal : ndarray of int, shape (terms,)
        Of each term c w_signal x_one x_two.
    factor : ndarray, shape (terms,)
        c.
    places : ndarray of int, shape (3, terms)
        Where ∂/∂x_one, ∂/∂x_two and the second derivative of the row by both stand in the matrix, or −1.
    pairs : ndarray of int, shape (5, pairs)
        Where two entries of J of one row stand in the matrix, and that of the two unknowns; the row, and the first of
        the unknowns.
    lengths : ndarray, shape (n,)
        Size of each unknown, m: 1 of a place; of a direction, which has no unit, the length that it turns.
    penalty : ndarray, shape (1 + rows,)
        Part of K's largest entry with which JᵀJ is added to K, which changes no solution: for statics, where K may be
        singular by itself; and γ of each row, which came of it.
    steepest : ndarray, shape (2, rows)
        Scratch: of each row the largest entry of J, and of K, in units of the sizes of the unknowns.
    prescribed : ndarray of int, shape (2, k)
        Rows that prescribe places of nodes, and the nodes.
    unit : ndarray, shape (k, 2)
        What a unit of such a row is at its node, m.
    used : ndarray of int, shape (used,)
        The unknowns that are in a term.
    homes : ndarray of int, shape (2, n + 1)
        Row and node of the coordinate that each of these is.
    x : ndarray, shape (3, n + 1)
        Values and two derivatives.
    signals : ndarray, shape (3, signals)
        Values and two derivatives now.
    turns : ndarray of bool, shape (drives,)
        Whether a drive gives an angle, with two signals, or a position.
    multipliers, trusted : ndarray, shape (rows,)
        λ, and those of the last step that succeeded.
    value : ndarray, shape (rows,)
        Of g, or of a derivative in time.
    memory : ndarray, shape (3, signals)
        Generalized forces on the signals, and their values, at the last call of `row_work`; scratch.
    constraint : ndarray of int, shape (rows,)
        Number of each among all constraints of the scene.
    """

    number: Ints
    row: Ints
    one: Ints
    two: Ints
    signal: Ints
    factor: Array
    places: Ints
    pairs: Ints
    lengths: Array
    penalty: Array
    steepest: Array
    prescribed: Ints
    unit: Array
    used: Ints
    homes: Ints
    x: Array
    signals: Array
    turns: NDArray[np.bool_]
    multipliers: Array
    trusted: Array
    value: Array
    memory: Array
    constraint: Ints


def rows_alone(kept: KeptUnknowns, chosen: NDArray[np.bool_]) -> Rows | None:
    """Some of the constraints of a scene, without a matrix, their unknowns numbered as kept; None without any."""
    if not chosen.any():
        return None
    found = kept.constraints
    number = np.cumsum(chosen) - 1
    some = replace(
        found,
        names=[name for name, of in zip(found.names, chosen, strict=True) if of],
        terms=[term._replace(row=int(number[term.row])) for term in found.terms if chosen[term.row]],
        prescribed=[(int(number[known[0]]), *known[1:]) for known in found.prescribed],
    )
    return _rows(kept, some, np.arange(kept.size + len(some.names)), None)._replace(
        constraint=np.flatnonzero(chosen)
    )


def rows_of(kept: KeptUnknowns, number: Ints, matrix: Sparse) -> Rows:
    """The constraints of a scene whose kept unknowns have new numbers."""
    return _rows(kept, kept.constraints, number, matrix)


def _rows(kept: KeptUnknowns, found: Constraints, number: Ints, matrix: Sparse | None) -> Rows:
    n = len(number)
    terms = np.array([term[:4] for term in found.terms], dtype=np.int64).reshape(-1, 4)
    row, one, two, signal = terms.T.copy()  # contiguous for any number: each layout is compiled for itself
    renumbered = np.append(number, n)  # the last stands for ONE, which is −1
    one, two, multiplier = renumbered[one], renumbered[two], number[kept.size + row]
    unknown = [np.where(k < n, k, -1) for k in (one, two)]
    couples = ((multiplier, unknown[0]), (multiplier, unknown[1]), (unknown[0], unknown[1]))
    places = [_places(matrix, a, b) for a, b in couples]
    homes = np.zeros((2, n + 1), dtype=np.int64)
    homes[:, number[: kept.size]] = kept.homes
    used = np.unique(np.concatenate([k[k >= 0] for k in unknown])) if len(row) else np.empty(0, np.int64)
    x, signals, rows = np.zeros((3, n + 1)), np.zeros((3, found.signals)), len(found.names)
    x[0, n] = signals[0, 0] = 1.0
    at = 1
    for drive in found.drives:  # they start at 0
        signals[0, at] = 1.0 if drive.turns else 0.0
        at += drive.signals
    return Rows(
        number[kept.size :], row, one, two, signal, np.array([t.factor for t in found.terms]),
        np.array(places, dtype=np.int64).reshape(3, -1), _pairs(found, number, matrix),
        _lengths(kept, number), np.zeros(1 + rows), np.zeros((2, rows)),
        np.array([known[:2] for known in found.prescribed], dtype=np.int64).reshape(-1, 2).T.copy(),
        np.array([(known[2].real, known[2].imag) for known in found.prescribed], dtype=np.float64).reshape(-1, 2),
        used, homes, x, signals,
        np.array([drive.turns for drive in found.drives], dtype=bool),
        np.zeros(rows), np.zeros(rows), np.zeros(rows), np.zeros((3, found.signals)), np.arange(rows),
    )  # fmt: skip


def _places(matrix: Sparse | None, one: Ints, two: Ints) -> Ints:
    """Where the entries of pairs of unknowns stand in the matrix; −1 for none."""
    if matrix is None:
        return np.full(len(one), -1)
    return matrix_places(matrix, one[:, None], two[:, None]).reshape(-1)


def _pairs(found: Constraints, number: Ints, matrix: Sparse | None) -> Ints:
    """`pairs` of the rows: each two unknowns of a row once."""
    of_row: dict[int, set[int]] = {}
    for term in found.terms:
        of_row.setdefault(term.row, set()).update(k for k in (term.one, term.two) if k != ONE)
    triples = [(found.size + row, i, j) for row, used in of_row.items() for i in used for j in used if i <= j]
    if matrix is None or not triples:
        return np.empty((5, 0), dtype=np.int64)
    multiplier, one, two = number[np.array(triples).T]
    couples = ((multiplier, one), (multiplier, two), (one, two))
    rows = np.array(triples)[:, 0] - found.size
    return np.array([*(_places(matrix, a, b) for a, b in couples), rows, one])


def _lengths(kept: KeptUnknowns, number: Ints) -> Array:
    """Sizes of the unknowns, m: of places 1, of directions the reach of the body or the length of the element."""
    bodies = kept.chain.bodies
    sizes = np.array([m.reach if m.nodes == 1 else m.element_length for m in bodies.meshes])
    found = np.ones(len(number))
    row, node = kept.homes
    of = np.searchsorted(bodies.first, node, side="right") - 1
    found[number[: kept.size]] = np.where(row < 2, 1.0, sizes[of])
    return found


@embedded
def set_signals(rows, drives, first):  # type: ignore[no-untyped-def]
    """Signals from values, rates and accelerations of drives, (…, 3), those of constraints from `first` on."""
    at = 1
    w = rows.signals
    for n in range(len(rows.turns)):
        s, v, a = drives[first + n, 0], drives[first + n, 1], drives[first + n, 2]
        if rows.turns[n]:
            c, d = np.cos(s), np.sin(s)
            w[0, at], w[0, at + 1] = c, d
            w[1, at], w[1, at + 1] = -v * d, v * c
            w[2, at], w[2, at + 1] = -a * d - v * v * c, a * c - v * v * d
            at += 2
        else:
            w[0, at], w[1, at], w[2, at] = s, v, a
            at += 1


@shared
def gather(rows, order, q):  # type: ignore[no-untyped-def]
    """Take values, or derivatives of an order, of the unknowns from coordinates, (rows, nodes)."""
    for n in range(len(rows.used)):
        k = rows.used[n]
        rows.x[order, k] = q[rows.homes[0, k], rows.homes[1, k]]


@shared
def evaluate(rows, order):  # type: ignore[no-untyped-def]
    """g, or its derivative in time of an order up to 2, from what was gathered; the largest of them."""
    x, v, a = rows.x
    w, rate, second = rows.signals
    for k in range(len(rows.value)):
        rows.value[k] = 0.0
    for n in range(len(rows.row)):
        i, j, m = rows.one[n], rows.two[n], rows.signal[n]
        if order == 0:
            value = w[m] * x[i] * x[j]
        elif order == 1:
            value = w[m] * (v[i] * x[j] + x[i] * v[j]) + rate[m] * x[i] * x[j]
        else:
            value = w[m] * (a[i] * x[j] + 2.0 * v[i] * v[j] + x[i] * a[j])
            value += 2.0 * rate[m] * (v[i] * x[j] + x[i] * v[j]) + second[m] * x[i] * x[j]
        rows.value[rows.row[n]] += rows.factor[n] * value
    largest = 0.0
    for k in range(len(rows.value)):
        size = abs(rows.value[k])
        if not size <= largest:  # what is no number stays
            largest = size
    return largest


@shared
def prescribe(rows, order, u):  # type: ignore[no-untyped-def]
    """Set the places of prescribed nodes, or derivatives of an order, in coordinates u, (rows, nodes)."""
    if len(rows.prescribed[0]) > 0:
        gather(rows, order, u)
        evaluate(rows, order)
        for n in range(len(rows.prescribed[0])):
            off, node = rows.value[rows.prescribed[0, n]], rows.prescribed[1, n]
            u[0, node] -= off * rows.unit[n, 0]
            u[1, node] -= off * rows.unit[n, 1]


@shared
def fill_rows(rows, matrix):  # type: ignore[no-untyped-def]
    """Put J at the unknowns that were gathered into the matrix."""
    values, x, w = matrix.values, rows.x, rows.signals
    for n in range(len(rows.row)):
        for side in range(2):
            if rows.places[side, n] >= 0:
                values[rows.places[side, n]] = 0.0
    for n in range(len(rows.row)):
        c = rows.factor[n] * w[0, rows.signal[n]]
        if rows.places[0, n] >= 0:
            values[rows.places[0, n]] += c * x[0, rows.two[n]]
        if rows.places[1, n] >= 0:
            values[rows.places[1, n]] += c * x[0, rows.one[n]]


@embedded
def fill(rows, matrix, q, stiffness):  # type: ignore[no-untyped-def]
    """Put J at coordinates q into the matrix, and to its other entries add stiffness times the curvature λ ∂²g.

    Without stiffness, None, nothing else is added.
    """
    gather(rows, 0, q)
    fill_rows(rows, matrix)
    if stiffness is not None:
        for n in range(len(rows.row)):
            if rows.places[2, n] >= 0:
                c = (
                    stiffness
                    * rows.multipliers[rows.row[n]]
                    * rows.factor[n]
                    * rows.signals[0, rows.signal[n]]
                )
                matrix.values[rows.places[2, n]] += (2.0 if rows.one[n] == rows.two[n] else 1.0) * c
        if rows.penalty[0] > 0.0:
            _add_penalty(rows, matrix)


@embedded
def _add_penalty(rows, matrix):  # type: ignore[no-untyped-def]
    """Add Jᵀ γ J to the matrix, with γ of each row of the size that makes both alike, whatever the units.

    K may be mere rounding there, as for a beam held by the constraint only: γ is then that of all kept unknowns.
    """
    values, pairs, lengths = matrix.values, rows.pairs, rows.lengths
    whole = 0.0
    for k in range(len(matrix.dual)):
        if not matrix.dual[k]:  # the diagonal is the last of a column
            whole = max(whole, abs(values[matrix.above[k + 1] - 1]) / (lengths[k] * lengths[k]))
    for k in range(len(rows.number)):
        rows.steepest[0, k] = rows.steepest[1, k] = 0.0
    for n in range(pairs.shape[1]):
        row, k = pairs[3, n], pairs[4, n]
        rows.steepest[0, row] = max(rows.steepest[0, row], abs(values[pairs[0, n]]) / lengths[k])
        size = abs(values[matrix.above[k + 1] - 1]) / (lengths[k] * lengths[k])
        rows.steepest[1, row] = max(rows.steepest[1, row], size)
    for k in range(len(rows.number)):
        largest = rows.steepest[1, k]
        if largest < ROUNDED * whole:
            largest = whole
        factor = rows.penalty[0] * (largest if largest > 0.0 else 1.0)
        rows.penalty[1 + k] = factor / max(rows.steepest[0, k] * rows.steepest[0, k], 1e-300)
    for n in range(pairs.shape[1]):
        values[pairs[2, n]] += rows.penalty[1 + pairs[3, n]] * values[pairs[0, n]] * values[pairs[1, n]]


@embedded
def ask(rows, load):  # type: ignore[no-untyped-def]
    """Ask the next solution for what takes away the value of the constraints."""
    for k in range(len(rows.number)):
        load[rows.number[k]] = -rows.value[k]


@embedded
def ask_whole(rows, load):  # type: ignore[no-untyped-def]
    """Ask for what takes away the value of the constraints, of a matrix with a penalty: the load −γ Jᵀg goes with it.

    The unknowns must have been gathered.
    """
    ask(rows, load)
    x, w = rows.x, rows.signals
    for n in range(len(rows.used)):
        load[rows.used[n]] = 0.0
    for n in range(len(rows.row)):
        i, j = rows.one[n], rows.two[n]
        c = rows.penalty[1 + rows.row[n]] * rows.value[rows.row[n]] * rows.factor[n] * w[0, rows.signal[n]]
        if rows.places[0, n] >= 0:
            load[i] -= c * x[0, j]
        if rows.places[1, n] >= 0:
            load[j] -= c * x[0, i]


@embedded
def push(rows, load):  # type: ignore[no-untyped-def]
    """Put the constraints' forces −Jᵀλ on the coordinates in the next solution; other loads there are forgotten."""
    x, w = rows.x, rows.signals
    for n in range(len(rows.used)):
        load[rows.used[n]] = 0.0
    for n in range(len(rows.row)):
        i, j = rows.one[n], rows.two[n]
        c = rows.factor[n] * w[0, rows.signal[n]] * rows.multipliers[rows.row[n]]
        if rows.places[0, n] >= 0:
            load[i] -= c * x[0, j]
        if rows.places[1, n] >= 0:
            load[j] -= c * x[0, i]


@embedded
def take_multipliers(rows, x, load, before):  # type: ignore[no-untyped-def]
    """λ ← before · λ + what was found; nothing is asked of the solutions that follow."""
    for k in range(len(rows.number)):
        rows.multipliers[k] = before * rows.multipliers[k] + x[rows.number[k]]
        load[rows.number[k]] = 0.0
    for n in range(len(rows.used)):
        load[rows.used[n]] = 0.0


@embedded
def row_work(rows, moving):  # type: ignore[no-untyped-def]
    """Work of the drives since the last call, by the trapezoidal rule, J; 0 unless `moving`.

    The power of −Jᵀλ is λ ∂g/∂t, as J ẋ = −∂g/∂t.
    """
    x, w, memory = rows.x, rows.signals, rows.memory
    work = 0.0
    for m in range(w.shape[1]):
        memory[2, m] = 0.0
    for n in range(len(rows.row)):
        force = rows.factor[n] * rows.multipliers[rows.row[n]] * x[0, rows.one[n]] * x[0, rows.two[n]]
        memory[2, rows.signal[n]] += force
    for m in range(1, w.shape[1]):
        if moving:
            work += 0.5 * (memory[2, m] + memory[0, m]) * (w[0, m] - memory[1, m])
        memory[0, m], memory[1, m] = memory[2, m], w[0, m]
    return work


@embedded
def row_power(rows):  # type: ignore[no-untyped-def]
    """Power of the drives now, W: that of −Jᵀλ, as of `row_work`."""
    x, power = rows.x, 0.0
    for n in range(len(rows.row)):
        force = rows.factor[n] * rows.multipliers[rows.row[n]] * x[0, rows.one[n]] * x[0, rows.two[n]]
        power += force * rows.signals[1, rows.signal[n]]
    return power
