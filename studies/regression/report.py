"""Output of a check: a table on the terminal and as files, JUnit XML, and pictures of the differences."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from studies.regression.check import DIFFERS, FAILED, NOT_RUN, SAME, UNCHANGED, Finding
from studies.regression.history import UNITS

STYLES = {SAME: "green", UNCHANGED: "green", NOT_RUN: "yellow"}
HEADS = ("solver", "difference", "tolerance", "where", "when", "verdict")
NOTES = """# Histories against the stored ones

- difference: at the sample that is farthest off in units of its tolerance, which stands in the head of the stored
  history with its reason.
- against: whose stored history; a peer of the same equations is also compared with ours, within both tolerances.
"""


def frame_of(findings: Sequence[Finding]) -> pd.DataFrame:
    """A row a comparison."""
    rows = []
    for f in findings:
        scene, run, solver = f.name.split("/")
        w = f.worst
        rows.append({
            "scene": scene, "run": run, "solver": solver, "against": f.against,
            "difference": w.difference if w else np.nan, "tolerance": w.tolerance if w else np.nan,
            "where": w.column.label if w else "", "time": w.time if w else np.nan,
            "verdict": f.verdict, "reason": f.reason,
        })  # fmt: skip
    return pd.DataFrame(rows)


def show(findings: Sequence[Finding], console: Console) -> None:
    """Print the table, the reasons of all that is not simply the same, and the count of each verdict."""
    shown = Table(*HEADS, box=None, padding=(0, 1, 0, 0), header_style="dim")
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
    folder.mkdir(parents=True, exist_ok=True)
    frame = frame_of(findings)
    frame.to_csv(folder / "check.csv", index=False, float_format="%.9g")
    lines = [
        " | ".join(map(_cell, row)) for row in [frame.columns, ["---"] * len(frame.columns), *frame.values]
    ]
    (folder / "check.md").write_text(
        "\n".join([NOTES, *(f"| {line} |" for line in lines), ""]), encoding="utf-8"
    )
    (folder / "junit.xml").write_text(junit(findings), encoding="utf-8")
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
        counts = {
            "tests": len(cases),
            "failures": sum(_outcome(f) == "failure" for f in cases),
            "errors": sum(_outcome(f) == "error" for f in cases),
            "skipped": sum(_outcome(f) == "skipped" for f in cases),
        }
        suite = ElementTree.SubElement(
            xml, "testsuite", {"name": scene, **{k: str(v) for k, v in counts.items()}}
        )
        for f in cases:
            _, run, solver = f.name.split("/")
            name = solver + (f" against {f.against}" if f.against not in ("", solver) else "")
            about = {"name": name, "classname": f"{scene}.{run}", "time": f"{f.wall_s:.3f}"}
            case = ElementTree.SubElement(suite, "testcase", about)
            text = "".join(
                c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in _in_words(f)
            )
            if outcome := _outcome(f):
                ElementTree.SubElement(case, outcome, message=text, type=f.verdict)
            ElementTree.SubElement(case, "system-out").text = text
    return ElementTree.tostring(xml, encoding="unicode", xml_declaration=True)


def _outcome(f: Finding) -> str:
    if f.verdict == NOT_RUN:
        return "skipped"
    return "" if f.good else "error" if f.verdict == FAILED else "failure"


def _draw(f: Finding, folder: Path) -> None:
    """The column of a history that is farthest off, stored and computed, and their difference."""
    assert f.computed and f.stored and f.worst  # noqa: PT018
    k = f.computed.columns.index(f.worst.column)
    now, before = f.computed.values[:, k], f.stored.history.values[:, k]
    unit = UNITS[f.worst.column.quantity]
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    above.plot(f.computed.t, now, "o", label="computed")
    above.plot(f.stored.history.t, before, color="black", linewidth=1.0, label="stored")
    above.set(ylabel=_plain(f.worst.column.label), title=_plain(f.name))
    above.legend()
    label = f"tolerance, ±{f.worst.tolerance:.1e} {unit}"
    below.axhspan(-f.worst.tolerance, f.worst.tolerance, color="tab:green", alpha=0.3, label=label)
    below.plot(f.computed.t, now - before, "o-", linewidth=1.0)
    below.set(xlabel=f.computed.axis, ylabel=f"difference ({unit})")
    below.legend()
    solver = f.name.split("/")[2]
    against = "" if f.against == solver else f"--against-{f.against}"
    with mpl.rc_context({"svg.fonttype": "none"}):
        figure.savefig(folder / f"{f.name.replace('/', '--')}{against}.svg")


def _cells(f: Finding) -> list[str]:
    """Solver, or whom its run is compared with besides; numbers with their unit."""
    solver = f.name.split("/")[2]
    first = f"  {solver}" if f.against in ("", solver) else f"    to {f.against}"
    if f.worst is None:
        return [first, "", "", "", "", f.verdict]
    w, unit = f.worst, UNITS[f.worst.column.quantity]
    numbers = [f"{w.difference:.1e} {unit}", f"{w.tolerance:.1e} {unit}"]
    return [first, *numbers, w.column.where or w.column.quantity, f"{w.time:.4g}", f.verdict]


def _in_words(f: Finding) -> str:
    if f.worst is None:
        return f"{f.verdict}: {f.reason}"
    w, unit = f.worst, UNITS[f.worst.column.quantity]
    where = f"{w.column.label} at {w.time:g}"
    text = f"{f.verdict}: {w.difference:.2e} {unit} in {where}, tolerance {w.tolerance:.1e} {unit}"
    return f"{text}; {f.reason}" if f.reason else text


def _cell(value: object) -> str:
    text = f"{value:.3g}" if isinstance(value, float) else str(value)
    return "" if text == "nan" else text.replace("|", "\\|")


def _plain(text: str) -> str:
    """A name in a picture: no mathematics."""
    return text.replace("$", r"\$")


def _style(f: Finding) -> str:
    return STYLES.get(f.verdict, "cyan") if f.good else "bold red"
