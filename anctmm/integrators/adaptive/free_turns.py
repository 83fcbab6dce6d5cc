"""Bodies that turn freely many times: what an error of a step makes of their angle until the end, for step control.

Where nothing holds the direction of a body, nothing brings its speed back: an error of the speed stays, and that of the
angle grows with the time left. Two things make it. What Newton's iteration leaves of a position, x, is an error x/h of
the speed of a step of h, of one sign over many steps, and so x (T − t)/h of the position at the end: a bar at a pin
missed by up to 11 times the tolerance after 4 turns, by 43 times after 16, by steps of fourth order, a free bar by 28
times after 4, a slider-crank by 35 times after 16, by generalized-α. And a step takes a part of the speed. By that
alone steps of fourth order missed by 0.5, 0.9 and 2.6 times the tolerance after 4, 16 and 64 turns, and by 5 and 7
times after 4 and 16 turns of a bar that a torque turns from rest; of generalized-α it is less than its estimate by far.
So where a body turns freely, the iteration leaves the less, the more steps are to come (`step_control.left_by_newton`),
and errors of fourth order at its nodes count 1 + 0.3 ω (T − t) times. That leaves at most 0.3 times the tolerance where
bars turn steadily, 1.1 of slider-cranks, and 2.8 of what a torque turns from rest. Sixteen turns cost 2.1 to 2.3 times
what they did by steps of fourth order, 1.1 to 1.6 times by generalized-α.

Elastic bodies that spin lose more. At the start nothing is stretched, and the first step, of an angle θ, takes θ²/2 of
the speed: generalized-α missed by 30 to 680 times the tolerance on stiff bars, or diverged. So that step is short
(`controlled_run.START_PART`). Each step of fourth order takes 0.0045 θ⁴ of it, where its estimate is 0.0007 θ⁵: they
missed by up to 17 times, and what they take is counted (`turn_error`). And what the iteration leaves of a stiff length
does not alternate (`step_control.ELASTIC_PART`). Stiff bars, pinned and free, damped and not, have 0.002 to 0.9 times
the tolerance after 4 and 16 turns, 1e-2 … 1e-4; without damping their vibrations take many steps.

Elastic bodies that swing lose that part of their speed, too, and what swings wide takes another time for it. Pendulums
of one damped beam, 5e7 … 2e11 Pa, which takes a few steps to follow a stretch, missed 1e-4 and 1e-5 by up to 15 times
the tolerance, where the estimate falls by an order more than the error. So that is counted for every elastic body whose
direction nothing holds and that nothing drives (`swing_error`): at most 3 times then but for one of 40 runs (4.6), for
1.2 to 2 times the steps at 1e-5, and none more on the scenes of the suite.

That is known of a body when it has made 0.6 of a turn, net, and will make a whole one at its mean speed until then. The
run is made again from the start: the steps until then were few. Bodies that go to and fro have the steps that they had.
Those that turn steadily less than 1.6 times are not found, and missed by up to 5.6 times the tolerance, nor those that
a torque turns from rest less than 4 times, by up to 12 times.
What drives, clamps and guides hold the direction of, does not turn freely, nor does what turns as that does, to within
that part of a turn, in its sense or against it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import inlined, uncompiled
from anctmm.model.topology import GROUND, Sets, held_directions

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: A turn, rad.
TURN = 2.0 * np.pi
#: Net turn that shows a body to turn freely, more than a pendulum swings; what it must then have left to turn, at its
#: mean speed; and the net turn at which others are taken for such bodies then, so that few runs are made again.
#: Andrews' squeezer, which a torque turns 2.5 times from rest, never has so much left: its errors have other causes,
#: and it cost 1.6 times as much for nearly the same error.
SEEN, LEFT, FORESEEN = 0.6 * TURN, TURN, 0.25 * TURN
#: Part of the angle left to turn by which a relative error of a step grows.
GROWS = 0.3
#: Turn of a body in a step, rad, that counts as all of the error allowed in it: a step that takes a body along a chord
#: may have an estimate of 0.
ONCE = 1.0
#: Part of its speed, over the fourth power of its turn in a step, that an elastic body loses which swings: a third more
#: than 0.0045, as its speed is not the same all the time.
SWUNG = 0.006
#: Runs that are made again for bodies found to turn freely, at most.
ANEW = 4


@by_address
class Turns(NamedTuple):
    """Turns of the bodies that have a direction, and what they make of errors.

    nodes: of each the node that tells its turn, the row of the vector that turns, its first node, and the one behind
    its last, (bodies, 4). start: that vector at the start, (bodies, 2). held: whether joints and drives hold its
    direction, (bodies,). angles: net turn, rad, (bodies,). rates: mean speed in the run before, rad/s, 0 of bodies that
    are not known to turn freely, (bodies,). growth: of errors at each node until the end, (nodes,). found: whether
    bodies are known to turn freely, whether others are looked for, and whether one was found, (3,). elastic: whether
    anything is elastic.
    """

    nodes: Ints
    start: Array
    held: NDArray[np.bool_]
    angles: Array
    rates: Array
    growth: Array
    found: NDArray[np.bool_]
    elastic: bool


def new_turns(chain: Chain) -> Turns:
    """Turns of the bodies of a scene, none of them known to turn freely."""
    bodies, q, directions = chain.bodies, chain.start_coordinates(), Sets[str | None]()
    for _, by, place in held_directions(chain.parts):
        directions.unite(by.body.name if by else GROUND, place.body.name)
    ground = directions.of(GROUND)
    table, start, held, first = [], [], [], 0
    for step, mesh in zip(chain.plan.steps, bodies.meshes, strict=True):
        row, end = mesh.turning_row, first + mesh.nodes
        if q[row : row + 2, first].any():  # a point mass has no direction
            table.append((first, row, first, end))
            start.append(q[row : row + 2, first])
            held.append(directions.of(step.body) == ground)
        first = end
    return Turns(
        np.array(table, dtype=np.int64).reshape(-1, 4),
        np.array(start).reshape(-1, 2),
        np.array(held, dtype=np.bool_),
        np.zeros(len(table)),
        np.zeros(len(table)),
        np.ones(bodies.nodes),
        np.zeros(3, dtype=np.bool_),
        any(body.name not in chain.rigid for body in chain.parts.beams),
    )


def begin_turns(turns: Turns, look: bool, t_end: float) -> None:
    """Start a run; whether bodies that are not known to turn freely are looked for."""
    turns.angles[:] = 0.0
    turns.found[:] = turns.rates.any(), look, False
    uncompiled(_grow)(0.0, t_end, turns)


def know_turns(turns: Turns, t: float, t_end: float) -> None:
    """After a run that was ended at t: which bodies turn freely, and how fast."""
    for b, angle in enumerate(np.abs(turns.angles)):
        turning = angle * (t_end - t) >= LEFT * t and uncompiled(_turns_freely)(b, FORESEEN, turns)
        if turns.rates[b] == 0.0 and turning:
            turns.rates[b] = angle / t


@inlined
def follow_turns(q, t, t_end, turns):  # type: ignore[no-untyped-def]
    """After a step to t: bring net turns up to date, and what errors grow; see whether a body is found."""
    for b in range(turns.nodes.shape[0]):
        i, row = turns.nodes[b, 0], turns.nodes[b, 1]
        x, y, u, v = turns.start[b, 0], turns.start[b, 1], q[row, i], q[row + 1, i]
        angle = np.arctan2(x * v - y * u, x * u + y * v)
        turns.angles[b] = angle + TURN * np.rint((turns.angles[b] - angle) / TURN)
    if turns.found[1]:
        for b in range(turns.nodes.shape[0]):
            size = abs(turns.angles[b])
            if size >= SEEN and turns.rates[b] == 0.0 and size * (t_end - t) >= LEFT * t:
                turns.found[2] = turns.found[2] or _turns_freely(b, SEEN, turns)
    if turns.found[0]:
        _grow(t, t_end, turns)


@inlined
def _turns_freely(b, least, turns):  # type: ignore[no-untyped-def]
    """Whether a body has turned by so much, rad, and beside all whose direction is held."""
    free = not turns.held[b] and abs(turns.angles[b]) >= least
    if free:
        for n in range(turns.nodes.shape[0]):
            beside = abs(abs(turns.angles[b]) - abs(turns.angles[n]))
            free = free and (not turns.held[n] or beside >= least)
    return free


@inlined
def _grow(t, t_end, turns):  # type: ignore[no-untyped-def]
    """Find what errors of a step at t grow until the end.

    Until it is seen to turn, a body has its mean speed of the run before; then that since the start.
    """
    for b in range(turns.nodes.shape[0]):
        if turns.rates[b] > 0.0:
            rate = turns.rates[b] if turns.rates[b] * t < SEEN else abs(turns.angles[b]) / t
            for i in range(turns.nodes[b, 2], turns.nodes[b, 3]):
                turns.growth[i] = 1.0 + GROWS * rate * (t_end - t)


@inlined
def turn_error(q_before, q, order, lost, t, allowed, control):  # type: ignore[no-untyped-def]
    """Error of a step to t, relative, that no estimate by its ends sees: the largest of the bodies, by what they turn.

    A body that turns by ONCE makes all of the error allowed in the step. `lost`: part of its speed, over the fourth
    power of the turn, that a body loses which turns freely, where anything is elastic.
    """
    turns, largest = control.turns, 0.0
    for b in range(turns.nodes.shape[0]):
        angle = _turned(b, q_before, q, turns)
        largest = max(largest, allowed * (angle / ONCE) ** order)
        if turns.elastic and turns.rates[b] > 0.0:
            largest = max(largest, lost * angle**4 * turns.rates[b] * (control.t_end - t))
    return largest


@inlined
def swing_error(h, q_before, q, t, control):  # type: ignore[no-untyped-def]
    """Error of a step of h to t, relative, by the speed that elastic bodies lose which nothing holds or drives."""
    turns, largest = control.turns, 0.0
    if turns.elastic and not control.restrained and control.angles.shape[1] == 0:
        for b in range(turns.nodes.shape[0]):
            if not turns.held[b] and turns.rates[b] == 0.0:
                angle = _turned(b, q_before, q, turns)
                grows = 1.0 + GROWS * angle / h * (control.t_end - t)
                largest = max(largest, SWUNG * angle**4 * grows)
    return largest


@inlined
def _turned(b, q_before, q, turns):  # type: ignore[no-untyped-def]
    """Angle by which a body has turned in a step, rad."""
    i, row = turns.nodes[b, 0], turns.nodes[b, 1]
    x, y, u, v = q_before[row, i], q_before[row + 1, i], q[row, i], q[row + 1, i]
    return abs(np.arctan2(x * v - y * u, x * u + y * v))
