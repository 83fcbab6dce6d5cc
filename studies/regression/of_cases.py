"""Regression check of a user's cases: one coarse run each, because the code is tested and not the accuracy."""

from collections.abc import Iterable
from dataclasses import replace
from math import ceil

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.case import Case
from anctmm.model.scene import Scene
from studies.engine.files import file_name
from studies.engine.meshes import by_beam, longest_step, parts_of
from studies.regression.scenes import TIGHT, Motion, Static, Watch

#: Elements of the longest beam, steps between outputs, and samples of a stored history at most.
ELEMENTS, EVERY, SAMPLES = 4, 4, 20
#: The solvers compared: a feature that one of them lacks is reported, and is no failure.
SOLVERS = ("anctmm", "global-dae")


def watches_of(
    cases: Iterable[Case], mesh: tuple[int, ...] | None = None, dt: float | None = None
) -> tuple[Watch, ...]:
    """A watch of each case, of cables and implicit steps; a scene's name is that of its directory.

    `mesh` has elements of each beam, or one number for all; StudyError if it does not fit. `dt` is a step, s.
    """
    scenes = ((case, replace(case.scene, name=file_name(case.name))) for case in cases)
    return tuple(Watch(s, tuple(c.probes), {"cable": _run(c, mesh, dt)}, SOLVERS) for c, s in scenes)


def _run(case: Case, given: tuple[int, ...] | None, dt: float | None) -> Motion:
    mesh = _mesh(case.scene, given)
    if case.static:
        return Static(mesh)
    outputs = round(case.duration / case.interval)
    few = next(k for k in range(1, outputs + 1) if outputs % k == 0 and outputs // k <= SAMPLES)
    step = longest_step(case) / EVERY if dt is None else dt
    return Discretisation(
        mesh, newton_tolerance=TIGHT, dt=step, t_end=case.duration, output_dt=few * case.interval
    )


def _mesh(scene: Scene, given: tuple[int, ...] | None) -> int | dict[str, int]:
    """Elements of each beam; if none are given a few, by its length, with a node at each joint inside it."""
    if given is None:
        longest = max((beam.length for beam in scene.beams), default=1.0)
        least = [2 * ceil(ELEMENTS / 2 * beam.length / longest * (1.0 - 1e-9)) for beam in scene.beams]
        parts = [parts_of(scene, beam) for beam in scene.beams]
        given = tuple(p * ceil(n / p) for n, p in zip(least, parts, strict=True)) or (2,)
    return by_beam(scene, given)
