"""Accelerations from which an implicit run starts: M w = F at t = 0, by the kernel that takes the steps.

They are what Newton's iteration finds in a step of no length with the mass alone for its matrix (`NO_STEP`). So nothing
is compiled for what is done once. Kernels that start anew on the way call `balance`.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from anctmm.forces.actuation import DrivenClamps, place_clamps, turn_clamps
from anctmm.forces.connectors import add_connectors
from anctmm.forces.loads import set_loads
from anctmm.integrators.implicit_step import copy, damp_now
from anctmm.integrators.implicit_system import Newton, State, System
from anctmm.jit.compiling import kernel, uncompiled
from anctmm.recursion.accelerations import by_blocks
from anctmm.recursion.constrained import ask_anew, set_drives, take_anew
from anctmm.recursion.riccati import factorize

Array = NDArray[np.float64]

#: Solutions with factors in single precision, each of which takes the error left times a rounding of them.
REFINED = 4


def start(
    state: State,
    clamps: DrivenClamps,
    drives: Array,
    newton: Newton,
    solve: Callable[[Newton], int],
    single: bool = False,
) -> None:
    """True accelerations at t = 0, from which a starts too; those of driven nodes are their drives'.

    Parameters
    ----------
    state : State
        w and a are written, and at driven nodes q and v.
    clamps : DrivenClamps
    drives : ndarray, shape (clamps, 3)
        Angle, rate and acceleration of each at t = 0.
    newton : Newton
        What it counted is forgotten.
    solve : callable
        Takes a step with the coefficients `NO_STEP`.
    single : bool
        Whether factors are kept in single precision: then the solution is refined.
    """
    uncompiled(turn_clamps)(clamps, drives)
    for field, motion in zip((state.q, state.v, state.w), clamps.motion, strict=True):
        for h, held in enumerate(clamps.held):
            field[:held, clamps.nodes[h]] = motion[h, :held]
    newton.counts[2] = 1
    for _ in range(REFINED if single else 1):
        solve(newton._replace(tolerance=np.inf))
    newton.counts[:] = 0, 1, 1


@kernel
def balance(system: System, drives: Array, values: Array) -> None:
    """True accelerations of the present state, w and a, by other kernels: where a run starts anew between two steps."""
    state, tables, links, factors, clamps, loads, _, damping = system
    turn_clamps(clamps, drives)
    place_clamps(state.q, state.v, clamps)
    set_loads(state.q, state.f, state.dead, loads, values)
    damp_now(damping, state, tables, loads, values)
    add_connectors(loads.connectors, state.q, state.v, values, state.f)
    set_drives(factors.loops, drives, len(clamps.nodes))
    factorize(state.q, tables, links, 1.0, 0.0, loads, values, factors)
    ask_anew(factors, factors.loops, len(clamps.nodes), drives, state.q, state.v, state.w_before)
    by_blocks(state.q, state.f, tables, clamps, factors, state.w_before, state.w)
    take_anew(factors.loops)
    _, _, flat_a, flat_w, _, _ = state.flat
    copy(flat_w, flat_a)
