"""Meshes, steps and references of a case that nobody has tuned: all follow from its refinement."""

from math import isfinite

from anctmm.model.case import Case
from studies.engine.refinement import Refined, Refinement, Setup
from studies.engine.runner import Mesh, Runner
from studies.engine.study import Options, StudyError
from studies.trade.plan import TARGETS, Ladder

#: Smallest target error where none is asked for; by whether the run is quick.
SMALLEST = {False: 1e-5, True: 1e-3}
#: Part of the smallest target error that a reference may be uncertain by.
SHARE = 0.3
#: Steps, and elements of the solver with a dense matrix, at most.
MOST_STEPS, MOST_DENSE = 6, 24


def own_ladder(case: Case, options: Options, runner: Runner) -> Ladder:
    """Refine a case with each element, and take the levels on the way as what is tried.

    Parameters
    ----------
    case : Case
    options : Options
        Its `error` is the smallest target error.
    runner : Runner

    Raises
    ------
    StudyError
        If the case is static: no step trades error for time there.
    """
    if case.static:
        raise StudyError(
            f"case {case.name!r} is a static equilibrium; a motion (t_end) is needed to trade error for time: "
            f"study convergence tells its errors over the mesh"
        )
    smallest = options.error or SMALLEST[options.quick]
    runner.heading = f"{case.name}, reference: "
    cable, shear = (
        Refinement(case, Setup(element=element), runner).refined(SHARE * smallest)
        for element in ("cable", "shear")
    )
    runner.heading = f"{case.name}: "
    cable_meshes = meshes(cable, halfway=not options.quick)
    steps = tuple(cable.levels.dt_at(cable.i, j) for j in range(cable.j + 1))[-MOST_STEPS:]
    return Ladder(
        case,
        cable_meshes,
        meshes(shear, halfway=False),
        tuple(m for m in cable_meshes if sum(m) <= MOST_DENSE)[-2:],
        ("global-dae", "exudyn-cable"),
        {"cable": cable.reference, "shear": shear.reference},
        fine_step=min(found.trial.dt for found in (cable, shear)),
        steps=steps,
        quick_steps=steps,
        targets=(*(target for target in TARGETS if target > 1.01 * smallest), smallest),
    )


def meshes(found: Refined, halfway: bool) -> tuple[Mesh, ...]:
    """Meshes of the levels up to that of a reference, and those halfway between them."""
    if not found.solution.status.ok or not isfinite(found.error):
        return (found.levels.mesh_at(0),)
    levels = [found.levels.mesh_at(i) for i in range(found.i + 1)]
    between = [tuple(3 * n // 2 for n in mesh) for mesh in levels[1:-1]] if halfway else []
    return tuple(sorted({*levels, *between}, key=sum))
