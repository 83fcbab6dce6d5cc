"""The largest stable explicit step over the motion of a case, and how near to it a fixed step can go."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import ceil, inf, isfinite
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.integrators.stability import largest_step
from anctmm.integrators.static_start import coordinates_of
from studies.engine.accuracy.refinement import Refinement, Setup
from studies.engine.pictures import Picture
from studies.engine.running.trial import mesh_label
from studies.engine.storage.files import file_name
from studies.engine.tables import Table
from studies.extremes.of_cases.base import TARGETS, Base, apart
from studies.extremes.parts import Part
from studies.report.plots import PALETTE, legend_below, picture

#: Instants looked at, by whether the run is quick.
INSTANTS = {False: 21, True: 6}
#: Fixed steps tried, as parts of the least limit over the motion.
FRACTIONS = (0.5, 0.9, 0.99, 1.05, 1.3)
#: Elements times steps of an explicit run at most.
MOST_WORK = 4e6
#: Relative accuracy of the highest frequency found by Lanczos on differences of forces.
LANCZOS = 1e-5


def steps(base: Base) -> Part:
    """Rows of one case: cables, and of whole studies shear elements, too."""
    limits, margins = [], []
    for element in ("cable",) if base.quick else ("cable", "shear"):
        mine = list(_limits(base, element))
        limits += mine
        least = min((row["stable_dt"] for row in mine if row["status"] == "ok"), default=inf)
        if element == "cable" and isfinite(least):
            margins = list(_margins(base, least))
    tables = (
        Table("stable_step", "Largest stable explicit step over the motion", pd.DataFrame(limits), (
            "stable_dt (s): 2/ω_max (less with damping) of the scene linearised about where the refined run is at t. "
            "of_start: over that of the start; uncertainty: relative, of the eigenvalue.",
        )),
        Table("margin", "Fixed explicit steps near the limit", pd.DataFrame(margins), (
            "of_limit: the step over the least stable one of the motion, as near to a round part as steps that fill an "
            "interval of output can be. error: largest distance to the refined run, of the largest displacement; it "
            "is known to uncertainty. balance: largest energy error over the largest kinetic energy.",
        )),
    )  # fmt: skip
    return Part(
        tables, tuple(filter(None, (_picture(base, limits),))), tuple(_learned(base, limits, margins))
    )


def _limits(base: Base, element: str) -> Iterator[dict[str, Any]]:
    case = base.case
    found = base.found
    if element != "cable":
        found = Refinement(case, Setup(element=element), base.runner).refined(TARGETS[base.quick])
    about = base.row("stable step", element=element, elements=mesh_label(found.trial.mesh))
    solution = found.solution
    if not solution.status.ok:
        yield about | {"status": str(solution.status)}
        return
    run = Discretisation(
        mesh=found.trial.by_body, element=element, integrator="zhai", dt=case.interval, t_end=case.duration
    )
    chain = Chain(case.scene, run)
    at = np.unique(np.linspace(0, len(solution.t) - 1, INSTANTS[base.quick]).astype(int))
    start = inf
    for k in map(int, at):
        limit = largest_step(chain, coordinates_of(chain, solution, k))
        start = limit if k == 0 else start
        yield about | {
            "t": float(solution.t[k]), "stable_dt": limit, "of_start": limit / start if isfinite(start) else 1.0,
            "theory": "2/ω_max", "reference": found.label, "uncertainty": LANCZOS,
            "status": "ok" if isfinite(limit) else "does not apply: nothing vibrates",
        }  # fmt: skip


def _margins(base: Base, least: float) -> Iterator[dict[str, Any]]:
    case = base.case
    done = set()
    for fraction in FRACTIONS:
        dt = case.interval / max(ceil(case.interval / (fraction * least) - 0.5), 1)
        if dt in done:
            continue
        done.add(dt)
        count = round(case.duration / dt)
        about = base.row("fixed step", of_limit=dt / least, dt=dt, steps=count)
        work = count * max(sum(base.trial.mesh), 1)
        if work > MOST_WORK:
            yield about | {"status": f"not run: {work:.1e} elements times steps"}
            continue
        trial = replace(base.trial, integrator="zhai", dt=dt, options=(("check_stability", False),))
        run = base.run(trial, f"explicit, {fraction:g} of the limit")
        reference = {"reference": base.found.label, "uncertainty": base.found.error}
        if not run.status.ok:
            yield about | reference | {"status": str(run.status)}
            continue
        kinetic = float(np.max(run.energy.kinetic, initial=0.0)) or 1.0
        yield about | reference | {
            "error": float(apart(base.found.solution, run, case)[1].max()),
            "balance": float(np.abs(run.energy.balance).max()) / kinetic, "status": "ok",
        }  # fmt: skip


def _learned(base: Base, limits: list[dict[str, Any]], margins: list[dict[str, Any]]) -> Iterator[str]:
    name = base.case.name
    good = [row for row in limits if row["status"] == "ok" and row["element"] == "cable"]
    if not good:
        yield f"{name}, explicit steps: {limits[0]['status']}."
        return
    mesh = f" ({good[0]['elements']} cables)" if base.case.scene.beams else ""
    # in ms, as the answer above the sentence
    first, least, most = (1e3 * dt for dt in (good[0]["stable_dt"], *_ends(row["stable_dt"] for row in good)))
    limit = f"{name}: the largest stable explicit step is {first:.3g} ms"
    over = (
        "over all of the motion"
        if most < 1.01 * least
        else f"at the start, {least:.3g} to {most:.3g} ms over the motion"
    )
    text = f"{limit} {over}{mesh}"
    tried = [row for row in margins if not row["status"].startswith("not run")]
    held = [row["of_limit"] for row in tried if _holds(row)]
    failed = [row["of_limit"] for row in tried if not _holds(row)]
    if held:
        text += f"; a fixed step of {max(held):.2f} of the least holds"
    if failed:
        text += f", one of {min(failed):.2f} does not"
    yield f"{text}."


def _ends(values: Iterable[float]) -> tuple[float, float]:
    """The least and the largest."""
    found = sorted(values)
    return found[0], found[-1]


def _holds(row: dict[str, Any]) -> bool:
    """Whether a run is whole, and its energy error not as large as its energy."""
    return row["status"] == "ok" and row["balance"] < 1.0


def _picture(base: Base, limits: list[dict[str, Any]]) -> Picture | None:
    frame = pd.DataFrame([row for row in limits if row["status"] == "ok"])
    if frame.empty:
        return None

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, (element, rows) in enumerate(frame.groupby("element", sort=False)):
            axes.plot(
                rows["t"], rows["of_start"], "os"[k] + "-", color=PALETTE[k], markersize=4, label=str(element)
            )
        axes.set(xlabel="t (s)", ylabel="that step / that at the start", title="Largest stable explicit step")
        axes.set_ylim(0.0, 1.1 * float(frame["of_start"].max()))
        legend_below(figure, [axes], 2)

    caption = f"{base.case.name}: the largest stable explicit step over the motion, of that at the start."
    return picture(f"stable_step_{file_name(base.case.name)}", caption, draw, (6.8, 3.2))
