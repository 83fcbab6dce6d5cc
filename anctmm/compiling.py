"""How kernels are compiled and cached.

Numba notices a change of the file a kernel stands in, not of the kernels it calls from other files. So the cache
lies in a directory named after a hash of all sources of this package: a stale kernel cannot be found.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config as _config

config: Any = _config
#: Fused multiply-add may be used; nothing else is reordered, and NaN and infinity keep their meaning.
FASTMATH = {"contract"}


def source_digest(root: Path) -> str:
    """Hash of all Python sources below a directory."""
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_directory() -> Path:
    """Where compiled kernels of this very source tree are kept; ANCTMM_CACHE or the user's cache directory."""
    base = os.environ.get("ANCTMM_CACHE") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    directory = Path(base) / "anctmm" / f"kernels-{source_digest(Path(__file__).parent)}"
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError:  # no writable home: kernels then live as long as the machine's temporary files
        directory = Path(tempfile.gettempdir()) / "anctmm" / directory.name
        directory.mkdir(parents=True, exist_ok=True)
    return directory


_DIRECTORY = str(cache_directory())


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function in nopython mode on first use, cached on disk."""
    previous = config.CACHE_DIR
    config.CACHE_DIR = _DIRECTORY
    try:
        return numba.njit(function, cache=True, fastmath=FASTMATH, error_model="numpy")
    finally:
        config.CACHE_DIR = previous


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a small function that its callers absorb."""
    return numba.njit(function, fastmath=FASTMATH, error_model="numpy", forceinline=True)
