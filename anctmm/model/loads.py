"""Loads on ends of bodies."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import shown, unknown_kind
from anctmm.model.drives import breaks_of, tabulate
from anctmm.model.joints import end_name
from anctmm.model.velocities import Point
from anctmm.validation import number, vector


@final
@dataclass(frozen=True)
class Force:
    """Dead force on an end: constant (Fx, Fy) or t → (Fx, Fy), N."""

    end: str
    value: Point | Callable[[Any], Point]

    def __post_init__(self) -> None:
        object.__setattr__(self, "end", end_name(self.end))
        if not callable(self.value):
            object.__setattr__(self, "value", vector(f"force on {shown(self.end)} (N)", self.value))
        breaks_of(f"force on {shown(self.end)}", self.value)


@final
@dataclass(frozen=True)
class Torque:
    """Moment on an end, positive counter-clockwise: constant or t → moment, N m.

    It acts on the direction of the section: on r_x of a cable (whose section stays normal to its axis), on
    r_y of a shear-deformable element.
    """

    end: str
    value: float | Callable[[Any], float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "end", end_name(self.end))
        if not callable(self.value):
            object.__setattr__(self, "value", number(f"torque on {shown(self.end)} (N m)", self.value))
        breaks_of(f"torque on {shown(self.end)}", self.value)


Load = Force | Torque
#: All kinds. None may be a subclass of another: solvers tell them apart by their class.
LOADS = (Force, Torque)


def tabulated(loads: Sequence[Load], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of loads at times: force (x, y), N, or moment and 0, N m.

    Parameters
    ----------
    loads : sequence of Load
    t : ndarray, shape (n,)
        Times, s.

    Returns
    -------
    ndarray, shape (n, loads, 2)

    Raises
    ------
    PropertyError
        If a history raises, or gives another number of values, or a value that is not finite.
    """
    table = np.zeros((len(t), len(loads), 2))
    for i, load in enumerate(loads):
        width = width_of(load)
        if callable(load.value):
            table[:, i, :width] = tabulate(f"load on {load.end!r}", load.value, t, width)
        else:
            table[:, i, :width] = load.value
    return table


def width_of(load: Load) -> int:
    """Numbers that the value of a load has."""
    match load:
        case Force():
            return 2
        case Torque():
            return 1
        case _:
            raise unknown_kind("load", load, LOADS)


def check_load(load: Load) -> None:
    """Refuse a load whose history gives nothing at t = 0.

    Raises
    ------
    PropertyError
    """
    if callable(load.value):
        tabulate(f"load on {shown(load.end)}", load.value, np.zeros(1), width_of(load))
