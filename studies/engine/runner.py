"""Runs of trials: joblib stores each when it is done, and does them in other processes where workers are given."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import cloudpickle
import joblib

from anctmm.results.solution import Cost, Solution
from anctmm.solvers import registry
from anctmm.solvers.registry import Solver
from studies.engine import provenance
from studies.engine.identity import identity
from studies.engine.meshes import StudyError
from studies.engine.timing import in_turn, settled
from studies.engine.trials import Trial, solved

#: Packages whose code computes a run.
COMPUTING = ("anctmm", "reference")
#: Samples of a time, by whether the study is quick.
ROUNDS = {False: 5, True: 1}


def remembered(key: str, compute: Callable[[], bytes]) -> bytes:
    """Answer of a computation, which joblib stores by its key."""
    return compute()


@dataclass
class Runner:
    """Runs trials and stores their solutions."""

    store: Path | None = None  # directory of finished runs
    quick: bool = False  # times are measured once
    workers: int = 1  # processes that compute solutions; times are measured in this one
    cluster: str = ""  # address of a dask scheduler, "tcp://host:8786"
    resolve: Callable[[str], Solver] = registry.solver
    show: Callable[[str, int, int], None] = lambda label, done, total: None
    heading: str = ""  # purpose of the runs, before their labels
    computed: int = 0  # runs of this session

    def __post_init__(self) -> None:
        if self.workers > 1 and self.cluster:
            both = f"--workers is {self.workers} beside --cluster {self.cluster!r}"
            raise StudyError(f"{both}; one of them is allowed")
        self._origins = dict(registry.origins())
        self._remembered = joblib.Memory(self.store, verbose=0).cache(remembered, ignore=["compute"])

    def solve(self, trial: Trial) -> Solution:
        """One trial."""
        return self.solve_many([trial])[0]

    def solve_many(self, trials: Iterable[Trial]) -> list[Solution]:
        """Solutions of trials, in their order; equal ones are computed once, stored ones not at all."""
        trials = list(trials)
        keys = [self.key(trial) or k for k, trial in enumerate(trials)]  # what has no identity is not stored
        first = dict(zip(reversed(keys), reversed(trials), strict=True))
        missing = [key for key in dict.fromkeys(keys) if not self._remembered.check_call_in_cache(key, None)]
        found: dict[str | int, Solution] = {}
        for key, solution in zip(missing, self._computed([first[key] for key in missing]), strict=True):
            found[key] = solution
            self._stored(key, partial(replace, solution))
        for key in first.keys() - found.keys():  # joblib computes that of a damaged file anew
            found[key] = self._stored(key, partial(solved, first[key], self.resolve))
        return [replace(found[key], scene=trial.scene) for key, trial in zip(keys, trials, strict=True)]

    def key(self, trial: Trial) -> str:
        """Identity of a run: its scene, setting, solver, versions and sources; empty where there is none."""
        try:
            solver = identity(self.resolve(trial.solver)), self._origins.get(trial.solver, "")
            return identity((trial, solver, provenance.software(), provenance.sources(*COMPUTING)))
        except Exception:  # parts of a user's scene that cannot be identified: the run is not stored
            return ""

    def time_in_turn(self, trials: Sequence[Trial]) -> list[list[Cost]]:
        """Costs of trials in turn on one core of this machine, after a warm-up; a list of samples each.

        The one loop that measures times. Of a run below 0.1 s the second call in a row is timed.
        """
        keys = [self.key(trial) for trial in trials]
        about = ROUNDS[self.quick], provenance.name(), provenance.stamp()
        return self._stored(identity((keys, about)) if all(keys) else 0, lambda: self._timed(trials))  # type: ignore[no-any-return]

    def _timed(self, trials: Sequence[Trial]) -> list[list[Cost]]:
        rounds, places = ROUNDS[self.quick], count(1)

        def sample(trial: Trial) -> Cost:
            self.show(f"{self.heading}times in turn: {trial.label}", next(places), rounds * len(trials))
            solver = self.resolve(trial.solver)
            return settled(lambda: trial.solve(solver).cost)

        for trial in trials:
            trial.warm_up(self.resolve(trial.solver))
        return list(in_turn({k: partial(sample, trial) for k, trial in enumerate(trials)}, rounds).values())

    def _stored(self, key: str | int, compute: Callable[[], Any]) -> Any:
        """What is stored, or else is computed and then stored; without an identity it is computed."""
        if not isinstance(key, str):
            return compute()
        return cloudpickle.loads(self._remembered(key, lambda: cloudpickle.dumps(compute())))

    def _computed(self, trials: Sequence[Trial]) -> Iterator[Solution]:
        """Solutions as they are computed, in their order, here or by workers."""
        if not trials:
            return
        one = nullcontext() if self.workers == 1 else joblib.parallel_config("loky", inner_max_num_threads=1)
        with _dask(self.cluster) if self.cluster else one:
            self.show(f"{self.heading}{trials[0].label}", 0, len(trials))
            parallel = joblib.Parallel(n_jobs=-1 if self.cluster else self.workers, return_as="generator")
            jobs = (joblib.delayed(solved)(trial, self.resolve) for trial in trials)
            for k, solution in enumerate(parallel(jobs), 1):
                self.computed += 1
                yield solution
                self.show(f"{self.heading}{trials[min(k, len(trials) - 1)].label}", k, len(trials))


@contextmanager
def _dask(address: str) -> Iterator[None]:
    """The cluster of a dask scheduler."""
    try:
        from distributed import Client

        # as the default, other uses of dask would need it, too
        client = Client(address, timeout="10s", set_as_default=False)
    except ModuleNotFoundError:
        raise StudyError("--cluster needs distributed: pip install 'anctmm[cluster]'") from None
    except (OSError, ValueError, TimeoutError) as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise StudyError(f"--cluster is {address!r}, which cannot be reached ({why})") from None
    with client, joblib.parallel_config(backend="dask", client=client):
        yield
