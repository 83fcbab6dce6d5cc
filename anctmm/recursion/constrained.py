"""Constraints between kept unknowns within a step: projections, accelerations, Newton corrections.

An explicit step violates the constraints by an error of h³. It is removed from positions and then from velocities by
the projection that is nearest in the metric of the mass, M Δq = −Jᵀμ. Only the small system of kept unknowns is
factored for it; the rest of the scene follows in one backward sweep.
"""

from anctmm.jit.compiling import embedded, kernel, shared
from anctmm.recursion.kept.loops import Loops
from anctmm.recursion.kept.rows import (
    CORRECTIONS,
    ENOUGH,
    KEPT,
    OFF,
    Array,
    ask,
    ask_whole,
    evaluate,
    fill_rows,
    gather,
    prescribe,
    push,
    row_power,
    row_work,
    set_signals,
    take_multipliers,
)
from anctmm.recursion.kept.sparse import factorize_rows, solve_kept
from anctmm.recursion.riccati import BlockFactors, follow_unknowns, meet_inboard
from anctmm.recursion.scratch import vectors


@kernel
def constrain_motion(
    factors: BlockFactors, loops: Loops, first: int, drives: Array, q: Array, v: Array, a: Array
) -> bool:
    """Take from positions and velocities what they have beside the constraints; the matrix is factored for q then.

    Parameters
    ----------
    factors : BlockFactors
        Of the mass.
    loops : Loops
        Those of the factors.
    first : int
        Number of drives before those of constraints.
    drives : ndarray, shape (drives, 3)
        Values, rates and accelerations.
    q, v : ndarray, shape (rows, nodes)
    a : ndarray, shape (rows, nodes)
        Scratch.

    Returns
    -------
    bool
        Whether the constraints are kept: they are not where joints and drives leave bodies no place.
    """
    rows, matrix = loops.rows, loops.matrix
    set_signals(rows, drives, first)
    prescribe(rows, 0, q)
    gather(rows, 0, q)
    prescribe(rows, 1, v)
    for k in range(len(loops.moved)):
        loops.moved[k] = 0.0
    largest = found = evaluate(rows, 0)
    for _ in range(CORRECTIONS):
        if largest <= OFF:
            break
        fill_rows(rows, matrix)
        factorize_rows(matrix)
        before = largest
        _solve(loops)
        for k in range(len(loops.moved)):
            loops.moved[k] += loops.x[k]
        for n in range(len(rows.used)):
            rows.x[0, rows.used[n]] += loops.x[rows.used[n]]
        largest = evaluate(rows, 0)
        if before <= ENOUGH:
            break
    if not found <= OFF:
        spread(factors, loops, a, q)
        gather(rows, 0, q)
    if not largest <= KEPT:
        return False
    fill_rows(rows, matrix)
    factorize_rows(matrix)
    gather(rows, 1, v)
    if evaluate(rows, 1) > 0.0:
        _solve(loops)
        for k in range(len(loops.moved)):
            loops.moved[k] = loops.x[k]
        spread(factors, loops, a, v)
        gather(rows, 1, v)
    return True


@shared
def _solve(loops):  # type: ignore[no-untyped-def]
    """Changes of the kept unknowns that take away the value of the constraints, with the least work of inertia."""
    for k in range(len(loops.x)):
        loops.x[k] = 0.0
    ask(loops.rows, loops.x)
    solve_kept(loops.matrix, loops.x)


@shared
def spread(factors, loops, a, u):  # type: ignore[no-untyped-def]
    """Add to u the changes of all nodes, a, that those of the kept unknowns, `moved`, bring: a backward sweep."""
    size, L, _, wide, work, _, places, _ = factors
    d = len(size)
    _, _, found, _ = vectors(size)
    for k in range(len(loops.x)):
        loops.x[k] = loops.moved[k]
    for k in range(d):
        work[found + k] = 0.0
    for place in range(len(places.at) - 1, -1, -1):
        meet_inboard(size, places, loops, place, a.T, work)
        begin = places.at[place - 1] if place > 0 else 0
        for i in range(places.at[place] - 1, begin - 1, -1):
            follow_unknowns(size, L, wide, loops, i, work)
            for k in range(d):
                a[k, i] = work[found + k]
                u[k, i] += a[k, i]


@embedded
def ask_accelerations(loops):  # type: ignore[no-untyped-def]
    """Ask the next solution for accelerations that constraints allow, at the positions and velocities gathered."""
    rows = loops.rows
    for n in range(len(rows.used)):
        rows.x[2, rows.used[n]] = 0.0
    evaluate(rows, 2)
    ask(rows, loops.load)


@embedded
def take_accelerations(loops):  # type: ignore[no-untyped-def]
    """Take the multipliers that the solution for accelerations has found."""
    take_multipliers(loops.rows, loops.x, loops.load, 0.0)


