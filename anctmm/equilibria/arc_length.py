"""The path of equilibria by its arc length: through limit points of the load, forwards and backwards.

An equilibrium is a point (q, λ) with residual(q, λ) = 0. The path is followed along its tangent t and corrected by
Newton's method in the plane normal to t, so that the load factor λ is an unknown like q (Riks 1979, DOI
10.1016/0020-7683(79)90081-7; Crisfield 1981, DOI 10.1016/0045-7949(81)90108-5). Each correction needs two solves with
K, for the residual and for the load. Arc length combines positions relative to the scene's length and gradients, as
root mean squares over the nodes, and λ.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.equilibria.balance import Balance, Configuration, Tangent
from anctmm.equilibria.load_path import HALF, ROUNDING

Array = NDArray[np.float64]

#: Corrections of one step before it is halved, and their number that a step is made for.
ITERATIONS, AIM = 12, 4
#: A correction larger than this, relative, is out of Newton's reach.
REACH = 0.3
#: Cosine of the angle that the tangent may turn by in a step, and of those between the step and both tangents.
STRAIGHT = 0.94
#: Shortest and longest step.
SHORTEST, LONGEST = 1e-9, 0.25
#: Component of λ in the tangent at which a point counts as a limit point: λ differs from its limit by the square.
LIMIT = 1e-7
#: Distance of λ from the whole load at which that counts as reached.
EXACT = 1e-12
#: Points tried until a limit point, or the whole load, is found.
TRIED = 60


class Point(NamedTuple):
    """An equilibrium of the path.

    Parameters
    ----------
    at : Configuration
    factor : float
        Load factor λ.
    along, more, rise : ndarray, ndarray and float
        The path's tangent: of the unknowns, of the multipliers of rows and of λ.
    limit : bool
        Whether the load factor is a maximum or a minimum of the path here.
    """

    at: Configuration
    factor: float
    along: Array
    more: Array
    rise: float
    limit: bool = False


class ArcPath:
    """The path of equilibria from the undeformed scene on.

    Parameters
    ----------
    balance : Balance
    first : float
        Load factor of the first step.
    """

    def __init__(self, balance: Balance, first: float) -> None:
        self.balance, self.first = balance, first
        #: Newton corrections so far.
        self.iterations = 0

    def points(self) -> Iterator[Point]:
        """Equilibria one after another, limit points among them, until the whole load is reached.

        It ends before where no step is short enough.
        """
        start = self._tangent(self.balance.start, 0.0, None)
        if start is None:
            return
        yield start
        here, step = start, self.first / start.rise
        while True:
            step = min(step, LONGEST)
            new, corrections = self._step(here, step)
            if new is None:
                step *= 0.5
                if step < SHORTEST:
                    return
                continue
            ends = [(step, new)]
            if (new.rise > 0.0) != (here.rise > 0.0):
                ends = [*self._where(lambda p: p.rise, LIMIT, here, new, step), *ends]
            for length, end in ends:
                if here.factor < 1.0 <= end.factor:
                    whole = self._where(lambda p: p.factor - 1.0, EXACT, here, end, length)
                    yield (whole[0][1] if whole else end)._replace(factor=1.0)
                    return
                yield end._replace(limit=end is not new)
            here, step = new, step * float(np.clip(np.sqrt(AIM / corrections), 0.5, 1.5))

    def _step(self, here: Point, length: float) -> tuple[Point | None, int]:
        """The equilibrium a step away, if it is found and the path bends little; Newton corrections."""
        balance = self.balance
        at = balance.moved(here.at, length * here.along, length * here.more)
        factor, last, stalled = here.factor + length * here.rise, np.inf, 0
        for number in range(1, ITERATIONS + 1):
            tangent = Tangent(balance, at, factor)
            (x, more), (y, other) = tangent.correction(), tangent.solve(balance.load_rate(at, factor))
            self.iterations += 1
            change = -self._product(here.along, x) / (self._product(here.along, y) + here.rise)
            x, more = x + change * y, more + change * other
            size = max(balance.sizes(x).max(initial=0.0), abs(change)) if np.isfinite(x).all() else np.inf
            if not size < REACH:
                return None, number
            at, factor = balance.moved(at, x, more), factor + change
            stalled = stalled + 1 if size > 0.5 * last and size < ROUNDING else 0
            if size <= balance.system.run.newton_tolerance or stalled == 2:
                new = self._tangent(at, factor, here)
                return (None if new is None or self._bends(here, new) else new), number
            last = size
        return None, ITERATIONS

    def _bends(self, here: Point, new: Point) -> bool:
        """Whether the path turns more than it may between two points, of which one may be on another branch."""
        chord, rise = self.balance.unknowns(new.at.q - here.at.q), new.factor - here.factor
        length = float(np.sqrt(self._product(chord, chord) + rise**2))
        if self.balance.turned(here.at, new.at) > HALF:
            return True
        least = min(self._product(chord, p.along) + rise * p.rise for p in (here, new))
        cosine = self._product(here.along, new.along) + here.rise * new.rise
        return least < STRAIGHT * length or cosine < STRAIGHT

    def _tangent(self, at: Configuration, factor: float, before: Point | None) -> Point | None:
        """An equilibrium with the path's tangent, which goes on as before, or from no load to more of it."""
        x, more = Tangent(self.balance, at, factor).solve(self.balance.load_rate(at, factor))
        length = float(np.sqrt(self._product(x, x) + 1.0))
        if not np.isfinite(length):
            return None
        if before is not None and self._product(x, before.along) + before.rise < 0.0:
            length = -length
        return Point(at, factor, x / length, more / length, 1.0 / length)

    def _where(
        self, value: Callable[[Point], float], exact: float, here: Point, beyond: Point, length: float
    ) -> list[tuple[float, Point]]:
        """Where a value changes its sign between two points: length and point, or nothing where that is not found."""
        low, high, before, after = 0.0, length, value(here), value(beyond)
        for trial in range(TRIED):
            part = before / (before - after) if trial % 3 < 2 else 0.5
            middle = low + part * (high - low)
            point, _ = self._step(here, middle)
            if point is None:
                return []
            found = value(point)
            if abs(found) <= exact or high - low <= exact * length:
                return [(middle, point)]
            if (found > 0.0) == (before > 0.0):
                low, before = middle, found
            else:
                high, after = middle, found
        return []

    def _product(self, x: Array, y: Array) -> float:
        weight = self.balance.weight
        return float(
            (self.balance.spread(x) * weight * self.balance.spread(y) * weight).sum() / weight.shape[1]
        )
