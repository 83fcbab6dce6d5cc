"""Stored histories: small CSV files with a header that describes them, readable in a diff."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, log10
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anctmm.results.metrics import common_times
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from studies.engine.accuracy.resting import turn_at_rest
from studies.engine.tables import atomic_write
from studies.regression.scenes import CheckError, Static, Task

Array = NDArray[np.float64]

FIRST, LAST, PHYSICS = "# anctmm history 1", "# end", "# physics: "
#: Before the name of the file whose scenes a history belongs to; histories of the package have no such line.
FILE = "# file: "
#: Of the quantities, each with one tolerance.
UNITS = {
    "displacement": "m",
    "angle": "rad",
    "kinetic energy": "J",
    "strain energy": "J",
    "potential energy": "J",
    "work": "J",
    "load factor": "1",
}
LOAD_FACTOR, ANGLE = "load factor", "angle"
ENERGIES = ("kinetic", "strain", "potential", "work")
#: What is counted of a run's work, and its name in `Cost`.
COUNTED = {
    "Newton corrections": "newton_iterations",
    "factorizations": "factorizations",
    "steps": "steps",
}
#: Between the factor of a tolerance and what it is made of; its digits are rounded.
OF_CAUSES, ROUNDED = " times the largest of: ", 1.1
#: Digits kept below the tolerance.
SPARE_DIGITS = 2


@dataclass(frozen=True)
class Column:
    """One quantity at one place."""

    quantity: str
    where: str = ""

    @property
    def label(self) -> str:
        """Head of the column, with its unit."""
        return f"{self.quantity} {self.where}".strip() + f" ({UNITS[self.quantity]})"


@dataclass(frozen=True)
class History:
    """Few samples of few quantities.

    Parameters
    ----------
    t : ndarray, shape (n,)
        s, or the load factor, or the number of the point of a path.
    axis : str
        Which of them, with its unit.
    columns : tuple of Column
    values : ndarray, shape (n, columns)
    corrections : int
        Newton corrections of the whole run: a wrong tangent leaves the history as it is, but takes more of them.
    counts : mapping of str to int
        What else the solver counts of its work.
    ending : str
        How the run ended, where it did not end well: status, and step, body and element it names.
    """

    t: Array
    axis: str
    columns: tuple[Column, ...]
    values: Array
    corrections: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    ending: str = ""

    @classmethod
    def of(cls, solution: Solution, task: Task) -> "History":
        """Displacements of the probes, and the energies that the solver gives, at the times wanted.

        Of a probe that rests and turns, such as the axle of a wheel, the angle as well: its displacement tells nothing,
        and energies do not tell in which sense it turns.
        A solver may take more samples (smaller load steps), or have fewer (a run cut short). An energy that is zero
        throughout (kinetic in statics) or that the solver does not give is left out.
        """
        axis = LOAD_FACTOR if isinstance(task.run, Static) else "t (s)"
        ending, cost = _ending(solution.status), solution.cost
        if len(solution.t) < 2:  # a run that ended before its first output has only a status
            return cls(np.empty(0), axis, (), np.empty((0, 0)), ending=ending)
        columns: list[Column] = []
        values: list[Array] = []
        if task.times is None:
            t, axis = np.arange(len(solution.t), dtype=float), "point of the path"
            mine = np.arange(len(t))
        else:
            t, (mine, _) = solution.t, common_times(solution.t, task.times)
        for probe in task.probes:
            body, key = solution.scene.probe(probe)
            where = key if isinstance(key, str) else f"{key:g}"
            u = solution.displacement(probe)
            for direction, series in zip("xy", u.T, strict=True):
                columns.append(Column("displacement", f"{body} at {where} {direction}"))
                values.append(series)
            if (turned := turn_at_rest(solution, probe)) is not None:
                columns.append(Column(ANGLE, f"{body} at {where}"))
                values.append(turned)
        if task.times is None:
            columns.append(Column(LOAD_FACTOR))
            values.append(solution.t)
        for name in ENERGIES:  # what is dissipated is part of the work
            series = getattr(solution.energy, name)
            if np.any(series != 0.0) and np.isfinite(series).all():
                columns.append(Column("work" if name == "work" else f"{name} energy"))
                values.append(series)
        table = np.column_stack(values)[mine]
        counts = {name: getattr(cost, attribute) for name, attribute in COUNTED.items()}
        return cls(t[mine], axis, tuple(columns), table, cost.newton_iterations, counts, ending)

    def of_quantity(self, quantity: str) -> Array:
        """The columns of a quantity, (n, m)."""
        return self.values[:, [c.quantity == quantity for c in self.columns]]

    @property
    def quantities(self) -> list[str]:
        """Those it has, in order."""
        return list(dict.fromkeys(c.quantity for c in self.columns))

    def of_columns(self, kept: Callable[[Column], bool]) -> "History":
        """The same with some of its columns only."""
        keep = [kept(c) for c in self.columns]
        columns = tuple(c for c, k in zip(self.columns, keep, strict=True) if k)
        return replace(self, columns=columns, values=self.values[:, keep])


@dataclass(frozen=True)
class Tolerance:
    """How far a quantity may lie from what is stored, and why."""

    value: float
    reason: str


@dataclass(frozen=True)
class Baseline:
    """A stored history with its settings, its tolerance of each quantity, and how far counts may lie apart.

    Histories that were stored before work was counted have no margins: only their Newton corrections are looked at.
    """

    settings: str
    tolerances: Mapping[str, Tolerance]
    history: History
    margins: Mapping[str, int] = field(default_factory=dict)
    physics: tuple[str, ...] = ()


def write_baseline(path: Path, task: Task, stored: Baseline, made_by: str, file: str = "") -> None:
    """Write a baseline, whole or not at all; `file` is the name of the user's file that it belongs to."""
    history = stored.history
    decimals = [_decimals(stored.tolerances[c.quantity].value) for c in history.columns]
    lines = [
        FIRST,
        *([f"{FILE}{file}"] if file else []),
        f"# scene: {task.scene.name}",
        *(f"{PHYSICS}{part}" for part in physics_of(task)),
        f"# run: {task.run_name}",
        f"# solver: {task.solver}",
        f"# settings: {stored.settings}",
        f"# made by (shown, not compared): {made_by}",
        *(
            f"# tolerance of {name}: {t.value:.1e} {UNITS[name]}, {t.reason}"
            for name, t in stored.tolerances.items()
        ),
        f"# Newton corrections: {history.corrections}",
        *(f"# count of {name}: {history.counts[name]} ± {margin}" for name, margin in stored.margins.items()),
        *([f"# ending: {history.ending}"] if history.ending else []),
        f"# rows: {len(history.t)}",
        ",".join([history.axis, *(c.label for c in history.columns)]),
    ]
    for t, row in zip(history.t, history.values, strict=True):
        lines.append(",".join([f"{t:.9g}", *(f"{v:.{d}f}" for v, d in zip(row, decimals, strict=True))]))
    atomic_write(path, "\n".join([*lines, LAST, ""]))


