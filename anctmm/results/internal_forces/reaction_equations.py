"""Equations of the reactions of joints that hang together, and their solution.

The unknowns are the force and moment of each joint on each of its places. A joint exerts only some of them: over the
places of one that is not fixed to the ground they sum up to zero, and in directions that it leaves free they vanish. So
they are a sum of as many independent states as the joint has, and the factors of these states are what is solved for.
The equations: at each place of a beam, or body, all forces sum up to the known total.

These are more equations than unknowns, and what a solution has of a body's accelerations is not exact: an error δ of
them is a force m δ in its equation, as large as all that a body of a millionth of its mass bears. So the equations of a
body count by what they say of its accelerations: the sum of |m r̈ − F − R|² / m is the least. That is
Gauss' principle of least constraint (J. reine angew. Math. 4, 1829, 232-235), by which errors along what joints leave
free are no forces.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.model.joints import Clamp, Joint, Pin, Prismatic, Slider, Weld, unknown_joint
from anctmm.model.places import Place
from anctmm.results.internal_forces.actions import turn_since_placed
from anctmm.results.internal_forces.rigid import holding, inertia_of
from anctmm.results.internal_forces.section_forces import HeldElement, element_count

Array = NDArray[np.float64]

#: Of the largest singular value: what counts as none; of a unit of a reaction: the part that cannot be known.
NONE, UNKNOWN = 1e-10, 1e-6
#: Unknowns from which on matrices are sparse.
MANY = 60
#: Smallest eigenvalue of J Jᵀ, of the largest, above which no equation depends on others. Rounding makes 1e-16 of none.
CLEAR = 1e-12
#: States drawn at random to find what is not determined; repeated steps, and the change that counts as none.
MOTIONS, STEPS, SETTLED = 8, 8, 1e-8


class JointForces(NamedTuple):
    """Forces and moments of joints.

    Parameters
    ----------
    forces : ndarray, shape (n, 3 places)
        Of each joint on each of its places, one joint after the other: N, N, N m.
    unknown : ndarray of bool, shape (n, 3 places)
        Whether equilibrium does not determine them.
    first : dict of int to int
        First column of each joint.
    """

    forces: Array
    unknown: NDArray[np.bool_]
    first: dict[int, int]


def joint_forces(
    solution: Any, holders: Sequence[Sequence[tuple[str, Any]]], together: Sequence[int]
) -> JointForces:
    """Forces of all joints that hang together, at all outputs.

    Parameters
    ----------
    solution : Solution
    holders : sequence of sequences of (str, key)
        Of each joint of the scene the places of beams, and rigid bodies, that it acts on.
    together : sequence of int
        Numbers of the joints.
    """
    return _System(solution, holders, together).solved()


class _Row(NamedTuple):
    """Factors of columns, numbers or of each output; the known sum; the weight."""

    terms: list[tuple[int, Any]]
    value: Any
    weight: float


class _System:
    """Linear equations of the unknown reactions of some joints, at all outputs.

    A moment counts in units of the scene's length, so that all unknowns are forces.
    """

    def __init__(
        self, solution: Any, holders: Sequence[Sequence[tuple[str, Any]]], joints: Sequence[int]
    ) -> None:
        self.solution, self.joints, self.scene = solution, joints, solution.scene
        self.length, self.outputs = self.scene.length, len(solution.t)
        counts = [3 * len(self.scene.joints[k].ends) for k in joints]
        self.first = dict(zip(joints, np.cumsum([0, *counts]).tolist(), strict=False))
        self.size = sum(counts)
        self.rows: list[_Row] = []
        held: dict[tuple[str, Any], list[tuple[int, int]]] = {}
        for k in joints:
            for p, holder in enumerate(holders[k]):
                held.setdefault(holder, []).append((k, p))
        for (name, key), pairs in held.items():
            if key == "":
                self._body(name, pairs)
            else:
                self._end(
                    self.scene.place((name, key) if not isinstance(key, str) else f"{name}.{key}"), pairs
                )

    def solved(self) -> JointForces:
        """All unknowns."""
        states, start = self._states()
        count = int(start[-1])
        row, column, factor, right = self._matrix(states, start)
        scale = np.array([r.weight for r in self.rows])
        factors, unknown = np.empty((self.outputs, count)), np.zeros((self.outputs, self.size), dtype=bool)
        solve = _sparse if count >= MANY else _dense
        for n in range(self.outputs):
            A = scipy.sparse.csr_array((factor[:, n], (row, column)), shape=(len(self.rows), count))
            factors[n], free = solve(A, scale, right[:, n])
            if len(free):
                here = [found[n:][:1] if len(found) > 1 else found for found in states]
                unknown[n] = np.linalg.norm(_spread(here, start, free), axis=0) > UNKNOWN
        forces = _spread(states, start, factors)
        forces[:, 2::3] *= self.length
        return JointForces(forces, unknown, self.first)

    def _states(self) -> tuple[list[Array], NDArray[np.int64]]:
        """Independent states of each joint, (outputs or 1, 3 places, states), and the number of the first of each."""
        states = [self._states_of(self.scene.joints[k]) for k in self.joints]
        return states, np.cumsum([0, *(found.shape[2] for found in states)]).astype(np.int64)

    def _states_of(self, joint: Joint) -> Array:
        """What a joint can exert: that which its conditions, independent rows, leave."""
        conditions = self._conditions(joint)
        _, _, V = np.linalg.svd(conditions)
        return np.asarray(V[:, conditions.shape[1] :].swapaxes(1, 2))

    def _conditions(self, joint: Joint) -> Array:
        """What a joint leaves free, and that it keeps nothing for itself, (outputs or 1, conditions, 3 places)."""
        places = len(joint.ends)
        of_place = np.eye(3 * places).reshape(places, 3, 3 * places)
        sums = of_place.sum(axis=0)
        balanced = [] if joint.grounded else [sums[0], sums[1]]
        match joint:
            case Pin():
                rows = [*of_place[:, 2], *balanced]
            case Weld():
                rows = [sums[2], *balanced]
            case Clamp():
                rows = []
            case Slider() | Prismatic():
                rows = [] if joint.holds_direction else [sums[2]]
                if joint.position is None:
                    x, y = self._direction(joint)
                    free = x[:, None] * of_place[0, 0] + y[:, None] * of_place[0, 1]
                    return np.stack([free, *(np.broadcast_to(row, free.shape) for row in rows)], axis=1)
            case _:
                raise unknown_joint(joint)
        return np.array(rows).reshape(1, -1, 3 * places)

    def _direction(self, guide: Slider | Prismatic) -> Array:
        """Of a guide's line at each output, (2, n)."""
        x, y = guide.direction
        fixed = guide.body is None
        angle = np.zeros(self.outputs) if fixed else turn_since_placed(self.solution, f"{guide.body}.center")
        return np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)])

    def _matrix(
        self, states: Sequence[Array], start: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
        """Row and column of each entry of the equations by factors of states, (k,), its values, (k, n), and the sums,
        (rows, n).
        """
        joint_of = np.repeat(np.arange(len(states)), [found.shape[1] for found in states])
        first = np.array([self.first[k] for k in self.joints])
        rows, columns, factors = list[int](), list[int](), list[Array]()
        right = np.zeros((len(self.rows), self.outputs))
        for r, (terms, value, _) in enumerate(self.rows):
            right[r] = value
            for c, factor in terms:
                j = int(joint_of[c])
                for s in range(states[j].shape[2]):
                    rows.append(r)
                    columns.append(int(start[j]) + s)
                    factors.append(np.broadcast_to(states[j][:, c - first[j], s] * factor, self.outputs))
        values = np.array(factors).reshape(-1, self.outputs)
        return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64), values, right

    def _sum(self, pairs: Sequence[tuple[int, int]], component: int, value: Any, weight: float) -> None:
        terms = [(self.first[k] + 3 * p + component, 1.0) for k, p in pairs]
        self.rows.append(_Row(terms, value, weight))

    def _end(self, place: Place, held: Sequence[tuple[int, int]]) -> None:
        """At a place of a beam: what holds it is known."""
        name, key = place.body.name, float(place.key)
        count = element_count(self.solution, name)
        node = round(key * count)
        parts = [
            HeldElement(self.solution, name, node - 1 + s).at_node(1 - s)
            for s in (0, 1)
            if 0 <= node - 1 + s < count
        ]
        force, moment = (sum(part[k] for part in parts) for k in (0, 1))
        beam = self.scene.beam(name)
        mass, length = len(parts) * beam.mass / count, beam.length / count
        for c in (0, 1):
            self._sum(held, c, force[:, c], mass**-0.5)  # type: ignore[index]
        self._sum(held, 2, moment / self.length, self.length / length * (mass / 12.0) ** -0.5)

    def _body(self, name: str, held: Sequence[tuple[int, int]]) -> None:
        """Of a rigid body, a beam without strain or a point mass: what holds it is known."""
        center, force, moment = holding(self.solution, name)
        terms: list[list[tuple[int, Any]]] = [[], [], []]
        for k, p in held:
            ends = self.scene.joints[k].ends
            sign, end = (1.0, p) if p < len(ends) else (-1.0, 0)  # a guide's body gets the opposite
            arm = self.solution.position(ends[end]) - center
            column = self.first[k] + 3 * end
            for c in (0, 1):
                terms[c].append((column + c, sign))
            terms[2] += [
                (column, -sign * arm[:, 1] / self.length),
                (column + 1, sign * arm[:, 0] / self.length),
                (column + 2, sign),
            ]
        body = self.scene.body(name)
        for c in (0, 1):
            self.rows.append(_Row(terms[c], force[:, c], body.mass**-0.5))
        if moment is not None:  # joints exert none on a point mass
            weight = self.length * inertia_of(body) ** -0.5
            self.rows.append(_Row(terms[2], moment / self.length, weight))


