"""A case far from the origin and in other units: only rounding may change the answer."""

from dataclasses import replace
from typing import Any

import numpy as np

from anctmm.errors import ResultError
from anctmm.results.solution import Solution
from studies.engine.other_numbers import Change
from studies.engine.tables import Table
from studies.extremes.of_cases.base import Base, apart, paths, size_of
from studies.extremes.parts import Part

#: Distances from the origin, in lengths of the scene.
FAR = (1e2, 1e4, 1e6)
OTHERS = {
    "mm, t, s": Change(1e3, 1e-3, 1.0),
    "µm, µg, ms": Change(1e6, 1e9, 1e3),
    "powers of two": Change(2.0**10, 2.0**-7, 2.0**5),
}


def places(base: Base, growth: float) -> Part:
    """Rows of one case.

    Parameters
    ----------
    base : Base
    growth : float
        Factor by which the motion makes a small disturbance larger.
    """
    plain = base.plain()
    rows = [_row(base, plain, name, units, growth) for name, units in OTHERS.items()]
    for far in FAR[-1:] if base.quick else FAR:
        away = far * base.case.scene.length
        rows.append(
            _row(base, plain, f"{far:.0e} lengths from the origin", Change(place=(away, 0.5 * away)), growth)
        )
    table = Table("units", "Other units, and far from the origin", _frame(rows), (
        "measured: largest difference at the probes to the same run in m, kg, s at its own place, over the largest "
        "displacement; uncertainty: of that number, by rounding.",
        "predicted: at most; each step rounds a coordinate by half a unit of its last place, what this does to "
        "velocities adds up, and the motion makes it larger as it does a disturbance. By powers of two only exponents "
        "change, and no bit of the history.",
        "reactions: largest difference of forces of joints to the same run at its own place, over the largest force, "
        "of joints whose forces equilibrium determines. Accelerations at outputs have an error of a thousandth beside "
        "what rounding does to them.",
        "Laws of springs are functions in SI units: scenes with them are moved, and not measured in other units.",
    ))  # fmt: skip
    good = [r for r in rows if r["status"] == "ok" and r["measured"] == r["measured"]]
    learned: tuple[str, ...] = ()
    if good:
        worst = max(good, key=lambda r: r["measured"])
        exact = [r for r in good if r["same_bits"]]
        forces = [r["reactions"] for r in good if r["reactions"] == r["reactions"]]
        carried = f", forces of joints by {max(forces):.0e}" if forces else ""
        bits = "; in units that are powers of two not one bit differs" if exact else ""
        learned = (
            f"{base.case.name}, units and place: results differ by {worst['measured']:.0e} at most "
            f"({worst['value']}){carried}{bits}.",
        )  # fmt: skip
    return Part((table,), (), learned)


def _row(base: Base, plain: Any, value: str, units: Change, growth: float) -> dict[str, Any]:
    case, trial = base.case, base.trial
    in_units = (units.metre, units.kilogram, units.second) != (1.0, 1.0, 1.0)
    about = base.row("units" if in_units else "place", value=value)
    if in_units and any(connector.law is not None for connector in case.scene.connectors):
        return about | {"status": "does not apply: a spring has a law in SI units"}
    scene = units.scene(case.scene)
    if not base.static():
        trial = replace(
            trial, dt=trial.dt * units.second, t_end=trial.t_end * units.second,
            output_dt=trial.output_dt * units.second,
        )  # fmt: skip
    moved = base.run(replace(trial, scene=scene), value)
    if not (plain.status.ok and moved.status.ok):
        bad = plain if not plain.status.ok else moved
        return about | {"status": str(bad.status)}
    size = size_of(paths(plain, case))
    far = float(np.hypot(*units.place)) + case.scene.length
    walk = base.rounding * max(growth, 1.0) / size
    _, away = apart(plain, moved, case, units.metre)
    return about | {
        "measured": float(away.max()),
        "reactions": float("nan") if in_units else _of_joints(plain, moved),
        "same_bits": bool(np.array_equal(paths(plain, case), paths(moved, case) / units.metre)),
        "predicted": 0.0 if units.exact else walk * far,
        "theory": "exponents only" if units.exact else "rounding",
        "reference": "the same in m, kg, s, at its own place", "uncertainty": walk * case.scene.length,
        "status": "ok",
    }  # fmt: skip


def _of_joints(plain: Solution, moved: Solution) -> float:
    """Largest difference of forces of joints of two runs, over the largest force; nan where none is known."""
    apart, largest = 0.0, 0.0
    for one, other in zip(plain.scene.joints, moved.scene.joints, strict=True):
        try:
            here, there = plain.reaction(one)[:, :2], moved.reaction(other)[:, :2]
        except ResultError:  # joints that share their forces in an unknown way
            continue
        n = min(len(here), len(there))
        apart = max(apart, float(np.abs(here[:n] - there[:n]).max(initial=0.0)))
        largest = max(largest, float(np.abs(here[:n]).max(initial=0.0)))
    return apart / largest if largest > 0.0 else float("nan")


def _frame(rows: list[dict[str, Any]]) -> Any:
    import pandas as pd

    columns = (
        "scene", "what", "value", "measured", "predicted", "reactions", "same_bits", "theory", "reference",
        "uncertainty", "status",
    )  # fmt: skip
    return pd.DataFrame(rows, columns=list(columns))
