"""Runs cases and stores their results one by one, so that a sweep can be continued after an interruption."""

import inspect
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from anctmm.errors import AnctmmError, reason
from anctmm.jit.compiler.second_process import one_process
from anctmm.jit.files import cache_dir as storage
from anctmm.results.ended_early import nothing
from anctmm.results.export.plain_data import decode
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.solvers.foreign_code import contained
from anctmm.solvers.registry import Solver
from studies.engine.measuring.timing import SHORT
from studies.engine.running.ahead import from_both_ends, kind_of, kinds, warmed_up
from studies.engine.running.case_text import case_key, classes, reproducible
from studies.engine.running.outcomes import Outcome, Sample
from studies.engine.running.spread import Came, Died, Spread, Wanted
from studies.engine.running.team import Team
from studies.engine.running.trial import Trial, guarded, label_of, performed
from studies.engine.running.turns import Interval, Turns, at_work
from studies.engine.running.worker import Answer, Errand, packed_job, packed_run, without_times, work
from studies.engine.storage import provenance
from studies.engine.storage.sources import OURS, Sources, module_of
from studies.engine.storage.store import Store


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
    short : float
        s; of a run that takes less, the second one in a row is timed, so that only its steps are.
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
    team : Team, optional
        Workers that compute solutions side by side; times are measured here afterwards, in turn.
    beside : Executor, optional
        A worker that compiles kernels which a sweep needs, while this process compiles others.
    computed, forgotten : int
        Runs of this session that can be kept, and that cannot: their scenes have functions or classes of the user's.
    spread : list of Interval
        When workers of this session were at a run.
    """

    cache: Path | None
    repeats: int = 3
    budget_s: float = 10.0
    short: float = SHORT
    resolve: Callable[[str], Solver] = registry.solver
    on_done: Callable[[Trial, int, int], None] = lambda case, done, total: None
    note: Callable[[str], None] = storage.note
    heading: str = ""
    on_job: Callable[[str, int, int], None] = lambda label, done, total: None
    on_start: Callable[[str, int, int], None] = lambda label, done, total: None
    team: Team | None = None
    beside: Executor | None = None
    computed: int = 0
    forgotten: int = 0
    spread: list[Interval] = field(default_factory=list)
    _warm: set[tuple[Any, ...]] = field(default_factory=set)
    _prepared: set[tuple[Any, ...]] = field(default_factory=set)
    _sources: Sources = field(default_factory=Sources)
    _unkept: dict[str, tuple[Trial, Solution]] = field(default_factory=dict)
    _solvers: dict[tuple[Any, str], Solver] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._store = Store(self.cache, self.note)
        self._turns = Turns.of(self.cache, self.note)

    def sweep(
        self, cases: Iterable[Trial], budget_s: float | None = None, timed: bool = True
    ) -> list[Outcome]:
        """Run cases and keep what comes of all of them: see `each`.

        Returns
        -------
        list of Outcome
            In the order of the cases, without repetitions.
        """
        found = dict(self.each(cases, budget_s, timed))
        return [found[place] for place in sorted(found)]

    def each(
        self, cases: Iterable[Trial], budget_s: float | None = None, timed: bool = True
    ) -> Iterator[tuple[int, Outcome]]:
        """Run cases, one after the other; those that differ in the solver only take their samples in turn.

        Workers, if there are any, compute the solutions first. Times are measured when none of them is at work.

        Parameters
        ----------
        cases : iterable of Trial
        budget_s : float, optional
            In place of the runner's own.
        timed : bool
            Whether times are wanted, too; without them each solution's cost has NaN in their place, and the only
            samples are of runs that were done here and now.

        Yields
        ------
        int
            Place of the case among the cases without repetitions: contestants come together.
        Outcome

        Raises
        ------
        SweepError
            If the workers cannot do such runs at all.
        """
        ordered = list({_identity(case): case for case in cases}.values())
        self.compute(ordered)
        self.prepare(ordered)
        places = {_identity(case): place for place, case in enumerate(ordered)}
        groups = [list(g) for _, g in groupby(sorted(ordered, key=_contest), key=_contest)]
        done = 0
        for group in groups:
            self.on_start(label_of(group[0]), done, len(ordered))
            for outcome in self._contest(group, self.budget_s if budget_s is None else budget_s, timed):
                done += 1
                self.on_done(outcome.case, done, len(ordered))
                yield places[_identity(outcome.case)], outcome

    def solve(self, case: Trial) -> Outcome:
        """One case, not timed."""
        return self.sweep([case], timed=False)[0]

    def compute(self, cases: Iterable[Trial]) -> None:
        """Have the workers compute solutions that are not stored yet and that a sweep will need.

        Without workers nothing is done. The longest are sent first.

        Raises
        ------
        SweepError
            If the workers cannot do such runs at all.
        """
        if self.team is None:
            return
        keys = {
            text: (case, self._answer_key(case))
            for case in cases
            if (text := case_key(case)) not in self._unkept
        }
        unknown = [(case, key) for case, key in keys.values() if not self._store.has(key)]
        unknown.sort(key=lambda found: -found[0].work)
        waiting = [case for case, _ in unknown]
        wanted = [Wanted(key, partial(self._errand, case)) for case, key in unknown]
        if wanted:
            self.on_start(f"{self.team}: {label_of(waiting[0])}", 0, len(wanted))
        for done, (number, came) in enumerate(Spread(self.team, self._store, wanted), 1):
            case = waiting[number]
            self._take(case, came)
            told = f"{self.team}: {label_of(case)}", done, len(wanted)
            self.on_start(*told)  # it is the next that begins; which one, its worker knows
            self.on_job(*told)

    def prepare(self, cases: Sequence[Trial]) -> None:
        """Compile what runs need that are not known yet, in two processes, before any of them is timed.

        Without a worker beside this process nothing is done.
        """
        if self.beside is None:
            return
        worker = self.beside
        unknown = [case for case in cases if case.kernels not in self._warm]
        unknown = [case for case in unknown if kind_of(case) not in self._prepared]
        new = kinds(case for case in unknown if not self._store.has(self._answer_key(case)))
        if len(new) < 2:
            return
        self._prepared |= set(map(kind_of, new))

        def here(case: Trial) -> None:
            self.on_start(f"compiling for {label_of(case)}", 0, len(cases))
            with self._turns.together(), one_process(), contained():
                case.warm_up(self._solver(case.solver))
            if not case.error_controlled:
                self._warm.add(case.kernels)

        def there(case: Trial) -> None:
            worker.submit(work, self._job_errand(partial(warmed_up, case, self.resolve))).result()

        from_both_ends(new, here, there)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """For times: on one core of this machine, with no other run of whoever uses the same store."""
        with self._turns.alone():
            yield

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
        return self._store.remember(f"{key}|{source}|{provenance.timed_on()}", compute, given)

    def jobs(
        self, jobs: Sequence[tuple[str, Callable[[], Any], Callable[[Exception], Any]]], code: str
    ) -> list[Any]:
        """Results of computations that are no runs of one case each, every one kept when it is done.

        They measure no time: workers, if there are any, do them side by side.

        Parameters
        ----------
        jobs : sequence of (str, callable, callable)
            Label, which tells a job from every other of its module; what computes it; and what takes its place,
            unremembered, if that raises an error of the solvers or of linear algebra.
        code : str
            The `source` of all solvers that the jobs find by name; nothing is kept if it is empty.

        Raises
        ------
        SweepError
            If the workers cannot do such jobs at all.
        """
        keys = [self._job_key(code and f"{label}|{code}", compute) for label, compute, _ in jobs]
        came = self._jobs_by_workers(jobs, keys) or self._jobs_from_both_ends(jobs, keys)
        results = []
        for k, (label, compute, otherwise) in enumerate(jobs):
            self.on_start(label, k, len(jobs))
            try:
                results.append(
                    came[k]() if k in came else self._store.remember(keys[k], self._together(compute))
                )
            except (AnctmmError, np.linalg.LinAlgError) as error:
                results.append(otherwise(error))
            self.on_job(label, k + 1, len(jobs))
        return results

    def _jobs_by_workers(
        self, jobs: Sequence[tuple[str, Callable[[], Any], Any]], keys: Sequence[str]
    ) -> dict[int, Callable[[], Any]]:
        """What came of jobs that no store keeps, by their place: a function that returns the result or raises."""
        if self.team is None:
            return {}
        places = [k for k, key in enumerate(keys) if not self._store.has(key)]
        wanted = [Wanted(keys[k], partial(self._job_errand, jobs[k][1])) for k in places]
        found: dict[int, Callable[[], Any]] = {}
        for done, (number, came) in enumerate(Spread(self.team, self._store, wanted), 1):
            k = places[number]
            told = f"{self.team}: {jobs[k][0]}", done, len(wanted)
            self.on_start(*told)
            match came:
                case Answer():
                    self.computed += 1
                    self.spread.append(came.interval)
                    if not (came.kept and self._store.has(keys[k])):
                        found[k] = came.result
                case Died():
                    found[k] = came.result
                case _:
                    pass  # the store has it, or it is done here
            self.on_job(*told)
        return found

    def _jobs_from_both_ends(
        self, jobs: Sequence[tuple[str, Callable[[], Any], Any]], keys: Sequence[str]
    ) -> dict[int, Callable[[], Any]]:
        """What came of jobs that a worker has done from the last on, while this process did them from the first on.

        What fails is left to be done, and told, as if there were no worker.
        """
        if self.beside is None:
            return {}
        worker, found = self.beside, dict[int, Callable[[], Any]]()

        def here(k: int) -> None:
            self.on_start(jobs[k][0], len(found), len(jobs))
            with one_process():
                value = self._store.remember(keys[k], self._together(jobs[k][1]))
            found[k] = lambda: value

        def there(k: int) -> None:
            answer = worker.submit(work, self._job_errand(jobs[k][1])).result()
            value = self._store.remember(keys[k], answer.result)
            found[k] = lambda: value

        from_both_ends([k for k, key in enumerate(keys) if not self._store.has(key)], here, there)
        return found

    def _job_errand(self, compute: Callable[[], Any]) -> Errand:
        module = module_of(compute)
        digest = self._sources.digest(module) if module.partition(".")[0] in OURS else None
        code = {module: digest} if digest else {}
        return Errand(packed_job(compute), provenance.software(), code, self._turns.name)

    def _job_key(self, key: str, compute: Callable[[], Any]) -> str:
        """Key of a result: the same on every machine; empty where it is not kept."""
        source = self._sources.of(compute)
        return f"{key}|result|{source}|{provenance.software()}" if key and source else ""

    def _together(self, compute: Callable[[], Any]) -> Callable[[], Any]:
        """The same on one thread, as in workers, and while no run is timed on this machine."""

        def computed() -> Any:
            with self._turns.together(), threadpool_limits(limits=1):
                return compute()

        return computed

    def warm_up(self, case: Trial) -> None:
        """Compile and load what a run needs, by a short one; what fails there fails where it is run, too."""
        with suppress(Exception), contained():
            case.warm_up(self._solver(case.solver))

    def attempt(self, case: Trial) -> Solution:
        """Run a case now, unremembered; whatever fails is a solution with that status."""
        return guarded(case.solver, case.scene, lambda: case.solve(self.resolve(case.solver)))

    def key(self, *cases: Trial) -> str:
        """A text that identifies cases, and the source of their solvers and of all that they depend on.

        It is empty if no text identifies a case, as with a function or a class of the user's, or a source
        cannot be found: nothing is then kept.
        """
        parts = []
        for case in cases:
            source = self.source(case.solver, *classes(case))
            if not reproducible(case) or not source:
                return ""
            parts.append(f"{case_key(case)}|{source}")
        return "|".join(parts)

    def source(self, solver: str, *modules: str) -> str:
        """A text that identifies the source of a solver, and of further modules; empty if none is found."""
        try:
            plain = inspect.unwrap(self._solver(solver))
        except Exception as error:  # a solver that cannot be loaded now may be repaired later
            return f"{solver} {type(error).__name__}: {error}"
        digest = self._sources.digest(module_of(plain), *modules)
        return f"{module_of(plain)}.{getattr(plain, '__qualname__', '?')} {digest}" if digest else ""

    def _contest(self, group: Sequence[Trial], budget_s: float, timed: bool) -> Iterator[Outcome]:
        # by place, not by case: what a scene's functions are need not have a hash
        answers = [self._answer(case, timed) for case in group]
        samples = [[fresh] if fresh and found.status.ok else [] for found, fresh in answers]
        for k in range(self.repeats if timed else 0):
            for case, (solution, _), known in zip(group, answers, samples, strict=True):
                if solution.status.ok and len(known) == k and not (known and _spent(known) >= budget_s):
                    known += self._timed(case, k)
        for case, (solution, _), known in zip(group, answers, samples, strict=True):
            if timed and known:
                solution = replace(solution, cost=known[0].cost)
            yield Outcome(case, solution, tuple(known))

    def _answer(self, case: Trial, timed: bool) -> tuple[Solution, Sample | None]:
        """The solution of a case, without times; and what it cost, if it was computed here and now.

        Without `timed` a short run is done once, and what it cost is not kept. A failure of the environment is a
        solution, too, but is not remembered.
        """
        known = self._unkept.get(case_key(case))
        if known is not None:
            return known[1], None
        fresh: list[Sample] = []

        def compute(solver: Solver) -> Solution:
            solution, samples = self._run(case, solver, again=timed)
            fresh.extend(samples)
            if samples and solution.status.ok and (timed or not self._is_short(samples[0])):
                self._timed(case, 0, samples)  # before others find the solution, and look for its time
            return without_times(solution)

        def solution() -> Solution:
            solver = self._solver(case.solver)
            return self._store.remember(self._answer_key(case), lambda: compute(solver), [case.scene])  # type: ignore[no-any-return]

        found = guarded(case.solver, case.scene, solution)
        return found, next(iter(fresh), None)

    def _timed(self, case: Trial, k: int, fresh: Sequence[Sample] = ()) -> list[Sample]:
        """The k-th time of a case on this machine: of a run that was done just now, or else of one that is done now."""

        def measured() -> list[Sample]:
            return list(fresh) or self._run(case, self._solver(case.solver))[1]

        key = self._key_with(case, f"time {k}", provenance.timed_on())
        try:
            with contained():
                return self._store.remember(key, measured)  # type: ignore[no-any-return]
        except Exception as error:  # its solution is known: a time that is not must not end a sweep
            self.note(f"{label_of(case)} could not be timed: {reason(error)}")
            return []

    def _is_short(self, sample: Sample) -> bool:
        """Whether a first call of a setting took so little that its preparations matter."""
        return sample.interval.end - sample.interval.begin < self.short

    def _run(self, case: Trial, solver: Solver, again: bool = True) -> tuple[Solution, list[Sample]]:
        """Run a case here, alone on this machine: the solution, and the sample, none if it did not begin.

        With `again` a short one is done twice in a row, and the second one is the sample.
        """

        def warm() -> None:
            if case.kernels not in self._warm:
                with self._turns.together():
                    case.warm_up(solver)
                self._warm.add(case.kernels)

        def once() -> tuple[Solution, list[Sample]]:
            intervals: list[Interval] = []

            @contextmanager
            def timed() -> Iterator[None]:
                with self._turns.alone(), at_work() as interval:
                    intervals.append(interval)
                    yield

            solution = performed(case, solver, warm, timed())
            return solution, [Sample(solution.cost, interval) for interval in intervals]

        solution, samples = once()
        self._count(case)
        if again and solution.status.ok and samples and self._is_short(samples[0]):
            _, samples = once()
        return solution, samples

    def _count(self, case: Trial) -> None:
        """Count a finished run; separately one that cannot be stored, which an interrupted session reports."""
        if self._answer_key(case):
            self.computed += 1
        else:
            self.forgotten += 1

    def _solver(self, name: str) -> Solver:
        """The solver of a name, looked for once: the registry reads what all installed packages say of themselves."""
        key = self.resolve, name
        if key not in self._solvers:
            self._solvers[key] = self.resolve(name)
        return self._solvers[key]

    def _answer_key(self, case: Trial) -> str:
        """Key of a solution: the same on every machine; empty where it is not kept."""
        return self._key_with(case, "solution", provenance.software())

    def _key_with(self, case: Trial, what: str, where: str) -> str:
        key, source = self.key(case), self._sources.of(performed)
        return f"{key}|{what}|{source}|{where}" if key and source else ""

    def _errand(self, case: Trial) -> Errand:
        """A case as it is sent to a worker, with the code that the worker must have."""
        resolve = None if self.resolve is registry.solver else self.resolve
        modules = [module_of(performed)]
        if resolve is None:
            modules += [module_of(inspect.unwrap(self._solver(case.solver)))]
        code = {module: digest for module in modules if (digest := self._sources.digest(module))}
        return Errand(packed_run(case, resolve), provenance.software(), code, self._turns.name)

    def _take(self, case: Trial, came: Came) -> None:
        """Remember what no store keeps: what has no key, or failed for a reason that may pass."""
        match came:
            case Answer():
                self._count(case)
                self.spread.append(came.interval)
                if not (came.kept and self._store.has(self._answer_key(case))):
                    self._unkept[case_key(case)] = case, decode(came.content, [case.scene])
            case Died():
                status = Status("failed", str(came))
                self._unkept[case_key(case)] = case, nothing(case.solver, case.scene, None, status)
            case _:
                pass  # the store has it, or it is computed here when needed


def _identity(case: Trial) -> Trial | int:
    """What is equal for equal cases; a case that has no hash, for a function in its scene, equals itself alone."""
    try:
        hash(case)
    except Exception:
        return id(case)
    return case


def _contest(case: Trial) -> str:
    """What the cases of one contest share: everything but the solver."""
    return case_key(replace(case, solver=""))


def _spent(samples: Sequence[Sample]) -> float:
    """s, that all samples took."""
    return sum(sample.cost.wall_s for sample in samples)
