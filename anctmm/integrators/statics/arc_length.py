"""The path of equilibria by its arc length: through limit points of the load, forwards and backwards.

An equilibrium is a point (q, λ) with residual(q, λ) = 0. The path is followed along its tangent t and corrected by
Newton's method in the plane normal to t, so that the load factor λ is an unknown like q (Riks 1979, DOI
10.1016/0020-7683(79)90081-7; Crisfield 1981, DOI 10.1016/0045-7949(81)90108-5). Each correction needs two solves with
K_T, for the residual and for the load. Arc length combines positions relative to the scene's length and gradients, as
root mean squares over the nodes, and λ.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.integrators.statics.static_system import StaticSystem, Turns

Array = NDArray[np.float64]

#: Corrections of one step before it is halved, and their number that a step is made for.
ITERATIONS, AIM = 12, 4
#: A correction larger than this, relative, is out of Newton's reach.
REACH = 0.3
#: Cosine of the angle that the tangent may turn by in a step, and of those between the step and both tangents.
STRAIGHT = 0.94
#: Largest turn of a rotational spring in a step, rad: its turns are counted.
HALF = 1.5
#: Shortest and longest step.
SHORTEST, LONGEST = 1e-9, 0.25
#: Component of λ in the tangent at which a point counts as a limit point: λ differs from its limit by the square.
LIMIT = 1e-7
#: Distance of λ from the whole load at which that counts as reached.
EXACT = 1e-12
#: Points tried until a limit point, or the whole load, is found.
TRIED = 60
#: Corrections that no longer fall count as rounding below this size.
ROUNDING = 1e-6


class Point(NamedTuple):
    """An equilibrium of the path.

    Parameters
    ----------
    q : ndarray, shape (rows, nodes)
    factor : float
        Load factor λ.
    along, rise : ndarray, shape (rows, nodes), and float
        The path's tangent: of q and of λ.
    limit : bool
        Whether the load factor is a maximum or a minimum of the path here.
    turns : Turns, optional
        Those of a point that the path goes through.
    """

    q: Array
    factor: float
    along: Array
    rise: float
    limit: bool = False
    turns: Turns | None = None


class ArcPath:
    """The path of equilibria from the undeformed scene on.

    Parameters
    ----------
    system : StaticSystem
    tolerance : float
        Of the last correction, relative.
    first : float
        Load factor of the first step.
    """

    def __init__(self, system: StaticSystem, tolerance: float, first: float) -> None:
        self.system, self.tolerance, self.first = system, tolerance, first
        self.weight = np.ones_like(system.reference) / system.reference.shape[1]
        self.weight[:2] /= system.chain.length**2
        #: Newton corrections so far.
        self.iterations = 0

    def points(self) -> Iterator[Point]:
        """Equilibria one after another, limit points among them, until the whole load is reached.

        It ends before where no step is short enough.
        """
        start = self._tangent(self.system.reference.copy(), 0.0, None)
        if start is None:
            return
        yield start._replace(turns=self.system.turns())
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
                    yield self._reached((whole[0][1] if whole else end)._replace(factor=1.0))
                    return
                yield self._reached(end._replace(limit=end is not new))
            here, step = new, step * float(np.clip(np.sqrt(AIM / corrections), 0.5, 1.5))

    def _reached(self, point: Point) -> Point:
        """A point that the path goes through, whose turns are counted."""
        self.system.accept(point.q, point.factor)
        return point._replace(turns=self.system.turns())

    def _step(self, here: Point, length: float) -> tuple[Point | None, int]:
        """The equilibrium a step away, if it is found and the path bends little; Newton corrections."""
        system = self.system
        q, factor = here.q + length * here.along, here.factor + length * here.rise
        last, stalled = np.inf, 0
        for number in range(1, ITERATIONS + 1):
            system.factorize(q, factor)
            x, y = system.correction(q, factor), system.solve(system.load_rate(q, factor))
            self.iterations += 1
            more = -self._product(here.along, x) / (self._product(here.along, y) + here.rise)
            x += more * y
            size = max(system.size(x), abs(more)) if np.isfinite(x).all() else np.inf
            if not size < REACH:
                return None, number
            q, factor = q + x, factor + more
            stalled = stalled + 1 if size > 0.5 * last and size < ROUNDING else 0
            if size <= self.tolerance or stalled == 2:
                new = self._tangent(q, factor, here)
                return (None if new is None or self._bends(here, new) else new), number
            last = size
        return None, ITERATIONS

    def _bends(self, here: Point, new: Point) -> bool:
        """Whether the path turns more than it may between two points, of which one may be on another branch."""
        chord, rise = new.q - here.q, new.factor - here.factor
        length = float(np.sqrt(self._product(chord, chord) + rise**2))
        if self.system.turned(new.q, new.factor) > HALF:
            return True
        least = min(self._product(chord, p.along) + rise * p.rise for p in (here, new))
        return least < STRAIGHT * length or self._cosine(here, new) < STRAIGHT

    def _cosine(self, one: Point, two: Point) -> float:
        return self._product(one.along, two.along) + one.rise * two.rise

    def _tangent(self, q: Array, factor: float, before: Point | None) -> Point | None:
        """An equilibrium with the path's tangent, which goes on as before, or from no load to more of it."""
        self.system.factorize(q, factor)
        x = self.system.solve(self.system.load_rate(q, factor))
        length = float(np.sqrt(self._product(x, x) + 1.0))
        if not np.isfinite(length):
            return None
        if before is not None and self._product(x, before.along) + before.rise < 0.0:
            length = -length
        return Point(q, factor, x / length, 1.0 / length)

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
        return float((self.weight * x * y).sum())
