"""Explicit ANC-TMM: Zhai's integrator (Rong 2014, eq. 38) with the mass eliminated by the recursion.

    q_{n+1} = q_n + v_n Δt + (½ + ψ) a_n Δt² − ψ a_{n−1} Δt²
    v_{n+1} = v_n + (1 + φ) a_n Δt − φ a_{n−1} Δt,     a_{−1} = a_0.

Driven vectors are prescribed at all three levels, and rows that change are kept by projection, so nothing drifts.
Damping forces are those of the velocities v_n: with ψ = φ = ½ both formulas remain of second order (the second is the
Adams–Bashforth method).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.integrators.accelerations import factorize_mass, project, solve_accelerations
from anctmm.integrators.output import Output, count_work, keep_due
from anctmm.integrators.state import State
from anctmm.kernels.options import kernel
from anctmm.system.calls import set_jacobian
from anctmm.system.forces import place_driven, set_forces
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]


class Numbers(NamedTuple):
    """Last step, steps between outputs, Δt (s), ψ, φ, and 1 where the rows change."""

    steps: int
    stride: int
    dt: float
    psi: float
    phi: float
    changing: int


@kernel
def advance(
    size: tuple[int, ...],
    space: tuple[int, ...],
    first: int,
    numbers: Numbers,
    tables: Tables,
    state: State,
    inputs: Inputs,
    out: Output,
) -> int:
    """Steps from `first` on at the times of the inputs; the one at which the motion failed, or −1."""
    dt, psi, phi = numbers.dt, numbers.psi, numbers.phi
    q, v, w, a = state.q, state.v, state.w, state.a
    for n in range(len(inputs.t)):
        step, signals = first + n, inputs.signals[n]
        for k in range(w.shape[0]):  # `a` is the acceleration of the step before
            for i in range(w.shape[1]):
                a[k, i], w[k, i] = w[k, i], 0.0
        place_driven(tables.driven, signals, q, v, w)
        if numbers.changing != 0:
            if not project(size, space, tables, state, inputs, n):
                return step
        elif step == 0:
            set_jacobian(tables, q, signals)
            factorize_mass(size, space, tables, state, inputs, n)
        set_forces(space, tables, q, v, inputs, n, state.f)
        solve_accelerations(size, space, tables, state, signals)
        check = 0.0
        for k in range(w.shape[0]):
            check += w[k, 0] + w[k, w.shape[1] - 1]
        if check - check != 0.0:  # also of no number
            return step
        count_work(space, tables, state, step > 0, inputs, n, out)
        if not keep_due(step, numbers.steps, numbers.stride, space, tables, state, out):
            return step
        if step < numbers.steps:
            for k in range(q.shape[0]):
                for i in range(q.shape[1]):
                    old = w[k, i] if step == 0 else a[k, i]
                    q[k, i] += dt * (v[k, i] + dt * ((0.5 + psi) * w[k, i] - psi * old))
                    v[k, i] += dt * ((1.0 + phi) * w[k, i] - phi * old)
    return -1
