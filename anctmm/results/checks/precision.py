"""Digits lost by rounding: far from the origin, and where a body is too stiff for the forces that act.

Both are upper estimates of the error in double precision: in tests, runs with large estimates were wrong by at least a
twentieth of them, and runs with small estimates were never wrong.
"""

from collections.abc import Iterator
from math import sqrt

import numpy as np

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.model.connectors import Spring
from anctmm.model.loads import Torque
from anctmm.model.scene import Scene
from anctmm.results.checks.finding import Finding
from anctmm.results.checks.scales import is_driven, load_sizes, mass_of, reach_of, weight_of
from anctmm.results.metrics import places_of
from anctmm.results.solution import Solution

#: Part of the largest displacement that roundings of positions, one a step, may make before a run is imprecise.
DISPLACED = 0.015
#: The same of forces: rounding of the stiffest body's, beside those that act.
FORCED = 0.3
#: Distance from the origin, of the length of all bodies, from which on positions lose digits to it.
FAR = 1e3


def precision_findings(solution: Solution, rests: bool = False) -> Iterator[Finding]:
    """What rounding says against a run that is whole.

    If it rests, displacements are rounding: this is compared with the length of all bodies.
    """
    run, scene, last = solution.run, solution.scene, solution.t.size - 1
    if run is None or last < 1 or not (solution.cost.steps and _acted_upon(scene)):
        return
    reach, moved = reach_of(scene), scene.length if rests else _moved(solution)
    spacing = float(np.spacing(max(reach, scene.length)))
    if reach > FAR * scene.length and solution.cost.steps * spacing > DISPLACED * moved:
        message = (
            f"displacements, of {moved:.1e} m at most, have lost their digits by {{when}}: positions {reach:.2g} m "
            f"from the origin are rounded to {spacing:.1e} m at each step; place the scene closer to the origin"
        )
        yield Finding(last, "imprecise", message)
    stiffest, force = _stiffest(scene, run)
    inertia = mass_of(scene) * moved * sqrt(solution.cost.steps) / float(solution.t[-1]) ** 2
    if 0.5 * spacing * force > FORCED * max(_acting(scene, run, moved), inertia):
        message = (
            f"displacements have lost their digits by {{when}}: rounding of positions makes forces of "
            f"{0.5 * spacing * force:.1e} N in body {stiffest!r}, which is too stiff for the forces that act; a "
            f"smaller E or a rigid body gives more digits"
        )
        yield Finding(last, "imprecise", message, stiffest)


def _stiffest(scene: Scene, run: Discretisation) -> tuple[str, float]:
    """The body whose elements are the stiffest, and the force that stretches one of them by its length, N; or 0."""
    found = "", 0.0
    for name, (elements, kind) in run.of(scene).items():
        body = scene.beam(name)
        if not kind_of(kind).rigid:
            force = body.material.E * body.section.area * elements / body.length
            found = max(found, (name, force), key=lambda one: one[1])
    return found


def _acted_upon(scene: Scene) -> bool:
    """Whether anything moves the scene: one at rest has no digits to lose."""
    acting = is_driven(scene) or scene.loads or scene.connectors or any(scene.gravity)
    return bool(acting or any(body.moving for body in scene.bodies))


def _moved(solution: Solution) -> float:
    """Largest displacement of an end, a middle or a point of a body, m."""
    middles = [(body.name, 0.5) for body in solution.scene.beams]
    places = [*middles, *places_of(solution.scene)]
    return max(float(np.linalg.norm(solution.displacement(p), axis=1).max()) for p in places)


def _acting(scene: Scene, run: Discretisation, moved: float) -> float:
    """Largest sum of weight, loads and springs, N; a torque counts by the length of all bodies."""
    total = weight_of(scene)
    for load, size in load_sizes(scene, run):
        total += size / (scene.length if isinstance(load, Torque) else 1.0)
    springs = (c.stiffness * moved + abs(c.preload) for c in scene.connectors if isinstance(c, Spring))
    return total + sum(springs)
