"""Estimate of the error of a step of fourth order: see `stage_control`.

The quintic through q, v and w at both ends of a step misses an exact motion by h⁶: the distance of its two ends,

    d = q_{n+1} − q_n − h/2 (v_n + v_{n+1}) + h²/12 (w_{n+1} − w_n),

is h⁵/720 times the fifth derivative there, and the error of the step has the same order, h⁵. So d shows it without the
loss of an order that an embedded formula has, and at no cost but a sweep. As in steps of second order,
(c_w M + K)⁻¹ c_w M takes from it what the method damps anyway. What is left of vibrations that two or three steps
resolve badly changes its sign from step to step, yet each size counts: a mean over two steps hides that they lose such
a vibration, which may be all that moves (3.4 times the error asked for, 1e-2).

Coordinates that are driven have no error. Forces, and the work of the drive, have one: it is an integral over the step
by the weights of the method. So d of the drives themselves counts as if they were free. It made no run of the suite
longer; without it the work of a driven arm of two links was wrong by half at 1e-2, and by 0.01 at 1e-3.

Where joints and a steady drive leave rigid bodies no freedom, the filter leaves nothing of d, and d of the drive is 0.
The work of the drive was wrong by 0.01 at 1e-5 then. So d over h, without the filter, counts as an error of velocities
(`velocity_error`) where drives move bodies, none is elastic, and steps resolve what vibrates on springs: velocities at
the stages have it, and the work with them. At the end of a step they are projected.

The same quintic is where the motion at outputs starts from: see `stage_outputs`.
"""

from anctmm.integrators.adaptive.step_control import seen
from anctmm.integrators.adaptive.step_error import filtered_error, largest_error
from anctmm.integrators.adaptive.velocity_error import drives_rigid, largest_of, velocity_allowed
from anctmm.jit.compiling import inlined

#: Times d without the filter that counts as the error of the quintic: it is a part of d alone, but strains stiff
#: beams, whose energy goes with its square.
BETWEEN = 20.0
#: Times d over h that counts as the error of velocities at the stages: with 1 the balance of energy was wrong by up to
#: 10 times the tolerance, with this by up to 5, and with less left by Newton's iteration by up to 2.3.
RATES = 3.0
#: Places through which a cubic shows what the stages see of a load, parts of a step, and their stages.
PLACES, ROWS = (0.0, 83.0 / 250.0, 31.0 / 50.0, 1.0), (0, 2, 3, 5)


@inlined
def stage_error(t, h, to_w, system, control, track):  # type: ignore[no-untyped-def]
    """Error of a step of h from t, relative, the largest of the nodes; that of the quintic within it; of velocities.

    The last is over the one that they may have; 0 unless drives move bodies none of which is elastic.

    `to_w` is that of the matrix which is kept.
    """
    q, v, w, x, start = system.state.q, system.state.v, system.state.w, control.x, track.start
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            way = 0.5 * h * (start[1, k, i] + v[k, i])
            x[k, i] = q[k, i] - start[0, k, i] - way + h * h / 12.0 * (w[k, i] - start[2, k, i])
    plain, rates = seen(largest_error(x, 0.0, False, control), system, control), 0.0
    if plain > 0.0 and drives_rigid(control) and h <= control.returning.resolved:
        rates = RATES * largest_of(x, control) / (h * velocity_allowed(v, control))
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            x[k, i] *= to_w
    turned = filtered_error(t, h, to_w, PLACES, ROWS, True, system, control)
    return largest_error(x, max(turned, _of_drives(h, control)), True, control), BETWEEN * plain, rates


@inlined
def _of_drives(h, control):  # type: ignore[no-untyped-def]
    """Error d that driven angles and positions would have if they were free, m."""
    start, end, largest = control.angles[0], control.angles[len(control.angles) - 1], 0.0
    for n in range(control.angles.shape[1]):
        d = end[n, 0] - start[n, 0] - 0.5 * h * (start[n, 1] + end[n, 1])
        d += h * h / 12.0 * (end[n, 2] - start[n, 2])
        largest = max(largest, control.reach[n] * abs(d))
    return largest
