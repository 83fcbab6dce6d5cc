"""Allowed differences of a history, measured on the history itself.

Two things change a history although nothing has changed. Rounding: another processor, another BLAS or another order of
the same sums rounds otherwise at every step. And the iteration: Newton stops somewhere below its tolerance, and another
sequence of corrections stops elsewhere. Both are measured when a history is stored, by runs that answer the same
question with every rounding different:

- the scene is turned in the plane by angles of no meaning; vectors, turned back, would be equal in exact arithmetic,
  and scalars are;
- the iteration is stopped at a tolerance ten times as large; in statics, it also gets there by twice the load steps.

The largest difference of these runs, but no less than what a single rounding or a single iteration may leave, times
MARGIN, is the tolerance. It stands in the file with its reason, so that one that grows is seen in a diff.
"""

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from math import cos, hypot, sin
from typing import Any

import numpy as np

from anctmm.model.scene import Beam, Point, PointMass, Prismatic, RigidBody, Scene, Slider, Spring, Torque
from studies.regression.history import UNITS, Baseline, History, Tolerance, physics_of
from studies.regression.reading import answered
from studies.regression.scenes import ARC_LENGTH, CheckError, Static, Task, iterations_of

#: Angles by which a scene is turned, rad.
ANGLES = (0.7, 2.0, 4.1)
#: Three samples of a distance say little of a fourth, and a sum in another order may round worse still. Seen: kernels
#: compiled for a processor without vectors or fused products use at most 0.13 of the tolerance, uncompiled ones 0.03.
MARGIN = 16.0
#: Rounding of one stored number, relative: a few of the last digits.
EPSILON = 4.0 * float(np.finfo(float).eps)
#: How much larger the tolerance of an iteration is made, and its largest value.
LOOSER, LOOSEST = 10.0, 1e-2
ROUNDING, ITERATION = "rounding (scene turned)", f"iteration ({LOOSER:g} x looser)"
LOAD_STEPS = "iteration (twice the load steps)"
#: Exudyn bounds residuals, relative and absolute (N): its own are 1e-7 and, where rounding allows it, 1e-9; in
#: statics 1e-10, which is taken as the least one iteration leaves.
EXUDYN, EXUDYN_STATIC = {"tolerances": (1e-6, 1e-7)}, 1e-10


def measured(task: Task, history: History) -> Baseline:
    """A history with the tolerance of every quantity.

    What the end of a run names that depends on rounding, such as one of two equal elements, is left out.

    Raises
    ------
    CheckError
        If a run that measures it fails, or gives other quantities.
    """
    moved: dict[str, dict[str, float]] = {quantity: {} for quantity in history.quantities}
    ending = history.ending.split(", ")
    for cause, angle, other in _disturbed(task):
        status, found = answered(other)
        if found is None:
            raise CheckError(f"{task.name}: its sensitivity to {cause} cannot be measured: {status}")
        found = _at(found, history.t)
        if found.columns != history.columns or found.t.shape != history.t.shape:
            raise CheckError(f"{task.name}: quantities or times change with {cause}; they must not")
        found = _turned_back(found, angle)
        ending = [part for part in ending if part in found.ending.split(", ")]
        for quantity, by_cause in moved.items():
            distance = float(np.abs(found.of_quantity(quantity) - history.of_quantity(quantity)).max())
            by_cause[cause] = max(by_cause.get(cause, 0.0), distance)
    cause, relative = _least(task)
    tolerances = {}
    for quantity, by_cause in moved.items():
        by_cause[cause] = relative * _scale(task, history, quantity)
        told = ", ".join(f"{name} {distance:.1e}" for name, distance in by_cause.items())
        value = MARGIN * max(by_cause.values())
        tolerances[quantity] = Tolerance(value, f"{MARGIN:g} times the largest of: {told}")
    return Baseline(task.settings, tolerances, replace(history, ending=", ".join(ending)), physics_of(task))


def _disturbed(task: Task) -> Iterator[tuple[str, float, Task]]:
    """Cause, angle by which the scene is turned, and task of the runs that measure the sensitivity."""
    for angle in ANGLES:
        yield ROUNDING, angle, replace(task, scene=turned(task.scene, angle))
    run = task.run
    if task.ends != "ok" or (isinstance(run, Static) and run.path == ARC_LENGTH):
        return  # another tolerance may well end it elsewhere
    if isinstance(run, Static):
        yield LOAD_STEPS, 0.0, replace(task, run=replace(run, load_steps=2 * run.load_steps))
    if not iterations_of(run):
        return
    if task.solver.startswith("exudyn"):
        if not isinstance(run, Static):
            yield ITERATION, 0.0, replace(task, options=EXUDYN)
    else:
        yield ITERATION, 0.0, replace(task, run=_looser(run))


