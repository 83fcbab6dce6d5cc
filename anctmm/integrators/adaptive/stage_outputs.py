"""Motion at outputs within a step of fourth order: see `stage_control`.

Steps end where the error bounds them, not where somebody looks. At an output within, positions and velocities, q* and
v*, are those of the quintic through q, v and w at both ends of the step. They miss the motion by a small part of the
error allowed; but what is stiff strains by that, and the forces that belong to it are wrong without bound. So what is
kept is a stage from there,

    M w = F(q, v, t),    q = q* + (γh)² (w − w*),    v = v* + γh (w − w*),

by Newton corrections: what is stiff goes where its forces balance, all else moves by about as much as the quintic
misses. Constraints are kept as positions; what is nonlinear in them is taken off before and after. The matrix is the
one kept, or a new one where that is old or does not do: as stiff parts turn, it takes what they move across themselves
for strain. So one correction, which does in most places, left a steel arm that a drive indexes with forces of seventy
times the largest at single outputs. What the corrections leave must be small beside the stretches of the step's ends.

Errors of reactions and tensions, over the largest, without and with it, at a tolerance of 1e-2: a steel linkage 40 and
0.1, a straight-line mechanism with steel links 135 and 0.3, a gantry crane 20 and 0.3, a four-bar driven by a moment
4.4 and 0.2; what remains are vibrations that steps of that length do not resolve. On seventeen scenes it took up to a
third of the corrections of a run at 1e-2, 0 to 6 of 100 at 1e-5, by the number of outputs. Steps do not change.

Nothing is corrected where beams alone are elastic and what the quintic misses is small beside the stretch of each of
them: of the stiffest, above all. That is so at most outputs of soft beams, and takes 0.98 times the work.
"""

import numpy as np

from anctmm.forces.actuation import place_clamps, turn_clamps
from anctmm.forces.connectors import add_connectors
from anctmm.forces.timeline import set_actions
from anctmm.integrators.adaptive.step_control import STRAINED
from anctmm.integrators.esdirk import correct_stage, move_drives
from anctmm.integrators.implicit.newton import SLOW
from anctmm.integrators.stage_constraints import project
from anctmm.jit.compiling import embedded, inlined
from anctmm.recursion.constrained import give_back_multipliers, keep_multipliers

#: What corrections at an output leave of a gradient, over the largest stretch at the ends of the step, and at least.
#: With 0.1 seventeen scenes took 1.01 times the work, with 1 single forces were wrong by a third of the largest.
BALANCED, LEAST = 0.3, 1e-9
#: Error of the quintic, over the least of the largest stretches of beams, up to which it is not corrected. The error is
#: that of `stage_error`, which is much larger than the error itself in most steps. With the largest stretch of all in
#: its place, sections of the stiff crank of a four-bar had three times the largest force.
SOUND = 3.6


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
    """Put the motion of drives at t in `found`, where constraints allow; a row takes the values of what acts."""
    clamps, angles = system.clamps, control.angles[row]
    set_actions(control.actions.pieces, t, False, angles, control.values[row])
    turn_clamps(clamps, angles)
    place_clamps(found[0], found[1], clamps)
    for h in range(len(clamps.nodes)):
        for k in range(clamps.held[h]):
            found[2, k, clamps.nodes[h]] = clamps.motion[2, h, k]
    project(projected, system, angles, found[0], found[1])


@inlined
def put_tensions(row, system, control, found):  # type: ignore[no-untyped-def]
    """Find tensions and energies of connectors; a row has the values of what acts."""
    add_connectors(system.loads.connectors, found[0], found[1], control.values[row], control.load)


@embedded
def strained_by(connectors, error, start, system, control):  # type: ignore[no-untyped-def]
    """Gradients by which the quintic of a step may be wrong, over the stretch of the beam that is stretched least.

    Infinite where that does not tell how wrong forces are: in springs, or where nothing is elastic.
    """
    if connectors is not None or not control.turns.elastic:
        return np.inf
    least, first, end = np.inf, system.tables.first, system.state.q
    for b in range(len(first) - 1):
        if first[b + 1] - first[b] > 1:  # a beam
            stretch = 0.0
            for i in range(first[b], first[b + 1]):
                stretch = max(stretch, max(_stretch(start, i), _stretch(end, i)))
            least = min(least, stretch)
    return error * control.scale[0] / (system.newton.scale * system.newton.weight[0] * max(least, LEAST))


@inlined
def _stretch(q, i):  # type: ignore[no-untyped-def]
    """How far the gradient at a node is from a unit vector; a point mass has none."""
    length = (q[2, i] * q[2, i] + q[3, i] * q[3, i]) ** 0.5
    return abs(length - 1.0) if length > 0.5 else 0.0


@inlined
def _enough(start, end, control):  # type: ignore[no-untyped-def]
    """Correction of a gradient that is small beside the stretches at the ends of a step; any where nothing bends."""
    stretch = 0.0
    for q in (start, end):
        for i in range(q.shape[1]):
            stretch = max(stretch, _stretch(q, i))
    return max(BALANCED * stretch, LEAST) if control.turns.elastic else np.inf


@inlined
def _small(newton, control):  # type: ignore[no-untyped-def]
    """Whether no correction of a stage was larger than the error allowed."""
    largest = 0.0
    for k in range(len(newton.history)):
        largest = max(largest, newton.history[k])
    return largest * newton.scale <= control.allowed * control.scale[0]


@inlined
def balance_within(row, c, system, control, track):  # type: ignore[no-untyped-def]
    """Bring the motion in `track.found` to balance by a stage with the coefficients c; a row has what acts.

    One that would move anything by more than the error allowed is none: there the matrix does not do, and a new one is
    made. Metal pendulums with damping went by the length of a gradient to another solution, and back at the next
    output, by corrections of which the first alone was small.
    """
    if control.progress[STRAINED] <= SOUND:
        return
    state, newton, found, end = system.state, system.newton, track.found, track.end
    for k in range(found.shape[1]):
        for i in range(found.shape[2]):
            end[0, k, i], end[1, k, i], end[2, k, i] = state.q[k, i], state.v[k, i], state.w[k, i]
    keep_multipliers(system.factors.loops, track.multipliers)
    move_drives(system.factors, system.clamps, control.angles[row])
    stale, made, expected = newton.counts[2], newton.counts[1], newton.expected[0]
    newton.counts[2] = 1 if stale != 0 and expected > SLOW else 0
    enough = newton.weight[0] * _enough(track.start[0], end[0], control)
    solved, tries = False, 0
    while not solved and tries < 2:
        for k in range(found.shape[1]):
            for i in range(found.shape[2]):
                state.q[k, i], state.w[k, i] = found[0, k, i], found[2, k, i]
                state.v[k, i] = found[1, k, i] - c.h * found[2, k, i]
        solved = correct_stage(False, system, c, control.values[row], enough) and _small(newton, control)
        newton.counts[2] = 1
        tries += 1
    newton.counts[2], newton.expected[0] = 1 if newton.counts[1] > made else stale, expected
    give_back_multipliers(system.factors.loops, track.multipliers)
    for k in range(found.shape[1]):
        for i in range(found.shape[2]):
            if solved:
                found[0, k, i], found[2, k, i] = state.q[k, i], state.w[k, i]
                found[1, k, i] = state.v[k, i] + c.h * state.w[k, i]
            state.q[k, i], state.v[k, i], state.w[k, i] = end[0, k, i], end[1, k, i], end[2, k, i]
    project(track.room.projected, system, control.angles[row], found[0], found[1])