def _spread(states: Sequence[Array], start: NDArray[np.int64], factors: Array) -> Array:
    """Forces, (n, 3 places), from factors of the states of all joints, (n, states)."""
    parts = [
        (found @ factors[:, first:last, None])[:, :, 0]
        for found, first, last in zip(states, start[:-1], start[1:], strict=True)
    ]
    return np.concatenate(parts, axis=1)


def _dense(A: "scipy.sparse.csr_array", scale: Array, right: Array) -> tuple[Array, Array]:
    """Solution of weighted equations, and states that they do not determine, (k, unknowns).

    The root of the sum of squares of what they have of an unknown is the length of what a unit of it has in common with
    all that is not determined.
    """
    matrix = A.toarray()
    _, sizes, V = np.linalg.svd(matrix)
    rank = int((sizes > NONE * sizes[0]).sum()) if sizes.size else 0
    return _least_squares(scale[:, None] * matrix, scale * right, rank), V[rank:]


def _sparse(A: "scipy.sparse.csr_array", scale: Array, right: Array) -> tuple[Array, Array]:
    """The same with sparse matrices where all is determined.

    With r what is left of the equations, r / scale² + A x = right and Aᵀ r = 0: no product of A with itself loses
    digits (Björck, Numerical Methods for Least Squares Problems, 1996, 2.5.3).
    """
    if not independent(scipy.sparse.csr_array(A.T)):
        found = _redundant(A, scale, right)
        return _dense(A, scale, right) if found is None else found
    inverse = (scale.max() / scale) ** 2
    blocks: list[list[Any]] = [[scipy.sparse.diags_array(inverse), A], [A.T, None]]
    whole = scipy.sparse.csc_array(scipy.sparse.block_array(blocks))
    asked = np.concatenate([right, np.zeros(A.shape[1])])
    factors = scipy.sparse.linalg.splu(whole)
    x = factors.solve(asked)
    x += factors.solve(asked - whole @ x)
    return x[len(right) :], np.empty((0, A.shape[1]))


