"""Work of a worker, in a process or on another machine: a call and its answer, as bytes.

A call, usually a run, arrives as bytes, and its answer is returned in the format of the store, without the scene.
Before a worker reads the call, it checks that its code equals that of the sender: an answer is stored under the code
that computed it.
"""

import hashlib
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import cloudpickle
from filelock import FileLock
from threadpoolctl import threadpool_limits

from anctmm.jit.files.cache_dir import kept_in
from anctmm.results.export.plain_data import NotPlain, decode, encode
from anctmm.results.solution import Cost, Solution
from anctmm.solvers import registry
from anctmm.solvers.foreign_code import contained
from studies.engine.running.own_code import own_modules
from studies.engine.running.trial import Trial, guarded, performed
from studies.engine.running.turns import Interval, Turns, at_work
from studies.engine.storage import provenance
from studies.engine.storage.sources import Sources

#: A name to a solver; None is the registry of installed solvers.
Resolve = Callable[[str], Any] | None


class OtherCode(Exception):
    """A worker's code differs from that of the main process."""


class NotSendable(Exception):
    """A call, or its answer, cannot be converted to bytes: the main process computes it."""


@dataclass(frozen=True)
class Errand:
    """A call as it is sent.

    Parameters
    ----------
    content : bytes
        Of a function without arguments and of what its answer need not hold, as who asks has it. The function returns
        the answer and whether it may be kept: what the environment made fail may go well later.
    software : str
        Versions that the worker must have.
    code : mapping of str to str
        Modules, and the hash of their source that the worker must have.
    turns : str
        Name of the turns that runs of the same store take on each machine.
    """

    content: bytes
    software: str
    code: Mapping[str, str]
    turns: str


@dataclass(frozen=True)
class Answer:
    """What comes back.

    Parameters
    ----------
    content : bytes
        As the store keeps it.
    kept : bool
        Whether it may be kept.
    interval : Interval
        When the worker was at it.
    """

    content: bytes
    kept: bool
    interval: Interval

    def result(self) -> Any:
        """Of a job: what it returned; raises what it raised."""
        value = decode(self.content)
        if not self.kept:
            raise cloudpickle.loads(value)
        return value


def packed_run(case: Trial, resolve: Resolve) -> bytes:
    """A run as bytes.

    Raises
    ------
    NotSendable
        If it holds what cannot be made bytes.
    """
    return _packed(partial(_solution, case, resolve), [case.scene], [case, resolve])


def packed_job(compute: Callable[[], Any]) -> bytes:
    """A computation as bytes; its answer is its result, or the error that it raised as bytes, which is not kept.

    Raises
    ------
    NotSendable
        If it holds what cannot be made bytes.
    """
    return _packed(partial(_result, compute), [], [compute])


def _packed(call: Callable[[], tuple[Any, bool]], given: list[Any], made_of: list[Any]) -> bytes:
    """A call as bytes. Code of the user's own, which a worker may not find, goes along."""
    own = [sys.modules[name] for name in own_modules(made_of)]
    for module in own:
        cloudpickle.register_pickle_by_value(module)
    try:
        return bytes(cloudpickle.dumps((call, given)))
    except Exception as error:  # whatever objects of others raise
        raise NotSendable(f"{type(error).__name__}: {error}") from error
    finally:
        for module in own:
            cloudpickle.unregister_pickle_by_value(module)


def work(errand: Errand) -> Answer:
    """Do a call: one at a time in a process, with no run of the store timed on this machine.

    Raises
    ------
    OtherCode
        If this worker's code would give the answer of another.
    NotSendable
        If the answer is more than data.
    """
    _check(errand)
    with _one_at_a_time, at_work() as interval:
        call, given = cloudpickle.loads(errand.content)
        with _turns(errand.turns).together():
            value, kept = call()
    try:
        return Answer(encode(value, given), kept, interval)
    except NotPlain as error:
        raise NotSendable(str(error)) from error


def without_times(solution: Solution) -> Solution:
    """A solution with the work that it took, counted, but no times: they are another's, or were disturbed."""
    blank, cost = Cost(), solution.cost
    times = {name: getattr(blank, name) for name in ("cpu_s", "wall_s", "build_s", "compile_s")}
    return replace(solution, cost=replace(cost, **times))


def _solution(case: Trial, resolve: Resolve) -> tuple[Solution, bool]:
    """The solution of a run, without times, and whether it may be kept."""
    done = []

    def solve() -> Solution:
        solver = (resolve or _registered)(case.solver)
        done.append(performed(case, solver, lambda: _warm(case, solver), nullcontext()))
        return done[0]

    return without_times(guarded(case.solver, case.scene, solve)), bool(done)


def _result(compute: Callable[[], Any]) -> tuple[Any, bool]:
    """The result of a computation, or the error that it raised."""
    try:
        with contained(), threadpool_limits(limits=1):
            return compute(), True
    except Exception as error:
        return _error_bytes(error), False


def _error_bytes(error: Exception) -> bytes:
    """An error for the main process to raise; one that cannot be sent is represented by its message."""
    try:
        content = bytes(cloudpickle.dumps(error))
        cloudpickle.loads(content)
    except Exception:
        return bytes(cloudpickle.dumps(RuntimeError(f"{type(error).__name__}: {error}")))
    return content


def _warm(case: Trial, solver: Any) -> None:
    """Compile or load what runs of this kind need: of the processes of one machine one compiles, the others wait."""
    if case.kernels in _ready:
        return
    with _compiling(case):
        case.warm_up(solver)
    _ready.add(case.kernels)


@contextmanager
def _compiling(case: Trial) -> Iterator[None]:
    place = kept_in("kernels")
    if place is None:
        yield
        return
    kind = hashlib.sha256(
        repr((case.element, case.quadrature, case.integrator, case.solver)).encode()
    ).hexdigest()
    with FileLock(place / f"{kind[:16]}.lock"):
        yield


def _check(errand: Errand) -> None:
    here = provenance.software()
    if here != errand.software:
        raise OtherCode(f"it has {here}; {errand.software} is needed")
    for module, digest in errand.code.items():
        if _digest(module) != digest:
            raise OtherCode(f"its source of {module} is another")


@cache
def _registered(name: str) -> Any:
    """The installed solver of a name, looked for once."""
    return registry.solver(name)


@cache
def _digest(module: str) -> str | None:
    return Sources().digest(module)


@cache
def _turns(name: str) -> Turns:
    return Turns(name)


_ready: set[tuple[Any, ...]] = set()
_one_at_a_time = threading.Lock()
