"""Places guided on straight lines in the ground, which the recursion eliminates like any others.

Across its line a place is fixed, as a support fixes it in all directions; in the frame of the line one component is
known. Full blocks are rotated into this frame for the elimination of that node, and back. The scalar form of explicit
steps has no directions: there the forces λ of the guides are computed between the two sweeps. The part of the loads Jᵀ
that the recursion passes on, along the path from the place to the root, is constant like the mass,

    b ← b − L⁻¹Jᵀ λ,    λ = (J M⁻¹Jᵀ)⁻¹ (L⁻¹Jᵀ)ᵀ G b,    M⁻¹ = L⁻ᵀ G L⁻¹,

with b the loads that have arrived at each node. A tree with guided ends has its root at one of them (`Plan`), whose
path is a single node.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined
from anctmm.jit.copies import writes
from anctmm.recursion.scratch import matrices

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@writes()
@by_address
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


@writes("across", "force")
@by_address
class Lines(NamedTuple):
    """Forces of guides in trees of scalar blocks.

    Parameters
    ----------
    node : ndarray of int, shape (nodes,)
        All nodes on lines, those of joined ends included.
    normal : ndarray, shape (nodes, 2)
        Normal of the line of each.
    start : ndarray of int, shape (lines + 1,)
        Where the path of each line begins in the arrays that follow, and where the last one ends.
    path : ndarray of int, shape (passed,)
        Nodes from each place to the root.
    load, weight : ndarray, shape (passed, rows)
        L⁻¹Jᵀ and G L⁻¹Jᵀ at these.
    last : ndarray of int, shape (lines,)
        Body of each path's last node, which a driven clamp may hold: its acceleration is no matter of loads.
    inverse : ndarray, shape (lines, lines)
        (J M⁻¹Jᵀ)⁻¹.
    across, force : ndarray, shape (lines,)
        Scratch: accelerations across the lines without the guides, J a, and λ.
    """

    node: Ints
    normal: Array
    start: Ints
    path: Ints
    load: Array
    weight: Array
    last: Ints
    inverse: Array
    across: Array
    force: Array


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


def lines(chain: Chain, L: Array, G: Array) -> Lines | None:
    """Forces of guides in trees of scalar blocks, `SplitFactors`; None where there are none."""
    if not chain.guided or chain.plan.kept:  # `kept_motions` are along lines
        return None
    onward = np.arange(1, chain.bodies.nodes + 1)
    onward[chain.bodies.first[1:] - 1] = chain.onward
    paths, loads, J = [], [], np.zeros((len(chain.guided), chain.bodies.rows, chain.bodies.nodes))
    for k, guided in enumerate(chain.guided):
        x, y = guided.direction
        J[k, :2, chain.node(guided.carrier)] = -y, x
        paths.append(_path(onward, chain.node(guided.carrier)))
        for i, following in pairwise(paths[-1]):
            J[k, :, following] = _passed_on(L[:, i], J[k, :, i])
        loads.append(J[k][:, paths[-1]].T)
    weights = np.zeros_like(J)
    for c in range(2):
        weights[:, c] = G[0] * J[:, c] + G[1] * J[:, 2 + c]
        weights[:, 2 + c] = G[1] * J[:, c] + G[2] * J[:, 2 + c]
        weights[:, 4 + c :: 2] = G[3] * J[:, 4 + c :: 2]
    nodes = [(chain.node(end), guided.direction) for guided in chain.guided for end in guided.ends]
    count = len(chain.guided)
    return Lines(
        np.array([i for i, _ in nodes], dtype=np.int64),
        np.array([(-y, x) for _, (x, y) in nodes]),
        np.cumsum([0, *map(len, paths)], dtype=np.int64),
        np.concatenate(paths),
        np.concatenate(loads),
        np.concatenate([weight[:, path].T for weight, path in zip(weights, paths, strict=True)]),
        np.searchsorted(chain.bodies.first, [path[-1] for path in paths], side="right") - 1,
        np.linalg.inv(np.einsum("jmi,kmi->jk", J, weights)),
        np.zeros(count),
        np.zeros(count),
    )


def _path(onward: Ints, node: int) -> Ints:
    """Nodes from one to the root."""
    found = [node]
    while onward[found[-1]] >= 0:
        found.append(int(onward[found[-1]]))
    return np.array(found, dtype=np.int64)


def _passed_on(L: Array, load: Array) -> Array:
    """−L b of a load, (rows,), at a node."""
    place, vector = load[:2], load[2:4]
    return -np.concatenate([L[0] * place + L[1] * vector, L[2] * place + L[3] * vector, L[4] * load[4:]])


@embedded
def add_guide_forces(lines, of, motion, a):  # type: ignore[no-untyped-def]
    """Add the forces of guides to the loads that have arrived, (rows, nodes), beside the motion of driven clamps."""
    if lines is not None:
        start, path, load, weight, across, force = (
            lines.start, lines.path, lines.load, lines.weight, lines.across, lines.force,
        )  # fmt: skip
        for k in range(len(across)):
            total = 0.0
            for n in range(start[k], start[k + 1]):
                for m in range(a.shape[0]):
                    total += weight[n, m] * a[m, path[n]]
            clamp = of[1, lines.last[k]]
            if clamp >= 0:
                for m in range(a.shape[0]):
                    total += load[start[k + 1] - 1, m] * motion[2, clamp, m]
            across[k] = total
        for k in range(len(across)):
            total = 0.0
            for j in range(len(across)):
                total += lines.inverse[k, j] * across[j]
            force[k] = total
        for k in range(len(across)):
            for n in range(start[k], start[k + 1]):
                for m in range(a.shape[0]):
                    a[m, path[n]] -= load[n, m] * force[k]


@embedded
def keep_on_lines(lines, a):  # type: ignore[no-untyped-def]
    """Take from accelerations what rounding has left across lines, and would add up from step to step."""
    if lines is not None:
        for n in range(len(lines.node)):
            i, x, y = lines.node[n], lines.normal[n, 0], lines.normal[n, 1]
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
    """Turn the place of a node, in its own matrix and its coupling with the next node, by an angle.

    With the cosine and the sine of a line its first component is that along the line, the second that across.
    """
    d = len(size)
    _, A, K, _ = matrices(size)
    xx, xy, yy = work[A], work[A + d], work[A + d + 1]
    work[A] = c * c * xx + 2.0 * c * s * xy + s * s * yy
    work[A + d] = c * s * (yy - xx) + (c * c - s * s) * xy
    work[A + d + 1] = s * s * xx - 2.0 * c * s * xy + c * c * yy
    for m in range(2, d):
        turn_pair(c, s, A + d * m, work)
    for m in range(d):
        turn_pair(c, s, K + d * m, work)


@embedded
def turn_back_node(size, c, s, work):  # type: ignore[no-untyped-def]
    """The same by the opposite angle, and in L."""
    turn_node(size, c, -s, work)
    _, _, _, L = matrices(size)
    for m in range(len(size)):
        turn_pair(c, -s, L + len(size) * m, work)


@inlined
def turn_pair(c, s, at, work):  # type: ignore[no-untyped-def]
    """Turn two components in a row of the scratch."""
    x, y = work[at], work[at + 1]
    work[at], work[at + 1] = c * x + s * y, c * y - s * x
