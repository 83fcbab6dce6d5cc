"""Implicit ANC-TMM: generalized-α with Newton, its linear solves by the Riccati recursion.

Chung & Hulbert (1993) in the form of Arnold & Brüls (2007): M w_{n+1} = F(q_{n+1}) holds at the end of the step, and

    (1 − αm) a_{n+1} + αm a_n = (1 − αf) w_{n+1} + αf w_n,
    q_{n+1} = q_n + h v_n + h² ((½ − β) a_n + β a_{n+1}),    v_{n+1} = v_n + h ((1 − γ) a_n + γ a_{n+1}).

A Newton correction solves (c_w M + K_T) Δq = F − M w with c_w = (1 − αm)/(βh²(1 − αf)): block tridiagonal, so the same
recursion as for the mass. Damping forces are those of q_{n+1} and v_{n+1}; to the matrix they add τγ/(βh) times the
elastic tangent of their body, which leaves out what stress and velocity add to their exact derivative: Newton needs a
correction or two more, and its limit is the same.

Known coordinates are known as positions; their velocities and accelerations follow from the formulas above, as they do
in an index-3 solution of the equations with multipliers. What they lack at the start, and where a drive jumps, stays
in the accelerations along constraints, with a sign that changes at each step, and falls as n ρ∞ⁿ; with ρ∞ = 1 it grows
as n, whatever the step. Positions and velocities are of second order all the same: accelerations of outputs are found
anew from them where that is seen (`implicit.balanced`).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.kept_chains import once, own
from anctmm.discretise.methods import NO_STEP, Coefficients
from anctmm.forces.actuation import actuation_of, clamp_reactions, turn_clamps, work_done
from anctmm.forces.driving import drive_width, tables_of
from anctmm.integrators.implicit.newton import solve_step
from anctmm.integrators.implicit.run import Steps, take_steps
from anctmm.integrators.implicit.step import begin_step, dissipated, finish
from anctmm.integrators.implicit.system import Newton, System, new_system
from anctmm.integrators.output import (
    Output,
    add_work,
    keep,
    too_large,
)
from anctmm.integrators.turn_count import count_turns
from anctmm.jit.by_address import by_address
from anctmm.jit.compiler.second_process import Task
from anctmm.jit.compiling import kernel
from anctmm.jit.direct import Direct
from anctmm.model.drives import table_of, tabulate
from anctmm.recursion.constrained import set_drives, work_of_drives
from anctmm.results.checks.divergence import STRETCH_LIMIT
from anctmm.results.solution import Solution

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@by_address
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
    run, actuation = chain.run, once(chain, actuation_of)

    def arguments(begin: int, end: int, c: Coefficients, system: System, out: Output) -> tuple[Any, ...]:
        first, last = max(begin, 0), min(end, run.steps)
        count = last + 1 - first if end > begin else 0  # without steps no history is evaluated
        find = table_of if begin < 0 else tabulate
        tables = tables_of(chain, actuation, lambda: run.times(np.arange(first, first + count)), count, find)
        return begin, end, Numbers(run.steps, run.stride, c), system, out, *tables

    def failed_at(step: int) -> float:
        return float(run.times(np.array([step]))[0])

    def again(step: Direct, outputs: Ints, system: System, out: Output) -> Callable[[int, Newton], int]:
        drives, values = tables_of(chain, actuation, lambda: run.times(outputs), len(outputs))
        still = Numbers(run.steps, run.stride, NO_STEP)
        return lambda k, newton: int(
            step(-1, 0, still, system._replace(newton=newton), out, drives[k : k + 1], values[k : k + 1])
        )

    with own(chain, new_system) as system:
        loads = system.loads
        work = Task(work_done, (True, system.state.q, system.clamps, loads, np.zeros((len(loads.kinds), 2))))
        steps = Steps(advance, arguments, drive_width(chain, actuation), failed_at, (work,), again)
        return take_steps(chain, system, steps)


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
            add_work(out, work_done(step > 0, q, clamps, loads, values))
        if step >= 0:
            out.work[0] += work_of_drives(factors.loops, step > 0, q)
            count_turns(q, out.turns)
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
        lost = dissipated(damping, q, state.q_before)
        add_work(out, (lost, lost))
    if unfinished:
        finish(flat_v, flat_a, flat_w, flat_before, coefficients)
    return -1
