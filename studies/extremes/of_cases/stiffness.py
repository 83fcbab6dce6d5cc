"""A case whose beams are made stiffer and stiffer: it must tend to rigid bars."""

from dataclasses import replace
from math import nan
from typing import Any

import pandas as pd

from anctmm.model.bodies import Beam
from anctmm.model.scene import Scene
from studies.engine.tables import Table
from studies.extremes.of_cases.base import Base, apart, paths, size_of
from studies.extremes.parts import Part

#: Factors of Young's modulus, by whether the run is quick.
FACTORS = {False: (1e-2, 1.0, 1e2, 1e4, 1e6), True: (1.0, 1e2, 1e4)}


def stiffness(base: Base) -> Part:
    """Rows of one case."""
    case, trial, rows = base.case, base.trial, []
    if not case.scene.beams:
        rows = [base.row("stiffness", status="does not apply: there is no beam")]
    else:
        ones = (1,) * len(case.scene.beams)
        rigid = base.run(replace(trial, element="rigid", mesh=ones), "rigid bars")
        limit = "all beams rigid" if rigid.status.ok else f"none: rigid bars {rigid.status}"
        gap, size = nan, size_of(paths(base.found.solution, case))
        for factor in FACTORS[base.quick]:
            run = base.run(replace(trial, scene=stiffened(case.scene, factor)), f"{factor:g} times as stiff")
            about = base.row("stiffness", factor=factor, reference=limit)
            if not run.status.ok:
                rows.append(about | {"status": str(run.status)})
                continue
            if rigid.status.ok:
                last, gap = gap, float(apart(rigid, run, case, size=size)[1].max())
                about |= {"measured": gap, "ratio": last / gap if gap > 0.0 else nan}
            rows.append(about | {"uncertainty": base.found.error, "status": "ok"})
    table = Table("stiffness", "Stiffer and stiffer", pd.DataFrame(rows), (
        "factor: of Young's modulus of all beams, on the refined mesh and by the refined step. measured: largest "
        "distance to rigid bars at the probes, over the largest displacement of the case; it must fall until mesh and "
        "step, which are known to uncertainty, are all that is left. ratio: to the row before.",
    ))  # fmt: skip
    return Part((table,), (), (_learned(base, rows),))


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
        return (
            f"{name}, stiffness: {rows[0]['status'] if rows[0]['status'] != 'ok' else rows[0]['reference']}."
        )
    soft, stiff = told[0], told[-1]
    return (
        f"{name}, stiffness: with {soft['factor']:g} times its modulus the result differs by {soft['measured']:.1g} "
        f"from that of rigid bars, with {stiff['factor']:g} times by {stiff['measured']:.1g}."
    )
