"""Whole turns of bodies whose rotation no fixed joint prevents, counted at each step of a run.

The direction at an output determines an angle up to whole turns. The rate there determines them only if it changes
little between outputs, unlike that of a pendulum that swings between two outputs. From step to step a body rotates by
less than half a turn: a whole turn is counted when its direction passes that of −x, which needs a comparison of signs.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.kept_chains import once
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import inlined
from anctmm.model.topology import turning_bodies

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

TURN = 2.0 * np.pi


@by_address
class TurnCount(NamedTuple):
    """Turns of bodies until now.

    Parameters
    ----------
    nodes : ndarray of int, shape (bodies, 2)
        Node at the start of each, or its only one, and the first row of the vector that turns there.
    before : ndarray, shape (bodies, 2)
        That vector after the last step.
    turns : ndarray, shape (bodies,)
        How often it has passed the direction of −x, counter-clockwise less clockwise.
    """

    nodes: Ints
    before: Array
    turns: Array


def new_count(chain: Chain) -> TurnCount:
    """Turns of the bodies of a scene that may turn, before its first step."""
    nodes, before = once(chain, _start)
    return TurnCount(nodes, before.copy(), np.zeros(len(nodes)))


def begin_count(q: Array, count: TurnCount) -> None:
    """Start to count anew at coordinates q, (rows, nodes)."""
    count.before[:], count.turns[:] = _vectors(q, count.nodes), 0.0


def _vectors(q: Array, nodes: Ints) -> Array:
    """Vectors that turn, (bodies, 2)."""
    i, row = nodes.T
    return q[[row, row + 1], i].T


def _start(chain: Chain) -> tuple[Ints, Array]:
    """Where these vectors stand, and what they are before the first step."""
    parts, bodies = chain.segments.parts, chain.bodies
    first = [parts[name][0].name if name in parts else name for name in turning_bodies(chain.scene)]
    table = [(bodies.node(name, 0), bodies.turning_row(name)) for name in first]
    nodes = np.array(table, dtype=np.int64).reshape(-1, 2)
    return nodes, _vectors(chain.start_coordinates(), nodes)


@inlined
def count_turns(q, count):  # type: ignore[no-untyped-def]
    """Bring turns up to date after a step to q, (rows, nodes)."""
    nodes, before, turns = count.nodes, count.before, count.turns
    for n in range(nodes.shape[0]):
        i, row = nodes[n, 0], nodes[n, 1]
        x, y, u, v = before[n, 0], before[n, 1], q[row, i], q[row + 1, i]
        if (y < 0.0) != (v < 0.0):
            onward = x * v - y * u
            turns[n] += 1.0 if v < 0.0 and onward > 0.0 else -1.0 if y < 0.0 and onward < 0.0 else 0.0
        before[n, 0], before[n, 1] = u, v


@inlined
def put_angles(q, count, angles):  # type: ignore[no-untyped-def]
    """Angles of the vectors at q, less than half a turn from the last step, rad, 0 in the direction of x."""
    nodes, before = count.nodes, count.before
    for n in range(nodes.shape[0]):
        i, row = nodes[n, 0], nodes[n, 1]
        x, y, u, v = before[n, 0], before[n, 1], q[row, i], q[row + 1, i]
        last = np.arctan2(y + 0.0, x) + TURN * count.turns[n]
        angles[n] = last + np.arctan2(x * v - y * u, x * u + y * v)
