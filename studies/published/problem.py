"""A published number, what solvers here find for it, and the verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, inf, log10
from typing import Literal

import numpy as np

#: Of the published number: what a digitised curve or a single run of another code may be off by.
DIGITISED = 0.02
#: Digits from which on two numbers are the same except for the last ones.
FEW = 3
#: Decimal digits that a double has in any case.
ALL = 15


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

    @property
    def digits(self) -> int:
        """Digits that the uncertainty leaves."""
        return _digits_of(abs(self.value), self.uncertainty)


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
    kind : str
        "printed": a number with so many digits; "exact": a formula, of which each digit is known; "curve": read off.
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
    kind: Literal["printed", "exact", "curve"] = "printed"

    @property
    def decisive(self) -> Value | None:
        """The value that decides."""
        return next(iter(self.found.values()), None)

    @property
    def digits(self) -> int:
        """Digits of the published value that agree with the found one, and that its own uncertainty leaves."""
        best = self.decisive
        if best is None:
            return 0
        if self.as_printed:
            return self.printed
        digits = min(agreeing(self.value, best.value), best.digits)
        return min(digits, self.printed - 1) if self.kind == "printed" else digits

    @property
    def printed(self) -> int:
        """Digits that the published number has."""
        if self.kind == "exact" or self.uncertainty == 0.0:
            return ALL
        return max(0, floor(log10(abs(self.value) / (2.0 * self.uncertainty))) + 1)

    @property
    def as_printed(self) -> bool:
        """Whether the found value, wherever it lies within its own uncertainty, is the printed one when rounded."""
        best = self.decisive
        if best is None or self.kind != "printed" or best.digits < self.printed:
            return False
        return abs(best.value - self.value) + best.uncertainty <= self.uncertainty

    @property
    def verdict(self) -> str:
        """In words."""
        best = self.decisive
        if best is None:
            return f"not comparable: {self.needs}"
        if self.as_printed:
            return f"confirmed as printed ({_counted(self.printed)})"
        apart, allowed = abs(best.value - self.value), self.uncertainty + best.uncertainty
        if apart > allowed and self.digits < FEW:
            return f"contradicted: {apart:.2g} {self.unit} apart, {allowed:.1g} allowed"
        if self.digits == 0:
            return f"undecided: what is found here is uncertain by {best.uncertainty:.1g} {self.unit}"
        beyond = ", not beyond" if apart > allowed else ""
        if self.kind == "printed":
            return f"confirmed to {self.digits} of {_counted(self.printed)}{beyond}"
        within = f", within the {DIGITISED:.0%} of the curve" if self.kind == "curve" and not beyond else ""
        return f"confirmed to {_counted(self.digits)}{within}{beyond}"


def _counted(count: int) -> str:
    return f"{count} digit{'s' if count != 1 else ''}"


def agreeing(one: float, two: float) -> int:
    """Significant digits in which two numbers agree; `ALL` where they are equal."""
    return _digits_of(max(abs(one), abs(two)), abs(one - two))


def _digits_of(size: float, error: float) -> int:
    """Significant digits of a number of this size that an error leaves."""
    if error == 0.0:
        return ALL
    return 0 if error >= size else min(ALL, floor(-log10(error / size)))


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
