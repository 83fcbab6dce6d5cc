"""Published problems with numbers: each is confirmed, contradicted, or cannot be compared, with the reason."""

from collections.abc import Iterator

import pandas as pd

from studies.engine.runner import Runner
from studies.engine.study import Options, Result, check_taken
from studies.engine.tables import Table
from studies.published import motions, statics
from studies.published.problem import Published

COLUMNS = (
    "problem", "quantity", "unit", "published", "source", "by", "found", "uncertainty", "digits", "verdict", "note",
)  # fmt: skip
ROOMS = (statics, motions)
#: Problems that cannot be put to the solvers here, and what they need.
MISSING = (
    Published(
        "flying spaghetti", "loaded end u_x at 7.5 s", "m", 10.1945, 0.02 * 10.1945, "one run of another code",
        needs="a beam whose GA and rotary inertia are given apart from EA and EI: here they follow from one section "
        "and one material",
    ),
)  # fmt: skip
LEFT_OUT = "Andrews' squeezer, and takes coarser meshes."


def run(options: Options, runner: Runner) -> Result:
    """Run the study."""
    check_taken(options, "published")
    found = tuple(problems(options.quick))
    frame = pd.DataFrame([line for problem in found for line in lines(problem)], columns=list(COLUMNS))
    notes = (
        "found: the limit of three meshes, each twice the one before, by Richardson's extrapolation with the observed "
        "order; uncertainty: what is left of it. Empty: the published number is of one mesh, on which it was found.",
        "verdict: by the first value of a problem. Confirmed as printed: rounded, the found value is the printed one, "
        "wherever it lies within its uncertainty. Otherwise confirmed to as many digits as agree and as its own "
        "uncertainty leaves; not beyond: the two are further apart than half of the last published digit (2 % where it "
        "was read off a curve) and the uncertainty together.",
    )
    said = findings(found)
    return Result(
        name="published",
        title="Published problems",
        question="What do the solvers here find for numbers that others have published?",
        findings=said,
        assumptions=(),
        tables=(Table("verdicts", "Published numbers, and what is found here", frame, notes),),
        answers=said[:1],
        left_out=LEFT_OUT if options.quick else "",
    )


def problems(quick: bool) -> Iterator[Published]:
    """Every published number."""
    for room in ROOMS:
        yield from room.problems(quick)
    yield from MISSING


def lines(problem: Published) -> Iterator[dict[str, object]]:
    """Table's lines of a problem: one for each that found a value."""
    shared = {
        "problem": problem.problem, "quantity": problem.quantity, "unit": problem.unit,
        "published": problem.value, "source": problem.source,
    }  # fmt: skip
    if not problem.found:
        yield {**shared, "verdict": problem.verdict, "note": problem.note}
    for number, (by, value) in enumerate(problem.found.items()):
        first = (
            {"digits": problem.digits, "verdict": problem.verdict, "note": problem.note}
            if number == 0
            else {}
        )
        uncertainty = value.uncertainty or float("nan")
        yield {**shared, "by": by, "found": value.value, "uncertainty": uncertainty, **first}


def findings(found: tuple[Published, ...]) -> tuple[str, ...]:
    """What the table says, in sentences."""
    judged = [p for p in found if p.found]
    whole = [p for p in judged if p.as_printed]
    part = [p for p in judged if "not beyond" in p.verdict]
    against = [p for p in judged if p.verdict.startswith("contradicted")]
    undecided = [p for p in judged if p.verdict.startswith("undecided")]
    rest = [p for p in judged if p not in (*whole, *part, *against, *undecided)]
    known = [p for p in rest if p.kind != "printed"]
    out = [
        f"Of {len(judged)} published numbers {len(whole)} are confirmed as far as they were printed, "
        f"{len(rest) - len(known)} to the fewer digits that the uncertainty of the values here leaves, {len(part)} to "
        f"fewer digits and not beyond, {len(known)} that are exact or were read off curves are confirmed, "
        + (f"{len(undecided)} are undecided, " if undecided else "")
        + f"{len(against)} contradicted; {len(found) - len(judged)} cannot be compared."
    ]
    out += [f"{p.problem}, {p.quantity}: {p.verdict} ({p.source})." for p in (*part, *against)]
    out += [f"{p.problem}, {p.quantity}: {p.verdict}." for p in found if not p.found]
    return tuple(out)
