"""A case cut into many elements: how many digits rounding leaves, and whether the answer still converges."""

from collections.abc import Iterator
from dataclasses import replace
from math import nan
from typing import Any

import pandas as pd

from anctmm.results.solution import Solution
from studies.engine.running.trial import Trial
from studies.engine.tables import Table
from studies.extremes.of_cases.base import Base, apart, paths, size_of
from studies.extremes.parts import EPS, Part

#: Elements at most, by whether the run is quick; of the global DAE.
MOST, MOST_OF_PEER = {False: 20_000, True: 1_000}, 1_000
#: Steps of each run.
STEPS = 10
#: Newton's tolerance of these runs, of the scene's length.
NEWTON = 1e-10
PEER = "global-dae"


def length(base: Base) -> Part:
    """Rows of one case: its first steps on meshes four times finer each."""
    rows = list(_rows(base)) if base.case.scene.beams else [_nothing(base)]
    table = Table("many_elements", "Many elements", pd.DataFrame(rows), (
        f"The first {STEPS} steps of the refined run (an equilibrium whole) on meshes four times finer each. "
        "to_coarser: largest difference to the mesh before, over the largest displacement: what the mesh changes.",
        f"measured: to the global DAE on the same mesh, up to {MOST_OF_PEER} elements: what rounding leaves of both; "
        "peer: how its run ended. uncertainty: Newton's tolerance, and rounding of coordinates.",
    ))  # fmt: skip
    return Part((table,), (), (_learned(base, rows),))


def _rows(base: Base) -> Iterator[dict[str, Any]]:
    case, trial, before = base.case, _short(base), None
    while sum(trial.mesh) <= MOST[base.quick]:
        elements = sum(trial.mesh)
        run = base.run(trial, f"{elements} elements")
        about = base.row("many elements", elements=elements, dofs=run.dofs)
        if not run.status.ok:
            yield about | {"status": str(run.status)}
            return
        gap = nan if before is None else float(apart(before, run, case)[1].max())
        cost = 1e6 * run.cost.cpu_s / elements / max(run.cost.steps, 1)
        yield (
            about
            | {"to_coarser": gap, "us_per_element_step": cost}
            | _rounding(base, trial, run)
            | {"status": "ok"}
        )
        before, trial = run, replace(trial, mesh=tuple(4 * n for n in trial.mesh))


def _nothing(base: Base) -> dict[str, Any]:
    return base.row("many elements", status="does not apply: there is no beam")


def _short(base: Base) -> Trial:
    trial = replace(base.trial, options=(("newton_tolerance", NEWTON),))
    return trial if base.case.static else replace(trial, t_end=STEPS * trial.dt, output_dt=trial.dt)


def _rounding(base: Base, trial: Trial, run: Solution) -> dict[str, Any]:
    """Distance to the global DAE, where it can do as many."""
    if sum(trial.mesh) > MOST_OF_PEER:
        return {"peer": "not run"}
    peer = base.run(replace(trial, solver=PEER), f"{PEER}, {sum(trial.mesh)} elements")
    if not peer.status.ok:
        return {"peer": peer.status.code}
    case = base.case
    uncertainty = (EPS * STEPS**1.5 + NEWTON * STEPS) * case.scene.length / size_of(paths(run, case))
    return {"measured": float(apart(run, peer, case)[1].max()), "uncertainty": uncertainty, "peer": "ok"}


def _learned(base: Base, rows: list[dict[str, Any]]) -> str:
    good = [row for row in rows if row["status"] == "ok"]
    if not good:
        return f"{base.case.name}, many elements: {rows[-1]['status']}."
    told = [row["measured"] for row in good if "measured" in row]
    text = f"{base.case.name}: runs hold up to {max(row['dofs'] for row in good)} coordinates"
    text += f"; {PEER} differs by {max(told):.0e} at most where it runs" if told else ""
    bad = next((row["status"] for row in rows if row["status"] != "ok"), "")
    return f"{text}{f'; beyond: {bad}' if bad else ''}."
