"""What acts on a scene, for steps of any length: values at any time, where steps end, and what a step misses."""

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
from anctmm.jit.compiling import inlined
from anctmm.model.connectors import Connector, free_name, name_of
from anctmm.model.loads import load_text, width_of
from anctmm.model.scene import Load

Array = NDArray[np.float64]

#: Gauss's rule of five points on [0, 1].
_POINTS, _WEIGHTS = (tuple(map(float, row)) for row in np.polynomial.legendre.leggauss(5))
POINTS, WEIGHTS = tuple(0.5 + 0.5 * x for x in _POINTS), tuple(0.5 * w for w in _WEIGHTS)


class Timeline(NamedTuple):
    """What acts in time, for kernels.

    Parameters
    ----------
    pieces : Pieces
        Of the drives, and then of the loads.
    stops : ndarray, shape (k,)
        Times at which steps must end beside the outputs, ascending, and one after the run, s.
    anew : ndarray of bool, shape (k,)
        Whether the motion starts anew there, since a load or the acceleration of a drive jumps.
    """

    pieces: Pieces
    stops: Array
    anew: NDArray[np.bool_]


def timeline(
    drives: Sequence[Drive],
    loads: Sequence[Load],
    connectors: Sequence[Connector],
    t_end: float,
    outputs: int,
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
    outputs : int
        Equal intervals of the output, at whose ends steps end too.

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
    stops = np.unique(np.concatenate([calendar.breaks, anew, [np.inf]]))
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

    What rows there are beyond these hold the time.

    Where they jump: those before it, or, if `after`, those after it.
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
def missed_impulse(together, pieces, history, t, h, start, end, found):  # type: ignore[no-untyped-def]
    """∫|f − its straight line over the step| dt of both values of a history from t to t + h, N s or N m s, in `found`.

    With `together` they are those of a vector, a force: then its size is integrated, which no axes change, and 0 is the
    second number.
    """
    found[0] = found[1] = 0.0
    if pieces.steady[history]:
        return
    last, piece, a = pieces.first[history + 1] - 1, piece_at(pieces, history, t, True), t
    while True:
        b = t + h if piece == last else min(pieces.edges[1, piece], t + h)
        for g in range(5):
            time, part = a + POINTS[g] * (b - a), WEIGHTS[g] * (b - a)
            x = (time - t) / h
            first = value_at(pieces, piece, 0, time) - ((1.0 - x) * start[0] + x * end[0])
            second = value_at(pieces, piece, 1, time) - ((1.0 - x) * start[1] + x * end[1])
            if together:
                found[0] += part * np.sqrt(first * first + second * second)
            else:
                found[0] += part * abs(first)
                found[1] += part * abs(second)
        if piece == last or b >= t + h:
            break
        a, piece = b, piece + 1


@inlined
def missed_turn(pieces, history, t, h, start, end):  # type: ignore[no-untyped-def]
    """Mean distance of a drive's angle from the cubic of its angles and rates at t and t + h, rad."""
    total, last = 0.0, pieces.first[history + 1] - 1
    piece, a = piece_at(pieces, history, t, True), t
    while True:
        b = t + h if piece == last else min(pieces.edges[1, piece], t + h)
        for g in range(5):
            time = a + POINTS[g] * (b - a)
            x = (time - t) / h
            y = 1.0 - x
            cubic = y * y * (1.0 + 2.0 * x) * start[0] + x * x * (1.0 + 2.0 * y) * end[0]
            cubic += h * x * y * (y * start[1] - x * end[1])
            total += WEIGHTS[g] * (b - a) * abs(value_at(pieces, piece, 0, time) - cubic)
        if piece == last or b >= t + h:
            break
        a, piece = b, piece + 1
    return total / h
