"""What is known of a run that failed: when, where and what to try."""

import numpy as np
from numpy.typing import NDArray

from anctmm.integrators.accelerations import VIOLATED
from anctmm.integrators.stability import largest_step
from anctmm.integrators.state import ROUNDINGS, State
from anctmm.model.connectors import name_of
from anctmm.results.checks.divergence import STRETCH_LIMIT
from anctmm.results.checks.finding import part
from anctmm.results.checks.precision import FAR
from anctmm.results.checks.scales import reach_of
from anctmm.results.status import Status, in_short
from anctmm.system.rows import set_rows
from anctmm.system.system import System

Array = NDArray[np.float64]

#: Nodes up to which the stable step is examined.
EXAMINED = 5_000


def failed_step(system: System, state: State, step: int, when: float, before: Array | None = None) -> Status:
    """Status of a run whose step failed, which has left the state; `before`: coordinates at the output before."""
    found = _broken_law(system, when, step) or _rounded(system, state, when, step)
    limit = _limit(system, before)
    if found is None and not (system.run.explicit and system.run.exact_dt > limit):
        found = _locked(system, state, when, step)
    if found is not None:
        return found
    size = np.abs(state.scratch if state.sizes.any() else state.q[system.mesh.dim :]).max(axis=0)
    bad = np.flatnonzero(~np.isfinite(size))
    body, element = system.mesh.body_at(int(bad[0]) if bad.size else int(np.argmax(size)))
    dt = system.run.exact_dt
    if system.run.explicit:
        now = f", to {limit:.3g} s at the output before" if limit < dt else ""
        why = f"; a smaller dt than {dt:g} s may help: deformation lowers the largest stable step{now}"
        what = f"the motion diverged at t = {when:.6g} s (step {step})"
    else:
        what, why = _newton(system, state, step, when)
    return Status(
        "diverged",
        f"{what}, worst in {part(body, element)}{why}",
        time=when,
        step=step,
        body=body,
        element=element,
    )


def _newton(system: System, state: State, step: int, when: float) -> tuple[str, str]:
    """What happened in Newton's iteration, and what to try."""
    fixed = system.run.tolerance is None
    advice = (
        f"; a smaller dt than {system.run.exact_dt:g} s, steps controlled by `tolerance`, or another mesh may help"
        if fixed
        else "; a larger tolerance, stated breaks of histories, or another mesh may help"
    )
    if not state.sizes.any():
        return f"gradients grew beyond {STRETCH_LIMIT:g} by t = {when:.6g} s (step {step})", advice
    sizes = in_short(state.sizes)
    return f"Newton's iteration failed at t = {when:.6g} s (step {step}), with corrections {sizes}", advice


def _limit(system: System, before: Array | None) -> float:
    """Largest stable step of explicit runs at the output before, s."""
    small = system.mesh.nodes <= EXAMINED
    return largest_step(system, before) if system.run.explicit and before is not None and small else np.inf


def _violated(system: System, state: State, when: float) -> tuple[int, float]:
    """The row that is violated most, and its value over the scene's length; no row and 0 without any."""
    rows = system.tables.rows
    if not len(rows.at) or not np.isfinite(state.q).all():
        return -1, 0.0
    set_rows(rows, state.q, system.inputs(np.array([min(when, system.run.t_end)])).signals[0])
    worst = int(np.abs(rows.g).argmax())
    return worst, float(abs(rows.g[worst])) / system.scene.length


def _rounded(system: System, state: State, when: float, step: int) -> Status | None:
    """What is known of a step that failed because positions far from the origin have few digits."""
    length, reach = system.scene.length, reach_of(system.scene)
    last = state.sizes[state.sizes > 0.0][-1:].max(initial=_violated(system, state, when)[1])
    if not (reach > FAR * length and last * length <= ROUNDINGS * np.spacing(reach)):
        return None
    message = (
        f"a step failed at t = {when:.6g} s (step {step}), because positions {reach:.2g} m from the origin are rounded "
        f"to {np.spacing(reach):.1e} m; place the scene closer to the origin"
    )
    return Status("imprecise", message, time=when, step=step)


def _locked(system: System, state: State, when: float, step: int) -> Status | None:
    """What is known of rows that are violated."""
    worst, error = _violated(system, state, when)
    if not error > VIOLATED:
        return None
    row = system.numbering.rows[worst]
    body, _ = system.mesh.body_at(min(row.vectors) // system.mesh.slots)
    return Status(
        "failed",
        f"{row.owner} is violated by {error:.1e} of the scene's length at t = {when:.6g} s (step {step}): joints and "
        f"drives leave the bodies no admissible position, as where a linkage locks; a flexible body, other lengths or "
        f"another drive may help, or smaller steps if the linkage can move",
        time=when,
        step=step,
        body=body,
    )


def _broken_law(system: System, when: float, step: int) -> Status | None:
    """What is known of a law that gave no number."""
    acting = system.tables.acting
    broken = (acting.law != 0) & ~np.isfinite(acting.now[:, 0]) & np.isfinite(acting.now[:, 1])
    if not broken.any():
        return None
    k = int(broken.argmax())
    force, measure = acting.now[k, :2]
    return Status(
        "diverged",
        f"the law of the {name_of(system.scene.connectors[k])} gives {force} near t = {when:.6g} s (step {step}), at a "
        f"length or angle of {measure:.6g}; a law must give a finite number for every elongation, rate and time",
        time=when,
        step=step,
    )
