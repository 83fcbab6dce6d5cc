"""Telling the user what is compiled and how long it took, and compiling with fewer interruptions of Python's own.

The compiler reports when it begins and ends; a run whose kernels are found on disk pays for nothing here.
"""

import atexit
import gc
import sys
import threading
import time
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from numba.core import event

#: Seconds of compiling in all before anything is said.
PATIENCE = 1.5
#: New objects that make Python look for garbage while kernels are compiled, some 30 MB of them: the compiler makes many
#: objects that live on, and going through them again and again takes a tenth of its time.
GARBAGE = 100_000


@dataclass
class Compiling(event.Listener):  # type: ignore[misc]
    """What this process has compiled.

    Parameters
    ----------
    seconds, cpu_seconds : float
        Wall and processor time spent by the compiler until now.
    kernels : int
        Compiled for somebody who called them; those that they call are not counted.
    """

    seconds: float = 0.0
    cpu_seconds: float = 0.0
    kernels: int = 0
    _depth: int = 0
    _began: tuple[float, float] = (0.0, 0.0)
    _often: tuple[int, int, int] = (0, 0, 0)
    _timer: threading.Timer | None = None
    _said: threading.Event = field(default_factory=threading.Event)

    def on_start(self, event: Any) -> None:
        """A kernel is about to be compiled, maybe while another one is."""
        self._depth += 1
        if self._depth > 1:
            return
        self._began = time.perf_counter(), time.process_time()
        self._often = gc.get_threshold()
        gc.set_threshold(self._often[0] and GARBAGE, *self._often[1:])
        if not self._said.is_set():
            name = event.data["dispatcher"].py_func
            self._timer = threading.Timer(
                max(0.0, PATIENCE - self.seconds), self._say, [f"{name.__module__}.{name.__qualname__}"]
            )
            self._timer.daemon = True
            self._timer.start()

    def on_end(self, event: Any) -> None:
        """A kernel has been compiled, or could not be."""
        self._depth -= 1
        if self._depth > 0:
            return
        gc.set_threshold(*self._often)
        if self._timer is not None:
            self._timer.cancel()
        self.seconds += time.perf_counter() - self._began[0]
        self.cpu_seconds += time.process_time() - self._began[1]
        self.kernels += 1

    def _say(self, name: str) -> None:
        if not self._said.is_set():
            self._said.set()
            sys.stderr.write(
                f"anctmm: compiling {name} and other kernels for this kind of scene; they are kept, and the next run "
                f"starts at once …\n"
            )

    def total(self) -> None:
        """Say at the end of the process what compiling took, if its beginning was said."""
        if self._said.is_set() and sys.stderr is not None:
            what = "1 kernel was" if self.kernels == 1 else f"{self.kernels} kernels were"
            sys.stderr.write(f"anctmm: {what} compiled in {self.seconds:.1f} s\n")


#: Of this process.
compiling = Compiling()


@lru_cache
def announce() -> None:
    """Begin to listen to the compiler."""
    event.register("numba:compile", compiling)
    atexit.register(compiling.total)
