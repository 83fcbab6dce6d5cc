"""From a product of lists to solutions and rows, cached run by run: a sweep goes on where it stopped."""

import hashlib
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.errors import AnctmmError, SolverError
from anctmm.jit import cache_dir as storage
from anctmm.model.scene import Probe, Scene
from anctmm.results.metrics import compare
from anctmm.results.solution import Cost, Solution, Status, nothing
from anctmm.solvers import registry
from anctmm.solvers.foreign_code import contained, told
from anctmm.solvers.registry import Solver, static_of
from studies.engine import provenance
from studies.engine.sources import Sources, module_of
from studies.engine.store import Store
from studies.engine.timing import summarise, undisturbed

STATIC = "static"
#: Of a run's row.
COLUMNS = (
    "scene", "solver", "element", "quadrature", "integrator", "elements", "dofs", "dt", "t_end", "steps",
    "newton_iterations", "error", "reference_error", "reference", "cpu_s", "cpu_spread", "build_s", "wall_s",
    "repeats", "status",
)  # fmt: skip
Mesh = tuple[int, ...]


@dataclass(frozen=True)
class Trial:
    """One run of one solver; nothing is checked before it runs, so that a bad case becomes a row, too.

    Parameters
    ----------
    scene : Scene
    solver : str
        Registered name.
    mesh : tuple of int
        Elements of each beam in the scene's order, or one number for all.
    element, quadrature, integrator : str
        As in Discretisation; `integrator` "static" asks for the static equilibrium.
    dt, t_end, output_dt : float
        s; of no meaning for statics.
    options : tuple of (str, value)
        Further options of the discretisation, or of the static solver; a `tolerance` among them takes the place
        of `dt`, which is then NaN.
    own : tuple of (str, value)
        Keyword arguments of the solver that no other has; not for statics.
    """

    scene: Scene
    solver: str
    mesh: Mesh
    element: str = "cable"
    quadrature: str = "full"
    integrator: str = "generalized-alpha"
    dt: float = float("nan")
    t_end: float = 0.0
    output_dt: float = 0.0
    options: tuple[tuple[str, Any], ...] = ()
    own: tuple[tuple[str, Any], ...] = ()

    @property
    def by_body(self) -> int | dict[str, int]:
        """The mesh as the discretisation takes it."""
        if len(self.mesh) == 1:
            return self.mesh[0]
        names = [body.name for body in self.scene.beams]
        if len(names) != len(self.mesh):
            raise SolverError(
                f"mesh {mesh_label(self.mesh)} has {len(self.mesh)} numbers; scene {self.scene.name!r} needs "
                f"1 or {len(names)}, for {'/'.join(names)}"
            )
        return dict(zip(names, self.mesh, strict=True))

    @property
    def error_controlled(self) -> bool:
        """Whether a tolerance drives the step."""
        return "tolerance" in dict(self.options)

    def run(self) -> Discretisation:
        """The discretisation of a dynamic case; raises what Discretisation raises."""
        step: dict[str, Any] = {} if self.error_controlled else {"dt": self.dt}
        return Discretisation(
            mesh=self.by_body, element=self.element, quadrature=self.quadrature, integrator=self.integrator,
            t_end=self.t_end, output_dt=self.output_dt, **step, **dict(self.options),
        )  # fmt: skip

    def solve(self, solver: Solver) -> Solution:
        """Run it with a solver already found by name."""
        if self.integrator != STATIC:
            return solver(self.scene, self.run(), **dict(self.own))
        return static_of(self.solver, solver)(
            self.scene,
            mesh=self.by_body,
            element=self.element,
            quadrature=self.quadrature,
            **dict(self.options),
        )

    def warm_up(self, solver: Solver) -> None:
        """Two steps (or the statics) unmeasured: whatever compiles or loads does it here."""
        step = self.output_dt if self.error_controlled else self.dt
        short = replace(self, t_end=2 * step, output_dt=step) if self.integrator != STATIC else self
        short.solve(solver)


