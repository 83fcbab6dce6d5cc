"""How far a history may lie from the stored one: measured on the history itself, not guessed.

Two things move a history although nothing has changed. Rounding: another processor, another BLAS or another order of
the same sums rounds otherwise at every step, and the motion makes of it what it makes of any disturbance. And the
iteration: Newton stops somewhere below its tolerance, and another sequence of corrections stops elsewhere. Both
are measured when a baseline is made, by runs that answer the same question with every rounding different:

- the scene is turned in the plane by angles of no meaning; the displacements, turned back, would be equal in exact
  arithmetic, and the energies are;
- the iteration is stopped at a tolerance ten times as large; in statics, it also gets there by twice the load steps.

The largest difference of these runs, but no less than what a single rounding or a single iteration may leave, times
MARGIN, is the tolerance. It stands in the file with its reason, so that one that grows is seen in a diff.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import cos, hypot, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import AnctmmError, PluginError, SolverError
from anctmm.model.bodies import Body
from anctmm.model.scene import Beam
from anctmm.results.ended_early import nothing
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.solvers.foreign_code import told
from anctmm.solvers.registry import static_of
from studies.engine.measuring.timing import undisturbed
from studies.engine.other_numbers import Change
from studies.engine.running.trial import guarded
from studies.regression.history import ANGLE, LOAD_FACTOR, OF_CAUSES, UNITS, Baseline, History, Tolerance
from studies.regression.readable import READABLE
from studies.regression.scenes import CheckError, FromRest, Run, Static, Task

Array = NDArray[np.float64]

#: Angles by which a scene is turned, rad.
ANGLES = (0.7, 2.0, 4.1)
#: Three samples of a distance say little of a fourth, and a sum in another order may round worse still. Seen: kernels
#: compiled for a processor without vectors or fused products use at most 0.13 of the tolerance, uncompiled ones 0.03.
MARGIN = 16.0
#: Rounding of one stored number, relative: a few of the last digits.
EPSILON = 4.0 * float(np.finfo(float).eps)
#: How much larger the tolerance of an iteration is made.
LOOSER = 10.0
ROUNDING, ITERATION = "rounding (scene turned)", f"iteration ({LOOSER:g} x looser)"
LOAD_STEPS = "iteration (twice the load steps)"
#: Exudyn bounds residuals, relative and absolute (N): its own are 1e-7 and, where rounding allows it, 1e-9; in
#: statics 1e-10, which is taken as the least one iteration leaves.
EXUDYN = {"tolerances": (1e-6, 1e-7)}
EXUDYN_STATIC = 1e-10
#: Least margin of a count: where an iteration stops may depend on a rounding here and there.
LEAST_MARGIN = 2
OPTIONS = {"exudyn-cable": EXUDYN, "exudyn-reissner": EXUDYN}


def simulate(task: Task, **options: Any) -> Solution:
    """Run a task; whatever is raised becomes a status."""

    def answer_of() -> Solution:
        run = task.run
        solver = READABLE[task.solver] if task.solver in READABLE else registry.solver(task.solver)
        if isinstance(run, Static):
            static = static_of(task.solver, solver)
            if run.path != "load":
                options["path"] = run.path
            return static(task.scene, run.discretisation, load_steps=run.load_steps, **options)
        if isinstance(run, FromRest):
            options["start"] = static_of(task.solver, solver)(task.scene, run.equilibrium)
            run = run.motion
        return solver(task.scene, run, **options)

    def solve() -> Solution:
        try:
            answer = answer_of()
        except PluginError:
            raise
        except AnctmmError as error:
            refused = Status("refused", f"{type(error).__name__}: {error}")
            return nothing(task.solver, task.scene, None, refused)
        if not isinstance(answer, Solution):
            raise SolverError(f"solver {task.solver!r} answers {told(answer)}; a Solution is needed")
        return answer

    with undisturbed():
        return guarded(task.solver, task.scene, solve)


def measured(task: Task, history: History) -> Baseline:
    """A history with the tolerance of every quantity, and how far counts of the work may lie from it.

    What the end of a run names that depends on rounding, such as one of two elements alike, is left out.

    Raises
    ------
    CheckError
        If a run that measures it fails, or gives other quantities.
    """
    moved: dict[str, dict[str, float]] = {}
    ending = history.ending.split(", ")
    margins = {name: max(LEAST_MARGIN, count // 32) for name, count in history.counts.items() if count}
    for cause, angle, other, options in _disturbed(task):
        solution = simulate(other, **options)
        if solution.status.code != task.ends:
            raise CheckError(f"{task.name}: its sensitivity to {cause} cannot be measured: {solution.status}")
        found = _turned_back(History.of(solution, task), angle)
        if found.columns != history.columns or found.t.shape != history.t.shape:
            raise CheckError(f"{task.name}: quantities or times change with {cause}; they must not")
        ending = [part for part in ending if part in found.ending.split(", ")]
        for name in margins if cause == ROUNDING else ():
            apart = abs(found.counts[name] - history.counts[name])
            margins[name] = max(margins[name], 2 * apart)
        for quantity in history.quantities:
            distance = np.abs(found.of_quantity(quantity) - history.of_quantity(quantity)).max()
            by_cause = moved.setdefault(quantity, {})
            by_cause[cause] = max(by_cause.get(cause, 0.0), float(distance))
    cause, relative = _least(task)
    scales = _scales(task, history)
    for quantity, by_cause in moved.items():
        by_cause[cause] = relative * scales[quantity]
    tolerances = {quantity: _tolerance(by_cause) for quantity, by_cause in moved.items()}
    return Baseline(task.settings, tolerances, replace(history, ending=", ".join(ending)), margins)


def _disturbed(task: Task) -> Iterator[tuple[str, float, Task, dict[str, Any]]]:
    """Cause, angle by which the scene is turned, task and options of the runs that measure the sensitivity."""
    for angle in ANGLES:
        yield ROUNDING, angle, replace(task, scene=Change(turn=angle).scene(task.scene)), {}
    run = task.run
    if task.ends != "ok":
        return  # another tolerance may well end it elsewhere
    if task.times is None:
        return  # other iterations or steps give other points of the path
    if isinstance(run, Static):
        yield LOAD_STEPS, 0.0, replace(task, run=replace(run, load_steps=2 * run.load_steps)), {}
    if task.solver in OPTIONS:
        if not isinstance(run, Static) and _iterates(run):
            yield ITERATION, 0.0, task, OPTIONS[task.solver]
    elif _iterates(run):
        looser = replace(run, newton_tolerance=min(LOOSER * run.newton_tolerance, 1e-2))
        yield ITERATION, 0.0, replace(task, run=looser), {}


def _iterates(run: Run) -> bool:
    return isinstance(run, Static) or not run.explicit


def _turned_back(history: History, angle: float) -> History:
    """Displacements as they would be had the scene not been turned; they stand in pairs x, y."""
    values = history.values.copy()
    pairs = [k for k, c in enumerate(history.columns) if c.quantity == "displacement"][::2]
    for k in pairs:
        x, y = history.values[:, k], history.values[:, k + 1]
        values[:, k], values[:, k + 1] = cos(angle) * x + sin(angle) * y, cos(angle) * y - sin(angle) * x
    return replace(history, values=values)


def _least(task: Task) -> tuple[str, float]:
    """The smallest possible tolerance of a history, relative: one rounding, or the bound of one Newton iteration."""
    if not _iterates(task.run):
        return "one rounding", EPSILON
    bound = EXUDYN_STATIC if task.solver in OPTIONS else task.run.newton_tolerance
    return "one iteration's bound", max(bound, EPSILON)


def _ends(body: Body) -> tuple[Any, ...]:
    """Keys of the farthest places of a body."""
    return (0.0, 1.0) if isinstance(body, Beam) else body.keys


def _scales(task: Task, history: History) -> dict[str, float]:
    """Of a displacement the farthest place of the scene (a position is rounded), of all energies the largest.

    Of an angle what it turns by, and a radian. Where nothing moves and nothing is away from the origin, 1 m.
    """
    if not history.columns:
        return {}
    bodies = task.scene.bodies
    farthest = max(hypot(*body.position_at(key)) for body in bodies for key in _ends(body))
    largest = {q: float(np.abs(history.of_quantity(q)).max()) for q in history.quantities}
    energy = max((x for q, x in largest.items() if UNITS[q] == "J"), default=0.0)
    moved = {
        "displacement": farthest + largest["displacement"] or 1.0,
        ANGLE: 1.0 + largest.get(ANGLE, 0.0),
        LOAD_FACTOR: largest.get(LOAD_FACTOR, 0.0),
    }
    return {q: moved.get(q, energy) for q in history.quantities}


def _tolerance(causes: dict[str, float]) -> Tolerance:
    told = ", ".join(f"{cause} {distance:.1e}" for cause, distance in causes.items())
    return Tolerance(MARGIN * max(causes.values()), f"{MARGIN:g}{OF_CAUSES}{told}")
