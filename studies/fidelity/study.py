"""Model only what a scene requires: kinds of element by body, how far each choice is from the richest, and its cost."""

from studies.engine.runner import Runner
from studies.engine.running.trial import Trial
from studies.engine.study import Options, Result, StudyError, check_taken
from studies.fidelity import base_scenes, of_cases


def trials(options: Options) -> list[Trial]:
    """Runs of all kinds that the study of the base scenes needs; of other cases their references tell first."""
    return base_scenes.trials(options) if options.cases is None else []


def run(options: Options, runner: Runner) -> Result:
    """Run the study: of cases, or else of the two moving base scenes with rules of thumb beside.

    Raises
    ------
    StudyError
        If meshes, steps or solvers are asked for, which are its own, or no case has a beam.
    """
    check_taken(options, "fidelity")
    if options.cases is None:
        if options.error is not None:
            raise StudyError(
                f"--error is {options.error:g} without a scene; the base scenes have target errors of their own"
            )
        return base_scenes.run(options, runner)
    return of_cases.run(options, runner)
