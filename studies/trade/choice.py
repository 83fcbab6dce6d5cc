"""Reading the trade's points: which settings surely meet an error, of what kind they are, and their names."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from studies.engine.accuracy.dynamics import AS_GIVEN
from studies.engine.choices import NONE
from studies.engine.running.trial import NO_BEAMS
from studies.engine.tables import error_text

#: What makes settings of one kind: who solves, with which element, and how the run steps.
KIND = ["solver", "element", "stepping"]
#: What is said of a kind of steps whose length an error drives.
CONTROLLED = ", error-controlled"
#: Errors of two settings, one over the other, that count as equal: those of solvers that agree differ by less.
SAME = 1.05
STEPPING = {"generalized-alpha": "implicit", "zhai": "explicit", "esdirk": "implicit, fourth order"}


def stepping(points: pd.DataFrame) -> pd.Series:
    """How each row steps, in words."""
    kind = points["integrator"].replace(STEPPING)
    return kind.mask(points["tolerance"] > 0, kind + CONTROLLED)


def kinds_of(points: pd.DataFrame) -> pd.Series:
    """The kind of each row, in words."""
    return points["solver"] + ", " + points["element"] + ", " + stepping(points)


def reaching(points: pd.DataFrame, target: float) -> pd.DataFrame:
    """Rows that surely meet a target error: with their reference's uncertainty added; cheapest first."""
    met = sure_errors(points) <= target
    return points[met & (points["cpu_s"] > 0.0)].sort_values("cpu_s", kind="stable")


def nearest(points: pd.DataFrame) -> pd.DataFrame:
    """Rows whose error is the smallest within its uncertainty; cheapest first."""
    errors = sure_errors(points)
    return points[errors <= SAME * errors.min()].sort_values("cpu_s", kind="stable")


def sure_errors(points: pd.DataFrame) -> pd.Series:
    """What the error of a setting surely is no larger than, by no chance of its iteration."""
    return points["robust_error"] + points["reference_error"]


def setting_of(line: Mapping[Any, Any]) -> str:
    """A setting in words."""
    rule = "" if line["quadrature"] in ("full", "-") else f" (quadrature {line['quadrature']})"
    step = f"tolerance {line['tolerance']:g}" if line["tolerance"] > 0 else f"Δt = {1e3 * line['dt']:.3g} ms"
    kind = STEPPING.get(line["integrator"], line["integrator"])
    own = "" if (said := own_of(line)) == NONE else f", {said}"
    free = ", clamps free the stretch" if stretch_of(line) == "free" else ""
    beams = (
        "" if line["elements"] == NO_BEAMS else f", {line['elements']} {line['element']} elements{rule}{free}"
    )
    return f"{line['solver']}, {kind}{beams}, {step}{own}"


def parts_of(line: Mapping[Any, Any]) -> str:
    """What mesh and step add to the error, in words; without beams there is no mesh."""
    step = f"step {error_text(line, 'step_error', '.1g')}"
    return step if line["elements"] == NO_BEAMS else f"mesh {error_text(line, 'mesh_error', '.1g')}, {step}"


def known_error(line: Mapping[Any, Any], form: str = ".1g") -> str:
    """An error with what its reference is known to, or that it is below that."""
    told = error_text(line, form=form)
    return told if told.startswith("<") else f"{told} ± {line['reference_error']:.1g}"


def own_of(line: Mapping[Any, Any]) -> str:
    """Keyword arguments that only the solver of a row has, as Python writes them; "-" without any."""
    return str(line.get("own", NONE))


def stretch_of(line: Mapping[Any, Any]) -> str:
    """How clamps hold the stretch, see `studies.engine.accuracy.dynamics.with_stretch`; older tables do not say it."""
    return str(line.get("stretch", AS_GIVEN))
