"""Decorators of the compiled solver's functions: numba's, stored beside the kernels of the package.

numba does not see a change in another file than that of a kernel, so the directory is named by a hash of the sources of
these kernels, too.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from anctmm.kernels import options

#: Modules with kernels.
SOURCES = ("elements.py", "factors.py", "kernels.py", "steps.py")
_sources = b"".join(Path(__file__).with_name(name).read_bytes() for name in SOURCES)
DIRECTORY = f"{options.DIRECTORY}-{hashlib.sha256(_sources).hexdigest()[:16]}"


def kernel(function: Callable[..., Any], memory: bool = False) -> Any:
    """Compile a function on its first call, and store it on disk; `memory`: whether it may take memory."""
    settings: Any = numba.config
    before, settings.CACHE_DIR = settings.CACHE_DIR, DIRECTORY
    try:
        return numba.njit(function, cache=True, **options.OPTIONS | {"_nrt": memory})
    finally:
        settings.CACHE_DIR = before


def inlined(function: Callable[..., Any]) -> Any:
    """Make a function part of the kernels that call it: it is compiled with them."""
    return numba.njit(function, inline="always", **options.OPTIONS)
