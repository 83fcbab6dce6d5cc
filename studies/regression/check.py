"""Do the solvers still move as they did? Histories against stored ones: the heart of `anctmm check`.

Every run is compared with its own stored history (like with like), and a peer that solves the same discrete
equations also with the displacements stored for ANC-TMM, within both tolerances.
"""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from itertools import chain
from multiprocessing import get_all_start_methods, get_context
from pathlib import Path
from time import perf_counter

import numpy as np

from anctmm.errors import OutputError, PluginError
from anctmm.results.status import Status
from anctmm.solvers import registry
from studies.engine import provenance
from studies.regression.history import (
    Baseline,
    History,
    Tolerance,
    is_ours,
    note_file,
    physics_of,
    quantity_of,
    read_baseline,
    write_baseline,
)
from studies.regression.reading import READABLE, answered
from studies.regression.scenes import TIGHT, CheckError, Static, Task, Watch, iterations_of
from studies.regression.tolerance import measured

__all__ = ["CheckError", "Finding", "Static", "Watch", "check", "passed", "select", "update"]

#: Stored histories of the base scenes: package data, so that an installed package has them, too.
BASELINES = Path(__file__).parent / "baselines"
OURS = "anctmm"
#: Solvers of ANC-TMM's own discrete equations; of Exudyn that is the cable.
SAME_EQUATIONS = ("global-dae", "global-dae-dense", "exudyn-cable", *READABLE)
#: Growth of the number of Newton corrections that is reported. Rotation of a scene changes it by a third (statics) or
#: a fiftieth (dynamics), a wrong tangent doubles it.
MORE_WORK = 0.5
#: Tolerance of displacements over the largest of them above which a tighter Newton tolerance is recommended.
BLIND = 1e-6

SAME, DIFFERS, SETTINGS, MISSING, UNREADABLE, FAILED, NOT_RUN, UNASKED = (
    "same", "differs", "other settings", "no baseline", "unreadable", "failed", "not run", "unasked",
)  # fmt: skip
NEW, RENEWED, UNCHANGED = "new", "renewed", "unchanged"
GOOD = {SAME, NOT_RUN, NEW, RENEWED, UNCHANGED}


@dataclass(frozen=True)
class Worst:
    """The largest difference of two histories, in units of the tolerance, and the head of its column."""

    column: str
    time: float
    difference: float
    tolerance: float


@dataclass(frozen=True)
class Finding:
    """The outcome of one comparison: of scene/run/solver, with the stored history of the solver `against`."""

    name: str
    verdict: str
    reason: str = ""
    against: str = ""
    worst: Worst | None = None
    computed: History | None = None
    stored: Baseline | None = None
    wall_s: float = 0.0

    @property
    def good(self) -> bool:
        """Whether it lets a check pass."""
        return self.verdict in GOOD


def select(tasks: Sequence[Task], only: Sequence[str], solvers: Sequence[str]) -> tuple[Task, ...]:
    """Tasks whose name has one of the texts (or fits one of the patterns), of these solvers.

    A solver that no task has (another package's) gets every run.

    Raises
    ------
    CheckError
        If a solver is neither asked for nor installed, or nothing is left.
    """
    asked = {task.solver for task in tasks}
    if unknown := [name for name in solvers if name not in asked and name not in registry.names()]:
        known = ", ".join(sorted(asked | set(registry.names())))
        raise CheckError(f"--solver has {unknown[0]!r}; allowed are {known}")
    runs = {(task.scene.name, task.run_name): task for task in tasks}
    others = [replace(task, solver=name) for name in solvers if name not in asked for task in runs.values()]
    chosen = [
        task
        for task in (*tasks, *others)
        if (not solvers or task.solver in solvers)
        and (not only or any(o in task.name or fnmatch(task.name, o) for o in only))
    ]
    if not chosen:
        names = ", ".join(dict.fromkeys(t.scene.name for t in tasks))
        raise CheckError(
            f"--only {','.join(only)!r} with --solver {','.join(solvers) or 'any'!r} leaves nothing; "
            f"allowed are parts or patterns of scene/run/solver, with scenes {names}"
        )
    return tuple(chosen)


def in_order(findings: Sequence[Finding], tasks: Sequence[Task]) -> list[Finding]:
    """Findings in the order of their tasks; those of no task come last."""
    places = {task.name: k for k, task in enumerate(tasks)}
    return sorted(findings, key=lambda f: places.get(f.name, len(places)))


