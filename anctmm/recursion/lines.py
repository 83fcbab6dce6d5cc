"""Places that guides hold on straight lines in the ground, where the recursion eliminates them like any others.

Across its line a place is held, as a support holds it in all directions; in the line's frame that is one known
component. Full blocks are turned into this frame for the elimination of that node, and back. The scalar form of
explicit steps knows no directions: it finds the accelerations a without guides, and J a = 0 across the lines is
restored by the forces of the guides, which are as constant as the mass,

    a ← a − Z J a,    Z = M⁻¹Jᵀ (J M⁻¹Jᵀ)⁻¹.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from anctmm.discretise.chain import Chain
from anctmm.discretise.fitting import mass_matrix
from anctmm.discretise.joined import Joined
from anctmm.jit.compiling import embedded, inlined
from anctmm.jit.copies import writes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@writes()
class Turned(NamedTuple):
    """Nodes that are eliminated in the frames of lines.

    Parameters
    ----------
    node : ndarray of int, shape (lines + 1,)
        In ascending order; after them what no node is.
    along : ndarray, shape (lines, 2)
        Directions of the lines.
    held : ndarray of int, shape (nodes,)
        All nodes on lines, those of joined ends included.
    place, normal : ndarray, shape (nodes, 2)
        A point of the line of each, m, and its normal.
    """

    node: Ints
    along: Array
    held: Ints
    place: Array
    normal: Array


@writes("across")
class Lines(NamedTuple):
    """What keeps accelerations along lines.

    Parameters
    ----------
    node, line : ndarray of int, shape (nodes,)
        Nodes on lines, and the line of each.
    first : ndarray of int, shape (lines,)
        A node of each line.
    normal : ndarray, shape (lines, 2)
    answer : ndarray, shape (lines, rows, nodes)
        Z: accelerations of which one is 1 across its line, and the others 0 across theirs.
    reaction : ndarray, shape (lines, 2, bodies, rows)
        Generalized forces of these at the first and the last node of each body, which are those of driven clamps.
    across : ndarray, shape (lines,)
        Scratch.
    """

    node: Ints
    line: Ints
    first: Ints
    normal: Array
    answer: Array
    reaction: Array
    across: Array


def turned(chain: Chain) -> Turned | None:
    """Nodes that are eliminated in the frames of lines; None where there are none: then nothing of it is compiled."""
    if not chain.guided:
        return None
    found = sorted((chain.node(guided.carrier), guided.direction) for guided in chain.guided)
    node = np.array([*(i for i, _ in found), -1], dtype=np.int64)
    ends = [(chain.node(end), one.direction) for one in chain.guided for end in one.ends]
    held = np.array([i for i, _ in ends], dtype=np.int64)
    normal = np.array([(-y, x) for _, (x, y) in ends])
    place = np.ascontiguousarray(chain.bodies.reference()[:2, held].T)
    return Turned(node, np.array([direction for _, direction in found]), held, place, normal)


def lines(chain: Chain) -> Lines | None:
    """What keeps the accelerations of a tree of scalar blocks along lines; None where there are none."""
    if not chain.guided or chain.plan.kept:  # `kept_motions` are along lines
        return None
    bodies = chain.bodies
    joined = Joined(chain, free=True)
    T, mass = joined.matrix, mass_matrix(bodies)
    count = len(chain.guided)
    normal = np.array([(-guided.direction[1], guided.direction[0]) for guided in chain.guided])
    first = np.array([chain.node(guided.carrier) for guided in chain.guided])
    J = np.zeros((count, bodies.rows, bodies.nodes))
    for k in range(count):
        J[k, :2, first[k]] = normal[k]
    flat = J.reshape(count, -1)
    Y = T @ splu((T.T @ mass @ T).tocsc()).solve(T.T @ flat.T)
    Z = np.linalg.solve((flat @ Y).T, Y.T)
    held = (mass @ Z.T).T.reshape(J.shape)
    ends = np.stack([bodies.first[:-1], bodies.first[1:] - 1])
    nodes = [(chain.node(end), k) for k, guided in enumerate(chain.guided) for end in guided.ends]
    return Lines(
        np.array([i for i, _ in nodes], dtype=np.int64),
        np.array([k for _, k in nodes], dtype=np.int64),
        first.astype(np.int64),
        normal,
        np.ascontiguousarray(Z.reshape(J.shape)),
        np.ascontiguousarray(held[:, :, ends].transpose(0, 2, 3, 1)),
        np.zeros(count),
    )


@embedded
def keep_on_lines(lines, of, reaction, a):  # type: ignore[no-untyped-def]
    """Take from accelerations, (rows, nodes), and reactions of driven clamps what guides do not allow."""
    if lines is not None:
        normal, across = lines.normal, lines.across
        for k in range(len(across)):
            i = lines.first[k]
            across[k] = normal[k, 0] * a[0, i] + normal[k, 1] * a[1, i]
        for k in range(len(across)):
            part = across[k]
            for m in range(a.shape[0]):
                for i in range(a.shape[1]):
                    a[m, i] -= part * lines.answer[k, m, i]
            for b in range(of.shape[1]):
                for side in range(2):
                    if of[side, b] >= 0:
                        for m in range(a.shape[0]):
                            reaction[of[side, b], m] -= part * lines.reaction[k, side, b, m]
        for n in range(len(lines.node)):  # nothing is left to rounding, which adds up from step to step
            i, x, y = lines.node[n], normal[lines.line[n], 0], normal[lines.line[n], 1]
            left = x * a[0, i] + y * a[1, i]
            a[0, i] -= left * x
            a[1, i] -= left * y


@embedded
def hold_on_lines(turned, q, w, c):  # type: ignore[no-untyped-def]
    """Put nodes on their lines, which rounding would leave step by step; w follows, and with it a and v."""
    if turned is not None:
        for n in range(len(turned.held)):
            i, x, y = turned.held[n], turned.normal[n, 0], turned.normal[n, 1]
            off = x * (q[0, i] - turned.place[n, 0]) + y * (q[1, i] - turned.place[n, 1])
            q[0, i] -= off * x
            q[1, i] -= off * y
            w[0, i] -= c.to_w * off * x
            w[1, i] -= c.to_w * off * y


@embedded
def turn_node(size, c, s, work):  # type: ignore[no-untyped-def]
    """Turn the place of a node, in matrices 1 (symmetric, its lower triangle) and 2 of the scratch, by an angle.

    With the cosine and the sine of a line its first component is that along the line, the second that across.
    """
    d = len(size)
    A = d * d
    xx, xy, yy = work[A], work[A + d], work[A + d + 1]
    work[A] = c * c * xx + 2.0 * c * s * xy + s * s * yy
    work[A + d] = c * s * (yy - xx) + (c * c - s * s) * xy
    work[A + d + 1] = s * s * xx - 2.0 * c * s * xy + c * c * yy
    for m in range(2, d):
        turn_pair(c, s, A + d * m, work)
    for m in range(d):
        turn_pair(c, s, 2 * A + d * m, work)


@embedded
def turn_back_node(size, c, s, work):  # type: ignore[no-untyped-def]
    """The same by the opposite angle, and in matrix 3."""
    turn_node(size, c, -s, work)
    d = len(size)
    for m in range(d):
        turn_pair(c, -s, 3 * d * d + d * m, work)


@inlined
def turn_pair(c, s, at, work):  # type: ignore[no-untyped-def]
    """Turn two components in a row of the scratch."""
    x, y = work[at], work[at + 1]
    work[at], work[at + 1] = c * x + s * y, c * y - s * x
