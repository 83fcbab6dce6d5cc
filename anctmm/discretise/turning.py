"""Rotations of sections at nodes since the undeformed scene, including whole turns.

Coordinates determine an angle up to whole turns. These are counted along a path of configurations, from one to the next
of which a section rotates by less than half a turn.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.chain import Chain

Array = NDArray[np.float64]


class Turning:
    """The angles along a path of configurations.

    Parameters
    ----------
    bodies : Bodies
    """

    def __init__(self, bodies: Bodies) -> None:
        self.bodies = bodies
        self.row = np.repeat([m.turning_row for m in bodies.meshes], [m.nodes for m in bodies.meshes])
        self.reference = self._directions(bodies.reference())
        #: Angles at the configuration followed last, (nodes,), rad.
        self.angles = np.zeros(bodies.nodes)

    def follow(self, q: Array) -> None:
        """Go on to coordinates q, (rows, nodes): each angle is that nearest to the one before."""
        angles = np.angle(self._directions(q) * np.conj(self.reference))
        self.angles = angles + 2.0 * np.pi * np.round((self.angles - angles) / (2.0 * np.pi))

    def _directions(self, q: Array) -> NDArray[np.complex128]:
        """The vector that turns with each node's section, (nodes,); 1 at a point mass, which has none."""
        nodes = np.arange(self.bodies.nodes)
        found = q[self.row, nodes] + 1j * q[self.row + 1, nodes]
        return np.where(found == 0.0, 1.0, found)


def angles_by_body(chain: Chain, angles: Array) -> dict[str, Array]:
    """Angles of all nodes, (k, nodes), as those of every body of the scene, (k, nodes), from its own start on."""
    flat = np.zeros((len(angles), chain.bodies.rows, chain.bodies.nodes))
    flat[:, 0] = angles
    return {name: found[:, :, 0, 0] for name, found in chain.by_body(flat).items()}


def angles_of_nodes(chain: Chain, angles: Mapping[str, Array]) -> Array:
    """Angles of all nodes, (nodes,), from those of every body of the scene, (nodes,)."""
    cut = {}
    for name, body in chain.by_body(np.zeros((chain.bodies.rows, chain.bodies.nodes))).items():
        cut[name] = body
        body[:, 0, 0] = angles[name]
    return chain.flat(cut)[0]
