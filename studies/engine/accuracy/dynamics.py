"""One dynamic scene over solvers, elements, integrators, meshes and steps, a reference for each element."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from anctmm.elements.kinds import KINDS
from anctmm.model.case import Case
from anctmm.model.scene import Clamp, Scene
from anctmm.results.solution import Solution
from anctmm.validation import one_of
from studies.engine.accuracy.references import refined_reference
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Outcome, Reference
from studies.engine.running.rows import element_of, row, rows_frame, sample_rows
from studies.engine.running.trial import Mesh, Trial, mesh_label, product
from studies.engine.study import Options, StudyError
from studies.engine.tables import Table

REISSNER = (
    "exudyn-reissner is measured against the shear element's reference: its error contains the difference of two "
    "models (Reissner's strains against Green's), which no mesh removes."
)


#: Clamps hold or free the stretch as their scene says.
AS_GIVEN = "as given"


def with_stretch(scene: Scene, stretch: str) -> Scene:
    """A scene whose clamps free the stretch, or as it is.

    Clamps hold directions in the continuum, which knows no gradient to be held beside: with more elements both tend to
    the same motion. Where clamps hold the stretch, the error of elements of any order falls like that of first order.

    Parameters
    ----------
    scene : Scene
    stretch : str
        "free" or "as given".
    """
    if one_of("stretch", stretch, (AS_GIVEN, "free")) == AS_GIVEN:
        return scene
    joints = (replace(j, stretch="free") if isinstance(j, Clamp) else j for j in scene.joints)
    return replace(scene, joints=tuple(joints))


@dataclass(frozen=True)
class Scheme:
    """Element, quadrature and integrator, with who runs them, on which meshes and by which steps.

    Parameters
    ----------
    element, quadrature, integrator : str
    solvers : tuple of str
    meshes : tuple of tuple of int
    steps : callable
        Mesh → time steps, s: an explicit scheme's must shrink with the elements.
    options : tuple of (str, value)
        Further options of the discretisation. With a `tolerance` the error drives the step, and `steps` is not used.
    own : tuple of (str, value)
        Keyword arguments that only these solvers have.
    stretch : str
        Of the scene's clamps, see `with_stretch`.
    """

    element: str
    quadrature: str
    integrator: str
    solvers: tuple[str, ...]
    meshes: tuple[Mesh, ...]
    steps: Callable[[Mesh], tuple[float, ...]]
    options: tuple[tuple[str, Any], ...] = ()
    own: tuple[tuple[str, Any], ...] = ()
    stretch: str = AS_GIVEN

    def steps_on(self, mesh: Mesh, wanted: tuple[float, ...] | None) -> tuple[float, ...]:
        """Steps on a mesh, s: those the user wants, or its own; one NaN where a tolerance drives them."""
        return (float("nan"),) if "tolerance" in dict(self.options) else wanted or self.steps(mesh)


@dataclass(frozen=True)
class Fine:
    """Settings of a reference: the finest run, the next coarser mesh and step, and the solvers, in order.

    Without a coarser mesh the reference is one of the step alone. `element` takes the place of the one whose reference
    it is, of the same continuum; `stretch` is that of the scene's clamps, see `with_stretch`; `options` are further
    ones of the discretisation.
    """

    solvers: tuple[str, ...]
    mesh: Mesh
    coarser_mesh: Mesh | None
    dt: float
    coarser_dt: float
    integrator: str = "zhai"
    quadrature: str = "full"
    element: str | None = None
    stretch: str = AS_GIVEN
    options: tuple[tuple[str, Any], ...] = ()


@dataclass(frozen=True)
class Plan:
    """A sweep: its schemes, and the reference of each element.

    A reference is that of settings, which are run, or one that is there already.
    A solver that uses an element of its own is measured against that element's reference, where there is one, or else
    against that of the element asked for, or of one that tends to the same continuum.
    `budget_s`: no further sample is taken of a run once its samples have taken that long; the
    runner's own limit without it.
    """

    schemes: tuple[Scheme, ...]
    references: Mapping[str, Fine | Reference]
    budget_s: float | None = None


@dataclass(frozen=True)
class Planned:
    """Cases of a sweep that are to be run, and what their errors are measured against."""

    base: Case
    cases: Sequence[Trial]
    references: Mapping[str, Reference]

    def reference_of(self, case: Trial) -> Reference:
        """The reference of a case."""
        return self.references[measured_by(case, self.references)]


@dataclass(frozen=True)
class Sweep:
    """What a sweep gave."""

    base: Case
    outcomes: tuple[Outcome, ...]
    references: Mapping[str, Reference]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row a run."""
        return [row(o, self.references[measured_by(o.case, self.references)]) for o in self.outcomes]

    @property
    def frame(self) -> pd.DataFrame:
        """The rows as a frame, with the number of all elements and the element whose reference they have."""
        families = [measured_by(o.case, self.references) for o in self.outcomes]
        return rows_frame(self.rows, self.outcomes, families)

    def solution(self, **wanted: Any) -> Solution | None:
        """The whole solution with the smallest step among the cases with these values; None without one."""
        found = [
            o for o in self.outcomes
            if o.solution.status.ok and all(getattr(o.case, k) == v for k, v in wanted.items())
        ]  # fmt: skip
        return min(found, key=lambda o: o.case.dt).solution if found else None

    def history(self, **wanted: Any) -> Solution | None:
        """The whole solution as above, or else the longest that was cut; None where nothing moved."""
        if whole := self.solution(**wanted):
            return whole
        cut = [
            o.solution for o in self.outcomes
            if len(o.solution.t) > 1 and all(getattr(o.case, k) == v for k, v in wanted.items())
        ]  # fmt: skip
        return max(cut, key=lambda s: float(s.t[-1]), default=None)


