"""Do the solvers still move as they did? Histories against stored ones: the heart of `anctmm check`.

Every run is compared with its own stored history (like with like), and a peer that solves the same discrete
equations also with what ANC-TMM has stored, within both their tolerances.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import partial
from itertools import starmap, zip_longest
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import PluginError
from anctmm.results.status import Status
from anctmm.solvers import registry
from studies.engine.running.outcomes import not_installed
from studies.engine.running.processes import Lost, side_by_side
from studies.engine.storage.files import check_writable
from studies.engine.storage.provenance import stamp
from studies.regression.history import (
    ANGLE,
    Baseline,
    Column,
    History,
    file_of,
    is_ours,
    note_file,
    physics_of,
    read_baseline,
    write_baseline,
)
from studies.regression.readable import READABLE
from studies.regression.scenes import TIGHT, CheckError, Static, Task, Watch
from studies.regression.tolerance import measured, simulate

__all__ = ["CheckError", "Finding", "Static", "Watch", "check", "passed", "select", "update"]

#: Stored histories of the base scenes: package data, so that an installed package has them, too.
BASELINES = Path(__file__).parent / "baselines"
OURS = "anctmm"
#: Solvers of ANC-TMM's own discrete equations; of Exudyn that is the cable, stepped implicitly or at rest (its
#: explicit clamps are large inertias).
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
    """Where two histories are farthest apart, in units of the tolerance."""

    column: Column
    time: float
    difference: float
    tolerance: float


@dataclass(frozen=True)
class Finding:
    """What became of one comparison.

    Parameters
    ----------
    name : str
        scene/run/solver.
    verdict : str
    reason : str
        Whatever the numbers do not say.
    against : str
        Whose stored history it was compared with.
    worst : Worst, optional
    computed, stored : optional
        What was compared.
    wall_s : float
        Of the run.
    """

    name: str
    verdict: str
    reason: str = ""
    against: str = ""
    worst: Worst | None = None
    computed: History | None = None
    stored: Baseline | None = None
    wall_s: float = 0.0

    @property
    def scene(self) -> str:
        """Name of the scene."""
        return self.name.split("/")[0]

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.name.split("/")[1]

    @property
    def solver(self) -> str:
        """Name of the solver."""
        return self.name.split("/")[2]

    @property
    def good(self) -> bool:
        """Whether it lets a check pass."""
        return self.verdict in GOOD


@dataclass(frozen=True)
class Done:
    """A task that was run: how it ended, and its history if it is whole."""

    task: Task
    status: Status
    history: History | None
    wall_s: float


def select(tasks: Sequence[Task], only: Sequence[str], solvers: Sequence[str]) -> tuple[Task, ...]:
    """Tasks whose name has one of the texts (or fits one of the patterns), of these solvers.

    A solver that no task has (another package's) gets every run.

    Raises
    ------
    CheckError
        If a solver is neither asked for nor installed, or nothing is left.
    """
    asked = {task.solver for task in tasks}
    for solver in solvers:
        if solver not in asked and solver not in registry.names():
            known = sorted(asked | set(registry.names()))
            raise CheckError(f"--solver has {solver!r}; allowed are {', '.join(known)}")
        if solver not in asked:
            runs = {(task.scene.name, task.run_name): task for task in tasks}
            tasks = (*tasks, *(replace(task, solver=solver) for task in runs.values()))
    chosen = [
        task
        for task in tasks
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


def check(
    tasks: Sequence[Task], baselines: Path, whole: bool = False, workers: int = 1, file: str = ""
) -> Iterator[tuple[Finding, ...]]:
    """Run tasks and compare.

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

    Returns
    -------
    iterator of tuple of Finding
        Of each task, and at last of what nobody asked for.

    Raises
    ------
    CheckError
        At once, if there is no such directory.
    """
    if not baselines.is_dir():
        raise CheckError(f"--baselines {baselines}: no such directory; --update makes it")
    groups = _groups(tasks) if workers > 1 else [(task,) for task in tasks]
    jobs = [partial(_checked, group, baselines) for group in groups]
    return _findings(groups, side_by_side(jobs, workers), _unasked(tasks, baselines, file) if whole else ())


def _findings(
    groups: Sequence[Sequence[Task]], results: Iterable[tuple[int, Any]], others: tuple[Finding, ...]
) -> Iterator[tuple[Finding, ...]]:
    """Findings of each task, and at last others, if there are any."""
    for k, found in results:
        if isinstance(found, Lost):
            yield from ((Finding(task.name, FAILED, str(found)),) for task in groups[k])
        else:
            yield from found
    if others:
        yield others


def _checked(tasks: Sequence[Task], baselines: Path) -> list[tuple[Finding, ...]]:
    """Run tasks and compare, one after another."""
    found = []
    for task in tasks:
        done = _done(task)
        both = [_own(done, baselines), *_like(done, baselines)]
        found.append(tuple(replace(f, wall_s=done.wall_s) for f in both))
    return found


def _groups(tasks: Sequence[Task]) -> list[tuple[Task, ...]]:
    """Tasks that share their kernels: what compiles longest stands first, so that processes end together."""
    groups: dict[tuple[Any, ...], list[Task]] = {}
    for task in tasks:
        groups.setdefault(_kernels(task), []).append(task)
    return [tuple(groups[key]) for key in sorted(groups, key=lambda key: (key[0], -len(key[-1]), key))]


def _kernels(task: Task) -> tuple[Any, ...]:
    """What roughly determines the kernels of a task: whether it is static, solver, integrator, damping, elements."""
    run, static = task.run, isinstance(task.run, Static)
    elements = run.element.values() if isinstance(run.element, Mapping) else [run.element]
    method = "" if isinstance(run, Static) else f"{run.integrator} {run.tolerance is not None}"
    damped = any(body.material.damping > 0.0 for body in task.scene.beams)
    return static, task.solver, method, damped, tuple(sorted(set(map(str, elements))))


def update(tasks: Sequence[Task], baselines: Path, file: str = "") -> Iterator[tuple[Finding, ...]]:
    """Run tasks and store what is new or differs; a history within its tolerance is left as it is.

    Parameters
    ----------
    tasks : sequence of Task
    baselines : Path
        Directory of the stored histories.
    file : str
        Name of the file that declares the tasks: their histories say that they belong to it.

    Yields
    ------
    tuple of Finding
        Of each task: what changed and by how much. A run that is not whole is not stored.

    Raises
    ------
    OutputError
        At once, if the directory cannot be written.
    """
    check_writable(baselines, "--baselines")
    for task in tasks:
        done = _done(task)
        yield (replace(_renewed(done, baselines, file), wall_s=done.wall_s),)


def in_order(findings: Sequence[Finding], tasks: Sequence[Task]) -> list[Finding]:
    """Findings in the order of their tasks; those of no task come last."""
    places = {task.name: k for k, task in enumerate(tasks)}
    return sorted(findings, key=lambda f: places.get(f.name, len(places)))


def passed(findings: Sequence[Finding]) -> bool:
    """Whether all is well, and anything was compared at all."""
    return all(f.good for f in findings) and any(f.verdict != NOT_RUN for f in findings)


def _done(task: Task) -> Done:
    """Run a task; an answer that cannot be read is a failure of that solver, not of the check."""
    begun = perf_counter()
    solution = simulate(task)
    status, history = solution.status, None
    if status.code == task.ends:
        try:
            history = History.of(solution, task)
        except Exception as error:
            reason = f"its answer cannot be read: {type(error).__name__}: {error}"
            status = Status("failed", reason)
    return Done(task, status, history, perf_counter() - begun)


def _own(done: Done, baselines: Path) -> Finding:
    """A run against its own stored history."""
    task, path = done.task, done.task.path(baselines)
    if done.history is None:
        return _not_whole(task, done.status, path.exists())
    try:
        stored = read_baseline(path)
    except FileNotFoundError:
        return Finding(task.name, MISSING, f"{path} is not there; --update makes it")
    except CheckError as error:
        return Finding(task.name, UNREADABLE, str(error))
    return _compared(task, done.history, stored, task.solver)


def _like(done: Done, baselines: Path) -> Iterator[Finding]:
    """A peer's run against what ANC-TMM has stored, if both solve the same equations and both are stored."""
    task = done.task
    explicit = not isinstance(task.run, Static) and task.run.explicit
    if task.solver not in SAME_EQUATIONS or (task.solver == "exudyn-cable" and explicit):
        return
    if done.history is None:
        return
    try:
        own = read_baseline(task.path(baselines))
        ours = read_baseline(replace(task, solver=OURS).path(baselines))
    except (FileNotFoundError, CheckError):
        return  # reported in the row of that history
    if not task.settings == own.settings == ours.settings:
        return
    both = {
        "displacement": replace(
            ours.tolerances["displacement"],
            value=ours.tolerances["displacement"].value + own.tolerances["displacement"].value,
        )
    }
    yield _compared(
        task,
        _displacements(done.history),
        Baseline(ours.settings, both, _displacements(ours.history)),
        OURS,
    )


def _compared(task: Task, computed: History, stored: Baseline, against: str) -> Finding:
    found = _difference(task, computed, stored, against)
    scene = _scene_changes(stored.physics, physics_of(task)) if found.verdict == DIFFERS else ""
    return replace(found, reason="; ".join(filter(None, (found.reason, scene))))


def _scene_changes(before: Sequence[str], now: Sequence[str]) -> str:
    """What of a scene is not what it was; empty where nothing is, or nothing was stored."""
    gone, come = [b for b in before if b not in now], [n for n in now if n not in before]
    if not before or not (gone or come):
        return ""
    return "the scene has changed: " + "; ".join(
        starmap(_part_change, zip_longest(gone, come, fillvalue="nothing"))
    )


def _part_change(before: str, now: str) -> str:
    """How a part of a scene has changed: of a body what of it has, of others the whole."""
    body = before.partition(", ")[0]
    if "(name=" in body and now.startswith(body):
        kind, _, name = body.partition("(name=")
        # "E=" for "material=Material(E="
        plain = (re.sub(r"\w+=\w+\((?=\w+=)", "", part) for part in (before, now))
        return f"{kind} {name}: {_changes(*plain)}"
    return f"stored with {before}; now {now}"


def _difference(task: Task, computed: History, stored: Baseline, against: str) -> Finding:
    kept = stored.history.columns
    # histories that were stored before angles were have none
    computed = computed.of_columns(lambda column: column.quantity != ANGLE or column in kept)
    found = Finding(task.name, SAME, against=against, computed=computed, stored=stored)
    if stored.settings != task.settings:
        return replace(found, verdict=SETTINGS, reason=_changes(stored.settings, task.settings))
    if computed.columns != kept:
        labels = ([c.label for c in h.columns] for h in (stored.history, computed))
        return replace(found, verdict=DIFFERS, reason="stored are {}; now there are {}".format(*labels))
    if not set(stored.history.ending.split(", ")) <= set(computed.ending.split(", ")):
        told = (h.ending or "ok" for h in (stored.history, computed))
        return replace(found, verdict=DIFFERS, reason="it ended with {}; now with {}".format(*told))
    if not len(computed.columns):
        return found
    times = stored.history.t
    if computed.t.shape != times.shape or not _close(computed.t, times):
        told = (f"{len(t)} up to {t[-1]:g}" for t in (times, computed.t))
        return replace(found, verdict=DIFFERS, reason="stored times are {}; now there are {}".format(*told))
    worst = _worst(computed, stored)
    if not worst.difference <= worst.tolerance:
        return replace(found, verdict=DIFFERS, worst=worst)
    before, now = stored.history.corrections, computed.corrections
    if against == task.solver and now > (1.0 + MORE_WORK) * before:
        reason = f"Newton corrections are {now}, stored are {before}: the tangent may be wrong"
        return replace(found, verdict=DIFFERS, worst=worst, reason=reason)
    for name, margin in stored.margins.items() if against == task.solver else ():
        before, now = stored.history.counts[name], computed.counts[name]
        if abs(now - before) > margin:
            reason = f"{name} are {now}, stored are {before} ± {margin}"
            return replace(found, verdict=DIFFERS, worst=worst, reason=reason)
    return replace(found, worst=worst)


def _close(times: NDArray[np.float64], stored: NDArray[np.float64]) -> bool:
    """Whether times are those stored; what is no number is not."""
    return bool(np.abs(times - stored).max() <= 1e-9 * max(float(stored[-1]), 1e-300))


def _worst(computed: History, stored: Baseline) -> Worst:
    """The sample farthest off in units of its tolerance; what is no number is farther than all others."""
    difference = np.abs(computed.values - stored.history.values)
    tolerance = np.array([stored.tolerances[c.quantity].value for c in computed.columns])
    parts = np.nan_to_num(difference / tolerance, nan=np.inf)
    i, k = np.unravel_index(int(parts.argmax()), parts.shape)
    return Worst(computed.columns[k], float(computed.t[i]), float(difference[i, k]), float(tolerance[k]))


def _renewed(done: Done, baselines: Path, file: str) -> Finding:
    """Store a run's history if it is new or differs."""
    task, computed, path = done.task, done.history, done.task.path(baselines)
    if computed is None:
        bad = _not_whole(task, done.status, path.exists())
        return replace(bad, reason=f"{bad.reason} (what was stored is kept)") if path.exists() else bad
    if path.exists() and not is_ours(path):
        reason = f"{path} is no history stored by anctmm check and is not overwritten; move it away"
        return Finding(task.name, UNREADABLE, reason)
    before = _own(done, baselines)
    if before.verdict == SAME:
        if file and file_of(path) != file:
            note_file(path, file)
        return replace(before, verdict=UNCHANGED)
    if not np.isfinite(computed.values).all():
        return Finding(task.name, FAILED, "its history has values that are no numbers; it is not stored")
    try:
        stored = measured(task, computed)
    except CheckError as error:
        return Finding(task.name, FAILED, str(error))
    write_baseline(path, task, stored, stamp(), file)
    blind = _blind(task, stored)
    if before.verdict == MISSING:
        return Finding(task.name, NEW, blind, computed=computed)
    worst = before.worst or _change(computed, before.stored)
    said = filter(None, (before.reason or _tolerances(before, stored), blind))
    return replace(before, verdict=RENEWED, worst=worst, reason="; ".join(said))


def _blind(task: Task, stored: Baseline) -> str:
    """That a check will not see much, where a loose bound of Newton's iteration makes tolerances wide."""
    run, known = task.run, stored.tolerances.get("displacement")
    if known is None or isinstance(run, Static) or run.explicit or run.newton_tolerance <= TIGHT:
        return ""
    part = known.value / max(float(np.abs(stored.history.of_quantity("displacement")).max()), 1e-300)
    if part <= BLIND:
        return ""
    return (
        f"displacements may change by {known.value:.1e} m unseen, {part:.1g} of the largest, as Newton's iteration "
        f"leaves that much: newton_tolerance={TIGHT:g} in its run makes the tolerance smaller"
    )


def _change(computed: History, before: Baseline | None) -> Worst | None:
    """How far a history with other settings lies from the old one, where they can be compared at all."""
    if before is None or not computed.values.size or before.history.values.shape != computed.values.shape:
        return None
    return _worst(computed, before) if before.history.columns == computed.columns else None


def _tolerances(before: Finding, stored: Baseline) -> str:
    """What became of the tolerances."""
    old = {} if before.stored is None else before.stored.tolerances
    changed = [
        f"{name} {old[name].value:.1e} → {new.value:.1e}"
        for name, new in stored.tolerances.items()
        if name in old and not 0.5 < new.value / old[name].value < 2.0
    ]
    return f"tolerance of {', '.join(changed)}" if changed else ""


def _not_whole(task: Task, status: Status, stored: bool) -> Finding:
    """A finding for a run that did not end well."""
    absent = _absent(task.solver)
    if absent is not None or not_installed(status):
        return Finding(task.name, NOT_RUN, absent or str(status))
    # What was stored could be run once: that the solver now says it cannot is a change.
    unable = status.code == "unsupported" and not stored
    told = str(status) if task.ends == "ok" else f"it must end as {task.ends!r}, and ended {status}"
    return Finding(task.name, NOT_RUN if unable else FAILED, told)


def _absent(solver: str) -> str | None:
    """Why a solver is not here; None if it is."""
    if solver in READABLE:
        return None
    if solver not in registry.names():
        return f"solver {solver!r} is not installed; installed are {', '.join(registry.names())}"
    try:
        registry.solver(solver)
    except PluginError as error:
        return str(error)
    return None


def _unasked(tasks: Sequence[Task], baselines: Path, file: str) -> tuple[Finding, ...]:
    """Stored histories without a task: something is no longer checked. Those of other files are not asked for here."""
    asked = {task.path(baselines) for task in tasks}
    found = []
    for path in sorted(baselines.glob("*/*/*.csv")):
        if path in asked or not is_ours(path):
            continue
        owner = file_of(path)
        if file and owner not in ("", file):
            continue
        name = path.relative_to(baselines).with_suffix("").as_posix()
        found.append(Finding(name, UNASKED, f"no run asks for {path}; {_ways_out(file, owner)}"))
    return tuple(found)


def _ways_out(file: str, owner: str) -> str:
    """What to do with a stored history that no run asks for."""
    if not file or owner:
        return "delete it, or ask for it"
    return (
        "it does not say to which file it belongs: if to another one than "
        f"{file}, check that with --update once; else delete it, or ask for it"
    )


def _displacements(history: History) -> History:
    return history.of_columns(lambda column: column.quantity == "displacement")


def _changes(before: str, now: str) -> str:
    """Settings that are not what they were."""
    old, new = before.split(", "), now.split(", ")
    gone, come = [o for o in old if o not in new], [n for n in new if n not in old]
    return f"stored with {', '.join(gone) or 'fewer settings'}; now {', '.join(come) or 'fewer'}"
