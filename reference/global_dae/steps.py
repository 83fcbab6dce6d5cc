"""Compiled steps of the rival: Zhai's explicit ones, and generalized-α in index-3 form by a modified Newton iteration.

Formulas as in `reference.global_dae.integrators`. States are rows of arrays, each found from the one before.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.methods import Coefficients
from reference.global_dae.elements import Elements, add_tangents, damping_forces, forces
from reference.global_dae.factors import Factors, Index, factor, solve_factored
from reference.global_dae.kernels import inlined, kernel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Newton iterations of a step at most; ratio of corrections above which the matrix is renewed; corrections after which
#: the next step renews it; a correction that is rounding where it no longer falls; values above HUGE are out of bounds.
ITERATIONS, SLOW, MANY, STALLED, HUGE = 30, 0.3, 5, 1e-8, 1e60
#: Places of the counts: Newton's corrections, factorizations, whether factors can be used.
CORRECTIONS, FACTORIZATIONS, USABLE = range(3)


class Scheme(NamedTuple):
    """Step h (s) and coefficients of both methods; by_v: ∂v/∂q; tolerance of corrections.

    dense: whether matrices are solved by LAPACK. scale: of rows and multipliers in linear systems.
    """

    h: float
    psi: float
    phi: float
    c: Coefficients
    by_v: float
    tolerance: float
    dense: bool
    scale: float


class Rows(NamedTuple):
    """J by rows (first, column, factor), and factors of J Jᵀ. gap, change: scratch, (m,)."""

    first: Index
    column: Index
    factor: Array
    gram: Factors
    gap: Array
    change: Array


class Loads(NamedTuple):
    """Loads on sums of vectors: load k on those with the x components at[first[k]], … times `weight`."""

    torque: NDArray[np.bool_]
    first: Ints
    at: Ints
    weight: Array


class Saddle(NamedTuple):
    """[c M + K, sJᵀ; sJ, 0] by columns: constant numbers of M and of J, places of the entries of tangents, numbers."""

    column: Index
    row: Index
    mass: Array
    joints: Array
    elements: Ints
    moments: Ints
    data: Array


class Room(NamedTuple):
    """Scratch: force, damping, (n,), right, left, (n + m,), and the dense matrix.

    unit: sizes of the coordinates; change: where a step has failed; counts: see above.
    """

    force: Array
    damping: Array
    change: Array
    right: Array
    left: Array
    matrix: Array
    unit: Array
    counts: Ints


class Equations(NamedTuple):
    """What the steps of a scene take."""

    scheme: Scheme
    elements: Elements
    rows: Rows
    loads: Loads
    dead: Array
    factors: Factors
    saddle: Saddle
    room: Room


class Tables(NamedTuple):
    """At each step: loads (steps, loads, 2), and b of J q = b with its derivatives by time, (steps, m)."""

    loads: Array
    b: Array
    rate: Array
    acceleration: Array


class States(NamedTuple):
    """At each step: q, v, q̈, auxiliary a or the q̈ before, (steps, n), μ/s, (steps, m), power of damping, (steps,)."""

    q: Array
    v: Array
    a: Array
    auxiliary: Array
    mu: Array
    power: Array


# --- what both share ------------------------------------------------------------------------------------------


@inlined
def damped(equations: Equations, q: Array, v: Array) -> float:
    """Forces of damping into the room, and their power."""
    damping, power = equations.room.damping, 0.0
    damping_forces(equations.elements, q, v, damping)
    for i in range(len(v)):
        power += damping[i] * v[i]
    return power


@inlined
def applied(equations: Equations, values: Array, q: Array, v: Array) -> float:
    """Forces of gravity, elasticity, damping and loads into `right`; of a moment M on g it is M (−g_y, g_x)/|g|².

    Returns the power of damping.
    """
    loads, room = equations.loads, equations.room
    forces(equations.elements, q, room.force)
    power = damped(equations, q, v)
    for i in range(len(q)):
        room.right[i] = equations.dead[i] - room.force[i] + room.damping[i]
    for k in range(len(loads.torque)):
        u, w = values[k, 0], values[k, 1]
        if loads.torque[k]:  # on one vector of a node
            x, y = q[loads.at[loads.first[k]]], q[loads.at[loads.first[k]] + 1]
            moment = u / (x * x + y * y)
            u, w = -moment * y, moment * x
        for t in range(loads.first[k], loads.first[k + 1]):
            room.right[loads.at[t]] += loads.weight[t] * u
            room.right[loads.at[t] + 1] += loads.weight[t] * w
    return power


def _solve_dense(saddle: Saddle, full: Array, right: Array, left: Array) -> None:
    """From `right` into `left` by LAPACK."""
    full[:] = 0.0
    for j in range(len(saddle.column) - 1):
        for t in range(saddle.column[j], saddle.column[j + 1]):
            full[saddle.row[t], j] = saddle.data[t]
    left[:] = np.linalg.solve(full, right)


solve_dense = kernel(_solve_dense, memory=True)


@inlined
def solve(equations: Equations) -> None:
    """From `right` into `left`: by factors, or by LAPACK."""
    room = equations.room
    if equations.scheme.dense:
        solve_dense(equations.saddle, room.matrix, room.right, room.left)
    else:
        solve_factored(equations.factors, room.right, room.left)


@inlined
def bounded(x: Array) -> bool:
    """Whether all numbers are finite, and none has left all bounds."""
    good = True
    for i in range(len(x)):
        good &= abs(x[i]) < HUGE
    return good


# --- explicit steps -------------------------------------------------------------------------------------------


@inlined
def project(rows: Rows, q: Array, b: Array) -> None:
    """q ← q − Jᵀ (J Jᵀ)⁻¹ (J q − b)."""
    for j in range(len(b)):
        rows.gap[j] = -b[j]
        for t in range(rows.first[j], rows.first[j + 1]):
            rows.gap[j] += rows.factor[t] * q[rows.column[t]]
    solve_factored(rows.gram, rows.gap, rows.change)
    for j in range(len(b)):
        for t in range(rows.first[j], rows.first[j + 1]):
            q[rows.column[t]] -= rows.factor[t] * rows.change[j]


@inlined
def advance(equations: Equations, z: States, tables: Tables, k: int) -> None:
    """Positions and velocities of row k, put back on the constraints."""
    s = equations.scheme
    for i in range(len(z.q[k])):
        a, before = z.a[k - 1, i], z.auxiliary[k - 1, i]
        step = s.h * z.v[k - 1, i] + s.h * s.h * ((0.5 + s.psi) * a - s.psi * before)
        z.q[k, i] = z.q[k - 1, i] + step
        z.v[k, i] = z.v[k - 1, i] + s.h * ((1.0 + s.phi) * a - s.phi * before)
        z.auxiliary[k, i] = a
    project(equations.rows, z.q[k], tables.b[k])
    project(equations.rows, z.v[k], tables.rate[k])


@kernel
def explicit_steps(equations: Equations, tables: Tables, z: States) -> int:
    """Steps from the first row on, one a row of the tables.

    Returns how many rows are known: fewer if accelerations are not finite.
    """
    s, room, n = equations.scheme, equations.room, len(equations.dead)
    for k in range(1, len(z.q)):
        advance(equations, z, tables, k)
        z.power[k] = applied(equations, tables.loads[k], z.q[k], z.v[k])
        for i in range(n):
            room.change[i] = room.right[i]
        for j in range(len(z.mu[k])):
            room.right[n + j] = s.scale * tables.acceleration[k, j]
        if not bounded(room.right):
            return k
        solve(equations)
        if not bounded(room.left):
            return k
        room.counts[FACTORIZATIONS] += int(s.dense)
        for i in range(n):
            z.a[k, i] = room.left[i]
        for j in range(len(z.mu[k])):
            z.mu[k, j] = room.left[n + j]
    return len(z.q)


# --- implicit steps -------------------------------------------------------------------------------------------


@kernel
def assemble(equations: Equations, values: Array, q: Array) -> None:
    """Numbers of [c M + K(q), sJᵀ; sJ, 0], K with the tangent of the moments."""
    matrix, loads, data = equations.saddle, equations.loads, equations.saddle.data
    for i in range(len(data)):
        data[i] = equations.scheme.c.to_w * matrix.mass[i] + matrix.joints[i]
    add_tangents(equations.elements, equations.scheme.by_v, q, matrix.elements, data)
    at = 0
    for k in range(len(loads.torque)):
        if loads.torque[k]:
            x, y = q[loads.at[loads.first[k]]], q[loads.at[loads.first[k]] + 1]
            s = x * x + y * y
            m = values[k, 0] / (s * s)  # −M times the second derivatives of atan2(y, x)
            data[matrix.moments[at]] -= 2.0 * m * x * y
            data[matrix.moments[at + 1]] -= m * (y * y - x * x)
            data[matrix.moments[at + 2]] -= m * (y * y - x * x)
            data[matrix.moments[at + 3]] += 2.0 * m * x * y
            at += 4


@inlined
def residual(equations: Equations, tables: Tables, z: States, k: int) -> None:
    """[f − M q̈ − Jᵀμ; s (b − J q)] of row k into `right`."""
    matrix, right, n = equations.saddle, equations.room.right, len(equations.dead)
    applied(equations, tables.loads[k], z.q[k], z.v[k])
    for j in range(len(z.mu[k])):
        right[n + j] = equations.scheme.scale * tables.b[k, j]
    for j in range(len(right)):
        a = z.a[k, j] if j < n else 0.0
        x = z.q[k, j] if j < n else z.mu[k, j - n]
        for t in range(matrix.column[j], matrix.column[j + 1]):
            right[matrix.row[t]] -= matrix.mass[t] * a + matrix.joints[t] * x


@inlined
def predict(s: Scheme, z: States, k: int) -> None:
    """Start of Newton's iteration for row k: q̈_{n+1} = q̈_n."""
    c, h = s.c, s.h
    for i in range(len(z.q[k])):
        a = z.auxiliary[k - 1, i]
        b = (z.a[k - 1, i] - c.alpha_m * a) / (1.0 - c.alpha_m)
        z.q[k, i] = z.q[k - 1, i] + h * z.v[k - 1, i] + h * h * ((0.5 - c.beta) * a + c.beta * b)
        z.v[k, i] = z.v[k - 1, i] + h * ((1.0 - c.gamma) * a + c.gamma * b)
        z.a[k, i] = z.a[k - 1, i]
    for j in range(len(z.mu[k])):
        z.mu[k, j] = z.mu[k - 1, j]


