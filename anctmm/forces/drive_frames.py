"""Gradients whose direction driven clamps hold while their stretch is free, in coordinates turned with the drive.

Such a gradient is g = ξ t with a known unit vector t(t): as a known place is, its direction is a function of time, and
ξ is all that is left unknown. With n = t turned by +90°,

    g' = ξ' t + ξ θ' n,    g'' = (ξ'' − ξ θ'²) t + (2 ξ' θ' + ξ θ'') n.

A Runge-Kutta method that is applied to ξ loses no order, as one does that is applied to g with a multiplier across t.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.forces.actuation import Actuation
from anctmm.forces.driving import drives_of
from anctmm.jit.compiling import embedded
from anctmm.jit.copies import writes
from anctmm.model.joints import Clamp

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@writes("along", "rate", "speed", "second", "put")
class DriveFrames(NamedTuple):
    """Gradients that driven clamps turn, for kernels.

    Parameters
    ----------
    nodes, rows : ndarray of int, shape (n,)
        Node of each, and its first component there.
    drive : ndarray of int, shape (n,)
        Number of its drive.
    reference, along : ndarray, shape (n, 2)
        t before it turns, and now.
    rate : ndarray, shape (n, 2)
        θ', rad/s, and θ'', rad/s², now.
    speed, second : ndarray, shape (n,)
        ξ' at the start of an implicit Euler step, and ξ'' at its end.
    put : ndarray, shape (n,)
        g''·t that belongs to this ξ''.
    """

    nodes: Ints
    rows: Ints
    drive: Ints
    reference: Array
    along: Array
    rate: Array
    speed: Array
    second: Array
    put: Array


def drive_frames(chain: Chain, actuation: Actuation) -> DriveFrames | None:
    """Gradients whose direction driven clamps hold; None where there are none: then nothing of it is compiled."""
    drives, first = drives_of(chain, actuation), len(actuation.driven)
    found = []
    for junction in chain.junctions:
        for clamp in junction.hinges:
            if not isinstance(clamp, Clamp) or clamp.angle is None:
                continue
            end = chain.parts.place(clamp.end).end
            drive = next(k for k in range(first, len(drives)) if drives[k].history is clamp.angle)
            for name, side in next(group for group in junction.groups if end in group):
                found.append((chain.bodies.node(name, side), chain.bodies.turning_row(name), drive))
    if not found:
        return None
    nodes, rows, drive = np.array(found, dtype=np.int64).T.copy()
    q = chain.bodies.reference()
    g = np.stack([q[rows, nodes], q[rows + 1, nodes]], axis=1)
    t, n = g / np.linalg.norm(g, axis=1, keepdims=True), len(found)
    return DriveFrames(
        nodes, rows, drive, t, t.copy(), np.zeros((n, 2)), np.zeros(n), np.zeros(n), np.zeros(n)
    )


@embedded
def turn_frames(frames, drives):  # type: ignore[no-untyped-def]
    """Turn the directions by angle, rate and acceleration of the drives, (drives, 3)."""
    if frames is not None:
        for n in range(len(frames.nodes)):
            drive = drives[frames.drive[n]]
            c, s = np.cos(drive[0]), np.sin(drive[0])
            x, y = frames.reference[n, 0], frames.reference[n, 1]
            frames.along[n, 0], frames.along[n, 1] = c * x - s * y, s * x + c * y
            frames.rate[n, 0], frames.rate[n, 1] = drive[1], drive[2]


@embedded
def keep_along(frames, q, v, was, had):  # type: ignore[no-untyped-def]
    """Put ξ and ξ' at the directions of now in place of g and g', in `was` and `had`, flat."""
    if frames is not None:
        for n in range(len(frames.nodes)):
            i, k = frames.nodes[n], frames.rows[n]
            x, y = frames.along[n, 0], frames.along[n, 1]
            first, last = k * q.shape[1] + i, (k + 1) * q.shape[1] + i
            was[first], was[last] = x * q[k, i] + y * q[k + 1, i], 0.0
            had[first], had[last] = x * v[k, i] + y * v[k + 1, i], 0.0


@embedded
def find_second(frames, q, w):  # type: ignore[no-untyped-def]
    """Find ξ'' of given accelerations w."""
    if frames is not None:
        for n in range(len(frames.nodes)):
            i, k = frames.nodes[n], frames.rows[n]
            x, y = frames.along[n, 0], frames.along[n, 1]
            rate = frames.rate[n, 0]
            frames.second[n] = x * w[k, i] + y * w[k + 1, i]
            frames.second[n] += rate * rate * (x * q[k, i] + y * q[k + 1, i])


@embedded
def keep_second(frames, nodes, w):  # type: ignore[no-untyped-def]
    """Put ξ'' in place of g'' in w, flat, of so many nodes."""
    if frames is not None:
        for n in range(len(frames.nodes)):
            first = frames.rows[n] * nodes + frames.nodes[n]
            w[first], w[first + nodes] = frames.second[n], 0.0


@embedded
def keep_speed(frames, v):  # type: ignore[no-untyped-def]
    """Take ξ' at the start of an implicit Euler step, which stands in place of g'."""
    if frames is not None:
        for n in range(len(frames.nodes)):
            frames.speed[n] = v[frames.rows[n], frames.nodes[n]]


@embedded
def put_predicted(frames, q, v, w, part):  # type: ignore[no-untyped-def]
    """Put g and what belongs to it in place of predicted ξ and ξ'', at the end of an implicit Euler step."""
    if frames is not None:
        for n in range(len(frames.nodes)):
            i, k = frames.nodes[n], frames.rows[n]
            frames.second[n] = w[k, i]
            _put(frames, n, q[k, i], q, v, w, part)


@embedded
def put_found(frames, q, v, w, part):  # type: ignore[no-untyped-def]
    """Put what belongs to ξ that was found, in the place of what belongs to that before.

    Returns the largest change of accelerations, as a change of coordinates in the step.
    """
    largest = 0.0
    if frames is not None:
        for n in range(len(frames.nodes)):
            i, k = frames.nodes[n], frames.rows[n]
            x, y, a, b = frames.along[n, 0], frames.along[n, 1], w[k, i], w[k + 1, i]
            frames.second[n] += x * a + y * b - frames.put[n]
            _put(frames, n, x * q[k, i] + y * q[k + 1, i], q, v, w, part)
            largest = max(largest, part * part * (abs(w[k, i] - a) + abs(w[k + 1, i] - b)))
    return largest


@embedded
def _put(frames, n, xi, q, v, w, part):  # type: ignore[no-untyped-def]
    """g and g'' of ξ and ξ''; v is g' less the step's part of g'', as of all nodes."""
    i, k = frames.nodes[n], frames.rows[n]
    x, y, rate = frames.along[n, 0], frames.along[n, 1], frames.rate[n, 0]
    speed = frames.speed[n] + part * frames.second[n]
    frames.put[n] = frames.second[n] - xi * rate * rate
    across = 2.0 * speed * rate + xi * frames.rate[n, 1]
    q[k, i], q[k + 1, i] = xi * x, xi * y
    w[k, i] = frames.put[n] * x - across * y
    w[k + 1, i] = frames.put[n] * y + across * x
    v[k, i] = speed * x - xi * rate * y - part * w[k, i]
    v[k + 1, i] = speed * y + xi * rate * x - part * w[k + 1, i]


@embedded
def put_directions(frames, drives, q, v, w):  # type: ignore[no-untyped-def]
    """Put gradients in the directions that drives give them, (drives, 3), from ones that are nearly there; ξ stays."""
    if frames is not None:
        for n in range(len(frames.nodes)):
            i, k, drive = frames.nodes[n], frames.rows[n], drives[frames.drive[n]]
            c, s, rate = np.cos(drive[0]), np.sin(drive[0]), drive[1]
            x = c * frames.reference[n, 0] - s * frames.reference[n, 1]
            y = s * frames.reference[n, 0] + c * frames.reference[n, 1]
            xi, speed = x * q[k, i] + y * q[k + 1, i], x * v[k, i] + y * v[k + 1, i]
            along, across = x * w[k, i] + y * w[k + 1, i], 2.0 * speed * rate + xi * drive[2]
            q[k, i], q[k + 1, i] = xi * x, xi * y
            v[k, i], v[k + 1, i] = speed * x - xi * rate * y, speed * y + xi * rate * x
            w[k, i], w[k + 1, i] = along * x - across * y, along * y + across * x
