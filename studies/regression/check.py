"""Do the solvers still move as they did? Histories against stored ones: the heart of `anctmm check`.

Every run is compared with its own stored history (like with like), and a peer that solves the same discrete
equations also with the displacements stored for ANC-TMM, within both tolerances.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from time import perf_counter
from typing import Any

import joblib
import numpy as np

from anctmm.results.status import Status
from anctmm.solvers import registry
from studies.engine.files import check_writable
from studies.engine.trials import OURS, not_installed
from studies.regression.history import FIRST, History, Tolerance, quantity_of, read_history, write_history
from studies.regression.reading import READABLE, answered
from studies.regression.scenes import CheckError, Task
from studies.regression.tolerance import measured

#: Stored histories of the base scenes: package data, so that an installed package has them, too.
BASELINES = Path(__file__).parent / "baselines"
#: Solvers of ANC-TMM's own discrete equations; of Exudyn that is the cable.
SAME_EQUATIONS = ("global-dae", "global-dae-dense", "exudyn-cable", *READABLE)
#: Growth of the number of Newton corrections that is reported. Rotation of a scene changes it by a third (statics) or
#: a fiftieth (dynamics), a wrong tangent doubles it.
MORE_WORK = 0.5

SAME, DIFFERS, SETTINGS, MISSING, UNREADABLE, FAILED, NOT_RUN = (
    "same", "differs", "other settings", "no baseline", "unreadable", "failed", "not run",
)  # fmt: skip
NEW, RENEWED, UNCHANGED = "new", "renewed", "unchanged"


@dataclass(frozen=True)
class Finding:
    """The outcome of one comparison: of scene/run/solver, with the stored history of the solver `against`.

    Difference, tolerance, column (`where`) and time are those of the sample that is farthest off in units of its
    tolerance; without a column nothing was compared.
    """

    name: str
    verdict: str
    reason: str = ""
    against: str = ""
    difference: float = np.nan
    tolerance: float = np.nan
    where: str = ""
    time: float = np.nan
    computed: History | None = None
    stored: History | None = None
    wall_s: float = 0.0

    @property
    def good(self) -> bool:
        """Whether it lets a check pass."""
        return self.verdict in (SAME, NOT_RUN, NEW, RENEWED, UNCHANGED)

    @property
    def title(self) -> str:
        """Its name, and whose history it is compared with where that is not its own."""
        own = self.against in ("", self.name.split("/")[-1])
        return self.name if own else f"{self.name} against {self.against}"


def select(tasks: Sequence[Task], only: Sequence[str], solvers: Sequence[str]) -> tuple[Task, ...]:
    """Tasks whose name has one of the texts (or fits one of the patterns), of these solvers.

    A solver that no task has (another package's) gets every run. CheckError, if one is neither asked for nor
    installed, or nothing is left.
    """
    asked = {task.solver for task in tasks}
    known = sorted(asked | set(registry.names()))
    if unknown := [name for name in solvers if name not in known]:
        raise CheckError(f"--solver has {unknown[0]!r}; allowed are {', '.join(known)}")
    runs = {(task.scene.name, task.run_name): task for task in tasks}
    others = [replace(task, solver=name) for name in solvers if name not in asked for task in runs.values()]
    chosen = [
        task
        for task in (*tasks, *others)
        if (not solvers or task.solver in solvers)
        and (not only or any(o in task.name or fnmatch(task.name, o) for o in only))
    ]
    if not chosen:
        asked_for = f"--only {','.join(only)!r} with --solver {','.join(solvers) or 'any'!r}"
        allowed = f"scene/run/solver, with scenes {', '.join(dict.fromkeys(t.scene.name for t in tasks))}"
        raise CheckError(f"{asked_for} leaves nothing; allowed are parts or patterns of {allowed}")
    return tuple(chosen)


def passed(findings: Sequence[Finding]) -> bool:
    """Whether all is well, and anything was compared at all."""
    return all(f.good for f in findings) and any(f.verdict != NOT_RUN for f in findings)


def check(
    tasks: Sequence[Task], baselines: Path, update: bool = False, workers: int = 1
) -> Iterator[tuple[Finding, ...]]:
    """Run tasks and compare: findings of each task, in order; with `update` store what is new or differs.

    A history within its tolerance is left as it is, and a run that is not whole is not stored. CheckError at once, if
    there is no directory of baselines; OutputError, if it is to be written and cannot be.
    """
    if update:
        check_writable(baselines, "--baselines")
    elif not baselines.is_dir():
        raise CheckError(f"the directory of stored histories, {baselines}, is not there; --update makes it")
    parallel = joblib.Parallel(n_jobs=min(workers, len(tasks)), return_as="generator")
    return parallel(joblib.delayed(_checked)(task, baselines.absolute(), update) for task in tasks)  # type: ignore[no-any-return]


def _checked(task: Task, baselines: Path, update: bool) -> tuple[Finding, ...]:
    """Run a task and compare: with its own stored history, and that of ANC-TMM if both solve the same equations."""
    begun = perf_counter()
    status, computed = answered(task)
    own = replace(_own(task, status, computed, baselines), wall_s=perf_counter() - begun)
    if not update:
        return (own, *_beside_ours(task, own, baselines))
    return (own if computed is None else _stored(task, computed, own, task.path(baselines)),)


def _stored(task: Task, computed: History, before: Finding, path: Path) -> Finding:
    """Store a run's history if it is new or differs."""
    if before.verdict == SAME:
        return replace(before, verdict=UNCHANGED)
    if before.verdict == UNREADABLE and not path.read_bytes().startswith(FIRST.encode()):
        return replace(before, reason=f"{before.reason}; it is not overwritten: move it away")
    if not np.isfinite(computed.frame.to_numpy()).all():
        return Finding(task.name, FAILED, "its history has values that are no numbers; it is not stored")
    try:
        write_history(path, task, measured(task, computed))
    except CheckError as error:
        return Finding(task.name, FAILED, str(error))
    new = before.verdict == MISSING
    return replace(before, verdict=NEW if new else RENEWED, reason="" if new else before.reason)


def _own(task: Task, status: Status, history: History | None, baselines: Path) -> Finding:
    """A run against its own stored history."""
    path = task.path(baselines)
    if history is None:
        absent = status.code == "absent" or not_installed(status)
        # what was stored could be run once: that the solver now says it cannot is a change
        new = status.code == "unsupported" and not path.exists()
        wanted = "" if task.ends == "ok" else f"it must end as {task.ends!r}, and ended "
        return Finding(task.name, NOT_RUN if absent or new else FAILED, f"{wanted}{status}")
    if not path.exists():
        return Finding(task.name, MISSING, f"{path} is not there; --update makes it")
    try:
        return _compared(task, history, read_history(path), task.solver)
    except CheckError as error:
        return Finding(task.name, UNREADABLE, str(error))


def _beside_ours(task: Task, own: Finding, baselines: Path) -> tuple[Finding, ...]:
    """A run against the displacements stored for ANC-TMM, if its solver solves the same equations."""
    path = replace(task, solver=OURS).path(baselines)
    if own.computed is None or own.stored is None or task.solver not in SAME_EQUATIONS or not path.exists():
        return ()
    try:
        ours = read_history(path)
    except CheckError:
        return ()  # it is reported in the row of that history
    known = [h.tolerances["displacement"].value for h in (own.stored, ours) if "displacement" in h.tolerances]
    if len(known) < 2 or not own.computed.settings == own.stored.settings == ours.settings:
        return ()
    now, before = (replace(h, frame=h.of_quantity("displacement")) for h in (own.computed, ours))
    both = {"displacement": Tolerance(sum(known), "both tolerances")}
    return (_compared(task, now, replace(before, tolerances=both), OURS),)


def _compared(task: Task, computed: History, stored: History, against: str) -> Finding:
    """A run against a stored history."""
    # histories that were stored before angles were have none
    columns = [c for c in computed.frame if quantity_of(c) != "angle" or c in stored.frame]
    computed = replace(computed, frame=computed.frame[columns])
    found = Finding(task.name, DIFFERS, against=against, computed=computed, stored=stored)
    if stored.settings != computed.settings:
        reason = _changes(stored.settings.split(", "), computed.settings.split(", "))
        return replace(found, verdict=SETTINGS, reason=reason)
    if reason := _unlike(computed, stored):
        return replace(found, reason=reason)
    found = replace(found, **_farthest(computed, stored))
    now, before = computed.corrections, stored.corrections
    if against == task.solver and now > (1.0 + MORE_WORK) * before:
        reason = f"Newton corrections are {now}, stored are {before}: the tangent may be wrong"
        return replace(found, reason=reason)
    far = bool(found.where) and not found.difference <= found.tolerance
    return found if far else replace(found, verdict=SAME)


def _unlike(computed: History, stored: History) -> str:
    """Why two histories have no common samples; empty if they have."""
    now, before = [*map(str, computed.frame)], [*map(str, stored.frame)]
    if now != before:
        return f"columns have changed: {_changes(before, now)}"
    if not set(stored.ending.split(", ")) <= set(computed.ending.split(", ")):
        return f"it ended with {stored.ending or 'ok'}; now with {computed.ending or 'ok'}"
    t, times = computed.t, stored.t
    if t.shape != times.shape or not np.allclose(t, times, rtol=0.0, atol=1e-9 * max(times, default=0.0)):
        found, wanted = (f"{len(x)} up to {x[-1]:g}" if len(x) else "none" for x in (t, times))
        return f"stored times are {wanted}; now there are {found}"
    return ""


def _changes(before: Sequence[str], now: Sequence[str]) -> str:
    """What is not what it was, of settings or of columns."""
    gone, come = [b for b in before if b not in now], [n for n in now if n not in before]
    return f"stored with {', '.join(gone) or 'less'}; now {', '.join(come) or 'less'}"


def _farthest(computed: History, stored: History) -> dict[str, Any]:
    """The sample farthest off in units of its tolerance; what is no number is farther than all others."""
    difference = np.abs(computed.frame.to_numpy() - stored.frame.to_numpy())
    if not difference.size:
        return {}
    tolerance = np.array([stored.tolerances[quantity_of(c)].value for c in computed.frame])
    parts = np.nan_to_num(difference / tolerance, nan=np.inf)
    i, k = map(int, np.unravel_index(int(parts.argmax()), parts.shape))
    where, time = str(computed.frame.columns[k]), float(computed.t[i])
    return {"difference": difference[i, k], "tolerance": tolerance[k], "where": where, "time": time}