@dataclass(frozen=True)
class Outcome:
    """A case, its solution (of the first sample) and the cost of every sample."""

    case: Trial
    solution: Solution
    costs: tuple[Cost, ...] = ()


@dataclass(frozen=True)
class Reference:
    """What errors are measured against.

    Parameters
    ----------
    name : str
        Solver and settings, or the exact solution.
    error_of : callable
        Solution → error.
    uncertainty : float
        The reference's own, in the unit of the error.
    solution : Solution, optional
    """

    name: str
    error_of: Callable[[Solution], float]
    uncertainty: float
    solution: Solution | None = None


def element_of(solver: str, asked: str) -> str:
    """Name of the element a solver uses for one asked for; that asked for, if the solver is not there."""
    try:
        return registry.offer_of(registry.load(solver)).element_of(asked)
    except AnctmmError:
        return asked


@dataclass
class Runner:
    """Runs cases, remembers them, and reports progress.

    Parameters
    ----------
    cache : Path or None
        Directory of finished runs; None: nothing is kept.
    repeats : int
        Samples of each run's time.
    budget_s : float
        No further sample is taken of a run once its samples have taken that long.
    resolve : callable
        Name → solver.
    on_done : callable
        Told after each case: (case, number done, number of all).
    note : callable
        Told what the user should know, such as a finished run that is not readable.
    heading : str
        What the runs are for: stands before them where progress is shown.
    on_job : callable
        Told after each job: (label, number done, number of all).
    on_start : callable
        Told before each run or job: (label, number done, number of all).
    """

    cache: Path | None
    repeats: int = 3
    budget_s: float = 10.0
    resolve: Callable[[str], Solver] = registry.solver
    on_done: Callable[[Trial, int, int], None] = lambda case, done, total: None
    note: Callable[[str], None] = storage.note
    heading: str = ""
    on_job: Callable[[str, int, int], None] = lambda label, done, total: None
    on_start: Callable[[str, int, int], None] = lambda label, done, total: None
    computed: int = 0
    _warm: set[tuple[Any, ...]] = field(default_factory=set)
    _sources: Sources = field(default_factory=Sources)

    def __post_init__(self) -> None:
        self._store = Store(self.cache, self.note)

    def sweep(self, cases: Iterable[Trial], budget_s: float | None = None) -> list[Outcome]:
        """Run cases; those that differ in the solver only take their samples in turn.

        Parameters
        ----------
        cases : iterable of Trial
        budget_s : float, optional
            In place of the runner's own.

        Returns
        -------
        list of Outcome
            In the order of the cases, sorted so that contestants stand together.
        """
        ordered = list({_identity(case): case for case in cases}.values())
        groups = [list(g) for _, g in groupby(sorted(ordered, key=_contest), key=_contest)]
        outcomes: list[Outcome] = []
        for group in groups:
            self.on_start(label_of(group[0]), len(outcomes), len(ordered))
            for outcome in self._contest(group, self.budget_s if budget_s is None else budget_s):
                outcomes.append(outcome)
                self.on_done(outcome.case, len(outcomes), len(ordered))
        place = {_identity(case): i for i, case in enumerate(ordered)}
        return sorted(outcomes, key=lambda o: place[_identity(o.case)])

    def solve(self, case: Trial) -> Outcome:
        """One case."""
        return self.sweep([case])[0]

    def remember(self, key: str, compute: Callable[[], Any], given: Sequence[Any] = ()) -> Any:
        """Result of any computation, kept under a key, the source it is made of, the machine and the versions.

        Parameters
        ----------
        key : str
            Tells this computation from every other of its module: all that it reads, the `source` of solvers that it
            finds by name among it. Under an empty one nothing is kept.
        compute : callable
            Its module, and all that this imports, is the source. Where none can be found nothing is kept.
        given : sequence
            As for `Store`.
        """
        source = self._sources.of(compute)
        if not key or source is None:
            return compute()
        return self._store.remember(f"{key}|{source}|{provenance.stamp()}", compute, given)

    def jobs(
        self, jobs: Sequence[tuple[str, Callable[[], Any], Callable[[Exception], Any]]], code: str
    ) -> list[Any]:
        """Results of computations that are no runs of one case each, every one kept when it is done.

        Parameters
        ----------
        jobs : sequence of (str, callable, callable)
            Label, which tells a job from every other of its module; what computes it; and what takes its place,
            unremembered, if that raises an error of the solvers or of linear algebra.
        code : str
            The `source` of all solvers that the jobs find by name; nothing is kept if it is empty.
        """
        results = []
        for done, (label, compute, otherwise) in enumerate(jobs, 1):
            self.on_start(label, done - 1, len(jobs))
            try:
                results.append(self.remember(code and f"{label}|{code}", compute))
            except (AnctmmError, np.linalg.LinAlgError) as error:
                results.append(otherwise(error))
            self.on_job(label, done, len(jobs))
        return results

    def attempt(self, case: Trial) -> Solution:
        """Run a case now, unremembered; whatever fails is a solution with that status."""
        return guarded(case.solver, case.scene, lambda: case.solve(self.resolve(case.solver)))

    def key(self, *cases: Trial) -> str:
        """Text that tells cases, the source of their solvers and of their scenes' functions, from every other.

        It is empty where a case cannot be told by its text, or a source cannot be found: nothing is then kept.
        """
        parts = []
        for case in cases:
            source = self.source(case.solver, *classes(case))
            if not reproducible(case) or not source:
                return ""
            parts.append(f"{case_key(case)}|{source}")
        return "|".join(parts)

    def source(self, solver: str, *modules: str) -> str:
        """Text that tells the source of a solver, and of further modules, from every other; empty if none is found."""
        try:
            plain = inspect.unwrap(self.resolve(solver))
        except Exception as error:  # a solver that cannot be loaded now may be repaired later
            return f"{solver} {type(error).__name__}: {error}"
        digest = self._sources.digest(module_of(plain), *modules)
        return f"{module_of(plain)}.{getattr(plain, '__qualname__', '?')} {digest}" if digest else ""

    def _contest(self, group: Sequence[Trial], budget_s: float) -> Iterator[Outcome]:
        # by place, not by case: what a scene's functions are need not have a hash
        first = [self._sample(case, 0) for case in group]
        costs = [[s.cost] if s.status.ok else [] for s in first]
        for k in range(1, self.repeats):
            for case, known in zip(group, costs, strict=True):
                if known and sum(c.wall_s for c in known) < budget_s:
                    known.append(self._sample(case, k).cost)
        for case, solution, known in zip(group, first, costs, strict=True):
            yield Outcome(case, solution, tuple(known))

    def _sample(self, case: Trial, k: int) -> Solution:
        """The k-th run of a case; a failure of the environment is a solution, too, but is not remembered."""

        def solution() -> Solution:
            solver = self.resolve(case.solver)
            key = self.key(case)
            if not key:
                return self._run(case, solver, k)
            key = f"{key}|sample {k}"
            return self.remember(key, lambda: self._run(case, solver, k), [case.scene])  # type: ignore[no-any-return]

        return guarded(case.solver, case.scene, solution)

    def _run(self, case: Trial, solver: Solver, k: int) -> Solution:
        try:
            kind = (case.solver, case.scene.name, case.element, case.quadrature, case.integrator, case.own)
            with undisturbed():
                if kind not in self._warm:
                    case.warm_up(solver)
                    self._warm.add(kind)
                solution = case.solve(solver)
            if not isinstance(solution, Solution):
                raise SolverError(f"solver {case.solver!r} answered {told(solution)}; a Solution is needed")
        except AnctmmError as error:
            return nothing(case.solver, case.scene, None, Status("refused", _one_line(error)))
        self.computed += 1
        # Only the first sample's history is needed; of the others the cost.
        return solution if k == 0 else replace(solution, t=solution.t[:0], fields={})


