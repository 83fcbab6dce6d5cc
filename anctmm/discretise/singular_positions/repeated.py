"""Constraints that repeat others, where joints hold a rigid body more than once, and those that nearly do.

The rank of J is the same in all positions of a mechanism but singular ones, where it is smaller. A constraint that is
independent of others where the motion starts therefore repeats none of them later, however small its pivot becomes near
a singular position, or beside bodies that are much lighter than others.

Long chains have small singular values without a small pivot. What decides is therefore what the constraints before it,
in the order of elimination, leave of each.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.junctions.as_written import body_as_written
from anctmm.discretise.junctions.constraints import ONE, Constraints
from anctmm.discretise.kept import KeptUnknowns
from anctmm.discretise.singular_positions.dependence import MOTIONS, NONE, PARTING
from anctmm.errors import DiscretisationError, listed

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

#: Part of −J M⁻¹ Jᵀ that those before it leave of a constraint that repeats them, up to which the recursion passes it
#: over: where Newton's iteration or a projection is on its way, positions are off, and the square of that is left.
REPEATED = 1e-4
#: The same of a constraint that repeats none, and where nothing is known: what steps and Newton's iteration leave open
#: there, divided by the distance to a singular position, would move bodies farther than that distance.
PASSING = 1e-9
#: The same in parts of the pivot where the motion starts, if that is small already, and the least: rounding.
FALL, LEAST = 0.01, 1e-14
#: What is left of a constraint that nearly repeats others, relative to its size.
NEARLY = 3e-5
#: Part that is left below which a constraint is looked at more closely; eigenvalue above which none needs it.
SUSPECT, CLEAR = 1e-8, 1e-6
#: What keeps pivots from vanishing, above rounding.
APART = 1e-14
#: Steps of iterative refinement.
REFINED = 3
#: Constraints up to which a full matrix is quicker, as measured; suspects that are looked at together.
FEW, TOGETHER = 64, 256


class _Factors(NamedTuple):
    """Pivots of a matrix, and what solves its equations."""

    pivots: Array
    solve: Callable[[Array], Array]


class Near(NamedTuple):
    """Stress λ of constraints, of one that others nearly repeat 1, and how far λᵀJ is from none."""

    stress: Array
    off: float


def passed_over(kept: KeptUnknowns, order: Ints) -> Array:
    """Part of each constraint up to which the recursion takes it to repeat those before it.

    Parameters
    ----------
    kept : KeptUnknowns
    order : ndarray of int, shape (rows,)
        Constraints in the order of elimination.

    Returns
    -------
    ndarray, shape (rows,)

    Raises
    ------
    DiscretisationError
        If joints nearly hold bodies in the same way twice, or nearly stop them: bars that are nearly straight between
        their supports, cranks that are nearly parallel. Reactions there are mostly rounding.
    """
    found = kept.constraints
    shape = len(found.names), found.size
    bounds = np.full(shape[0], PASSING)
    if not found.names:
        return bounds
    values, places = _entries(found, kept.chain.bodies.reference()[tuple(kept.homes)])
    masses = _masses(kept)
    softness = 1.0 / np.sqrt(np.where(masses > 0.0, masses, 1.0))
    if shape[0] <= FEW:
        full = np.zeros(shape)
        np.add.at(full, places, values)
        pivots = _pivots((full * softness)[order]) if _apart(full) else None
        if pivots is not None:
            bounds[order] = _bounds(pivots)
            return bounds
    J = scipy.sparse.csr_array((values, places), shape=shape)
    A: Any = _sized(J)[order]
    B: Any = _rows_sized(_times(J, softness))[order]
    if shape[0] <= FEW:
        A, B = A.toarray(), B.toarray()
    told, factors = _told_apart(A), _cholesky(B)
    if told is None or factors is None:
        return bounds
    repeated, near = told
    if near is not None:
        strained = np.abs(near.stress) @ abs(A) > PARTING * np.abs(near.stress).max()
        raise DiscretisationError(_hardly_apart(_bodies_at(kept, strained), near.off))
    bounds[order] = _bounds(factors.pivots)
    # What repeats others in one position alone would have been refused before, but of what beams and drives move.
    bounds[order[repeated]] = REPEATED if _solid(kept) and not found.drives else PASSING
    return bounds


def _bounds(pivots: Array) -> Array:
    """Bounds of constraints that repeat no others, by their pivots where the motion starts."""
    return np.clip(FALL * pivots, LEAST, PASSING)


def _masses(kept: KeptUnknowns) -> Array:
    """Masses of the kept unknowns: of rigid bodies exact, of beams those of the element at the node."""
    bodies, (row, node) = kept.chain.bodies, kept.homes
    of = np.searchsorted(bodies.first, node, side="right") - 1
    return np.asarray(bodies.masses[of, row // 2, row // 2])


def _solid(kept: KeptUnknowns) -> bool:
    """Whether no beam has a part in any constraint: `dead_centres` and `rigid_loops` have looked at all of them."""
    bodies = kept.chain.bodies
    of = np.searchsorted(bodies.first, kept.homes[1], side="right") - 1
    solid = np.array([mesh.nodes == 1 for mesh in bodies.meshes])[of]
    return bool(solid[[k for term in kept.constraints.terms for k in (term.one, term.two) if k != ONE]].all())


def _bodies_at(kept: KeptUnknowns, unknowns: Mask) -> str:
    """Bodies that some of the kept unknowns belong to: rigid ones, if there are any."""
    chain = kept.chain
    of = np.searchsorted(chain.bodies.first, kept.homes[1][unknowns], side="right") - 1
    names = [body_as_written(chain.parts, chain.bodies.meshes[b].body.name) for b in of]
    return listed(dict.fromkeys([name for name in names if name in chain.rigid] or names))


def _hardly_apart(bodies: str, by: float) -> str:
    """Text of an error for bodies that are listed, whose equations are that far from depending on each other."""
    return (
        f"bodies {bodies} are rigid, and joints nearly hold them in the same way twice, or nearly stop them: but for "
        f"{by:.1g} of what they do, which is too little; place them exactly so, or farther from it, or make one of "
        f"them flexible ('cable' or 'shear')"
    )


def _entries(found: Constraints, x: Array) -> tuple[Array, tuple[Ints, Ints]]:
    """Entries of J at t = 0, and their rows and columns; those of one place add up."""
    signals = [1.0]
    for drive in found.drives:  # they start at 0
        signals += [1.0, 0.0] if drive.turns else [0.0]
    row, one, two, signal = np.array([term[:4] for term in found.terms], dtype=np.int64).T
    factor = np.array([term.factor for term in found.terms]) * np.array(signals)[signal]
    x = np.append(x, 1.0)  # the last stands for ONE, which is −1
    values, rows = np.concatenate([factor * x[two], factor * x[one]]), np.append(row, row)
    columns = np.append(one, two)
    unknown = columns != ONE
    return values[unknown], (rows[unknown], columns[unknown])


def _sized(J: "scipy.sparse.csr_array") -> "scipy.sparse.csr_array":
    """J with columns of largest entry 1, whatever the masses, then rows of size 1.

    Of small bodies the entry of a turn is small, but no less certain.
    """
    largest = np.zeros(J.shape[1])
    np.maximum.at(largest, J.indices, np.abs(J.data))
    return _rows_sized(_times(J, 1.0 / np.where(largest > 0.0, largest, 1.0)))


def _times(J: "scipy.sparse.csr_array", sizes: Array) -> "scipy.sparse.csr_array":
    """J for unknowns of other sizes."""
    return scipy.sparse.csr_array((J.data * sizes[J.indices], J.indices, J.indptr), shape=J.shape)


def _rows_sized(J: "scipy.sparse.csr_array") -> "scipy.sparse.csr_array":
    """J with rows of size 1."""
    sizes = np.sqrt(J.multiply(J).sum(axis=1))
    return scipy.sparse.csr_array(scipy.sparse.diags_array(1.0 / np.where(sizes > 0.0, sizes, 1.0)) @ J)


def _apart(J: Array) -> bool:
    """Whether no row of few depends on others, by far."""
    largest = np.abs(J).max(axis=0)
    S = _gram(J / np.where(largest > 0.0, largest, 1.0))
    S.flat[:: len(S) + 1] -= CLEAR
    try:
        np.linalg.cholesky(S)
    except np.linalg.LinAlgError:
        return False
    return True


def _pivots(J: Array) -> Array | None:
    """What the rows before each leave of it; None where rounding hides that."""
    try:
        return np.asarray(np.linalg.cholesky(_gram(J)).diagonal() ** 2)
    except np.linalg.LinAlgError:
        return None


def _gram(J: Array) -> Array:
    """J Jᵀ for rows of size 1."""
    S = J @ J.T
    sizes = np.sqrt(S.diagonal())
    scale = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    return np.asarray(S * scale * scale[:, None])


def _told_apart(A: Any) -> tuple[Mask, Near | None] | None:
    """Rows of a matrix, sparse or not, that repeat rows before them, and what nearly does so; or None.

    What the others leave of a suspect is the residual of a problem of least squares, min ‖Aₖᵀ − Aᵀλ‖. It is computed
    from the normal equations, with iterative refinement (corrected seminormal equations; Björck, Numerical Methods for
    Least Squares Problems, 1996, 6.6.5): its error is that of rounding, and not the root of it, as that of a pivot.
    """
    repeated = np.zeros(A.shape[0], dtype=bool)
    factors = _cholesky(A)
    if factors is None:
        return None
    suspects = np.flatnonzero(factors.pivots <= SUSPECT)
    if not suspects.size:
        return repeated, None
    others = np.setdiff1d(np.arange(A.shape[0]), suspects)
    factors = _cholesky(A[others]) if others.size else None
    if factors is None:
        return None
    left = _Left(A, suspects, others, factors)
    draws = np.random.default_rng(0).standard_normal((suspects.size, MOTIONS))
    if _exact(*left.of(draws), left.rounding).all():  # they all repeat others
        repeated[suspects] = True
        return repeated, None
    return _one_by_one(left, repeated)


def _one_by_one(left: "_Left", repeated: Mask) -> tuple[Mask, Near | None]:
    """The same of suspects of which some repeat no others: these are known to those after them."""
    known = np.zeros((left.A.shape[1], 0))
    for first in range(0, left.suspects.size, TOGETHER):
        few = left.suspects[first : first + TOGETHER]
        stress, rest = left.of(np.eye(left.suspects.size, len(few), -first))
        rest -= known @ (known.T @ rest)
        for k, row in enumerate(few):
            off = float(np.linalg.norm(rest[:, k]))
            if _exact(stress[:, [k]], rest[:, [k]], left.rounding).all():
                repeated[row] = True
            elif off <= NEARLY:
                return repeated, Near(stress[:, k], off)
            else:
                new = rest[:, [k]] / off
                known = np.append(known, new, axis=1)
                rest -= new @ (new.T @ rest)
    return repeated, None


def _exact(stress: Array, rest: Array, rounding: float) -> Mask:
    """Which stresses λ are states of self-stress, as far as rounding tells, by what λᵀA is."""
    off = np.linalg.norm(rest, axis=0)
    return np.asarray(off <= np.maximum(NONE, rounding * np.abs(stress).max(axis=0)))


class _Left:
    """What other rows leave of suspects."""

    def __init__(self, A: Any, suspects: Ints, others: Ints, factors: _Factors) -> None:
        self.A, self.suspects, self.others, self.factors = A, suspects, others, factors
        self.rest = A[others]
        known = np.random.default_rng(1).standard_normal((len(others), 1))
        missed = self._refined(np.zeros_like(known), self.rest.T @ known)
        #: Size of what counts as none: rounding, as found where nothing is left.
        self.rounding = 10.0 * float(np.linalg.norm(missed) / np.abs(known).max())

    def _refined(self, stress: Array, fixed: Array) -> Array:
        """Make `stress` of the other rows what leaves least of the sums that are given; returns that."""
        for _ in range(REFINED):
            stress -= self.factors.solve(self.rest @ (fixed + self.rest.T @ stress))
        return np.asarray(fixed + self.rest.T @ stress)

    def of(self, parts: Array) -> tuple[Array, Array]:
        """Stresses λ of sums of suspects, (suspects, k), and how far λᵀA is from none."""
        stress = np.zeros((self.A.shape[0], parts.shape[1]))
        stress[self.suspects] = parts
        others = np.zeros((len(self.others), parts.shape[1]))
        left = self._refined(others, self.A[self.suspects].T @ parts)
        stress[self.others] = others
        return stress, left


def _cholesky(A: Any) -> _Factors | None:
    """Factors of A Aᵀ whose pivots are what the rows before each leave of it; None where they are none."""
    if isinstance(A, np.ndarray):
        try:
            L = np.linalg.cholesky(A @ A.T + APART * np.eye(len(A)))
        except np.linalg.LinAlgError:  # rounding is more than that: pivots of both signs tell as much
            return _cholesky(scipy.sparse.csr_array(A))
        return _Factors(np.square(L.diagonal()), partial(scipy.linalg.cho_solve, (L, True)))
    S = (A @ A.T + APART * scipy.sparse.eye_array(A.shape[0])).tocsc()
    try:
        found = scipy.sparse.linalg.splu(
            S, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:  # a pivot of zero
        return None
    return _Factors(found.U.diagonal(), found.solve) if np.array_equal(found.perm_r, found.perm_c) else None
