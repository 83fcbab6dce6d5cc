"""Loads, drives and connectors for steps of any length: values at any time, ends of steps, and what a step misses."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.junctions.constraints import Drive
from anctmm.forces.connectors import free_of
from anctmm.forces.histories import (
    JUMP,
    Calendar,
    Pieces,
    Represented,
    check_drive,
    constant,
    piece_at,
    pieces_of,
    represent,
    value_at,
)
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import inlined
from anctmm.model.connectors import Connector, free_name, name_of
from anctmm.model.loads import load_text, width_of
from anctmm.model.scene import Load

Array = NDArray[np.float64]

#: Gauss's rule of five points on [0, 1].
_POINTS, _WEIGHTS = (tuple(map(float, row)) for row in np.polynomial.legendre.leggauss(5))
POINTS, WEIGHTS = tuple(0.5 + 0.5 * x for x in _POINTS), tuple(0.5 * w for w in _WEIGHTS)


@by_address
class Timeline(NamedTuple):
    """What acts in time, for kernels.

    Parameters
    ----------
    pieces : Pieces
        Of the drives, and then of the loads.
    stops : ndarray, shape (k,)
        Times at which steps must end beside the outputs, ascending, and one after the run, s.
    anew : ndarray of bool, shape (k,)
        Whether the motion restarts there, because a load or the acceleration of a drive jumps.
    """

    pieces: Pieces
    stops: Array
    anew: NDArray[np.bool_]


def timeline(
    drives: Sequence[Drive],
    loads: Sequence[Load],
    connectors: Sequence[Connector],
    t_end: float,
    outputs: Array,
) -> Timeline:
    """What acts from 0 to t_end.

    Parameters
    ----------
    drives : sequence of Drive
        Of driven clamps, and of constraints.
    loads : sequence of Force, Torque, LineLoad
        Those whose generalized force varies.
    connectors : sequence of Spring, RotationalSpring
        Those whose free length or angle is driven.
    t_end : float
        s.
    outputs : ndarray
        Times of the outputs from 0 to `t_end`, s, at which steps end too.

    Raises
    ------
    PropertyError
        If a history cannot be followed, or a drive jumps.
    """
    calendar, found = Calendar(t_end, outputs), []
    for drive in drives:
        found.append(represent(drive.name, drive.history, 3, calendar))
        check_drive(drive.name, found[-1])
    found += [_of_load(load, calendar) for load in loads]
    for connector in connectors:
        name = f"{name_of(connector)} {free_name(connector)}"
        found.append(represent(name, free_of(connector), 2, calendar))
    jumps = [history.breaks[(history.jumps() > JUMP).any(axis=1)] for history in found]
    anew = np.unique(np.concatenate([np.empty(0), *jumps]))
    # those at outputs too, which the calendar does not list: steps of fourth order pass outputs
    stops = np.unique(np.concatenate([*(history.breaks for history in found), anew, [np.inf]]))
    return Timeline(pieces_of(found), stops, np.isin(stops, anew))


def _of_load(load: Load, calendar: Calendar) -> Represented:
    width = width_of(load)
    if not callable(load.value):
        return constant(np.full(width, load.value, dtype=float), calendar.t_end)
    name = load_text(load)
    return represent(name, load.value, width, calendar)


@inlined
def set_actions(pieces, t, after, angles, values):  # type: ignore[no-untyped-def]
    """Angles, rates and accelerations of drives, (drives, 3), and values of loads and driven connectors, (n, 2), at t.

    Where a history jumps: the values before the jump or, if `after`, those after it. Further rows of `values` hold the
    time.
    """
    for h in range(len(angles)):
        piece = piece_at(pieces, h, t, after)
        for k in range(3):
            angles[h, k] = value_at(pieces, piece, k, t)
    histories = len(pieces.steady) - len(angles)
    for n in range(histories):
        piece = piece_at(pieces, len(angles) + n, t, after)
        for k in range(2):
            values[n, k] = value_at(pieces, piece, k, t)
    for n in range(histories, len(values)):
        values[n, 0] = t


@inlined
def missed_impulse(together, pieces, history, t, h, places, rows, values, n, found):  # type: ignore[no-untyped-def]
    """∫|f − what a step sees of it| dt of both values of a history from t to t + h, N s or N m s, in `found`.

    A step sees the polynomial through the values at its `places`, parts of its length: those in the `rows` of `values`,
    (rows, histories, 2), this history the n-th. With `together` they are those of a vector, a force: then its size is
    integrated, which no axes change, and 0 is the second number.
    """
    found[0] = found[1] = 0.0
    if pieces.steady[history]:
        return
    last, piece, a = pieces.first[history + 1] - 1, piece_at(pieces, history, t, True), t
    while True:
        b = t + h if piece == last else min(pieces.edges[1, piece], t + h)
        for g in range(5):
            time, part = a + POINTS[g] * (b - a), WEIGHTS[g] * (b - a)
            first, second = value_at(pieces, piece, 0, time), value_at(pieces, piece, 1, time)
            for i in range(len(places)):
                weight = _share((time - t) / h, i, places)
                first -= weight * values[rows[i], n, 0]
                second -= weight * values[rows[i], n, 1]
            if together:
                found[0] += part * np.sqrt(first * first + second * second)
            else:
                found[0] += part * abs(first)
                found[1] += part * abs(second)
        if piece == last or b >= t + h:
            break
        a, piece = b, piece + 1


@inlined
def _share(x, i, places):  # type: ignore[no-untyped-def]
    """Lagrange's polynomial of the i-th place at x."""
    share = 1.0
    for j in range(len(places)):
        if j != i:
            share *= (x - places[j]) / (places[i] - places[j])
    return share


@inlined
def missed_turn(curved, pieces, history, t, h, start, end):  # type: ignore[no-untyped-def]
    """Mean distance of a drive's angle from what a step sees of it, from t to t + h, rad.

    That is the cubic of its angles and rates at t and t + h, or, if `curved`, the quintic of its accelerations, too.
    """
    total, last = 0.0, pieces.first[history + 1] - 1
    piece, a = piece_at(pieces, history, t, True), t
    while True:
        b = t + h if piece == last else min(pieces.edges[1, piece], t + h)
        for g in range(5):
            time = a + POINTS[g] * (b - a)
            off = value_at(pieces, piece, 0, time) - _hermite(curved, (time - t) / h, h, start, end)
            total += WEIGHTS[g] * (b - a) * abs(off)
        if piece == last or b >= t + h:
            break
        a, piece = b, piece + 1
    return total / h


@inlined
def _hermite(curved, x, h, start, end):  # type: ignore[no-untyped-def]
    """Polynomial of angles and rates at 0 and 1, and of accelerations if `curved`, at x."""
    y = 1.0 - x
    if curved:
        early = (1.0 + 3.0 * x + 6.0 * x * x) * start[0] + x * (1.0 + 3.0 * x) * h * start[1]
        late = (1.0 + 3.0 * y + 6.0 * y * y) * end[0] - y * (1.0 + 3.0 * y) * h * end[1]
        early += 0.5 * x * x * h * h * start[2]
        late += 0.5 * y * y * h * h * end[2]
        return y * y * y * early + x * x * x * late
    cubic = y * y * (1.0 + 2.0 * x) * start[0] + x * x * (1.0 + 2.0 * y) * end[0]
    return cubic + h * x * y * (y * start[1] - x * end[1])