def _redundant(A: "scipy.sparse.csr_array", scale: Array, right: Array) -> tuple[Array, Array] | None:
    """The same where something is not determined; None where sparse factors cannot tell what.

    The equations of `_sparse` with −ν² in the place of 0, and repeated for what is left, ν² small: what they determine
    is the same, and the rest is of any size. States that A does not see are drawn at random, always the same ones.
    """
    inverse = (scale.max() / scale) ** 2
    size = scipy.sparse.linalg.norm(A, 1) * scipy.sparse.linalg.norm(A, np.inf)
    count, unknowns = A.shape
    low = scipy.sparse.diags_array(np.full(unknowns, -size * NONE**2))
    D, T = scipy.sparse.diags_array(inverse), scipy.sparse.csr_array(A.T)
    factors = scipy.sparse.linalg.splu(scipy.sparse.csc_array(scipy.sparse.block_array([[D, A], [T, low]])))

    def seen(x: Array) -> Array:
        return np.asarray(factors.solve(np.concatenate([A @ x, np.zeros_like(x)]))[count:])

    free = settled(seen, np.random.default_rng(0).standard_normal((unknowns, MOTIONS)))
    if free is None:
        return None
    r, x = np.zeros(count), np.zeros(unknowns)
    for _ in range(STEPS):
        step = factors.solve(np.concatenate([right - D @ r - A @ x, -(T @ r)]))
        r, x = r + step[:count], x + step[count:]
    return x, free.T / np.sqrt(MOTIONS)


