"""Implicit ANC-TMM of fourth order: a Runge-Kutta method whose stages are solved by the Riccati recursion.

ESDIRK4(3)6L[2]SA of Kennedy & Carpenter (2003), `anctmm.discretise.methods.Esdirk`. With w_j the accelerations of the
stages, M w_j = F(Q_j, V_j, t + c_j h), and Ā = A²,

    Q_i = q_n + c_i h v_n + h² Σ_j≤i ā_ij w_j,    V_i = v_n + h Σ_j≤i a_ij w_j,    q_{n+1} = Q_6,  v_{n+1} = V_6.

The first stage is the last one of the step before. In each of the others the known terms stand for q and v at the start
of a step of γh by the implicit Euler method, γ = a_ii = 1/4: Newton's matrix is M/(γh)² + K_T, the same for all stages,
and a stage is what `generalized_alpha` calls a step. Coordinates of driven clamps, their velocities and accelerations
are those of the drives at each stage: the method solves the differential equations of the others, and no order is
lost. Nor is any where constraints with multipliers are nonlinear or driven, see `stage_constraints`: 480 steps bring
the angles of Andrews' squeezer to 1.8e-7 of their published values at its end, generalized-α to 1.6e-2.

Why this method, by numbers (global equations, dense, of the base scenes with 4 cables and 1, 4, 1 cables; errors of
positions relative to the largest displacement, evaluations of the forces for a run of 0.6 s and 0.4 s):

    four-bar        h = 6 ms          1.5 ms            0.75 ms           fall  h = 2 ms         1 ms
    ESDIRK4         1.5e-7   3187     1.8e-9   6991     1.3e-10  11191    3.0e-4   6641    2.3e-5   9507
    Suzuki          1.5e-7   3147     1.9e-9   6967     1.6e-10  11195    2.9e-4   6598    2.3e-5   9438
    trapezoidal     2.4e-5    923     1.5e-6   1863     4.0e-7    2809    4.9e-3   1946    2.2e-3   2618

Suzuki's composition of five trapezoidal steps, one of them backwards in time, has the same error at the same cost: the
terms of fifth order in the phase of a vibration are 8.5e-4 and 9.3e-4 (ωh)⁵. But it needs two matrices, does not bear
damping (a backward step makes it energy), and does not damp what the step does not resolve. Two-stage Gauss, 1.4e-3
(ωh)⁵, has a pair of complex matrices or an iteration that converges linearly; a stage there is not a solve of the
recursion. A composition of nine stages, of sixth order, is no better than these where axial vibrations are stiff. The
method is not reversible in time; what it dissipates of a resolved vibration is of the order (ωh)⁶ a step.

The work of drives, loads, dampers and laws is the integral of their power by the weights of the method, so that the
balance of energy has its order, too.
"""

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.kept_chains import once, own
from anctmm.discretise.methods import Coefficients, Stages, stages
from anctmm.forces.actuation import actuation_of, clamp_reactions, power_of, turn_clamps
from anctmm.forces.driving import drive_table, drive_width
from anctmm.integrators.implicit.newton import iterate
from anctmm.integrators.implicit.run import Steps, take_steps
from anctmm.integrators.implicit.step import copy, predict
from anctmm.integrators.implicit.system import System, new_system
from anctmm.integrators.output import Output, add_work, keep, too_large
from anctmm.integrators.stage_constraints import end_step, look_ahead, of_stages, projected
from anctmm.integrators.turn_count import count_turns
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined, kernel, shared
from anctmm.jit.copies import writes
from anctmm.model.drives import table_of, tabulate
from anctmm.recursion.constrained import power_of_drives, set_drives
from anctmm.recursion.lines import hold_on_lines
from anctmm.results.checks.divergence import STRETCH_LIMIT
from anctmm.results.solution import Solution

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
#: Change of a gradient by the accelerations at the start, above which they are no guess of those of the first step.
ASTRAY = 0.01


@by_address
class Numbers(NamedTuple):
    """Last step, steps between outputs, step (s), the method, and coefficients of the implicit solves of its stages."""

    steps: int
    stride: int
    h: float
    stages: Stages
    coefficients: Coefficients


@writes("q", "v", "w", "power", "at", "projected")
@by_address
class Room(NamedTuple):
    """What a step keeps: q and v at its start, flat, and of each stage w, flat, and the power, W, of what does work
    and of damping alone, (stages, 2).

    at: number of the last stage tried, (1,). projected: see `stage_constraints`.
    """

    q: Array
    v: Array
    w: Array
    power: Array
    at: Ints
    projected: Array | None


def new_room(chain: Chain) -> Room:
    """Room for the stages of a scene."""
    size, count = chain.bodies.rows * chain.bodies.nodes, len(stages().c)
    return Room(
        np.zeros(size),
        np.zeros(size),
        np.zeros((count, size)),
        np.zeros((count, 2)),
        np.zeros(1, np.int64),
        projected(chain),
    )


