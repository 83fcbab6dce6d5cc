"""Limits of a case: explicit steps, disturbances, many elements, other units and places, stiffness, loads, time."""

from collections.abc import Iterator

from studies.cases import assumptions_of
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Result, check_taken
from studies.extremes import parts
from studies.extremes.base import Base, Part, part
from studies.extremes.growth import growth


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case; of an extreme that does not apply a row says why."""
    check_taken(options, "extremes")
    case = options.case
    base = Base.of(case, runner, options.quick)
    found = list(_parts(base))
    return Result(
        name="extremes", title="Limits",
        question="How long may a step be, how does a disturbance grow, and what do many elements, other units, far "
        "places, stiff beams, large loads and long times do to the answer?",
        findings=tuple(p.finding for p in found), assumptions=assumptions_of(case),
        tables=tuple(p.table for p in found), pictures=tuple(picture for p in found for picture in p.pictures),
        answers=tuple(_answers(case.name, found)), shown=tuple(p.table.name for p in found),
        good=base.found.solution.status.ok,
    )  # fmt: skip


def _parts(base: Base) -> Iterator[Part]:
    status = base.found.solution.status
    if not status.ok:
        text = f"{base.case.name}: no refined run: {status}."
        yield part(
            "refined", "The refined run", [base.row(str(status))], "Of cables and implicit steps.", text
        )
        return
    larger = 1.0
    if not base.case.static:
        grown, larger = growth(base)
        yield grown
        yield parts.steps(base)
        yield parts.time(base)
    yield parts.places(base, larger)
    yield parts.elements(base)
    yield parts.stiffness(base)
    if base.case.scene.loads or any(base.case.scene.gravity):
        yield parts.loads(base)


def _answers(name: str, found: list[Part]) -> Iterator[Answer]:
    """Cards: the longest explicit step, the growth of a disturbance; at rest the units."""
    asked = {
        "stable_step": f"{name}: how long may an explicit step be?",
        "growth": f"{name}: until when can runs be compared?",
    }
    cards = [(asked[p.table.name], p.finding) for p in found if p.table.name in asked]
    for question, finding in cards or [(f"{name}: limits?", found[0].finding)]:
        text = finding.partition(": ")[2] or finding
        yield Answer(question, "", f"{text[:1].upper()}{text[1:]}")
