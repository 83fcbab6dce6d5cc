"""Meshes and steps given by the user, as levels from coarse to fine."""

from itertools import pairwise

from anctmm.model.case import Case
from studies.engine.accuracy.dynamics import check_mesh
from studies.engine.accuracy.refinement import Refinement, Setup
from studies.engine.runner import Runner
from studies.engine.running.trial import Mesh, mesh_label
from studies.engine.study import Options, StudyError


def given_levels(case: Case, options: Options) -> tuple[tuple[Mesh, ...], tuple[float, ...]]:
    """Meshes from coarse to fine, and steps (s) from long to short, of a case; none where none are given.

    Parameters
    ----------
    case : Case
    options : Options

    Raises
    ------
    StudyError
        If they do not fit the case, one mesh is not finer than another, or nothing is left to be compared.
    StepError
        If a step does not divide the interval of output.
    """
    meshes = tuple(sorted((_of_each(case, mesh) for mesh in options.meshes or ()), key=sum))
    steps = tuple(sorted(options.steps or (), reverse=True))
    for coarse, fine in pairwise(meshes):
        if not all(n > before for n, before in zip(fine, coarse, strict=True)):
            raise StudyError(
                f"--elements has {mesh_label(coarse)} and {mesh_label(fine)}; the finer of two meshes needs more "
                f"elements of each beam of {case.name!r}: an order is observed over meshes that are finer everywhere"
            )
    if case.static and steps:
        raise StudyError(
            f"--dt is {steps[0]:g} s for {case.name!r}, a static equilibrium, which has no step; --case NAME "
            "chooses a motion, --elements its meshes"
        )
    if meshes and steps and options.error:
        raise StudyError(
            f"--error is {options.error:g} beside --elements and --dt; one of these is needed less, to be chosen for it"
        )
    if len(meshes) == 1 and (len(steps) == 1 or case.static):
        raise StudyError(
            f"--elements is {mesh_label(meshes[0])} alone{'' if case.static else ', and --dt one step'}: nothing "
            f"converges; at least two of one of them are needed (`anctmm run` does a single run)"
        )
    for level in range(len(steps)):
        Refinement(case, Setup(), Runner(None), meshes, steps).trial(0, level).run()
    return meshes, steps


def _of_each(case: Case, mesh: Mesh) -> Mesh:
    """Elements of each beam."""
    check_mesh(case.scene, mesh)
    return mesh * len(case.scene.beams) if len(mesh) == 1 else mesh
