"""Explicit steps of scenes with few kept unknowns: their independent motions, computed once, beside scalar blocks.

With all kept junctions and rigid bodies fixed, and guided places fixed on their lines, a scene is a set of trees,
whose accelerations a the recursion computes in scalar blocks. The n kept unknowns x add a sum of r constant fields.
Joints that are linear in x (pins above all) and lines leave x = N y; the field Φ of each y continues its x into the
trees where no load acts on them (constraint modes of Craig and Bampton 1968, DOI 10.2514/3.4741, by inertia). With
ΦᵀMΦ = 1 and loads b

    y = Φᵀ b − Jᵀλ,    a ← a + Φ y,

where λ belongs to the remaining constraints, J y = −γ: the lengths of rigid bodies, their directions and guides. When y
is needed, b has been passed on already, so Φᵀ b is computed from the loads that arrive, with constant weights.

Errors of these constraints by truncation are removed from positions and velocities in the directions Jᵀ, by the nearest
ones in the metric of the mass, as in `constrained`.
"""

from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.fitting import full_mass_matrix, mass_matrix
from anctmm.discretise.joined import Joined
from anctmm.discretise.kept_chains import of_masses
from anctmm.discretise.singular_positions.repeated import passed_over
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, kernel, shared, uncompiled
from anctmm.jit.copies import writes
from anctmm.recursion.kept.rows import (
    CORRECTIONS,
    ENOUGH,
    KEPT,
    OFF,
    Rows,
    evaluate,
    gather,
    prescribe,
    rows_alone,
    set_signals,
)

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Part of the largest of the linear constraints below which one says what others say.
DEPENDENT = 1e-9
#: Coordinates of all nodes up to which matrices are full: what sparse ones take beside their entries is more.
DENSE = 256


@writes("rows", "slope", "J", "S", "inverse", "alone", "y", "moved")
@by_address
class KeptMotions(NamedTuple):
    """Independent motions of few kept unknowns.

    Parameters
    ----------
    fields : ndarray, shape (r, rows · nodes)
        Φ: accelerations of all nodes.
    weights : ndarray, shape (r, rows · nodes)
        Of the loads that arrive at the nodes of trees.
    reaction : ndarray, shape (r, 2, bodies, rows)
        Generalized forces of the fields at the first and the last node of each body, which are those of driven clamps.
    basis : ndarray, shape (n, r)
        N of the kept unknowns, without places on lines.
    softness : ndarray, shape (n,)
        Diagonal of the inverse mass of the kept unknowns.
    rows : Rows or None
        Constraints that the motions do not keep by themselves; None without any: then nothing of them is compiled.
    pairs : ndarray of int, shape (2, pairs)
        Constraints, and the unknowns of each.
    into : ndarray of int, shape (2, terms)
        Pairs of each term with its first and its second unknown; the number of pairs for the number 1.
    slope : ndarray, shape (pairs + 1,)
        Scratch: derivatives of constraints by their unknowns.
    J : ndarray, shape (m, r)
    S : ndarray, shape (m, m)
        J Jᵀ, and L of its factors L D Lᵀ.
    inverse : ndarray, shape (m,)
        1/D; 0 of constraints that are passed over.
    alone : ndarray, shape (m,)
        Scale of each constraint's pivot.
    void : ndarray, shape (m,)
        Part of it up to which the constraint is passed over.
    y : ndarray, shape (r,)
        Accelerations along the motions.
    moved : ndarray, shape (2, r)
        What a projection adds to positions and to velocities.
    """

    fields: Array
    weights: Array
    reaction: Array
    basis: Array
    softness: Array
    rows: Rows | None
    pairs: Ints
    into: Ints
    slope: Array
    J: Array
    S: Array
    inverse: Array
    alone: Array
    void: Array
    y: Array
    moved: Array


def kept_motions(chain: Chain, L: Array) -> KeptMotions | None:
    """Independent motions of the kept unknowns of a chain of scalar blocks; None without any, or where they are places.

    Parameters
    ----------
    chain : Chain
    L : ndarray, shape (5, nodes)
        Of the `SplitFactors` of the trees between what is kept.
    """
    if not chain.plan.kept or chain.kept.pinned:
        return None
    return of_masses(chain, lambda: _motions(chain, L), what=kept_motions)


