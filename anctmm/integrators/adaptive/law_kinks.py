"""Where the law of a connector bends or jumps within a step, for step control: impacts on one-sided springs.

A step across the onset of a contact sees a force that bends by the polynomial of its method. What that misses of the
impulse stays as an error of the speed and moves the body ever further, while an estimate of a displacement shows what
the step itself misses. No order helps: the speed is wrong by h² times the jump of the slope. So a step ends before such
a place, a very short one crosses it, and the next ones see a smooth force.

Nothing tells where a law bends but its values. They are found along the step, by the cubic of the elongation and its
rate at both ends, which is exact in free flight. A bend is a second difference that is more than twice as large as
those beside it: with POINTS values a step, those of a smooth law change little from one to the next, however curved it
is. What the step misses of the impulse is at most that difference times Peano's kernel of the quadrature: between its
ends at most `middle`, near them `edge` times the way to them, for a slope that jumps by one in a step of length one.
Times the time left and over the inertia it is the displacement by which the motion will be wrong at the end. Each step
may make CROSSING of the error allowed by that; one that makes more is refused.

A bend that would have made all of the error allowed is severe. Then errors of the speed matter in the whole run: it is
made again, with a stricter iteration (`step_control.left_by_newton`), and with fourth order errors count the more, the
more bends are to come (`grown`). Neither the estimate nor Newton's iteration may then be taken at their word at a
contact: see `_unsolved`.

Masses that bounce 1 to 10 times, between stops, on preloaded and damped floors, pendulums at rotational stops, and
masses that collide missed by up to 1,600 times the tolerance, 1e-2 … 1e-5, by steps of fourth order, by 700 times by
generalized-α, and some diverged. Now errors are at most 0.3 of it, and 2.6 times it with generalized-α, in 504 runs.
Steps of fourth order are half as many as before in the mean, those of generalized-α as many. Smooth laws have the steps
that they had; those that bend a little, or nearly, have up to 1.7 times as many, a beam that meets its stop 2.2 times.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.maps import push, rate_at
from anctmm.forces.connectors import bends_at, free_measure, has_clock, measure, slopes
from anctmm.forces.laws import call_law
from anctmm.integrators.adaptive.step_error import largest_error
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined, shared
from anctmm.model.scene import Scene
from anctmm.recursion.low_rank import correct
from anctmm.recursion.riccati import sweep

Array = NDArray[np.float64]

#: Intervals of a step between whose ends laws are evaluated, and times the place of a bend is looked for, each time in
#: three intervals of the last.
POINTS, LEVELS = 48, 3
#: Part of the error allowed that a step may make by a bend, and part of that at which a step across one aims.
CROSSING, AIMED = 0.03, 0.4
#: Times what a step may make by a bend, above which it is severe: all of the error allowed.
SEVERE = 1.0 / CROSSING
#: Times that errors grow by each severe bend, and the part of a run since whose start those to come are foreseen, at
#: least.
GROWS, EARLY = 1.0, 0.05
#: Part of a jump of a force that is seen in a part of the step if it is one, and what a step may miss of it.
JUMPS, WHOLE = 0.25, 0.5
#: Part of the inertia c_w m, over what a quadrature gives an end of the step, that the stiffness of a contact may be:
#: steps of 1.4 over its frequency with fourth order, of 1 with second.
RESOLVED = 0.5
#: Part of the largest force by which that of a stage may differ from that on the path of its step.
STRAYED = 0.5
#: Half of a step across a bend, at least, of the run.
LEAST = 1e-8
#: Part of that, below which a step to its begin is none.
AT_ONCE = 0.25
#: Part of a step by which its end and a stop may differ and be one.
CLOSE = 1e-8


@by_address
class Kinks(NamedTuple):
    """Bends of laws within a step.

    path: coefficients of the elongation along it, (4,). forces: of a law at equal distances, (POINTS + 1,). bends:
    second differences of two neighbours, (POINTS,). place: where a bend is to be crossed: its middle and half of its
    width, parts of the step, the power of the width by which the error falls, and the error; the second row is that of
    the law looked at, (2, 4). stops: times between which a step is to cross a bend, s, −∞ where they are over, (2,).
    crossed: severe bends until now, steps refused for one since the last that was not, and the largest error of these,
    (3,). known: whether the run is one made again since a severe bend was seen, and whether one is to be, (2,).
    severe: whether such a bend of each connector was seen, (connectors,). staged: forces at the stages of the step,
    (connectors, stages).
    """

    path: Array
    forces: Array
    bends: Array
    place: Array
    stops: Array
    crossed: Array
    known: NDArray[np.bool_]
    severe: NDArray[np.bool_]
    staged: Array


def new_kinks(scene: Scene, stages: int) -> Kinks | None:
    """What is known of bends; None where no connector has a law: then nothing of them is compiled."""
    if not has_clock(scene):
        return None
    path, forces, bends, place = np.zeros(4), np.zeros(POINTS + 1), np.zeros(POINTS), np.zeros((2, 4))
    known, severe = np.zeros(2, np.bool_), np.zeros(len(scene.connectors), np.bool_)
    stops, staged = np.full(2, -np.inf), np.zeros((len(scene.connectors), stages))
    return Kinks(path, forces, bends, place, stops, np.zeros(3), known, severe, staged)


def begin_kinks(kinks: Kinks | None) -> None:
    """Start a run."""
    if kinks is not None:
        kinks.stops[:], kinks.crossed[:] = -np.inf, 0.0


def know_kinks(kinks: Kinks | None) -> bool:
    """After a run that was ended: whether that was for bends, of which the next one knows."""
    found = kinks is not None and bool(kinks.known[1])
    if kinks is not None and found:
        kinks.known[:] = True, False
    return found


@embedded
def knows_kinks(kinks):  # type: ignore[no-untyped-def]
    """Whether errors of speeds are known to stay: less of them may be left by Newton's iteration."""
    known = False
    if kinks is not None:
        known = kinks.known[0]
    return known


