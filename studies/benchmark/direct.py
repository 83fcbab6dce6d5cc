"""A direct solver to check against: global matrices of a chain in banded form, solved by LAPACK."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.sparse import coo_array, csr_array

from anctmm.discretise.assembly import Bodies, block_tangents, unpack_tangent
from anctmm.discretise.chain import Chain
from anctmm.discretise.joined import Joined
from anctmm.elements.tangent_blocks import TANGENT_BLOCK, TANGENT_BUFFER
from anctmm.jit.compiling import kernel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass
class Direct:
    """Solves with a global matrix of a chain whose joints and supports are eliminated.

    Parameters
    ----------
    chain : Chain
    """

    chain: Chain

    def __post_init__(self) -> None:
        self.join = Joined(self.chain)
        nodes = self.chain.bodies.nodes
        row, node = np.divmod(self.join.masters, nodes)
        # node after node: what couples then stands close together, and the matrix is a band
        self.order = np.argsort(node * self.chain.bodies.rows + row, kind="stable")
        self.matrix = csr_array(self.join.matrix[:, self.order])

    def solve(self, band: Array, load: Array) -> Array:
        """Unknowns of all nodes, (rows, nodes), 0 where they are known.

        Parameters
        ----------
        band : ndarray
            Of the joined matrix, as `band` gives it; overwritten.
        load : ndarray, shape (rows, nodes)
        """
        right = self.matrix.T @ load.ravel()
        x = solveh_banded(band, right, overwrite_ab=True, overwrite_b=True, check_finite=False)
        return (self.matrix @ x).reshape(load.shape)

    def solve_tangent(self, q: Array, load: Array) -> Array:
        """Unknowns of all nodes by the tangents of the elements at coordinates q, as `solve` has them."""
        return self.solve(self.band(stiffness_matrices(self.chain.bodies, q)), load)

    def band(self, elements: Array) -> Array:
        """Upper band of the joined matrix, as `solveh_banded` takes it.

        Parameters
        ----------
        elements : ndarray, shape (elements, 2 rows, 2 rows)
            Symmetric positive matrices of all elements: the components of node I, then those of node O.
        """
        size = self.join.shape[0] * self.join.shape[1]
        at = _places(self.chain.bodies)
        there = elements != 0.0
        rows = np.broadcast_to(at[:, :, None], elements.shape)[there]
        columns = np.broadcast_to(at[:, None, :], elements.shape)[there]
        loose = csr_array(coo_array((elements[there], (rows, columns)), shape=(size, size)))
        joined = coo_array(self.matrix.T @ loose @ self.matrix)
        i, j = joined.coords
        upper = i <= j
        i, j, values = i[upper], j[upper], joined.data[upper]
        width = int((j - i).max())
        band = np.zeros((width + 1, joined.shape[0]), order="F")
        np.add.at(band, (width + i - j, j), values)
        return band


def mass_matrices(bodies: Bodies) -> Array:
    """Mass matrices of all elements, (elements, 2 rows, 2 rows)."""
    vectors = bodies.rows // 2
    keep = [*range(vectors), *range(3, 3 + vectors)]
    by_body = [np.kron(m[np.ix_(keep, keep)], np.eye(2)) for m in bodies.masses]
    return np.repeat(np.array(by_body), bodies.elements, axis=0)


def stiffness_matrices(bodies: Bodies, q: Array) -> Array:
    """Tangents of all elements at coordinates q, (elements, 2 rows, 2 rows)."""
    out = np.zeros((int(bodies.elements.sum()), 2 * bodies.rows, 2 * bodies.rows))
    _tangents(
        bodies.formulations,
        q,
        bodies.first,
        bodies.elements,
        bodies.kinds,
        bodies.constants,
        np.zeros(TANGENT_BUFFER),
        out,
    )
    return out


def _places(bodies: Bodies) -> Ints:
    """Flat places of the components of each element's two nodes, (elements, 2 rows)."""
    pairs = zip(bodies.first[:-1], bodies.elements, strict=True)
    nodes = np.concatenate([first + np.arange(count) for first, count in pairs])
    rows = np.arange(bodies.rows) * bodies.nodes
    return np.concatenate([rows[None] + nodes[:, None], rows[None] + nodes[:, None] + 1], axis=1)


@kernel
def _tangents(
    formulations: tuple[int, ...],
    q: Array,
    first: Ints,
    elements: Ints,
    kinds: Ints,
    constants: Array,
    buffer: Array,
    out: Array,
) -> None:
    e = 0
    for b in range(len(elements)):
        for start in range(0, elements[b], TANGENT_BLOCK):
            count = min(TANGENT_BLOCK, elements[b] - start)
            block_tangents(formulations, q, first[b] + start, count, kinds[b], constants[b], buffer)
            for j in range(count):
                unpack_tangent(buffer, j, kinds[b], out[e])
                e += 1
