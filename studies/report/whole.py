"""Studies of several cases: their files in CASE/STUDY, and the report of all of them."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pandas as pd

from anctmm.model.case import Case
from studies import scenes
from studies.engine.files import atomic_write, file_name
from studies.engine.runner import Runner
from studies.engine.study import STUDIES, TAKEN, Options, Result, StudyError, check_taken, find
from studies.engine.tables import Table, write_machine, write_table
from studies.report.page import page
from studies.report.plots import write_picture

#: Pictures of these studies are files of a report, too; those of all are in its page.
DRAWN = ("trade",)


def run_study(name: str, options: Options, runner: Runner) -> Iterator[Result]:
    """Answers of a study, one a case; the built-in scenes where none is given.

    Raises
    ------
    StudyError
        If there is no such study, an option is not for it, or it fits no case; of those that it does not fit standard
        error says why.
    """
    check_taken(options, name)
    if "cases" not in TAKEN[name]:
        yield find(name)(options, runner)
        return
    refused: list[StudyError] = []
    cases = options.cases or defaults(name)
    for case in cases:
        try:
            yield replace(find(name)(replace(options, cases=(case,)), runner), case=case.name)
        except StudyError as error:
            refused.append(error)
            print(f"anctmm: {case.name} is left out: {error}", file=sys.stderr)
    if len(refused) == len(cases):
        raise refused[-1]


def run_all(cases: tuple[Case, ...] | None, quick: bool, runner: Runner) -> Iterator[Result]:
    """Answers of all studies; of cases those of the studies that take cases."""
    fitting = 0
    for name in STUDIES if cases is None else [n for n in STUDIES if "cases" in TAKEN[n]]:
        with suppress(StudyError):  # said already
            for result in run_study(name, Options(quick=quick, cases=cases), runner):
                fitting += 1
                yield result
    if not fitting:
        raise StudyError("no study fits the cases, as said above")


def defaults(name: str) -> list[Case]:
    """Built-in scenes of a study: the two that move, and for convergence equilibria with exact solutions."""
    resting = [scenes.cantilever_tip_force(scenes.TIP_FORCES[-1]), scenes.cantilever_end_moment()]
    return [*scenes.moving_scenes(), *(resting if name == "convergence" else [])]


def write_study(result: Result, out: Path) -> Path:
    """Write tables and pictures to `<out>/<case>/<study>/` and return that directory."""
    folder = out / file_name(result.case) / result.name if result.case else out / result.name
    for table in result.tables:
        write_table(table, folder)
    for picture in result.pictures:
        write_picture(picture, folder)
    write_machine(folder)
    return folder


def write_report(
    results: Sequence[Result], folder: Path, quick: bool, words: tuple[str | None, str | None]
) -> None:
    """Write `<folder>/index.html`, and the tables of each study, of all cases together, beside it."""
    names = dict.fromkeys(r.name for r in results)
    joined = [join([r for r in results if r.name == name]) for name in names]
    for result in joined:
        for table in result.tables:
            write_table(table, folder / result.name, for_people=False)
        for picture in result.pictures if result.name in DRAWN else ():
            write_picture(picture, folder / result.name)
    write_machine(folder)
    cases = list(dict.fromkeys(r.case for r in results if r.case))
    atomic_write(folder / "index.html", page(joined, cases, quick, words))


def join(results: Sequence[Result]) -> Result:
    """Results of one study on several cases as one; tables for that study alone are left out."""
    every = {
        name: tuple(dict.fromkeys(x for r in results for x in getattr(r, name)))
        for name in ("findings", "assumptions", "pictures", "answers")
    }
    tables = [table for r in results for table in r.tables if table.place != "study"]
    names = dict.fromkeys(table.name for table in tables)
    joined = tuple(_joined([table for table in tables if table.name == name]) for name in names)
    return replace(results[0], tables=joined, **every)  # type: ignore[arg-type]


def _joined(same: Sequence[Table]) -> Table:
    frames = [table.frame for table in same if len(table.frame)] or [same[0].frame]
    notes = tuple(dict.fromkeys(note for table in same for note in table.notes))
    return replace(same[0], frame=pd.concat(frames, ignore_index=True), notes=notes)
