"""Compiled steps of the rival: Zhai's explicit ones, and generalized-α in index-3 form by a modified Newton iteration.

Formulas as in `reference.global_dae.integrators`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    """Step h (s) and coefficients of both methods; by_a, by_v: ∂q̈/∂q, ∂v/∂q; tolerance of corrections.

    dense: whether matrices are solved by LAPACK. scale: of rows and multipliers in linear systems.
    """

    h: float
    psi: float
    phi: float
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    by_a: float
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


class Motion(NamedTuple):
    """State, and scratch: q, v, a, the auxiliary a or the a before, (n,); μ/s, (m,).

    new_q, new_v, new_a, force, damping, (n,); right, left, (n + m,). unit: sizes of the coordinates; change: where a
    step has failed; counts: see above.
    """

    q: Array
    v: Array
    a: Array
    auxiliary: Array
    mu: Array
    new_q: Array
    new_v: Array
    new_a: Array
    force: Array
    damping: Array
    change: Array
    right: Array
    left: Array
    unit: Array
    counts: Ints


class Equations(NamedTuple):
    """What the steps of a scene take; `full` is room for the dense matrix."""

    scheme: Scheme
    elements: Elements
    rows: Rows
    loads: Loads
    dead: Array
    factors: Factors
    saddle: Saddle
    full: Array
    motion: Motion


class Tables(NamedTuple):
    """At each step: loads (steps, loads, 2), and b of J q = b with its derivatives by time, (steps, m)."""

    loads: Array
    b: Array
    rate: Array
    acceleration: Array


class History(NamedTuple):
    """At each step: q, v, a, (steps, n), μ, (steps, m), and the power of damping, (steps,)."""

    q: Array
    v: Array
    a: Array
    mu: Array
    power: Array


# --- what both share ------------------------------------------------------------------------------------------


@inlined
def applied(equations: Equations, values: Array, q: Array, v: Array) -> None:
    """Forces of gravity, elasticity, damping and loads into `right`; of a moment M on g it is M (−g_y, g_x)/|g|²."""
    loads, m = equations.loads, equations.motion
    forces(equations.elements, q, m.force)
    damping_forces(equations.elements, q, v, m.damping)
    for i in range(len(q)):
        m.right[i] = equations.dead[i] - m.force[i] + m.damping[i]
    for k in range(len(loads.torque)):
        u, w = values[k, 0], values[k, 1]
        if loads.torque[k]:  # on one vector of a node
            x, y = q[loads.at[loads.first[k]]], q[loads.at[loads.first[k]] + 1]
            moment = u / (x * x + y * y)
            u, w = -moment * y, moment * x
        for t in range(loads.first[k], loads.first[k + 1]):
            m.right[loads.at[t]] += loads.weight[t] * u
            m.right[loads.at[t] + 1] += loads.weight[t] * w


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
    m = equations.motion
    if equations.scheme.dense:
        solve_dense(equations.saddle, equations.full, m.right, m.left)
    else:
        solve_factored(equations.factors, m.right, m.left)


@inlined
def bounded(x: Array) -> bool:
    """Whether all numbers are finite, and none has left all bounds."""
    good = True
    for i in range(len(x)):
        good &= abs(x[i]) < HUGE
    return good


@inlined
def store(m: Motion, history: History, k: int, scale: float) -> None:
    """Store the state as the k-th of a history."""
    power = 0.0
    for i in range(len(m.q)):
        history.q[k, i], history.v[k, i], history.a[k, i] = m.q[i], m.v[i], m.a[i]
        power += m.damping[i] * m.v[i]
    for j in range(len(m.mu)):
        history.mu[k, j] = scale * m.mu[j]
    history.power[k] = power


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
def advance(s: Scheme, rows: Rows, m: Motion, b: Array, rate: Array) -> None:
    """Positions and velocities of the next step, put back on the constraints."""
    for i in range(len(m.q)):
        a, before = m.a[i], m.auxiliary[i]
        m.q[i] += s.h * m.v[i] + s.h * s.h * ((0.5 + s.psi) * a - s.psi * before)
        m.v[i] += s.h * ((1.0 + s.phi) * a - s.phi * before)
        m.auxiliary[i] = a
    project(rows, m.q, b)
    project(rows, m.v, rate)


@kernel
def explicit_steps(equations: Equations, first: int, tables: Tables, history: History) -> int:
    """Steps from the number `first` on, one a row of the tables; step 0 only finds the accelerations of the start.

    Returns how many were done: fewer if accelerations are not finite.
    """
    s, m = equations.scheme, equations.motion
    n = len(m.q)
    for k in range(len(tables.b)):
        if first + k > 0:
            advance(s, equations.rows, m, tables.b[k], tables.rate[k])
        applied(equations, tables.loads[k], m.q, m.v)
        for i in range(n):
            m.change[i] = m.right[i]
        for j in range(len(m.mu)):
            m.right[n + j] = s.scale * tables.acceleration[k, j]
        if not bounded(m.right):
            return k
        solve(equations)
        if not bounded(m.left):
            return k
        m.counts[FACTORIZATIONS] += int(s.dense)
        for i in range(n):
            m.a[i] = m.left[i]
            m.auxiliary[i] = m.a[i] if first + k == 0 else m.auxiliary[i]
        for j in range(len(m.mu)):
            m.mu[j] = m.left[n + j]
        store(m, history, k, s.scale)
    return len(tables.b)


# --- implicit steps -------------------------------------------------------------------------------------------


@kernel
def assemble(equations: Equations, values: Array, q: Array) -> None:
    """Numbers of [by_a M + K(q), sJᵀ; sJ, 0], K with the tangent of the moments."""
    matrix, loads, data = equations.saddle, equations.loads, equations.saddle.data
    for i in range(len(data)):
        data[i] = equations.scheme.by_a * matrix.mass[i] + matrix.joints[i]
    add_tangents(equations.elements, q, matrix.elements, data)
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
def residual(equations: Equations, values: Array, b: Array) -> None:
    """[f − M q̈ − Jᵀμ; s (b − J q)] into `right`."""
    matrix, m = equations.saddle, equations.motion
    n, right = len(m.q), m.right
    applied(equations, values, m.new_q, m.new_v)
    for j in range(len(b)):
        right[n + j] = equations.scheme.scale * b[j]
    for j in range(len(right)):
        a = m.new_a[j] if j < n else 0.0
        x = m.new_q[j] if j < n else m.mu[j - n]
        for t in range(matrix.column[j], matrix.column[j + 1]):
            right[matrix.row[t]] -= matrix.mass[t] * a + matrix.joints[t] * x


@inlined
def predict(s: Scheme, m: Motion) -> None:
    """Start of Newton's iteration: q̈_{n+1} = q̈_n."""
    h = s.h
    for i in range(len(m.q)):
        a = m.auxiliary[i]
        b = (m.a[i] - s.alpha_m * a) / (1.0 - s.alpha_m)
        m.new_q[i] = m.q[i] + h * m.v[i] + h * h * ((0.5 - s.beta) * a + s.beta * b)
        m.new_v[i] = m.v[i] + h * ((1.0 - s.gamma) * a + s.gamma * b)
        m.new_a[i] = m.a[i]


