"""Estimate of the error of a step whose length an error drives, relative to what moves: see `step_control`."""

import numpy as np

from anctmm.discretise.assembly import mass_product
from anctmm.discretise.maps import push_alike
from anctmm.forces.connectors import measure, slopes
from anctmm.forces.loads import load_at
from anctmm.forces.timeline import missed_impulse, missed_turn
from anctmm.jit.compiling import embedded, inlined
from anctmm.recursion.low_rank import correct
from anctmm.recursion.riccati import sweep

#: Displacement that counts where nothing has moved yet, m.
TINY = 1e-300


@inlined
def step_error(t, h, to_w, system, control):  # type: ignore[no-untyped-def]
    """Filtered estimate of the error in displacement since the last one, relative, the largest of the nodes.

    The step is of h from t. `to_w` is c_w of the matrix that is kept: with that of the step, the estimate would change
    with the matrix's age: by a third where the matrix is that of steps 15 % shorter or longer.
    """
    state, tables, loads, pieces = system.state, system.tables, system.loads, control.actions.pieces
    q, load, x, missed = state.q, control.load, control.x, control.missed
    angles, values = control.angles, control.values
    factor = control.coefficient * h * h * to_w
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            x[k, i] = factor * (state.w[k, i] - control.w[k, i])
    mass_product(x, tables.first, tables.masses, tables.buffer, load)
    drives = angles.shape[1]
    for n in range(len(loads.kinds)):
        missed_impulse(True, pieces, drives + n, t, h, values[0, n], values[1, n], missed)
        fx, fy = load_at(loads, n, q, missed[0], missed[1])
        push_alike(loads.targets, n, to_w * h * fx, to_w * h * fy, load)
    _add_missed_lengths(loads.connectors, pieces, drives, t, h, to_w, q, values, missed, load)
    sweep(system.factors, load, x)
    correct(loads.border, x)
    turned = 0.0
    for n in range(drives):
        missing = control.reach[n] * missed_turn(pieces, n, t, h, angles[0, n], angles[1, n])
        turned = max(turned, missing)
    largest, least = 0.0, max(control.small * control.scale[0], TINY)
    for i in range(q.shape[1]):
        known = max(control.moved[0, i], control.moved[1, i])
        largest = max(largest, _size(x, i, control.bulge) / max(known, least))
    return largest + turned / control.scale[0] if control.scale[0] > 0.0 else 0.0


@embedded
def _add_missed_lengths(connectors, pieces, drives, t, h, to_w, q, values, missed, load):  # type: ignore[no-untyped-def]
    """What free lengths and angles do beside their straight lines, as impulses of the forces that they make."""
    if connectors is not None:
        for n in range(len(connectors.kinds)):
            row = connectors.driven[n]
            if row >= 0:
                missed_impulse(False, pieces, drives + row, t, h, values[0, row], values[1, row], missed)
                m, ax, ay, bx, by = measure(connectors, n, q)
                k, d = slopes(connectors, n, m - values[1, row, 0], 0.0, t)
                s = to_w * h * (abs(k) * missed[0] + abs(d) * missed[1])
                push_alike(connectors.first, n, s * ax, s * ay, load)
                push_alike(connectors.second, n, s * bx, s * by, load)


@inlined
def measure_motion(q, control):  # type: ignore[no-untyped-def]
    """Bring the largest displacements up to date."""
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            control.x[k, i] = q[k, i] - control.reference[k, i]
    for i in range(q.shape[1]):
        control.moved[0, i] = max(control.moved[0, i], _size(control.x, i, control.bulge))
        control.scale[0] = max(control.scale[0], control.moved[0, i])


@inlined
def _size(x, i, bulge):  # type: ignore[no-untyped-def]
    """Displacement that changes of coordinates make at a node, or by its gradient beside it, m."""
    here = x[0, i] * x[0, i] + x[1, i] * x[1, i]
    beside = (x[2, i] * x[2, i] + x[3, i] * x[3, i]) * bulge[i] * bulge[i]
    return np.sqrt(max(here, beside))