def of_kinds(schemes: Iterable[Scheme], options: Options) -> tuple[Scheme, ...]:
    """The schemes of the requested element and integrator."""
    return tuple(
        scheme for scheme in schemes
        if options.element in (None, scheme.element) and options.integrator in (None, scheme.integrator)
    )  # fmt: skip


def quick_plan(quick: Plan, full: Plan, options: Options) -> Plan:
    """A quick plan; if it has none of the requested kinds, the beginning of the full plan's schemes of them.

    Their two coarsest meshes are run, by the longest of their steps.
    """
    if of_kinds(quick.schemes, options):
        return quick
    short = (
        replace(s, meshes=s.meshes[:2], steps=lambda mesh, s=s: s.steps(mesh)[:1])  # type: ignore[misc]
        for s in of_kinds(full.schemes, options)
    )
    return replace(
        quick, schemes=(*quick.schemes, *short), references={**full.references, **quick.references}
    )


def sweep(base: Case, plan: Plan, options: Options, runner: Runner) -> Sweep:
    """Run a plan, narrowed by the user's options."""
    one = planned(base, plan, options, runner)
    return Sweep(base, tuple(runner.sweep(one.cases, plan.budget_s)), one.references)


def planned(base: Case, plan: Plan, options: Options, runner: Runner) -> Planned:
    """Cases of a plan, narrowed by the user's options, and the references, found."""
    cases = cases_of(base, plan, options)
    every = with_references(base, plan, cases)
    runner.compute(every)
    runner.prepare(every)
    elements = dict.fromkeys(measured_by(case, plan.references) for case in cases)
    return Planned(base, cases, {e: reference_of(base, e, plan.references[e], runner) for e in elements})


def with_references(base: Case, plan: Plan, cases: Sequence[Trial]) -> list[Trial]:
    """Cases of a plan, and the runs that their references begin with."""
    elements = dict.fromkeys(measured_by(case, plan.references) for case in cases)
    return [*cases, *(run for e in elements for run in _reference_runs(base, e, plan.references[e]))]