@inlined
def correct(s: Scheme, m: Motion) -> float:
    """Add the correction in `left`; its size relative to the units of the coordinates."""
    n, largest = len(m.q), 0.0
    for i in range(n):
        d = m.left[i]
        m.new_q[i] += d
        m.new_v[i] += s.by_v * d
        m.new_a[i] += s.by_a * d
        m.change[i] = d
        size = abs(d) / m.unit[i]
        if not size <= largest:
            largest = size
    for j in range(len(m.mu)):
        m.mu[j] += m.left[n + j]
    return largest


@inlined
def newton(full: bool, equations: Equations, values: Array, b: Array) -> bool:
    """Find q_{n+1} and μ_{n+1}: with a new matrix each time if `full`, else with an old one while it contracts."""
    s, m = equations.scheme, equations.motion
    before, renew = np.inf, full or m.counts[USABLE] == 0
    for iteration in range(ITERATIONS):
        residual(equations, values, b)
        if not bounded(m.right):
            return False
        if renew:
            assemble(equations, values, m.new_q)
            m.counts[FACTORIZATIONS] += 1
            m.counts[USABLE] = int(s.dense or factor(equations.factors, equations.saddle.data))
            if m.counts[USABLE] == 0:
                return False
        solve(equations)
        size = correct(s, m)
        m.counts[CORRECTIONS] += 1
        if size <= s.tolerance or (renew and 0.5 * before < size <= STALLED):
            m.counts[USABLE] *= int(iteration + 1 < MANY)  # the next step begins with a new matrix
            return True
        renew = full or size > SLOW * before
        before = size
    return False


@inlined
def accept(s: Scheme, m: Motion) -> None:
    """Make the new state the present one."""
    for i in range(len(m.q)):
        mean = (1.0 - s.alpha_f) * m.new_a[i] + s.alpha_f * m.a[i]
        m.auxiliary[i] = (mean - s.alpha_m * m.auxiliary[i]) / (1.0 - s.alpha_m)
        m.q[i], m.v[i], m.a[i] = m.new_q[i], m.new_v[i], m.new_a[i]


@kernel
def implicit_steps(equations: Equations, first: int, tables: Tables, history: History) -> int:
    """Steps from the number `first` on, one a row of the tables; step 0 only stores the start.

    Returns how many were done: fewer if Newton's iteration does not converge.
    """
    s, m = equations.scheme, equations.motion
    for k in range(len(tables.b)):
        if first + k > 0:
            done = False
            for attempt in range(2):
                if not done and (attempt == 0 or not s.dense):
                    predict(s, m)
                    done = newton(attempt == 1 or s.dense, equations, tables.loads[k], tables.b[k])
            if not done:
                return k
            accept(s, m)
        damping_forces(equations.elements, m.q, m.v, m.damping)
        store(m, history, k, s.scale)
    return len(tables.b)
