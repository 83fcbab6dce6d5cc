"""A solver under test, without the registry's own check of its answers."""

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


@dataclass
class Subject:
    """Name and `solve` of a solver, with what the rules ask of it; equal runs are computed once."""

    name: str
    solve: Solver
    _found: dict[Any, Solution] = field(default_factory=dict)

    @cached_property
    def offer(self) -> Offer:
        """Its declared capabilities."""
        return registry.offer_of(self.solve)

    @property
    def element(self) -> str:
        """The element that the rules of motion use."""
        return next(iter(self.offer.limits), "cable")

    def run(self, **changes: Any) -> Discretisation:
        """Discretisation of a rule's run: implicit where there is a choice."""
        integrator = changes.get("integrator", self.offer.integrators[0])
        dt = 1e-3 if integrator == "generalized-alpha" else 2e-4
        usual = {"mesh": 8, "element": self.element, "integrator": integrator, "dt": dt}
        return Discretisation(**({**usual, "t_end": 0.4, "output_dt": 0.01} | changes))

    def motion(self, scene: Scene, **changes: Any) -> Solution:
        """Motion of a scene; BrokenRule if it is not whole."""
        run = self.run(**changes)
        if (scene, run) not in self._found:
            self._found[scene, run] = whole(self.solve(scene, run))
        return self._found[scene, run]

    def static(self, scene: Scene, **options: Any) -> Solution:
        """What its `solve_static` answers, asked for as in the studies."""
        usual = {"mesh": 8, "element": self.element, "quadrature": "full"}
        return registry.load_static(self.name, self.solve)(scene, **(usual | options))


def whole(answer: Solution) -> Solution:
    """The answer, if it is a whole run; else BrokenRule."""
    if not isinstance(answer, Solution):
        raise BrokenRule(f"the answer is a {type(answer).__name__}, no anctmm.Solution")
    if not answer.status.ok:
        raise BrokenRule(f"status {answer.status}")
    return answer
