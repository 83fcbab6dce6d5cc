"""The error of the time step alone: on one mesh, against the explicit integrator's finest step there."""

from dataclasses import replace

import numpy as np
import pandas as pd

from studies.engine.accuracy.dynamics import Fine, Plan, Scheme, Sweep, of_kinds, sweep
from studies.engine.runner import Runner
from studies.engine.running.trial import Mesh
from studies.engine.study import Options
from studies.engine.tables import Table
from studies.scenes import BaseScene


def step_sweep(
    base: BaseScene,
    mesh: Mesh,
    fine: dict[str, float],
    schemes: tuple[Scheme, ...],
    options: Options,
    runner: Runner,
) -> Sweep:
    """Runs of one mesh over steps.

    Parameters
    ----------
    base : BaseScene
        What moves.
    mesh : tuple of int
        Of all runs and of the reference.
    fine : dict of element to float
        Step of the reference, s; its uncertainty is the difference to twice that.
    schemes : tuple of Scheme
        Their meshes are not used.
    options : Options
        Meshes and steps asked for by the user are left to the other sweep.
    runner : Runner
        Runs them.

    Returns
    -------
    Sweep
        Empty if no scheme is of the element and the integrator asked for.
    """
    narrow = replace(options, meshes=None, steps=None)
    on_mesh = tuple(
        Scheme(s.element, s.quadrature, s.integrator, s.solvers, (mesh,), s.steps)
        for s in of_kinds(schemes, narrow)
    )
    if not on_mesh:
        return Sweep(base, (), {})
    references = {e: Fine(("anctmm", "global-dae"), mesh, None, dt, 2 * dt) for e, dt in fine.items()}
    return sweep(base, Plan(on_mesh, references), narrow, runner)


def step_rates(swept: Sweep) -> Table:
    """Observed orders in time, by least squares over the errors well above the reference's uncertainty."""
    lines = []
    keys = ["scene", "solver", "element", "integrator", "elements"]
    for values, group in swept.frame.groupby(keys, sort=False):
        sound = group[(group["error"] > 10 * group["reference_error"]) & (group["error"] < 0.02)].sort_values(
            "dt"
        )
        order = float("nan")
        if len(sound) > 1:
            order = float(np.polyfit(np.log(sound["dt"].to_numpy()), np.log(sound["error"].to_numpy()), 1)[0])
        by_step = group.sort_values("dt")
        lines.append({
            **dict(zip(keys, values, strict=True)),
            "largest_dt": by_step["dt"].iloc[-1], "smallest_dt": by_step["dt"].iloc[0],
            "error_at_largest": by_step["error"].iloc[-1], "error_at_smallest": by_step["error"].iloc[0],
            "order": order, "reference": group["reference"].iloc[0],
            "reference_error": group["reference_error"].iloc[0],
        })  # fmt: skip
    notes = (
        "The mesh is the same in all runs and in the reference, so that only the step's error is left. order: "
        "fitted to the errors between ten times the reference's uncertainty and 2 %.",
    )
    return Table("step_rates", "Observed orders in time", pd.DataFrame(lines), notes)
