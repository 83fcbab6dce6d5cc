"""Output of `anctmm list`: cases, solvers and studies."""

from collections.abc import Iterable

from rich.markup import escape
from rich.table import Table

from anctmm.errors import PluginError
from anctmm.model.case import Case
from anctmm.solvers import registry
from studies.cases import place_name
from studies.engine.study import STUDIES
from studies.engine.tables import rich_table


def scenes(cases: Iterable[Case]) -> Table:
    """A row a case."""
    rows = [
        (
            case.name,
            ", ".join(body.name for body in case.scene.bodies),
            ", ".join(map(place_name, case.probes)),
            "static" if case.static else f"{case.duration:g} s",
            case.note if len(case.note) <= 60 else f"{case.note[:59]}…",
        )
        for case in cases
    ]
    return _table("Scenes", ("name", "bodies", "probes", "run", "note"), rows)


def solvers() -> Table:
    """A row a solver, with the features that it lacks."""
    rows = [(name, origin, _lacks(name)) for name, origin in registry.origins()]
    return _table("Solvers", ("name", "from", "lacks"), rows)


def studies() -> Table:
    """A row a study."""
    rows = [(name, question) for name, (_, question) in STUDIES.items()]
    return _table("Studies", ("name", "question"), rows)


def _table(title: str, columns: Iterable[str], rows: Iterable[tuple[str, ...]]) -> Table:
    shown = rich_table(title, dict.fromkeys(columns, False))
    shown.columns[0].no_wrap = True
    for row in rows:
        shown.add_row(*map(escape, row))
    return shown


def _lacks(solver: str) -> str:
    """Features that a solver lacks, or why it cannot be loaded."""
    try:
        return ", ".join(sorted(registry.offer_of(registry.load(solver)).lacks))
    except PluginError as error:
        return f"broken: {' '.join(str(error).split())}"
