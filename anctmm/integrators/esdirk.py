"""Implicit ANC-TMM of fourth order: ESDIRK4(3)6L[2]SA of Kennedy & Carpenter (2003).

With w_j the accelerations of the stages, M w_j = f(Q_j, V_j, t + c_j h) − Jᵀλ_j, and Ā = A²,

    Q_i = q_n + c_i h v_n + h² Σ_j≤i ā_ij w_j,    V_i = v_n + h Σ_j≤i a_ij w_j,    q_{n+1} = Q_6,  v_{n+1} = V_6.

The first stage is the last one of the step before; in all others Newton's matrix is M/(γh)² + K. Rows that change are
kept in the stages as accelerations, J w = γ, which makes w a smooth function of q, v and t and loses no order; what
truncation leaves of g and ġ is taken off at the end of a step by the nearest positions and velocities in the metric of
Newton's matrix (Eich 1993, SIAM J. Numer. Anal. 30). Where that fails, as beside a singular position, the stages of the
step keep positions, which brings less order. Constant linear rows are kept as positions.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.methods import stages
from anctmm.integrators.accelerations import KEPT, VIOLATED, take_off
from anctmm.integrators.newton import Coefficients, iterate, set_end
from anctmm.integrators.output import Output, keep_due, stage_power
from anctmm.integrators.starting import balance
from anctmm.integrators.state import State
from anctmm.kernels.by_address import by_address
from anctmm.kernels.options import NONE, inlined, kernel, part
from anctmm.system.calls import set_jacobian, set_rates, set_rows
from anctmm.system.forces import place_driven
from anctmm.system.system import System
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]

#: Projections at the end of a step at most.
PROJECTIONS = 6


@by_address
class Room(NamedTuple):
    """What a step keeps beside the state.

    Parameters
    ----------
    q, v : ndarray, shape (rows, nodes)
        At its start.
    w : ndarray, shape (stages, rows, nodes)
    power : ndarray, shape (stages, 2)
        Of all that does work beside energies, and of damping, W.
    """

    q: Array
    v: Array
    w: Array
    power: Array


@by_address
class Stages(NamedTuple):
    """Runge-Kutta coefficients: matrix A, its square, and nodes c; the last row of A is the weights."""

    A: Array
    square: Array
    c: Array


class Scheme(NamedTuple):
    """Step h (s), the coefficients, the derivative of rows that stages keep, and their room."""

    h: float
    method: Stages
    level: int
    room: Room


class Numbers(NamedTuple):
    """Last step, steps between outputs, and the scheme."""

    steps: int
    stride: int
    scheme: Scheme


def scheme_of(system: System, h: float) -> Scheme:
    """The scheme of a scene for steps of h, s."""
    method, shape = Stages(*stages()), (system.mesh.rows, system.mesh.nodes)
    count = len(method.c)
    room = Room(np.zeros(shape), np.zeros(shape), np.zeros((count, *shape)), np.zeros((count, 2)))
    return Scheme(h, method, 2 if system.changing else 0, room)


def stage_times(system: System, begin: int, end: int) -> Array:
    """Times of the stages, behind the first, of the steps to states begin … end − 1; of state 0 its own time."""
    c, run = stages().c[1:], system.run
    steps = np.arange(max(begin, 1), end)
    before = run.times(steps - 1)[:, None]
    inner = np.hstack([before + run.exact_dt * c[:-1], run.times(steps)[:, None]]).ravel()
    return np.concatenate([[0.0], inner]) if begin == 0 < end else inner


@inlined
def begin_stage(i, h, method, room, state):  # type: ignore[no-untyped-def]
    """Known parts of q and v in stage i; w is predicted as that of the stage before."""
    A, square, c, q, v, stages = method.A, method.square, method.c, room.q, room.v, room.w
    base, rates, w = state.base, state.rate, state.w
    for k in range(q.shape[0]):
        for n in range(q.shape[1]):
            rate, way = 0.0, h * c[i] * v[k, n]
            for j in range(i):
                rate += h * A[i, j] * stages[j, k, n]
                way += h * h * square[i, j] * stages[j, k, n]
            base[k, n], rates[k, n] = q[k, n] + way, v[k, n] + rate
            w[k, n] = stages[i - 1, k, n]


@part
def take_stages(
    size: tuple[int, ...],
    space: tuple[int, ...],
    scheme: Scheme,
    tables: Tables,
    state: State,
    inputs: Inputs,
    first: int,
) -> bool:
    """Find the stages of a step, whose inputs stand from `first` on; False if Newton's iteration fails in one."""
    h, method, room = scheme.h, scheme.method, scheme.room
    gamma = method.A[1, 1] * h
    c = Coefficients(h, 1.0 / (gamma * gamma), gamma, scheme.level)
    for i in range(1, len(method.c)):
        n, solved = first + i - 1, False
        for attempt in range(state.limits[1]):
            if not solved:
                begin_stage(i, h, method, room, state)
                set_end(state, c)
                place_driven(tables.driven, inputs.signals[n], state.q, state.v, state.w)
                solved = iterate(size, space, tables, state, c, attempt == 1, inputs, n)
        if not solved:
            return False
        for k in range(state.q.shape[0]):
            for m in range(state.q.shape[1]):
                room.w[i, k, m] = state.w[k, m]
        stage_power(space, tables, state, inputs, n, room.power[i])
    return True


