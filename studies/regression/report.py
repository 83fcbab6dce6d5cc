"""Output of a check: a table on the terminal and as files, JUnit XML, and pictures of the differences."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from xml.etree import ElementTree

import pandas as pd
from matplotlib.figure import Figure
from rich.console import Console

from studies.engine.files import atomic_write
from studies.engine.tables import Table, say, say_counts, show_frame, write_table
from studies.regression.check import DIFFERS, FAILED, NOT_RUN, Finding
from studies.report.plots import picture, write_picture

NOTES = (
    "difference: at the sample that is farthest off in units of its tolerance, which stands in the head of the stored "
    "history with its reason.",
    "against: whose stored history; a peer of the same equations is also compared with ours, within both tolerances.",
)
OUTCOMES = {NOT_RUN: "skipped", FAILED: "error"}
COLUMNS = ["against", "difference", "tolerance", "where", "time", "verdict", "reason"]


def frame_of(findings: Sequence[Finding]) -> pd.DataFrame:
    """A row a comparison."""
    names = pd.DataFrame([f.name.split("/") for f in findings], columns=["scene", "run", "solver"])
    return names.join(pd.DataFrame([{c: getattr(f, c) for c in COLUMNS} for f in findings]))


def show(findings: Sequence[Finding], console: Console) -> None:
    """Print the table, the reasons of all that is not simply the same, and the count of each verdict."""
    frame = frame_of(findings).assign(run=[f.title for f in findings])
    show_frame(console, "", frame[["run", "difference", "tolerance", "where", "time", "verdict"]])
    for f in (f for f in findings if f.reason):
        style = "yellow" if f.verdict == NOT_RUN else "green" if f.good else "bold red"
        say(console, f"{f.title}: {f.reason}", style)
    say_counts(console, (f.verdict for f in findings))


def write_check(findings: Sequence[Finding], folder: Path) -> None:
    """`check.csv`, `check.md`, `junit.xml` and a picture of each history that differs."""
    write_table(Table("check", "Histories against the stored ones", frame_of(findings), NOTES), folder)
    atomic_write(folder / "junit.xml", junit(findings))
    for old in folder.glob("*--*.svg"):
        old.unlink()
    for f in findings:
        if f.verdict == DIFFERS and f.where:
            name = f.title.replace("/", "--").replace(" ", "-")
            write_picture(picture(name, f.title, lambda figure, f=f: _draw(f, figure)), folder)  # type: ignore[misc]


def junit(findings: Sequence[Finding]) -> str:
    """JUnit XML: a suite a scene, a case a comparison."""
    xml = ElementTree.Element("testsuites", name="anctmm check")
    kinds = {"failures": "failure", "errors": "error", "skipped": "skipped"}
    for scene, group in groupby(findings, key=lambda f: f.name.split("/")[0]):
        suite = ElementTree.SubElement(xml, "testsuite", name=scene)
        for f in group:
            _, run, title = f.title.split("/")
            about = {"name": title, "classname": f"{scene}.{run}", "time": f"{f.wall_s:.3f}"}
            case = ElementTree.SubElement(suite, "testcase", about)
            if not f.good or f.verdict == NOT_RUN:
                sizes = f"; {f.where} differs by {f.difference:.2g}, allowed are {f.tolerance:.2g}"
                said = f"{f.verdict}: {f.reason}{sizes if f.where else ''}"
                text = "".join(c if c.isprintable() else " " for c in said)
                ElementTree.SubElement(case, OUTCOMES.get(f.verdict, "failure"), message=text, type=f.verdict)
        counts = {name: str(len(suite.findall(f"testcase/{outcome}"))) for name, outcome in kinds.items()}
        suite.attrib.update(counts, tests=str(len(suite)))
    return ElementTree.tostring(xml, encoding="unicode", xml_declaration=True)


def _draw(f: Finding, figure: Figure) -> None:
    """The column that is farthest off, less the stored one, between its tolerances."""
    assert f.computed and f.stored  # noqa: PT018
    now, before = f.computed.frame[f.where], f.stored.frame[f.where]
    title, label = (text.replace("$", r"\$") for text in (f.title, f.where))  # no mathematics
    axes = figure.subplots()
    axes.axhspan(-f.tolerance, f.tolerance, color="tab:green", alpha=0.3, label="tolerance")
    axes.plot(now.index, now.to_numpy() - before.to_numpy(), "o-", label="computed − stored")
    axes.set(title=title, xlabel=now.index.name, ylabel=label)
    axes.legend()
