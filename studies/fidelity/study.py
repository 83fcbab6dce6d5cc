"""Model only what a scene requires: kinds of element by body, how far each choice is from the richest, and its cost."""

from studies.engine.runner import Runner
from studies.engine.study import Options, Result, check_taken, refuse
from studies.fidelity import base_scenes, of_cases


def run(options: Options, runner: Runner) -> Result:
    """Run the study: of cases, or else of the two moving base scenes with rules of thumb beside.

    Raises
    ------
    StudyError
        If meshes, steps or solvers are asked for, which are its own, or a case has no beam.
    """
    check_taken(options, "fidelity")
    refuse(options, "fidelity", "meshes", "steps", "solvers")
    if options.cases is None:
        refuse(options, "fidelity", "error")
        return base_scenes.run(options, runner)
    return of_cases.run(options, runner)
