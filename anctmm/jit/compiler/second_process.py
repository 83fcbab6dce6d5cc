"""Compilation in two processes at the same time: the second compiles some kernels for their callers, this one the rest.

Both take kernels from one list: this process the next that it needs, the second one the last that is not begun, so that
both work until they meet. Kernels of the second process reach this one through the kernel files, which are locked while
they are written. If the second process cannot be started or fails, nothing is lost: this process compiles what is
missing.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from threading import get_ident
from typing import Any, NamedTuple

from anctmm.jit.files.one_compiler import is_taken


class Task(NamedTuple):
    """A kernel to be compiled.

    Parameters
    ----------
    kernel : Kernel
    arguments : tuple
        Of the types that it is called with.
    by_python : bool
        Whether Python calls it; else other kernels do.
    """

    kernel: Any
    arguments: tuple[Any, ...]
    by_python: bool = False


class Parts(NamedTuple):
    """What two processes compile.

    Parameters
    ----------
    shared : sequence of Task
        What either of them compiles, in the order in which this process reaches it.
    here : callable
        What this process compiles before what it reaches first; called when the second one has begun.
    """

    shared: Sequence[Task]
    here: Callable[[], Sequence[Task]] = tuple


#: Seconds that this process waits for one kernel of the second one, which takes 10 s on a free processor; then it
#: compiles for itself.
PATIENCE = 30.0
#: What the second process runs: the same code from the same places.
_PROGRAM = (
    "import pickle, sys; sys.path[:], name = pickle.load(sys.stdin.buffer); "
    "import importlib; importlib.import_module(name).serve()"
)


class _Beginning:
    """Starts the second process where this thread is about to compile something."""

    def __init__(self, parts: Callable[[], Parts]) -> None:
        self.parts, self.thread, self.begun = parts, get_ident(), False
        self.second: subprocess.Popen[bytes] | None = None

    def begin(self) -> None:
        """A kernel is about to be compiled: this process begins with its own part."""
        if self.begun or get_ident() != self.thread:
            return
        self.begun = True
        self.second = _start()  # it loads the compiler while what there is to do is found here
        if self.second is None:
            return
        parts = self.parts()
        if not _tell(self.second, parts.shared):
            self.end()
            return
        for task in parts.here():
            _compile(task.kernel, _types(task.arguments), task.by_python)

    def end(self) -> None:
        """Leave no process behind."""
        if self.second is not None:
            self.second.kill()
            self.second.wait()
            assert self.second.stdin is not None
            with suppress(OSError):
                self.second.stdin.close()


_open: list[_Beginning] = []
#: Threads that are in `one_process`.
_alone: list[int] = []


@contextmanager
def side_by_side(parts: Callable[[], Parts]) -> Iterator[None]:
    """Compile kernels in a second process while others are compiled in this one, unless they are compiled already.

    Parameters
    ----------
    parts : callable
        Called where something is compiled in the context: parts of what is compiled there, with arguments of the types
        that they are called with.
    """
    beginning = _Beginning(parts)
    _open.append(beginning)
    try:
        yield
    finally:
        _open.remove(beginning)
        beginning.end()


@contextmanager
def one_process() -> Iterator[None]:
    """In the context this thread begins no second process: the other processor has work of its own."""
    thread = get_ident()
    _alone.append(thread)
    try:
        yield
    finally:
        _alone.remove(thread)


def about_to_compile() -> None:
    """Begin the second process, if this thread may have one."""
    if get_ident() in _alone:
        return
    for beginning in list(_open):
        beginning.begin()


def waited(seconds: float) -> None:
    """End the second processes of this thread if one kernel has been waited for that long: they may be stopped."""
    if seconds > PATIENCE:
        for beginning in list(_open):
            if beginning.thread == get_ident():
                beginning.end()


def _start() -> "subprocess.Popen[bytes] | None":
    """A second process, which waits for work; None if it would not help or cannot be started."""
    from numba.core import config

    settings: Any = config
    if settings.DISABLE_JIT or not _worthwhile():
        return None
    try:
        second = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is answered by the first process, which then ends this one
        )
    except Exception:  # of whatever kind: then all is compiled here
        return None
    _write(second, pickle.dumps((sys.path, __name__)))
    return second


def _tell(second: "subprocess.Popen[bytes]", shared: Sequence[Task]) -> bool:
    """Tell a second process which kernels to compile; whether there are any, and it can keep them."""
    try:
        typed = [(task, _types(task.arguments)) for task in shared]
        unknown = [(task, types) for task, types in typed if not _known(task.kernel, types)]
        if not unknown or any(task.kernel._cache.file_of(types) is None for task, types in unknown):
            return False
        functions = [(task.kernel.py_func, types, task.by_python) for task, types in unknown]
        asked = [(f.__module__, f.__qualname__, types, by_python) for f, types, by_python in functions]
        told = pickle.dumps(asked)
    except Exception:
        return False
    _write(second, told)
    return True


def _write(second: "subprocess.Popen[bytes]", told: bytes) -> None:
    assert second.stdin is not None
    with suppress(OSError):  # it may have ended at once
        second.stdin.write(told)
        second.stdin.flush()


def serve() -> None:
    """In the second process: compile what the first one requests, except what that one is compiling."""
    import_module("anctmm.jit.compiler.kernels")  # the compiler, while the first one finds what to ask for
    for module, name, types, by_python in reversed(pickle.load(sys.stdin.buffer)):
        kernel: Any = import_module(module)
        for part in name.split("."):
            kernel = getattr(kernel, part)
        if not is_taken(kernel._cache.file_of(types)):
            _compile(kernel, types, by_python)


def _compile(kernel: Any, types: tuple[Any, ...], by_python: bool) -> None:
    from anctmm.jit.compiler.kernels import compile_for_callers

    if by_python:
        kernel.compile(types)
    else:
        compile_for_callers(kernel, types)


def _worthwhile() -> bool:
    """Whether a second process would find a processor that is free, and an interpreter to run."""
    processors, program = _processors(), Path(sys.executable or "").name.lower()
    inside_another = not program.startswith("python") or getattr(sys, "frozen", False)
    if inside_another:
        return False
    with suppress(OSError, AttributeError):
        return processors > 1 and os.getloadavg()[0] < processors
    return processors > 1


@lru_cache
def _processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _types(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    from numba import typeof

    return tuple(map(typeof, arguments))


def _known(kernel: Any, types: tuple[Any, ...]) -> bool:
    """Whether a kernel is compiled for these types, in memory or on disk."""
    if types in kernel.overloads:
        return True
    file = kernel._cache.file_of(types)
    return file is not None and bool(file.exists())
