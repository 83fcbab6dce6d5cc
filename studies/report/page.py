"""One self-contained page of all studies."""

import json
import re
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from studies.engine import provenance
from studies.engine.files import atomic_write
from studies.engine.study import Result
from studies.engine.tables import MOST_ROWS, Table, cells
from studies.report.animation import Film
from studies.report.plots import GRID, INK, PAPER, Picture

#: What a reader asks first stands first; the other studies follow in their order.
FIRST = ("trade", "agreement")
#: Study and table that stand right below the answers.
ADVICE = ("trade", "advice")
#: What `anctmm bench` may have left beside the page.
BENCH = "bench/requirements.md"
#: Columns whose name needs a unit or a symbol.
LABELS = {
    "cpu_s": "CPU time (s)",
    "cpu_ms": "CPU time (ms)",
    "build_s": "set-up (s)",
    "wall_s": "wall time (s)",
    "us_per_step": "µs per step",
    "dofs": "DOFs",
    "dt": "Δt (s)",
    "t": "t (s)",
    "t_end": "t end (s)",
    "wished_error": "target error",
    "wish": "target error",
}
#: Tables with no more rows and columns are open.
SHORT, NARROW = 12, 10


def write_page(results: Sequence[Result], out: Path, quick: bool) -> Path:
    """`<out>/index.html` with everything inside: answers, scenes in motion, pictures, tables, how they were got."""
    ordered = sorted(results, key=lambda r: FIRST.index(r.name) if r.name in FIRST else len(FIRST))
    environment = Environment(
        loader=PackageLoader("studies.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {
        "inline": inline,
        "columns": columns,
        "cells": lambda t: cells(t.frame),
        "label": label,
        "prose": prose,
        "bodies": bodies,
    }
    environment.tests["short"] = lambda frame: frame.shape[0] <= SHORT and frame.shape[1] <= NARROW
    page = environment.get_template("page.html.jinja").render(
        results=ordered, answers=[a for r in ordered for a in r.answers],
        advice=next((t for r in ordered for t in r.tables if (r.name, t.name) == ADVICE), None),
        films=[f for r in results for f in r.films],
        machine=provenance.machine(), versions=provenance.versions(), quick=quick, most_rows=MOST_ROWS,
        bench=(out / BENCH).is_file() and BENCH,
    )  # fmt: skip
    path = out / "index.html"
    atomic_write(path, page)
    return path


def inline(shown: Picture, study: str) -> str:
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
    return svg.replace("<svg ", f'<svg role="img" aria-label="{_attribute(shown.caption)}" ', 1)


def columns(table: Table) -> list[tuple[str, bool]]:
    """Names of the columns, and whether each holds numbers."""
    return [(str(n), pd.api.types.is_numeric_dtype(t)) for n, t in table.frame.dtypes.items()]


def bodies(film: Film) -> int:
    """Number of all bodies of all layers of an animation."""
    return sum(map(len, json.loads(film.data)["layers"]))


def label(name: str) -> str:
    """A column's name for people."""
    return LABELS.get(name, name.replace("_", " "))


def prose(text: str) -> Markup:
    """A text with what stands between backquotes as code."""
    return Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", str(escape(text))))


def _attribute(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
