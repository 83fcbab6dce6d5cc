"""Errors of velocities that positions determine: across constraints, and of what drives hold.

Generalized-α keeps constraints g(q, t) = 0 and driven coordinates as positions (index 3). These have no error, but the
velocities, J v + ∂g/∂t, have one: that of a free coordinate in a step over the length of the step, h² q‴ times the
constant of the method (Arnold & Brüls 2007). Each step has its own: they do not add up. Where joints and drives leave a
mechanism no freedom there is no other error, estimates of positions see nothing of it, and steps stayed long whatever
the tolerance. So the velocities that drives and joints determine may miss by a part of the tolerance times the largest
velocity until now. Where nothing is driven this is not asked: what moves is free, and errors of its positions, which
add up to the tolerance over a run, leave its velocities better by far.

Velocities projected on the constraints at the end of each step, as in steps of fourth order, are exact to 1e-4 … 1e-8
there. But then accelerations no longer fit them, and forces of constraints are of first order: slider-cranks and
four-bars had a balance of energy wrong by 0.08 at 1e-3 and 0.008 at 1e-5, where it is now wrong by 2e-3 and 3e-5, and
positions of Andrews' squeezer missed by 11 times the tolerance instead of 2.
"""

from anctmm.integrators.adaptive.step_error import TINY, size_of
from anctmm.integrators.implicit.step import shares
from anctmm.jit.compiling import embedded, inlined
from anctmm.recursion.constrained import ask_velocities, forget_asked
from anctmm.recursion.low_rank import correct
from anctmm.recursion.riccati import sweep

#: Part of the tolerance that errors of velocities may have in the mean over some steps.
PART = 0.5


@inlined
def velocity_error(c, system, control):  # type: ignore[no-untyped-def]
    """Error of the velocities at the end of a step that positions determine, over the one that they may have."""
    clamps, loops, error = system.clamps, system.factors.loops, 0.0
    if control.angles.shape[1] > 0:
        x = control.x
        _set_velocities(c, system.state, x)
        allowed = velocity_allowed(x, control)
        for h in range(len(clamps.nodes)):
            i = clamps.nodes[h]
            for k in range(x.shape[0]):
                wrong = x[k, i] - clamps.motion[1, h, k] if k < clamps.held[h] else 0.0
                control.load[k, i] = wrong
            error = max(error, size_of(control.load, i, control.bulge))
        error = max(error, _across(loops, system, control))
        error /= allowed
    return error


@inlined
def drives_rigid(control):  # type: ignore[no-untyped-def]
    """Whether drives move bodies, and none is elastic."""
    return control.angles.shape[1] > 0 and not control.turns.elastic


@inlined
def velocity_allowed(v, control):  # type: ignore[no-untyped-def]
    """Error that velocities v may have, m/s; the largest is no less than the mean one of what moves furthest."""
    fastest = max(control.fastest[0], control.scale[0] / control.t_end, TINY)
    return PART * control.tolerance * max(fastest, largest_of(v, control))


@inlined
def _set_velocities(c, state, x):  # type: ignore[no-untyped-def]
    """Put the velocities that the step would end with in the place of x."""
    now, then, old = shares(c)
    v, a, w, had = state.v, state.a, state.w, state.w_before
    for k in range(x.shape[0]):
        for i in range(x.shape[1]):
            new = now * w[k, i] + then * had[k, i] - old * a[k, i]
            x[k, i] = v[k, i] + c.h * ((1.0 - c.gamma) * a[k, i] + c.gamma * new)


@embedded
def _across(loops, system, control):  # type: ignore[no-untyped-def]
    """Largest change that brings velocities x back to the constraints, in the metric of the matrix kept, m/s."""
    if loops is None:
        return 0.0
    x, largest = control.x, 0.0
    missed = ask_velocities(loops, system.state.q, x)
    if missed > 0.0:
        control.load[:] = 0.0
        sweep(system.factors, control.load, x)
    forget_asked(loops)
    if missed > 0.0:
        correct(system.loads.border, x, system.factors)
        largest = largest_of(x, control)
    return largest


@inlined
def largest_of(x, control):  # type: ignore[no-untyped-def]
    """Largest size of x, (rows, nodes), of a node or beside it."""
    largest = 0.0
    for i in range(x.shape[1]):
        largest = max(largest, size_of(x, i, control.bulge))
    return largest


@inlined
def measure_speed(v, control):  # type: ignore[no-untyped-def]
    """Bring the largest velocity up to date."""
    control.fastest[0] = max(control.fastest[0], largest_of(v, control))
