"""Cases by name: built in, or defined by a user's Python file."""

import os
from collections.abc import Sequence
from pathlib import Path

from anctmm.errors import CaseError, listed
from anctmm.model.case import Case
from anctmm.model.places import Written
from studies import scenes
from studies.user_files import listed_in

#: What a user's file must define.
DECLARED = "CASES"


def built_in() -> list[Case]:
    """Cases that are built in."""
    return list(scenes.CASES)


def cases_in(path: str | os.PathLike[str]) -> tuple[Case, ...]:
    """Cases that a Python file defines as CASES.

    CaseError if it is not there, does not run, defines no list of cases, or two of its scenes have one name.
    """
    cases = listed_in(Path(path), DECLARED, Case, CaseError, "file")
    names = [case.name for case in cases]
    if twice := next((n for n in names if names.count(n) > 1), None):
        raise CaseError(
            f"file {path} has {names.count(twice)} cases of scenes named {twice!r}; one is allowed"
        )
    return cases


def find_cases(given: str, name: str | None = None) -> tuple[Case, ...]:
    """Cases that a user means by a file, or by a built-in scene's name or the beginning of it; `name` chooses one.

    CaseError if there is no such file, or no such name, or the beginning fits several names.
    """
    if is_file(given):
        cases = cases_in(given)
        return cases if name is None else (_named(cases, name, f"--case of file {given}"),)
    others = f", and files that end in .py; {given!r} is no file either"
    case = _named(built_in(), given, "scene", others)
    return (case,) if name is None else (_named([case], name, f"--case of the built-in scene {given!r}"),)


def find_case(given: str, name: str | None = None) -> Case:
    """The one case that a user means; errors as of `find_cases`, and where a file has several and no name is given."""
    cases = find_cases(given, name)
    if len(cases) > 1:
        several = f"file {given} has {len(cases)} cases"
        raise CaseError(f"{several}; --case is needed, one of {listed(c.name for c in cases)}")
    return cases[0]


def chosen(given: str | None, name: str | None) -> tuple[Case, ...] | None:
    """Cases that a user means, if he means any; errors as of `find_cases`."""
    if given is None and name is not None:
        raise CaseError(
            f"--case is {name!r} without a file; a file that defines {DECLARED} is needed, or the name of "
            f"a built-in scene in its place"
        )
    return None if given is None else find_cases(given, name)


def is_file(given: str) -> bool:
    """Whether a text means a file rather than the name of a scene."""
    return given.endswith(".py") or os.sep in given or Path(given).is_file()


def assumptions_of(case: Case) -> tuple[str, ...]:
    """The note of a case, shown beside its results."""
    return (f"{case.name}: {case.note}",) if case.note else ()


def place_name(place: Written) -> str:
    """A place of a scene in words: "arm.end", "arm at 0.25"."""
    return place if isinstance(place, str) else f"{place[0]} at {place[1]:.6g}"


def _named(cases: Sequence[Case], name: str, what: str, others: str = "") -> Case:
    """The case of a name, or of the beginning of one."""
    found = [c for c in cases if c.name == name] or [c for c in cases if name and c.name.startswith(name)]
    if len(found) == 1:
        return found[0]
    several = f" and fits {listed(c.name for c in found)}" if found else " and is unknown"
    raise CaseError(f"{what} is {name!r}{several}; allowed are {listed(c.name for c in cases)}{others}")
