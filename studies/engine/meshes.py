"""Meshes and steps of a case: as numbers, the coarsest ones that fit it, and the longest stable explicit step."""

from fractions import Fraction
from math import ceil, inf, lcm
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import KINDS
from anctmm.errors import AnctmmError
from anctmm.integrators.stability import largest_step
from anctmm.integrators.starting import started
from anctmm.model.case import Case
from anctmm.model.scene import Beam, Scene
from anctmm.solve import system_of

#: Elements of each beam in the scene's order, or one number for all.
Mesh = tuple[int, ...]
#: Elements of the longest beam on the coarsest mesh: of fourth order, and of others.
COARSEST, COARSEST_OF_LOW_ORDER = 2, 4
#: Parts of a beam at most that joints between its ends are looked for in.
MOST_PARTS = 64
#: Steps of the coarsest run at least.
FEWEST_STEPS = 50


class StudyError(AnctmmError, ValueError):
    """A study or one of its options is unknown, or does not fit a case."""


def mesh_label(mesh: Mesh) -> str:
    """2/8/2 of (2, 8, 2)."""
    return "/".join(map(str, mesh))


def by_beam(scene: Scene, mesh: Mesh) -> int | dict[str, int]:
    """A mesh as a discretisation takes it; StudyError if it fits neither all beams nor each."""
    names = [beam.name for beam in scene.beams]
    if len(mesh) == 1:
        return mesh[0]
    if len(mesh) != len(names):
        needed = f"{' or '.join(dict.fromkeys(('1', str(len(names)))))} numbers, for {'/'.join(names)}"
        raise StudyError(f"--elements has {mesh_label(mesh)!r}; scene {scene.name!r} needs {needed}")
    return dict(zip(names, mesh, strict=True))


def parts_of(scene: Scene, beam: Beam) -> int:
    """Smallest number of equal elements with nodes at all joints between the ends of a beam; 1 if there is none."""
    places = [scene.place(end) for joint in scene.joints for end in joint.ends]
    inside = [float(p.key) for p in places if p.interior and p.body.name == beam.name]
    found = [Fraction(f).limit_denominator(MOST_PARTS) for f in inside]
    parts = lcm(*(f.denominator for f in found))
    fits = parts <= MOST_PARTS and all(abs(f - float(g)) < 1e-9 for f, g in zip(inside, found, strict=True))
    return parts if fits else 1


def coarsest_mesh(case: Case, element: str) -> Mesh:
    """A few elements for each beam, by its length and its joints."""
    kind, beams = KINDS[element], case.scene.beams
    if kind.rigid or not beams:
        return (1,) * max(len(beams), 1)
    return by_length(case.scene, COARSEST if kind.order >= 4.0 else COARSEST_OF_LOW_ORDER)


def by_length(scene: Scene, most: int, each: int = 1) -> Mesh:
    """Elements of each beam by its length, multiples of `each`, `most` of the longest; more for nodes at joints."""
    longest = max((beam.length for beam in scene.beams), default=1.0)
    wanted = [each * ceil(most / each * beam.length / longest * (1.0 - 1e-9)) for beam in scene.beams]
    parts = [parts_of(scene, beam) for beam in scene.beams]
    return tuple(p * ceil(n / p) for n, p in zip(wanted, parts, strict=True))


def longest_step(case: Case, limit: float = inf) -> float:
    """The longest step to begin with, s: no longer than a limit; 1, 2, 5, 10, 20, … steps are an interval of output."""
    least = case.interval / min(limit, case.duration / FEWEST_STEPS) * (1.0 - 1e-9)
    steps = (n * 10**k for k in range(3) for n in (1, 2, 5) if n * 10**k >= least)
    return case.interval / next(steps, ceil(least))


def step_below(case: Case, limit: float) -> float:
    """The largest step below a limit that divides the interval of output, s."""
    return case.interval / ceil(case.interval / limit * (1.0 - 1e-9))


def stable_step(scene: Scene, mesh: Any, **options: Any) -> float:
    """Largest stable explicit step of ANC–TMM about the undeformed scene, s; infinite where nothing vibrates."""
    system = system_of(scene, Discretisation(mesh, integrator="zhai", dt=1.0, t_end=1.0, **options))
    return largest_step(system, started(system).q)
