"""Kernels run by Python instead of the compiler: for a few steps of a few elements this is faster than compiling.

The arithmetic is the same, except for multiplications and additions that the compiler fuses: results differ by
rounding.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache, wraps
from threading import local
from typing import Any


class _Mode:
    """Whether kernels that Python calls are run by Python."""

    def __init__(self) -> None:
        self.on = False


class _Here(local):
    """The same of one thread."""

    on = False


mode, here = _Mode(), _Here()


@contextmanager
def interpreted() -> Iterator[None]:
    """In the context kernels are run by Python, in all threads."""
    before, mode.on = mode.on, True
    try:
        yield
    finally:
        mode.on = before


@lru_cache
def by_python(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function that a kernel is made of, run by Python with all kernels that it calls, in this thread alone."""

    @wraps(function)
    def call(*args: Any, **kws: Any) -> Any:
        before, here.on = here.on, True
        try:
            return function(*args, **kws)
        finally:
            here.on = before

    call.py_func = call  # type: ignore[attr-defined]
    return call
