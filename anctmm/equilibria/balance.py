"""Equations of equilibrium under a part of the loads: K x + Jᵀλ = f, J x = −g, as matrices of SciPy.

A load factor multiplies gravity, loads and preloads; free lengths and angles of connectors go by it from those of the
undeformed scene to what they are. Histories have their values at t = 0.
"""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from anctmm.kernels.announcing import compiling
from anctmm.system.acting import FOLLOWER, TURN
from anctmm.system.body_meshes import BeamMesh, RigidMesh
from anctmm.system.calls import strain_energy
from anctmm.system.equations import set_matrix, set_residual
from anctmm.system.matrix import gather, scatter
from anctmm.system.rows import REGULARISATION, set_rows
from anctmm.system.system import System
from anctmm.system.tables import Inputs, Tables
from anctmm.validation import EPS

Array = NDArray[np.float64]

#: Step of the load factor by which forces are differentiated: they are linear in it, except for laws.
RATE = 1e-3
#: Factor of the stiffness with which rows are penalised where the signs of pivots are counted.
PENALTY = 100.0
#: Corrections that bring coordinates back onto the rows, the error that counts as none, and the longest way.
PROJECTIONS, CLOSED, NEAREST = 30, 1e-12, 0.3


class Configuration(NamedTuple):
    """Where a scene is.

    Parameters
    ----------
    q : ndarray, shape (rows, nodes)
    multipliers : ndarray, shape (rows of constraints,)
    angles : ndarray, shape (nodes,)
        By which sections have turned since the undeformed scene, rad, whole turns included.
    measures : ndarray, shape (connectors,)
        Lengths of springs, and angles of rotational springs, whole turns included.
    """

    q: Array
    multipliers: Array
    angles: Array
    measures: Array


