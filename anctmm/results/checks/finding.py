"""A finding of a check against a run."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution

Array = NDArray[np.float64]

#: Codes after which the history from the output on is none of the scene: it is cut there.
FATAL = ("diverged", "failed")


class Finding(NamedTuple):
    """What speaks against a run.

    Parameters
    ----------
    output : int
        Number of the first output concerned.
    code : str
        Of the status: "diverged" and "failed" cut the history before the output; "inaccurate" and "imprecise" leave
        it whole.
    message : str
        Why, and what to try; "{when}" stands for the time.
    body : str, optional
    element : int, optional
    """

    output: int
    code: str
    message: str
    body: str | None = None
    element: int | None = None


def most_stretched(solution: Solution, k: int) -> tuple[str | None, int | None]:
    """Body and element with the largest gradient at an output."""
    sizes = {
        n: np.abs(f.coordinates[k, :, 1:]).max(axis=(1, 2))
        for n, f in solution.fields.items()
        if isinstance(f, HermiteField)
    }
    if not sizes:
        return None, None
    body = max(sizes, key=lambda n: float(sizes[n].max()))
    return body, min(int(sizes[body].argmax()), len(sizes[body]) - 2)


def part(body: str, element: int | None) -> str:
    """An element of a body, or a body without elements, in words, for a message."""
    return f"body {body!r}" if element is None else f"element {element} of body {body!r}"
