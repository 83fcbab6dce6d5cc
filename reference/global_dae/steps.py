"""Compiled steps of the rival: Zhai's explicit ones, and generalized-α in index-3 form by a modified Newton iteration.

Formulas as in `reference.global_dae.explicit` and `reference.global_dae.implicit`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.global_dae.elements import Elements, add_tangents, damping_forces, forces
from reference.global_dae.kernels import inlined, kernel
from reference.global_dae.lu import Factors, Index, Pattern, refactor, solve_factored

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Newton iterations of a step at most; ratio of corrections above which the matrix is renewed; corrections of a
#: step from which on it is renewed before the next.
ITERATIONS, SLOW, MANY = 30, 0.3, 5
#: Roundings of the largest terms that a residual may have; values above HUGE have left all bounds.
ROUNDINGS, EPSILON, HUGE = 8.0, float(np.finfo(np.float64).eps), 1e60
#: How Newton's iteration ended.
CONVERGED, FAILED, SINGULAR = 0, 1, 2


class Scheme(NamedTuple):
    """Step h (s) and coefficients of both methods; by_a, by_v: ∂q̈/∂q, ∂v/∂q; tolerance of corrections.

    project: whether explicit steps are put back on the constraints. dense: whether matrices are solved by LAPACK.
    """

    h: float
    psi: float
    phi: float
    project: bool
    dense: bool
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    by_a: float
    by_v: float
    tolerance: float


class Rows(NamedTuple):
    """J q = b(t): J by rows (first, column, factor); b = base + cos p along + sin p across + p shift, p of `drive`.

    gram: factors of J Jᵀ. gap, change, permuted: scratch, (m,). scale: of rows and multipliers in linear systems.
    """

    first: Index
    column: Index
    factor: Array
    drive: Ints
    base: Array
    along: Array
    across: Array
    shift: Array
    gram: Factors
    gap: Array
    change: Array
    permuted: Array
    scale: float


class Loads(NamedTuple):
    """Loads on sums of vectors: load k on those with the x components at[first[k]], … times `weight`."""

    torque: NDArray[np.bool_]
    first: Ints
    at: Ints
    weight: Array


class NewtonMatrix(NamedTuple):
    """[c M + K, sJᵀ; sJ, 0] by columns: constant numbers of M and J, places of the entries of tangents, numbers."""

    column: Index
    row: Index
    mass: Array
    joints: Array
    elements: Ints
    moments: Ints
    data: Array


class Motion(NamedTuple):
    """State, and scratch.

    q, v, a, auxiliary, (n,), mu/s, (m,); new_q, new_v, new_a; right, left, scratch, zeros, (n + m,); force; damping,
    resisting: damping forces of the step before and now; b, rate, acceleration, (m,). trail: force and place of all
    that does work at the step before. work: all, and that of damping, (2,). places, last, angles: of vectors whose
    turns are counted. counts: corrections, factorizations, worst coordinate, whether factors can be used, step
    reached, outputs. unit: sizes of coordinates. residuals: of the last step.
    """

    q: Array
    v: Array
    a: Array
    auxiliary: Array
    mu: Array
    new_q: Array
    new_v: Array
    new_a: Array
    right: Array
    left: Array
    scratch: Array
    zeros: Array
    force: Array
    damping: Array
    resisting: Array
    b: Array
    rate: Array
    acceleration: Array
    trail: Array
    work: Array
    places: Ints
    last: Array
    angles: Array
    counts: Ints
    unit: Array
    residuals: Array


class Equations(NamedTuple):
    """What the steps of a scene take; `constant`: columns, rows and numbers of the matrix of explicit steps."""

    scheme: Scheme
    elements: Elements
    rows: Rows
    loads: Loads
    dead: Array
    factors: Factors
    constant: tuple[Index, Index, Array]
    matrix: NewtonMatrix
    pattern: Pattern
    motion: Motion


class Tables(NamedTuple):
    """Loads (steps, loads, 2) and drives (steps + 1, drives, 5): cos p, sin p, p, p', p''."""

    loads: Array
    drives: Array


