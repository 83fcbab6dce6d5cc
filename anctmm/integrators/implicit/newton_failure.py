"""Status of a run whose Newton iteration failed."""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import (
    damping_forces,
    elastic_forces,
    mass_product,
)
from anctmm.discretise.chain import Chain
from anctmm.discretise.joined import Joined
from anctmm.discretise.methods import Coefficients
from anctmm.forces.actuation import DrivenClamps, actuation_of, turn_clamps
from anctmm.forces.connectors import add_connectors_at_end, end_velocities
from anctmm.forces.driving import drive_table
from anctmm.forces.loads import set_loads
from anctmm.integrators.implicit.system import ITERATIONS, Newton, State, System, new_damping
from anctmm.integrators.output import (
    gradient_size,
    worst_element,
)
from anctmm.integrators.singular_positions import advice_at
from anctmm.jit.compiling import uncompiled
from anctmm.recursion.low_rank import correct, factor_border
from anctmm.recursion.riccati import (
    block_factors,
    factorize,
    links,
    solve,
)
from anctmm.results.checks.divergence import STRETCH_LIMIT
from anctmm.results.checks.finding import part
from anctmm.results.status import Status, in_short

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def stalled(
    chain: Chain, step: int, system: System, newton: Newton, t: float, jump: str | None = None
) -> Status:
    """What is known of the step that ended a run; t: where in it the iteration failed, s; what a jump there advises."""
    state, residuals = system.state, tuple[float, ...]()
    if not newton.history.any():  # the step was found, and is none that can be
        body, element = worst_element(chain, gradient_size(state.q))
        what = f"gradients grew beyond {STRETCH_LIMIT:g} by t = {t:.6g} s (step {step})"
    else:
        body, element = worst_element(chain, correction_size(chain, state))
        residuals = residual_history(chain, system, t)
        sizes = f"corrections {in_short(newton.history)}"
        if residuals:
            sizes += f" and residuals {in_short(residuals)} N"
        what = f"Newton's iteration failed at t = {t:.6g} s (step {step}), with {sizes}"
    advice = (
        jump
        or advice_at(chain, state.q_before, t)
        or f"a smaller dt than {chain.run.dt:g} s, steps controlled by `tolerance`, or another mesh may help"
    )
    return Status(
        "diverged",
        f"{what}, worst in {part(body, element)}; {advice}",
        time=t,
        step=step,
        body=body,
        element=element,
        residuals=residuals,
    )


def correction_size(chain: Chain, state: State) -> Array:
    """Largest component of the last correction at each node, positions relative to the scene's length, (nodes,)."""
    x = np.abs(state.loads)
    return np.maximum(x[:, :2].max(axis=1) / chain.length, x[:, 2:].max(axis=1))


def residual_history(chain: Chain, system: System, t: float) -> tuple[float, ...]:
    """Norms of the residual, N, of Newton's iteration in the step to t that failed, gone through once more.

    The kernel does not form them: a step that succeeds has no use for them. Empty if there are constraints,
    whose multipliers in the failed step are not stored.
    """
    if chain.plan.kept and chain.kept.constraints.names:
        return ()
    bodies, joined, state = chain.bodies, Joined(chain), system.state
    actuation = actuation_of(chain)
    c = chain.run.coefficients
    now, clamps, loads = np.array([t]), actuation.clamps(), actuation.loads()
    values, tables, dead = actuation.load_table(now)[0], bodies.tables(), chain.dead_load
    force, (elastic, inertia) = dead.copy(), np.zeros((2, *dead.shape))
    factors, damping = block_factors(chain), new_damping(chain)
    matrix = tables if damping is None else damping.stiff
    turn_clamps(clamps, drive_table(chain, actuation, now)[0])
    if loads.connectors is not None and system.loads.connectors is not None:
        loads.connectors.memory[:] = system.loads.connectors.memory  # whole turns are counted from there
    a = state.a
    q, w = _predicted(state, clamps, c)
    found: list[float] = []
    with np.errstate(all="ignore"):
        while len(found) < ITERATIONS and np.isfinite(found[-1:]).all() and np.isfinite(q).all():
            np.copyto(force, dead)
            set_loads(q, force, dead, loads, values)
            if damping is not None:
                new = ((1.0 - c.alpha_f) * w + c.alpha_f * state.w_before - c.alpha_m * a) / (1.0 - c.alpha_m)
                v = state.v + c.h * ((1.0 - c.gamma) * a + c.gamma * new)
                damping_forces(
                    tables.formulations,
                    q,
                    v,
                    tables.first,
                    tables.kinds,
                    tables.constants,
                    damping.of,
                    tables.buffer,
                    force,
                )
            uncompiled(end_velocities)(loads.connectors, state.v, a, w, state.w_before, c)
            add_connectors_at_end(loads.connectors, q, values, force)
            elastic_forces(
                tables.formulations, q, tables.first, tables.kinds, tables.constants, tables.buffer, elastic
            )
            mass_product(w, tables.first, tables.masses, tables.buffer, inertia)
            residual = force - elastic - inertia
            found.append(float(np.linalg.norm(joined.gather(residual))))
            factorize(q, matrix, links(chain), c.to_w, 1.0, loads, values, factors)
            factor_border(loads.border, q, 1.0, loads, values, factors)
            x = solve(factors, residual)
            correct(loads.border, x, factors)
            q += x
            w += c.to_w * x
    return tuple(found)


def _predicted(state: State, clamps: DrivenClamps, c: Coefficients) -> tuple[Array, Array]:
    """Positions and accelerations at the end of the step before Newton's iteration, each (rows, nodes)."""
    w = state.w_before.copy()
    new = (w - c.alpha_m * state.a) / (1.0 - c.alpha_m)
    q = state.q_before + c.h * state.v + c.h**2 * ((0.5 - c.beta) * state.a + c.beta * new)
    for h, i in enumerate(clamps.nodes):
        held = clamps.held[h]
        w[:held, i] += c.to_w * (clamps.motion[0, h, :held] - q[:held, i])
        q[:held, i] = clamps.motion[0, h, :held]
    return q, w
