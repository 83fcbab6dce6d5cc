"""Kernels run by Python instead of the compiler: a few steps of a few elements take less time so than compiling.

The arithmetic is the same but for multiplications and additions that the compiler fuses: results differ by rounding.
"""

from collections.abc import Iterator
from contextlib import contextmanager


class _Mode:
    """Whether kernels that Python calls are run by Python."""

    def __init__(self) -> None:
        self.on = False


mode = _Mode()


@contextmanager
def interpreted() -> Iterator[None]:
    """In the context kernels are run by Python, in all threads."""
    before, mode.on = mode.on, True
    try:
        yield
    finally:
        mode.on = before
