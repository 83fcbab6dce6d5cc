"""How kernels are compiled and cached.

Numba notices a change of the file a kernel stands in, not of the kernels it calls from other files. So the cache
lies in a directory named after a hash of all sources of this package, and of the kernel's own package where that is
another one (a reference has kernels, too): a stale kernel cannot be found.
"""

import gc
import hashlib
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba
from numba.core import config as _config
from numba.core.caching import FunctionCache

from anctmm.jit.cache_dir import kept_in, note

config: Any = _config
#: Fused multiply-add may be used; nothing else is reordered, and NaN and infinity keep their meaning. numba's runtime
#: is left out: what would take memory does not compile, and no reference to an array is counted, which costs some 5 ns
#: each and halved the speed of short chains.
OPTIONS: dict[str, Any] = {
    "fastmath": {"contract"},
    "error_model": "numpy",
    "_nrt": False,
    "no_cfunc_wrapper": True,  # an entry for C that nobody calls
}
#: Options of implementations that the compiler chooses by the types of arguments.
CHOSEN: dict[str, Any] = {"jit_options": OPTIONS, "inline": "always"}
#: Kernels found in the cache load faster than this, s.
PATIENCE = 1.5
#: New objects that make Python look for garbage while kernels are compiled: some 30 MB of them.
GARBAGE = 100_000


def source_digest(root: Path) -> str:
    """Hash of all Python sources below a directory."""
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


class Cache(FunctionCache):  # type: ignore[misc]
    """Numba's cache of a function; a broken file is compiled anew, a full disk keeps nothing, neither ends a run."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Machine code of a signature, or None: not there, or not readable."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # whatever unpickling half a file may raise
            note(
                f"the kept kernel {self._name} is not readable ({type(error).__name__}); it is compiled anew"
            )
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep machine code, if the disk has room."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _not_kept(error.strerror or str(error), self.cache_path)


@lru_cache
def _not_kept(reason: str, path: str) -> None:
    """Say once why kernels are not kept."""
    note(f"compiled kernels cannot be kept in {path} ({reason}); the next run compiles them again")


@lru_cache
def cache_directory(package: str) -> Path | None:
    """Where compiled kernels of a top-level package are kept; None where nothing can be."""
    digests = [source_digest(Path(__file__).parents[1])]
    if package != __name__.partition(".")[0] and hasattr(sys.modules.get(package), "__path__"):
        digests += [source_digest(Path(root)) for root in sys.modules[package].__path__]
    return kept_in("-".join(["kernels", *digests]))


def kernel(function: Callable[..., Any], allocates: bool = False) -> Any:
    """Compile a function in nopython mode on first use, cached on disk; only with `allocates` may it take memory."""
    compiled: Any = numba.njit(function, **{**OPTIONS, "_nrt": allocates})
    directory = cache_directory(function.__module__.partition(".")[0])
    if directory is None:
        return compiled
    previous = config.CACHE_DIR
    config.CACHE_DIR = str(directory)
    try:
        compiled._cache = Cache(function)
    finally:
        config.CACHE_DIR = previous
    return compiled


def allocating_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that takes memory: for preparations, not for the steps of a run."""
    return kernel(function, allocates=True)


def inlined(function: Callable[..., Any]) -> Any:
    """Make a function part of the kernels that call it, before types are known: it is never compiled by itself."""
    return numba.njit(function, inline="always", **OPTIONS)


def embedded(function: Callable[..., Any]) -> Any:
    """Make a function part of the kernels that call it, once compiled by itself: quicker, if it is large."""
    return numba.njit(function, forceinline=True, **OPTIONS)


@contextmanager
def announced() -> Iterator[None]:
    """Say on standard error that kernels are being compiled, if what is done here takes longer than PATIENCE.

    Meanwhile Python looks for garbage more rarely: the compiler makes many objects that live on, and going through
    them again and again takes a tenth of its time.
    """
    message = (
        "anctmm: compiling kernels for this kind of scene; they are kept, the next run starts at once …\n"
    )
    timer = threading.Timer(PATIENCE, lambda: sys.stderr.write(message))
    timer.daemon = True
    timer.start()
    often = gc.get_threshold()
    gc.set_threshold(often[0] and GARBAGE, *often[1:])
    try:
        yield
    finally:
        gc.set_threshold(*often)
        timer.cancel()
