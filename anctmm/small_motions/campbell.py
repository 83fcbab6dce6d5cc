"""Frequencies of a steadily rotating scene as functions of its speed (Campbell 1924)."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import DiscretisationError
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.export.pictures import plot_campbell
from anctmm.small_motions.eigenvalues import grows
from anctmm.small_motions.modes import modes
from anctmm.validation import number, several, whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Campbell:
    """Frequencies over speeds.

    Parameters
    ----------
    name : str
        Of the scene.
    speeds : ndarray, shape (n,)
        rad/s, ascending.
    frequencies : ndarray, shape (n, count)
        Hz, in the rotating frame; in the order of `Modes` at each speed.
    damping : ndarray, shape (n, count)
        Ratios to the critical damping; negative where a motion grows.
    growth_rates : ndarray, shape (n, count)
        1/s; positive where a motion grows.
    """

    name: str
    speeds: Array
    frequencies: Array
    damping: Array
    growth_rates: Array

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """Which modes grow, (n, count)."""
        return grows(self.damping)

    def resonances(self, order: int = 1) -> list[tuple[float, float]]:
        """Where a frequency is a multiple, `order`, of the speed, which excites it.

        Returns
        -------
        list of (float, float)
            Speeds (rad/s) and frequencies (Hz), interpolated linearly between the given speeds.

        Raises
        ------
        DiscretisationError
            If the order is no whole number from 1 on.
        """
        order = whole("order", order, 10_000, DiscretisationError)
        over = self.frequencies - order * self.speeds[:, None] / (2.0 * np.pi)
        found = []
        for k, n in zip(*np.nonzero(over[:-1] * over[1:] < 0.0), strict=True):
            share = over[k, n] / (over[k, n] - over[k + 1, n])
            speed = float(self.speeds[k] + share * (self.speeds[k + 1] - self.speeds[k]))
            found.append((speed, order * speed / (2.0 * np.pi)))
        return sorted(found)

    def plot(self, orders: Sequence[int] = (1, 2, 3, 4, 5, 6)) -> "Figure":
        """The Campbell diagram, with lines of multiples of the speed; unstable motions are marked by crosses.

        Raises
        ------
        ResultError
            If matplotlib is not installed.
        """
        return plot_campbell(self.speeds, self.frequencies, self.unstable, orders, self.name)

    def __repr__(self) -> str:
        """Frequencies, a line a speed."""
        lines = [
            f"  {speed:10.4g} rad/s  {'  '.join(f'{f:10.5g}' for f in row[:6])} Hz{'  unstable' if grow.any() else ''}"
            for speed, row, grow in zip(self.speeds, self.frequencies, self.unstable, strict=True)
        ]
        return "\n".join([f"Campbell diagram of scene {self.name!r}:", *lines])


def campbell(
    scene: Scene | Callable[[float], Scene],
    speeds: Iterable[float],
    run: Discretisation | None = None,
    *,
    count: int | None = None,
    **options: Any,
) -> Campbell:
    """Frequencies of a steadily rotating scene at several speeds.

    Parameters
    ----------
    scene : Scene or callable
        As for `spin` of `modes`; or a function speed (rad/s) → scene, if the scene depends on the speed.
    speeds : iterable of float
        rad/s.
    run, count, **options
        As of `modes`.

    Raises
    ------
    DiscretisationError
        If the speeds are no numbers, or of what `modes` raises.
    SolverError
        If at a speed no steady state is found.
    """
    needed = "a list of numbers (rad/s) is needed"
    given = several("speeds is", speeds, needed, DiscretisationError)
    wanted = sorted({number("a speed (rad/s)", speed, DiscretisationError) for speed in given})
    if not wanted:
        raise DiscretisationError(f"speeds are 0 numbers; {needed}")
    scenes = [checked_scene(scene(speed) if callable(scene) else scene) for speed in wanted]
    found = [
        modes(turning, run, count=count, spin=speed, **options)
        for turning, speed in zip(scenes, wanted, strict=True)
    ]
    frequencies, damping, rates = (
        np.array([getattr(m, what) for m in found]) for what in ("frequencies", "damping", "growth_rates")
    )
    return Campbell(scenes[-1].name, np.array(wanted), frequencies, damping, rates)
