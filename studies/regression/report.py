"""Output of a check: a table on the terminal and as files, JUnit XML, and pictures of the differences."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from studies.engine.files import atomic_write
from studies.engine.tables import Table, write_table
from studies.regression.check import DIFFERS, FAILED, NOT_RUN, SAME, UNCHANGED, Finding, Worst
from studies.regression.history import UNITS, place_of, quantity_of

STYLES = {SAME: "green", UNCHANGED: "green", NOT_RUN: "yellow"}
HEADS = ("solver", "difference", "tolerance", "where", "when", "verdict")
NOTES = (
    "difference: at the sample that is farthest off in units of its tolerance, which stands in the head of the stored "
    "history with its reason.",
    "against: whose stored history; a peer of the same equations is also compared with ours, within both tolerances.",
)


def frame_of(findings: Sequence[Finding]) -> pd.DataFrame:
    """A row a comparison."""
    none = Worst("", np.nan, np.nan, np.nan)
    rows = []
    for f in findings:
        w = f.worst or none
        rows.append(
            [*f.name.split("/"), f.against, w.difference, w.tolerance, w.column, w.time, f.verdict, f.reason]
        )
    names = (
        "scene",
        "run",
        "solver",
        "against",
        "difference",
        "tolerance",
        "where",
        "time",
        "verdict",
        "reason",
    )
    return pd.DataFrame(rows, columns=names)


def show(findings: Sequence[Finding], console: Console) -> None:
    """Print the table, the reasons of all that is not simply the same, and the count of each verdict."""
    shown = RichTable(*HEADS, box=None, padding=(0, 1, 0, 0), header_style="dim")
    for run, group in groupby(findings, key=lambda f: f.name.split("/")[:2]):
        shown.add_row(f"[bold]{escape(' · '.join(run))}[/bold]")
        for finding in group:
            shown.add_row(*map(escape, _cells(finding)), style=_style(finding))
    console.print(shown, highlight=False)
    for finding in findings:
        if finding.reason:
            console.print(escape(f"{finding.name}: {finding.reason}"), style=_style(finding), highlight=False)
    counts = pd.Series([f.verdict for f in findings]).value_counts(sort=False)
    console.print(", ".join(f"{n} {verdict}" for verdict, n in counts.items()), highlight=False)


def write_check(findings: Sequence[Finding], folder: Path) -> None:
    """`check.csv`, `check.md`, `junit.xml` and a picture of each history that differs."""
    write_table(Table("check", "Histories against the stored ones", frame_of(findings), NOTES), folder)
    atomic_write(folder / "junit.xml", junit(findings))
    for old in folder.glob("*--*.svg"):
        old.unlink()
    for finding in findings:
        if finding.verdict == DIFFERS and finding.worst is not None:
            _draw(finding, folder)


def junit(findings: Sequence[Finding]) -> str:
    """JUnit XML: a suite a scene, a case a comparison."""
    xml = ElementTree.Element("testsuites", name="anctmm check")
    for scene, group in groupby(findings, key=lambda f: f.name.split("/")[0]):
        cases = list(group)
        outcomes = [_outcome(f) for f in cases]
        kinds = {"failures": "failure", "errors": "error", "skipped": "skipped"}
        counts: dict[str, Any] = {
            "tests": str(len(cases)),
            **{k: str(outcomes.count(v)) for k, v in kinds.items()},
        }
        suite = ElementTree.SubElement(xml, "testsuite", name=scene, **counts)
        for f, outcome in zip(cases, outcomes, strict=True):
            _, run, solver = f.name.split("/")
            name = f"{solver} against {f.against}" if _with_another(f) else solver
            about = {"name": name, "classname": f"{scene}.{run}", "time": f"{f.wall_s:.3f}"}
            case = ElementTree.SubElement(suite, "testcase", about)
            text = "".join(c if c.isprintable() else " " for c in _in_words(f))
            if outcome:
                ElementTree.SubElement(case, outcome, message=text, type=f.verdict)
            ElementTree.SubElement(case, "system-out").text = text
    return ElementTree.tostring(xml, encoding="unicode", xml_declaration=True)


def _outcome(f: Finding) -> str:
    if f.verdict == NOT_RUN:
        return "skipped"
    return "" if f.good else "error" if f.verdict == FAILED else "failure"


def _with_another(f: Finding) -> bool:
    """Whether it is a comparison with the history of another solver."""
    return f.against not in ("", f.name.split("/")[2])


def _draw(f: Finding, folder: Path) -> None:
    """The column of a history that is farthest off, stored and computed, and their difference."""
    assert f.computed and f.stored and f.worst  # noqa: PT018
    now, before = (frame[f.worst.column] for frame in (f.computed.frame, f.stored.history.frame))
    unit = UNITS[quantity_of(f.worst.column)]
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    above.plot(now, "o", label="computed")
    above.plot(before, color="black", linewidth=1.0, label="stored")
    label, title = (text.replace("$", r"\$") for text in (f.worst.column, f.name))  # no mathematics
    above.set(ylabel=label, title=title)
    above.legend()
    label = f"tolerance, ±{f.worst.tolerance:.1e} {unit}"
    below.axhspan(-f.worst.tolerance, f.worst.tolerance, color="tab:green", alpha=0.3, label=label)
    below.plot(now.index, now.to_numpy() - before.to_numpy(), "o-", linewidth=1.0)
    below.set(xlabel=now.index.name, ylabel=f"difference ({unit})")
    below.legend()
    against = f"--against-{f.against}" if _with_another(f) else ""
    with mpl.rc_context({"svg.fonttype": "none"}):
        figure.savefig(folder / f"{f.name.replace('/', '--')}{against}.svg")


def _cells(f: Finding) -> list[str]:
    """Solver, or whom its run is compared with besides; numbers with their unit."""
    first = f"    to {f.against}" if _with_another(f) else f"  {f.name.split('/')[2]}"
    if f.worst is None:
        return [first, "", "", "", "", f.verdict]
    w, unit = f.worst, UNITS[quantity_of(f.worst.column)]
    numbers = [f"{w.difference:.1e} {unit}", f"{w.tolerance:.1e} {unit}"]
    return [first, *numbers, place_of(w.column), f"{w.time:.4g}", f.verdict]


def _in_words(f: Finding) -> str:
    if f.worst is None:
        return f"{f.verdict}: {f.reason}"
    w, unit = f.worst, UNITS[quantity_of(f.worst.column)]
    text = f"{f.verdict}: {w.difference:.2e} {unit} in {w.column} at {w.time:g}, tolerance {w.tolerance:.1e} {unit}"
    return f"{text}; {f.reason}" if f.reason else text


def _style(f: Finding) -> str:
    return STYLES.get(f.verdict, "cyan") if f.good else "bold red"