class Outputs(NamedTuple):
    """Steps wanted, ascending, then −1; room for q, v, a, (outputs, 3, n), work, (outputs, 2), and angles."""

    wanted: Ints
    states: Array
    work: Array
    angles: Array

    def after(self, count: int) -> "Outputs":
        """Those behind the first ones."""
        return Outputs(*(part[count:] for part in self))  # type: ignore[arg-type]


# --- constraints, loads, outputs ------------------------------------------------------------------------------


@inlined
def prescribe(rows: Rows, drives: Array, b: Array, rate: Array, acceleration: Array) -> None:
    """B and its derivatives at the values of the drives, (drives, 5)."""
    for j in range(len(b)):
        b[j], rate[j], acceleration[j] = rows.base[j], 0.0, 0.0
        d = rows.drive[j]
        if d >= 0:
            cos, sin, p, w, e = drives[d, 0], drives[d, 1], drives[d, 2], drives[d, 3], drives[d, 4]
            turned = cos * rows.along[j] + sin * rows.across[j]
            slope = cos * rows.across[j] - sin * rows.along[j] + rows.shift[j]
            b[j] += turned + p * rows.shift[j]
            rate[j] = w * slope
            acceleration[j] = e * slope - w * w * turned


@inlined
def product(rows: Rows, j: int, q: Array) -> float:
    """(J q)_j."""
    total = 0.0
    for t in range(rows.first[j], rows.first[j + 1]):
        total += rows.factor[t] * q[rows.column[t]]
    return total


@inlined
def project(rows: Rows, q: Array, b: Array) -> None:
    """q ← q − Jᵀ (J Jᵀ)⁻¹ (J q − b)."""
    for j in range(len(b)):
        rows.gap[j] = product(rows, j, q) - b[j]
    solve_factored(rows.gram, rows.gap, rows.change, rows.permuted)
    for j in range(len(b)):
        for t in range(rows.first[j], rows.first[j + 1]):
            q[rows.column[t]] -= rows.factor[t] * rows.change[j]


@inlined
def place_of(loads: Loads, k: int, q: Array) -> tuple[float, float]:
    """The vector that load k acts on."""
    x, y = 0.0, 0.0
    for t in range(loads.first[k], loads.first[k + 1]):
        x += loads.weight[t] * q[loads.at[t]]
        y += loads.weight[t] * q[loads.at[t] + 1]
    return x, y


@inlined
def add_loads(loads: Loads, values: Array, q: Array, f: Array) -> None:
    """Add all loads, of their values (loads, 2), to f; of a moment M on g the force is M (−g_y, g_x)/|g|²."""
    for k in range(len(loads.torque)):
        u, v = values[k, 0], values[k, 1]
        if loads.torque[k]:
            x, y = place_of(loads, k, q)
            m = u / (x * x + y * y)
            u, v = -m * y, m * x
        for t in range(loads.first[k], loads.first[k + 1]):
            f[loads.at[t]] += loads.weight[t] * u
            f[loads.at[t] + 1] += loads.weight[t] * v


@inlined
def account(
    rows: Rows, loads: Loads, values: Array, drives: Array, q: Array, mu: Array, first: bool, m: Motion
) -> None:
    """Add the work of loads and drives since the last call, by the trapezoidal rule; mu: multipliers over their scale.

    Of a force ½ (F_n + F_{n+1}) · Δr, of a moment its mean times the change of the angle, of a drive −μᵀ ∂b/∂p.
    """
    trail, count = m.trail, len(loads.torque)
    for k in range(count):
        u, v = values[k, 0], values[k, 1]
        x, y = place_of(loads, k, q)
        a, b = trail[k, 2], trail[k, 3]
        if not first and loads.torque[k]:
            m.work[0] += 0.5 * (u + trail[k, 0]) * np.arctan2(a * y - b * x, a * x + b * y)
        elif not first:
            m.work[0] += 0.5 * ((u + trail[k, 0]) * (x - a) + (v + trail[k, 1]) * (y - b))
        trail[k, 0], trail[k, 1], trail[k, 2], trail[k, 3] = u, v, x, y
    for d in range(drives.shape[0]):
        total = 0.0
        for j in range(len(rows.drive)):
            if rows.drive[j] == d:
                slope = drives[d, 0] * rows.across[j] - drives[d, 1] * rows.along[j] + rows.shift[j]
                total -= rows.scale * mu[j] * slope
        k = count + d
        if not first:
            m.work[0] += 0.5 * (total + trail[k, 0]) * (drives[d, 2] - trail[k, 2])
        trail[k, 0], trail[k, 2] = total, drives[d, 2]


