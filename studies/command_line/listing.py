"""Output of `anctmm list`: cases, solvers and studies."""

from collections.abc import Iterable

import pandas as pd

from anctmm.errors import PluginError
from anctmm.model.case import Case
from anctmm.solvers import registry
from studies.cases import place_name
from studies.engine.study import STUDIES


def scenes(cases: Iterable[Case]) -> pd.DataFrame:
    """A row a case."""
    rows = [
        {
            "name": case.name, "bodies": ", ".join(body.name for body in case.scene.bodies),
            "probes": ", ".join(map(place_name, case.probes)),
            "run": "static" if case.static else f"{case.duration:g} s",
            "note": case.note if len(case.note) <= 60 else f"{case.note[:59]}…",
        }
        for case in cases
    ]  # fmt: skip
    return pd.DataFrame(rows)


def solvers() -> pd.DataFrame:
    """A row a solver, with the features that it lacks."""
    rows = [{"name": name, "from": origin, "lacks": _lacks(name)} for name, origin in registry.origins()]
    return pd.DataFrame(rows)


def studies() -> pd.DataFrame:
    """A row a study."""
    return pd.DataFrame([{"name": name, "question": about[1]} for name, about in STUDIES.items()])


def _lacks(solver: str) -> str:
    """Features that a solver lacks, or why it cannot be loaded."""
    try:
        return ", ".join(sorted(registry.offer_of(registry.load(solver)).lacks))
    except PluginError as error:
        return f"broken: {' '.join(str(error).split())}"
