"""Batches of steps for each call of a kernel: long enough that calls cost nothing, short enough for an interruption.

Python handles Ctrl-C between two calls of compiled code, not within one.
"""

import time
from collections.abc import Callable, Iterator
from typing import TypeVar

E = TypeVar("E", bound=Exception)

#: Seconds that a call should take, and the first one, whose work is only estimated.
CALL, FIRST = 0.2, 0.05
#: Times that a call may be larger than the one before.
GROWTH = 16
#: Numbers in the tables made for one call: a bound of the memory that long runs take.
TABLE = 100_000


def part_by_part(
    one: Callable[[int, int], object], begin: int, end: int, error: type[E]
) -> tuple[int, E | None]:
    """Take the steps of a range in which an exception was raised, up to the one that raises it.

    Parameters
    ----------
    one : callable
        Takes the steps of a range, or raises before it has taken any.
    begin, end : int
        Steps begin … end − 1.
    error : type
        Of the exception.

    Returns
    -------
    (int, Exception or None)
        The step that could not be taken, and what it raises; `end` and None if all could.
    """
    while begin < end:
        middle = begin + max(1, (end - begin) // 2)
        try:
            one(begin, middle)
        except error as raised:
            if middle == begin + 1:
                return begin, raised
            end = middle
        else:
            begin = middle
    return end, None


def paced(steps: int, seconds: float, width: int = 0) -> Iterator[tuple[int, int]]:
    """Ranges of steps, each sized by what the one before took, that together make 0 … steps − 1.

    Parameters
    ----------
    steps : int
    seconds : float
        What a step takes, about.
    width : int
        Numbers tabulated for each step.
    """
    most = max(1, TABLE // (1 + width))
    count, begin = min(max(1, int(FIRST / seconds)), most), 0
    while begin < steps:
        end = min(begin + count, steps)
        started = time.perf_counter()
        yield begin, end
        took = max(time.perf_counter() - started, 1e-9)
        count = max(1, min(int(count * min(CALL / took, GROWTH)), most))
        begin = end
