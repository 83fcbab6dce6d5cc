"""The interface of studies, and the list of all studies."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

from anctmm.model.case import Case
from studies.engine.files import file_name
from studies.engine.meshes import Mesh, StudyError, by_beam
from studies.engine.runner import Runner
from studies.engine.tables import Table

#: Options as they are typed.
TYPED = {
    "meshes": "--elements", "steps": "--dt", "solvers": "--solvers", "cases": "scene", "element": "--element",
    "integrator": "--integrator", "error": "--error",
}  # fmt: skip
#: A new study is one module with a function `run(options, runner) -> Result`, and its line here.
STUDIES = {
    "trade": ("studies.trade.study", "which solver, element, mesh and step costs least for an error"),
    "convergence": ("studies.convergence", "observed orders in mesh and step, and the uncertainty of every value"),
    "fidelity": ("studies.fidelity", "which body may be a cable or rigid, and what that saves"),
    "extremes": ("studies.extremes.study", "limits of step, size, place, stiffness, load and time"),
    "agreement": ("studies.agreement.study", "every pair of solvers on both moving scenes: the same motion or not"),
    "published": ("studies.published.study", "numbers that others have published: confirmed, contradicted or why not"),
}  # fmt: skip
#: Options that they take.
TAKEN: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("convergence", "trade"), tuple(TYPED)), "fidelity": ("cases", "error"), "extremes": ("cases",),
    "agreement": ("element", "integrator", "meshes", "steps", "solvers"), "published": (),
}  # fmt: skip


@dataclass(frozen=True)
class Options:
    """Choices of the user; None means the study's own."""

    quick: bool = False  # the smallest sweep that still shows the study's point
    meshes: tuple[Mesh, ...] | None = None
    steps: tuple[float, ...] | None = None  # s
    solvers: tuple[str, ...] | None = None
    cases: tuple[Case, ...] | None = None
    element: str | None = None
    integrator: str | None = None
    error: float | None = None  # target, relative

    @property
    def case(self) -> Case:
        """The one case of a study that takes cases: commands run such a study once for each."""
        assert self.cases is not None
        return self.cases[0]


@dataclass(frozen=True)
class Picture:
    """A drawing with its name (of the file) and its caption; `studies.report.plots` draws it."""

    name: str
    caption: str
    svg: str


@dataclass(frozen=True)
class Answer:
    """A card of the page: a question, the number that answers it, and a conclusion in a sentence."""

    question: str
    figure: str
    take: str


@dataclass(frozen=True)
class Result:
    """A study's answer."""

    name: str
    title: str
    question: str
    findings: tuple[str, ...]  # sentences with numbers taken from the tables
    assumptions: tuple[str, ...]
    tables: tuple[Table, ...]
    pictures: tuple[Picture, ...] = ()
    answers: tuple[Answer | str, ...] = ()  # cards of the page; a sentence alone answers the study's question
    shown: tuple[str, ...] = ()  # names of the tables that a terminal shows
    left_out: str = ""  # parts that a quick run leaves out, as the end of a sentence
    good: bool = True  # at least one run answered
    case: str = ""  # its name; empty where the study has scenes of its own

    def table(self, name: str) -> Table:
        """The table of a name."""
        return next(t for t in self.tables if t.name == name)


def check_taken(options: Options, study: str) -> None:
    """Refuse by a StudyError what a study does not use, a study that is unknown, and cases with files of one name."""
    find(study)
    names = [case.name for case in options.cases or ()]
    if len({file_name(name) for name in names}) < len(names):
        every = ", ".join(map(repr, names))
        raise StudyError(f"scenes {every} would have files of one name; other letters or digits are needed")
    for name, typed in TYPED.items():
        if name not in TAKEN[study] and getattr(options, name) is not None:
            takers = ", ".join(other for other, taken in TAKEN.items() if name in taken)
            raise StudyError(f"study {study!r} takes no {typed}; studies with it: {takers}, and `run`")


def check_fits(options: Options, case: Case) -> None:
    """Refuse by a StudyError what does nothing for a case, and meshes that fit neither all of its beams nor each."""
    still, bare = "is a static equilibrium, which has no step", "has no beams"
    useless = {"meshes": bare, "element": bare} if not case.scene.beams else {}
    useless |= {"steps": still, "integrator": still} if case.static else {}
    for name, kind in useless.items():
        if getattr(options, name):
            raise StudyError(f"{TYPED[name]} is given, and scene {case.name!r} {kind}: leave it out")
    for mesh in options.meshes or ():
        by_beam(case.scene, mesh)


def find(name: str) -> Callable[[Options, Runner], Result]:
    """The `run` of a study; StudyError if there is no such study."""
    if name not in STUDIES:
        raise StudyError(f"study {name!r} is unknown; allowed are {', '.join(STUDIES)}")
    return import_module(STUDIES[name][0]).run  # type: ignore[no-any-return]
