"""Allowed differences of a history, measured on the history itself.

A history changes with rounding, and with the place where Newton's iteration stops. Both are measured when it is stored:
the scene is turned in the plane (vectors, turned back, would be equal in exact arithmetic, and scalars are), and the
iteration stops at a tolerance ten times as large; in statics it also takes twice the load steps. The largest difference
of these runs, but no less than a single rounding or iteration may leave, times MARGIN, is the tolerance.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import cos, hypot, sin
from typing import Any

import numpy as np
import pandas as pd

from anctmm.errors import UnknownKindError
from anctmm.model.scene import Beam
from studies.engine.other_numbers import Change
from studies.regression.history import UNITS, History, Tolerance
from studies.regression.reading import answered
from studies.regression.scenes import CheckError, Read, Static, Task, motions_of

#: Angles by which a scene is turned, rad.
ANGLES = (0.7, 2.0, 4.1)
#: Three samples of a distance say little of a fourth, and a sum in another order may round worse still.
MARGIN = 16.0
#: Rounding of one stored number, relative: a few of the last digits.
EPSILON = 4.0 * float(np.finfo(float).eps)
#: How much larger the tolerance of an iteration is made, and its largest value.
LOOSER, LOOSEST = 10.0, 1e-2
ROUNDING, ITERATION = "rounding (scene turned)", f"iteration ({LOOSER:g} x looser)"
LOAD_STEPS = "iteration (twice the load steps)"
#: Exudyn bounds residuals and not positions; what that leaves of them, relative.
EXUDYN = 1e-8


def measured(task: Task, history: History) -> History:
    """A history with the tolerance of every quantity; CheckError if a run that measures it fails.

    What the end of a run names that depends on rounding, such as one of two equal elements, is left out.
    """
    bounds = _bounds(task)
    cause, relative = ("one iteration's bound" if bounds else "one rounding"), max([EPSILON, *bounds])
    moved = {q: {cause: relative * _scale(task, history, q)} for q in history.quantities}
    ending = history.ending.split(", ")
    for cause, angle, other in _disturbed(task):
        status, found = answered(other)
        if found is None:
            raise CheckError(f"{task.name}: its sensitivity to {cause} cannot be measured: {status}")
        common = np.isclose(found.t[:, None], history.t, rtol=1e-9, atol=1e-12).any(axis=1)
        frame = _turned_back(found.frame.iloc[np.flatnonzero(common)], angle)
        if list(frame) != list(history.frame) or len(frame) != len(history.frame):
            raise CheckError(f"{task.name}: quantities or times change with {cause}; they must not")
        ending = [part for part in ending if part in found.ending.split(", ")]
        for quantity, by_cause in moved.items():
            difference = History(frame).of_quantity(quantity) - history.of_quantity(quantity).to_numpy()
            by_cause[cause] = max(by_cause.get(cause, 0.0), float(difference.abs().to_numpy().max()))
    tolerances = {}
    for quantity, by_cause in moved.items():
        causes = ", ".join(f"{name} {distance:.1e}" for name, distance in by_cause.items())
        reason = f"{MARGIN:g} times the largest of: {causes}"
        tolerances[quantity] = Tolerance(MARGIN * max(by_cause.values()), reason)
    return replace(history, tolerances=tolerances, ending=", ".join(ending))


def _disturbed(task: Task) -> Iterator[tuple[str, float, Task]]:
    """Cause, angle by which the scene is turned, and task of the runs that measure the sensitivity."""
    for angle in ANGLES:
        try:
            yield ROUNDING, angle, replace(task, scene=Change(turn=angle).scene(task.scene))
        except (
            UnknownKindError
        ):  # parts of a user's own kinds cannot be turned: the other order rounds otherwise
            other = replace(task.scene, bodies=tuple(reversed(task.scene.bodies)))
            yield ROUNDING, 0.0, replace(task, scene=other)
    if task.ends != "ok":
        return  # another tolerance may well end it elsewhere
    if isinstance(task.run, Static):
        yield LOAD_STEPS, 0.0, replace(task, run=replace(task.run, load_steps=2 * task.run.load_steps))
    if _bounds(task) and not task.solver.startswith("exudyn"):
        yield ITERATION, 0.0, replace(task, run=_looser(task.run))


def _bounds(task: Task) -> list[float]:
    """Bounds of the Newton iterations within a run, relative."""
    runs = [r for r in motions_of(task.run) if isinstance(r, Static) or not r.explicit]
    return [EXUDYN if task.solver.startswith("exudyn") else run.newton_tolerance for run in runs]


def _looser(run: Any) -> Any:
    """A run, or a run of runs, whose Newton iterations stop earlier."""
    if isinstance(run, Read):
        return replace(run, runs=tuple(map(_looser, run.runs)))
    return replace(run, newton_tolerance=min(LOOSER * run.newton_tolerance, LOOSEST))


def _turned_back(frame: pd.DataFrame, angle: float) -> pd.DataFrame:
    """Vectors as they would be had the scene not been turned."""
    frame = frame.copy()
    for column in [c for c in map(str, frame) if " x (" in c]:
        other = column.replace(" x (", " y (")
        x, y = frame[column], frame[other]
        frame[column], frame[other] = cos(angle) * x + sin(angle) * y, cos(angle) * y - sin(angle) * x
    return frame


def _scale(task: Task, history: History, quantity: str) -> float:
    """The size of a quantity: of displacements the farthest place of the scene, whose position is rounded.

    Of all energies, of all forces and of all moments the largest; of an angle what it turns by, and a radian.
    """
    same_unit = [q for q in history.quantities if UNITS[q] == UNITS[quantity]]
    largest = float(np.abs(history.of_quantity(*same_unit).to_numpy()).max(initial=0.0))
    if quantity == "displacement":
        keys = ((b, k) for b in task.scene.bodies for k in ((0.0, 1.0) if isinstance(b, Beam) else b.keys))
        return max(hypot(*body.position_at(key)) for body, key in keys) + largest or 1.0  # type: ignore[arg-type]
    return 1.0 + largest if quantity == "angle" else largest or 1.0