@embedded
def keep_forces(kinks, connectors, stage):  # type: ignore[no-untyped-def]
    """After a stage was found: keep the forces of laws in it."""
    if kinks is not None:
        for n in range(len(connectors.kinds)):
            kinks.staged[n, stage] = connectors.now[n, 0]


@embedded
def before_kink(kinks, t, stop):  # type: ignore[no-untyped-def]
    """The time that a step from t must not pass: a stop, or one before or behind a bend."""
    if kinks is not None:
        for k in range(2):
            if kinks.stops[k] > t:
                stop = min(stop, kinks.stops[k])
    return stop


@embedded
def crosses(kinks):  # type: ignore[no-untyped-def]
    """Whether the next step is to cross a bend."""
    crossing = False
    if kinks is not None:
        crossing = kinks.stops[0] == -np.inf and kinks.stops[1] > -np.inf
    return crossing


@embedded
def near_kink(kinks):  # type: ignore[no-untyped-def]
    """Whether the next steps are to end before or behind a bend."""
    near = False
    if kinks is not None:
        near = kinks.stops[1] > -np.inf
    return near


@embedded
def pass_kink(kinks, t, h):  # type: ignore[no-untyped-def]
    """After a step of h to t: whether it has crossed a bend."""
    crossed = False
    if kinks is not None:
        for k in range(2):
            if kinks.stops[k] > -np.inf and t >= kinks.stops[k] - CLOSE * h:
                kinks.stops[k], crossed = -np.inf, k == 1
        kinks.crossed[1] = 0.0
        if crossed:
            kinks.crossed[0] += kinks.crossed[2] > SEVERE
            kinks.crossed[2] = 0.0
    return crossed


