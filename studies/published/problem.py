"""A published number, what solvers here find for it, and the verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, inf, log10

import numpy as np

#: Of the published number: what a digitised curve or a single run of another code may be off by.
DIGITISED = 0.02
#: Digits from which on two numbers are the same except for the last ones.
FEW = 3


@dataclass(frozen=True)
class Value:
    """What a solver finds.

    Parameters
    ----------
    value : float
    uncertainty : float
        Of its discretisation; 0 where the published number is for the same mesh.
    """

    value: float
    uncertainty: float = 0.0


@dataclass(frozen=True)
class Published:
    """One number of a published problem.

    Parameters
    ----------
    problem, quantity, unit : str
    value : float
    uncertainty : float
        What its source leaves open: half of its last digit, or what reading a curve may be off by.
    source : str
    found : mapping of str to Value
        By element or solver; the first one decides.
    needs : str
        What is not there to model it; empty where it is modelled.
    note : str
    """

    problem: str
    quantity: str
    unit: str
    value: float
    uncertainty: float
    source: str
    found: Mapping[str, Value] = field(default_factory=dict)
    needs: str = ""
    note: str = ""

    @property
    def decisive(self) -> Value | None:
        """The value that decides."""
        return next(iter(self.found.values()), None)

    @property
    def digits(self) -> int:
        """Digits in which the published and the found value agree."""
        best = self.decisive
        return 0 if best is None else agreeing(self.value, best.value)

    @property
    def printed(self) -> int:
        """Digits that the published number has."""
        return (
            15
            if self.uncertainty == 0.0
            else max(0, floor(log10(abs(self.value) / (2.0 * self.uncertainty))) + 1)
        )

    @property
    def verdict(self) -> str:
        """In words."""
        best = self.decisive
        if best is None:
            return f"not comparable: {self.needs}"
        apart = abs(best.value - self.value)
        if apart <= self.uncertainty + best.uncertainty:
            return f"confirmed to {_digits(self.digits)}"
        if self.digits >= FEW:
            return f"confirmed to {self.digits} of {_digits(self.printed)}, not beyond"
        return (
            f"contradicted: {apart:.2g} {self.unit} apart, {self.uncertainty + best.uncertainty:.1g} allowed"
        )


def _digits(count: int) -> str:
    return f"{count} digit{'s' if count != 1 else ''}"


def agreeing(one: float, two: float) -> int:
    """Significant digits in which two numbers agree; 15 where all do."""
    size = max(abs(one), abs(two))
    if size == 0.0 or one == two:
        return 15
    return max(0, min(15, floor(-log10(abs(one - two) / size))))


def last_digit(text: str) -> float:
    """Half a unit of the last digit of a number as printed, "3.5160" or "8.09e-4"."""
    mantissa, _, power = text.lower().partition("e")
    places = len(mantissa.partition(".")[2])
    return 0.5 * 10.0 ** (int(power or 0) - places)


def converged(compute: Callable[[int], float], meshes: Sequence[int]) -> Value:
    """Richardson's limit of a value on three or more meshes, each twice the one before.

    The uncertainty is the last change divided by 2^p − 1, p the observed order (at most the change itself).

    Parameters
    ----------
    compute : callable
        Mesh → value.
    meshes : sequence of int

    Returns
    -------
    Value
    """
    values = [compute(mesh) for mesh in meshes]
    before, last = values[-2] - values[-3], values[-1] - values[-2]
    if last == 0.0:
        return Value(values[-1], 4.0 * float(np.spacing(abs(values[-1]))))
    ratio = abs(before / last) if last else inf
    left = last / (ratio - 1.0) if ratio > 2.0 else last
    return Value(values[-1] + (left if ratio > 2.0 else 0.0), abs(left))