class Balance:
    """The equations of a scene.

    Parameters
    ----------
    system : System
    """

    def __init__(self, system: System) -> None:
        self.system, self.mesh, self.tables = system, system.mesh, system.tables
        inputs = system.inputs(np.zeros(1))
        self._inputs = inputs
        q = system.start()[0]
        self._still, self._f = np.zeros_like(q), np.zeros_like(q)
        self._index_unknowns()
        self._index_matrix()
        #: Factors that make lengths relative to the scene's and leave gradients as they are, (rows, nodes).
        self.weight = system.mesh.units
        self._directions = _directions(system)
        self._before = self._complex(q)
        compiling.first_call(self._compile, (system.size, system.space), q)
        acting, rows = self.tables.acting, self.tables.rows
        start = Configuration(q, np.zeros(len(rows.at)), np.zeros(q.shape[1]), np.zeros(len(acting.kind)))
        self.start = start._replace(measures=self._measured(start))

    def _compile(self, q: Array) -> None:
        nothing = np.zeros(len(self.tables.acting.kind))
        at = Configuration(q, np.zeros(len(self.tables.rows.at)), np.zeros(q.shape[1]), nothing)
        self.residual(at, 0.0)
        self.matrix(at, 0.0, 0.0)
        self.spread(np.zeros(self.size))
        self.strain_energy(at, 0.0)
        self.missed(at)

    def _index_unknowns(self) -> None:
        at, dim = self.tables.matrix.at, self.mesh.dim
        self._own = (np.unique(at[at >= 0])[:, None] + np.arange(dim)).ravel()
        #: Number of unknown coordinates.
        self.size = len(self._own)

    def _index_matrix(self) -> None:
        """Where the entries of the matrix, in compressed columns, stand among those of the blocks."""
        plan, width, rows = self.tables.matrix.plan, self.mesh.rows, self.tables.rows.at
        blocks = len(plan.start) - 1
        row = np.concatenate([np.arange(blocks), plan.row])
        column = np.concatenate([np.arange(blocks), np.repeat(np.arange(blocks), np.diff(plan.start))])
        i, k = (part.ravel() for part in np.indices((width, width)))
        rows_of, columns_of = row[:, None] * width + i, column[:, None] * width + k
        flat = np.arange(rows_of.size).reshape(rows_of.shape)
        place = np.full(blocks * width, -1)
        place[self._own] = np.arange(self.size)
        place[rows] = self.size + np.arange(len(rows))
        used = (rows_of >= columns_of) & (place[rows_of] >= 0) & (place[columns_of] >= 0)
        low, high, flat = place[columns_of[used]], place[rows_of[used]], flat[used]
        off = low != high
        r, c = np.concatenate([high, low[off]]), np.concatenate([low, high[off]])
        flat = np.concatenate([flat, flat[off]])
        order = np.lexsort((r, c))
        count = self.size + len(rows)
        self._flat, self._rows = flat[order], r[order]
        self._starts = np.searchsorted(c[order], np.arange(count + 1))
        self._multiplier_diagonal = np.flatnonzero((r == c)[order] & (r[order] >= self.size))

    def _given(self, at: Configuration, factor: float) -> Tables:
        """Tables for a load factor and a configuration."""
        acting, rows = self.tables.acting, self.tables.rows
        acting.part[0] = factor
        acting.now[:, 1] = at.measures
        rows.multiplier[:] = at.multipliers
        return self.tables._replace(dead=factor * self.tables.dead)

    def _given_inputs(self, factor: float) -> Inputs:
        """Inputs under a part of the loads."""
        return self._inputs._replace(loads=factor * self._inputs.loads)

    def residual(self, at: Configuration, factor: float, v: Array | None = None) -> tuple[Array, Array]:
        """f − Jᵀλ of the unknowns, and the values of the rows; v, (rows, nodes): velocities."""
        tables = self._given(at, factor)
        set_residual(
            self.system.space, tables, at.q, self._still if v is None else v, self._still,
            self._given_inputs(factor), 0, self._f,
        )  # fmt: skip
        return tables.matrix.unknowns[self._own], tables.rows.g.copy()

    def load_rate(self, at: Configuration, factor: float) -> Array:
        """Derivative of the forces by the load factor, N."""
        high, low = (self.residual(at, factor + change)[0] for change in (RATE, -RATE))
        return (high - low) / (2.0 * RATE)

    def matrix(self, at: Configuration, factor: float, mass: float, stiffness: float = 1.0) -> Any:
        """mass · M + stiffness · K bordered by J, sparse; unsymmetric where forces turn with their place."""
        tables = self._given(at, factor)
        set_residual(
            self.system.space, tables, at.q, self._still, self._still, self._given_inputs(factor), 0,
            self._f,
        )  # fmt: skip
        set_matrix(
            self.system.size, self.system.space, tables, at.q, self._still,
            self._given_inputs(factor), 0, mass, stiffness, 0.0,
        )  # fmt: skip
        data = tables.matrix.flat[self._flat]
        data[self._multiplier_diagonal] = 0.0
        count = len(self._starts) - 1
        found = sparse.csc_matrix((data, self._rows, self._starts), shape=(count, count))
        return (
            found if self.conservative or stiffness == 0.0 else found + stiffness * self._turning(at, factor)
        )

    def _turning(self, at: Configuration, factor: float) -> Any:
        """What the stiffness of forces that turn with their place has beside its symmetric part."""
        acting, count = self.tables.acting, len(self._starts) - 1
        total = sparse.csc_matrix((count, count))
        for n in np.flatnonzero(acting.load_kind == FOLLOWER):
            form, turns = int(acting.load_form[n]), int(acting.load_turns[n])
            g = self._vector(turns, at.q)
            (c, s), (x, y) = g / np.hypot(*g), acting.rest[n]
            (c, s), (p, r) = (c * x + s * y, s * x - c * y), factor * self._inputs.loads[0, n]
            force = c * p - s * r, s * p + c * r
            one = self._pushed(form, np.array([force[1], -force[0]]))
            two = self._pushed(turns, np.array([-g[1], g[0]]) / (g @ g))
            total += 0.5 * (one @ two.T - two @ one.T)
        return total

    def _vector(self, form: int, q: Array) -> Array:
        """A vector that loads act on or turn with, (dim,)."""
        forms, dim = self.tables.acting.forms, self.mesh.dim
        found = forms.b[form].copy()
        for t in range(forms.start[form], forms.start[form + 1]):
            a = forms.component[t]
            found += forms.A[t] @ q[a : a + dim, forms.node[t]]
        return found

    def _pushed(self, form: int, force: Array) -> Any:
        """Generalized force of a force on such a vector, a sparse column."""
        forms, dim, f = self.tables.acting.forms, self.mesh.dim, np.zeros_like(self._f)
        for t in range(forms.start[form], forms.start[form + 1]):
            a = forms.component[t]
            f[a : a + dim, forms.node[t]] += forms.A[t].T @ force
        return sparse.csc_matrix(np.append(self.gathered(f), np.zeros(len(self.tables.rows.at)))[:, None])

    def gathered(self, f: Array) -> Array:
        """Forces, (rows, nodes), on the unknowns."""
        gather(self.system.space, self.tables.matrix.at, f, self.tables.matrix.unknowns)
        return self.tables.matrix.unknowns[self._own]

    def spread(self, x: Array) -> Array:
        """A change of the unknowns as one of the coordinates, (rows, nodes)."""
        unknowns, out = np.zeros_like(self.tables.matrix.unknowns), np.zeros_like(self._f)
        unknowns[self._own] = x
        scatter(self.system.space, self.tables.matrix.at, unknowns, out)
        return out

    def unknowns(self, moved: Array) -> Array:
        """A change of the coordinates that keeps what joints share, (rows, nodes), as one of the unknowns."""
        at, full = self.tables.matrix.at, np.zeros_like(self.tables.matrix.unknowns)
        for k in range(self.mesh.dim):
            full[at[at >= 0] + k] = moved[k :: self.mesh.dim][at >= 0]
        return full[self._own]

    @property
    def conservative(self) -> bool:
        """Whether all forces have a potential: those that turn with their place have none."""
        return not (self.tables.acting.load_kind == FOLLOWER).any()

    @cached_property
    def mass(self) -> Any:
        """M, sparse."""
        return self.matrix(self.start, 0.0, 1.0, 0.0)[: self.size, : self.size]

    @cached_property
    def largest_square(self) -> float:
        """Order of the largest λ of K x = λ M x, 1/s²: of the undeformed scene, and of accelerations by the loads."""
        mass = self.mass.diagonal()
        stiff = float((np.abs(Tangent(self, self.start, 1.0).K.diagonal()) / mass).max(initial=0.0))
        return stiff + float(self.sizes(self.residual(self.start, 1.0)[0] / mass).max(initial=0.0)) or 1.0

    @property
    def least_shift(self) -> float:
        """A shift of the order of the rounding of K x = λ M x, 1/s²."""
        return 16.0 * EPS * self.largest_square

    def moved(self, at: Configuration, x: Array, more: Array | float = 0.0) -> Configuration:
        """A configuration changed by x, (unknowns,), and multipliers by `more`; no section turns by half a turn."""
        q = at.q + self.spread(x)
        turned = np.angle(self._complex(q) * np.conj(self._before))
        angles = turned + 2.0 * np.pi * np.round((at.angles - turned) / (2.0 * np.pi))
        new = Configuration(q, at.multipliers + more, angles, at.measures)
        return new._replace(measures=self._measured(new)) if len(new.measures) else new

    def _complex(self, q: Array) -> NDArray[np.complex128]:
        """The vector that turns with each node's section, (nodes,); 1 where nothing turns."""
        if self.mesh.dim == 3:
            return np.ones(q.shape[1], dtype=complex)
        found = np.einsum("nskm,smn->nk", self._directions, q.reshape(self.mesh.slots, 2, -1))
        z = found[:, 0] + 1j * found[:, 1]
        return np.where(z == 0.0, 1.0, z)

    def _measured(self, at: Configuration) -> Array:
        self.residual(at, 0.0)
        return self.tables.acting.now[:, 1].copy()

    def turned(self, one: Configuration, two: Configuration) -> float:
        """Largest turn of a rotational spring between two configurations, rad."""
        return float(np.abs((one.measures - two.measures)[self.tables.acting.kind == TURN]).max(initial=0.0))

    def sizes(self, x: Array) -> Array:
        """Largest component of a change at each node, (nodes,): lengths relative to the scene's, and gradients."""
        return np.asarray(np.abs(self.spread(x) * self.weight).max(axis=0))

    def missed(self, at: Configuration) -> float:
        """Largest value of a row."""
        return float(set_rows(self.tables.rows, at.q, self._inputs.signals[0]))

    def strain_energy(self, at: Configuration, factor: float) -> float:
        """Strain energy of bodies and connectors, J."""
        self.residual(at, factor)
        return float(strain_energy(self.tables, at.q) + self.tables.acting.now[:, 2].sum())


