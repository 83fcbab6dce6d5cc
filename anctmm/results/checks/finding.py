"""A finding of a check against a run."""

from typing import NamedTuple

import numpy as np

from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution

#: Codes after which the history from the output on is none of the scene: it is cut there.
FATAL = ("diverged", "failed")


class Finding(NamedTuple):
    """What speaks against a run, from the number of an output on.

    The code is that of the status: "diverged" and "failed" cut the history before the output; "inaccurate" and
    "imprecise" leave it whole. The message says why, and what to try; "{when}" stands for the time.
    """

    output: int
    code: str
    message: str
    body: str | None = None
    element: int | None = None


def most_stretched(solution: Solution, k: int) -> tuple[str | None, int | None]:
    """Body and element with the largest gradient at an output."""
    found: tuple[float, str | None, int | None] = -1.0, None, None
    for name, field in solution.fields.items():
        if isinstance(field, HermiteField):
            sizes = np.abs(field.coordinates[k, :, 1:]).max(axis=(1, 2))
            found = max(found, (float(sizes.max()), name, min(int(sizes.argmax()), len(sizes) - 2)))
    return found[1:]


def part(body: str, element: int | None) -> str:
    """An element of a body, or a body without elements, in words, for a message."""
    return f"body {body!r}" if element is None else f"element {element} of body {body!r}"
