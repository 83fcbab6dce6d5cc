"""The first call of a kernel: compiled, or loaded from disk, announced if that takes long, and timed."""

import sys
import threading
import time
from dataclasses import dataclass, field
from typing import Any

from anctmm.kernels.options import one_process

#: Seconds of compiling before anything is said.
PATIENCE = 2.0


@dataclass
class Compiling:
    """What this process has compiled.

    Parameters
    ----------
    seconds, cpu_seconds : float
        Wall and processor time of first calls until now.
    """

    seconds: float = 0.0
    cpu_seconds: float = 0.0
    _known: set[tuple[str, Any]] = field(default_factory=set)
    _announced: bool = False

    def first_call(self, kernel: Any, key: Any, *arguments: Any) -> None:
        """Call a kernel so that it is compiled, unless that was done.

        Parameters
        ----------
        kernel : compiled function
        key : hashable
            The same for arguments of the same types.
        *arguments
            With which the kernel does nothing.
        """
        if (kernel.__qualname__, key) in self._known:
            return
        began = time.perf_counter(), time.process_time()
        timer = threading.Timer(PATIENCE, self._announce)
        timer.daemon = True
        timer.start()
        try:
            with one_process():
                kernel(*arguments)
        finally:
            timer.cancel()
        self.seconds += time.perf_counter() - began[0]
        self.cpu_seconds += time.process_time() - began[1]
        self._known.add((kernel.__qualname__, key))

    def _announce(self) -> None:
        if not self._announced and sys.stderr is not None:
            self._announced = True
            sys.stderr.write(
                "anctmm: compiling kernels, once for this machine and version (`anctmm compile` does it beforehand) …\n"
            )


#: Of this process.
compiling = Compiling()
