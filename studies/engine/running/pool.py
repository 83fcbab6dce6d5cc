"""Worker processes on this machine as an executor. If one dies, only its current call is lost.

The executor of the standard library gives up all calls when one of its processes dies. Here each process has a thread
that passes it one call at a time, and starts another process to replace it. The processes are new interpreters: they
need no `if __name__ == "__main__"` in the calling script, and share no thread and no lock with it.
"""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from typing import IO, Any

from anctmm.jit.announcing import compiling
from anctmm.jit.compiler.second_process import one_process
from studies.engine.running.processes import Lost

#: What a process runs: the same code from the same places.
_PROGRAM = (
    "import os, pickle, sys; calls = os.fdopen(os.dup(0), 'rb'); path, name = pickle.load(calls); sys.path[:] = path; "
    "import importlib; importlib.import_module(name).serve(calls)"
)
#: s, between two looks of a process for who began it.
_LOOK = 1.0
#: As it is before a run, in which it is refused.
_leave = os._exit


class WorkerDied(Exception):
    """A worker process ended before it had answered; the message says how."""


class WorkerPool(Executor):
    """So many processes, each begun when it is first needed.

    Parameters
    ----------
    workers : int
    """

    def __init__(self, workers: int) -> None:
        compiling.together()
        self.workers = workers
        self._threads = ThreadPoolExecutor(workers, "anctmm-worker")
        self._of_thread = threading.local()
        self._processes: set[subprocess.Popen[bytes]] = set()
        self._closing = threading.Event()

    @property
    def processes(self) -> tuple[int, ...]:
        """Numbers of the processes that are there."""
        return tuple(p.pid for p in list(self._processes) if p.poll() is None)

    def submit(self, call: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """Have a call done by the next process that is free; the future raises `WorkerDied` if that dies."""
        return self._threads.submit(self._done_by_process, pickle.dumps((call, args, kwargs)))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes: at once with `cancel_futures`, or else when the submitted calls are done."""
        if cancel_futures:
            self._closing.set()
            self._end()
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        self._closing.set()
        for process in list(self._processes):
            self._forget(process)

    def _end(self) -> None:
        for process in list(self._processes):
            process.kill()
            process.wait()

    def _forget(self, process: Any) -> int:
        """Leave nothing of a process, which has closed its pipes if it has not ended; how it ended."""
        with suppress(ProcessLookupError):
            process.kill()
        code = process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):  # what nobody will read
                pipe.close()
        self._processes.discard(process)
        return int(code)

    def _done_by_process(self, call: bytes) -> Any:
        process = self._process()
        try:
            process.stdin.write(call)
            process.stdin.flush()
            well, found = pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError) as error:
            del self._of_thread.process
            raise WorkerDied(str(Lost(self._forget(process)))) from error
        if not well:
            raise found
        return found

    def _process(self) -> Any:
        """This thread's process."""
        process = getattr(self._of_thread, "process", None)
        if process is None:
            if self._closing.is_set():
                raise WorkerDied("the workers were ended")
            process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C is answered by who began it, which then ends it
            )  # fmt: skip
            self._of_thread.process = process
            self._processes.add(process)
            assert process.stdin is not None
            with suppress(OSError):  # it may have ended at once, which the next call reports
                process.stdin.write(pickle.dumps((sys.path, __name__)) + pickle.dumps(compiling.place))
        return process


def in_new_process(call: Callable[..., Any], *args: Any) -> Any:
    """Have a call done in a new interpreter: a copy of this process would have its code, and all that it holds."""
    with WorkerPool(1) as pool:
        return pool.submit(call, *args).result()


def serve(calls: IO[bytes]) -> None:
    """In a worker process: answer calls until the main process is gone."""
    answers = _private_stream()
    compiling.place = pickle.load(calls)  # it reports together with the main process
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with one_process(), suppress(EOFError, BrokenPipeError):  # the other processors have work of their own
        while True:
            call, args, kwargs = pickle.load(calls)
            pickle.dump(_answered(call, args, kwargs), answers)
            answers.flush()


def _answered(call: Callable[..., Any], args: Any, kwargs: Any) -> tuple[bool, Any]:
    """Whether a call went well, and what it returned or raised."""
    try:
        return True, call(*args, **kwargs)
    except BaseException as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # errors of others may not be what pickle takes them for
            return False, RuntimeError(f"{type(error).__name__}: {error}")
        return False, error


def _private_stream() -> IO[bytes]:
    """The pipe to the main process; prints of solvers go to standard error, and their standard input is empty."""
    answers = os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "rb") as empty:
        os.dup2(empty.fileno(), 0)
    os.dup2(2, 1)
    return answers


def _end_with(parent: int) -> None:
    """End this process when the one that began it has ended, even in the middle of a run."""
    while os.getppid() == parent:
        time.sleep(_LOOK)
    _leave(1)
