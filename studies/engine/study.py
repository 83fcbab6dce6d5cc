"""The interface of studies, and the list of all studies."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING

from anctmm.errors import AnctmmError
from anctmm.model.case import Case
from studies.engine.answers import Answer
from studies.engine.pictures import Film, Picture
from studies.engine.storage.files import file_names
from studies.engine.tables import Table

if TYPE_CHECKING:
    from studies.engine.runner import Runner
    from studies.engine.running.trial import Mesh, Trial

#: A new study is one module with a function `run(options, runner) -> Result`, and its line here.
STUDIES = {
    "four-bar": (
        "studies.four_bar.study",
        "the paper's crank mechanism: accuracy and cost over meshes and steps",
    ),
    "cantilever": (
        "studies.cantilever.study",
        "large deflections against exact solutions; a fall under gravity",
    ),
    "agreement": (
        "studies.agreement.study",
        "every pair of solvers on both scenes: do they compute the same motion",
    ),
    "trade": ("studies.trade.study", "which solver, element, mesh and step an error costs least with"),
    "extremes": (
        "studies.extremes.study",
        "what holds at the extremes of length, step, parameters, time and deformation",
    ),
    "convergence": (
        "studies.convergence.study",
        "observed orders in mesh and step, and the uncertainty of every value",
    ),
    "fidelity": ("studies.fidelity.study", "which body may be a cable or rigid, and what that saves"),
    "published": (
        "studies.published.study",
        "numbers that others have published: confirmed, contradicted or why not",
    ),
}

#: Studies of the report on the built-in scenes; that of convergence is in two of them already.
REPORTED = tuple(name for name in STUDIES if name != "convergence")
#: Options as they are typed; and what studies take of them.
TYPED = {
    "meshes": "--elements", "steps": "--dt", "solvers": "--solvers", "cases": "scene", "element": "--element",
    "integrator": "--integrator", "error": "--error",
}  # fmt: skip
RANGES = ("meshes", "steps", "solvers")
TAKEN = {
    "convergence": ("cases", "element", "integrator", "error", *RANGES),
    "trade": ("cases", "error", "element", "integrator", *RANGES),
    "four-bar": ("element", "integrator", *RANGES),
    "cantilever": ("element", "integrator", *RANGES),
    "agreement": ("element", "integrator", *RANGES),
    "fidelity": ("cases", "error"),
    "extremes": ("cases",),
    "published": (),
}
#: Why a study has no use for some options, and the command to use instead.
REASONS = {
    "fidelity": "it compares kinds of elements, each on the mesh and by the step that its error needs; `anctmm study "
    "trade` takes solvers, elements, meshes and steps",
    "extremes": "it goes to the limits of a refined run, of cables and by both integrators; `anctmm study convergence` "
    "and `anctmm run` take solvers, elements, meshes and steps",
    "published": "each of its problems has the mesh, step and elements of its source; `anctmm run` and `anctmm study "
    "convergence` take a scene, and these options",
    "four-bar": "its scene is the paper's, with a reference of its own; `anctmm study convergence` takes both",
    "cantilever": "its scenes have exact solutions and references of their own; `anctmm study convergence` takes both",
    "agreement": "it compares all solvers on the built-in scenes; `anctmm run my.py --solvers a,b` does on yours",
}


class StudyError(AnctmmError, ValueError):
    """A study or one of its options is unknown."""


@dataclass(frozen=True)
class Options:
    """What the user may narrow; None means the study's own choice.

    Parameters
    ----------
    quick : bool
        The smallest sweep that still shows the study's point.
    meshes : tuple of tuple of int, optional
    steps : tuple of float, optional
        s.
    solvers : tuple of str, optional
        Registered names.
    cases : tuple of Case, optional
        What is studied.
    element, integrator : str, optional
    error : float, optional
        Target, relative.
    """

    quick: bool = False
    meshes: "tuple[Mesh, ...] | None" = None
    steps: tuple[float, ...] | None = None
    solvers: tuple[str, ...] | None = None
    cases: tuple[Case, ...] | None = None
    element: str | None = None
    integrator: str | None = None
    error: float | None = None


@dataclass(frozen=True)
class Result:
    """A study's answer.

    Parameters
    ----------
    name, title, question : str
    findings : tuple of str
        Sentences with numbers taken from the tables.
    assumptions : tuple of str
    tables : tuple of Table
    pictures : tuple of Picture
    films : tuple of Film
        Motions to be played on the page.
    answers : tuple of Answer or str
        What the page begins with: one line an answer; a sentence alone answers the study's question.
    shown : tuple of str
        Names of the tables that a terminal shows.
    left_out : str
        What a quick run leaves out of the study, as the end of a sentence; empty where nothing is.
    """

    name: str
    title: str
    question: str
    findings: tuple[str, ...]
    assumptions: tuple[str, ...]
    tables: tuple[Table, ...]
    pictures: tuple[Picture, ...] = ()
    films: tuple[Film, ...] = ()
    answers: tuple[Answer | str, ...] = ()
    shown: tuple[str, ...] = ()
    left_out: str = ""

    def table(self, name: str) -> Table:
        """The table of a name."""
        return next(t for t in self.tables if t.name == name)


def check_taken(options: Options, study: str) -> None:
    """Refuse what a study does not take: what it does not use must not seem to be used.

    Raises
    ------
    StudyError
        Naming the option, the reason, and what takes it.
    OutputError
        If files of two cases would have one name.
    """
    file_names(case.name for case in options.cases or ())
    taken = TAKEN.get(study, RANGES)
    for name, typed in TYPED.items():
        if name not in taken and getattr(options, name) is not None:
            why = f": {REASONS[study]}" if study in REASONS else f"; {_takers(name)}"
            raise StudyError(f"study {study!r} takes no {typed}{why}")


def without_beams(cases: Iterable[Case], options: Options) -> list[str]:
    """Of each case without beams a sentence that options about elements do nothing for it; none where none is given.

    Raises
    ------
    StudyError
        If no case has beams: then they do nothing at all.
    """
    given = [TYPED[name] for name in ("meshes", "element") if getattr(options, name) is not None]
    what = f"{' and '.join(given)} {'choose' if len(given) > 1 else 'chooses'} the elements of beams"
    cases, them = tuple(cases) if given else (), "them" if len(given) > 1 else "it"
    none = [case.name for case in cases if not case.scene.beams]
    return _in_vain(what, cases, none, ("has none", "have none"), them)


def without_motion(cases: Iterable[Case], options: Options) -> list[str]:
    """Of each static case a sentence that an integrator does nothing for it; none where none is given.

    Raises
    ------
    StudyError
        If no case moves: then it does nothing at all.
    """
    cases = tuple(cases) if options.integrator is not None else ()
    what = f"{TYPED['integrator']} chooses the steps of motions"
    resting = [case.name for case in cases if case.static]
    return _in_vain(what, cases, resting, ("is a static equilibrium", "are static equilibria"), "it")


def _in_vain(
    what: str, cases: Sequence[Case], names: list[str], why: tuple[str, str], them: str
) -> list[str]:
    """Sentences on the cases for which options do nothing, refused if these are all; why: of one, of several."""
    if names and len(names) == len(cases):
        raise StudyError(f"{what}; {', '.join(names)} {why[len(names) > 1]}: leave {them} out")
    return [f"{name}: {what}, and it {why[0]}." for name in names]


def of_case(options: Options, case: Case) -> Options:
    """The options as one of several cases takes them: without beams there are no elements to choose."""
    return options if case.scene.beams else replace(options, meshes=None, element=None)


def asked(cases: tuple[Case, ...] | None, quick: bool) -> list[tuple[str, Options]]:
    """Studies of a report with their options: all, or those that take cases; each takes the cases that it can."""
    if cases is None:
        return [(name, Options(quick=quick)) for name in REPORTED]
    moving = tuple(case for case in cases if not case.static)
    bending = tuple(case for case in cases if case.scene.beams)
    found = [("convergence", cases), ("trade", moving), ("fidelity", bending), ("extremes", cases)]
    return [(name, Options(quick=quick, cases=those)) for name, those in found if those]


def _takers(name: str) -> str:
    takers = [study for study, taken in TAKEN.items() if name in taken]
    return f"{', '.join(takers)} {'do' if len(takers) > 1 else 'does'}" if takers else "others do"


def trials(every: Iterable[tuple[str, Options]]) -> list["Trial"]:
    """Runs of all kinds that studies need, of those that know them in advance."""
    tell = [(getattr(import_module(STUDIES[name][0]), "trials", None), options) for name, options in every]
    return [trial for one, options in tell if one is not None for trial in one(options)]


def find(name: str) -> "Callable[[Options, Runner], Result]":
    """The `run` of a study.

    Raises
    ------
    StudyError
        If there is no such study.
    """
    if name not in STUDIES:
        raise StudyError(f"study {name!r} is unknown; allowed are {', '.join(STUDIES)}")
    return import_module(STUDIES[name][0]).run  # type: ignore[no-any-return]
