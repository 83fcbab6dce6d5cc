"""Accelerations that satisfy the equations of motion and all constraints: at the start, and at outputs.

Implicit steps enforce constraints and drives as positions only. Accelerations along them may have an error that no step
removes (`generalized_alpha`), and so may reactions and section forces. Accelerations that follow from positions and
velocities at an output are found by a step of length zero, as at the start.
"""

from collections.abc import Callable, Iterator
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.kept_chains import light, once
from anctmm.forces.actuation import DrivenClamps, actuation_of
from anctmm.forces.connectors import TURN, count_turns
from anctmm.forces.driving import drive_table
from anctmm.integrators.implicit.system import Newton, System
from anctmm.integrators.locking import rows_in
from anctmm.integrators.output import Output, Record, output_times
from anctmm.integrators.static_start import turned_of_nodes
from anctmm.jit.compiling import uncompiled
from anctmm.model.drives import table_of
from anctmm.recursion.kept.rows import Rows, set_signals
from anctmm.results.whole_turns import WholeTurns

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Again = Callable[[Ints, System, Output], Callable[[int, Newton], int]]
"""(steps of outputs, system, output) → (number of one of them, Newton's iteration) → solves for its accelerations."""

#: Solutions with factors in single precision, each of which takes the error left times a rounding of them.
REFINED = 4
#: Error of accelerations along a constraint, of the largest of its terms, above which they are computed again.
OFF = 1e-3
#: Value, rate and acceleration of the number 1 in a product.
ONE = np.array([[[1.0]], [[0.0]], [[0.0]]])


def balanced(
    system: System,
    series: Array,
    drives: Array,
    solve: Callable[[int, Newton], int],
    turned: Array | None = None,
) -> None:
    """True accelerations of states; those of driven nodes are their drives'.

    Parameters
    ----------
    system : System
        Its state becomes the last one.
    series : ndarray, shape (3, n, rows, nodes)
        q, v and w of each state: w is written, and at driven nodes q and v.
    drives : ndarray, shape (n, drives, 3)
        Values, rates and accelerations.
    solve : callable
        Takes the k-th state's step with the coefficients `NO_STEP`, which turns the clamps. With factors in single
        precision the solution is refined.
    turned : ndarray, shape (n, nodes), optional
        Angles of nodes, where connectors need whole turns.
    """
    state, newton, connectors = system.state, system.newton, system.loads.connectors
    for node, held, motion in _motions(system.clamps, drives):
        series[:, :, :held, node] = motion
    loose = newton._replace(tolerance=np.inf)
    repeats = REFINED if system.factors.L.dtype == np.float32 else 1
    for k, (q, v, w) in enumerate(series.swapaxes(0, 1)):
        state.q[:], state.v[:], state.w[:], state.a[:] = q, v, w, w
        if turned is not None:
            count_turns(connectors, state.q, turned[k])
        newton.counts[2] = 1
        for _ in range(repeats):
            solve(k, loose)
        w[:] = state.w


def settle(chain: Chain, system: System, record: Record, kept: int, again: Again, out: Output) -> None:
    """Compute accelerations at outputs again where they violate constraints or drives.

    Parameters
    ----------
    chain : Chain
    system : System
        Of a run that has ended: its state is written, and what Newton's iteration found last; its counts stay.
    record : Record
        Whose accelerations are written.
    kept : int
        Number of outputs that are valid.
    again : callable
    out : Output
        Of the run.
    """
    rows, clamps = rows_in(system.factors.loops), system.clamps
    if not kept or (rows is None and not len(clamps.nodes)):
        return
    times = light(chain, output_times)[:kept]
    drives = drive_table(chain, once(chain, actuation_of), times, table_of)
    looks = list(_of_clamps(chain, clamps, drives, record.series[2, :kept])) if len(clamps.nodes) else []
    if rows is not None:
        looks.append(_of_rows(chain, rows, clamps, drives, record.series[:, :kept]))
    at = np.flatnonzero(reduce(np.logical_or, (_off(*look) for look in looks)))
    if not len(at):
        return
    found = record.series[:, at]
    turned = _turned(chain, system, record, kept)
    before = system.newton.counts.copy()
    solve = again(chain.run.output_steps[at], system, out)
    balanced(system, found, drives[at], solve, None if turned is None else turned[at])
    system.newton.counts[:] = before
    finite = np.isfinite(found[2])
    if not finite.all():
        whole = finite.all(axis=(1, 2))
        at, found = at[whole], found[:, whole]
    record.series[2, at] = found[2]


def _off(errors: Array, sizes: Array) -> NDArray[np.bool_]:
    """At which outputs, (n,), an error is large beside the largest term of its constraint."""
    return np.logical_or.reduce(errors > OFF * np.maximum.reduce(sizes, axis=1, keepdims=True))  # type: ignore[no-any-return]


def _turned(chain: Chain, system: System, record: Record, kept: int) -> Array | None:
    """Angles of nodes at outputs, (kept, nodes), where connectors need whole turns."""
    connectors = system.loads.connectors
    if connectors is None or not (connectors.kinds == TURN).any():
        return None
    times = chain.run.times(chain.run.output_steps[:kept])
    return turned_of_nodes(chain, WholeTurns(chain.scene, record.fields(kept), times))