@embedded
def ask_anew(factors, loops, first, drives, q, v, a):  # type: ignore[no-untyped-def]
    """Prepare the next solution for accelerations at a restart, and project positions and velocities."""
    if loops is not None:
        constrain_motion(factors, loops, first, drives, q, v, a)
        ask_accelerations(loops)


@embedded
def take_anew(loops):  # type: ignore[no-untyped-def]
    """Store the multipliers of the prepared solution."""
    if loops is not None:
        take_accelerations(loops)
        end_newton(loops)


@embedded
def set_drives(loops, drives, first):  # type: ignore[no-untyped-def]
    """What drives the constraints at the end of the step, (drives, 3); those from `first` on are theirs."""
    if loops is not None:
        set_signals(loops.rows, drives, first)


@kernel
def ask_equilibrium(loops: Loops, q: Array) -> float:
    """Prepare the next static solution to remove the values of the constraints, and return the largest of these."""
    rows = loops.rows
    gather(rows, 0, q)
    largest = evaluate(rows, 0)
    ask_whole(rows, loops.load)
    return largest  # type: ignore[no-any-return]


@kernel
def take_equilibrium(loops: Loops, keep: bool) -> None:
    """Take the multipliers that a static solution has found, or `keep` those that were."""
    rows = loops.rows
    for k in range(len(rows.number)):
        if not keep:
            rows.multipliers[k] = loops.x[rows.number[k]]
        loops.load[rows.number[k]] = 0.0
    for n in range(len(rows.used)):
        loops.load[rows.used[n]] = 0.0


@embedded
def begin_newton(loops):  # type: ignore[no-untyped-def]
    """Start Newton's iteration from the multipliers of the last step that succeeded."""
    if loops is not None:
        for k in range(len(loops.rows.multipliers)):
            loops.rows.multipliers[k] = loops.rows.trusted[k]


@embedded
def end_newton(loops):  # type: ignore[no-untyped-def]
    """Newton's iteration has succeeded."""
    if loops is not None:
        for k in range(len(loops.rows.multipliers)):
            loops.rows.trusted[k] = loops.rows.multipliers[k]


@embedded
def keep_multipliers(loops, kept):  # type: ignore[no-untyped-def]
    """Keep the multipliers of the last step that succeeded, before an iteration that is no step."""
    if loops is not None:
        for k in range(len(loops.rows.trusted)):
            kept[k] = loops.rows.trusted[k]


@embedded
def give_back_multipliers(loops, kept):  # type: ignore[no-untyped-def]
    """Take the multipliers that were kept for those of the last step."""
    if loops is not None:
        for k in range(len(loops.rows.trusted)):
            loops.rows.trusted[k] = kept[k]


@embedded
def ask_correction(loops, c, q, v, w):  # type: ignore[no-untyped-def]
    """Ask the next solution for a correction of what the step keeps of constraints; v is short of c.h w.

    Returns the largest error of the constraints' positions; 0 where the step keeps accelerations.
    """
    largest = 0.0
    if loops is not None:
        rows = loops.rows
        gather(rows, 0, q)
        if c.level == 0.0:
            largest = evaluate(rows, 0)
        else:
            gather(rows, 1, v)
            gather(rows, 2, w)
            for n in range(len(rows.used)):
                rows.x[1, rows.used[n]] += c.h * rows.x[2, rows.used[n]]
            evaluate(rows, 2)
            for k in range(len(rows.value)):
                rows.value[k] /= c.to_w
        push(rows, loops.load)
        ask(rows, loops.load)
    return largest


@embedded
def ask_velocities(loops, q, v):  # type: ignore[no-untyped-def]
    """Ask the next solution for the change that brings velocities back to the constraints; the largest of these."""
    rows, largest = loops.rows, 0.0
    gather(rows, 0, q)
    gather(rows, 1, v)
    largest = evaluate(rows, 1)
    ask(rows, loops.load)
    return largest


@embedded
def forget_asked(loops):  # type: ignore[no-untyped-def]
    """Ask nothing of the solutions that follow."""
    rows = loops.rows
    for k in range(len(rows.number)):
        loops.load[rows.number[k]] = 0.0


@embedded
def take_correction(loops):  # type: ignore[no-untyped-def]
    """Add to the multipliers what the solution for a correction has found."""
    if loops is not None:
        take_multipliers(loops.rows, loops.x, loops.load, 1.0)


@embedded
def work_of_drives(loops, moving, q):  # type: ignore[no-untyped-def]
    """Work of the constraints' drives since the last call, J; 0 unless `moving`."""
    if loops is None:
        return 0.0
    gather(loops.rows, 0, q)
    return row_work(loops.rows, moving)


@embedded
def power_of_drives(loops, q):  # type: ignore[no-untyped-def]
    """Power of the constraints' drives now, W."""
    if loops is None:
        return 0.0
    gather(loops.rows, 0, q)
    return row_power(loops.rows)