@inlined
def keep(m: Motion, q: Array, v: Array, a: Array, n: int, out: Outputs, count: int) -> int:
    """Add up the turns of a step and store it where it is wanted; number of outputs so far."""
    for k in range(len(m.angles)):
        x, y = m.last[k, 0], m.last[k, 1]
        u, w = q[m.places[k, 0]], q[m.places[k, 1]]
        m.angles[k] += np.arctan2(x * w - y * u, x * u + y * w)
        m.last[k, 0], m.last[k, 1] = u, w
    if n != out.wanted[count]:
        return count
    for i in range(len(q)):
        out.states[count, 0, i], out.states[count, 1, i], out.states[count, 2, i] = q[i], v[i], a[i]
    out.work[count, 0], out.work[count, 1] = m.work[0], m.work[1]
    for k in range(len(m.angles)):
        out.angles[count, k] = m.angles[k]
    return count + 1


@kernel
def solve(f: Factors, column: Index, row: Index, data: Array, m: Motion, dense: Array | None) -> None:
    """From `right` into `left`: by factors, or by LAPACK, `dense` made of columns, rows and numbers."""
    if dense is None:
        solve_factored(f, m.right, m.left, m.scratch)
    else:
        dense[:] = 0.0
        for j in range(len(column) - 1):
            for t in range(column[j], column[j + 1]):
                dense[row[t], j] = data[t]
        m.left[:] = np.linalg.solve(dense, m.right)


@inlined
def bounded(x: Array) -> bool:
    """Whether all numbers are finite, and none has left all bounds."""
    good = True
    for i in range(len(x)):
        good &= abs(x[i]) < HUGE
    return good


# --- explicit steps -------------------------------------------------------------------------------------------


@kernel
def explicit_steps(
    equations: Equations, tables: Tables, out: Outputs, span: tuple[int, int, int], dense: Array | None
) -> tuple[int, int]:
    """Steps span[0] … span[1] − 1: acceleration, output, and advance unless it is the last, span[2].

    Returns
    -------
    int, int
        Step reached, below span[1] if the acceleration there is not finite; outputs stored.
    """
    s, e, rows, loads, dead, factors, constant, _, _, m = equations
    n, count, h = len(m.q), 0, s.h
    for step in range(span[0], span[1]):
        at = step - span[0]
        if step == 0:
            prescribe(rows, tables.drives[0], m.b, m.rate, m.acceleration)
        forces(e, m.q, m.force)
        damping_forces(e, m.q, m.v, m.resisting)
        power = 0.0
        for i in range(n):
            m.force[i] = dead[i] - m.force[i] + m.resisting[i]
            power += m.resisting[i] * m.v[i]
        if step > 0:
            lost = 0.5 * h * (power + m.damping[0])
            m.work[0] += lost
            m.work[1] += lost
        m.damping[0] = power
        add_loads(loads, tables.loads[at], m.q, m.force)
        m.right[:n] = m.force
        for j in range(len(m.b)):
            m.right[n + j] = rows.scale * m.acceleration[j]
        if not bounded(m.right):
            return step, count
        solve(factors, constant[0], constant[1], constant[2], m, dense)
        if not bounded(m.left):
            return step, count
        if s.dense:
            m.counts[1] += 1
        m.a[:] = m.left[:n]
        if step == 0:
            m.auxiliary[:] = m.a
        account(rows, loads, tables.loads[at], tables.drives[at], m.q, m.left[n:], step == 0, m)
        count = keep(m, m.q, m.v, m.a, step, out, count)
        if step == span[2]:
            break
        for i in range(n):
            a, b = m.a[i], m.auxiliary[i]
            m.q[i] += h * m.v[i] + h * h * ((0.5 + s.psi) * a - s.psi * b)
            m.v[i] += h * ((1.0 + s.phi) * a - s.phi * b)
            m.auxiliary[i] = a
        prescribe(rows, tables.drives[at + 1], m.b, m.rate, m.acceleration)
        if s.project:
            project(rows, m.q, m.b)
            project(rows, m.v, m.rate)
    return span[1], count


