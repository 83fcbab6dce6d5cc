"""One self-contained page of all studies."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from studies.engine.answers import answers_of
from studies.engine.pictures import Film
from studies.engine.storage import provenance
from studies.engine.storage.files import atomic_write
from studies.engine.study import Result
from studies.engine.tables import MOST_ROWS
from studies.report.plots import GRID, INK, PAPER, Picture
from studies.report.table_view import by_subject, is_short, view

#: The first question of a reader comes first; the other studies follow in their order.
FIRST = ("trade", "agreement")
#: What `anctmm bench` may have left beside the page.
BENCH = "bench/requirements.md"
#: Colours of bodies in an animation.
BODY_COLOURS = 7


@dataclass(frozen=True)
class Subject:
    """What a page is about: the built-in scenes, or cases of a user's.

    Parameters
    ----------
    names : sequence of str
        Of the cases; none for the built-in scenes.
    words : sequence of str
        What was typed to mean them: a file or a scene's name, and --case.
    """

    names: Sequence[str] = ()
    words: Sequence[str] = ()

    def command(self, study: str, quick: bool) -> str:
        """The command that makes a study's tables."""
        return shlex.join(["anctmm", "study", study, *self.words, *(["--quick"] if quick else [])])


#: The scenes that are built in.
BUILT_IN = Subject()


def write_page(results: Sequence[Result], out: Path, quick: bool, subject: Subject = BUILT_IN) -> Path:
    """`<out>/index.html` with everything inside: answers, scenes in motion, pictures, tables, how they were got."""
    ordered = sorted(results, key=lambda r: FIRST.index(r.name) if r.name in FIRST else len(FIRST))
    environment = Environment(
        loader=PackageLoader("studies.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {
        "inline": inline, "view": view, "prose": prose, "curves": curves, "by_subject": by_subject, "name": css_text,
    }  # fmt: skip
    environment.tests["short"] = is_short
    page = environment.get_template("page.html.jinja").render(
        results=ordered, answers=[a for r in ordered for a in answers_of(r.question, r.answers)],
        advice=next((t for r in ordered for t in r.tables if t.name == "advice"), None),
        films=[f for r in results for f in r.films],
        machine=provenance.machine(), versions=provenance.versions(), quick=quick, most_rows=MOST_ROWS,
        bench=(out / BENCH).is_file() and BENCH, subject=subject,
        whole=shlex.join(["anctmm", "report", *subject.words, *(["--quick"] if quick else [])]),
    )  # fmt: skip
    path = out / "index.html"
    atomic_write(path, page)
    return path


@dataclass(frozen=True)
class Curve:
    """A shape of an animation: its number among all, its classes of CSS, and its name."""

    number: int
    classes: str
    name: str


def curves(film: Film) -> list[Curve]:
    """Shapes of all layers of an animation; bodies of one layer alone have colours of their own."""
    own = len(film.shapes) // len(film.labels)
    found = []
    for number, (kind, name) in enumerate(film.shapes):
        behind = number >= own
        colour = "behind" if behind else f"c{number % BODY_COLOURS}" if len(film.labels) == 1 and name else ""
        found.append(Curve(number, " ".join(filter(None, ("body", kind, colour))), "" if behind else name))
    return found


def css_text(text: str) -> Markup:
    """A text as a string of CSS, safe inside a style element."""
    return Markup('"' + re.sub(r"[^\w .,()%/×-]", lambda m: f"\\{ord(m[0]):x} ", text) + '"')


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


def prose(text: str) -> Markup:
    """A text with what stands between backquotes as code."""
    return Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", str(escape(text))))


def _attribute(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
