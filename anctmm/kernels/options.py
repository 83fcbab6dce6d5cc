"""The decorator of compiled functions, and the directory where numba stores what it compiles.

numba does not see a change in another file than that of a kernel. The directory is therefore named by a hash of all
sources that kernels consist of and by the versions of Python, numba and this package.
"""

import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np

_settings: Any = numba.config
_njit: Any = numba.njit

#: Integers that kernels give to others; for a literal these would be compiled once more.
NONE, ONE, TWO = map(np.int64, range(3))
#: Packages whose modules hold kernels.
SOURCES = ("kernels", "elements", "elimination", "system", "integrators", "equilibria")
#: NaN and infinity keep their meaning, and sums their order; a product and a sum may be one instruction. Kernels take
#: no memory, so that no reference to an array needs to be counted: that compiles and runs in half of the time.
OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract"},
    "_nrt": False,
    "no_cfunc_wrapper": True,
}


def cache_root() -> Path:
    """Directory of all stored kernels: `ANCTMM_CACHE`, or one in the user's cache directory."""
    given = os.environ.get("ANCTMM_CACHE")
    if given:
        return Path(given)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "anctmm"


def _directory() -> str:
    """Directory of the kernels of these sources and versions."""
    package, digest = Path(__file__).parents[1], hashlib.sha256()
    digest.update(repr((sys.version, numba.__version__, llvmlite.__version__)).encode())
    for room in SOURCES:
        for path in sorted((package / room).rglob("*.py")):
            digest.update(path.read_bytes())
    return str(cache_root() / digest.hexdigest()[:16])


DIRECTORY = _directory()


@contextmanager
def one_process() -> Iterator[None]:
    """Let no other process compile.

    Where two store a function for different types at once, numba may give both the same file, and calls of one crash.
    """
    with ExitStack() as stack:
        with suppress(ImportError, OSError):  # Windows; a directory that cannot be written
            import fcntl

            Path(DIRECTORY).mkdir(parents=True, exist_ok=True)
            lock = stack.enter_context(open(Path(DIRECTORY) / "lock", "w"))
            fcntl.lockf(lock, fcntl.LOCK_EX)  # held by the process: calls within each other do not wait
        yield


@contextmanager
def _stored() -> Iterator[None]:
    """Let numba store what is declared in the directory of these kernels.

    Its setting is restored: functions of the user's own are stored where he wants them.
    """
    before, _settings.CACHE_DIR = _settings.CACHE_DIR, DIRECTORY
    try:
        yield
    finally:
        _settings.CACHE_DIR = before


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function by numba on its first call, and store it on disk."""
    with _stored():
        return _njit(function, cache=True, **OPTIONS)


def part(function: Callable[..., Any]) -> Any:
    """The same for a function that other kernels call, and Python does not."""
    with _stored():
        return _njit(function, cache=True, no_cpython_wrapper=True, **OPTIONS)


def inlined(function: Callable[..., Any]) -> Any:
    """The same for a small function: its machine code becomes part of that of the kernels that call it."""
    with _stored():
        return _njit(function, cache=True, no_cpython_wrapper=True, forceinline=True, **OPTIONS)


def c_function(signature: Any, function: Callable[..., Any]) -> Any:
    """Compile a function for calls by its address, and store it on disk."""
    options = {key: value for key, value in OPTIONS.items() if key != "no_cfunc_wrapper"}
    with _stored():
        return numba.cfunc(signature, cache=True, **options)(function)