# --- implicit steps -------------------------------------------------------------------------------------------


@kernel
def assemble(matrix: NewtonMatrix, by_a: float, e: Elements, loads: Loads, values: Array, q: Array) -> None:
    """See `assemble_into`."""
    assemble_into(matrix, by_a, e, loads, values, q)


@inlined
def assemble_into(
    matrix: NewtonMatrix, by_a: float, e: Elements, loads: Loads, values: Array, q: Array
) -> None:
    """Numbers of [by_a M + K(q), sJᵀ; sJ, 0], K with the tangent of the moments."""
    data = matrix.data
    for i in range(len(data)):
        data[i] = by_a * matrix.mass[i] + matrix.joints[i]
    add_tangents(e, q, matrix.elements, data)
    at = 0
    for k in range(len(loads.torque)):
        if loads.torque[k]:
            x, y = place_of(loads, k, q)
            s = x * x + y * y
            m = values[k, 0] / (s * s)  # −M times the second derivatives of atan2(y, x)
            data[matrix.moments[at]] -= 2.0 * m * x * y
            data[matrix.moments[at + 1]] -= m * (y * y - x * x)
            data[matrix.moments[at + 2]] -= m * (y * y - x * x)
            data[matrix.moments[at + 3]] += 2.0 * m * x * y
            at += 4


@inlined
def residual(equations: Equations, values: Array, m: Motion) -> float:
    """[f − M q̈ − Jᵀμ; s (b − J q)] into `right`; its largest component, infinite if one is out of bounds."""
    _, e, rows, loads, dead, _, _, matrix, _, _ = equations
    n, right = len(m.q), m.right
    forces(e, m.new_q, m.force)
    damping_forces(e, m.new_q, m.new_v, m.resisting)
    for i in range(n):
        right[i] = dead[i] - m.force[i] + m.resisting[i]
    add_loads(loads, values, m.new_q, right)
    for j in range(n):  # constant numbers of the matrix: M of its coordinates
        a = m.new_a[j]
        for t in range(matrix.column[j], matrix.column[j + 1]):
            if matrix.row[t] < n:
                right[matrix.row[t]] -= matrix.mass[t] * a
    for j in range(len(m.b)):
        right[n + j] = rows.scale * (m.b[j] - product(rows, j, m.new_q))
        for t in range(rows.first[j], rows.first[j + 1]):
            right[rows.column[t]] -= rows.factor[t] * rows.scale * m.mu[j]
    if not bounded(right):
        return np.inf
    largest = 0.0
    for i in range(len(right)):
        largest = max(largest, abs(right[i]))
    return largest


