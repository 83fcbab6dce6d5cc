"""Accelerations that balance the forces of a state and keep all constraints: at the start, and at outputs.

Implicit steps keep constraints and drives as positions alone. Accelerations along them may be wrong by a part that no
step takes away (`generalized_alpha`), and with them reactions and section forces. Those of positions and velocities at
an output follow by a step of no length, as at the start.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables
from anctmm.discretise.chain import Chain
from anctmm.discretise.kept_chains import once
from anctmm.forces.actuation import DrivenClamps, turn_clamps
from anctmm.forces.connectors import TURN, count_turns
from anctmm.forces.driving import drive_table
from anctmm.integrators.implicit.system import Newton, System
from anctmm.integrators.locking import rows_in
from anctmm.integrators.output import Output, Record, actuation_of
from anctmm.integrators.static_start import turned_of_nodes
from anctmm.jit.compiling import uncompiled
from anctmm.recursion.rows import Rows, set_signals
from anctmm.results.whole_turns import WholeTurns

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Again = Callable[[Ints, System, Output], Callable[[int, Newton], int]]
"""(steps of outputs, system, room) → (number of an output, Newton's iteration) → solves for its accelerations."""

#: Solutions with factors in single precision, each of which takes the error left times a rounding of them.
REFINED = 4
#: Error of accelerations along a constraint, of the largest of its terms in the run, above which they are found anew.
OFF = 1e-3


def balanced(system: System, drives: Array, solve: Callable[[Newton], int]) -> None:
    """True accelerations of the present state; those of driven nodes are their drives'.

    Parameters
    ----------
    system : System
        Of its state w and a are written, and at driven nodes q and v.
    drives : ndarray, shape (drives, 3)
        Values, rates and accelerations.
    solve : callable
        Takes a step with the coefficients `NO_STEP`. With factors in single precision the solution is refined.
    """
    state, clamps, newton = system.state, system.clamps, system.newton
    uncompiled(turn_clamps)(clamps, drives)
    for field, motion in zip((state.q, state.v, state.w), clamps.motion, strict=True):
        for h, held in enumerate(clamps.held):
            field[:held, clamps.nodes[h]] = motion[h, :held]
    newton.counts[2] = 1
    for _ in range(REFINED if system.factors.L.dtype == np.float32 else 1):
        solve(newton._replace(tolerance=np.inf))


def settle(chain: Chain, system: System, record: Record, kept: int, again: Again) -> None:
    """Find accelerations of outputs anew where they break constraints or drives.

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
    """
    rows, clamps = rows_in(system.factors.loops), system.clamps
    if not kept or (rows is None and not len(clamps.nodes)):
        return
    steps = chain.run.output_steps[:kept]
    drives = drive_table(chain, once(chain, actuation_of), chain.run.times(steps))
    off = np.zeros(kept, dtype=bool)
    for errors, sizes in (
        _of_clamps(system.tables, clamps, drives, record.a[:kept]),
        _of_rows(rows, clamps, drives, record),
    ):
        off |= (errors > OFF * sizes.max(axis=1, initial=0.0)[:, None]).any(axis=0)
    if not off.any():
        return
    turned = _turned(chain, system, record, kept)
    solve, state, counts = again(steps[off], system, record.arrays()), system.state, system.newton.counts
    before = counts.copy()
    for k, n in enumerate(np.flatnonzero(off)):
        state.q[:], state.v[:], state.w[:] = record.q[n], record.v[n], record.a[n]
        state.a[:] = state.w
        if turned is not None:
            count_turns(system.loads.connectors, state.q, turned[n])
        balanced(system, drives[n], lambda newton, k=k: solve(k, newton))  # type: ignore[misc]
        if np.isfinite(state.w).all():
            record.a[n] = state.w
    counts[:] = before


def _turned(chain: Chain, system: System, record: Record, kept: int) -> Array | None:
    """Angles of nodes at outputs, (kept, nodes), where connectors ask for whole turns."""
    connectors = system.loads.connectors
    if connectors is None or not (connectors.kinds == TURN).any():
        return None
    times = chain.run.times(chain.run.output_steps[:kept])
    return turned_of_nodes(chain, WholeTurns(chain.scene, record.fields(kept), times))


def _of_clamps(tables: Tables, clamps: DrivenClamps, drives: Array, a: Array) -> tuple[Array, Array]:
    """Errors of accelerations at driven clamps, (coordinates, outputs), and their sizes, as far as reactions have them.

    The gradient at the end of a beam of n elements has 1/(35 n³) of its moment of inertia, m L²/105 of an element of
    length L beside m L² n³/3; a rigid body has all of it in its one node.
    """
    errors, sizes = [np.zeros((0, len(a)))], [np.zeros((0, len(a)))]
    for h, (node, held) in enumerate(zip(clamps.nodes, clamps.held, strict=True)):
        elements = min(np.diff(tables.first)[(clamps.of == h).any(axis=0)] - 1, default=0)
        share = 1.0 / (35.0 * elements**3) if elements else 1.0
        g = clamps.reference[h, 2:held:2] + 1j * clamps.reference[h, 3:held:2]
        angle, rate, second = drives[:, h].T
        exact = np.outer(g, (1j * second - rate**2) * np.exp(1j * angle))
        errors.append(share * np.abs(a[:, 2:held:2, node] + 1j * a[:, 3:held:2, node] - exact.T).T)
        sizes.append(np.abs(exact))
    return np.concatenate(errors), np.concatenate(sizes)


def _of_rows(rows: Rows | None, clamps: DrivenClamps, drives: Array, record: Record) -> tuple[Array, Array]:
    """Errors of the constraints' second derivatives, (constraints, outputs), and the sizes of their terms."""
    n = len(drives)
    if rows is None:
        return np.zeros((0, n)), np.zeros((0, n))
    x, v, a = np.zeros((3, rows.x.shape[1], n))
    x[-1] = 1.0  # the last place stands for the number 1
    for to, series in ((x, record.q), (v, record.v), (a, record.a)):
        to[rows.used] = series[:n, rows.homes[0, rows.used], rows.homes[1, rows.used]].T
    signals = np.zeros((*rows.signals.shape, n))
    signals[0, 0] = 1.0
    uncompiled(set_signals)(rows._replace(signals=signals), np.moveaxis(drives, 0, -1), len(clamps.nodes))
    w, rate, second = signals[:, rows.signal]
    i, j = rows.one, rows.two
    terms = (
        w * a[i] * x[j], w * x[i] * a[j], 2.0 * w * v[i] * v[j],
        2.0 * rate * (v[i] * x[j] + x[i] * v[j]), second * x[i] * x[j],
    )  # fmt: skip
    errors, sizes = np.zeros((2, len(rows.value), n))
    np.add.at(errors, rows.row, rows.factor[:, None] * sum(terms))
    np.add.at(sizes, rows.row, np.abs(rows.factor)[:, None] * sum(map(np.abs, terms)))
    return np.abs(errors), sizes
