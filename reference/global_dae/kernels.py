"""Decorators of the compiled solver's functions: numba's, stored beside the kernels of the package.

numba does not see a change in another file than that of a kernel, so the directory is named by a hash of these sources,
too.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from anctmm.kernels import options

#: As those of the package's kernels; but functions may take memory.
OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}, "no_cfunc_wrapper": True}
_sources = b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
DIRECTORY = f"{options.DIRECTORY}-{hashlib.sha256(_sources).hexdigest()[:16]}"


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function on its first call, and store it on disk."""
    settings: Any = numba.config
    before, settings.CACHE_DIR = settings.CACHE_DIR, DIRECTORY
    try:
        return numba.njit(function, cache=True, **OPTIONS)
    finally:
        settings.CACHE_DIR = before


def inlined(function: Callable[..., Any]) -> Any:
    """Make a function part of the kernels that call it: it is compiled with them."""
    return numba.njit(function, inline="always", **OPTIONS)
