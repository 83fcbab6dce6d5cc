"""Estimate of the remaining error from results on several levels of mesh or step (Richardson extrapolation).

If the error is proportional to h^p, results on h and r h differ by d = e (r^p − 1), where e is the remaining error on
h. The order p is observed on three levels, from the ratio of two differences. If it is near the theoretical order, 1.5
d / (r^p − 1) is used, and p never exceeds the theoretical one; else twice the estimate of first order. (The factor of
the grid convergence index, 1.25, Roache 1994, doi:10.1115/1.2910291, was too small where steps excite the highest
frequencies of a scene.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, log, nan

from scipy.optimize import brentq

#: Factor of Richardson's estimate, and of a difference where the order is not that of theory, to so much.
SAFETY, UNSURE, NEAR = 1.5, 2.0, 0.7
#: Orders that are looked for; order of a single number that is believed at most.
LOWEST, HIGHEST, BELIEVED = -30.0, 30.0, 2.0


@dataclass(frozen=True)
class Spacing:
    """Ratio of the finest level to the one before it, and of that to the one before, each above 1."""

    last: float = 2.0
    before: float = 2.0

    def left(self, order: float) -> float:
        """Error of the finest level over its difference to the one before: 1 / (r^p − 1)."""
        return 1.0 / (self.last**order - 1.0)

    def ratio(self, order: float) -> float:
        """The ratio of the difference before to the last one."""
        return float(self.last**order * (self.before**order - 1.0) * self.left(order))

    def order(self, ratio: float) -> float:
        """The order that gives a ratio of two differences; NaN without one."""
        if not self.ratio(LOWEST) < ratio < self.ratio(HIGHEST):
            return nan
        return float(brentq(lambda p: log(self.ratio(p or 1e-9) / ratio), LOWEST, HIGHEST))


@dataclass(frozen=True)
class Part:
    """Part of a run's error that is due to its mesh, or to its step."""

    error: float = 0.0  # with its safety factor; infinite without a complete coarser run
    order: float = nan  # observed
    sure: bool = False  # the order is near that of theory
    spacing: Spacing = Spacing()


def part_of(last: float, before: float, theory: float, spacing: Spacing) -> Part:
    """The part of an error by the differences of the finest run to the one before, and of that to the one before it.

    `before` is NaN where there are two levels only; infinite differences are of runs that are not complete.
    """
    known = 0.0 < last < inf and isfinite(before)
    order = spacing.order(before / last) if known else nan
    sure = abs(order - theory) <= NEAR
    factor = SAFETY * spacing.left(min(order, theory)) if sure else UNSURE * spacing.left(1.0)
    return Part(factor * last, order, sure, spacing)


def left_in(numbers: Sequence[float], part: Part) -> float:
    """Uncertainty of a number from its values on levels from fine to coarse.

    Two differences of one sign show the order at which the number itself converges. It is believed where the order of
    the history is near that of theory; elsewhere the last difference is taken, or that which second order would have
    left of the one before, if that is more: two runs may agree by chance.
    """
    if len(numbers) < 2:
        return 0.0
    spacing = part.spacing
    last = numbers[0] - numbers[1]
    before = numbers[1] - numbers[2] if len(numbers) > 2 else last
    size = max(abs(last), abs(before) / spacing.ratio(BELIEVED))
    if not part.sure:
        return UNSURE * size * spacing.left(1.0)
    regular = last * before > 0.0 and abs(before) >= spacing.ratio(1.0) * abs(last)
    return SAFETY * size * spacing.left(min(spacing.order(before / last), BELIEVED) if regular else 1.0)
