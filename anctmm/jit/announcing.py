"""Messages about compilation and its duration, and compilation with fewer interruptions by Python's garbage collector.

The compiler reports when it begins and ends; a run whose kernels are found on disk has no cost here. Processes started
by one process report together: the first that compiles prints the message, and the one that started them prints the
total.
"""

import atexit
import gc
import os
import shutil
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

#: Seconds of compiling in all before anything is said.
PATIENCE = 1.5
#: New objects that make Python look for garbage while kernels are compiled, some 30 MB of them: the compiler makes many
#: objects that live on, and going through them again and again takes a tenth of its time.
GARBAGE = 100_000
#: Files of processes that tell as one: that it has been said that something is compiled; and for each kernel that was
#: compiled by another process than the first, which one and the seconds.
SAID, TOOK = "said", "took"


@dataclass
class Compiling:
    """What this process has compiled.

    Parameters
    ----------
    seconds, cpu_seconds : float
        Wall and processor time spent by the compiler until now.
    kernels : int
        Compiled for somebody who called them; those that they call are not counted.
    place : Path, optional
        Directory that processes use to report together.
    """

    seconds: float = 0.0
    cpu_seconds: float = 0.0
    kernels: int = 0
    place: Path | None = None
    _depth: int = 0
    _began: tuple[float, float] = (0.0, 0.0)
    _often: tuple[int, int, int] = (0, 0, 0)
    _timer: threading.Timer | None = None
    _said: threading.Event = field(default_factory=threading.Event)
    _owner: int | None = None

    def notify(self, event: Any) -> None:
        """What the compiler calls."""
        (self.on_start if event.is_start else self.on_end)(event)

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
        if self.place is not None and self._owner != os.getpid():
            with suppress(OSError), (self.place / TOOK).open("a") as file:
                file.write(f"{os.getpid()} {time.perf_counter() - self._began[0]:.3f}\n")

    def together(self) -> None:
        """Tell as one with copies of this process, and with those that are given `place`, made from now on."""
        if self.place is None:
            with suppress(OSError):  # then each process reports separately
                self.place, self._owner = Path(tempfile.mkdtemp(prefix="anctmm-compiling-")), os.getpid()
                if self._said.is_set():
                    (self.place / SAID).touch()

    def _say(self, name: str) -> None:
        if not self._said.is_set():
            self._said.set()
            if self.place is not None:
                try:
                    (self.place / SAID).touch(exist_ok=False)
                except OSError:  # another process has said it
                    return
            sys.stderr.write(
                f"anctmm: compiling {name} and other kernels for this kind of scene; they are stored, and the next run "
                f"starts at once …\n"
            )

    def total(self) -> None:
        """Say at the end of the process what compiling took, if its beginning was said."""
        said, took = self._said.is_set(), [(os.getpid(), self.seconds)] * (self.kernels > 0)
        kernels = self.kernels
        if self.place is not None:
            if self._owner != os.getpid():
                return  # the process that began this one reports
            said |= (self.place / SAID).exists()
            with suppress(OSError):
                lines = [line.split() for line in (self.place / TOOK).read_text().splitlines()]
                took += [(int(process), float(seconds)) for process, seconds in lines]
                kernels += len(lines)
            shutil.rmtree(self.place, ignore_errors=True)
        if said and sys.stderr is not None:
            what = "1 kernel was" if kernels == 1 else f"{kernels} kernels were"
            processes = len({process for process, _ in took})
            by = f", the sum of {processes} processes" if processes > 1 else ""
            sys.stderr.write(f"anctmm: {what} compiled in {sum(s for _, s in took):.1f} s{by}\n")


#: Of this process.
compiling = Compiling()
atexit.register(compiling.total)


@lru_cache
def announce() -> None:
    """Begin to listen to the compiler."""
    from numba.core import event

    event.Listener.register(Compiling)
    event.register("numba:compile", compiling)
