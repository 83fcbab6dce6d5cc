"""Small motions of a scene about a configuration, as sparse matrices.

Small motions u of the unknown coordinates obey M ü + D u̇ + K u + Jᵀμ = 0 and J u = 0: D of the Kelvin-Voigt damping and
of dampers, J of the constraint rows, whose forces λ stiffen K by Σ λ ∇²g. In a frame that turns with Ω all coordinates
are vectors q' with q̈ = R (q̈' + 2 Ω S q̇' − Ω² q'), S the turn by +90°: so a steady spin adds 2 Ω M S to D and −Ω² M
to K.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from anctmm.elimination.factor import solve
from anctmm.model.expressions import QUARTER_TURN
from anctmm.small_motions.frames import GROUND, Frame
from anctmm.system.acting import FOLLOWER
from anctmm.system.assembled import assembled, coordinates_of
from anctmm.system.body_meshes import RigidMesh
from anctmm.system.calls import factorize_matrix
from anctmm.system.equations import set_matrix, set_residual
from anctmm.system.rows import REGULARISATION
from anctmm.system.system import System
from anctmm.validation import EPS

Array = NDArray[np.float64]
Sparse = Any

#: Part of Ω² by which that of a matrix of Newton's iteration is larger.
BESIDE = 1e-6
#: Solutions that find the forces of constraints: each takes off more of the regularisation.
SOLUTIONS = 3


class SmallMotions:
    """Matrices of small motions about coordinates q, (rows, nodes), of a system, whose multipliers are set for them.

    Loads and drives act as at a time, s, and a part of loads, preloads and free lengths; the scene rests in a frame.
    """

    def __init__(self, system: System, q: Array, time: float, part: float, frame: Frame = GROUND) -> None:
        self.system, self.q, self.time, self.part, self.frame = system, q, time, part, frame
        self.spin = frame.spin
        inputs = system.inputs(np.array([time]))
        self._inputs = inputs._replace(loads=part * inputs.loads)
        system.tables.acting.part[0] = part
        at = system.numbering.at
        #: Places of the free coordinates among the unknowns, and numbers of nodal vectors among them.
        self._free = coordinates_of(system)
        self._at = np.where(at >= 0, np.searchsorted(self._free, np.maximum(at, 0)), -1)

    def at(self, q: Array, spin: float) -> "SmallMotions":
        """The same about other coordinates, in a frame that turns at another rate."""
        return SmallMotions(self.system, q, self.time, self.part, self.frame._replace(spin=spin))

    @property
    def size(self) -> int:
        """Number of coordinates that are free."""
        return len(self._free)

    @cached_property
    def M(self) -> Sparse:
        """Mass, (size, size)."""
        return self._matrix(1.0, 0.0, 0.0)

    @cached_property
    def K(self) -> Sparse:
        """Stiffness, with Σ λ ∇²g and −Ω² M, (size, size); unsymmetric where forces turn with their place."""
        return self._matrix(0.0, 1.0, 0.0) + self._turning_forces() - self.spin**2 * self.M

    @cached_property
    def D(self) -> Sparse:
        """Damping, with 2 Ω M S, (size, size)."""
        found = self._matrix(0.0, 0.0, 1.0)
        if self.spin:
            turn = sparse.kron(sparse.eye(self.size // 2), QUARTER_TURN)
            found = found + 2.0 * self.spin * self.M @ turn
        return found.tocsr()

    @cached_property
    def J(self) -> Sparse:
        """Jacobian of the constraint rows, (rows, size)."""
        rows, dim = self.system.tables.rows, self.system.mesh.dim
        self.residual()
        at = self._at[rows.entries[:, 2] // dim, rows.entries[:, 1]]
        known = at >= 0
        columns = (at[known][:, None] + np.arange(dim)).ravel()
        places = np.repeat(rows.entries[known, 0], dim), columns
        return sparse.coo_matrix((rows.J[known].ravel(), places), (len(rows.at), self.size)).tocsr()

    @property
    def damped(self) -> bool:
        """Whether anything damps, or the frame turns."""
        return bool(self.spin) or self.D.count_nonzero() > 0

    @property
    def symmetric(self) -> bool:
        """Whether K is: forces that turn with their place, which have no potential, make it none."""
        return not (self.system.tables.acting.load_kind == FOLLOWER).any()

    @cached_property
    def rounding(self) -> float:
        """Rounding of squares of rates and frequencies, 1/s²: that of the stiffest coordinate."""
        return EPS * (float((abs(self.K.diagonal()) / self.M.diagonal()).max(initial=0.0)) or 1.0)

    def negative(self, shift: float) -> int:
        """Number of squares below −shift, by the inertia of K + shift · M, a symmetric one."""
        tables, size = self.system.tables, self.system.mesh.rows
        at, give = tables.rows.at, REGULARISATION * self.compliance(shift)
        self._assemble(shift - self.spin**2, 1.0, 0.0)
        tables.matrix.flat[at * size + at % size] = -give
        return factorize_matrix(self.system.size, tables) - len(at)

    def roundings(self, x: Any) -> Array:
        """Rounding of the squares of motions x, (size, n), 1/s²: ε |x|ᵀ|K| |x| / xᵀM x."""
        energy = (np.abs(x) * (abs(self.K) @ np.abs(x))).sum(axis=0)
        return EPS * energy / np.abs((x.conj() * (self.M @ x)).sum(axis=0))

    def compliance(self, shift: float) -> Array:
        """What K + shift · M gives way by where each row pulls with a unit of force, (rows,); more than zero."""
        stiff = abs(self.K.diagonal()) + max(abs(shift), self.rounding) * self.M.diagonal()
        return np.asarray(self.J.multiply(self.J) @ (1.0 / stiff)).ravel()

    def solver(self, P: Sparse, shift: float) -> Callable[[Array], Array]:
        """Solves P x + Jᵀμ = f, J x − δ μ = g for x and μ behind each other; P is about K + shift · M."""
        unit = 1.0 / np.sqrt(self.compliance(shift))
        J, rows = sparse.diags(unit) @ self.J, self.J.shape[0]
        factors = splu(
            sparse.bmat([[P, J.T], [J, -REGULARISATION * sparse.eye(rows)]], format="csc")
            if rows
            else P.tocsc()
        )
        scale = np.concatenate([np.ones(self.size), unit])
        return lambda f: scale * factors.solve(scale * f)

    def correction(self) -> tuple[Array, Array]:
        """Newton's correction of coordinates, (size,), and multipliers, (rows,), towards rest in the frame.

        Its matrix is that of another spin, a little beside, since Ω² may be the square of a frequency.
        """
        left, P = self.residual(), self.K - BESIDE * self.spin**2 * self.M
        right = np.concatenate([left, -self.system.tables.rows.g])
        x = self.solver(P, 0.0)(right)
        return x[: self.size], x[self.size :]

    def spread(self, x: Any) -> Any:
        """Displacements of all nodes, (rows, nodes), from those of the free coordinates, (size,)."""
        places = np.maximum(self._at, 0)[:, None] + np.arange(self.system.mesh.dim)[:, None]
        return (x[places] * (self._at >= 0)[:, None]).reshape(self.q.shape)

    def _matrix(self, mass: float, stiffness: float, damping: float) -> Sparse:
        """mass · M + stiffness · K + damping · D without spin, of the free coordinates."""
        self._assemble(mass, stiffness, damping)
        return assembled(self.system).tocsr()[self._free][:, self._free]

    def _assemble(self, mass: float, stiffness: float, damping: float) -> None:
        system, still = self.system, np.zeros_like(self.q)
        set_matrix(
            system.size, system.space, system.tables, self.q, still, self._inputs, 0, mass, stiffness, damping
        )

    def _turning_forces(self) -> Sparse:
        """What forces that turn with their place add to the symmetric part of their stiffness, ½ (a bᵀ − b aᵀ)."""
        acting, found = self.system.tables.acting, sparse.csr_matrix((self.size, self.size))
        for n in np.flatnonzero(acting.load_kind == FOLLOWER):
            by_q, direction = self._form(acting.load_turns[n])
            (x, y), (c, s) = direction / np.hypot(*direction), acting.rest[n]
            turn = (c * x + s * y) * np.eye(2) + (c * y - s * x) * QUARTER_TURN
            force = turn @ self._inputs.loads[0, n]
            a = sparse.csr_matrix(-(QUARTER_TURN @ force) @ self._form(acting.load_form[n])[0])
            b = sparse.csr_matrix(QUARTER_TURN @ direction / (direction @ direction) @ by_q)
            found = found + 0.5 * (a.T @ b - b.T @ a)
        return found

    def _form(self, n: int) -> tuple[Array, Array]:
        """Derivative by the free coordinates, (dim, size), and value, (dim,), of a form of places."""
        forms, dim = self.system.tables.acting.forms, self.system.mesh.dim
        by_q, value = np.zeros((dim, self.size)), forms.b[n].copy()
        for k in range(forms.start[n], forms.start[n + 1]):
            node, component, A = forms.node[k], forms.component[k], forms.A[k]
            value += A @ self.q[component : component + dim, node]
            if (at := self._at[component // dim, node]) >= 0:
                by_q[:, at : at + dim] += A
        return by_q, value

    def residual(self) -> Array:
        """f + Ω² M (q − centre) − Jᵀλ of the free coordinates; rows have their J and values then."""
        system, force, still = self.system, np.empty_like(self.q), np.zeros_like(self.q)
        away = -(self.spin**2) * (self.q - self._centres()) if self.spin else still
        set_residual(system.space, system.tables, self.q, still, away, self._inputs, 0, force)
        return system.tables.matrix.unknowns[self._free]

    def _centres(self) -> Array:
        """The centre in the place of every position, (rows, nodes): gradients turn about nothing but themselves."""
        mesh, found = self.system.mesh, {}
        for name, body in mesh.bodies.items():
            place = np.zeros((body.nodes, body.vectors, mesh.dim))
            both = isinstance(body, RigidMesh) and body.anchors is not None
            place[:, : 2 if both else 1] = self.frame.centre
            found[name] = place
        return mesh.flat(found)

    def set_multipliers(self) -> None:
        """Set the forces of constraints, λ of M a + Jᵀλ = f and J a = 0: a is zero in an equilibrium."""
        system = self.system
        tables, matrix = system.tables, system.tables.matrix
        tables.rows.multiplier[:] = 0.0
        for _ in range(SOLUTIONS if len(tables.rows.at) else 0):
            self.residual()
            self._assemble(1.0, 0.0, 0.0)
            factorize_matrix(system.size, tables)
            solve(system.size, matrix.plan, matrix.values, matrix.x)
            tables.rows.multiplier[:] += matrix.unknowns[tables.rows.at]
