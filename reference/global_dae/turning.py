"""Rotations of bodies summed over the steps, because outputs alone do not determine whole turns."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.jit.compiling import kernel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Turned(NamedTuple):
    """Angles of vectors until now, (vectors,), rad.

    places: of their components in flat coordinates, (vectors, 2). last: the vectors after the last step, (vectors, 2).
    """

    places: Ints
    last: Array
    angles: Array


def not_turned(places: Ints, q: Array) -> Turned:
    """Vectors at the start, which stand at `places` of flat coordinates q."""
    return Turned(places, q[places], np.zeros(len(places)))


def at_starts(bodies: Bodies, names: Iterable[str]) -> Ints:
    """Places of the vectors that turn with the starts of beams, in their coordinates, (rows, nodes), flat."""
    rows = [(bodies.turning_row(name), bodies.node(name, 0)) for name in names]
    x = [row * bodies.nodes + node for row, node in rows]
    return np.array([(k, k + bodies.nodes) for k in x], dtype=np.int64).reshape(-1, 2)


@kernel
def turn(q: Array, turned: Turned) -> None:
    """Add the angles of a step to flat coordinates q: each is less than half a turn."""
    for n in range(len(turned.angles)):
        x, y = turned.last[n, 0], turned.last[n, 1]
        u, v = q[turned.places[n, 0]], q[turned.places[n, 1]]
        turned.angles[n] += np.arctan2(x * v - y * u, x * u + y * v)
        turned.last[n, 0], turned.last[n, 1] = u, v


def with_angles(fields: Mapping[str, Any], names: Iterable[str], angles: Array) -> dict[str, Any]:
    """Motions of bodies with the angles of those that are named, (n, names)."""
    found = dict(fields)
    for name, angle in zip(names, angles.T, strict=True):
        found[name] = replace(found[name], start_angle=angle.copy())
    return found
