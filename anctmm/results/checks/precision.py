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

#: Part of the largest displacement that rounding of positions may make before a run is imprecise.
DISPLACED = 0.03
#: The same of forces: rounding of the stiffest body's, beside those that act.
FORCED = 0.3
#: Distance from the origin, of the length of all bodies, from which on positions lose digits to it.
FAR = 1e3
#: Roundings of positions in a step: explicit, and implicit, where Newton's iteration leaves more.
EXPLICIT, IMPLICIT = 0.5, 2.0


def precision_findings(solution: Solution, rests: bool = False) -> Iterator[Finding]:
    """What rounding says against a run that is whole.

    If it rests, displacements are rounding: this is compared with the length of all bodies.
    """
    run, scene = solution.run, solution.scene
    if run is None or solution.t.size < 2 or not (solution.cost.steps and _acted_upon(scene)):
        return
    yield from _findings(solution, run, scene.length if rests else _moved(solution))


def _findings(solution: Solution, run: Discretisation, moved: float) -> Iterator[Finding]:
    """The same for a largest displacement, m."""
    scene, last = solution.scene, solution.t.size - 1
    reach = reach_of(scene)
    rounding = (EXPLICIT if run.explicit else IMPLICIT) * solution.cost.steps * float(np.spacing(reach))
    if reach > FAR * scene.length and rounding > DISPLACED * moved:
        yield Finding(
            last,
            "imprecise",
            f"displacements, of {moved:.1e} m at most, have lost their digits by {{when}}: positions {reach:.2g} m "
            f"from the origin are rounded to {np.spacing(reach):.1e} m, at each of {solution.cost.steps} steps; place "
            f"the scene closer to the origin",
        )
    stiffest, force = _stiffest(scene, run)
    noise = 0.5 * float(np.spacing(max(reach, scene.length))) * force
    inertia = mass_of(scene) * moved * sqrt(solution.cost.steps) / float(solution.t[-1]) ** 2
    if noise > FORCED * max(_acting(scene, run, moved), inertia):
        yield Finding(
            last,
            "imprecise",
            f"displacements have lost their digits by {{when}}: rounding of positions makes forces of {noise:.1e} N in "
            f"body {stiffest!r}, which is too stiff for the forces that act; a smaller E or a rigid body gives more "
            f"digits",
            stiffest,
        )


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
    return max(
        float(np.hypot(*solution.displacement(p).T).max()) for p in [*middles, *places_of(solution.scene)]
    )


def _acting(scene: Scene, run: Discretisation, moved: float) -> float:
    """Largest sum of weight, loads and springs, N; a torque counts by the length of all bodies."""
    total = weight_of(scene)
    for load, size in load_sizes(scene, run):
        total += size / (scene.length if isinstance(load, Torque) else 1.0)
    springs = (c.stiffness * moved + abs(c.preload) for c in scene.connectors if isinstance(c, Spring))
    return total + sum(springs)