@embedded
def grown(kinks, t, t_end):  # type: ignore[no-untyped-def]
    """Times the error of a step at t counts, since what it leaves of speeds stays."""
    times = 1.0
    if kinks is not None and kinks.crossed[0] > 0.0:
        times += GROWS * kinks.crossed[0] * (t_end - t) / max(t, EARLY * t_end)
    return times


@embedded
def stop_at_kink(kinks, h, system, control):  # type: ignore[no-untyped-def]
    """After a step of h was refused for a bend: steps end before and behind it. Returns that to come, s.

    Each time that it was refused in vain they end twice as far from the bend. The matrix may be that of another branch.
    The first time that one is severe the run is made again.
    """
    short = h
    if kinks is not None:
        t, t_end = control.progress[0], control.t_end
        system.newton.counts[2] = 1
        kinks.crossed[2] = max(kinks.crossed[2], kinks.place[0, 3])
        if kinks.crossed[2] > SEVERE and control.turns.found[1] and not kinks.known[0]:
            kinks.known[1] = control.turns.found[2] = True
        middle, half = kinks.place[0, 0], kinks.place[0, 1]
        half = max(half * 2.0 ** kinks.crossed[1], LEAST * t_end / h)
        before, behind = middle - half, middle + half
        if before <= AT_ONCE * half:
            before, behind = 0.0, min(behind, 0.5)
        kinks.stops[0] = t + before * h if before > 0.0 else -np.inf
        kinks.stops[1] = t + behind * h
        kinks.crossed[1] += 1.0
        short = (before if before > 0.0 else behind) * h
    return short


@embedded
def missed_at_kinks(kinks, edge, middle, h, to_w, places, q, v, end, system, control):  # type: ignore[no-untyped-def]
    """Error at the end of the run by the bend that makes the largest, relative to what a step may make by one.

    The step of h starts at q and v, and ends with the velocities `end`; its stages are at the `places`, parts of it.
    `kinks.place` tells where the bend is then to be crossed. Infinite, where the step itself is none: a shorter one is
    needed.
    """
    worst = 0.0
    if kinks is not None and control.allowed < np.inf and h > 4.0 * LEAST * control.t_end:
        connectors, t, last = system.loads.connectors, control.progress[0], len(places) - 1
        for n in range(len(connectors.kinds)):
            if connectors.laws[n] != 0:
                _set_path(connectors, n, h, q, v, control.values[0], 0, kinks.path)
                _set_path(connectors, n, h, system.state.q, end, control.values[last], 2, kinks.path)
                impulse = _missed_impulse(connectors.laws[n], t, h, edge, middle, kinks)
                unsolved = _unsolved(connectors, n, t, h, edge, to_w, kinks, system, control)
                if kinks.severe[n] and not unsolved:
                    impulse_astray = edge * h * _strayed(connectors.laws[n], n, t, h, places, kinks)
                    unsolved = _matters(connectors, n, impulse_astray, to_w, system, control)
                if unsolved:
                    worst = np.inf
                elif impulse > 0.0:
                    _push_apart(connectors, n, to_w * impulse * (control.t_end - t), system, control)
                    error = largest_error(control.x, 0.0, False, control) / (CROSSING * control.allowed)
                    kinks.severe[n] = kinks.severe[n] or error > SEVERE
                    if error > worst:
                        worst = error
                        _cross(error, kinks.place)
    return worst


@inlined
def _set_path(connectors, n, h, q, v, values, k, path):  # type: ignore[no-untyped-def]
    """Set two coefficients of the elongation, from k on: its value and h times its rate at one end."""
    m, ax, ay, bx, by = measure(connectors, n, q)
    ux, uy = rate_at(connectors.first, n, v)
    wx, wy = rate_at(connectors.second, n, v)
    free, rate = free_measure(connectors, n, values)
    path[k], path[k + 1] = m - free, h * (ax * ux + ay * uy + bx * wx + by * wy - rate)