def passed(findings: Sequence[Finding]) -> bool:
    """Whether all is well, and anything was compared at all."""
    return all(f.good for f in findings) and any(f.verdict != NOT_RUN for f in findings)


# --- checking ------------------------------------------------------------------------------------------------


def check(
    tasks: Sequence[Task], baselines: Path, whole: bool = False, workers: int = 1, file: str = ""
) -> Iterator[tuple[Finding, ...]]:
    """Run tasks and compare: findings of each task, and at last of the stored histories without one.

    Parameters
    ----------
    tasks : sequence of Task
    baselines : Path
        Directory of the stored histories.
    whole : bool
        Whether these are all tasks there are: then a stored history that none of them asks for is a finding.
    workers : int
        Processes; with more than one, findings come in another order than the tasks.
    file : str
        Name of the file that declares the tasks: histories that belong to another file need no task.

    Raises
    ------
    CheckError
        At once, if there is no such directory.
    """
    if not baselines.is_dir():
        raise CheckError(f"--baselines {baselines}: no such directory; --update makes it")
    others = _unasked(tasks, baselines, file) if whole else ()
    if workers < 2 or len(tasks) < 2 or "fork" not in get_all_start_methods():
        found: Iterator[tuple[Finding, ...]] = (_checked(task, baselines) for task in tasks)
    else:
        found = _side_by_side(tasks, baselines, workers)
    return chain(found, [others] if others else [])


#: Tasks that processes begun from this one know: scenes, which may have functions of a user's, need not be picklable.
_shared: list[Task] = []


def _side_by_side(tasks: Sequence[Task], baselines: Path, workers: int) -> Iterator[tuple[Finding, ...]]:
    """Findings as they come. Processes begin at once, before any thread that shows progress: copies of it may hang."""
    _shared[:] = tasks
    pool = ProcessPoolExecutor(workers, get_context("fork"))
    return _as_they_come(pool, {pool.submit(_job, k, baselines): task for k, task in enumerate(tasks)})


def _as_they_come(
    pool: ProcessPoolExecutor, jobs: "dict[Future[tuple[Finding, ...]], Task]"
) -> Iterator[tuple[Finding, ...]]:
    """Findings of each task; where a process has died, those of all that was not done."""
    with pool:
        for job in as_completed(jobs):
            try:
                yield job.result()
            except BrokenProcessPool as error:
                yield (Finding(jobs[job].name, FAILED, f"its process has died: {error}"),)


def _job(k: int, baselines: Path) -> tuple[Finding, ...]:
    return _checked(_shared[k], baselines)


def _checked(task: Task, baselines: Path) -> tuple[Finding, ...]:
    """Run a task and compare: with its own stored history, and that of ANC-TMM if both solve the same equations."""
    begun = perf_counter()
    status, history = answered(task)
    wall_s = perf_counter() - begun
    found = [_own(task, status, history, baselines)]
    if history is not None and (ours := _ours(task, baselines)) is not None:
        found.append(_compared(task, _displacements(history), ours, OURS))
    return tuple(replace(f, wall_s=wall_s) for f in found)


def _own(task: Task, status: Status, history: History | None, baselines: Path) -> Finding:
    """A run against its own stored history."""
    path = task.path(baselines)
    if history is None:
        return _not_whole(task, status, path.exists())
    try:
        stored = read_baseline(path)
    except FileNotFoundError:
        return Finding(task.name, MISSING, f"{path} is not there; --update makes it")
    except CheckError as error:
        return Finding(task.name, UNREADABLE, str(error))
    return _compared(task, history, stored, task.solver)


def _ours(task: Task, baselines: Path) -> Baseline | None:
    """The displacements stored for ANC-TMM, if a peer solves the same equations and both have stored histories."""
    if task.solver not in SAME_EQUATIONS:
        return None
    try:
        own, ours = (read_baseline(replace(task, solver=s).path(baselines)) for s in (task.solver, OURS))
    except (FileNotFoundError, CheckError):
        return None  # reported in the row of that history
    if not task.settings == own.settings == ours.settings or "displacement" not in own.tolerances:
        return None
    both = sum(one.tolerances["displacement"].value for one in (ours, own))
    tolerance = Tolerance(both, ours.tolerances["displacement"].reason)
    return Baseline(ours.settings, {"displacement": tolerance}, _displacements(ours.history), ours.physics)


