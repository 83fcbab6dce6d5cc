"""Error of a step whose length an error drives, relative to what moves: see `step_control`."""

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
def filtered_error(t, h, to_w, places, rows, curved, system, control):  # type: ignore[no-untyped-def]
    """Put (c_w M + K)⁻¹ M x, and what acts unseen, in the place of x; returns what drives do unseen, m.

    x, c_w times an estimate of the error of a step of h from t, stands in `control.x`. `to_w` is c_w of the matrix that
    is kept: with that of the step, the estimate would change with the matrix's age. The step sees what acts at its
    `places`, whose values are the `rows` of those in `control`; of drives it sees accelerations if `curved`.
    """
    pieces, load, x, angles = control.actions.pieces, control.load, control.x, control.angles
    mass_product(x, system.tables.first, system.tables.masses, system.tables.buffer, load)
    _add_missed_loads(t, h, to_w, places, rows, system, control)
    _add_missed_lengths(system.loads.connectors, t, h, to_w, places, rows, system.state.q, control)
    sweep(system.factors, load, x)
    correct(system.loads.border, x, system.factors)
    turned, first, last = 0.0, rows[0], rows[len(rows) - 1]
    for n in range(angles.shape[1]):
        missing = control.reach[n] * missed_turn(curved, pieces, n, t, h, angles[first, n], angles[last, n])
        turned = max(turned, missing)
    return turned


@inlined
def largest_error(x, turned, weighed, control):  # type: ignore[no-untyped-def]
    """Largest error x of the nodes, (rows, nodes), relative to what they move, and that of drives, m.

    `weighed`: times what it grows until the end.
    """
    largest, least = 0.0, max(control.small * control.scale[0], TINY)
    for i in range(x.shape[1]):
        known = max(control.moved[0, i], control.moved[1, i])
        growth = control.turns.growth[i] if weighed else 1.0
        largest = max(largest, growth * size_of(x, i, control.bulge) / max(known, least))
    return largest + turned / control.scale[0] if control.scale[0] > 0.0 else 0.0


@inlined
def _add_missed_loads(t, h, to_w, places, rows, system, control):  # type: ignore[no-untyped-def]
    """What loads do that the step does not see, as impulses at its start."""
    loads, missed, drives = system.loads, control.missed, control.angles.shape[1]
    for n in range(len(loads.kinds)):
        missed_impulse(
            True, control.actions.pieces, drives + n, t, h, places, rows, control.values, n, missed
        )
        fx, fy = load_at(loads, n, system.state.q, missed[0], missed[1])
        push_alike(loads.targets, n, to_w * h * fx, to_w * h * fy, control.load)


@embedded
def _add_missed_lengths(connectors, t, h, to_w, places, rows, q, control):  # type: ignore[no-untyped-def]
    """What free lengths and angles do that the step does not see, as impulses of the forces that they make."""
    if connectors is not None:
        pieces, values, missed, load = control.actions.pieces, control.values, control.missed, control.load
        drives, last = control.angles.shape[1], rows[len(rows) - 1]
        for n in range(len(connectors.kinds)):
            row = connectors.driven[n]
            if row >= 0:
                missed_impulse(False, pieces, drives + row, t, h, places, rows, values, row, missed)
                m, ax, ay, bx, by = measure(connectors, n, q)
                k, d = slopes(connectors, n, m - values[last, row, 0], 0.0, t)
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
        control.moved[0, i] = max(control.moved[0, i], size_of(control.x, i, control.bulge))
        control.scale[0] = max(control.scale[0], control.moved[0, i])


@inlined
def size_of(x, i, bulge):  # type: ignore[no-untyped-def]
    """Displacement that changes of coordinates make at a node, or by its gradient beside it, m."""
    here = x[0, i] * x[0, i] + x[1, i] * x[1, i]
    beside = (x[2, i] * x[2, i] + x[3, i] * x[3, i]) * bulge[i] * bulge[i]
    return np.sqrt(max(here, beside))