def read_baseline(path: Path) -> Baseline:
    """Read a baseline.

    Raises
    ------
    FileNotFoundError
        If there is none.
    CheckError
        If the file is none of ours, or not whole, naming the line.
    """
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except FileNotFoundError:
        raise
    except UnicodeDecodeError:
        lines = [""]
    except OSError as error:
        raise CheckError(f"{path} cannot be read: {error.strerror}; a file is needed") from None
    if lines[0] != FIRST:
        raise CheckError(f"{path} does not begin with {FIRST!r}: it is no history stored by anctmm check")
    head = [line for line in lines if line.startswith("# ")]
    body = [line.split(",") for line in lines[1:] if line and not line.startswith("#")]
    rows = _after(head, "# rows: ")
    if lines[-2:] != [LAST, ""] or rows != str(len(body) - 1):
        raise CheckError(
            f"{path} is cut short or edited: {len(body) - 1} rows and {lines[-2] if len(lines) > 1 else ''!r} at "
            f"its end; {rows or 'a number of'} rows and {LAST!r} are needed; renew it with --update"
        )
    try:
        table = np.array(body[1:], dtype=float).reshape(len(body) - 1, len(body[0]))
        columns = tuple(map(_column, body[0][1:]))
        corrections = int(_after(head, "# Newton corrections: "))
        counted = [_count(line) for line in head if line.startswith("# count of ")]
        tolerances = dict(_tolerance(line) for line in head if line.startswith("# tolerance of "))
        if table.shape[1] != len(columns) + 1 or {c.quantity for c in columns} - set(tolerances):
            raise ValueError("a column or a tolerance is missing")
    except (ValueError, KeyError, IndexError) as error:
        raise CheckError(f"{path} cannot be read: {error}; renew it with --update") from None
    settings = _after(head, "# settings: ")
    history = History(
        table[:, 0],
        body[0][0],
        columns,
        table[:, 1:],
        corrections,
        {name: count for name, count, _ in counted},
        _after(head, "# ending: "),
    )
    physics = tuple(line.removeprefix(PHYSICS) for line in head if line.startswith(PHYSICS))
    return Baseline(settings, tolerances, history, {name: margin for name, _, margin in counted}, physics)