@inlined
def _strayed(law, n, t, h, places, kinks):  # type: ignore[no-untyped-def]
    """Force of stages of a step of h from t that there is not on its path, if it is a large part: a contact was passed.

    It may be rounding: the path of what has come to rest has rates of the rounding of positions over h.
    """
    path, largest, astray = kinks.path, 0.0, 0.0
    for i in range(1, len(places) - 1):
        s, there = places[i], kinks.staged[n, i]
        y = 1.0 - s
        x = y * y * ((1.0 + 2.0 * s) * path[0] + s * path[1]) + s * s * (
            (1.0 + 2.0 * y) * path[2] - y * path[3]
        )
        rate = (
            6.0 * s * y * (path[2] - path[0]) + y * (1.0 - 3.0 * s) * path[1] + s * (1.0 - 3.0 * y) * path[3]
        )
        force = call_law(law, x, rate / h, t + s * h)
        largest = max(largest, abs(there), abs(force))
        astray = max(astray, abs(force - there))
    return astray if astray > STRAYED * largest else 0.0


@shared
def _missed_impulse(law, t, h, edge, middle, kinks):  # type: ignore[no-untyped-def]
    """Impulse that a step of h from t misses at the worst bend of a law, N s or N m s; 0 without one.

    The second row of the places tells where it is.
    """
    path, forces, bends, place = kinks.path, kinks.forces, kinks.bends, kinks.place
    x, rate, way = path[0], path[1], path[2] - path[0]
    two, three = 3.0 * way - 2.0 * rate - path[3], rate + path[3] - 2.0 * way
    begin, width, missed, jump = 0.0, 1.0 / POINTS, 0.0, 0.0
    for level in range(LEVELS):
        for j in range(POINTS + 1):
            s = begin + j * width
            along = x + s * (rate + s * (two + s * three))
            forces[j] = call_law(law, along, (rate + s * (2.0 * two + s * 3.0 * three)) / h, t + s * h)
        for j in range(1, POINTS - 1):
            bends[j] = forces[j - 1] - forces[j] - forces[j + 1] + forces[j + 2]
        for j, side in ((0, 1), (POINTS, -1)):
            first = forces[j] - 2.0 * forces[j + side] + forces[j + 2 * side]
            second = forces[j + side] - 2.0 * forces[j + 2 * side] + forces[j + 3 * side]
            bends[min(j, POINTS - 1)] = 3.0 * first - second
        largest, size, worst = 0.0, 0.0, -1
        for j in range(POINTS):
            s = begin + (j + 0.5) * width
            weight = min(middle, edge * min(s, 1.0 - s)) if level == 0 else 1.0
            alone = _alone(j, bends)
            if weight * alone > largest:
                largest, size, worst = weight * alone, alone, j
        if worst < 0:
            break
        if level == 0:
            missed, jump, place[1, 2] = POINTS * h * largest, size, 0.5
        elif level == 1 and size > JUMPS * jump:
            missed, place[1, 2] = min(missed, WHOLE * h * jump), 1.0
        before, behind = max(worst - 1, 0), min(worst + 2, POINTS)
        begin += before * width
        width *= (behind - before) / POINTS
    place[1, 0], place[1, 1] = begin + 0.5 * POINTS * width, 0.5 * POINTS * width
    return missed


@inlined
def _alone(j, bends):  # type: ignore[no-untyped-def]
    """How much a bend is larger than those beside it; 0 unless twice as large. Beyond the ends they go on as lines."""
    size, alone = abs(bends[j]), 0.0
    for apart in range(2, 4):
        left = bends[j - apart] if j >= apart else 3.0 * bends[j + apart] - 2.0 * bends[j + 2 * apart]
        right = bends[j + apart] if j + apart < POINTS else 3.0 * left - 2.0 * bends[j - 2 * apart]
        beside = max(abs(left), abs(right))
        if size > 2.0 * beside:
            alone = max(alone, size - beside)
    return alone