def _motions(chain: Chain, L: Array) -> KeptMotions:
    """The same, found anew."""
    constraints, bodies = chain.kept.constraints, chain.bodies
    fields, K = _fields(chain)
    basis = _free_directions(chain)
    basis = basis @ np.linalg.inv(scipy.linalg.cholesky(basis.T @ K @ basis))
    fields = fields @ basis
    r, shape = basis.shape[1], (bodies.rows, bodies.nodes)
    still = constraints.still
    left = rows_alone(chain.kept, ~still)
    m = 0 if left is None else len(left.number)
    pairs, into = _pairs(left, chain.kept.size)
    result = KeptMotions(
        np.ascontiguousarray(fields.T),
        np.ascontiguousarray(_weights(chain, fields.T.reshape(r, *shape), L).reshape(r, fields.shape[0])),
        _reactions(chain, fields),
        basis[: chain.kept.size].copy(),
        np.diagonal(np.linalg.inv(K))[: chain.kept.size].copy(),
        left,
        pairs, into, np.zeros(pairs.shape[1] + 1), np.zeros((m, r)), np.zeros((m, m)), np.zeros(m), np.zeros(m),
        passed_over(chain.kept, np.argsort(~still, kind="stable"))[~still], np.zeros(r), np.zeros((2, r)),
    )  # fmt: skip
    if left is not None:
        uncompiled(gather)(left, 0, chain.start_coordinates())
        uncompiled(factor_constraints)(result, left)
    return result


def _pairs(rows: Rows | None, size: int) -> tuple[Ints, Ints]:
    """`pairs` and `into` of constraints between so many unknowns."""
    if rows is None:
        return np.zeros((2, 0), dtype=np.int64), np.zeros((2, 0), dtype=np.int64)
    unknowns = np.minimum(np.array([rows.one, rows.two]), size)  # the number 1 stands behind them
    found, into = np.unique(rows.row * (size + 1) + unknowns, return_inverse=True)
    row, unknown = np.divmod(found, size + 1)
    real = unknown < size
    number = np.where(real, np.cumsum(real) - 1, np.count_nonzero(real))
    return np.array([row[real], unknown[real]]), number[into].reshape(unknowns.shape)


def _reactions(chain: Chain, fields: Array) -> Array:
    """`reaction` of the fields, (rows · nodes, r); nothing asks for it where no clamp is driven."""
    bodies, r = chain.bodies, fields.shape[1]
    if not any(clamp and clamp.angle for junction in chain.junctions for clamp in junction.clamps):
        return np.zeros((r, 2, len(bodies.meshes), bodies.rows))
    ends = np.stack([bodies.first[:-1], bodies.first[1:] - 1])
    held = (mass_matrix(bodies) @ fields).T.reshape(r, bodies.rows, bodies.nodes)
    return np.ascontiguousarray(held[:, :, ends].transpose(0, 2, 3, 1))


def _free_directions(chain: Chain) -> Array:
    """Directions, (n, r), that linear constraints leave the kept unknowns, and lines the places on them."""
    linear, lines = chain.kept.constraints.linear, chain.guided
    J = np.zeros((len(linear) + len(lines), chain.kept.size + 2 * len(lines)))
    J[: len(linear), : chain.kept.size] = linear
    for k, guided in enumerate(lines):
        x, y = guided.direction
        J[len(linear) + k, chain.kept.size + 2 * k :][:2] = -y, x
    return np.asarray(scipy.linalg.null_space(J, rcond=DEPENDENT)) if len(J) else np.eye(J.shape[1])


def _fields(chain: Chain) -> tuple[Array, Array]:
    """Fields of units of the kept unknowns and places on lines, (rows · nodes, n), and the mass of these, (n, n)."""
    joined, bodies = Joined(chain, free=True), chain.bodies
    nodes, small = bodies.nodes, bodies.rows * bodies.nodes <= DENSE
    T: Any = joined.full_matrix() if small else joined.matrix
    M: Any = full_mass_matrix(bodies) if small else mass_matrix(bodies)
    A = T.T @ M @ T
    guided = [row * nodes + chain.node(one.carrier) for one in chain.guided for row in (0, 1)]
    of_kept = T[[*(chain.kept.homes[0] * nodes + chain.kept.homes[1]), *guided]]
    master = np.zeros(T.shape[1], dtype=bool)
    master[of_kept.nonzero()[1]] = True
    masters, free = np.flatnonzero(master), np.flatnonzero(~master)
    values = np.zeros((T.shape[1], of_kept.shape[0]))
    own = of_kept[:, masters]
    values[masters] = np.linalg.inv(own if small else own.toarray())
    if free.size:
        coupling, inner = A[free][:, masters] @ values[masters], A[free][:, free]
        solve = partial(np.linalg.solve, inner) if small else scipy.sparse.linalg.splu(inner.tocsc()).solve
        values[free] = -solve(coupling)
    return T @ values, values.T @ (A @ values)