class Tangent:
    """K + μ M and the rows at a configuration.

    Parameters
    ----------
    balance : Balance
    at : Configuration
    factor : float
        Part of the loads.
    shift : float
        μ, 1/s².
    """

    def __init__(self, balance: Balance, at: Configuration, factor: float, shift: float = 0.0) -> None:
        self.balance, self.at, self.factor, n = balance, at, factor, balance.size
        A = balance.matrix(at, factor, shift)
        rows = A.shape[0] > n
        #: K + μ M and J, sparse.
        self.K: Any
        self.J: Any
        self.K, self.J = (A[:n, :n], A[n:, :n]) if rows else (A, sparse.csc_matrix((0, n)))
        self._matrix = A
        if rows:
            self._squares = np.maximum(np.asarray(self.J.multiply(self.J).sum(axis=1)).ravel(), 1e-300)
            #: Order of the stiffness that the rows are compared with.
            self._scale = float(abs(self.K).max()) or 1.0
            soft = REGULARISATION * self._squares / self._scale
            self._matrix = A - sparse.diags(np.append(np.zeros(n), soft), format="csc")

    @cached_property
    def _factors(self) -> Any:
        try:
            return splu(self._matrix)
        except RuntimeError:  # exactly singular
            return None

    def solve(self, f: Array, g: Array | float = 0.0) -> tuple[Array, Array]:
        """x and multipliers of (K + μ M) x + Jᵀλ = f, J x = g; not finite where the matrix is singular."""
        n, right = len(f), np.zeros(self._matrix.shape[0])
        right[:n], right[n:] = f, g
        if self._factors is None or not np.isfinite(right).all():
            return np.full(n, np.nan), np.full(len(right) - n, np.nan)
        found = self._factors.solve(right)
        with np.errstate(all="ignore"):
            found = found + self._factors.solve(right - self._matrix @ found)
        return found[:n], found[n:]

    def correction(self) -> tuple[Array, Array]:
        """Newton's correction of unknowns and multipliers."""
        f, g = self.balance.residual(self.at, self.factor)
        return self.solve(f, -g)

    @cached_property
    def negative(self) -> int:
        """Negative eigenvalues of K + μ M (of its symmetric part) in motions that keep the rows, by Sylvester's law."""
        S = self.K if self.balance.conservative else sparse.csc_matrix(0.5 * (self.K + self.K.T))
        if self.J.shape[0]:
            S = sparse.csc_matrix(S + self.J.T @ sparse.diags(PENALTY * self._scale / self._squares) @ self.J)
        try:
            # without exchange of rows: pivots are those of L D Lᵀ
            factors = splu(S, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError:  # a pivot that is zero
            return self.balance.size
        return int((factors.U.diagonal() < 0.0).sum())

    def projected(self, at: Configuration) -> Configuration | None:
        """The configuration brought onto the rows; None if it is too far from them."""
        if not len(at.multipliers):
            return at
        balance, start = self.balance, at
        length = balance.system.scene.length
        for _ in range(PROJECTIONS):
            off = balance.missed(at)
            if not off > CLOSED * length:
                break
            x, _ = self.solve(np.zeros(balance.size), -balance.tables.rows.g.copy())
            if not balance.sizes(x).max() <= NEAREST:
                return None
            at = balance.moved(at, x)
        off = balance.missed(at)
        near = np.abs((at.q - start.q) * balance.weight).max() <= NEAREST
        return at if off <= 1e3 * CLOSED * length and near else None


def _directions(system: System) -> Array:
    """Matrices that give the vector that turns with each node from its vectors, (nodes, slots, 2, 2)."""
    mesh = system.mesh
    found = np.zeros((mesh.nodes, mesh.slots, 2, 2))
    for name, body in mesh.bodies.items() if mesh.dim == 2 else ():
        first = mesh.first[name]
        if isinstance(body, BeamMesh):
            found[first : first + body.nodes, body.kind.turned_vector] = np.eye(2)
        elif isinstance(body, RigidMesh):
            for k, A in body.direction().items():
                found[first, k] = A
    return found
