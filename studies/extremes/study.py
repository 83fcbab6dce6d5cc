"""Limits of a case: explicit steps, disturbances, many elements, far places, stiffness, loads, time."""

from collections.abc import Iterator

from studies.cases import assumptions_of
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Result
from studies.extremes import parts
from studies.extremes.base import Base, Part
from studies.extremes.growth import growth

#: Questions of the cards, by the table that answers them.
ASKED = {"stable_step": "how long may an explicit step be?", "growth": "until when can runs be compared?"}


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case; of an extreme that does not apply a row says why."""
    case = options.case
    base = Base.of(case, runner, options.quick)
    found = list(_parts(base))
    cards = [p for p in found if p.table.name in ASKED] or found[:1]
    return Result(
        name="extremes", title="Limits",
        question="How long may a step be, how does a disturbance grow, and what do many elements, far places, stiff "
        "beams, large loads and long times do to the answer?",
        findings=tuple(p.finding for p in found), assumptions=assumptions_of(case),
        tables=tuple(p.table for p in found), pictures=tuple(picture for p in found for picture in p.pictures),
        answers=tuple(Answer(f"{case.name}: {ASKED.get(p.table.name, 'limits?')}", "", p.finding) for p in cards),
        shown=tuple(p.table.name for p in found), good=base.found.solution.status.ok,
    )  # fmt: skip


def _parts(base: Base) -> Iterator[Part]:
    status = base.found.solution.status
    if not status.ok:
        yield base.part("refined", "No refined run", "Of cables and implicit steps.", [base.row(status)], "")
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
