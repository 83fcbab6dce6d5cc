"""Settings of a trade: a family for each solver, element, quadrature, integrator and choice, over meshes and steps."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isinf

from anctmm.elements.kinds import KINDS, QUADRATURES
from anctmm.model.case import Case
from anctmm.model.needs import features_of
from anctmm.solvers import registry
from anctmm.solvers.capabilities import NEWTON_TOLERANCES
from studies.engine.choices import Given, choices_of
from studies.engine.meshes import explicit_limit, step_below
from studies.engine.refinement import offer_of
from studies.engine.study import Options, StudyError
from studies.engine.trials import Mesh, Trial
from studies.trade.levels import Levels

EXPLICIT = "zhai"
#: Tolerances of the error-controlled steps; of a quick run.
TOLERANCES = {False: (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5), True: (1e-2, 1e-3, 1e-4)}
#: Doublings of the mesh that a solver takes in addition whose element is of lower order than the one asked for.
MORE_MESHES = 2


@dataclass(frozen=True)
class Family:
    """Settings of one solver that differ in mesh and step alone.

    Parameters
    ----------
    solver, element, quadrature, integrator : str
        `element` is the one asked for.
    options, own : tuple of (str, value)
        As of `Trial`.
    tightest : bool
        Whether the bounds of the iteration are the tightest of the solver.
    """

    solver: str
    element: str
    quadrature: str
    integrator: str
    options: Given = ()
    own: Given = ()
    tightest: bool = True

    @property
    def controlled(self) -> bool:
        """Whether a tolerance controls the step."""
        return "tolerance" in dict(self.options)

    @property
    def kind(self) -> tuple[str, ...]:
        """Solver, element, integrator, and whether a tolerance controls the step."""
        stepping = f"{self.integrator}, error-controlled" if self.controlled else self.integrator
        return self.solver, self.element, stepping

    def trials(self, case: Case, mesh: Mesh, steps: Iterable[float]) -> list[Trial]:
        """Runs on a mesh, one a step; with a tolerance a single one."""
        return [
            Trial(
                case.scene, self.solver, mesh, self.element, self.quadrature, self.integrator, dt, case.duration,
                case.interval, self.options, self.own,
            )
            for dt in ((float("nan"),) if self.controlled else steps)
        ]  # fmt: skip


@dataclass(frozen=True)
class Grid:
    """Families with their meshes and steps; sentences about solvers that are not timed."""

    levels: Levels
    families: tuple[Family, ...]
    not_timed: tuple[str, ...] = ()
    quick: bool = False

    def meshes(self, family: Family) -> tuple[Mesh, ...]:
        """Meshes of a family, from coarse to fine; finer ones where the solver's own element is of lower order."""
        meshes = self.levels.meshes[family.element]
        own = offer_of(family.solver).order_of(family.element)
        if own >= KINDS[family.element].order or len(meshes) < 2 or self.quick:
            return meshes
        more = [tuple(2**k * n for n in meshes[-1]) for k in range(1, MORE_MESHES + 1)]
        return (*meshes, *more)

    def steps(self, family: Family, mesh: Mesh) -> tuple[float, ...]:
        """Steps of a family on a mesh, s: an explicit one takes the largest safe step and half of it."""
        if family.integrator != EXPLICIT or self.levels.case.static:
            return self.levels.steps
        case = self.levels.case
        by_body = Trial(case.scene, family.solver, mesh).by_body
        limit = explicit_limit(case, by_body, element=family.element, quadrature=family.quadrature)
        if isinf(limit):
            return self.levels.steps
        largest = step_below(case, limit)
        return largest, largest / 2.0


def grid(levels: Levels, options: Options) -> Grid:
    """Every solver with every freedom that it offers, on the same meshes with the same steps.

    Raises
    ------
    StudyError
        If no solver offers the requested element and integrator.
    """
    features = set(features_of(levels.case.scene))
    solvers, slow = [], []
    for solver in options.solvers or registry.names():
        with_callbacks = sorted(features & offer_of(solver).slow_with)
        if with_callbacks and not options.solvers:
            things = ", ".join(f.replace("-", " ") for f in with_callbacks)
            slow.append(
                f"{solver} is not timed: its model has {things} for verification and not for speed (as by Python "
                f"callbacks in each step); --solvers {solver} times it all the same."
            )
        else:
            solvers.append(solver)
    families = tuple(
        family
        for element in levels.meshes
        for solver in solvers
        for family in _families(solver, element, levels.case, options)
    )
    if not families:
        asked = " ".join(filter(None, (options.element, options.integrator)))
        raise StudyError(
            f"--element and --integrator ask for {asked}; no solver of {', '.join(solvers)} offers that"
        )
    return Grid(levels, families, tuple(slow), options.quick)


def _families(solver: str, element: str, case: Case, options: Options) -> Iterator[Family]:
    offer = offer_of(solver)
    if (offer.element and element not in offer.limits) or offer.lacking({element}):
        return
    own = KINDS.get(offer.element_of(element))
    rules = own.quadratures if own and own.quadratures and case.scene.beams else QUADRATURES[:1]
    for quadrature in rules[-1:] if options.quick else rules:
        for integrator in offer.integrators:
            if options.integrator in (None, integrator):
                yield from _choices(Family(solver, element, quadrature, integrator), options.quick)


def _choices(plain: Family, quick: bool) -> Iterator[Family]:
    """A family for each choice of the iteration's bounds, and for each tolerance of error control."""
    about = plain.solver, plain.element, plain.quadrature, plain.integrator
    if plain.integrator == EXPLICIT:
        yield plain
        return
    for k, (shared, own) in enumerate(choices_of(plain.solver)):
        yield Family(*about, shared, own, k == 0)
    for tolerance in TOLERANCES[quick]:
        yield Family(*about, (("tolerance", tolerance), ("newton_tolerance", NEWTON_TOLERANCES[-1])))