def guarded(solver: str, scene: Scene, solve: Callable[[], Solution]) -> Solution:
    """What `solve` returns; whatever it raises becomes a solution with that status."""
    try:
        with contained():
            return solve()
    except AnctmmError as error:
        return nothing(solver, scene, None, Status("refused", _one_line(error)))
    except Exception as error:  # one broken solver must not end a sweep
        reason = f"{type(error).__name__}: {_one_line(error)}"
        return nothing(solver, scene, None, Status("failed", reason))


def product(
    scene: Scene,
    solvers: Iterable[str],
    meshes: Iterable[Mesh],
    steps: Iterable[float] = (float("nan"),),
    **common: Any,
) -> list[Trial]:
    """Cases of solver × mesh × step, the rest in common."""
    steps, solvers = tuple(steps), tuple(solvers)
    return [Trial(scene, s, mesh, dt=dt, **common) for mesh in meshes for dt in steps for s in solvers]


def uncertainty_of(best: Solution, coarser: Iterable[Solution], probes: Sequence[Probe]) -> float:
    """How well a fine run is known: the sum of its differences to one of a coarser mesh and one of a coarser step."""
    return sum(compare(other, best, probes).error for other in coarser)


def refined_reference(
    runner: Runner, fine: Trial, coarser: Sequence[Trial], probes: Sequence[Probe], solvers: Sequence[str]
) -> Reference:
    """The finest run of the first of several solvers that can do it.

    Parameters
    ----------
    runner : Runner
        Runs them.
    fine : Trial
        Its `solver` does not matter.
    coarser : sequence of Trial
        The same with a coarser mesh, and with a coarser step: the reference's uncertainty is the sum of its
        differences to them.
    probes : sequence
        Where to compare.
    solvers : sequence of str
        Names in the order of preference.
    """
    reason = "no solver given"
    for name in solvers:
        best, *others = (runner.solve(replace(c, solver=name)).solution for c in (fine, *coarser))
        bad = [s.status for s in (best, *others) if not s.status.ok]
        if bad:
            reason = f"{name} {bad[0]}"
            continue
        uncertainty = uncertainty_of(best, others, probes)
        label = f"{name} {fine.integrator} {mesh_label(fine.mesh)} dt={fine.dt:g}"
        return Reference(label, lambda s, best=best: compare(s, best, probes).error, uncertainty, best)  # type: ignore[misc]
    return Reference(f"none: {reason}", lambda s: float("nan"), float("nan"))


