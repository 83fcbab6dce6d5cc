"""Compiling in two processes side by side: a second one compiles some kernels for their callers, this one the rest.

What the second process compiles comes to this one through the files of kernels. So nothing is lost where it cannot be
started, or fails: what is not there is compiled here.
"""

import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from threading import get_ident
from typing import Any

from numba import typeof
from numba.core import config, event

from anctmm.jit.kernels import compile_for_callers

settings: Any = config
#: A kernel and arguments as its caller will have them.
Task = tuple[Any, tuple[Any, ...]]
#: What the second process compiles, and what this one begins with.
Parts = tuple[Sequence[Task], Sequence[Task]]

#: Seconds after which a second process is waited for no longer, and between two looks for what it makes.
PATIENCE, PAUSE = 120.0, 0.01
#: What the second process runs: the same code from the same places.
_PROGRAM = (
    "import pickle, sys; path, name = pickle.load(sys.stdin.buffer); sys.path[:] = path; "
    "import importlib; importlib.import_module(name).serve()"
)


class _Second:
    """A second process and the files that it will make."""

    def __init__(self, process: "subprocess.Popen[bytes]", files: frozenset[Path]) -> None:
        self.process, self.files, self.began = process, files, time.monotonic()

    def wait_for(self, file: Path) -> None:
        """Return once a file is there, or will never be."""
        while not file.exists() and self.process.poll() is None:
            if time.monotonic() - self.began > PATIENCE:
                self.process.kill()
            time.sleep(PAUSE)

    def end(self) -> None:
        """Leave no process behind."""
        self.process.kill()
        self.process.wait()


_running: list[_Second] = []


class _Beginning(event.Listener):  # type: ignore[misc]
    """Starts the second process where this thread begins to compile something."""

    def __init__(self, parts: Callable[[], Parts]) -> None:
        self.parts, self.thread, self.begun = parts, get_ident(), False
        self.second: _Second | None = None

    def on_start(self, event: Any) -> None:
        """A kernel is about to be compiled."""
        if self.begun or get_ident() != self.thread:
            return
        self.begun = True
        aside, here = self.parts()
        self.second = _second(aside)
        if self.second is not None:
            _running.append(self.second)
            for one, args in here:
                compile_for_callers(one, _types(args))

    def on_end(self, event: Any) -> None:
        """It has been compiled; the second process goes on."""

    def end(self) -> None:
        """Leave no process behind."""
        if self.second is not None:
            _running.remove(self.second)
            self.second.end()


@contextmanager
def side_by_side(parts: Callable[[], Parts]) -> Iterator[None]:
    """Compile kernels in a second process while others are compiled in this one, unless they are compiled already.

    Parameters
    ----------
    parts : callable
        Called where something is compiled in the context: (aside, here), parts of what is compiled there, with
        arguments of the types that they are called with: those that the second process compiles, which are kept on
        disk, and those that this one begins with.
    """
    beginning = _Beginning(parts)
    try:
        with event.install_listener("numba:compile", beginning):
            yield
    finally:
        beginning.end()


def _second(aside: Sequence[Task]) -> _Second | None:
    """A second process with kernels to compile; None where there are none, or where it would not help."""
    if settings.DISABLE_JIT or not _worthwhile():
        return None
    try:
        tasks = [(k, types) for k, args in aside if not _known(k, types := _types(args))]
        files = frozenset(k._cache.file_of(types) for k, types in tasks)
        return _Second(_start(tasks), files) if tasks and None not in files else None
    except Exception:  # of whatever kind: then all is compiled here
        return None


def wait_for(file: Path) -> None:
    """Wait for a file that a second process is making, if one is."""
    for second in list(_running):
        if file in second.files:
            second.wait_for(file)


def serve() -> None:
    """In the second process: compile what the first one asks for."""
    for module, name, types in pickle.load(sys.stdin.buffer):
        kernel: Any = import_module(module)
        for part in name.split("."):
            kernel = getattr(kernel, part)
        compile_for_callers(kernel, types)


def _start(tasks: list[tuple[Any, tuple[Any, ...]]]) -> "subprocess.Popen[bytes]":
    """Start a second process and tell it what to do."""
    asked = [(k.py_func.__module__, k.py_func.__qualname__, types) for k, types in tasks]
    told = pickle.dumps((sys.path, __name__)) + pickle.dumps(asked)
    process = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is answered by the first process, which then ends this one
    )
    assert process.stdin is not None
    with suppress(OSError), process.stdin as pipe:  # it may have ended at once
        pipe.write(told)
    return process


def _worthwhile() -> bool:
    """Whether a second process would find a processor that is free, and an interpreter to run."""
    processors, program = _processors(), Path(sys.executable or "").name.lower()
    if not program.startswith("python") or getattr(
        sys, "frozen", False
    ):  # another program, with Python inside
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
    return tuple(map(typeof, arguments))


def _known(kernel: Any, types: tuple[Any, ...]) -> bool:
    """Whether a kernel is compiled for these types, in memory or on disk."""
    if types in kernel.overloads:
        return True
    file = kernel._cache.file_of(types)
    return file is not None and bool(file.exists())