def integrate(chain: Chain) -> Solution:
    """Run a scene with the method of fourth order.

    Returns
    -------
    Solution
        With a status that names step, time and element if Newton's iteration failed.
    """
    run, actuation, method = chain.run, once(chain, actuation_of), stages()

    def arguments(begin: int, end: int, c: Coefficients, system: System, out: Output) -> tuple[Any, ...]:
        t = stage_times(chain, begin, end)
        find = table_of if begin < 0 else tabulate
        tables = drive_table(chain, actuation, t, find), actuation.load_table(t)
        return begin, end, Numbers(run.steps, run.stride, run.exact_dt, method, c), room, system, out, *tables

    def failed_at(step: int) -> float:
        before = float(run.times(np.array([step - 1]))[0])
        return before + float(method.c[room.at[0]]) * run.exact_dt

    width = (len(method.c) - 1) * drive_width(chain, actuation)
    with own(chain, new_room) as room, own(chain, new_system) as system:
        steps = Steps(advance, arguments, width, failed_at, look=partial(look_ahead, chain, system))
        return take_steps(chain, system, steps)


def stage_times(chain: Chain, begin: int, end: int) -> Array:
    """Times of the stages behind the first one of steps begin … end − 1, s; of step −1 that of the start."""
    if begin < 0:
        return np.zeros(1)
    run, c = chain.run, stages().c[1:-1]
    steps = np.arange(begin, min(end, run.steps))
    inner = run.times(steps)[:, None] + run.exact_dt * c
    return np.hstack([inner, run.times(steps + 1)[:, None]]).ravel()


@kernel
def advance(
    begin: int,
    end: int,
    numbers: Numbers,
    room: Room,
    system: System,
    out: Output,
    clamp_table: Array,
    load_table: Array,
) -> int:
    """From step `begin` to step `end`; the step in which Newton's iteration failed, or −1.

    The two tables hold the values of drives and of loads at the times of `stage_times`, row after row.
    Step −1 finds the accelerations at t = 0.
    """
    steps, stride, h, table, _ = numbers
    state, tables, _, factors, clamps, loads, newton, _ = system
    q, v, w = state.q, state.v, state.w
    flat_q, flat_v, _, _, _, _ = state.flat
    count, row = len(table.c), 0
    for step in range(begin, end):
        if step < 0:
            move_drives(factors, clamps, clamp_table[0])
            _balance(room, system, load_table[0])
            break
        count_turns(q, out.turns)
        if step % stride == 0 or step == steps:
            if too_large(q, STRETCH_LIMIT):
                newton.history[:] = 0.0  # no iteration failed
                return step
            keep(step, stride, q, v, w, tables, loads.connectors, out)
        if step == steps:
            break
        copy(flat_q, room.q)
        copy(flat_v, room.v)
        copy(room.w[count - 1], room.w[0])
        pass_power(room.power)
        solved = _find_stages(False, step == 0, numbers, row, room, system, clamp_table, load_table)
        again = not solved and room.projected is not None
        if again:
            copy(room.q, flat_q)
            copy(room.v, flat_v)
            solved = _find_stages(True, step == 0, numbers, row, room, system, clamp_table, load_table)
        row += count - 1
        if not end_step(solved, room, system, clamp_table[row - 1]):
            return step + 1
        add_work(out, work_of_stages(h, table, room.power))
        if again:  # w of such stages is not that of the end of the step
            _balance(room, system, load_table[row - 1])
    return -1


@shared
def _find_stages(places, first, numbers, row, room, system, clamp_table, load_table):  # type: ignore[no-untyped-def]
    """Find the stages of a step, with all constraints kept as positions if `places`; False if one is not found.

    Near a singular position accelerations do not keep a linkage together: an error in a direction that it is about to
    be free in grows as the inverse square of what holds it there. Positions, which bring less order, do.

    In the first step stages start from where the one before has ended, if the accelerations there lead astray: under
    loads that act at once they move what is stiff by centimetres in a long step, and Newton's iteration found bars
    turned inside out from there.
    """
    h, table = numbers.h, numbers.stages
    c = of_stages(numbers.coefficients, room.projected, places)
    stays = first and _leads_astray(c.h, room.w[0], system.state.q.shape[1])
    state, tables, _, factors, clamps, loads, newton, damping = system
    _, flat_v, _, flat_w, _, _ = state.flat
    for i in range(1, len(table.c)):
        room.at[0] = i
        begin_stage(i, h, c.h, table, room, state.flat)
        if stays:
            _stay(h * (table.c[i] - table.c[i - 1]), c.h, room, state.flat)
        move_drives(factors, clamps, clamp_table[row])
        if not solve_stage(2, system, c, load_table[row], newton.tolerance):
            return False
        for k in range(len(flat_v)):
            flat_v[k] += c.h * flat_w[k]
        copy(flat_w, room.w[i])
        room.power[i, 0], room.power[i, 1] = stage_power(
            state, tables, factors, clamps, loads, load_table[row], damping
        )
        row += 1
    return True