def _displacements(history: History) -> History:
    return replace(history, frame=history.of_quantity("displacement"))


def _compared(task: Task, computed: History, stored: Baseline, against: str) -> Finding:
    """A run against a stored history; where they differ, what of the scene is not what it was."""
    # histories that were stored before angles were have none
    columns = [c for c in computed.frame if quantity_of(c) != "angle" or c in stored.history.frame]
    computed = replace(computed, frame=computed.frame[columns])
    found = Finding(task.name, SAME, against=against, computed=computed, stored=stored)
    if stored.settings != task.settings:
        reason = _changes(stored.settings.split(", "), task.settings.split(", "))
        return replace(found, verdict=SETTINGS, reason=reason)
    unlike = _unlike(computed, stored.history)
    if not unlike and columns:
        found = replace(found, worst=_worst(computed, stored))
        unlike = _too_far(found, work=against == task.solver)
    if unlike is None:
        return found
    scene = _changes(stored.physics, physics_of(task)) if stored.physics else ""
    scene = f"the scene has changed: {scene}" if scene else ""
    return replace(found, verdict=DIFFERS, reason="; ".join(filter(None, (unlike, scene))))


def _unlike(computed: History, stored: History) -> str | None:
    """Why two histories have no common samples; None if they have."""
    now, before = [*map(str, computed.frame)], [*map(str, stored.frame)]
    if now != before:
        gone, come = (
            ", ".join(c for c in one if c not in other) for one, other in ((before, now), (now, before))
        )
        return f"columns have changed: {gone or 'none'} are gone, {come or 'none'} are new"
    if not set(stored.ending.split(", ")) <= set(computed.ending.split(", ")):
        return f"it ended with {stored.ending or 'ok'}; now with {computed.ending or 'ok'}"
    t, times = computed.t, stored.t
    if t.shape != times.shape or not np.allclose(t, times, rtol=0.0, atol=1e-9 * max(times, default=0.0)):
        found, wanted = (f"{len(x)} up to {x[-1]:g}" if len(x) else "none" for x in (t, times))
        return f"stored times are {wanted}; now there are {found}"
    return None


def _too_far(found: Finding, work: bool) -> str | None:
    """Why a history differs from the stored one: empty where its numbers say so; None if it does not."""
    assert found.worst and found.computed and found.stored  # noqa: PT018
    if not found.worst.difference <= found.worst.tolerance:
        return ""
    now, before = found.computed.corrections, found.stored.history.corrections
    if work and now > (1.0 + MORE_WORK) * before:
        return f"Newton corrections are {now}, stored are {before}: the tangent may be wrong"
    return None


def _worst(computed: History, stored: Baseline) -> Worst:
    """The sample farthest off in units of its tolerance; what is no number is farther than all others."""
    difference = np.abs(computed.frame.to_numpy() - stored.history.frame.to_numpy())
    tolerance = np.array([stored.tolerances[quantity_of(c)].value for c in computed.frame])
    parts = np.nan_to_num(difference / tolerance, nan=np.inf)
    i, k = np.unravel_index(int(parts.argmax()), parts.shape)
    column = str(computed.frame.columns[int(k)])
    return Worst(column, float(computed.t[i]), float(difference[i, k]), float(tolerance[k]))


def _not_whole(task: Task, status: Status, stored: bool) -> Finding:
    """A finding for a run that did not end as it must."""
    missing = status.code == "unsupported" and "not installed" in status.message
    if (absent := _absent(task.solver)) or missing:
        return Finding(task.name, NOT_RUN, absent or str(status))
    # what was stored could be run once: that the solver now says it cannot is a change
    unable = status.code == "unsupported" and not stored
    reason = str(status) if task.ends == "ok" else f"it must end as {task.ends!r}, and ended {status}"
    return Finding(task.name, NOT_RUN if unable else FAILED, reason)


def _absent(solver: str) -> str:
    """Why a solver is not here; empty if it is."""
    if solver in READABLE:
        return ""
    if solver not in registry.names():
        return f"solver {solver!r} is not installed; installed are {', '.join(registry.names())}"
    try:
        registry.solver(solver)
    except PluginError as error:
        return str(error)
    return ""