@part
def project_end(
    size: tuple[int, ...], space: tuple[int, ...], tables: Tables, state: State, signals: Array
) -> bool:
    """Take g and ġ off by the factored matrix of Newton's iteration; False if g stays."""
    bound, off = KEPT * state.scale[0], 0.0
    for _ in range(PROJECTIONS):
        off = set_rows(tables, state.q, signals)
        if not off > bound:
            break
        take_off(size, space, tables, state, state.q)
    set_jacobian(tables, state.q, signals)
    for _ in range(2):
        set_rates(tables, state.q, state.v, signals)
        take_off(size, space, tables, state, state.v)
    return off <= VIOLATED * state.scale[0]


@part
def step_esdirk(
    size: tuple[int, ...],
    space: tuple[int, ...],
    scheme: Scheme,
    tables: Tables,
    state: State,
    inputs: Inputs,
    first: int,
) -> bool:
    """One step; False, with the state as before, if it fails."""
    room, last = scheme.room, len(scheme.method.c) - 1
    for k in range(state.q.shape[0]):
        for i in range(state.q.shape[1]):
            room.q[k, i], room.v[k, i], room.w[0, k, i] = state.q[k, i], state.v[k, i], state.w[k, i]
    room.power[0, 0], room.power[0, 1] = room.power[last, 0], room.power[last, 1]
    n = first + last - 1
    solved = take_stages(size, space, scheme, tables, state, inputs, first)
    if solved and scheme.level == 2:
        solved = project_end(size, space, tables, state, inputs.signals[n])
    if not solved and scheme.level == 2:
        state.counts[2] = 1
        positions = Scheme(scheme.h, scheme.method, NONE, room)  # type: ignore[arg-type]
        solved = take_stages(size, space, positions, tables, state, inputs, first)
        if solved:
            balance(size, space, tables, state, inputs, n)
            stage_power(space, tables, state, inputs, n, room.power[last])
    if not solved:
        for k in range(state.q.shape[0]):
            for i in range(state.q.shape[1]):
                state.q[k, i], state.v[k, i], state.w[k, i] = room.q[k, i], room.v[k, i], room.w[0, k, i]
    return solved


@inlined
def add_work(out, scheme):  # type: ignore[no-untyped-def]
    """Count the work of a step by the method's quadrature."""
    A, power, last = scheme.method.A, scheme.room.power, len(scheme.method.c) - 1
    for j in range(last + 1):
        out.work[0] += scheme.h * A[last, j] * power[j, 0]
        out.work[1] += scheme.h * A[last, j] * power[j, 1]


@kernel
def advance(
    size: tuple[int, ...],
    space: tuple[int, ...],
    first: int,
    numbers: Numbers,
    tables: Tables,
    state: State,
    inputs: Inputs,
    out: Output,
) -> int:
    """States from `first` on, whose stages have the times of the inputs; the one that failed, or −1."""
    scheme, step, n = numbers.scheme, first, NONE
    width = len(scheme.method.c) - 1
    while n < len(inputs.t):
        if step == 0:
            stage_power(space, tables, state, inputs, NONE, scheme.room.power[width])
            n += 1
        else:
            if not step_esdirk(size, space, scheme, tables, state, inputs, n):
                return step
            n += width
            add_work(out, scheme)
        if not keep_due(step, numbers.steps, numbers.stride, space, tables, state, out):
            return step
        step += 1
    return -1