def _quadrature_shown(case: Trial) -> str:
    """The quadrature of a case as tables show it: of bodies of different kinds none is told."""
    return (
        "-" if isinstance(case.element, Mapping) else kind_of(case.element).quadrature_shown(case.quadrature)
    )


def row(outcome: Outcome, reference: Reference) -> dict[str, Any]:
    """The tidy row of a run. A run cut short has no error."""
    case, solution, timing = outcome.case, outcome.solution, summarise(outcome.costs)
    return {
        "scene": case.scene.name,
        "solver": case.solver,
        "element": element_of(case.solver, case.element),
        "quadrature": _quadrature_shown(case),
        "integrator": case.integrator,
        "elements": mesh_label(case.mesh),
        "dofs": solution.dofs,
        "dt": case.dt,
        "t_end": case.t_end if case.integrator != STATIC else float("nan"),
        "steps": solution.cost.steps,
        "newton_iterations": solution.cost.newton_iterations,
        "error": reference.error_of(solution) if solution.status.ok else float("nan"),
        "reference_error": reference.uncertainty,
        "reference": reference.name,
        "cpu_s": timing.cpu_s,
        "cpu_spread": timing.cpu_spread,
        "build_s": timing.build_s,
        "wall_s": timing.wall_s,
        "repeats": timing.repeats,
        "status": str(solution.status),
    }


