"""One self-contained page of all studies."""

import re
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

from studies import provenance
from studies.files import atomic_write
from studies.plots import GRID, INK, PAPER, Picture
from studies.study import Result
from studies.tables import Table, cells


def write_page(results: Sequence[Result], out: Path, quick: bool) -> Path:
    """`<out>/index.html` with everything inside: pictures, tables, assumptions, machine and versions."""
    environment = Environment(
        loader=PackageLoader("studies", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {
        "inline": inline,
        "columns": columns,
        "cells": lambda t: cells(t.frame),
        "label": label,
    }
    page = environment.get_template("page.html.jinja").render(
        results=results, machine=provenance.machine(), versions=provenance.versions(), quick=quick
    )
    path = out / "index.html"
    atomic_write(path, page)
    return path


def inline(shown: Picture) -> str:
    """The picture's SVG for the inside of a page: themed, with ids of its own and no fixed size."""
    svg = shown.svg[shown.svg.index("<svg") :]
    svg = re.sub(r'<svg ([^>]*?)height="[^"]*"([^>]*?)width="[^"]*"', r"<svg \1\2", svg, count=1)
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{shown.name}-\1"', svg)
    svg = re.sub(r'href="#([^"]+)"', rf'href="#{shown.name}-\1"', svg)
    svg = re.sub(r"url\(#([^)]+)\)", rf"url(#{shown.name}-\1)", svg)
    for colour, variable in ((INK, "ink"), (GRID, "grid"), (PAPER, "paper")):
        svg = svg.replace(colour, f"var(--{variable})")
    return svg.replace("<svg ", f'<svg role="img" aria-label="{_attribute(shown.caption)}" ', 1)


def columns(table: Table) -> list[tuple[str, bool]]:
    """Names of the columns, and whether each holds numbers."""
    return [(str(n), pd.api.types.is_numeric_dtype(t)) for n, t in table.frame.dtypes.items()]


def label(name: str) -> str:
    """A column's name for people."""
    return name.replace("_", " ")


def _attribute(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
