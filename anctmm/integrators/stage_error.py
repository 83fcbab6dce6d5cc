"""Estimate of the error of a step of fourth order, and the motion within it: see `stage_control`.

The quintic through q, v and w at both ends of a step misses an exact motion by h⁶: the distance of its two ends,

    d = q_{n+1} − q_n − h/2 (v_n + v_{n+1}) + h²/12 (w_{n+1} − w_n),

is h⁵/720 times the fifth derivative there, and the error of the step has the same order, h⁵. So d shows it without the
loss of an order that an embedded formula has, and at no cost but a sweep. As in steps of second order,
(c_w M + K)⁻¹ c_w M takes from it what the method damps anyway. What is left of vibrations that two or three steps
resolve badly changes its sign from step to step, yet each size counts: a mean over two steps hides that they lose such
a vibration, which may be all that moves (3.4 times the error asked for, 1e-2).

The same quintic is the motion at the outputs: steps end where the error bounds them, not where somebody looks.
"""

from anctmm.forces.actuation import place_clamps, turn_clamps
from anctmm.forces.connectors import add_connectors
from anctmm.forces.timeline import set_actions
from anctmm.integrators.stage_constraints import project
from anctmm.integrators.step_error import filtered_error, largest_error
from anctmm.jit.compiling import inlined

#: Times d without the filter that counts as the error of the quintic: it is a part of d alone, but strains stiff
#: beams, whose energy goes with its square.
BETWEEN = 20.0
#: Places through which a cubic shows what the stages see of a load, parts of a step, and their stages.
PLACES, ROWS = (0.0, 83.0 / 250.0, 31.0 / 50.0, 1.0), (0, 2, 3, 5)


@inlined
def stage_error(t, h, to_w, system, control, track):  # type: ignore[no-untyped-def]
    """Error of a step of h from t, relative, the largest of the nodes; and that of the quintic within it.

    `to_w` is that of the matrix which is kept.
    """
    q, v, w, x, start = system.state.q, system.state.v, system.state.w, control.x, track.start
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            rates = 0.5 * h * (start[1, k, i] + v[k, i])
            x[k, i] = q[k, i] - start[0, k, i] - rates + h * h / 12.0 * (w[k, i] - start[2, k, i])
    between = BETWEEN * largest_error(x, 0.0, False, control)
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            x[k, i] *= to_w
    turned = filtered_error(t, h, to_w, PLACES, ROWS, True, system, control)
    return largest_error(x, turned, True, control), between


@inlined
def motion_within(x, h, state, start, found):  # type: ignore[no-untyped-def]
    """q, v and w at the part x of a step, by the quintic, in `found`, (3, rows, nodes)."""
    for k in range(found.shape[1]):
        for i in range(found.shape[2]):
            q, one, two = start[0, k, i], h * start[1, k, i], 0.5 * h * h * start[2, k, i]
            a = state.q[k, i] - q - one - two
            b = h * state.v[k, i] - one - 2.0 * two
            c = h * h * state.w[k, i] - 2.0 * two
            three, four, five = (
                10.0 * a - 4.0 * b + 0.5 * c,
                -15.0 * a + 7.0 * b - c,
                6.0 * a - 3.0 * b + 0.5 * c,
            )
            found[0, k, i] = q + x * (one + x * (two + x * (three + x * (four + x * five))))
            rate = one + x * (2.0 * two + x * (3.0 * three + x * (4.0 * four + x * 5.0 * five)))
            found[1, k, i] = rate / h
            found[2, k, i] = (2.0 * two + x * (6.0 * three + x * (12.0 * four + x * 20.0 * five))) / (h * h)


@inlined
def put_actions(t, row, projected, system, control, found):  # type: ignore[no-untyped-def]
    """Put the motion of drives at t in `found`, and find energies of connectors; a row takes the values."""
    clamps, angles, values = system.clamps, control.angles[row], control.values[row]
    set_actions(control.actions.pieces, t, False, angles, values)
    turn_clamps(clamps, angles)
    place_clamps(found[0], found[1], clamps)
    for h in range(len(clamps.nodes)):
        for k in range(clamps.held[h]):
            found[2, k, clamps.nodes[h]] = clamps.motion[2, h, k]
    project(projected, system, angles, found[0], found[1])
    add_connectors(system.loads.connectors, found[0], found[1], values, control.load)
