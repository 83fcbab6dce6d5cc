"""Prefetching of memory by the processor: long chains are limited by memory, not by arithmetic.

The hardware prefetcher stops at each page of 4 kB, which the factors of nine nodes fill.
"""

from anctmm.jit.deferred import compiled_in

#: Nodes of a chain whose factors do not stay in the cache, and how many nodes ahead they are asked for.
LONG, AHEAD = 2000, 8
#: Length of a line of the cache, numbers.
LINE = 8


def prefetch_row(array, row):  # type: ignore[no-untyped-def]
    """Bring a row of a C-ordered matrix into the cache. Without numba's compiler: nothing."""


def prefetch_columns(array, column):  # type: ignore[no-untyped-def]
    """Bring the numbers of every row of a C-ordered matrix that stand near a column into the cache."""


compiled_in("anctmm.jit.prefetching_code")
