"""Branches in the order of elimination: ends that pass on to a node which is not the next one.

Nodes are in the order of elimination. A node passes on to the next node, unless its body ends at a junction where
another body continues: then its matrix and vector wait there, and are added to those that arrive (S = Σ S_child, e = Σ
e_child; Rui et al. 2020, 10.1007/s11044-019-09711-2). A chain has no such place, and no extra cost.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.junctions.structure import common
from anctmm.discretise.plan import Kept
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import inlined
from anctmm.jit.copies import writes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@writes("vectors", "matrices")
@by_address
class Branches(NamedTuple):
    """Places between two nodes where the recursion does not simply go on, and the end of the row.

    Parameters
    ----------
    at : ndarray of int, shape (places,)
        The node behind each place, in order; the last one is the number of nodes.
    to, take : ndarray of int, shape (places,)
        Junction where what comes from the node before waits; junction whose sum the node behind takes; or −1.
    node : ndarray of int, shape (places,)
        The node that the node before passes on to; −1 where it is the next one, none or a kept junction.
    vectors : ndarray, shape (junctions, rows)
    matrices : ndarray, shape (junctions, rows²)
        What waits. Always 0 between two sweeps.
    """

    at: Ints
    to: Ints
    take: Ints
    node: Ints
    vectors: Array
    matrices: Array


def branches(chain: Chain) -> Branches:
    """Branches of a scene, with room of their own for what waits."""
    at, to, take, node = common(chain, _places)
    rows, junctions = chain.bodies.rows, int(to.max(initial=-1)) + 1
    return Branches(at, to, take, node, np.zeros((junctions, rows)), np.zeros((junctions, rows * rows)))


def _places(chain: Chain) -> tuple[Ints, Ints, Ints, Ints]:
    """Places where the recursion leaves the row, as `Branches` has them."""
    first = chain.bodies.first
    leaves = {
        int(first[b + 1]): int(node) for b, node in enumerate(chain.onward) if node not in (-1, first[b + 1])
    }
    junction = {node: number for number, node in enumerate(sorted(set(leaves.values())))}
    stretches = {int(first[b]) for b, step in enumerate(chain.plan.steps) if step.start is not None}
    kept = {int(first[b + 1]) for b, step in enumerate(chain.plan.steps) if isinstance(step.to, Kept)}
    at = sorted({*leaves, *junction, *stretches, *kept, chain.bodies.nodes})
    return (
        np.array(at, dtype=np.int64),
        np.array([junction.get(leaves.get(i, -1), -1) for i in at], dtype=np.int64),
        np.array([junction.get(i, -1) for i in at], dtype=np.int64),
        np.array([leaves.get(i, -1) for i in at], dtype=np.int64),
    )


@inlined
def pass_branch(place, to, take, waiting, passed, at):  # type: ignore[no-untyped-def]
    """At a place: `passed[at …]` waits at the junction it goes to, and what waits for the next node is taken."""
    width = waiting.shape[1]
    if to[place] >= 0:
        for k in range(width):
            waiting[to[place], k] += passed[at + k]
            passed[at + k] = 0.0
    if take[place] >= 0:
        for k in range(width):
            passed[at + k] += waiting[take[place], k]
            waiting[take[place], k] = 0.0
