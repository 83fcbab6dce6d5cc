"""Runs with a fixed step: the integrator's kernel, batch after batch, and the solution."""

from collections.abc import Callable

import numpy as np

from anctmm.discretise.methods import Esdirk, GeneralizedAlpha, Zhai
from anctmm.integrators import alpha, esdirk, explicit
from anctmm.integrators.diagnosis import failed_step
from anctmm.integrators.output import Record
from anctmm.integrators.run import take_batches
from anctmm.integrators.stability import check_step
from anctmm.integrators.starting import balance, started
from anctmm.integrators.state import State
from anctmm.kernels.announcing import compiling
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.system.system import System

Batch = Callable[[int, int], int]


def integrate(system: System, start: Solution | None = None) -> Solution:
    """Run a scene with a fixed step.

    Returns
    -------
    Solution
        With a status that says when, where and why a run failed.
    """
    run = system.run
    compiling.first_call(started, (system.size, system.space), system)
    state = started(system, start)
    if run.explicit and run.check_stability:
        check_step(system, state.q, start is not None)
    record = Record(system, run.times(run.output_steps), start)
    batch = batch_of(system, state, record)
    compiling.first_call(batch, (system.size, system.space, run.method.name), 0, 0)
    record.restart()
    width = 3 * len(system.signals) + 2 * (len(system.loads) + len(system.scene.connectors))
    failed = take_batches(system, record, state, width, batch)
    record.stop()
    count, status, steps = len(record.t), Status(), run.steps
    if failed >= 0:
        when = float(run.times(np.array([failed]))[0])
        count, steps = 1 + (failed - 1) // run.stride if failed else 0, failed
        before = record.out.series[0, count - 1] if count else None
        status = failed_step(system, state, failed, when, before)
    if isinstance(run.method, GeneralizedAlpha):
        settle(system, record, state, count)
    return record.solution(count, status, state, steps)


def settle(system: System, record: Record, state: State, count: int) -> None:
    """Accelerations at outputs from the equations of motion, where drives or rows make those of steps oscillate."""
    if not (len(system.tables.driven.node) or len(system.tables.rows.at)):
        return
    q, v, w = record.out.series[:, :count]
    inputs = system.inputs(record.t[:count])
    for n in range(count):
        state.q[:], state.v[:] = q[n], v[n]
        balance(system.size, system.space, system.tables, state, inputs, n)
        w[n] = state.w


def batch_of(system: System, state: State, record: Record) -> Batch:
    """What takes the steps that lead to states begin … end − 1, by the integrator of the run."""
    run, tables, shapes, out = system.run, system.tables, (system.size, system.space), record.out
    match run.method:
        case Zhai():
            fixed = explicit.Numbers(
                run.steps, run.stride, run.exact_dt, run.psi, run.phi, int(system.changing)
            )

            def batch(begin: int, end: int) -> int:
                inputs = system.inputs(run.times(np.arange(begin, end)))
                return int(explicit.advance(*shapes, begin, fixed, tables, state, inputs, out))
        case GeneralizedAlpha():
            means = alpha.means_of(run.method, run.exact_dt, run.steps, run.stride)

            def batch(begin: int, end: int) -> int:
                inputs = system.inputs(run.times(np.arange(begin, end)))
                return int(alpha.advance(*shapes, begin, means, tables, state, inputs, out))
        case Esdirk():
            scheme = esdirk.scheme_of(system, run.exact_dt)
            numbers = esdirk.Numbers(run.steps, run.stride, scheme)

            def batch(begin: int, end: int) -> int:
                inputs = system.inputs(esdirk.stage_times(system, begin, end))
                return int(esdirk.advance(*shapes, begin, numbers, tables, state, inputs, out))

    return batch
