"""Is a registered solver what the studies take it for? The rules are in `conform_rules`; this runs and shows them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import PluginError
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from anctmm.solvers import registry
from anctmm.solvers.capabilities import Offer
from anctmm.solvers.registry import Solver

HOLDS, BROKEN, NOT_OFFERED, NOT_RUN = "holds", "broken", "not offered", "not run"
NOT_INSTALLED = "not installed"
STYLES = {HOLDS: "green", BROKEN: "bold red", NOT_OFFERED: "dim", NOT_RUN: "yellow", NOT_INSTALLED: "yellow"}


class BrokenRule(Exception):
    """A rule is broken in a way that no number tells."""


@dataclass(frozen=True)
class Measure:
    """What a rule found: a number, or words where there is none to exceed.

    Parameters
    ----------
    value, allowed : float
        The rule holds if value ≤ allowed; what is no number is not.
    what : str
        Of what the number is, or what was seen.
    """

    value: float
    allowed: float
    what: str

    @property
    def ok(self) -> bool:
        """Whether it is allowed."""
        return self.value <= self.allowed


@dataclass(frozen=True)
class Rule:
    """One thing asked of every solver.

    Parameters
    ----------
    name : str
    asks : str
        What, in words.
    test : callable
        Subject → Measure, or words for what was seen; raises whatever a broken solver makes it raise.
    needs : tuple of str
        Features without which it does not apply, of `anctmm.solvers.capabilities.FEATURES`.
    """

    name: str
    asks: str
    test: "Callable[[Subject], Measure | str]"
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Finding:
    """A row of the table."""

    rule: str
    asks: str
    measured: str
    allowed: str
    verdict: str


@dataclass
class Subject:
    """A solver under test, without the registry's own check of its answers.

    Parameters
    ----------
    name : str
    solve : callable
    """

    name: str
    solve: Solver
    _kept: dict[Any, Solution] = field(default_factory=dict)

    @cached_property
    def offer(self) -> Offer:
        """What it claims."""
        return registry.offer_of(self.solve)

    @cached_property
    def static(self) -> Solver:
        """Its `solve_static`."""
        return registry.load_static(self.name, self.solve)

    @property
    def integrator(self) -> str:
        """The one the rules use: implicit where there is a choice."""
        return self.offer.integrators[0]

    @property
    def element(self) -> str:
        """The one the rules of motion ask for."""
        return next(iter(self.offer.limits), "cable")

    def run(self, **changes: Any) -> Discretisation:
        """Discretisation of a rule's run."""
        integrator = changes.get("integrator", self.integrator)
        usual = {
            "mesh": 8, "element": self.element, "integrator": integrator,
            "dt": 1e-3 if integrator == "generalized-alpha" else 2e-4, "t_end": 0.4, "output_dt": 0.01,
        }  # fmt: skip
        return Discretisation(**(usual | changes))

    def motion(self, scene: Scene, **changes: Any) -> Solution:
        """Answer to a scene, which must be a whole run; the same question is asked but once."""
        run = self.run(**changes)
        if (scene, run) not in self._kept:
            self._kept[scene, run] = whole(self.solve(scene, run))
        return self._kept[scene, run]

    def rest(self, scene: Scene, mesh: int, element: str) -> Solution:
        """Equilibrium, asked for as the studies do; it must be found."""
        if (scene, mesh, element) not in self._kept:
            answer = self.static(scene, mesh=mesh, element=element, quadrature="full")
            self._kept[scene, mesh, element] = whole(answer)
        return self._kept[scene, mesh, element]


def whole(answer: Solution) -> Solution:
    """The answer, if it is a whole run."""
    if not isinstance(answer, Solution):
        raise BrokenRule(f"the answer is a {type(answer).__name__}, no anctmm.Solution")
    if not answer.status.ok:
        raise BrokenRule(f"status {answer.status}")
    return answer


def conform(name: str) -> Iterator[Finding]:
    """Test a registered solver against every rule, a finding at a time.

    Parameters
    ----------
    name : str

    Raises
    ------
    UnknownSolverError
        If no package registers that name.
    """
    from studies.conformance.rules import INSTALLED, LOADS, RULES, SIGNATURE, missing

    try:
        subject = Subject(name, registry.load(name))
        lacks = ", ".join(sorted(subject.offer.lacks)) or "nothing"
        yield Finding(LOADS, "it can be imported", f"lacks {lacks}", "", HOLDS)
    except PluginError as error:
        yield Finding(LOADS, "it can be imported", str(error), "", BROKEN)
        return
    if absent := missing(subject):
        yield Finding(INSTALLED, "what it stands on is installed", absent, "", NOT_INSTALLED)
        yield from (Finding(rule.name, rule.asks, "", "", NOT_RUN) for rule in RULES)
        return
    called = True
    for rule in RULES:
        found = judge(rule, subject) if called else Finding(rule.name, rule.asks, "", "", NOT_RUN)
        called = called and (rule.name, found.verdict) != (SIGNATURE, BROKEN)
        yield found


def judge(rule: Rule, subject: Subject) -> Finding:
    """One rule's finding; whatever is raised on the way breaks the rule."""
    if lacking := subject.offer.lacking(rule.needs):
        return Finding(rule.name, rule.asks, f"lacks {', '.join(lacking)}", "", NOT_OFFERED)
    try:
        found = rule.test(subject)
    except BrokenRule as reason:
        return Finding(rule.name, rule.asks, str(reason), "", BROKEN)
    except Exception as error:  # a broken solver may raise anything
        told = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return Finding(rule.name, rule.asks, told, "", BROKEN)
    if isinstance(found, str):
        return Finding(rule.name, rule.asks, found, "", HOLDS)
    measured, allowed = f"{found.value:.2g} {found.what}", f"{found.allowed:.2g}"
    return Finding(rule.name, rule.asks, measured, allowed, HOLDS if found.ok else BROKEN)


def passed(findings: Sequence[Finding]) -> bool:
    """Whether no rule is broken, and all were run."""
    return all(f.verdict in (HOLDS, NOT_OFFERED) for f in findings)


def exit_code(findings: Sequence[Finding]) -> int:
    """0 if all rules hold, 1 if one is broken, 4 if none could be tested: what the solver needs is not installed."""
    return 4 if any(f.verdict == NOT_INSTALLED for f in findings) else 0 if passed(findings) else 1


def show(name: str, findings: Sequence[Finding], console: Console) -> None:
    """Print the table and the verdict."""
    shown = Table(title=f"Solver {name}", title_justify="left", box=None, padding=(0, 2, 0, 0))
    for head in ("rule", "asks", "measured", "allowed", "verdict"):
        shown.add_column(head, header_style="dim", overflow="fold", no_wrap=head in ("rule", "verdict"))
    for f in findings:
        texts = map(escape, (f.rule, f.asks, f.measured, f.allowed))
        shown.add_row(*texts, f"[{STYLES[f.verdict]}]{f.verdict}[/]")
    console.print(shown)
    counts = {v: sum(f.verdict == v for f in findings) for v in STYLES}
    console.print(", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count))