def rows_frame(
    rows: Sequence[dict[str, Any]], outcomes: Sequence[Outcome], families: Sequence[str]
) -> pd.DataFrame:
    """Rows as a frame, with the number of all elements and the element whose reference they have."""
    return pd.DataFrame(rows, columns=list(COLUMNS)).assign(
        all_elements=[sum(o.case.mesh) for o in outcomes],
        family=list(families),
    )


def sample_rows(outcome: Outcome) -> list[dict[str, Any]]:
    """The raw time samples of a run."""
    case = outcome.case
    names = ("solver", "element", "quadrature", "integrator")
    about = {"scene": case.scene.name, **{n: getattr(case, n) for n in names}}
    about |= {"elements": mesh_label(case.mesh), "dt": case.dt}
    times = ("cpu_s", "build_s", "wall_s")
    return [{**about, "sample": k, **{t: getattr(c, t) for t in times}} for k, c in enumerate(outcome.costs)]


def label_of(case: Trial) -> str:
    """A run in a few words, for whoever waits for it."""
    mesh = f"{mesh_label(case.mesh)} {case.element}"
    return f"{case.scene.name} · {case.solver} {mesh} {case.integrator}"


def mesh_label(mesh: Mesh) -> str:
    """2/8/2 of (2, 8, 2)."""
    return "/".join(map(str, mesh))


def case_key(case: Trial) -> str:
    """Text that tells a case from every other, with every digit of every number."""
    return _text(case)


def _text(value: Any) -> str:
    """A value with all that makes it, whatever its own representation leaves out."""
    if is_dataclass(value) and not isinstance(value, type):
        parts = (f"{f.name}={_text(getattr(value, f.name))}" for f in fields(value) if f.init)
        return f"{_class(value)}({', '.join(parts)})"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_text(k)}: {_text(v)}' for k, v in value.items())}}}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, set | frozenset):
        return f"{{{', '.join(sorted(map(_text, value)))}}}"
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    try:
        return repr(value)
    except Exception:  # a function of the user's own; such cases are not kept
        return f"{_class(value)} {id(value)}"


def _class(value: Any) -> str:
    return f"{type(value).__module__}.{type(value).__qualname__}"


def _parts(value: Any) -> Iterator[Any]:
    """A value and all that it is made of."""
    yield value
    if is_dataclass(value) and not isinstance(value, type):
        inside: Iterable[Any] = (getattr(value, f.name) for f in fields(value) if f.init)
    elif isinstance(value, Mapping):
        inside = (*value.keys(), *value.values())
    else:
        inside = value if isinstance(value, tuple | list | set | frozenset) else ()
    for part in inside:
        yield from _parts(part)


def classes(value: Any) -> set[str]:
    """Modules of the classes of a value and of its parts: a drive's law is code of its class."""
    return {type(v).__module__ for v in _parts(value) if is_dataclass(v) and not isinstance(v, type)}


def _identity(case: Trial) -> Trial | int:
    """What is equal for equal cases; a case that has no hash, for a function in its scene, equals itself alone."""
    try:
        hash(case)
    except Exception:
        return id(case)
    return case


def reproducible(value: Any) -> bool:
    """Whether a value is told by its text: data only, no plain function, whose text is an address."""
    plain = str | bytes | int | float | complex | np.generic | Mapping | tuple | list | set | frozenset
    return all(
        v is None
        or isinstance(v, plain)
        or (isinstance(v, np.ndarray) and not v.dtype.hasobject)
        or (is_dataclass(v) and not isinstance(v, type))
        for v in _parts(value)
    )


def _contest(case: Trial) -> str:
    """What the cases of one contest share: everything but the solver."""
    return case_key(replace(case, solver=""))


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