def cases_of(base: Case, plan: Plan, options: Options) -> list[Trial]:
    """All cases of a plan as the user narrowed it.

    A solver asked for by name runs the schemes that list it; one that no scheme lists (another package's)
    runs them all, except for those with keyword arguments that only another solver has.

    Raises
    ------
    StudyError
        If a mesh asked for has neither one number nor one for each body, or no scheme is of the kinds asked for.
    """
    for mesh in options.meshes or ():
        check_mesh(base.scene, mesh)
    cases = []
    listed = {solver for scheme in plan.schemes for solver in scheme.solvers}
    schemes = of_kinds(plan.schemes, options)
    check_kinds(base, plan.schemes, options)
    for scheme in schemes:
        wanted = scheme.solvers if options.solvers is None else options.solvers
        solvers = [s for s in wanted if s in scheme.solvers or (s not in listed and not scheme.own)]
        scene = with_stretch(base.scene, scheme.stretch)
        for mesh in options.meshes or scheme.meshes:
            cases += product(
                scene, solvers, [mesh], scheme.steps_on(mesh, options.steps), element=scheme.element,
                quadrature=scheme.quadrature, integrator=scheme.integrator, t_end=base.duration,
                output_dt=base.interval, options=scheme.options, own=scheme.own,
            )  # fmt: skip
    return cases


def check_kinds(base: Case, schemes: Iterable[Scheme], options: Options) -> None:
    """Refuse an element or integrator that no scheme has."""
    schemes = tuple(schemes)
    if not of_kinds(schemes, options):
        asked = " ".join(filter(None, (options.element, options.integrator)))
        kinds = "; ".join(dict.fromkeys(f"{scheme.element} {scheme.integrator}" for scheme in schemes))
        raise StudyError(
            f"--element and --integrator ask for {asked}; scene {base.scene.name!r} is run with {kinds}"
        )


def check_mesh(scene: Scene, mesh: Mesh) -> None:
    """Refuse a mesh that fits neither all beams nor each."""
    names = [body.name for body in scene.beams]
    if len(mesh) not in (1, len(names)):
        allowed = " or ".join(dict.fromkeys(("1", str(len(names)))))
        raise StudyError(
            f"--elements has {mesh_label(mesh)!r}; scene {scene.name!r} needs {allowed} numbers, "
            f"for {'/'.join(names)}"
        )


def samples(outcomes: tuple[Outcome, ...]) -> Table:
    """All raw time samples."""
    return Table(
        "samples",
        "Raw time samples",
        pd.DataFrame([r for o in outcomes for r in sample_rows(o.case, o.samples)]),
    )


def measured_by(case: Trial, references: Mapping[str, Any]) -> str:
    """Element whose reference a case is measured against: its own, or one that tends to the same."""
    own = element_of(case.solver, case.element)
    return own if own in references else continuum_of(case.element, references)


def continuum_of(element: str, known: Iterable[str]) -> str:
    """An element among those known that tends to the same continuum: itself first, and where there is none."""
    known = list(known)
    if element in known:
        return element
    alike = (e for e in known if e in KINDS and KINDS[e].continuum == KINDS[element].continuum)
    return next(alike, element)


def reference_of(base: Case, element: str, fine: Fine | Reference, runner: Runner) -> Reference:
    """The reference of an element: that of settings, which are run, or one that is there already."""
    if isinstance(fine, Reference):
        return fine
    best, *coarser = _fine_and_coarser(base, element, fine)
    return refined_reference(runner, best, coarser, base.probes, fine.solvers)


def _reference_runs(base: Case, element: str, fine: Fine | Reference) -> list[Trial]:
    """Runs that a reference begins with: those of the first solver."""
    if isinstance(fine, Reference):
        return []
    return [replace(case, solver=fine.solvers[0]) for case in _fine_and_coarser(base, element, fine)]


def fine_run(base: Case, element: str, fine: Fine) -> Trial:
    """The finest run of settings, by the first solver that succeeds."""
    return replace(_fine_and_coarser(base, element, fine)[0], solver=fine.solvers[0])


def _fine_and_coarser(base: Case, element: str, fine: Fine) -> list[Trial]:
    # a solver with an element of its own takes any of our kinds
    asked = fine.element or (element if element in KINDS else "shear")
    scene = with_stretch(base.scene, fine.stretch)

    def case(mesh: Mesh, dt: float) -> Trial:
        return Trial(
            scene, "", mesh, element=asked, quadrature=fine.quadrature, integrator=fine.integrator,
            dt=dt, t_end=base.duration, output_dt=base.interval, options=fine.options,
        )  # fmt: skip

    cases = [case(fine.mesh, fine.dt), case(fine.mesh, fine.coarser_dt)]
    if fine.coarser_mesh is not None:
        cases.append(case(fine.coarser_mesh, fine.dt))
    return cases
