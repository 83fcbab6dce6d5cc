"""Definition of a conformance rule, and its argument: the solver under test."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from anctmm.solvers import registry
from anctmm.solvers.capabilities import Offer
from anctmm.solvers.registry import Solver


class BrokenRule(Exception):
    """A rule is violated in a way that no number describes."""


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
    """One requirement on every solver.

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
        """The integrator that the rules of motion use."""
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
        """Solution of a scene, which must be a complete run; equal runs are computed once."""
        run = self.run(**changes)
        if (scene, run) not in self._kept:
            self._kept[scene, run] = whole(self.solve(scene, run))
        return self._kept[scene, run]

    def rest(self, scene: Scene, mesh: int, element: str) -> Solution:
        """Equilibrium, requested as in the studies; it must be found."""
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