@inlined
def at_rounding(matrix: NewtonMatrix, m: Motion, dead: Array) -> bool:
    """Whether the residual is as small as rounding of its terms, |A| |q| and the forces, lets it be."""
    n = len(m.q)
    m.left[:] = 0.0
    for i in range(n):
        m.left[i] = abs(m.force[i]) + abs(dead[i])
    for j in range(len(matrix.column) - 1):
        value = abs(m.new_q[j]) if j < n else abs(m.mu[j - n])
        for t in range(matrix.column[j], matrix.column[j + 1]):
            m.left[matrix.row[t]] += abs(matrix.data[t]) * value
    terms, found = 0.0, 0.0
    for i in range(n):
        terms, found = max(terms, m.left[i]), max(found, abs(m.right[i]))
    return found <= ROUNDINGS * EPSILON * terms


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
        size = abs(d) / m.unit[i]
        if not size <= largest:
            largest, m.counts[2] = size, i
    for j in range(len(m.mu)):
        m.mu[j] += m.left[n + j]
    return largest


@inlined
def newton(full: bool, equations: Equations, values: Array, dense: Array | None) -> int:
    """Find q_{n+1} and μ_{n+1}: with a new matrix each time if `full`, else with an old one while it contracts."""
    s, e, _, loads, dead, factors, _, matrix, pattern, m = equations
    before, renew = np.inf, full or m.counts[3] == 0
    m.residuals[:] = 0.0
    for iteration in range(ITERATIONS):
        m.residuals[iteration] = residual(equations, values, m)
        if m.residuals[iteration] == np.inf:
            return FAILED
        fresh = renew
        if renew:
            assemble_into(matrix, s.by_a, e, loads, values, m.new_q)
            m.counts[1] += 1
            m.counts[3] = 0
            if not s.dense and not refactor(pattern, matrix.data, factors, m.zeros):
                return SINGULAR
            m.counts[3] = 1
        solve(factors, matrix.column, matrix.row, matrix.data, m, dense)
        size = correct(s, m)
        m.counts[0] += 1
        if size <= s.tolerance:
            if iteration + 1 >= MANY:
                m.counts[3] = 0
            return CONVERGED
        if fresh and size > 0.5 * before and at_rounding(matrix, m, dead):
            return CONVERGED
        renew = full or size > SLOW * before
        before = size
    return FAILED


@kernel
def implicit_steps(
    equations: Equations, tables: Tables, out: Outputs, span: tuple[int, int], dense: Array | None
) -> int:
    """Steps span[0] … span[1] − 1, step n leading to t_n; step 0 only keeps the start.

    Returns
    -------
    int
        CONVERGED, or how Newton's iteration ended; step reached and outputs are in `m.counts`.
    """
    s, e, rows, loads, _, _, _, _, _, m = equations
    count = 0
    for step in range(span[0], span[1]):
        at = step - span[0]
        m.counts[4], m.counts[5] = step, count
        if step > 0:
            prescribe(rows, tables.drives[at], m.b, m.rate, m.acceleration)
            code = FAILED
            for attempt in range(2):
                if code == FAILED and (attempt == 0 or not s.dense):
                    predict(s, m)
                    code = newton(attempt == 1 or s.dense, equations, tables.loads[at], dense)
            if code != CONVERGED:
                return code
            accept(s, e, m)
        account(rows, loads, tables.loads[at], tables.drives[at], m.q, m.mu, step == 0, m)
        count = keep(m, m.q, m.v, m.a, step, out, count)
    m.counts[4], m.counts[5] = span[1], count
    return CONVERGED


@inlined
def accept(s: Scheme, e: Elements, m: Motion) -> None:
    """Make the new state the present one, with the work of damping over the step."""
    damping_forces(e, m.new_q, m.new_v, m.resisting)
    for i in range(len(m.q)):
        lost = 0.5 * (m.resisting[i] + m.damping[i]) * (m.new_q[i] - m.q[i])
        m.work[0] += lost
        m.work[1] += lost
        m.damping[i] = m.resisting[i]
        mean = (1.0 - s.alpha_f) * m.new_a[i] + s.alpha_f * m.a[i]
        m.auxiliary[i] = (mean - s.alpha_m * m.auxiliary[i]) / (1.0 - s.alpha_m)
        m.q[i], m.v[i], m.a[i] = m.new_q[i], m.new_v[i], m.new_a[i]
