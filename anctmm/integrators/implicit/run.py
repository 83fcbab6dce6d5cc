"""Start, continuation and end of an implicit run with a fixed step, for all methods.

It starts from the accelerations with M w = F at t = 0. The kernel of the steps computes them: they are the result of
Newton's iteration in a step of length zero with the mass as its matrix (`NO_STEP`). So nothing is compiled for a
computation that is done once. Kernels that restart during a run call `balance`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Concatenate

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.kept_chains import once, once_alike
from anctmm.discretise.methods import NO_STEP, Coefficients
from anctmm.forces.actuation import actuation_of, clamp_reactions, place_clamps, turn_clamps
from anctmm.forces.connectors import add_connectors
from anctmm.forces.driving import drive_table
from anctmm.forces.loads import set_loads
from anctmm.integrators.broken_law import broken_law
from anctmm.integrators.implicit.balanced import balanced, settle
from anctmm.integrators.implicit.newton import iterate
from anctmm.integrators.implicit.newton_failure import stalled
from anctmm.integrators.implicit.step import copy, damp_now
from anctmm.integrators.implicit.system import Newton, System
from anctmm.integrators.jumping_law import advice_on_jump
from anctmm.integrators.locking import locked, rows_in
from anctmm.integrators.output import Output, Record, keep, run_batches
from anctmm.jit.compiler.second_process import Parts, Task, side_by_side
from anctmm.jit.compiling import kernel
from anctmm.jit.direct import Direct
from anctmm.model.drives import table_of
from anctmm.recursion.accelerations import by_blocks
from anctmm.recursion.constrained import ask_anew, begin_newton, set_drives, take_anew
from anctmm.recursion.riccati import factorize
from anctmm.results.solution import Solution
from anctmm.results.status import Status

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Steps:
    """How a method takes its steps.

    Parameters
    ----------
    advance : kernel
        Takes steps; gives the one that failed, or −1.
    arguments : callable
        (begin, end, coefficients, system, output) → arguments of `advance` for the steps of a range; step −1 is the
        start.
    width : int
        Numbers tabulated for each step.
    failed_at : callable
        Time in a step that failed, s.
    parts : sequence of Task
        What `advance` calls beside Newton's iteration and the output, for compilation in a second process.
    again : callable, optional
        Takes what calls `advance`, and then what `Again` takes: for methods whose accelerations along constraints
        drift, computes these at outputs again.
    look : callable, optional
        Sees whether constraints can be kept after a time of failure, s, where the method does not keep positions.
    """

    advance: Any
    arguments: Callable[[int, int, Coefficients, System, Output], tuple[Any, ...]]
    width: int
    failed_at: Callable[[int], float]
    parts: tuple[Task, ...] = ()
    again: Callable[Concatenate[Direct, ...], Callable[[int, Newton], int]] | None = None
    look: Callable[[float], None] | None = None


def take_steps(chain: Chain, system: System, steps: Steps) -> Solution:
    """Run a scene.

    Returns
    -------
    Solution
        With a status that names step, time and element if Newton's iteration failed.
    """
    run, record, c = chain.run, Record(chain), once(chain, _coefficients)
    newton, out = system.newton, record.arrays()

    def compiled() -> Direct:
        with side_by_side(lambda: parts_of(system, c, out, steps.parts)):
            steps.advance(*steps.arguments(0, 0, c, system, out))
        return Direct(steps.advance)

    advance = once_alike(chain, compiled, steps.advance, (system.damping is None, system.factors.L.dtype))

    def one(begin: int, end: int, c: Coefficients = c, newton: Newton = newton) -> int:
        return int(advance(*steps.arguments(begin, end, c, system._replace(newton=newton), out)))

    record.start()
    start(chain, system, lambda _, newton: one(-1, 0, NO_STEP, newton))

    def so_far(kept: int, status: Status, taken: int) -> Solution:
        return record.solution(kept, status, taken, int(newton.counts[0]), int(newton.counts[1]))

    failed = run_batches(chain, steps.width, one, so_far)
    record.stop()
    kept, status, taken = len(record.q), Status(), run.steps
    if failed >= 0:
        kept, taken = 1 + (failed - 1) // run.stride, failed
        when = steps.failed_at(failed)
        if steps.look is not None:
            steps.look(when)
        last = float(newton.history[newton.history != 0.0][-1:].sum())
        jump = advice_on_jump(chain, system.loads.connectors, last, c, when)
        status = (
            (
                locked(chain, system.state.q, rows_in(system.factors.loops), when, failed)
                if jump is None
                else None
            )
            or broken_law(chain, system.loads.connectors, when, failed)
            or stalled(chain, failed, system, newton, when, jump)
        )
    if steps.again is not None:  # after the look at where it failed: it writes the state
        settle(chain, system, record, kept, partial(steps.again, advance), out)
    return so_far(kept, status, taken)


def _coefficients(chain: Chain) -> Coefficients:
    """Coefficients of the implicit solves of a step."""
    return chain.run.coefficients


def parts_of(system: System, c: Coefficients, out: Output, more: Sequence[Task]) -> Parts:
    """Kernels of a method, for `side_by_side`: the second process begins with the largest, which stands last.

    Parameters
    ----------
    system : System
    c : Coefficients
    out : Output
    more : sequence of Task
        What the method calls beside Newton's iteration and the output.
    """
    state, tables, links, factors, clamps, loads, _, _ = system
    values = np.zeros((len(loads.kinds), 2))
    shared = [
        Task(clamp_reactions, (state.q, state.w, state.f, tables, clamps)),
        *more,
        Task(keep, (0, 1, state.q, state.v, state.w, tables, loads.connectors, out), by_python=True),
        Task(iterate, (False, system, c, values, 1.0), by_python=True),
        Task(factorize, (state.q, tables, links, c.to_w, c.to_q, loads, values, factors), by_python=True),
    ]
    return Parts(shared)


def start(chain: Chain, system: System, solve: Callable[[int, Newton], int]) -> None:
    """True accelerations at t = 0, from which a starts too; those of driven nodes are their drives'.

    Parameters
    ----------
    chain : Chain
    system : System
        Of its state w and a are written, and at driven nodes q and v; what Newton's iteration counted is forgotten.
    solve : callable
        As of `balanced`.
    """
    state, drives = system.state, drive_table(chain, once(chain, actuation_of), np.zeros(1), table_of)
    balanced(system, np.array([[state.q], [state.v], [state.w]]), drives, solve)
    system.newton.counts[:] = 0, 1, 1


@kernel
def balance(system: System, drives: Array, values: Array) -> None:
    """True accelerations of the present state, w and a, by other kernels: where a run restarts between two steps."""
    state, tables, links, factors, clamps, loads, _, damping = system
    turn_clamps(clamps, drives)
    place_clamps(state.q, state.v, clamps)
    set_loads(state.q, state.f, state.dead, loads, values)
    damp_now(damping, state, tables, loads, values)
    add_connectors(loads.connectors, state.q, state.v, values, state.f)
    set_drives(factors.loops, drives, len(clamps.nodes))
    # the multipliers that an iteration left which failed may be no numbers: nor is 0 times them
    begin_newton(factors.loops)
    factorize(state.q, tables, links, 1.0, 0.0, loads, values, factors)
    ask_anew(factors, factors.loops, len(clamps.nodes), drives, state.q, state.v, state.w_before)
    by_blocks(state.q, state.f, tables, clamps, factors, state.w_before, state.w)
    take_anew(factors.loops)
    _, _, flat_a, flat_w, _, _ = state.flat
    copy(flat_w, flat_a)
