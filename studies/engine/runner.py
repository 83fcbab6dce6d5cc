"""Runs of trials: each is stored when it is done, and done in other processes where workers are given."""

import inspect
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Protocol

import cloudpickle
import joblib

from anctmm.errors import AnctmmError
from anctmm.model.scene import Scene
from anctmm.results.solution import Cost, Solution
from anctmm.solvers import registry
from anctmm.solvers.registry import Solver
from studies.engine import provenance
from studies.engine.identity import identity
from studies.engine.timing import in_turn, settled
from studies.engine.trials import Trial, guarded, solved

#: Packages whose code computes a run.
COMPUTING = ("anctmm", "reference")


class SweepError(AnctmmError, ValueError):
    """Workers or a cluster cannot be used."""


class Shows(Protocol):
    """Shows progress: what is done, how much of it, of how much."""

    def __call__(self, label: str, done: int, total: int) -> None: ...


@dataclass(frozen=True)
class Outcome:
    """A trial and its solution."""

    case: Trial
    solution: Solution


def remembered(key: str, compute: Callable[[], bytes]) -> bytes:
    """Answer of a computation, which joblib stores by its key."""
    return compute()


@dataclass
class Runner:
    """Runs trials and stores their solutions.

    Parameters
    ----------
    store : Path or None
        Directory of finished runs; None: nothing is stored.
    quick : bool
        Whether times are measured once.
    workers : int
        Processes that compute solutions side by side; times are measured in this one.
    cluster : str
        Address of a dask scheduler that does, "tcp://host:8786".
    resolve : callable
        Name → solver.
    show : callable
        Shows progress: (label, number done, number of all).
    heading : str
        Purpose of the runs: stands before their labels.
    computed : int
        Runs of this session.
    """

    store: Path | None = None
    quick: bool = False
    workers: int = 1
    cluster: str = ""
    resolve: Callable[[str], Solver] = registry.solver
    show: Shows = lambda label, done, total: None
    heading: str = ""
    computed: int = 0
    _scenes: dict[int, tuple[Scene, str]] = field(default_factory=dict)
    _codes: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._origins = dict(registry.origins())
        self._remembered = joblib.Memory(self.store, verbose=0).cache(remembered, ignore=["compute"])

    @property
    def rounds(self) -> int:
        """Samples of a time."""
        return 1 if self.quick else 5

    def solve(self, trial: Trial) -> Solution:
        """One trial."""
        return self.solve_many([trial])[0]

    def solve_many(self, trials: Iterable[Trial]) -> list[Solution]:
        """Solutions of trials, in their order."""
        found = dict(self.each(trials))
        return [found[k] for k in sorted(found)]

    def sweep(self, trials: Iterable[Trial], timed: bool = False) -> list[Outcome]:
        """Trials with their solutions, in their order without repetitions."""
        unique = list({self.key(trial) or str(id(trial)): trial for trial in trials}.values())
        return [Outcome(*pair) for pair in zip(unique, self.solve_many(unique), strict=True)]

    def prepare(self, trials: Iterable[Trial]) -> None:
        """Nothing: each run compiles what it needs."""

    def each(self, trials: Iterable[Trial]) -> Iterator[tuple[int, Solution]]:
        """Solutions of trials with their places, stored ones first, others as they come.

        Raises
        ------
        SweepError
            If the cluster cannot be reached.
        """
        trials = list(trials)
        keys = [self.key(trial) for trial in trials]
        places: dict[str, list[int]] = {}
        for k, key in enumerate(keys):
            places.setdefault(key or f"trial {k}", []).append(k)
        unknown = []
        for name, those in places.items():
            if name in keys and self._stored(name):
                yield from self._all(those, trials, self._recall(name, trials[those[0]]))
            else:
                unknown.append(name)
        todo = sorted(unknown, key=lambda name: -trials[places[name][0]].work) if self.spread else unknown
        answers = self._computed([trials[places[name][0]] for name in todo])
        for name, answer in zip(todo, answers, strict=True):
            first = trials[places[name][0]]
            solution = (
                self._recall(name, first, answer) if name in keys else replace(answer, scene=first.scene)
            )
            yield from self._all(places[name], trials, solution)

    @property
    def spread(self) -> bool:
        """Whether other processes compute."""
        return self.workers > 1 or bool(self.cluster)

    def key(self, trial: Trial) -> str:
        """Identity of a run: its scene, setting, solver, versions and sources; empty where there is none."""
        scene = trial.scene
        try:
            if id(scene) not in self._scenes:
                self._scenes[id(scene)] = scene, identity(scene)
            if trial.solver not in self._codes:
                self._codes[trial.solver] = self._code_of(trial.solver)
            solver = self._codes[trial.solver]
            setting = [(f.name, getattr(trial, f.name)) for f in fields(trial) if f.name != "scene"]
            code = self._origins.get(trial.solver, ""), provenance.software(), provenance.sources(*COMPUTING)
            return identity((self._scenes[id(scene)][1], setting, solver, code))
        except Exception:  # parts of a user's scene that cannot be identified: the run is not stored
            return ""

    def _code_of(self, name: str) -> str:
        """Identity of a solver's code: of another package's module its file, of a function that is given its code."""
        solver = self.resolve(name)
        if self.resolve is not registry.solver:
            return identity(solver)
        module = inspect.getmodule(inspect.unwrap(solver))
        file = getattr(module, "__file__", None)
        ours = module is None or module.__name__.partition(".")[0] in COMPUTING
        return "" if ours or file is None else identity(Path(file).read_bytes())

    def time_in_turn(self, trials: Sequence[Trial]) -> list[list[Cost]]:
        """Costs of trials in turn on one core of this machine, after a warm-up; a list of samples each.

        The one loop that measures times. Of a run below 0.1 s the second call in a row is timed.
        """
        total = self.rounds * len(trials)
        done = 0

        def sampler(trial: Trial) -> Callable[[], Cost]:
            solver = self.resolve(trial.solver)

            def sample() -> Cost:
                nonlocal done
                done += 1
                self.show(f"{self.heading}times in turn: {trial.label}", done, total)
                return settled(lambda: guarded(trial.solver, trial.scene, lambda: trial.solve(solver)).cost)

            return sample

        def warm(trial: Trial) -> None:
            with suppress(AnctmmError):
                trial.warm_up(self.resolve(trial.solver))

        def measure() -> bytes:
            calls = {str(k): sampler(trial) for k, trial in enumerate(trials)}
            begin = {str(k): lambda trial=trial: warm(trial) for k, trial in enumerate(trials)}  # type: ignore[misc]
            return cloudpickle.dumps(list(in_turn(calls, self.rounds, begin).values()))

        keys = [self.key(trial) for trial in trials]
        machine = f"{provenance.name()}, {provenance.stamp()}"
        stored = all(keys)
        content = self._remembered(identity((keys, self.rounds, machine)), measure) if stored else measure()
        return cloudpickle.loads(content)  # type: ignore[no-any-return]

    def _all(
        self, places: Sequence[int], trials: Sequence[Trial], solution: Solution
    ) -> Iterator[tuple[int, Solution]]:
        yield from ((k, replace(solution, scene=trials[k].scene)) for k in places)

    def _stored(self, key: str) -> bool:
        return bool(self._remembered.check_call_in_cache(key, None))

    def _recall(self, key: str, trial: Trial, answer: Solution | None = None) -> Solution:
        """A stored solution, or one that is stored now; a damaged file is computed anew."""
        try:
            content = self._remembered(key, lambda: cloudpickle.dumps(answer or solved(trial, self.resolve)))
            return answer or cloudpickle.loads(content)  # type: ignore[no-any-return]
        except (OSError, EOFError, ValueError, AttributeError):
            return answer or solved(trial, self.resolve)

    def _computed(self, trials: Sequence[Trial]) -> Iterator[Solution]:
        """Solutions as they are computed, in their order, here or by workers."""
        if not trials:
            return
        total = len(trials)
        with self._backend():
            jobs = (joblib.delayed(self._one)(trial, k, total) for k, trial in enumerate(trials))
            for k, solution in enumerate(joblib.Parallel(n_jobs=self._jobs, return_as="generator")(jobs), 1):
                self.computed += 1
                self.show(f"{self.heading}{trials[k - 1].label}", k, total)
                yield solution

    @property
    def _one(self) -> Callable[[Trial, int, int], Solution]:
        if self.spread:
            resolve = self.resolve
            return lambda trial, k, total: solved(trial, resolve)

        def here(trial: Trial, k: int, total: int) -> Solution:
            self.show(f"{self.heading}{trial.label}", k, total)
            return solved(trial, self.resolve)

        return here

    @property
    def _jobs(self) -> int:
        return -1 if self.cluster else self.workers

    @contextmanager
    def _backend(self) -> Iterator[None]:
        """Where joblib runs: this process, others of this machine, or a cluster."""
        if not self.cluster:
            with (
                joblib.parallel_config(backend="loky", inner_max_num_threads=1)
                if self.spread
                else nullcontext()
            ):
                yield
            return
        with _client(self.cluster), joblib.parallel_config(backend="dask"):
            yield


@contextmanager
def _client(address: str) -> Iterator[Any]:
    """A client of a dask scheduler."""
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise SweepError("--cluster needs distributed: pip install 'anctmm[cluster]'") from None
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError, TimeoutError) as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise SweepError(f"--cluster is {address!r}, which cannot be reached ({why})") from None
    try:
        yield client
    finally:
        client.close()


def check_workers(workers: int | None, cluster: str | None) -> None:
    """Refuse workers beside a cluster.

    Raises
    ------
    SweepError
    """
    if workers and cluster:
        raise SweepError(f"--workers is {workers} beside --cluster {cluster!r}; one of them is allowed")


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
