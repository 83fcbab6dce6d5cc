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

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import (
    Tables,
)
from anctmm.discretise.chain import Chain
from anctmm.discretise.methods import Coefficients, GeneralizedAlpha
from anctmm.forces.actuation import (
    Actuation,
    Hubs,
    Loads,
    hub_reactions,
    place_hubs,
    set_loads,
    turn_hubs,
    work_done,
)
from anctmm.integrators.implicit_step import (
    Damping,
    State,
    add_damping_forces,
    begin_step,
    copy,
    dissipated,
    finish,
    new_damping,
    new_state,
)
from anctmm.integrators.newton import Newton, new_newton, single_will_do, solve_step
from anctmm.integrators.newton_failure import stalled
from anctmm.integrators.output import (
    Output,
    Record,
    keep,
    run_batches,
    too_large,
)
from anctmm.jit.compiling import kernel
from anctmm.recursion.accelerations import by_blocks
from anctmm.recursion.riccati import (
    BlockFactors,
    Links,
    block_factors,
    factorize,
    links,
    widened,
)
from anctmm.results.divergence_checks import STRETCH_LIMIT
from anctmm.results.solution import Solution, Status

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def integrate(chain: Chain) -> Solution:
    """Run a scene with the implicit integrator.

    Returns
    -------
    Solution
        With a status that names step, time and element if Newton's iteration failed.
    """
    run, bodies = chain.run, chain.bodies
    actuation, record = Actuation(chain.scene, bodies), Record(chain)
    state, newton = new_state(chain), new_newton(chain)
    fixed = (
        run.steps,
        run.stride,
        GeneralizedAlpha(run.spectral_radius).of_step(run.exact_dt),
        state,
        bodies.tables(),
        links(chain),
        block_factors(chain, single_will_do(chain)),
        actuation.hubs(),
        actuation.loads(),
        newton,
        record.arrays(),
        new_damping(chain),
    )

    def one(begin: int, end: int) -> int:
        t = run.times(np.arange(begin, min(end, run.steps) + 1))
        return int(advance(begin, end, *fixed, actuation.hub_table(t), actuation.load_table(t)))

    one(0, 0)
    start(*fixed[3:10], actuation, fixed[-1])
    record.start()
    start(*fixed[3:10], actuation, fixed[-1])

    def so_far(kept: int, status: Status, steps: int) -> Solution:
        return record.solution(kept, status, steps, int(newton.counts[0]), int(newton.counts[1]))

    failed = run_batches(chain, actuation.width, one, so_far)
    if failed < 0:
        return so_far(len(run.output_steps), Status(), run.steps)
    return so_far(1 + (failed - 1) // run.stride, stalled(chain, failed, state, newton), failed)


def start(
    state: State,
    tables: Tables,
    links: Links,
    factors: BlockFactors,
    hubs: Hubs,
    loads: Loads,
    newton: Newton,
    actuation: Actuation,
    damping: Damping | None = None,
) -> None:
    """True accelerations at t = 0, M w = F, from which a starts too; at driven clamps those of the drives."""
    now = np.zeros(1)
    drives, values = actuation.hub_table(now)[0], actuation.load_table(now)[0]
    if factors.L.dtype != np.float64:  # here nothing would correct what is rounded
        factors = widened(factors)
    balance(state, tables, links, factors, hubs, loads, drives, values, damping)
    newton.counts[:] = 0, 1, 1


@kernel
def balance(
    state: State,
    tables: Tables,
    links: Links,
    factors: BlockFactors,
    hubs: Hubs,
    loads: Loads,
    drives: Array,
    values: Array,
    damping: Damping | None,
) -> None:
    """w and a from the forces at t = 0; one call, since handing over so many arrays takes longer than the work."""
    turn_hubs(hubs, drives)
    place_hubs(state.q, state.v, hubs)
    set_loads(state.q, state.f, state.dead, loads, values)
    if damping is not None:
        _, flat_v, _, _, _, _ = state.flat
        copy(flat_v, damping.flat)
        add_damping_forces(state.q, state.f, state.dead, tables, loads, values, damping)
        dissipated(state.q, state.q, damping)
    factorize(state.q, tables, links, 1.0, 0.0, loads, values, factors)
    by_blocks(state.q, state.f, tables, hubs, factors, state.w_before, state.w)
    _, _, flat_a, flat_w, _, _ = state.flat
    copy(flat_w, flat_a)


@kernel
def advance(
    begin: int,
    end: int,
    steps: int,
    stride: int,
    coefficients: Coefficients,
    state: State,
    tables: Tables,
    links: Links,
    factors: BlockFactors,
    hubs: Hubs,
    loads: Loads,
    newton: Newton,
    out: Output,
    damping: Damping | None,
    hub_table: Array,
    load_table: Array,
) -> int:
    """From step `begin` to step `end`; the step whose Newton iteration failed, or −1.

    The two tables hold the values of driven clamps, (steps + 1, hubs, 3), and of loads, (steps + 1, loads, 2), from
    `begin` on.
    """
    q, v, _, w, _, _, f, _, _, flat = state
    _, flat_v, flat_a, flat_w, _, flat_before = flat
    driven = len(hubs.nodes) + len(loads.nodes) > 0
    unfinished = False
    for step in range(begin, end):
        values = load_table[step - begin]
        if driven:
            hub_reactions(q, w, f, tables, hubs)
            out.work[0] += work_done(step > 0, q, hubs, loads, values)
        if step % stride == 0 or step == steps:
            if too_large(q, STRETCH_LIMIT):
                newton.history[:] = 0.0  # no iteration failed
                return step
            if unfinished:
                finish(flat_v, flat_a, flat_w, flat_before, coefficients)
            unfinished = False
            keep(step, stride, q, v, tables, out)
        if step == steps:
            break
        begin_step(unfinished, flat, coefficients)
        if driven:
            turn_hubs(hubs, hub_table[step + 1 - begin])
        if not solve_step(
            state,
            coefficients,
            tables,
            links,
            factors,
            hubs,
            loads,
            load_table[step + 1 - begin],
            newton,
            damping,
        ):
            return step + 1
        unfinished = True
        if damping is not None:
            out.work[0] += dissipated(q, state.q_before, damping)
    if unfinished:
        finish(flat_v, flat_a, flat_w, flat_before, coefficients)
    return -1