@inlined
def _push_apart(connectors, n, size, system, control):  # type: ignore[no-untyped-def]
    """Put (c_w M + K)⁻¹ times a force of a connector in the place of x."""
    load, x = control.load, control.x
    load[:] = 0.0
    _, ax, ay, bx, by = measure(connectors, n, system.state.q)
    push(connectors.first, n, size * ax, size * ay, load)
    push(connectors.second, n, size * bx, size * by, load)
    sweep(system.factors, load, x)
    correct(system.loads.border, x, system.factors)


@inlined
def _unsolved(connectors, n, t, h, edge, to_w, kinks, system, control):  # type: ignore[no-untyped-def]
    """Whether a step of h from t is none, although Newton's iteration has ended and the estimate is small.

    At a bend corrections may be small because the matrix is wrong: it has another slope of the law than there is at the
    end of the step, by more than the inertia c_w m, or it has misled the last correction. And a stiff contact is damped
    by a long step, or passed by one whose error vanishes by its symmetry: what comes with a speed that matters must
    meet a stiffness below a part of the inertia.
    """
    known, path, unsolved = connectors.tangent[n], kinks.path, False
    x, rate = path[2], path[3] / h
    k, d = slopes(connectors, n, x, rate, t + h)
    found = k + connectors.part[1] * d
    if abs(found - known) > 0.5 * max(abs(found), abs(known)) or (kinks.severe[n] and k > 0.0):
        _push_apart(connectors, n, 1.0, system, control)
        _, ax, ay, bx, by = measure(connectors, n, system.state.q)
        ux, uy = rate_at(connectors.first, n, control.x)
        wx, wy = rate_at(connectors.second, n, control.x)
        opened = ax * ux + ay * uy + bx * wx + by * wy
        inertia = 1.0 / opened - known
        unsolved = abs(found - known) > max(inertia, 0.5 * max(abs(found), abs(known)))
        if kinks.severe[n] and k > RESOLVED * edge * inertia:  # damping is no contact
            way = max(abs(path[1]), abs(path[3])) / h * (control.t_end - t)
            limit = CROSSING * control.allowed
            unsolved = unsolved or way / opened * largest_error(control.x, 0.0, False, control) > limit
    misled = _misled(connectors, n, x, rate, t + h, kinks.severe[n], system.state.q)
    return unsolved or _matters(connectors, n, edge * h * misled, to_w, system, control)


@inlined
def _matters(connectors, n, impulse, to_w, system, control):  # type: ignore[no-untyped-def]
    """Whether an impulse of a connector makes more error until the end of the run than a step may make by a bend."""
    error = 0.0
    if impulse > 0.0:
        _push_apart(connectors, n, to_w * impulse * (control.t_end - control.progress[0]), system, control)
        error = largest_error(control.x, 0.0, False, control)
    return error > CROSSING * control.allowed


@inlined
def _misled(connectors, n, x, rate, t, severe, q):  # type: ignore[no-untyped-def]
    """By how much a force is not that of the last correction, where a step ends at a bend, or there are severe ones.

    Where a force jumps, the last correction may have crossed the jump with the force of the other side.
    """
    wrong = 0.0
    if severe or bends_at(connectors, n, x, rate, t):
        m, _, _, _, _ = measure(connectors, n, q)
        force, now = call_law(connectors.laws[n], x, rate, t), connectors.now
        wrong = abs(force - now[n, 0] - connectors.tangent[n] * (m - now[n, 1]))
    return wrong


@inlined
def _cross(error, place):  # type: ignore[no-untyped-def]
    """Take the place of the law looked at for that to be crossed, by a step that may miss so much there."""
    place[0, 0], place[0, 3] = place[1, 0], error
    place[0, 1] = max(place[1, 1], min(0.25, 0.5 * (AIMED / error) ** place[1, 2]))
