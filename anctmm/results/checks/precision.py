"""Digits lost by rounding: far from the origin, and where a body is too stiff for the forces that act.

Both are upper estimates of the error in double precision: in tests, runs with large estimates were wrong by at least a
twentieth of them, and runs with small estimates were never wrong.
"""

from collections.abc import Iterator
from math import log10, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.model.joints import drive_of
from anctmm.model.kept import kept, kept_beside
from anctmm.model.scene import Beam, Force, LineLoad, Scene, Spring
from anctmm.results.checks.acting import ends_of, length_of, load_sizes, mass_of, reach_of, weight_of
from anctmm.results.checks.finding import Finding
from anctmm.results.checks.places import Places
from anctmm.results.solution import Solution

Array = NDArray[np.float64]

#: Part of the largest displacement that rounding of positions may make before a run is imprecise.
DISPLACED = 0.03
#: The same of forces: rounding of the stiffest body's, beside those that act.
FORCED = 0.3
#: Distance from the origin, of the length of all bodies, from which on positions lose digits to it.
FAR = 1e3
#: Roundings of positions in a step: explicit, and implicit, where Newton's iteration leaves more.
EXPLICIT, IMPLICIT = 0.5, 2.0
#: Outputs that are looked at, at most.
SEEN = 65


def precision_findings(solution: Solution, places: Places | None, rests: bool = False) -> Iterator[Finding]:
    """What rounding says against a run that is whole.

    Parameters
    ----------
    solution : Solution
    places : Places or None
        Its own.
    rests : bool
        Whether nothing moves, so that displacements are rounding: this is compared with the length of all bodies.
    """
    run, scene = solution.run, solution.scene
    if run is None or solution.t.size < 2 or not (solution.cost.steps and _acted_upon(scene)):
        return
    if rests and not any(True for _ in _findings(solution, length_of(scene))):
        return
    # what is moved more has more digits: as soon as nothing is found, nothing is found at all
    if places is not None:
        place = places.place
        if not any(True for _ in _findings(solution, float(np.abs(place - place[:, :1]).max()))):
            return
    most, found = 0.0, list[Finding]()
    for moved in _displacements(solution):
        if moved > most:
            most, found = moved, list(_findings(solution, moved))
            if not found:
                return
    yield from found or _findings(solution, 0.0)


def _findings(solution: Solution, moved: float) -> Iterator[Finding]:
    """The same for a largest displacement, m."""
    run, scene = solution.run, solution.scene
    assert run is not None
    length = length_of(scene)
    reach = reach_of(scene)
    if reach > FAR * length:
        rounding = (EXPLICIT if run.explicit else IMPLICIT) * solution.cost.steps * float(np.spacing(reach))
        part = _ratio(rounding, moved)
        if part > DISPLACED:
            alone = (
                f" (displacements are {moved:.1e} m at most, perhaps rounding alone)" if part > 1.0 else ""
            )
            yield Finding(
                solution.t.size - 1,
                "imprecise",
                f"{_digits(part)} of the displacements can be trusted at {{when}}: positions {reach:.2g} m from the "
                f"origin are rounded to {np.spacing(reach):.1e} m, at each of {solution.cost.steps} steps{alone}; "
                f"place the scene closer to the origin",
            )
    yield from _too_stiff(solution, max(reach, length), moved)


def _too_stiff(solution: Solution, reach: float, moved: float) -> Iterator[Finding]:
    """Rounding of positions strains every body, and the stiffest one most of all by force."""
    scene = solution.scene
    stiffest, force = _stiffest(scene, solution.run)
    if not force:
        return
    noise = 0.5 * float(np.spacing(reach)) * force
    inertia = mass_of(scene) * moved * sqrt(solution.cost.steps) / float(solution.t[-1]) ** 2
    if _ratio(noise, max(weight_of(scene), inertia)) <= FORCED:  # loads are looked at where they matter
        return
    part = _ratio(noise, max(_acting(solution, moved), inertia))
    if part > FORCED:
        yield Finding(
            solution.t.size - 1,
            "imprecise",
            f"{_digits(part)} of the displacements can be trusted at {{when}}: rounding of positions makes forces of "
            f"{noise:.1e} N in body {stiffest!r}, which is too stiff for the forces that act; a smaller E or a "
            f"rigid body gives more digits",
            stiffest,
        )


@kept_beside
def _stiffest(scene: Scene, run: Discretisation) -> tuple[str, float]:
    """The body whose elements are the stiffest, and the force that stretches one of them by its length, N; or 0."""
    forces = {
        name: scene.beam(name).material.E * scene.beam(name).section.area * elements / scene.beam(name).length
        for name, (elements, kind) in run.of(scene).items()
        if not kind_of(kind).rigid
    }
    return max(forces.items(), key=lambda item: item[1], default=("", 0.0))


@kept
def _acted_upon(scene: Scene) -> bool:
    """Whether anything moves the scene: one at rest has no digits to lose."""
    driven = any(drive_of(joint) is not None for joint in scene.joints)
    acting = driven or scene.loads or scene.connectors or any(scene.gravity)
    return bool(acting or any(body.moving for body in scene.bodies))


def _displacements(solution: Solution) -> Iterator[float]:
    """Largest ones of starts, middles and ends of bodies, m, one after the other."""
    rows: Any = slice(None)
    if solution.t.size > SEEN:
        rows = np.linspace(0, solution.t.size - 1, SEEN).astype(np.int64)
    for body in solution.scene.bodies:
        for key in (*ends_of(body), *((0.5,) if isinstance(body, Beam) else ())):
            path = solution.position(body.name, key)[rows]
            yield float(np.hypot(*(path - path[0]).T).max())


def _acting(solution: Solution, moved: float) -> float:
    """Largest sum of weight, loads and springs, N; a torque counts by the length of all bodies."""
    scene, run = solution.scene, solution.run
    assert run is not None
    length = length_of(scene)
    total = weight_of(scene)
    for load, size in load_sizes(scene, run):
        total += size / (1.0 if isinstance(load, Force | LineLoad) else length)
    springs = (c.stiffness * moved + abs(c.preload) for c in scene.connectors if isinstance(c, Spring))
    return total + sum(springs)


def _ratio(error: float, size: float) -> float:
    return error / size if size > 0.0 else np.inf


def _digits(part: float) -> str:
    """Digits that an error of this part leaves, in words."""
    count = int(-log10(part)) if 0.0 < part < 1.0 else 0
    return "no digit" if count == 0 else f"about {count} digit{'s' if count > 1 else ''}"
