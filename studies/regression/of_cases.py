"""Regression check of a user's cases: one coarse run each, because the code is tested and not the accuracy."""

from collections.abc import Iterable
from dataclasses import replace
from math import ceil
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.case import Case
from anctmm.model.scene import Scene
from studies.engine.files import file_name
from studies.engine.meshes import by_beam, parts_of
from studies.regression.scenes import TIGHT, Motion, Static, Watch

#: Elements of the longest beam; steps of a run at least, and between outputs.
ELEMENTS, STEPS, EVERY = 4, 50, 4
#: Samples of a stored history at most.
SAMPLES = 20
#: The solvers compared: a feature that one of them lacks is reported, and is no failure.
SOLVERS = ("anctmm", "global-dae")


def watches_of(
    cases: Iterable[Case], mesh: tuple[int, ...] | None = None, dt: float | None = None
) -> tuple[Watch, ...]:
    """A watch of each case, of cables and implicit steps; a scene's name is that of its directory.

    `mesh` has elements of each beam, or one number for all; StudyError if it does not fit. `dt` is a step, s.
    """
    return tuple(
        Watch(
            replace(case.scene, name=file_name(case.name)),
            tuple(case.probes),
            {"cable": _run(case, mesh, dt)},
            SOLVERS,
        )
        for case in cases
    )


def _run(case: Case, mesh: tuple[int, ...] | None, dt: float | None) -> Motion:
    by_beam = _mesh(case.scene, mesh)
    if case.static:
        return Static(by_beam)
    outputs = round(case.duration / case.interval)
    few = next(k for k in range(1, outputs + 1) if outputs % k == 0 and outputs // k <= SAMPLES)
    least = STEPS / outputs * (1.0 - 1e-9)
    parts = next(n * 10**k for k in range(9) for n in (1, 2, 5) if n * 10**k >= least)  # easy to read
    step = case.interval / (EVERY * parts) if dt is None else dt
    times: dict[str, Any] = {"dt": step, "t_end": case.duration, "output_dt": few * case.interval}
    return Discretisation(by_beam, newton_tolerance=TIGHT, **times)


def _mesh(scene: Scene, given: tuple[int, ...] | None) -> int | dict[str, int]:
    """Elements of each beam; if none are given a few, by its length, with a node at each joint inside it."""
    if given is None:
        longest = max((beam.length for beam in scene.beams), default=1.0)
        least = [2 * ceil(ELEMENTS / 2 * beam.length / longest * (1.0 - 1e-9)) for beam in scene.beams]
        parts = [parts_of(scene, beam) for beam in scene.beams]
        given = tuple(p * ceil(n / p) for n, p in zip(least, parts, strict=True)) or (2,)
    return by_beam(scene, given)
