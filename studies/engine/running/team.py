"""The workers that compute the errors of a sweep: processes on this machine, or those of a cluster."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from anctmm.errors import AnctmmError
from studies.engine.running.pool import WorkerDied, WorkerPool

#: s, that a cluster may take to answer, and its first worker to be there.
PATIENCE = 10.0


class SweepError(AnctmmError, RuntimeError):
    """Runs cannot be sent to workers: there are none, they cannot be reached, or their code is another."""


@dataclass(frozen=True)
class Team:
    """Workers.

    Parameters
    ----------
    executor : Executor
        Does a call at a time on each.
    size : callable
        How many there are now.
    where : str
        What stands behind their number: "", or " of tcp://…".
    died : tuple of exception classes
        What a future raises whose worker died.
    tries : int
        How often a run is sent before its worker's death is its result.
    """

    executor: Executor
    size: Callable[[], int]
    where: str = ""
    died: tuple[type[BaseException], ...] = (WorkerDied,)
    tries: int = 2

    def __str__(self) -> str:
        count = self.size()
        return f"{count} {'worker' if count == 1 else 'workers'}{self.where}"


@contextmanager
def team(workers: int | None = None, cluster: str | None = None) -> Iterator[Team | None]:
    """Workers for the errors of sweeps; None where all is done in this process.

    Parameters
    ----------
    workers : int, optional
        Processes on this machine; 1 and None: this process.
    cluster : str, optional
        Address of the scheduler of a `dask.distributed` cluster: "tcp://host:8786".

    Raises
    ------
    SweepError
        If both are given, there is no such number, or the cluster cannot be used; the message names it.
    """
    if workers is not None and cluster is not None:
        raise SweepError(f"workers are {workers} beside cluster {cluster!r}; one of them is allowed")
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise SweepError(f"workers are {workers!r}; a whole number from 1 on is needed")
    if cluster is not None:
        with _cluster(cluster) as found:
            yield found
    elif workers is None or workers == 1:
        yield None
    else:
        pool = WorkerPool(workers)
        try:
            yield Team(pool, lambda: workers)
        finally:  # whatever is still at work is wanted no longer
            pool.shutdown(cancel_futures=True)


@contextmanager
def _cluster(address: str) -> Iterator[Team]:
    """The workers of a cluster, which go on when we leave.

    An answer is in its worker's memory for the few milliseconds until it is fetched: a worker that is killed just then
    costs that run, too.
    """
    client, died = _connected(address)
    try:
        yield Team(
            client.get_executor(pure=False), lambda: len(_workers(client)), f" of {address}", died, tries=1
        )
    finally:
        client.close()


def _connected(address: str) -> tuple[Any, tuple[type[BaseException], ...]]:
    """A client of a cluster that has workers, and what says that they died; the scheduler itself tries again."""
    try:
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ImportError as error:
        raise SweepError(
            f"cluster {address!r} needs dask.distributed, which is not installed: pip install 'anctmm[cluster]' "
            f"({error})"
        ) from error
    try:
        client: Any = Client(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # a name that is unknown, nobody there, another protocol
        raise SweepError(
            f"cluster {address!r} cannot be reached: {' '.join(str(error).split()) or type(error).__name__}; "
            "the address of a running dask scheduler is needed, such as tcp://host:8786"
        ) from error
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        client.close()
        raise SweepError(
            f"cluster {address!r} has no workers; at least one is needed: dask worker {address} --nthreads 1"
        ) from error
    return client, (KilledWorker,)


def _workers(client: Any) -> dict[str, Any]:
    """Workers that the scheduler knows now."""
    return client.scheduler_info(n_workers=-1)["workers"]  # type: ignore[no-any-return]
