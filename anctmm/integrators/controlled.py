"""Trial steps of runs with a tolerance, with estimates of their errors: of positions, root mean square over the nodes.

An estimate passes the filter (to_w M + K)⁻¹ to_w M with the factored matrix of Newton's iteration, which takes from it
what the step damps anyway, and what joints do not allow. It is

- of ESDIRK4(3)6L[2]SA that of the embedded weights b̂, of positions or of velocities times h, whichever is larger;
- of generalized-α the difference to the Taylor series (Zienkiewicz & Xie 1991), h³ ẇ (β + ½ (αm − αf) − 1/6): its
  means are a_n = w(t_n + (αm − αf) h), and h ẇ = w_{n+1} − w_n.
"""

import numpy as np

from anctmm.integrators.alpha import coefficients, step_alpha
from anctmm.integrators.esdirk import step_esdirk
from anctmm.integrators.newton import Coefficients, renew
from anctmm.integrators.output import count_work, keep, stage_power, too_large
from anctmm.integrators.starting import balance
from anctmm.integrators.turning import count_turns
from anctmm.kernels.options import NONE, ONE, kernel, part
from anctmm.results.checks.divergence import STRETCH_LIMIT
from anctmm.system.calls import solve_for
from anctmm.system.elastic import subtract_inertia
from anctmm.system.forces import set_forces
from anctmm.system.matrix import gather


@kernel
def attempt_esdirk(size, space, restart, scheme, less, tables, state, inputs):  # type: ignore[no-untyped-def]
    """A step, and its error; infinity if it fails. Inputs: at its start, and of the stages behind it."""
    h, method, room = scheme.h, scheme.method, scheme.room
    if h == 0.0:
        return 0.0
    last = len(method.c) - 1
    if restart:
        for _ in range(2):
            balance(size, space, tables, state, inputs, NONE)
        stage_power(space, tables, state, inputs, NONE, room.power[last])
    if not step_esdirk(size, space, scheme, tables, state, inputs, ONE):
        return np.inf
    gamma, largest = method.A[1, 1] * h, 0.0
    c = Coefficients(h, 1.0 / (gamma * gamma), gamma, scheme.level)
    prepare(size, space, tables, state, c, inputs, last)
    for n in range(less.shape[0]):
        for k in range(state.q.shape[0]):
            for i in range(state.q.shape[1]):
                e = 0.0
                for j in range(last + 1):
                    e += less[n, j] * room.w[j, k, i]
                state.base[k, i] = h * h * e
        largest = max(largest, filtered(size, space, c.to_w, tables, state))
    return largest


@kernel
def attempt_alpha(size, space, restart, m, tables, state, inputs, out):  # type: ignore[no-untyped-def]
    """A step of m.h, and its error; infinity if it fails. Inputs: at its start, and at its end behind it."""
    if m.h == 0.0:
        return 0.0
    if restart:
        for _ in range(2):
            balance(size, space, tables, state, inputs, NONE)
        count_work(space, tables, state, m.h < 0.0, inputs, NONE, out)
    if not step_alpha(size, space, m, tables, state, inputs, ONE):
        return np.inf
    c = coefficients(m)
    prepare(size, space, tables, state, c, inputs, ONE)
    part_of_w = m.h * m.h * (m.beta + 0.5 * (m.alpha_m - m.alpha_f) - 1.0 / 6.0)
    for k in range(state.q.shape[0]):
        for i in range(state.q.shape[1]):
            state.base[k, i] = part_of_w * (state.w[k, i] - state.before[k, i])
    return filtered(size, space, c.to_w, tables, state)


@part
def prepare(size, space, tables, state, c, inputs, n):  # type: ignore[no-untyped-def]
    """Have the matrix of Newton's iteration where the next step would renew it, and connectors as they are now."""
    if state.counts[2] != 0:
        renew(size, space, tables, state, c, inputs, n)
    set_forces(space, tables, state.q, state.v, inputs, n, state.f)


@part
def filtered(size, space, to_w, tables, state):  # type: ignore[no-untyped-def]
    """The error in `base` through the filter: root mean square over the nodes, by `State.weight`."""
    matrix, nodes, total = tables.matrix, state.q.shape[1], 0.0
    for k in range(state.f.shape[0]):
        for i in range(nodes):
            state.f[k, i] = 0.0
            state.base[k, i] *= -to_w
    subtract_inertia(space, tables.elements, state.base, state.f)
    gather(space, matrix.at, state.f, matrix.unknowns)
    solve_for(size, space, tables, state.scratch)
    for k in range(state.weight.shape[0]):
        for i in range(nodes):
            total += (state.weight[k, i] * state.scratch[k, i]) ** 2
    return np.sqrt(total / nodes)


@kernel
def take(space, place, h, tables, state, inputs, row, out):  # type: ignore[no-untyped-def]
    """Count the work of a step of h unless h is 0, and turns; keep the state as output `place` unless that is −1."""
    if h > 0.0:
        count_work(space, tables, state, h > 0.0, inputs, row, out)
    count_turns(out.turning, state.q)
    if too_large(tables.elements, state.q, len(space), STRETCH_LIMIT):
        return False
    if place >= 0:
        keep(place, space, tables, state, out)
    return True
