"""A case whose beams become stiffer and stiffer: it must converge to rigid bars."""

from dataclasses import replace
from math import nan
from typing import Any

import pandas as pd

from anctmm.model.bodies import Beam
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from studies.engine.tables import Table
from studies.extremes.of_cases.base import Base, apart, paths, size_of
from studies.extremes.parts import Part

#: Factors of Young's modulus, by whether the run is quick.
FACTORS = {False: (1e-2, 1.0, 1e2, 1e4, 1e6), True: (1.0, 1e2, 1e4)}


def stiffness(base: Base) -> Part:
    """Rows of one case."""
    case, trial = base.case, base.trial
    if not case.scene.beams:
        rows = [base.row("stiffness", status="does not apply: there is no beam")]
    else:
        ones = (1,) * len(case.scene.beams)
        rigid = base.run(replace(trial, element="rigid", mesh=ones), "rigid bars")
        if rigid.status.ok:
            rows = _towards(base, rigid)
        else:  # there is nothing that stiff beams tend to
            why = "the scene is a mechanism" if rigid.status.code == "singular" else str(rigid.status)
            rows = [base.row("stiffness", status=f"does not apply: with all beams rigid {why}")]
    table = Table("stiffness", "Stiffer and stiffer", pd.DataFrame(rows), (
        "factor: of Young's modulus of all beams, on the refined mesh and by the refined step. measured: largest "
        "distance to rigid bars at the probes, over the largest displacement of the case; it must fall until mesh and "
        "step, which are known to uncertainty, are all that is left. ratio: to the row before.",
    ))  # fmt: skip
    return Part((table,), (), (_learned(base, rows),))


def _towards(base: Base, rigid: Solution) -> list[dict[str, Any]]:
    """Stiffer and stiffer beams, and how far they are from rigid ones."""
    case, rows, gap = base.case, [], nan
    size = size_of(paths(base.found.solution, case))
    for factor in FACTORS[base.quick]:
        trial = replace(base.trial, scene=stiffened(case.scene, factor))
        run = base.run(trial, f"{factor:g} times as stiff")
        about = base.row("stiffness", factor=factor, reference="all beams rigid")
        if not run.status.ok:
            rows.append(about | {"status": str(run.status)})
            continue
        last, gap = gap, float(apart(rigid, run, case, size=size)[1].max())
        ratio = last / gap if gap > 0.0 else nan
        rows.append(
            about | {"measured": gap, "ratio": ratio, "uncertainty": base.found.error, "status": "ok"}
        )
    return rows


def stiffened(scene: Scene, factor: float) -> Scene:
    """The scene with beams so many times as stiff."""
    return replace(
        scene,
        bodies=tuple(
            replace(body, material=replace(body.material, E=factor * body.material.E))
            if isinstance(body, Beam)
            else body
            for body in scene.bodies
        ),
    )  # fmt: skip


def _learned(base: Base, rows: list[dict[str, Any]]) -> str:
    told = [row for row in rows if row.get("measured", nan) == row.get("measured", nan)]
    name = base.case.name
    if not told:
        return f"{name}, stiffness: {rows[0]['status']}."
    soft, stiff = (f"{row['measured']:.1g} {_modulus(row['factor'])}" for row in (told[0], told[-1]))
    return f"{name}, stiffness: the result differs from that of rigid bars by {soft}, and by {stiff}."


def _modulus(factor: float) -> str:
    return "as it is" if factor == 1.0 else f"with {factor:g} times its modulus"
