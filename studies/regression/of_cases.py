"""Regression check of a user's cases: one coarse run each, because the code is tested and not the accuracy."""

from collections.abc import Iterable
from dataclasses import replace
from math import nan

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.case import Case
from studies.engine.accuracy.dynamics import check_mesh
from studies.engine.accuracy.refinement import coarsest_mesh, longest_step
from studies.engine.running.trial import Mesh, Trial
from studies.engine.storage.files import file_names
from studies.regression.scenes import TIGHT, CheckError, Run, Static, Watch

#: Elements over those of the coarsest mesh, and steps over those of the longest step.
FINER, SHORTER = 2, 4
#: Samples of a stored history at most.
SAMPLES = 20
#: The solvers compared: a feature that one of them lacks is reported, and is no failure.
SOLVERS = ("anctmm", "global-dae")


def watches_of(cases: Iterable[Case], mesh: Mesh | None = None, dt: float | None = None) -> tuple[Watch, ...]:
    """A watch of each case, of cables and implicit steps; a scene's name is that of its directory.

    Parameters
    ----------
    cases : iterable of Case
    mesh : tuple of int, optional
        Elements of each beam, or one number for all; twice the coarsest without it.
    dt : float, optional
        Step, s; a quarter of the longest without it.

    Raises
    ------
    CheckError
        If a step is given for a static case.
    StudyError, DiscretisationError
        If mesh or step do not fit.
    OutputError
        If stored histories of two cases would have one name.
    """
    cases = tuple(cases)
    return tuple(
        Watch(replace(case.scene, name=name), case.probes, {"cable": _run(case, mesh, dt)}, SOLVERS)
        for case, name in zip(cases, file_names(case.name for case in cases), strict=True)
    )


def _run(case: Case, mesh: Mesh | None, dt: float | None) -> Run:
    if not case.scene.beams:
        mesh = None
    if mesh is not None:
        check_mesh(case.scene, mesh)
    chosen = mesh or tuple(FINER * n for n in coarsest_mesh(case, "cable"))
    by_beam = Trial(case.scene, "anctmm", chosen, dt=nan).by_body
    if case.static:
        if dt is not None:
            raise CheckError(f"--dt is {dt:g} s for case {case.name!r}, a static equilibrium; it has no step")
        return Static(by_beam)
    return Discretisation(
        by_beam, dt=longest_step(case) / SHORTER if dt is None else dt, t_end=case.duration,
        output_dt=_few(case) * case.interval, newton_tolerance=TIGHT,
    )  # fmt: skip


def _few(case: Case) -> int:
    """Intervals of output between two stored samples: a divisor of their number."""
    count = round(case.duration / case.interval)
    return next(k for k in range(1, count + 1) if count % k == 0 and count // k <= SAMPLES)
