"""Constraints in a method whose stages keep them as accelerations: projections between the steps.

In stages of a Runge-Kutta method constraints g(q, t) = 0 are kept as g̈ = 0, which with M w + Jᵀλ = F gives w as a
smooth function of q, v and t: to these equations of index 1 the method applies as to any others, with its whole order.
Kept as positions, they are of index 3, and the order falls to 2. What truncation adds to g and ġ, h⁵ in a step, is
taken off at its end, by the nearest positions and velocities in the metric of Newton's matrix (Eich 1993, SIAM J.
Numer. Anal. 30: coordinate projection keeps the order).

Near a singular position, as where bars come to lie on one line, accelerations do not keep a linkage together. There
g = ε φ + c φ² in a direction φ that J hardly holds: g̈ = 0 lets its rate grow as 1/ε², and Newton's iteration, whose
matrix has J alone, diverges where ε̇ h is more than ε. Stages of such a step keep positions instead, which brings less
order to this step; w at its end is then found as at t = 0.

Constraints that are linear and constant, pins above all, stages keep as positions: that is the same for them, and
nothing is to be projected.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.kept_chains import once
from anctmm.discretise.methods import Coefficients
from anctmm.forces.actuation import actuation_of
from anctmm.forces.driving import drive_table
from anctmm.integrators.implicit.step import copy
from anctmm.integrators.implicit.system import System
from anctmm.integrators.locking import rows_in
from anctmm.jit.compiling import embedded, inlined
from anctmm.recursion.constrained import constrain_motion

Array = NDArray[np.float64]


def projected(chain: Chain) -> Array | None:
    """Scratch of projections, (rows, nodes); None where nothing is projected: then nothing of it is compiled."""
    if not chain.plan.kept or chain.kept.constraints.still.all():
        return None
    return np.zeros((chain.bodies.rows, chain.bodies.nodes))


@embedded
def of_stages(c, scratch, places=False):  # type: ignore[no-untyped-def]
    """Coefficients with which a stage keeps constraints: as accelerations, or, with `places`, all as positions."""
    if scratch is None:
        return c
    return Coefficients(c.h, c.alpha_m, c.alpha_f, c.beta, c.gamma, c.to_w, c.to_q, 0.0 if places else 2.0)


@embedded
def project(scratch, system, drives, q, v):  # type: ignore[no-untyped-def]
    """Put positions and velocities where constraints allow; False where joints and drives leave bodies no place.

    drives: values, rates and accelerations, (drives, 3).
    """
    if scratch is None:
        return True
    factors = system.factors
    kept = constrain_motion(factors, factors.loops, len(system.clamps.nodes), drives, q, v, scratch)
    if kept:
        factors.loops.rows.value[:] = 0.0  # errors of velocities that are taken off: see `locked`
    return kept


@inlined
def end_step(solved, room, system, drives):  # type: ignore[no-untyped-def]
    """Project the end of a step, or go back to its start where a stage was not solved; whether the step is taken."""
    state = system.state
    flat_q, flat_v, _, _, _, _ = state.flat
    if not solved:
        if room.projected is not None:
            copy(room.q, flat_q)
            copy(room.v, flat_v)
        return False
    return project(room.projected, system, drives, state.q, state.v)


def look_ahead(chain: Chain, system: System, t: float) -> None:
    """Where a step failed: see whether constraints can be kept a step later, or an interval of output, for `locked`.

    Stages keep the second derivative of g alone: where a linkage is about to lock, accelerations grow beyond all
    bounds, which does not tell why.
    """
    rows = rows_in(system.factors.loops)
    if rows is None or projected(chain) is None:
        return
    state, factors, actuation = system.state, system.factors, once(chain, actuation_of)
    later = np.array([min(t + chain.run.exact_dt, chain.run.t_end)])
    drives = drive_table(chain, actuation, later)[0]
    q, v, scratch = state.q.copy(), state.v.copy(), np.zeros_like(state.q)
    if constrain_motion(factors, factors.loops, len(system.clamps.nodes), drives, q, v, scratch):
        rows.value[:] = 0.0
