"""The page of a report: cards, then a section a study with pictures, tables and notes."""

import re
import shlex
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from pandas.api.types import is_numeric_dtype

from studies.engine import provenance
from studies.engine.study import Answer, Picture, Result
from studies.engine.tables import MOST_ROWS, Table, cell, for_people
from studies.report.plots import GRID, INK, PAPER

#: Names of columns that need a unit or a symbol.
LABELS = {
    "cpu_s": "CPU time of steps (s)", "whole_s": "whole call (s)", "build_s": "set-up (s)", "dofs": "coordinates",
    "dt": "Δt (s)", "t": "t (s)", "t_end": "t end (s)", "stable_dt": "stable Δt (s)",
    "us_per_element_step": "µs per element and step",
}  # fmt: skip
#: Columns that the page leaves out: they are in the files.
HIDDEN = {"case", "asked", "own", "kind", "repeats", "cpu_spread", "in_turn", "excess"}
#: Columns of settings that a sentence holds, which stands beside them in the same table.
IN_SETTING = {
    "element", "quadrature", "integrator", "elements", "dt", "tolerance", "newton_tolerance", "build_s", "steps",
    "newton_iterations", "error_from",
}  # fmt: skip
#: Characters of a cell beyond which it may be broken into lines; rows of a table that is open.
LONG, SHORT = 36, 24


def label(column: str) -> str:
    """Head of a column."""
    return LABELS.get(column, column.replace("_", " "))


def page(
    results: Sequence[Result], names: Sequence[str], quick: bool, words: tuple[str | None, str | None]
) -> str:
    """HTML with everything inside."""
    file, case = words
    title = "Accuracy and cost of planar flexible multibody solvers" if file is None else ", ".join(names)
    command = ["anctmm", "report", *([file] if file else []), *(["--case", case] if case else [])]
    cards = [
        a if isinstance(a, Answer) else Answer(result.question, "", a)
        for result in results
        for a in result.answers
    ]
    environment = Environment(
        loader=PackageLoader("studies.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {"inline": inline, "html": html, "prose": prose}
    css = (Path(__file__).parent / "page.css").read_text(encoding="utf-8")
    return environment.get_template("page.html.jinja").render(
        title=title, results=results, answers=cards, quick=quick, short=SHORT, most_rows=MOST_ROWS,
        command=shlex.join([*command, *(["--quick"] if quick else [])]), stamp=provenance.stamp(), css=Markup(css),
    )  # fmt: skip


def html(table: Table) -> Markup:
    """A table for the page, by pandas' Styler: numbers on the right, statuses that are not ok marked."""
    hidden = HIDDEN | (IN_SETTING if "setting" in table.frame else set())
    shown = for_people(table.frame).drop(columns=list(hidden & set(table.frame.columns)))
    shown = shown.dropna(axis="columns", how="all").reset_index(drop=True)
    cells = shown.map(cell)
    classes = pd.DataFrame("", index=cells.index, columns=cells.columns)
    for name in cells.columns:
        long = cells[name].str.len() > LONG
        numeric = is_numeric_dtype(table.frame[name])
        classes[name] = "number" if numeric else long.map({True: "long", False: ""})
        if name == "status":
            classes.loc[~cells[name].str.startswith("ok"), name] = "bad"
    cells.columns = classes.columns = pd.Index([label(str(name)) for name in cells.columns])
    style = cells.style.hide(axis="index").format(escape="html").set_td_classes(classes)
    return Markup(style.to_html(cell_ids=False, table_uuid="t", sparse_columns=False))


def inline(shown: Picture, study: str) -> Markup:
    """The picture's SVG for the inside of a page: themed, with ids of its own and no fixed size."""
    own = f"{study}-{shown.name}"
    svg = shown.svg[shown.svg.index("<svg") :]
    svg = re.sub(r'<svg ([^>]*?)height="[^"]*"([^>]*?)width="[^"]*"', r"<svg \1\2", svg, count=1)
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{own}-\1"', svg)
    svg = re.sub(r'href="#([^"]+)"', rf'href="#{own}-\1"', svg)
    svg = re.sub(r"url\(#([^)]+)\)", rf"url(#{own}-\1)", svg)
    svg = re.sub(r' (?:d|x|y)="[^"]*"', lambda m: re.sub(r"(\.\d\d)\d+", r"\1", m[0]), svg)
    for colour, variable in ((INK, "ink"), (GRID, "grid"), (PAPER, "paper")):
        svg = svg.replace(colour, f"var(--{variable})")
    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{escape(shown.caption)}" ', 1))


def prose(words: str) -> Markup:
    """A text with what stands between backquotes as code."""
    return Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", str(escape(words))))
