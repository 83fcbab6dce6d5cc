"""Output of `anctmm list`: cases, solvers and studies."""

from collections.abc import Iterable

from rich.markup import escape
from rich.table import Table

from anctmm.errors import PluginError
from anctmm.model.case import Case
from anctmm.solvers import registry
from studies.engine.places import place_texts
from studies.engine.study import STUDIES


def scenes(cases: Iterable[Case]) -> Table:
    """A row a case."""
    shown = _table("Scenes", "name", "bodies", "probes", "run", "note")
    for case in cases:
        bodies = ", ".join(b.name for b in case.scene.bodies)
        note = case.note if len(case.note) <= 60 else f"{case.note[:59]}…"
        cells = (case.name, bodies, ", ".join(place_texts(case.probes).values()), _run(case), note)
        shown.add_row(*map(escape, cells))
    return shown


def solvers() -> Table:
    """A row a solver, with the features that it lacks."""
    shown = _table("Solvers", "name", "from", "lacks")
    for name, origin in registry.origins():
        shown.add_row(escape(name), escape(origin), escape(_lacks(name)))
    return shown


def studies() -> Table:
    """A row a study."""
    shown = _table("Studies", "name", "question")
    for name, (_, question) in STUDIES.items():
        shown.add_row(name, question)
    return shown


def _run(case: Case) -> str:
    return "static" if case.static else f"{case.duration:g} s"


def _table(title: str, *columns: str) -> Table:
    shown = Table(title=title, title_justify="left", header_style="bold", box=None, padding=(0, 2, 0, 0))
    for column in columns:
        shown.add_column(column, no_wrap=column == "name")
    return shown


def _lacks(solver: str) -> str:
    """Features that a solver lacks, or why it cannot be loaded."""
    try:
        return ", ".join(sorted(registry.offer_of(registry.load(solver)).lacks))
    except PluginError as error:
        return f"broken: {' '.join(str(error).split())}"
