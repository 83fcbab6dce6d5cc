"""A lock for compilation: one process compiles a kernel, and others that need it at the same time wait for its file.

Processes lock a file beside that of the kernel; the lock disappears when its process ends. If files cannot be locked,
each process compiles on its own. There is no deadlock: a process that holds a kernel's lock waits only for kernels that
this kernel calls.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None

#: Of a file that is locked.
LOCK = ".lock"
#: Seconds after which a process that compiles is waited for no longer, and between two looks.
PATIENCE, PAUSE = 120.0, 0.02


@contextmanager
def alone(file: Path | None, waited: Callable[[float], None] = lambda seconds: None) -> Iterator[None]:
    """In the context no other process makes a file; entered once it is there, or nobody else makes it.

    Parameters
    ----------
    file : Path or None
        None where nothing is kept.
    waited : callable
        Told at each look how long another process has been waited for, s.
    """
    if file is None or fcntl is None or file.exists():
        yield
        return
    lock = file.with_name(file.name + LOCK)
    try:
        handle = lock.open("wb")
    except OSError:  # the directory is gone, or cannot be written: nothing is kept there
        yield
        return
    with handle:
        mine = _locked(fcntl, handle.fileno(), file, waited)
        try:
            yield
        finally:
            if mine:  # whoever holds a lock of the file that is removed here finds the kernel
                with suppress(OSError):
                    lock.unlink()


def is_taken(file: Path | None) -> bool:
    """Whether a file is there, or another process is making it."""
    if file is None or fcntl is None:
        return False
    if file.exists():
        return True
    try:
        with file.with_name(file.name + LOCK).open("rb") as handle:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # nobody has locked it
        return False
    return False


def _locked(system: ModuleType, handle: int, file: Path, waited: Callable[[float], None]) -> bool:
    """Wait until a lock is had, True, or none is needed or to be had."""
    began = time.monotonic()
    while not file.exists() and time.monotonic() - began < PATIENCE:
        try:
            system.flock(handle, system.LOCK_EX | system.LOCK_NB)
        except BlockingIOError:
            waited(time.monotonic() - began)
            time.sleep(PAUSE)
        except OSError:  # of a file system without locks
            return False
        else:
            return True
    return False