def _least_squares(matrix: Array, right: Array, rank: int) -> Array:
    """Least squares by rows that may differ by many powers of ten, and that tell a part of the unknowns only.

    The largest rows come first, and columns are chosen: so no small row loses its digits beside large ones (Cox and
    Higham, Numer. Math. 78, 1998, 537-555). Unknowns that nothing tells are 0.
    """
    order = np.argsort(-np.abs(matrix).max(axis=1, initial=0.0), kind="stable")
    Q, R, chosen = scipy.linalg.qr(matrix[order], mode="economic", pivoting=True)
    found = np.zeros(matrix.shape[1])
    found[chosen[:rank]] = scipy.linalg.solve_triangular(R[:rank, :rank], (Q.T @ right[order])[:rank])
    return found


def settled(part: Callable[[Array], Array], x: Array) -> Array | None:
    """What is left of x if the same part of it is taken away again and again; None if there is no end of it."""
    size = float(np.abs(x).max())
    for _ in range(STEPS):
        taken = part(x)
        x = x - taken
        if np.abs(taken).max() <= SETTLED * size:
            return x
    return None


def independent(J: "scipy.sparse.csr_array") -> bool:
    """Whether no equation of J u = 0 depends on others, by far.

    Parameters
    ----------
    J : csr_array, shape (equations, unknowns)
        With entries of like sizes.

    Returns
    -------
    bool
        False also where J Jᵀ is too near to singular to tell: a singular value decomposition of J can tell more.
    """
    count, unknowns = J.shape
    if count > unknowns:
        return False
    S = (J @ J.T).tocsc()
    try:
        factors = scipy.sparse.linalg.splu(
            S, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:  # a pivot of zero
        return False
    inverse = scipy.sparse.linalg.LinearOperator(
        S.shape, matvec=factors.solve, rmatvec=factors.solve, dtype=float
    )
    least = 1.0 / float(scipy.sparse.linalg.onenormest(inverse)) if count > 1 else float(abs(S[0, 0]))
    return least > CLEAR * float(scipy.sparse.linalg.norm(S, 1))
