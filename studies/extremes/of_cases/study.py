"""Limits of a case: explicit steps, disturbances, many elements, other units and places, stiffness."""

from collections.abc import Iterator, Sequence

import pandas as pd

from anctmm.model.case import Case
from studies.cases import assumptions_of
from studies.engine.answers import Answer
from studies.engine.runner import Runner
from studies.engine.storage.files import file_name
from studies.engine.study import Options, Result
from studies.engine.tables import Table
from studies.extremes.of_cases.base import Base
from studies.extremes.of_cases.growth import growth
from studies.extremes.of_cases.length import length
from studies.extremes.of_cases.places import places
from studies.extremes.of_cases.steps import steps
from studies.extremes.of_cases.stiffness import stiffness
from studies.extremes.parts import Part


def run(options: Options, runner: Runner) -> Result:
    """Run the study of cases; what does not apply is a row that says why."""
    cases = options.cases or ()
    parts = [part for case in cases for part in _parts(case, options.quick, runner)]
    learned = tuple(sentence for part in parts for sentence in part.learned)
    tables = _joined([table for part in parts for table in part.tables])
    return Result(
        name=file_name("-".join(["extremes", *(case.name for case in cases)])),
        title="Extremes",
        question="How long may a step be, how does a disturbance grow, and what do many elements, other units, far "
        "places and stiff beams do to the answer?",
        findings=learned,
        assumptions=tuple(dict.fromkeys(a for case in cases for a in assumptions_of(case))),
        tables=tables,
        pictures=tuple(shown for part in parts for shown in part.pictures),
        answers=tuple(answer for case in cases for answer in answers_of_case(case, learned, tables)),
        shown=tuple(table.name for table in tables),
    )


def answers_of_case(case: Case, learned: Sequence[str], tables: Sequence[Table]) -> Iterator[Answer]:
    """What the page begins with: the longest explicit step, how a disturbance grows; at rest what holds."""
    mine = [
        text.removeprefix(case.name).lstrip(",: ")
        for text in learned
        if text.startswith((f"{case.name}:", f"{case.name},"))
    ]
    mine = [f"{text[:1].upper()}{text[1:]}" for text in mine]
    limits = next((t.frame for t in tables if t.name == "stable_step"), None)
    if case.static or limits is None:
        yield Answer(
            f"{case.name}: what do other units, far places and many elements change?", "", " ".join(mine[:2])
        )
        return
    rows = limits[(limits["scene"] == case.name) & limits["status"].eq("ok")]
    said = [text for text in mine if "explicit step" in text]
    if len(rows) and said:
        step = f"{1e3 * rows['stable_dt'].min():.3g} ms"
        yield Answer(f"{case.name}: how long may an explicit step be?", step, said[0])
    grows = [text for text in mine if text.startswith("A disturbance")]
    if grows:
        yield Answer(f"{case.name}: until when can runs be compared?", "", grows[0])


def _parts(case: Case, quick: bool, runner: Runner) -> Iterator[Part]:
    base = Base.of(case, runner, quick)
    if not base.found.solution.status.ok:
        why = f"{case.name}: no refined run: {base.found.solution.status}."
        row = pd.DataFrame([base.row("refined run", status=str(base.found.solution.status))])
        yield Part((Table("refined", "The refined run", row),), (), (why,))
        return
    larger = 1.0
    if not case.static:
        part, larger = growth(base)
        yield part
        yield steps(base)
    yield places(base, larger)
    yield length(base)
    yield stiffness(base)


def _joined(tables: list[Table]) -> tuple[Table, ...]:
    """Tables of one name as one."""
    found: dict[str, Table] = {}
    for table in tables:
        before = found.get(table.name)
        frame = table.frame if before is None else pd.concat([before.frame, table.frame], ignore_index=True)
        found[table.name] = Table(table.name, table.title, frame, table.notes)
    return tuple(found.values())
