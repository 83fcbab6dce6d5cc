"""Implicit ANC-TMM: generalized-α (Chung & Hulbert 1993) in the index-3 form of Arnold & Brüls (2007).

With M w = f − Jᵀλ and g = 0 at the end of each step, and the means a of w,

    (1 − αm) a_{n+1} + αm a_n = (1 − αf) w_{n+1} + αf w_n
    q_{n+1} = q_n + h v_n + h² ((½ − β) a_n + β a_{n+1}),    v_{n+1} = v_n + h ((1 − γ) a_n + γ a_{n+1}).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.methods import GeneralizedAlpha
from anctmm.integrators.newton import Coefficients, iterate, set_end
from anctmm.integrators.output import Output, count_work, keep_due
from anctmm.integrators.state import State
from anctmm.kernels.options import inlined, kernel, part
from anctmm.system.forces import place_driven
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]


class Means(NamedTuple):
    """Parameters of the method: αm, αf, β, γ, step h (s), steps of the run and between outputs."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    h: float
    steps: int
    stride: int


def means_of(method: GeneralizedAlpha, h: float, steps: int, stride: int) -> Means:
    """Parameters of a run."""
    return Means(method.alpha_m, method.alpha_f, method.beta, method.gamma, h, steps, stride)


@inlined
def coefficients(m):  # type: ignore[no-untyped-def]
    """Of Newton's iteration."""
    part_of_w = (1.0 - m.alpha_f) / (1.0 - m.alpha_m)
    return Coefficients(m.h, 1.0 / (m.beta * m.h * m.h * part_of_w), m.gamma * m.h * part_of_w, 0)


@part
def predict(m: Means, state: State) -> None:
    """Known parts of q and v at the end of the step."""
    r, h = 1.0 / (1.0 - m.alpha_m), m.h
    q, v, means, now = state.q, state.v, state.a, state.w
    before, base, rate = state.before, state.base, state.rate
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            a, w = means[k, i], now[k, i]
            known = r * (m.alpha_f * w - m.alpha_m * a)
            before[k, i] = w
            base[k, i] = q[k, i] + h * v[k, i] + h * h * ((0.5 - m.beta) * a + m.beta * known)
            rate[k, i] = v[k, i] + h * ((1.0 - m.gamma) * a + m.gamma * known)


@part
def begin(tables: Tables, c: Coefficients, state: State, signals: Array) -> None:
    """q and v at the end of the step if w stays as it is, but where driven vectors have their positions."""
    w, before = state.w, state.before
    for k in range(w.shape[0]):
        for i in range(w.shape[1]):
            w[k, i] = before[k, i]
    set_end(state, c)
    driven, q, v = tables.driven, state.q, state.v
    place_driven(driven, signals, q, v, w)
    for n in range(len(driven.node)):
        i, a = driven.node[n], driven.component[n]
        for k in range(a, a + driven.b.shape[1]):
            w[k, i] = c.to_w * (q[k, i] - state.base[k, i])
            v[k, i] = state.rate[k, i] + c.to_v * w[k, i]


@part
def take_means(m: Means, state: State) -> None:
    """a at the end of the step."""
    r, w, before, a = 1.0 / (1.0 - m.alpha_m), state.w, state.before, state.a
    for k in range(a.shape[0]):
        for i in range(a.shape[1]):
            a[k, i] = r * ((1.0 - m.alpha_f) * w[k, i] + m.alpha_f * before[k, i] - m.alpha_m * a[k, i])


@part
def step_alpha(
    size: tuple[int, ...],
    space: tuple[int, ...],
    m: Means,
    tables: Tables,
    state: State,
    inputs: Inputs,
    n: int,
) -> bool:
    """One step; False if Newton's iteration fails, with the matrix at hand and with one renewed at each correction."""
    c = coefficients(m)
    predict(m, state)
    for attempt in range(state.limits[1]):
        begin(tables, c, state, inputs.signals[n])
        if iterate(size, space, tables, state, c, attempt == 1, inputs, n):
            take_means(m, state)
            return True
    return False


@kernel
def advance(
    size: tuple[int, ...],
    space: tuple[int, ...],
    first: int,
    m: Means,
    tables: Tables,
    state: State,
    inputs: Inputs,
    out: Output,
) -> int:
    """States from `first` on at the times of the inputs, each found by a step; the one that failed, or −1."""
    for n in range(len(inputs.t)):
        step = first + n
        if step > 0 and not step_alpha(size, space, m, tables, state, inputs, n):
            return step
        count_work(space, tables, state, step > 0, inputs, n, out)
        if not keep_due(step, m.steps, m.stride, space, tables, state, out):
            return step
    return -1