def is_ours(path: Path) -> bool:
    """Whether a file was written by `write_baseline`, whole or not."""
    try:
        with path.open("rb") as file:
            return file.read(len(FIRST)) == FIRST.encode()
    except OSError:
        return False


def file_of(path: Path) -> str:
    """Name of the file that a stored history belongs to; empty where it does not say, or cannot be read."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError:
        return ""
    return _after([line for line in lines if line.startswith("# ")], FILE)


def note_file(path: Path, file: str) -> None:
    """Write into a stored history which file it belongs to; all else stays as it is."""
    first, *rest = path.read_text(encoding="utf-8").split("\n")
    kept = [line for line in rest if not line.startswith(FILE)]
    atomic_write(path, "\n".join([first, f"{FILE}{file}", *kept]))


def physics_of(task: Task) -> list[str]:
    """The scene in words; functions by their names, whose addresses say nothing."""
    scene = task.scene
    parts = [
        *map(repr, (*scene.bodies, *scene.joints, *scene.loads, *scene.connectors)),
        f"gravity {scene.gravity}",
    ]
    return [re.sub(r" at 0x[0-9a-f]+", "", " ".join(part.split())) for part in parts]


def _decimals(tolerance: float) -> int:
    return max(0, ceil(-log10(tolerance))) + SPARE_DIGITS


def _after(head: Sequence[str], start: str) -> str:
    return next((line.removeprefix(start) for line in head if line.startswith(start)), "")


def _column(label: str) -> Column:
    quantity = next((q for q in UNITS if label.startswith(q)), "work")
    where = label.removeprefix(quantity).removesuffix(f"({UNITS[quantity]})").strip()
    if Column(quantity, where).label != label:
        raise ValueError(f"column {label!r} is unknown")
    return Column(quantity, where)


def _ending(status: Status) -> str:
    """What a status says of the end of a run that did not end well, except for its words, which may be bettered."""
    if status.ok:
        return ""
    kind = [status.message.partition(":")[0]] if status.code == "refused" else []
    parts = {"step": status.step, "body": status.body, "element": status.element}
    return ", ".join([status.code, *kind, *(f"{k} {v}" for k, v in parts.items() if v is not None)])


def _count(line: str) -> tuple[str, int, int]:
    """Name, count and margin."""
    name, _, rest = line.removeprefix("# count of ").partition(": ")
    count, _, margin = rest.partition(" ± ")
    return name, int(count), int(margin)


def _tolerance(line: str) -> tuple[str, Tolerance]:
    name, _, rest = line.removeprefix("# tolerance of ").partition(": ")
    value, _, reason = rest.partition(f" {UNITS[name]}, ")
    if not 0.0 < float(value) < float("inf"):
        raise ValueError(f"tolerance of {name} is {value}")
    factor, _, causes = reason.partition(OF_CAUSES)
    most = float(factor) * max(float(cause.rpartition(" ")[2]) for cause in causes.split(", "))
    if float(value) > ROUNDED * most:  # it would hide what has changed
        raise ValueError(f"tolerance of {name} is {value}, more than its causes make it, {most:.1e}")
    return name, Tolerance(float(value), reason)