def _looser(run: Any) -> Any:
    """A run, or a run of runs, whose Newton iterations stop earlier."""
    changes = {
        f.name: _looser(getattr(run, f.name))
        for f in fields(run)
        if f.init and is_dataclass(getattr(run, f.name)) and hasattr(getattr(run, f.name), "newton_tolerance")
    }
    if hasattr(run, "newton_tolerance"):
        changes["newton_tolerance"] = min(LOOSER * run.newton_tolerance, LOOSEST)
    return replace(run, **changes)


def _at(history: History, t: Any) -> History:
    """A history at the times of another one, which has fewer load steps."""
    mine = [k for k, time in enumerate(history.t) if np.isclose(time, t, rtol=1e-9, atol=1e-12).any()]
    return replace(history, t=history.t[mine], values=history.values[mine])


def _turned_back(history: History, angle: float) -> History:
    """Vectors as they would be had the scene not been turned; their components follow each other."""
    values = history.values.copy()
    for k, column in enumerate(history.columns):
        if column.where.endswith(" x"):
            x, y = history.values[:, k], history.values[:, k + 1]
            values[:, k], values[:, k + 1] = cos(angle) * x + sin(angle) * y, cos(angle) * y - sin(angle) * x
    return replace(history, values=values)


def _least(task: Task) -> tuple[str, float]:
    """The smallest possible tolerance of a history, relative: one rounding, or the bound of one Newton iteration."""
    bounds = [run.newton_tolerance for run in iterations_of(task.run)]
    if not bounds:
        return "one rounding", EPSILON
    bound = EXUDYN_STATIC if task.solver.startswith("exudyn") else max(bounds)
    return "one iteration's bound", max(bound, EPSILON)


def _scale(task: Task, history: History, quantity: str) -> float:
    """The size of a quantity: of displacements the farthest place of the scene, whose position is rounded.

    Of all energies, of all forces and of all moments the largest; of an angle what it turns by, and a radian.
    """
    unit = UNITS[quantity]
    alike = [q for q in history.quantities if UNITS[q] == unit]
    largest = max(float(np.abs(history.of_quantity(q)).max(initial=0.0)) for q in alike)
    if quantity == "displacement":
        bodies = task.scene.bodies
        farthest = max(hypot(*body.position_at(key)) for body in bodies for key in _ends(body))
        return farthest + largest or 1.0
    return 1.0 + largest if quantity == "angle" else largest or 1.0


def _ends(body: Any) -> tuple[Any, ...]:
    """Keys of the farthest places of a body."""
    return (0.0, 1.0) if isinstance(body, Beam) else body.keys


# --- a scene that is turned ------------------------------------------------------------------------------------


def turned(scene: Scene, angle: float) -> Scene:
    """The scene turned about the origin: the same physics with every number different."""

    def vector(v: Any) -> Point:
        x, y = v
        return cos(angle) * x - sin(angle) * y, sin(angle) * x + cos(angle) * y

    def of_time(value: Any) -> Any:
        return _after_call(value, vector) if callable(value) else vector(value)

    def body(b: Any) -> Any:
        match b:
            case Beam():
                velocity = b.velocity and _after_call(b.velocity, vector)
                return replace(b, start=vector(b.start), end=vector(b.end), velocity=velocity)
            case RigidBody():
                points = {name: vector(p) for name, p in b.points.items()}
                return replace(b, center=vector(b.center), points=points, velocity=vector(b.velocity))
            case PointMass():
                return replace(b, position=vector(b.position), velocity=vector(b.velocity))
            case _:
                raise CheckError(f"body {b!r} cannot be turned")

    def connector(c: Any) -> Any:
        grounded = isinstance(c, Spring) and c.ground is not None
        return replace(c, second=vector(c.ground)) if grounded else c

    return replace(
        scene,
        bodies=tuple(map(body, scene.bodies)),
        joints=tuple(
            replace(j, direction=vector(j.direction)) if isinstance(j, Slider | Prismatic) else j
            for j in scene.joints
        ),
        loads=tuple(
            load if isinstance(load, Torque) else replace(load, value=of_time(load.value))
            for load in scene.loads
        ),
        gravity=vector(scene.gravity),
        connectors=tuple(map(connector, scene.connectors)),
    )


def _after_call(function: Callable[[Any], Any], change: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A function whose results are changed; the times at which it breaks stay."""

    def changed(argument: Any) -> Any:
        return change(function(argument))

    if hasattr(function, "breaks"):
        changed.breaks = function.breaks  # type: ignore[attr-defined]
    return changed
