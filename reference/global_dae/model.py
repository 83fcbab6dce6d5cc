"""A scene as the equations M q̈ + Φᵀμ = F(q, t), Φ q = b(t) (Rong 2014, eq. 14): numbering, mass, constraints, loads.

Unknowns are numbered body after body, node after node, vector after vector (r, r_x, r_y), x before y; then the
multipliers in the order of the joints. Rows that `Bodies` keeps for cables beside shear elements are left out.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.mesh import build
from anctmm.elements.kinds import check_kinds
from anctmm.model.scene import Scene
from reference.global_dae.constraints import Row, Rows, compiled_rows, constraint_rows
from reference.global_dae.loads import Loads, dead_forces, varying

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Matrix = sparse.csc_array
#: Kinds of element that it knows.
ELEMENTS = ("cable", "shear", "quintic")


class Parts(NamedTuple):
    """What the kernels need of the bodies; `dead` (gravity and constant forces) and `reference` are flat."""

    first: Ints
    formulations: tuple[int, ...]
    kinds: Ints
    constants: Array
    masses: Array
    dead: Array
    reference: Array


@dataclass(frozen=True)
class Model:
    """A scene as discretised.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    bodies : Bodies
        Each with its own nodes, in its own direction.
    joints : list of Row
        Constraint rows, each for x and y.
    """

    scene: Scene
    run: Discretisation
    bodies: Bodies
    joints: list[Row]

    @classmethod
    def of(cls, scene: Scene, run: Discretisation) -> "Model":
        """Build it; raises the errors of `mesh.build` and `constraint_rows`; refuses rigid bodies."""
        check_kinds(run.of(scene), ELEMENTS, "the global solver")
        bodies = Bodies(list(build(scene, run).values()))
        return cls(scene, run, bodies, constraint_rows(scene, bodies))

    @cached_property
    def numbers(self) -> Ints:
        """Number of the vector in row pair k of a node, (rows/2, nodes); −1 where there is none."""
        table = np.full((self.bodies.rows // 2, self.bodies.nodes), -1, dtype=np.int64)
        count = 0
        for b, mesh in enumerate(self.bodies.meshes):
            size = mesh.nodes * mesh.vectors
            block = np.arange(count, count + size).reshape(mesh.nodes, mesh.vectors)
            table[: mesh.vectors, self.bodies.first[b] : self.bodies.first[b + 1]] = block.T
            count += size
        return table

    @cached_property
    def vectors(self) -> int:
        """Number of coordinate vectors."""
        return int(self.numbers.max()) + 1

    @property
    def size(self) -> int:
        """Length of the flat coordinates, unused rows included."""
        return self.bodies.rows * self.bodies.nodes

    @property
    def dofs(self) -> int:
        """Number of generalized coordinates of all bodies; multipliers do not count."""
        return 2 * self.vectors

    @property
    def length(self) -> float:
        """The scene's length that tolerances refer to: of all bodies together, m."""
        return self.scene.length

    @cached_property
    def scalar_mass(self) -> Matrix:
        """Mass matrix m of the vectors; that of the components is m ⊗ I₂."""
        rows, columns, values = [], [], []
        for b, mesh in enumerate(self.bodies.meshes):
            start = self.bodies.first[b] + np.arange(mesh.elements)
            ends = np.concatenate([self.numbers[:, start], self.numbers[:, start + 1]])
            for i in np.flatnonzero(ends[:, 0] >= 0):
                for j in np.flatnonzero(ends[:, 0] >= 0):
                    at = 3 * (i // len(self.numbers)) + i % len(self.numbers)
                    to = 3 * (j // len(self.numbers)) + j % len(self.numbers)
                    rows.append(ends[i])
                    columns.append(ends[j])
                    values.append(np.full(mesh.elements, self.bodies.masses[b, at, to]))
        where = (np.concatenate(rows), np.concatenate(columns))
        return Matrix((np.concatenate(values), where), shape=(self.vectors, self.vectors))

    @cached_property
    def complex_constraints(self) -> sparse.csr_array:
        """Φ on vectors as complex numbers, (rows, vectors)."""
        entries = [
            (j, self.numbers[t.vector, t.node], t.factor) for j, r in enumerate(self.joints) for t in r.terms
        ]
        j, i, factor = (
            (np.array(c) for c in zip(*entries, strict=True)) if entries else (np.zeros(0, int),) * 3
        )
        shape = (len(self.joints), self.vectors)
        return sparse.csr_array((factor.astype(complex), (j, i)), shape=shape)

    @property
    def separable(self) -> bool:
        """Whether no joint mixes x and y: one scalar matrix then serves both."""
        return not np.any(self.complex_constraints.data.imag)

    @cached_property
    def mass(self) -> Matrix:
        """Mass matrix of the components, (dofs, dofs)."""
        return Matrix(sparse.kron(self.scalar_mass, np.eye(2), "csc"))

    @cached_property
    def constraints(self) -> sparse.csr_array:
        """Φ of the components, (2 rows, dofs)."""
        phi = self.complex_constraints
        real = sparse.kron(sparse.csr_array(phi.real), np.eye(2))
        imaginary = sparse.kron(sparse.csr_array(phi.imag), np.array([[0.0, -1.0], [1.0, 0.0]]))
        return sparse.csr_array(real + imaginary)

    def rows(self, scale: float) -> Rows:
        """Constraints for the kernels."""
        return compiled_rows(self.joints, self.bodies, scale)

    @cached_property
    def loads(self) -> Loads:
        """Loads that vary, for the kernels."""
        return varying(self.scene, self.bodies)

    @cached_property
    def parts(self) -> Parts:
        """The bodies for the kernels."""
        b = self.bodies
        dead = dead_forces(self.scene, b).reshape(-1)
        return Parts(b.first, b.formulations, b.kinds, b.constants, b.masses, dead, b.reference().reshape(-1))

    def places(self, width: int) -> Ints:
        """Flat places of the unknowns, multipliers behind the coordinates: (unknowns, width).

        With width 2 an unknown is a vector (x and y are solved for at once), with width 1 a component.
        """
        nodes = self.bodies.nodes
        vector, node = np.nonzero(self.numbers >= 0)
        coordinates = np.empty((self.vectors, 2), dtype=np.int64)
        x = 2 * vector * nodes + node
        coordinates[self.numbers[vector, node]] = np.stack([x, x + nodes], axis=1)
        multipliers = self.size + np.arange(2 * len(self.joints)).reshape(-1, 2)
        return np.concatenate([coordinates, multipliers]).reshape(-1, width)


def kkt(upper: Matrix, constraints: sparse.csr_array, scale: float) -> Matrix:
    """[A, sΦᵀ; sΦ, 0]; multipliers then come out divided by s."""
    if not constraints.shape[0]:
        return upper
    phi = sparse.csr_array(scale * constraints)
    none = Matrix((phi.shape[0], phi.shape[0]))
    return Matrix(sparse.vstack([sparse.hstack([upper, phi.T]), sparse.hstack([phi, none])]))


def typical(A: Matrix) -> float:
    """Mean size of the diagonal: the scale that constraint rows are given beside A (Bottasso et al. 2008)."""
    return float(np.abs(A.diagonal()).mean())