def _weights(chain: Chain, fields: Array, L: Array) -> Array:
    """Φ of each node, and what its loads bring to the node that they are passed on to: Φ_i + L_iᵀ Φ_next."""
    last = chain.bodies.first[1:] - 1
    onward = np.arange(1, chain.bodies.nodes + 1)
    onward[last] = np.where(chain.onward >= 0, chain.onward, 0)  # L is 0 where nothing is passed on
    beyond, weights = fields[:, :, onward], fields.copy()
    for c in range(2):
        r, g = beyond[:, c], beyond[:, 2 + c]
        weights[:, c] += L[0] * r + L[2] * g
        weights[:, 2 + c] += L[1] * r + L[3] * g
        if fields.shape[1] == 6:
            weights[:, 4 + c] += L[4] * beyond[:, 4 + c]
    return weights


@kernel
def constrain_few(kept: KeptMotions, rows: Rows, first: int, drives: Array, q: Array, v: Array) -> bool:
    """Take from positions and velocities what they have beside the constraints, which are factored for q then.

    Parameters
    ----------
    kept : KeptMotions
    rows : Rows
        Those of `kept`.
    first : int
        Number of drives before those of constraints.
    drives : ndarray, shape (drives, 3)
        Values, rates and accelerations.
    q, v : ndarray, shape (rows, nodes)

    Returns
    -------
    bool
        Whether the constraints are kept: they are not where joints and drives leave bodies no place.
    """
    set_signals(rows, drives, first)
    prescribe(rows, 0, q)
    gather(rows, 0, q)
    prescribe(rows, 1, v)
    gather(rows, 1, v)
    for p in range(len(kept.y)):
        kept.moved[0, p] = kept.moved[1, p] = 0.0
    largest = evaluate(rows, 0)
    for _ in range(CORRECTIONS):
        if largest <= OFF:
            break
        factor_constraints(kept, rows)
        before = largest
        _correct(kept, rows, 0)
        largest = evaluate(rows, 0)
        if before <= ENOUGH:
            break
    whole = largest <= KEPT
    if whole:
        factor_constraints(kept, rows)
        if evaluate(rows, 1) > 0.0:
            _correct(kept, rows, 1)
    _move(kept, q, v)
    return whole


@shared
def factor_constraints(kept, rows):  # type: ignore[no-untyped-def]
    """J at the unknowns that were gathered, and the factors of J Jᵀ.

    Terms of one unknown are summed before they are squared: each may be a coordinate of a place far from the origin.
    """
    basis, slope, J, S, alone = kept.basis, kept.slope, kept.J, kept.S, kept.alone
    x, w = rows.x, rows.signals
    r, m = len(kept.y), len(alone)
    for k in range(m):
        alone[k] = 0.0
        for p in range(r):
            J[k, p] = 0.0
    for n in range(len(slope)):
        slope[n] = 0.0
    for t in range(len(rows.row)):
        c = rows.factor[t] * w[0, rows.signal[t]]
        slope[kept.into[0, t]] += c * x[0, rows.two[t]]
        slope[kept.into[1, t]] += c * x[0, rows.one[t]]
    for n in range(kept.pairs.shape[1]):
        k, i, g = kept.pairs[0, n], kept.pairs[1, n], slope[n]
        alone[k] += g * g * kept.softness[i]
        for p in range(r):
            J[k, p] += g * basis[i, p]
    for k in range(m):
        for n in range(k + 1):
            total = 0.0
            for p in range(r):
                total += J[k, p] * J[n, p]
            S[k, n] = total
    _factor(S, kept.inverse, alone, kept.void)


