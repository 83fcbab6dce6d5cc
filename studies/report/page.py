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
from studies.engine.tables import MOST_ROWS, Table, cell, label, readable
from studies.report.plots import GRID, INK, PAPER

#: Characters of a cell beyond which it may be broken into lines; rows of a table that is open.
LONG, SHORT = 36, 24


def page(
    results: Sequence[Result], names: Sequence[str], quick: bool, words: tuple[str | None, str | None]
) -> str:
    """HTML with everything inside; words: the file and the case that were asked for."""
    file, case = words
    title = "Accuracy and cost of planar flexible multibody solvers" if file is None else ", ".join(names)
    command = ["anctmm", "report", *([file] if file else []), *(["--case", case] if case else [])]
    environment = Environment(
        loader=PackageLoader("studies.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {"inline": inline, "html": html, "prose": prose}
    return environment.get_template("page.html.jinja").render(
        title=title, results=results, quick=quick, short=SHORT, most_rows=MOST_ROWS,
        answers=[
            a if isinstance(a, Answer) else Answer(result.question, "", a) for result in results for a in result.answers
        ],
        command=shlex.join([*command, *(["--quick"] if quick else [])]), stamp=provenance.stamp(),
        css=Markup((Path(__file__).parent / "page.css").read_text(encoding="utf-8")),
    )  # fmt: skip


def html(table: Table) -> Markup:
    """A table for the page, by pandas' Styler: numbers on the right, statuses that are not ok marked."""
    cells = readable(table.frame).reset_index(drop=True).map(cell)
    classes = pd.DataFrame("", index=cells.index, columns=cells.columns)
    for name in cells.columns:
        long = cells[name].str.len().gt(LONG).map({True: "long", False: ""})
        classes[name] = "number" if is_numeric_dtype(table.frame[name]) else long
    if "status" in cells:
        classes.loc[~cells["status"].str.startswith("ok"), "status"] = "bad"
    cells.columns = classes.columns = pd.Index(map(label, cells.columns))
    style = cells.style.hide(axis="index").format(escape="html").set_td_classes(classes)
    return Markup(style.to_html(cell_ids=False, table_uuid="t", sparse_columns=False))


def inline(shown: Picture, study: str) -> Markup:
    """The picture's SVG for the inside of a page: themed, with ids of its own and no fixed size."""
    own = f"{study}-{shown.name}"
    svg = shown.svg[shown.svg.index("<svg") :]
    replaced = (
        (r'<svg ([^>]*?)height="[^"]*"([^>]*?)width="[^"]*"', r"<svg \1\2"),
        (r"(?s)<metadata>.*?</metadata>", ""),
        (r'\bid="([^"]+)"', rf'id="{own}-\1"'),
        (r'href="#([^"]+)"', rf'href="#{own}-\1"'),
        (r"url\(#([^)]+)\)", rf"url(#{own}-\1)"),
    )
    for pattern, text in replaced:
        svg = re.sub(pattern, text, svg)
    svg = re.sub(r' (?:d|x|y)="[^"]*"', lambda m: re.sub(r"(\.\d\d)\d+", r"\1", m[0]), svg)
    for colour, variable in ((INK, "ink"), (GRID, "grid"), (PAPER, "paper")):
        svg = svg.replace(colour, f"var(--{variable})")
    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{escape(shown.caption)}" ', 1))


def prose(words: str) -> Markup:
    """A text with what stands between backquotes as code."""
    return Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", str(escape(words))))