def _motions(clamps: DrivenClamps, drives: Array) -> Iterator[tuple[int, int, Array]]:
    """Node of each driven clamp, the number of coordinates that it holds, and their q, v and w, (3, states, held).

    The place is fixed; of a vector g in the reference they are e^iθ g, iθ' e^iθ g and (iθ'' − θ'²) e^iθ g.
    """
    for h, (node, held) in enumerate(zip(clamps.nodes.tolist(), clamps.held.tolist(), strict=True)):
        angle, rate, second = drives[:, h].T
        turn = np.exp(1j * angle)
        motion = np.zeros((3, len(drives), held))
        motion[0, :, :2] = clamps.reference[h, :2]
        turns = np.array([turn, 1j * rate * turn, (1j * second - rate**2) * turn])
        vectors = clamps.reference[h, 2:held].view(np.complex128)
        motion[:, :, 2:] = np.multiply.outer(turns, vectors).view(np.float64)
        yield node, held, motion


def _of_clamps(chain: Chain, clamps: DrivenClamps, drives: Array, a: Array) -> Iterator[tuple[Array, Array]]:
    """Errors of accelerations at each driven clamp, (vectors, outputs), and their sizes, as reactions have them."""
    shares = once(chain, _shares)
    for share, (node, held, motion) in zip(shares, _motions(clamps, drives), strict=True):
        exact = motion[2, :, 2:].view(np.complex128).T
        off = a[:, 2:held, node] - motion[2, :, 2:]
        yield share * np.abs(off.view(np.complex128)).T, np.abs(exact)


def _shares(chain: Chain) -> list[float]:
    """Of each driven clamp the part of the moment of inertia of its beam that the gradient there has.

    At the end of a beam of n elements it is 1/(35 n³), m L²/105 of an element of length L beside m L² n³/3; a rigid
    body has all of it in its one node.
    """
    ends = (end for end, _ in once(chain, actuation_of).driven)
    elements = (chain.bodies.mesh(name).elements for name, _ in ends)
    return [1.0 / (35.0 * n**3) if n else 1.0 for n in elements]


class _Terms(NamedTuple):
    """Terms c w x_i x_j of constraints, those of one after those of another, with x_i a direction where x_j is a place.

    order: of each among the terms of the rows. places: of x_i and x_j among the coordinates of an output, (2, terms).
    ones: where they are the number 1 instead, if anywhere. weights: c of the three parts x_i a_j, v_i v_j, a_i x_j of
    (x_i x_j)'', (3, 1, terms). first: term of each constraint. group: first term of those of one constraint that have
    one x_i and places as x_j, or of one term alone; whole: first group of each constraint.
    """

    order: Ints
    places: Ints
    ones: NDArray[np.bool_] | None
    weights: Array
    first: Ints
    group: Ints
    whole: Ints


def _terms(rows: Rows, nodes: int) -> _Terms:
    """Terms of constraints between the coordinates of so many nodes."""
    unknowns, one = np.array([rows.one, rows.two]), rows.x.shape[1] - 1
    direction = (unknowns != one) & (rows.homes[0, unknowns] >= 2)
    mixed = direction[0] != direction[1]
    unknowns = np.where(mixed & direction[1], unknowns[::-1], unknowns)
    # a number of its own for each term that is in no group
    member = np.where(mixed, unknowns[0], one + 1 + np.arange(len(rows.row)))
    order = np.lexsort((member, rows.signal, rows.row))
    unknowns, row, member = unknowns[:, order], rows.row[order], member[order]
    keys = np.array([row, rows.signal[order], member])
    group = np.flatnonzero(np.any(np.diff(keys, prepend=-1), axis=0))
    first = np.flatnonzero(np.diff(row, prepend=-1))
    home, node = rows.homes[:, unknowns]
    weights = np.multiply.outer([1.0, 2.0, 1.0], rows.factor[order])[:, None]
    ones = unknowns == one
    whole = np.searchsorted(group, first)
    return _Terms(order, home * nodes + node, ones if ones.any() else None, weights, first, group, whole)


def _of_rows(
    chain: Chain, rows: Rows, clamps: DrivenClamps, drives: Array, series: Array
) -> tuple[Array, Array]:
    """Errors of the constraints' second derivatives, (constraints, outputs), and the sizes of their terms.

    Places count relative to each other: where the origin is, and how fast it moves, changes no size.
    """
    of = once(chain, lambda _: _terms(rows, series.shape[3]), what=_terms)
    known = series.reshape(*series.shape[:2], -1)[:, :, of.places]
    if of.ones is not None:
        known[:, :, of.ones] = ONE
    one, two = known[:, :, 0], known[:, :, 1]
    terms = one * two[::-1] * of.weights
    if len(rows.turns):
        terms = _driven(terms, one, two, rows, of.order, drives, len(clamps.nodes))
    errors = np.add.reduceat(np.add.reduce(terms), of.first, axis=1)
    together = np.add.reduceat(terms[1:3], of.group, axis=2)
    alone = np.abs(terms[0]) + np.add.reduce(np.abs(terms[3:]))
    sizes = np.add.reduceat(alone, of.first, axis=1)
    sizes += np.add.reduceat(np.add.reduce(np.abs(together)), of.whole, axis=1)
    return np.abs(errors).T, sizes.T


def _driven(
    terms: Array, one: Array, two: Array, rows: Rows, order: Ints, drives: Array, first: int
) -> Array:
    """Parts of (w x_i x_j)'' from those of (x_i x_j)'', with the signals w of drives from the first on."""
    signals = np.zeros((*rows.signals.shape, len(drives)))
    signals[0, 0] = 1.0
    uncompiled(set_signals)(rows._replace(signals=signals), drives.transpose(1, 2, 0), first)
    w, rate, second = signals[:, rows.signal[order]].swapaxes(1, 2)
    (xi, vi, _), (xj, vj, _) = one, two
    changed = np.array([2.0 * rate * (vi * xj + xi * vj), second * xi * xj])
    return np.concatenate([w * terms, rows.factor[order] * changed])