def _unasked(tasks: Sequence[Task], baselines: Path, file: str) -> tuple[Finding, ...]:
    """Stored histories without a task: something is no longer checked. Those of other files are not asked for here."""
    asked = {task.path(baselines) for task in tasks}
    found = []
    for path in sorted(set(baselines.glob("*/*/*.csv")) - asked):
        owner = _owner(path)
        if not is_ours(path) or (file and owner not in ("", file)):
            continue
        way_out = "delete it, or ask for it"
        if file and not owner:
            way_out = (
                f"it does not say to which file it belongs: if to another one than {file}, check that with --update "
                f"once; else delete it, or ask for it"
            )
        name = path.relative_to(baselines).with_suffix("").as_posix()
        found.append(Finding(name, UNASKED, f"no run asks for {path}; {way_out}"))
    return tuple(found)


def _owner(path: Path) -> str:
    """Name of the file that a stored history belongs to; empty where it does not say, or cannot be read."""
    try:
        return read_baseline(path).file
    except CheckError:
        return ""


def _changes(before: Sequence[str], now: Sequence[str]) -> str:
    """What is not what it was, of settings or of the parts of a scene."""
    gone, come = [b for b in before if b not in now], [n for n in now if n not in before]
    return f"stored with {', '.join(gone) or 'less'}; now {', '.join(come) or 'less'}" if gone or come else ""


# --- storing -------------------------------------------------------------------------------------------------


def update(tasks: Sequence[Task], baselines: Path, file: str = "") -> Iterator[tuple[Finding, ...]]:
    """Run tasks and store what is new or differs; parameters as of `check`.

    A history within its tolerance is left as it is, and a run that is not whole is not stored.

    Raises
    ------
    OutputError
        At once, if the directory cannot be written.
    """
    try:
        baselines.mkdir(parents=True, exist_ok=True)
        reason = "" if os.access(baselines, os.W_OK) else "permission denied"
    except OSError as error:
        reason = error.strerror or str(error)
    if reason:
        raise OutputError(
            f"--baselines is {str(baselines)!r}, which cannot be written ({reason}); "
            f"a directory that can be written is needed"
        )
    return ((_renewed(task, baselines, file),) for task in tasks)


def _renewed(task: Task, baselines: Path, file: str) -> Finding:
    """Store a run's history if it is new or differs."""
    status, computed = answered(task)
    path = task.path(baselines)
    if computed is None:
        bad = _not_whole(task, status, path.exists())
        return replace(bad, reason=f"{bad.reason} (the stored history stays)") if path.exists() else bad
    if path.exists() and not is_ours(path):
        reason = f"{path} is no history stored by anctmm check and is not overwritten; move it away"
        return Finding(task.name, UNREADABLE, reason)
    before = _own(task, status, computed, baselines)
    if before.verdict == SAME:
        if file and before.stored and before.stored.file != file:
            note_file(path, file)
        return replace(before, verdict=UNCHANGED)
    if not np.isfinite(computed.frame.to_numpy()).all():
        return Finding(task.name, FAILED, "its history has values that are no numbers; it is not stored")
    try:
        stored = replace(measured(task, computed), file=file)
    except CheckError as error:
        return Finding(task.name, FAILED, str(error))
    machine = provenance.machine()
    made_by = f"{machine['cores']} cores, {machine['system']}, {provenance.software()}"
    write_baseline(path, task, stored, made_by)
    new = before.verdict == MISSING
    reasons = filter(None, ("" if new else before.reason, _blind(task, stored)))
    return replace(before, verdict=NEW if new else RENEWED, reason="; ".join(reasons))


def _blind(task: Task, stored: Baseline) -> str:
    """That a check will not see much, where a loose bound of Newton's iteration makes tolerances wide."""
    known = stored.tolerances.get("displacement")
    if known is None or all(run.newton_tolerance <= TIGHT for run in iterations_of(task.run)):
        return ""
    part = known.value / max(float(stored.history.of_quantity("displacement").abs().to_numpy().max()), 1e-300)
    if part <= BLIND:
        return ""
    return (
        f"displacements may change by {known.value:.1e} m unseen, {part:.1g} of the largest, as Newton's iteration "
        f"leaves that much: newton_tolerance={TIGHT:g} in its run makes the tolerance smaller"
    )
