"""Springs, dampers and laws between two vectors of the coordinates: their forces, energy and work.

A connector has a measure m: of a spring the length of b − a, of a rotational spring the angle from a to b, continuous.
With its gradients G_a, G_b the force N(m, ṁ, t) acts on a as −N G_a and on b as −N G_b. N is
k (m − l) + c (ṁ − l̇) + preload, or the value of a law.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.junctions.as_written import as_written
from anctmm.discretise.maps import Map, Maps, direction_of, maps, position_of, push, rate_at, vector_at
from anctmm.errors import unknown_kind
from anctmm.forces.laws import address_of, call_law
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined, merged, uncompiled
from anctmm.jit.copies import writes
from anctmm.model.connectors import CONNECTORS, Connector, RotationalSpring, Spring, ends_of, name_of
from anctmm.model.places import Place
from anctmm.model.scene import Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SPRING, TURN = 0, 1
#: Relative change of a law's arguments by which it is differentiated: a central difference.
DIFFERENCE = 1e-5
#: Second difference, of the first one, that shows a law to bend or jump there, also difference of two slopes; what that
#: changes the arguments by in steps.
BENDS, NEARER = 0.1, 1e-4
#: Relative difference of slopes that agree; what distances shrink by, and how often at most; distance, of the argument,
#: that rounding still resolves.
AGREE, CLOSER, SHRUNK, RESOLVED = 1e-8, 0.25, 16, 1e-11


@writes("now", "memory", "v", "part", "tangent")
@by_address
class Connectors(NamedTuple):
    """Connectors for kernels.

    Parameters
    ----------
    kinds : ndarray of int, shape (n,)
        SPRING or TURN.
    laws : ndarray of int, shape (n,)
        Addresses of compiled laws, or 0.
    numbers : ndarray, shape (n, 4)
        Stiffness, damping, preload and free measure of each.
    lossy : ndarray of bool, shape (n,)
        Whether the force depends on the rate.
    driven : ndarray of int, shape (n,)
        Row of the values in which its free measure and the rate of that stand, or −1.
    first, second : Maps
        a and b; the ground is a constant.
    placed : ndarray, shape (n,)
        Measure in the reference; angles are counted from there.
    unit : ndarray, shape (n,)
        Size of a measure, m or rad.
    now, memory : ndarray, shape (n, 8)
        Force, measure and energy at the last evaluation, and at the last call of `connectors_work`; the gradient of the
        measure by b, and the rate of the measure where the force depends on it. In `memory` the part of the force that
        changes its sign with the rate stands in the place of the rate; then the part that changes its sign with the
        rate of the elongation, which resists, and the elongation.
    v : ndarray, shape (rows, nodes)
        Scratch: velocities at the end of an implicit step, where connectors act.
    part : ndarray, shape (3,)
        Part of preloads and of free measures less those placed, that acts: 1 but in statics. Weight of damping in the
        matrix of an implicit step, relative to stiffness, 1/s. Whether slopes of laws are those of statics and modes, 1
        or 0: steps through a contact take fewer corrections with slopes over a distance.
    tangent : ndarray, shape (n,)
        Stiffness along the measure in the last matrix of a step, damping included.
    """

    kinds: Ints
    laws: Ints
    numbers: Array
    lossy: NDArray[np.bool_]
    driven: Ints
    first: Maps
    second: Maps
    placed: Array
    unit: Array
    now: Array
    memory: Array
    v: Array
    part: Array
    tangent: Array


def driven_connectors(scene: Scene) -> list[Connector]:
    """Connectors whose free length or angle is a function of time."""
    return [connector for connector in scene.connectors if callable(free_of(connector))]


def has_clock(scene: Scene) -> bool:
    """Whether the time is needed: only by laws."""
    return any(connector.law is not None for connector in scene.connectors)


def free_of(connector: Connector):  # type: ignore[no-untyped-def]
    """Free length or angle as it is given."""
    match connector:
        case Spring():
            return connector.length
        case RotationalSpring():
            return connector.angle
        case _:
            raise unknown_kind("connector", connector, CONNECTORS)


def vectors_of(scene: Scene, bodies: Bodies, connector: Connector) -> tuple[Map, Map]:
    """a and b of a connector."""
    first, second = ends_of(scene, connector)
    match connector:
        case Spring():
            end = (
                position_of(bodies, second)
                if isinstance(second, Place)
                else Map(constant=second or (0.0, 0.0))
            )
            return position_of(bodies, first), end
        case RotationalSpring():
            turning = direction_of(bodies, first)
            if second is None:
                return Map(constant=(1.0, 0.0)), turning
            assert isinstance(second, Place)  # a rotational spring has no point of the ground
            return turning, direction_of(bodies, second)
        case _:
            raise unknown_kind("connector", connector, CONNECTORS)


def connectors_of(scene: Scene, bodies: Bodies, loads: int) -> Connectors | None:
    """Connectors of a scene for kernels; None where there are none: then nothing of them is compiled.

    Parameters
    ----------
    scene : Scene
    bodies : Bodies
    loads : int
        Rows of the values before those of driven connectors.
    """
    things: Sequence[Connector] = scene.connectors
    if not things:
        return None
    n, q = len(things), bodies.reference()
    ends = [vectors_of(scene, bodies, thing) for thing in things]
    kinds = np.array([SPRING if isinstance(thing, Spring) else TURN for thing in things], dtype=np.int64)
    first, second = maps([a for a, _ in ends]), maps([b for _, b in ends])
    placed = np.zeros(n)
    for i in range(n):
        a, b = _vector(first, i, q), _vector(second, i, q)
        placed[i] = np.hypot(*(b - a)) if kinds[i] == SPRING else np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)
    unit = np.where((kinds == SPRING) & (placed > 0.0), placed, 1.0)
    driven, numbers = np.full(n, -1, dtype=np.int64), np.zeros((n, 4))
    for i, thing in enumerate(things):
        free = free_of(thing)
        numbers[i] = thing.stiffness, thing.damping, thing.preload, 0.0
        if callable(free):
            driven[i] = loads + int((driven >= 0).sum())
        else:
            numbers[i, 3] = placed[i] if free is None else free
    laws = np.array(
        [
            0 if t.law is None else address_of(name_of(as_written(scene, t)), t.law, float(u))
            for t, u in zip(things, unit, strict=True)
        ],
        dtype=np.int64,
    )
    memory = np.zeros((n, 8))
    memory[:, 1] = np.where(kinds == SPRING, placed, 0.0)
    lossy = (laws != 0) | (numbers[:, 1] != 0.0)
    return Connectors(
        kinds, laws, numbers, lossy, driven, first, second, placed, unit, memory.copy(), memory, np.zeros_like(q),
        np.array([1.0, 0.0, 0.0]), np.zeros(n),
    )  # fmt: skip


def _vector(maps: Maps, n: int, q: Array) -> Array:
    terms = slice(maps.start[n], maps.start[n + 1])
    g = np.stack([q[maps.row[terms], maps.node[terms]], q[maps.row[terms] + 1, maps.node[terms]]])
    turned = np.stack([-g[1], g[0]])
    return maps.constant[n] + g @ maps.a[terms] + turned @ maps.b[terms]  # type: ignore[no-any-return]


@embedded
def measure(c, n, q):  # type: ignore[no-untyped-def]
    """Measure m of a connector and its gradients by a and b; an angle is that nearest to the last one accepted."""
    ax, ay = vector_at(c.first, n, q)
    bx, by = vector_at(c.second, n, q)
    if c.kinds[n] == SPRING:
        x, y = bx - ax, by - ay
        m = np.sqrt(x * x + y * y)
        x, y = x / max(m, 1e-300), y / max(m, 1e-300)
        return m, -x, -y, x, y
    aa, bb = ax * ax + ay * ay, bx * bx + by * by
    m = np.arctan2(ax * by - ay * bx, ax * bx + ay * by) - c.placed[n]
    m += 2.0 * np.pi * np.round((c.memory[n, 1] - m) / (2.0 * np.pi))
    return m, ay / aa, -ax / aa, -by / bb, bx / bb


def count_turns(connectors: Connectors | None, q: Array, turned: Array) -> None:
    """Take the measures at coordinates q for the last ones accepted.

    Parameters
    ----------
    connectors : Connectors or None
    q : ndarray, shape (rows, nodes)
    turned : ndarray, shape (nodes,)
        Angles by which the nodes' sections have turned since the reference, rad: they tell whole turns.
    """
    if connectors is not None:
        for n in range(len(connectors.kinds)):
            a, b = (
                turned[ends.node[ends.start[n]]] if ends.start[n] < ends.start[n + 1] else 0.0
                for ends in (connectors.first, connectors.second)
            )
            connectors.memory[n, 1] = b - a
            connectors.memory[n, 1] = uncompiled(measure)(connectors, n, q)[0]


@embedded
def free_measure(c, n, values):  # type: ignore[no-untyped-def]
    """Free measure of a connector and its rate."""
    free, rate = c.numbers[n, 3], 0.0
    if c.driven[n] >= 0:
        free, rate = values[c.driven[n], 0], values[c.driven[n], 1]
    if c.part[0] != 1.0:
        placed = c.placed[n] if c.kinds[n] == SPRING else 0.0
        free = placed + c.part[0] * (free - placed)
    return free, rate


@embedded
def time_of(values):  # type: ignore[no-untyped-def]
    """The time, which only laws need: the last row of the values."""
    return values[len(values) - 1, 0] if len(values) > 0 else 0.0


@embedded
def force_of(c, n, x, rate, t):  # type: ignore[no-untyped-def]
    """Force N of a connector at an elongation x and its rate."""
    if c.laws[n] == 0:
        return c.numbers[n, 0] * x + c.numbers[n, 1] * rate + c.part[0] * c.numbers[n, 2]
    if c.part[0] == 1.0:
        return call_law(c.laws[n], x, rate, t)
    return call_law(c.laws[n], x, rate, t) - (1.0 - c.part[0]) * call_law(c.laws[n], 0.0, 0.0, t)


@embedded
def stored(c, n, x):  # type: ignore[no-untyped-def]
    """Energy of a connector at an elongation x; none of a law."""
    return 0.5 * c.numbers[n, 0] * x * x + c.part[0] * c.numbers[n, 2] * x


@embedded
def slopes(c, n, x, rate, t):  # type: ignore[no-untyped-def]
    """Derivatives of N by elongation and rate."""
    if c.laws[n] == 0:
        return c.numbers[n, 0], c.numbers[n, 1]
    h, g = DIFFERENCE * max(abs(x), c.unit[n]), DIFFERENCE * max(abs(rate), c.unit[n])
    if c.part[2] == 0.0:
        return _quick_slope(c.laws[n], x, rate, t, h, 0.0), _quick_slope(c.laws[n], x, rate, t, 0.0, g)
    return _slope_of_law(c.laws[n], x, rate, t, h, 0.0), _slope_of_law(c.laws[n], x, rate, t, 0.0, g)


@inlined
def _quick_slope(law, x, rate, t, h, g):  # type: ignore[no-untyped-def]
    """Derivative of a law by its elongation, between places h from x, or by its rate; where it bends, from closer ones.

    The other of the two distances is 0.
    """
    here, slope = call_law(law, x, rate, t), 0.0
    for _ in range(2):
        less, more = call_law(law, x - h, rate - g, t), call_law(law, x + h, rate + g, t)
        slope = (more - less) / (2.0 * (h + g))
        if abs(less - 2.0 * here + more) <= BENDS * abs(more - less):
            break
        h, g = NEARER * h, NEARER * g
    return slope


@inlined
def _slope_of_law(law, x, rate, t, h, g):  # type: ignore[no-untyped-def]
    """Derivative of a law by its elongation, between places h from x, or by its rate, between rates g from it.

    The other of the two distances is 0. Where the difference from closer places is another one the law bends within the
    distance, which shrinks until both agree or rounding keeps them apart. A law that jumps, or is as a power above 1,
    has no distance at which they agree: of the first and last slope the smaller one is taken.
    """
    slope = _difference(law, x, rate, t, h, g)
    finer = _difference(law, x, rate, t, CLOSER * h, CLOSER * g)
    first, apart = slope, abs(finer - slope)
    if apart <= AGREE * abs(slope):
        return slope
    least = RESOLVED * (abs(x) if h > 0.0 else abs(rate))
    for _ in range(SHRUNK):
        h, g, slope, before = CLOSER * h, CLOSER * g, finer, apart
        if CLOSER * (h + g) < least:
            break
        finer = _difference(law, x, rate, t, CLOSER * h, CLOSER * g)
        apart = abs(finer - slope)
        if apart <= AGREE * abs(finer):
            return finer
        if apart < BENDS * abs(finer) and apart > 0.5 * before:
            return slope
    return first if abs(first) < abs(finer) else finer


@inlined
def _difference(law, x, rate, t, h, g):  # type: ignore[no-untyped-def]
    """Central difference of a law."""
    return (call_law(law, x + h, rate + g, t) - call_law(law, x - h, rate - g, t)) / (2.0 * (h + g))


@embedded
def bends_at(c, n, x, rate, t):  # type: ignore[no-untyped-def]
    """Whether a law bends or jumps near an elongation x."""
    h = DIFFERENCE * max(abs(x), c.unit[n])
    less, more = call_law(c.laws[n], x - h, rate, t), call_law(c.laws[n], x + h, rate, t)
    return abs(less - 2.0 * call_law(c.laws[n], x, rate, t) + more) > BENDS * abs(more - less)


@merged
def add_connectors(connectors, q, v, values, f):  # type: ignore[no-untyped-def]
    """Add the forces of connectors at q and v to f, (rows, nodes); what they are is kept in `now`."""
    if connectors is not None:
        t = time_of(values)
        for n in range(len(connectors.kinds)):
            m, ax, ay, bx, by = measure(connectors, n, q)
            free, rate = free_measure(connectors, n, values)
            x, change = m - free, 0.0
            if connectors.lossy[n]:
                ux, uy = rate_at(connectors.first, n, v)
                wx, wy = rate_at(connectors.second, n, v)
                change = ax * ux + ay * uy + bx * wx + by * wy
            force = force_of(connectors, n, x, change - rate, t)
            push(connectors.first, n, -force * ax, -force * ay, f)
            push(connectors.second, n, -force * bx, -force * by, f)
            connectors.now[n, 0], connectors.now[n, 1] = force, m
            connectors.now[n, 2] = stored(connectors, n, x)
            connectors.now[n, 3], connectors.now[n, 4], connectors.now[n, 5] = bx, by, change


@merged
def add_connectors_at_end(connectors, q, values, f):  # type: ignore[no-untyped-def]
    """The same at the velocities of `end_velocities`."""
    if connectors is not None:
        add_connectors(connectors, q, connectors.v, values, f)


@merged
def connectors_work(connectors, moving, values):  # type: ignore[no-untyped-def]
    """Work of connectors since the last call that is not their energy, and that of what resists, J; 0 unless `moving`.

    What was evaluated last is accepted: forces by the trapezoidal rule, less what energy has grown. A spring whose
    direction turns by more than a right angle in a step has passed its length 0 or a small one, which the change of its
    length does not show: the mean of two forces that oppose the rate would be about 0. The part of the force that
    changes its sign with the rate does work on the displacement then.
    """
    work, lost = 0.0, 0.0
    if connectors is not None:
        now, memory, t = connectors.now, connectors.memory, time_of(values)
        for n in range(len(connectors.kinds)):
            odd, resists, x = 0.0, 0.0, 0.0
            if connectors.lossy[n]:
                free, rate = free_measure(connectors, n, values)
                x = now[n, 1] - free
                resists = 0.5 * (now[n, 0] - force_of(connectors, n, x, rate - now[n, 5], t))
                odd = resists
                if rate != 0.0:
                    odd = 0.5 * (now[n, 0] - force_of(connectors, n, x, -now[n, 5] - rate, t))
                turned = now[n, 3] * memory[n, 3] + now[n, 4] * memory[n, 4]
                if moving and connectors.kinds[n] == SPRING and turned < 0.0:
                    passed = 0.5 * (1.0 - turned) * (memory[n, 5] * now[n, 1] - odd * memory[n, 1])
                    work, lost = work + passed, lost + passed
            if moving:
                work -= 0.5 * (now[n, 0] + memory[n, 0]) * (now[n, 1] - memory[n, 1])
                work += now[n, 2] - memory[n, 2]
                lost -= 0.5 * (resists + memory[n, 6]) * (x - memory[n, 7])
            for k in range(5):
                memory[n, k] = now[n, k]
            memory[n, 5], memory[n, 6], memory[n, 7] = odd, resists, x
    return work, lost


@embedded
def connectors_power(connectors, q, v, values):  # type: ignore[no-untyped-def]
    """Power of connectors beside the rate of their energy, and that of what resists, W, at q and v, which are accepted.

    With x = m − l: −N ṁ + dE/dt, where dE/dt = (k x + preload) ẋ; and −½ [N(x, ẋ) − N(x, −ẋ)] ẋ.
    """
    power, lost = 0.0, 0.0
    if connectors is not None:
        t = time_of(values)
        for n in range(len(connectors.kinds)):
            m, ax, ay, bx, by = measure(connectors, n, q)
            ux, uy = rate_at(connectors.first, n, v)
            wx, wy = rate_at(connectors.second, n, v)
            free, rate = free_measure(connectors, n, values)
            turn = ax * ux + ay * uy + bx * wx + by * wy
            kept = connectors.numbers[n, 0] * (m - free) + connectors.part[0] * connectors.numbers[n, 2]
            force = force_of(connectors, n, m - free, turn - rate, t)
            power += kept * (turn - rate) - force * turn
            if connectors.lossy[n]:
                resists = 0.5 * (force - force_of(connectors, n, m - free, rate - turn, t))
                lost -= resists * (turn - rate)
            connectors.memory[n, 1] = m
    return power, lost


@merged
def connectors_energy(connectors):  # type: ignore[no-untyped-def]
    """Energy of all connectors at the last evaluation, J."""
    total = 0.0
    if connectors is not None:
        for n in range(len(connectors.kinds)):
            total += connectors.now[n, 2]
    return total


@embedded
def end_velocities(connectors, v, a, w, w_before, c):  # type: ignore[no-untyped-def]
    """Velocities at the end of an implicit step where connectors act, from w there, as in `implicit.step.finish`.

    v, a, w and w_before: (rows, nodes); v and a of the start of the step.
    """
    if connectors is not None:
        for n in range(len(connectors.kinds)):
            if connectors.lossy[n]:
                r = 1.0 / (1.0 - c.alpha_m)
                now, then, old = (1.0 - c.alpha_f) * r, c.alpha_f * r, c.alpha_m * r
                connectors.part[1] = c.gamma / (c.beta * c.h) if c.h > 0.0 else 0.0
                for side in range(2):
                    table = connectors.first if side == 0 else connectors.second
                    for k in range(table.start[n], table.start[n + 1]):
                        i = table.node[k]
                        for row in range(table.row[k], table.row[k] + 2):
                            new = now * w[row, i] + then * w_before[row, i] - old * a[row, i]
                            mean = (1.0 - c.gamma) * a[row, i] + c.gamma * new
                            connectors.v[row, i] = v[row, i] + c.h * mean