@inlined
def correct(equations: Equations, z: States, k: int) -> float:
    """Add the correction in `left` to row k; its size relative to the units of the coordinates."""
    s, room, n, largest = equations.scheme, equations.room, len(equations.dead), 0.0
    for i in range(n):
        d = room.left[i]
        z.q[k, i] += d
        z.v[k, i] += s.by_v * d
        z.a[k, i] += s.c.to_w * d
        room.change[i] = d
        size = abs(d) / room.unit[i]
        if not size <= largest:
            largest = size
    for j in range(len(z.mu[k])):
        z.mu[k, j] += room.left[n + j]
    return largest


@inlined
def newton(full: bool, equations: Equations, tables: Tables, z: States, k: int) -> bool:
    """Find row k: with a new matrix each time if `full`, else with an old one while it contracts."""
    s, room = equations.scheme, equations.room
    before, renew = np.inf, full or room.counts[USABLE] == 0
    for iteration in range(ITERATIONS):
        residual(equations, tables, z, k)
        if not bounded(room.right):
            return False
        if renew:
            assemble(equations, tables.loads[k], z.q[k])
            room.counts[FACTORIZATIONS] += 1
            room.counts[USABLE] = int(s.dense or factor(equations.factors, equations.saddle.data))
            if room.counts[USABLE] == 0:
                return False
        solve(equations)
        size = correct(equations, z, k)
        room.counts[CORRECTIONS] += 1
        if size <= s.tolerance or (renew and 0.5 * before < size <= STALLED):
            room.counts[USABLE] *= int(iteration + 1 < MANY)  # the next step begins with a new matrix
            return True
        renew = full or size > SLOW * before
        before = size
    return False


@kernel
def implicit_steps(equations: Equations, tables: Tables, z: States) -> int:
    """Steps from the first row on, one a row of the tables; one that fails is tried again with new matrices.

    Returns how many rows are known: fewer if Newton's iteration does not converge.
    """
    s, c = equations.scheme, equations.scheme.c
    for k in range(1, len(z.q)):
        done = False
        for attempt in range(2):
            if not done:
                predict(s, z, k)
                done = newton(attempt == 1 or s.dense, equations, tables, z, k)
        if not done:
            return k
        for i in range(len(z.q[k])):
            mean = (1.0 - c.alpha_f) * z.a[k, i] + c.alpha_f * z.a[k - 1, i]
            z.auxiliary[k, i] = (mean - c.alpha_m * z.auxiliary[k - 1, i]) / (1.0 - c.alpha_m)
        z.power[k] = damped(equations, z.q[k], z.v[k])
    return len(z.q)