@embedded
def _balance(room, system, values):  # type: ignore[no-untyped-def]
    """Accelerations and power of the present state, with which the next step begins: a step of no length finds them."""
    state, tables, _, factors, clamps, loads, newton, damping = system
    flat_q, _, _, flat_w, was, had = state.flat
    c = Coefficients(0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 2.0)
    last = len(room.w) - 1
    copy(flat_q, was)
    copy(flat_w, had)
    newton.counts[2] = 1
    solve_stage(2, system, c, values, newton.tolerance)
    copy(flat_w, room.w[last])
    room.power[last, 0], room.power[last, 1] = stage_power(
        state, tables, factors, clamps, loads, values, damping
    )
    newton.counts[2] = 1


@embedded
def begin_stage(i, h, part, table, room, flat):  # type: ignore[no-untyped-def]
    """What stands for q and v at the start of the implicit Euler step of stage i, of length `part`; w is predicted."""
    _, v, _, _, was, had = flat
    q_start, v_start, last = room.q, room.v, room.w[i - 1]
    for k in range(len(v)):  # changes first, which are added up without the rounding of what they change
        v[k] = 0.0
        was[k] = h * table.c[i] * v_start[k]
    for j in range(i):
        w, speed, way = room.w[j], h * table.A[i, j], h * h * table.square[i, j]
        for k in range(len(v)):
            v[k] += speed * w[k]
            was[k] += way * w[k]
    for k in range(len(v)):
        v[k] += v_start[k]
        was[k] = q_start[k] + (was[k] - part * v[k])
        had[k] = last[k]


@embedded
def _leads_astray(h, w, nodes):  # type: ignore[no-untyped-def]
    """Whether accelerations w, flat, change a gradient in a stage of length h by more than a motion does."""
    largest = 0.0
    for k in range(2 * nodes, len(w)):
        largest = max(largest, abs(w[k]))
    return h * h * largest > ASTRAY


@embedded
def _stay(h, part, room, flat):  # type: ignore[no-untyped-def]
    """Predict the w by which a stage ends where the one before did, moved on for h by the velocities at the start."""
    q, v, _, _, was, had = flat
    for k in range(len(q)):
        had[k] = (q[k] + h * room.v[k] - was[k] - part * v[k]) / (part * part)


@shared
def move_drives(factors, clamps, drives):  # type: ignore[no-untyped-def]
    """Take the values of all drives."""
    if len(clamps.nodes) > 0:
        turn_clamps(clamps, drives)
    set_drives(factors.loops, drives, len(clamps.nodes))


@inlined
def solve_stage(tries, system, c, values, tolerance):  # type: ignore[no-untyped-def]
    """Find the end of an implicit Euler step: by modified Newton, and in a second try by Newton."""
    q, v, w = system.state.q, system.state.v, system.state.w
    flat_q, flat_v, flat_a, flat_w, was, had = system.state.flat
    solved = False
    for full in range(tries):
        if not solved:
            predict(flat_q, flat_v, flat_a, flat_w, was, had, c)
            _drive(q, v, w, system.clamps, c.h)
            hold_on_lines(system.links.turned, q, w, c)
            solved = correct_stage(full == 1, system, c, values, tolerance)
    return solved


@shared
def correct_stage(full, system, c, values, tolerance):  # type: ignore[no-untyped-def]
    """Newton's iteration of a stage, from where it stands."""
    return iterate(full, system, c, values, tolerance)


@embedded
def _drive(q, v, w, clamps, part):  # type: ignore[no-untyped-def]
    """Give the nodes of driven clamps their motion; v is that before the end of the step, as of all nodes."""
    for n in range(len(clamps.nodes)):
        i = clamps.nodes[n]
        for k in range(clamps.held[n]):
            q[k, i], w[k, i] = clamps.motion[0, n, k], clamps.motion[2, n, k]
            v[k, i] = clamps.motion[1, n, k] - part * w[k, i]


@shared
def stage_power(state, tables, factors, clamps, loads, values, damping):  # type: ignore[no-untyped-def]
    """Power of all that does work beside energies, and of damping alone, W, at the state found."""
    power, lost = power_of_drives(factors.loops, state.q), 0.0
    if len(clamps.nodes) + len(loads.touched) > 0:
        clamp_reactions(state.q, state.w, state.f, tables, clamps)
        acting, lost = power_of(state.q, state.v, clamps, loads, values)
        power += acting
    if damping is not None:
        resisting = 0.0
        for k in range(state.v.shape[0]):
            for i in range(state.v.shape[1]):
                resisting += damping.force[0, k, i] * state.v[k, i]
        power, lost = power + resisting, lost + resisting
    return power, lost


@inlined
def work_of_stages(h, table, power):  # type: ignore[no-untyped-def]
    """Work over a step of h, J, by the method's quadrature: all, and that of damping."""
    last, work, lost = len(table.c) - 1, 0.0, 0.0
    for i in range(last + 1):
        work += h * table.A[last, i] * power[i, 0]
        lost += h * table.A[last, i] * power[i, 1]
    return work, lost


@inlined
def pass_power(power):  # type: ignore[no-untyped-def]
    """The power at the end of a step is that at the start of the next one."""
    power[0, 0], power[0, 1] = power[-1, 0], power[-1, 1]
