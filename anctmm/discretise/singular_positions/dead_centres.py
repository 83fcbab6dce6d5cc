"""Dead centres: rigid bodies on guides or in hinges whose motion is possible to first order, but blocked beyond it.

This is the second-order test of `rigid_loops`, with all constraints of the scene instead of the equations of its pins.
Example: a body that is hinged, and guided across the line to its hinge. Constraints on which beams act are left out,
because beams deform. Drives have their values at t = 0.
"""

from collections.abc import Iterable, Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.junctions.constraints import ALWAYS, ONE, Constraints, Term
from anctmm.discretise.kept import KeptUnknowns
from anctmm.discretise.singular_positions.dependence import PARTING, stress_of
from anctmm.errors import DiscretisationError, listed
from anctmm.model.topology import Sets

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Connected constraints up to which they are tested where a dense decomposition is needed.
MOST = 1000


def check_dead_centres(kept: KeptUnknowns) -> None:
    """Refuse rigid bodies whose guides and hinges stop them where they stand.

    Parameters
    ----------
    kept : KeptUnknowns
        Of the scene.

    Raises
    ------
    DiscretisationError
        Naming the bodies.
    """
    chain = kept.chain
    if not chain.rigid or not any(junction.guides or junction.hinges for junction in chain.junctions):
        return
    found = kept.constraints
    meshes = chain.bodies.meshes
    of_unknown = np.searchsorted(chain.bodies.first, kept.homes[1], side="right") - 1
    solid = np.array([mesh.nodes == 1 for mesh in meshes])[of_unknown]
    give = {term.row for term in found.terms for k in (term.one, term.two) if k != ONE and not solid[k]}
    x = chain.bodies.reference()[tuple(kept.homes)]
    scale = np.where(kept.homes[0] < 2, chain.length, 1.0)
    for terms in _connected(term for term in _at_start(found) if term.row not in give):
        stopped = _stopped(terms, x, scale)
        if len(stopped):
            names = listed(
                dict.fromkeys(
                    n for n in (meshes[k].body.name for k in of_unknown[stopped]) if n in chain.rigid
                )
            )
            raise DiscretisationError(
                f"bodies {names} are rigid and at a dead centre of their joints and guides: a motion that is "
                f"free to first order is blocked beyond it; start from another position, or make one of them flexible "
                f"('cable' or 'shear')"
            )


def _at_start(found: Constraints) -> Iterator[Term]:
    """Terms of constraints, their factors times their signals at t = 0: 1, or the cosine of a drive's angle."""
    ones = {ALWAYS}
    at = 1
    for drive in found.drives:
        ones |= {at} if drive.turns else set()
        at += drive.signals
    return (term for term in found.terms if term.signal in ones)


def _connected(terms: Iterable[Term]) -> list[list[Term]]:
    """Terms of constraints that are connected by their unknowns."""
    every, sets = list(terms), Sets[tuple[str, int]]()
    for term in every:
        for k in (term.one, term.two):
            if k != ONE:
                sets.unite(("row", term.row), ("unknown", k))
    groups: dict[tuple[str, int], list[Term]] = {}
    for term in every:
        groups.setdefault(sets.of(("row", term.row)), []).append(term)
    return list(groups.values())


def _stopped(terms: list[Term], x: Array, scale: Array) -> Ints:
    """Unknowns at which constraints strain each other that part in second order; none where all can move on."""
    rows = {row: k for k, row in enumerate(dict.fromkeys(term.row for term in terms))}
    unknowns = sorted({k for term in terms for k in (term.one, term.two) if k != ONE})
    number = {k: i for i, k in enumerate(unknowns)}
    entries = [
        (rows[term.row], number[one], term.factor * scale[one] * (1.0 if two == ONE else x[two]))
        for term in terms
        for one, two in ((term.one, term.two), (term.two, term.one))
        if one != ONE
    ]
    row, column, values = np.array(entries).reshape(-1, 3).T
    J = scipy.sparse.csr_array(
        (values, (row.astype(int), column.astype(int))), shape=(len(rows), len(number))
    )

    def curved(motions: Array) -> Array:
        products = [term for term in terms if ONE not in (term.one, term.two)]
        row, i, j = (
            np.array([(rows[c.row], number[c.one], number[c.two]) for c in products], np.int64)
            .reshape(-1, 3)
            .T
        )
        sizes = np.array([2.0 * c.factor * scale[c.one] * scale[c.two] for c in products])
        shape = len(rows), len(products)
        second = scipy.sparse.csr_array((sizes, (row, np.arange(len(products)))), shape=shape)
        return np.asarray(second @ (motions[i] * motions[j]))

    stress = stress_of(J, curved, MOST)
    if stress is None:
        return np.empty(0, dtype=np.int64)
    return np.array(unknowns)[(np.abs(stress) @ abs(J)) > PARTING]
