"""Output of a check: a table on the terminal and as files, JUnit XML, and pictures of the differences."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from studies.engine.console import say
from studies.engine.tables import Table, atomic_write, write_table
from studies.regression.check import DIFFERS, FAILED, NOT_RUN, RENEWED, SAME, UNCHANGED, Finding
from studies.regression.history import UNITS
from studies.report.plots import (
    INK,
    PALETTE,
    Picture,
    legend_below,
    picture,
    solver_colour,
    solver_marker,
    write_picture,
)

STYLES = {SAME: "green", UNCHANGED: "green", NOT_RUN: "yellow"}
#: Columns with their widths: one table a run, and all of them in line.
HEADS = {"solver": 18, "difference": 11, "tolerance": 11, "where": 14, "when": 6, "verdict": 14}
NUMERIC = ("difference", "tolerance", "when")
#: Verdicts of histories that have changed.
CHANGED = (DIFFERS, RENEWED)
#: A difference below this part of its tolerance is drawn there: a logarithmic axis has no zero.
DRAWN = 1e-4


def frame_of(findings: Sequence[Finding]) -> pd.DataFrame:
    """A row a comparison."""
    return pd.DataFrame([_row(f) for f in findings])


def show(findings: Sequence[Finding], console: Console) -> None:
    """Print the table, the reasons of what is not simply the same, and the count of each verdict."""
    for i, (run, group) in enumerate(groupby(findings, key=lambda f: (f.scene, f.run))):
        shown = RichTable(box=None, padding=(0, 1, 0, 0), header_style="dim", show_header=i == 0)
        for head, width in HEADS.items():
            right = "right" if head in NUMERIC else "left"
            shown.add_column(head, justify=right, width=width, overflow="fold")  # type: ignore[arg-type]
        for finding in group:
            shown.add_row(*map(escape, _cells(finding)), style=None if finding.good else "bold red")
        console.print(f"[bold]{escape(' · '.join(run))}[/bold]", shown, highlight=False)
    for finding in findings:
        if finding.reason:
            say(console, f"{finding.name}: {finding.reason}", _style(finding))
    counts = {v: sum(f.verdict == v for f in findings) for v in dict.fromkeys(f.verdict for f in findings)}
    console.print(", ".join(f"{n} {verdict}" for verdict, n in counts.items()), highlight=False)


def write_check(findings: Sequence[Finding], folder: Path) -> None:
    """`check.csv`, `check.md`, `junit.xml` and the pictures."""
    notes = (
        "difference: at the sample that is farthest off in units of its tolerance, which stands in the head "
        "of the stored history with its reason.",
        "against: whose stored history; a peer of the same equations is also compared with ours, within both "
        "tolerances.",
    )
    title = "Displacement histories against the stored ones"
    write_table(Table("check", title, frame_of(findings), notes), folder)
    atomic_write(folder / "junit.xml", junit(findings))
    for old in folder.glob("*--*.svg"):
        old.unlink()
    for shown in pictures(findings):
        write_picture(shown, folder)


def junit(findings: Sequence[Finding]) -> str:
    """JUnit XML: a suite a scene, a case a comparison."""
    xml = JUnitXml("anctmm check")
    for scene, group in groupby(findings, key=lambda f: f.scene):
        suite = TestSuite(scene)
        for f in group:
            name = f.solver + (f" against {f.against}" if f.against not in ("", f.solver) else "")
            case = TestCase(name, f"{f.scene}.{f.run}", f.wall_s)
            told = "".join(
                c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in _told(f)
            )
            if f.verdict == NOT_RUN:
                case.result = [Skipped(told)]
            elif not f.good:
                case.result = [(Error if f.verdict == FAILED else Failure)(told, f.verdict)]
            case.system_out = told
            suite.add_testcase(case)
        xml.add_testsuite(suite)
    xml.update_statistics()
    return str(xml.tostring().decode())


# --- pictures ----------------------------------------------------------------------------------------------


def pictures(findings: Sequence[Finding]) -> list[Picture]:
    """Of each run in which a history has changed: every solver's difference, and the histories that differ.

    None of what is the same: a picture takes longer than most runs.
    """
    compared = [f for f in findings if f.worst is not None]
    runs = [list(group) for _, group in groupby(compared, key=lambda f: (f.scene, f.run))]
    changed = [group for group in runs if any(f.verdict in CHANGED for f in group)]
    return [
        *(_differences(f"{group[0].scene}--{group[0].run}", group) for group in changed),
        *(_one(f) for f in compared if f.verdict == DIFFERS),
    ]


def _differences(name: str, findings: list[Finding]) -> Picture:
    quantities = list(dict.fromkeys(q for f in findings for q in f.computed.quantities))  # type: ignore[union-attr]

    axis = next(f.computed.axis for f in findings if f.computed is not None)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(quantities), squeeze=False)[0]
        for axes, quantity in zip(panels, quantities, strict=True):
            for f in findings:
                _difference(axes, f, quantity)
            axes.set(
                yscale="log", xlabel=axis, ylabel=f"difference ({UNITS[quantity]})",
                title=quantity.capitalize(),
            )  # fmt: skip
        panels[0].plot([], [], color=INK, linewidth=1.2, label="lines: tolerances")
        legend_below(figure, list(panels), 4)
        figure.suptitle(_plain(name.replace("--", " · ")), fontsize=10, x=0.01, ha="left")

    caption = f"{name}: largest difference to the stored histories (points), and tolerances (lines)."
    return picture(name, caption, draw, (3.1 * max(len(quantities), 2), 3.4))


def _difference(axes: Axes, f: Finding, quantity: str) -> None:
    computed, stored = f.computed, f.stored
    assert computed is not None
    assert stored is not None
    if quantity not in computed.quantities:
        return
    tolerance = stored.tolerances[quantity].value
    apart = np.abs(computed.of_quantity(quantity) - stored.history.of_quantity(quantity)).max(axis=1)
    own = f.against == f.solver
    label = f.solver if own else f"{f.solver} against {f.against}"
    style: dict[str, Any] = {"color": solver_colour(f.solver), "linestyle": "-" if own else (0, (4, 2))}
    axes.plot(
        computed.t, np.maximum(apart, DRAWN * tolerance), "-", label=label, marker=solver_marker(f.solver),
        markerfacecolor=style["color"] if own else "none", linewidth=0.7, color=style["color"],
    )  # fmt: skip
    axes.axhline(tolerance, **style, linewidth=1.2, alpha=0.7)


def _one(f: Finding) -> Picture:
    """A history that differs: the quantity that is farthest off, stored and computed, and their difference."""
    assert f.computed is not None
    assert f.stored is not None
    assert f.worst is not None
    computed, stored, worst = f.computed, f.stored, f.worst
    k = computed.columns.index(worst.column)
    unit = UNITS[worst.column.quantity]

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        above.plot(computed.t, computed.values[:, k], "o", color=PALETTE[1], label="computed")
        above.plot(stored.history.t, stored.history.values[:, k], color=INK, label="stored", linewidth=1.0)
        above.set(ylabel=_plain(worst.column.label), title=_plain(f.name))
        above.legend()
        difference = computed.values[:, k] - stored.history.values[:, k]
        label = f"tolerance, ±{worst.tolerance:.1e} {unit}"
        below.axhspan(
            -worst.tolerance, worst.tolerance, color=PALETTE[2], alpha=0.4, label=label, linewidth=0.5
        )
        below.plot(computed.t, difference, "o-", color=PALETTE[1], linewidth=1.0)
        below.set(xlabel=computed.axis, ylabel=f"difference ({unit})")
        below.legend()

    against = "" if f.against == f.solver else f"--against-{f.against}"
    name = f.name.replace("/", "--") + against
    return picture(name, f"{f.name}: {_told(f)}", draw, (6.4, 4.4))


# --- words -------------------------------------------------------------------------------------------------


def _row(f: Finding) -> dict[str, Any]:
    worst = f.worst
    return {
        "scene": f.scene,
        "run": f.run,
        "solver": f.solver,
        "against": f.against,
        "difference": worst.difference if worst else float("nan"),
        "tolerance": worst.tolerance if worst else float("nan"),
        "where": worst.column.label if worst else "",
        "time": worst.time if worst else float("nan"),
        "verdict": f.verdict,
        "reason": f.reason,
    }


def _cells(f: Finding) -> list[str]:
    """Solver, or whom its run is compared with besides; numbers with their unit."""
    first = f"  {f.solver}" if f.against in ("", f.solver) else f"    to {f.against}"
    if f.worst is None:
        return [first, "", "", "", "", f.verdict]
    w, unit = f.worst, UNITS[f.worst.column.quantity]
    where = w.column.where or w.column.quantity
    return [
        first,
        f"{w.difference:.1e} {unit}",
        f"{w.tolerance:.1e} {unit}",
        where,
        f"{w.time:.4g}",
        f.verdict,
    ]


def _told(f: Finding) -> str:
    if f.worst is None:
        return f"{f.verdict}: {f.reason}"
    w, unit = f.worst, UNITS[f.worst.column.quantity]
    where = f"{w.column.label} at {w.time:g}"
    told = f"{f.verdict}: {w.difference:.2e} {unit} in {where}, tolerance {w.tolerance:.1e} {unit}"
    return f"{told}; {f.reason}" if f.reason else told


def _plain(text: str) -> str:
    """A name in a picture: no mathematics."""
    return text.replace("$", r"\$")


def _style(f: Finding) -> str:
    return STYLES.get(f.verdict, "cyan" if f.good else "red")
