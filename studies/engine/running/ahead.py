"""Kernels of many kinds of runs, compiled by this process and a worker before the first of the runs is timed.

Nothing is timed meanwhile, and no answer is kept. A kind that fails here fails where its runs are done.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from threading import Thread
from typing import Any, TypeVar

from anctmm.jit.compiler.kernel_files import directory
from anctmm.solvers import registry
from anctmm.solvers.foreign_code import contained
from anctmm.solvers.registry import Solver
from studies.engine.running.pool import WorkerPool
from studies.engine.running.processes import processors
from studies.engine.running.trial import Trial

Case = TypeVar("Case")


def worthwhile() -> bool:
    """Whether no kernels are kept yet, and a second processor may compile them."""
    place = directory()
    return place is not None and processors() > 1 and next(place.glob("*.kernel"), None) is None


@contextmanager
def helper(wanted: bool) -> Iterator[WorkerPool | None]:
    """A worker that compiles beside this process; None where it is not wanted, or not worth while."""
    if not (wanted and worthwhile()):
        yield None
        return
    pool = WorkerPool(1)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def kind_of(case: Trial) -> tuple[Any, ...]:
    """What is equal for runs that need the same kernels, of whatever scene."""
    solver, _, *needed = case.kernels
    joints = sorted(type(joint).__name__ for joint in case.scene.joints)
    return solver, *needed, len(case.scene.bodies), *joints, case.error_controlled


def kinds(cases: Iterable[Trial]) -> list[Trial]:
    """Of each kind of run the one with least work; scenes of as many bodies with the same joints are one kind."""
    least: dict[tuple[Any, ...], Trial] = {}
    for case in cases:
        kind = kind_of(case)
        if kind not in least or case.work < least[kind].work:
            least[kind] = case
    return list(least.values())


def warmed_up(case: Trial, resolve: Callable[[str], Solver] = registry.solver) -> bool:
    """In a worker: compile what runs of a kind need; `resolve` finds solvers by name."""
    with contained():
        case.warm_up(resolve(case.solver))
    return True


def from_both_ends(
    cases: Sequence[Case], here: Callable[[Case], object], there: Callable[[Case], object]
) -> None:
    """Do something for each of some cases: from the first on in this thread, from the last on in another one.

    Parameters
    ----------
    cases : sequence
    here, there : callable
        What they raise is left out: each case is done once, well or not.
    """
    left = deque(cases)

    def do(take: Callable[[], Case], one: Callable[[Case], object]) -> None:
        with suppress(IndexError):
            while True:
                case = take()
                with suppress(Exception):
                    one(case)

    other = Thread(target=do, args=(left.pop, there), daemon=True)
    other.start()
    try:
        do(left.popleft, here)
        other.join()
    finally:  # where somebody has interrupted this thread
        left.clear()