@embedded
def _factor(S, inverse, alone, void):  # type: ignore[no-untyped-def]
    """L D Lᵀ of S, in place; what says no more than those before it is passed over."""
    for k in range(len(S)):
        pivot = S[k, k]
        for n in range(k):
            y = S[k, n]
            for j in range(n):
                y -= S[k, j] * S[n, j]
            S[k, n] = y
        for n in range(k):
            y = S[k, n]
            S[k, n] = y * inverse[n]
            pivot -= y * S[k, n]
        inverse[k] = 1.0 / pivot if pivot > void[k] * alone[k] else 0.0


@embedded
def _multipliers(kept, rows):  # type: ignore[no-untyped-def]
    """S⁻¹ times the right sides that stand in the multipliers, in place."""
    S, inverse, x = kept.S, kept.inverse, rows.multipliers
    m = len(x)
    for k in range(m):
        for n in range(k):
            x[k] -= S[k, n] * x[n]
    for k in range(m - 1, -1, -1):
        x[k] *= inverse[k]
        for n in range(k + 1, m):
            x[k] -= S[n, k] * x[n]


@shared
def _correct(kept, rows, order):  # type: ignore[no-untyped-def]
    """Take the value of the constraints, or of their rates, from the unknowns, and keep along which motions."""
    for k in range(len(rows.value)):
        rows.multipliers[k] = rows.value[k]
    _multipliers(kept, rows)
    for p in range(len(kept.y)):
        change = 0.0
        for k in range(len(rows.value)):
            change -= kept.J[k, p] * rows.multipliers[k]
        kept.moved[order, p] += change
        for n in range(len(rows.used)):
            i = rows.used[n]
            rows.x[order, i] += kept.basis[i, p] * change


@embedded
def _move(kept, q, v):  # type: ignore[no-untyped-def]
    """Add to positions and velocities of all nodes what projections have found."""
    nodes = q.shape[1]
    for p in range(len(kept.y)):
        along, faster = kept.moved[0, p], kept.moved[1, p]
        for k in range(q.shape[0]):
            for i in range(nodes):
                q[k, i] += along * kept.fields[p, k * nodes + i]
                v[k, i] += faster * kept.fields[p, k * nodes + i]


@embedded
def find_kept(kept, a):  # type: ignore[no-untyped-def]
    """Accelerations along the motions, from the loads in a, (rows, nodes), that have arrived at each node."""
    if kept is not None:
        nodes = a.shape[1]
        for p in range(len(kept.y)):
            x = y = 0.0
            for k in range(0, a.shape[0], 2):
                for i in range(nodes):
                    x += kept.weights[p, k * nodes + i] * a[k, i]
                    y += kept.weights[p, k * nodes + nodes + i] * a[k + 1, i]
            kept.y[p] = x + y
        _allow(kept, kept.rows)


@embedded
def _allow(kept, rows):  # type: ignore[no-untyped-def]
    """Take from these accelerations what the constraints do not allow, and find the multipliers."""
    if rows is not None:
        for n in range(len(rows.used)):
            rows.x[2, rows.used[n]] = 0.0
        evaluate(rows, 2)
        r = len(kept.y)
        for k in range(len(rows.value)):
            total = rows.value[k]
            for p in range(r):
                total += kept.J[k, p] * kept.y[p]
            rows.multipliers[k] = total
        _multipliers(kept, rows)
        for k in range(len(rows.value)):
            for p in range(r):
                kept.y[p] -= kept.J[k, p] * rows.multipliers[k]


@embedded
def add_kept(kept, of, reaction, a):  # type: ignore[no-untyped-def]
    """Add the motions to accelerations, (rows, nodes), and to the reactions of driven clamps."""
    if kept is not None:
        nodes = a.shape[1]
        for p in range(len(kept.y)):
            y = kept.y[p]
            for k in range(a.shape[0]):
                for i in range(nodes):
                    a[k, i] += y * kept.fields[p, k * nodes + i]
        if len(reaction) > 0:
            for b in range(of.shape[1]):
                for side in range(2):
                    if of[side, b] >= 0:
                        for p in range(len(kept.y)):
                            for k in range(a.shape[0]):
                                reaction[of[side, b], k] += kept.y[p] * kept.reaction[p, side, b, k]
