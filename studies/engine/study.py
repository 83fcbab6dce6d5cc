"""The interface of studies, and the list of all studies."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING

from anctmm.errors import AnctmmError
from anctmm.model.case import Case
from anctmm.model.scene import Scene
from studies.engine.files import file_names
from studies.engine.pictures import Picture

if TYPE_CHECKING:
    from studies.engine.runner import Runner
    from studies.engine.tables import Table
    from studies.engine.trials import Mesh

#: A new study is one module with a function `run(options, runner) -> Result`, and its line here.
STUDIES = {
    "trade": ("studies.trade.study", "which solver, element, mesh and step costs least for an error"),
    "convergence": ("studies.convergence", "observed orders in mesh and step, and the uncertainty of every value"),
    "fidelity": ("studies.fidelity", "which body may be a cable or rigid, and what that saves"),
    "extremes": ("studies.extremes.study", "limits of step, size, place, stiffness, load and time"),
    "agreement": ("studies.agreement.study", "every pair of solvers on both moving scenes: the same motion or not"),
    "published": ("studies.published.study", "numbers that others have published: confirmed, contradicted or why not"),
}  # fmt: skip
#: Options as they are typed; and those that studies take.
TYPED = {
    "meshes": "--elements", "steps": "--dt", "solvers": "--solvers", "cases": "scene", "element": "--element",
    "integrator": "--integrator", "error": "--error",
}  # fmt: skip
RANGES = ("meshes", "steps", "solvers")
TAKEN = {
    "convergence": ("cases", "element", "integrator", "error", *RANGES),
    "trade": ("cases", "error", "element", "integrator", *RANGES),
    "agreement": ("element", "integrator", *RANGES),
    "fidelity": ("cases", "error"),
    "extremes": ("cases",),
    "published": (),
}


class StudyError(AnctmmError, ValueError):
    """A study or one of its options is unknown."""


@dataclass(frozen=True)
class Options:
    """Choices of the user; None means the study's own.

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

    @property
    def case(self) -> Case:
        """The one case of a study that takes cases: commands run such a study once for each."""
        assert self.cases is not None
        return self.cases[0]


@dataclass(frozen=True)
class Answer:
    """A card of the page: a question, the number that answers it, and a conclusion in a sentence."""

    question: str
    figure: str
    take: str

    def __str__(self) -> str:
        return " ".join(filter(None, (self.question, f"{self.figure}:" if self.figure else "", self.take)))


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
    answers : tuple of Answer or str
        Cards of the page; a sentence alone answers the study's question.
    shown : tuple of str
        Names of the tables that a terminal shows.
    left_out : str
        Parts of the study that a quick run leaves out, as the end of a sentence; empty where there are none.
    good : bool
        Whether at least one run answered.
    """

    name: str
    title: str
    question: str
    findings: tuple[str, ...]
    assumptions: tuple[str, ...]
    tables: "tuple[Table, ...]"
    pictures: tuple[Picture, ...] = ()
    answers: tuple[Answer | str, ...] = ()
    shown: tuple[str, ...] = ()
    left_out: str = ""
    good: bool = True

    def table(self, name: str) -> "Table":
        """The table of a name."""
        return next(t for t in self.tables if t.name == name)


def answers_of(result: Result) -> list[Answer]:
    """Cards of a result."""
    return [a if isinstance(a, Answer) else Answer(result.question, "", a) for a in result.answers]


def check_taken(options: Options, study: str) -> None:
    """Refuse options that a study does not use.

    Raises
    ------
    StudyError
        Naming the option, and the studies with that option.
    OutputError
        If files of two cases would have one name.
    """
    file_names(case.name for case in options.cases or ())
    taken = TAKEN.get(study, RANGES)
    for name, typed in TYPED.items():
        if name not in taken and getattr(options, name) is not None:
            takers = [other for other, names in TAKEN.items() if name in names]
            raise StudyError(
                f"study {study!r} takes no {typed}; studies with it: {', '.join(takers)}, and `run`"
            )


def check_mesh(scene: Scene, mesh: "Mesh") -> None:
    """Refuse a mesh that fits neither all beams nor each."""
    names = [body.name for body in scene.beams]
    if len(mesh) not in (1, len(names)):
        allowed = " or ".join(dict.fromkeys(("1", str(len(names)))))
        given = "/".join(map(str, mesh))
        raise StudyError(
            f"--elements has {given!r}; scene {scene.name!r} needs {allowed} numbers, for {'/'.join(names)}"
        )


def without_beams(cases: Iterable[Case], options: Options) -> list[str]:
    """Of each case without beams a sentence that options about elements do nothing for it; none where none is given.

    Raises
    ------
    StudyError
        If no case has beams: then they do nothing at all.
    """
    given = [TYPED[name] for name in ("meshes", "element") if getattr(options, name) is not None]
    cases = tuple(cases) if given else ()
    none = [case.name for case in cases if not case.scene.beams]
    return _in_vain(f"{' and '.join(given)}: for elements of beams", cases, none, "has no beams")


def without_motion(cases: Iterable[Case], options: Options) -> list[str]:
    """Of each static case a sentence that an integrator does nothing for it; none where none is given.

    Raises
    ------
    StudyError
        If no case moves: then it does nothing at all.
    """
    cases = tuple(cases) if options.integrator is not None else ()
    resting = [case.name for case in cases if case.static]
    return _in_vain(f"{TYPED['integrator']}: for steps of motions", cases, resting, "is a static equilibrium")


def _in_vain(what: str, cases: Sequence[Case], names: list[str], why: str) -> list[str]:
    """Sentences on the cases for which options do nothing, refused if these are all."""
    if names and len(names) == len(cases):
        raise StudyError(f"{what}; scene {', '.join(names)} {why}: leave it out")
    return [f"{name}: {what}, and it {why}." for name in names]


def of_case(options: Options, case: Case) -> Options:
    """The options for one of several cases: without beams there are no elements to choose."""
    return options if case.scene.beams else replace(options, meshes=None, element=None)


def known(name: str) -> str:
    """The module of a study.

    Raises
    ------
    StudyError
        If there is no such study.
    """
    if name not in STUDIES:
        raise StudyError(f"study {name!r} is unknown; allowed are {', '.join(STUDIES)}")
    return STUDIES[name][0]


def find(name: str) -> "Callable[[Options, Runner], Result]":
    """The `run` of a study; errors as of `known`."""
    return import_module(known(name)).run  # type: ignore[no-any-return]
