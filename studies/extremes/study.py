"""What holds at the extremes: of length, step, parameters, time and deformation, each beside its theory."""

from collections.abc import Callable

from studies.engine.runner import Runner
from studies.engine.study import Options, Result, check_taken
from studies.extremes.damping import damping
from studies.extremes.deformation import deformation
from studies.extremes.length import length
from studies.extremes.of_cases import study as of_cases
from studies.extremes.parameters import parameters
from studies.extremes.parts import Part
from studies.extremes.places import places
from studies.extremes.plane import plane
from studies.extremes.step import step
from studies.extremes.time import time

#: Each answers (quick, runner) with its tables, pictures and sentences.
PARTS: tuple[Callable[[bool, Runner], Part], ...] = (
    length,
    step,
    plane,
    damping,
    parameters,
    places,
    time,
    deformation,
)
LEFT_OUT = "most rows of each table: of each extreme it takes few values, and short motions."


def run(options: Options, runner: Runner) -> Result:
    """Run the study, of cases or else of its own scenes; meshes, steps and solvers are its own."""
    check_taken(options, "extremes")
    if options.cases is not None:
        return of_cases.run(options, runner)
    parts = [part(options.quick, runner) for part in PARTS]
    learned = tuple(sentence for part in parts for sentence in part.learned)
    return Result(
        name="extremes",
        title="Extremes",
        question="How long, stiff, slender, small, far away, bent and lasting may a scene be before digits are lost?",
        findings=learned,
        assumptions=(),
        tables=tuple(table for part in parts for table in part.tables),
        pictures=tuple(shown for part in parts for shown in part.pictures),
        answers=learned[:1],
        left_out=LEFT_OUT if options.quick else "",
    )
