"""Tables: tidy frames to CSV, Markdown, HTML and the terminal."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.engine.storage import provenance
from studies.engine.storage.files import atomic_write

if TYPE_CHECKING:
    import pandas as pd

ACCURACY = (
    "scene", "solver", "element", "quadrature", "integrator", "elements", "dofs", "dt", "t_end", "steps",
    "error", "reference_error", "reference", "cpu_s", "build_s", "wall_s", "status",
)  # fmt: skip
CPU_TIME = (
    "scene", "solver", "element", "quadrature", "integrator", "elements", "dofs", "dt", "t_end", "steps",
    "newton_iterations", "error", "reference_error", "cpu_s", "cpu_spread", "build_s", "wall_s", "repeats",
    "us_per_step", "ratio", "status",
)  # fmt: skip
BUILD = (
    "build_s: CPU time of a call beside its steps: building the system before them, the answer and its checks after "
    "them; a run costs both. Median of the same samples, compilation excluded."
)
#: A row's time is compared with this solver's at the same setting.
BASE_SOLVER = "anctmm"
#: Longer tables are for programs: in their CSV file only.
MOST_ROWS = 500
#: Errors, and the columns that say how well what they are measured against is known.
KNOWN_TO = {
    "error": "reference_error",
    "robust_error": "reference_error",
    "mesh_error": "reference_error",
    "step_error": "step_reference_error",
}
BELOW = "An error below what its reference is known to is shown as below that: < 0.0002. CSV files have the number."
SETTING = ["scene", "element", "quadrature", "integrator", "elements", "dt"]


@dataclass(frozen=True)
class Table:
    """A named table.

    Parameters
    ----------
    name : str
        Of its files.
    title : str
    frame : DataFrame
    notes : tuple of str
        What a reader must know to read it rightly.
    """

    name: str
    title: str
    frame: "pd.DataFrame"
    notes: tuple[str, ...] = ()


def accuracy(rows: Sequence[dict[str, Any]], notes: Iterable[str] = ()) -> Table:
    """Who is how wrong."""
    import pandas as pd  # a third of a second, which commands that show no table do not take

    frame = pd.DataFrame(rows, columns=list(ACCURACY))
    standard = (
        "error: over the probes, the largest of RMS in time of |u − u_ref| / max in time of |u_ref|, "
        "u the displacement.",
        "reference_error: the reference's own uncertainty; an error near it says nothing.",
        BELOW,
        BUILD,
    )
    return Table("accuracy", "Accuracy: who is how wrong", frame, (*standard, *notes))


def cpu_time(rows: Sequence[dict[str, Any]], notes: Iterable[str] = ()) -> Table:
    """What it costs, with ratios to ANC-TMM at the same setting."""
    import pandas as pd

    frame = pd.DataFrame(rows)
    if not frame.empty:
        frame["us_per_step"] = 1e6 * frame["cpu_s"] / frame["steps"].where(frame["steps"] > 0)
        frame["ratio"] = frame["cpu_s"] / _base_time(frame)
    frame = frame.reindex(columns=list(CPU_TIME))
    standard = (
        "cpu_s: of the steps; median of `repeats` samples on one thread, garbage collection off, compilation excluded; "
        "cpu_spread: (largest − smallest) / median. The samples are in samples.csv.",
        BUILD,
        f"ratio: cpu_s over that of {BASE_SOLVER!r} at the same setting; the contestants ran in turn.",
    )
    return Table("cpu_time", "CPU time: what it costs", frame, (*standard, *notes))


def _base_time(frame: "pd.DataFrame") -> "pd.Series":
    base = frame[frame["solver"] == BASE_SOLVER].drop_duplicates(SETTING)[[*SETTING, "cpu_s"]]
    return frame[SETTING].merge(base, on=SETTING, how="left")["cpu_s"].set_axis(frame.index)


def failed(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Rows of the runs that are not whole; "ok: …" is a whole run with a remark."""
    return frame[frame["status"].str.split(":").str[0] != "ok"]


def text(value: Any) -> str:
    """A cell to be read: five digits of a float, nothing for a NaN."""
    if isinstance(value, float):
        return "" if isnan(value) else f"{value:.5g}"
    return str(value)


def times(ratio: float) -> str:
    """A ratio in a sentence: two digits, and no power of ten."""
    return f"{ratio:.2g}" if ratio < 99.5 else f"{ratio:.0f}"


def milliseconds(cpu_s: float) -> str:
    """A time in words."""
    return f"{1e3 * cpu_s:.2g} ms" if cpu_s < 0.0995 else f"{cpu_s:.2g} s"


def error_text(line: Mapping[Any, Any], name: str = "error", form: str = ".2g") -> str:
    """An error of a row in words; where it is below what its reference is known to, that it is below that."""
    error, known = line[name], line.get(KNOWN_TO[name], nan)
    return f"< {known:{form}}" if 0.0 < error < known else f"{error:{form}}"


def for_people(frame: "pd.DataFrame") -> "pd.DataFrame":
    """A frame whose errors are shown as below what their reference is known to, where they are; the rest as it is."""
    for name, known in KNOWN_TO.items():
        if {name, known} <= set(frame.columns):
            below = (frame[name] > 0.0) & (frame[name] < frame[known])
            if below.any():
                told = frame[known].map("< {:.2g}".format)
                frame = frame.assign(**{name: frame[name].astype(object).mask(below, told)})
    return frame


def cells(frame: "pd.DataFrame") -> list[list[str]]:
    """All cells of a frame as text."""
    return [[text(v) for v in record] for record in frame.itertuples(index=False, name=None)]


def markdown(table: Table) -> str:
    """The table with its title, its notes and the machine."""
    from pandas.api.types import is_numeric_dtype

    columns = [str(c) for c in table.frame.columns]
    body = [[c.replace("|", "\\|") for c in line] for line in cells(for_people(table.frame))]
    numeric = [is_numeric_dtype(t) for t in table.frame.dtypes]
    rule = ["---:" if n else "---" for n in numeric]
    lines = ["| " + " | ".join(line) + " |" for line in [columns, rule, *body]]
    notes = [f"- {note}" for note in table.notes]
    head = [f"# {table.title}", "", *notes, ""] if notes else [f"# {table.title}", ""]
    return "\n".join([*head, *lines, "", f"Measured on: {provenance.stamp()}.", ""])


def write_table(table: Table, folder: Path) -> None:
    """`<name>.csv`, and `<name>.md` if a person may want to read that many rows."""
    atomic_write(folder / f"{table.name}.csv", table.frame.to_csv(index=False, float_format="%.9g"))
    if len(table.frame) <= MOST_ROWS:
        atomic_write(folder / f"{table.name}.md", markdown(table))


def write_machine(folder: Path) -> None:
    """Machine and versions beside the CSV files, which have no room for them."""
    facts = {"machine": provenance.machine(), "versions": provenance.versions()}
    atomic_write(folder / "machine.json", json.dumps(facts, indent=2) + "\n")
