"""Implicit ANC-TMM: generalized-α with Newton, its linear solves by the Riccati recursion.

Chung & Hulbert (1993) in the form of Arnold & Brüls (2007): M w_{n+1} = F(q_{n+1}) holds at the end of the step, and

    (1 − αm) a_{n+1} + αm a_n = (1 − αf) w_{n+1} + αf w_n,
    q_{n+1} = q_n + h v_n + h² ((½ − β) a_n + β a_{n+1}),    v_{n+1} = v_n + h ((1 − γ) a_n + γ a_{n+1}).

A Newton correction solves (c_w M + K_T) Δq = F − M w with c_w = (1 − αm)/(βh²(1 − αf)): block tridiagonal, so the same
recursion as for the mass. Damping forces are those of q_{n+1} and v_{n+1}; to the matrix they add τγ/(βh) times the
elastic tangent of their body, which leaves out what stress and velocity add to their exact derivative: Newton needs a
correction or two more, and its limit is the same.

Known coordinates are known as positions; their velocities and accelerations follow from the formulas above, as they do
in an index-3 solution of the equations with multipliers.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.kept_chains import once, own
from anctmm.discretise.methods import NO_STEP, Coefficients
from anctmm.forces.actuation import clamp_reactions, turn_clamps, work_done
from anctmm.forces.driving import drive_table, drive_width
from anctmm.integrators.implicit_start import start
from anctmm.integrators.implicit_step import begin_step, dissipated, finish
from anctmm.integrators.implicit_system import Newton, System, new_system
from anctmm.integrators.locking import locked, rows_in
from anctmm.integrators.newton import parts, solve_step
from anctmm.integrators.newton_failure import stalled
from anctmm.integrators.output import (
    Output,
    Record,
    actuation_of,
    keep,
    run_batches,
    too_large,
)
from anctmm.jit.compiling import kernel
from anctmm.jit.second_process import Parts, side_by_side
from anctmm.recursion.constrained import set_drives, work_of_drives
from anctmm.results.divergence_checks import STRETCH_LIMIT
from anctmm.results.solution import Solution, Status

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Numbers(NamedTuple):
    """Last step, steps between outputs, and coefficients of a step."""

    steps: int
    stride: int
    coefficients: Coefficients


def integrate(chain: Chain) -> Solution:
    """Run a scene with the implicit integrator.

    Returns
    -------
    Solution
        With a status that names step, time and element if Newton's iteration failed.
    """
    run = chain.run
    actuation, record = once(chain, actuation_of), Record(chain)
    system = own(chain, new_system)
    state, newton, clamps = system.state, system.newton, system.clamps
    out, single = record.arrays(), system.factors.L.dtype == np.float32
    of_step = once(chain, coefficients_of)

    def arguments(begin: int, end: int, c: Coefficients, newton: Newton) -> tuple[Any, ...]:
        t = run.times(np.arange(max(begin, 0), min(end, run.steps) + 1))
        tables = drive_table(chain, actuation, t), actuation.load_table(t)
        numbers = Numbers(run.steps, run.stride, c)
        return begin, end, numbers, system._replace(newton=newton), out, *tables

    def one(begin: int, end: int, c: Coefficients = of_step, newton: Newton = newton) -> int:
        return int(advance(*arguments(begin, end, c, newton)))

    def compiles(_: Chain) -> None:
        call = arguments(0, 0, of_step, newton)
        with side_by_side(lambda: _parts(system, of_step, out, call[-1][0])):
            advance(*call)

    once(chain, compiles, what=advance)
    record.start()
    drives = drive_table(chain, actuation, np.zeros(1))[0]
    start(state, clamps, drives, newton, lambda first: one(-1, 0, NO_STEP, first), single)

    def so_far(kept: int, status: Status, steps: int) -> Solution:
        return record.solution(kept, status, steps, int(newton.counts[0]), int(newton.counts[1]))

    failed = run_batches(chain, drive_width(chain, actuation), one, so_far)
    if failed < 0:
        return so_far(len(record.q), Status(), run.steps)
    when = float(run.times(np.array([failed]))[0])
    return so_far(1 + (failed - 1) // run.stride, why_it_ended(chain, system, failed, when), failed)


def why_it_ended(chain: Chain, system: System, failed: int, when: float) -> Status:
    """Status of a run whose step `failed` was not found, at a time in it, s."""
    state = system.state
    status = locked(chain, state.q, rows_in(system.factors.loops), when, failed)
    return status or stalled(chain, failed, state, system.newton, when)


def _parts(system: System, c: Coefficients, out: Output, values: Array) -> Parts:
    """The largest kernels of `advance`, for `side_by_side`: those that it reaches first stand first."""
    state, tables, _, _, clamps, loads, _, _ = system
    aside, here = parts(system, c)
    outside = [
        (clamp_reactions, (state.q, state.w, state.f, tables, clamps)),
        (work_done, (True, state.q, clamps, loads, values)),
        (keep, (0, 1, state.q, state.v, state.w, tables, loads.connectors, out)),
    ]
    return [*outside, *aside], here


def coefficients_of(chain: Chain) -> Coefficients:
    """Coefficients of the implicit solves of a step."""
    return chain.run.coefficients


@kernel
def advance(
    begin: int, end: int, numbers: Numbers, system: System, out: Output, clamp_table: Array, load_table: Array
) -> int:
    """From step `begin` to step `end`; the step whose Newton iteration failed, or −1.

    The two tables hold the values of drives, (steps + 1, drives, 3), and of loads, (steps + 1, loads, 2), from
    `begin` on.
    Step −1 has no length (`NO_STEP`) and ends at t = 0.
    """
    steps, stride, coefficients = numbers
    state, tables, _, factors, clamps, loads, newton, damping = system
    q, v, _, w, _, _, f, _, _, flat = state
    _, flat_v, flat_a, flat_w, _, flat_before = flat
    driven = len(clamps.nodes) + len(loads.touched) > 0
    unfinished, first = False, max(begin, 0)
    for step in range(begin, end):
        if driven and step >= 0:
            values = load_table[step - first]
            clamp_reactions(q, w, f, tables, clamps)
            out.work[0] += work_done(step > 0, q, clamps, loads, values)
        if step >= 0:
            out.work[0] += work_of_drives(factors.loops, step > 0, q)
        if step >= 0 and (step % stride == 0 or step == steps):
            if too_large(q, STRETCH_LIMIT):
                newton.history[:] = 0.0  # no iteration failed
                return step
            if unfinished:
                finish(flat_v, flat_a, flat_w, flat_before, coefficients)
            unfinished = False
            keep(step, stride, q, v, w, tables, loads.connectors, out)
        if step == steps:
            break
        begin_step(unfinished, flat, coefficients)
        if driven:
            turn_clamps(clamps, clamp_table[step + 1 - first])
        set_drives(factors.loops, clamp_table[step + 1 - first], len(clamps.nodes))
        if not solve_step(system, coefficients, load_table[step + 1 - first], newton.tolerance):
            return step + 1
        unfinished = True
        out.work[0] += dissipated(damping, q, state.q_before)
    if unfinished:
        finish(flat_v, flat_a, flat_w, flat_before, coefficients)
    return -1
