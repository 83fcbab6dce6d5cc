"""Histories of all drives of a scene: of driven clamps, and of constraints behind them."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.junctions.constraints import Drive
from anctmm.forces.actuation import Actuation
from anctmm.model.drives import tabulate

Array = NDArray[np.float64]


def drives_of(chain: Chain, actuation: Actuation) -> list[Drive]:
    """All drives, those of driven clamps before those of constraints."""
    return actuation.drives + (chain.kept.constraints.drives if chain.plan.kept else [])


def drive_table(chain: Chain, actuation: Actuation, t: Array, find: Callable[..., Array] = tabulate) -> Array:
    """Value, rate and acceleration of each drive at times `t`, (n, drives, 3).

    `find` is `table_of` for times that every run of a scene asks for.
    """
    drives = drives_of(chain, actuation)
    table = np.empty((len(t), len(drives), 3))
    for k, drive in enumerate(drives):
        table[:, k] = find(drive.name, drive.history, t, 3)
    return table


def drive_width(chain: Chain, actuation: Actuation) -> int:
    """Numbers that the tables of drives and loads hold for each time."""
    return actuation.width + 3 * (len(drives_of(chain, actuation)) - len(actuation.driven))


def tables_of(
    chain: Chain,
    actuation: Actuation,
    t: Callable[[], Array],
    count: int,
    find: Callable[..., Array] = tabulate,
) -> tuple[Array, Array]:
    """Values of all drives, (count, drives, 3), and of loads, (count, loads, 2), at as many times.

    Parameters
    ----------
    chain : Chain
    actuation : Actuation
        Its own.
    t : callable
        Gives the times; not called if nothing is driven.
    count : int
    find : callable
        As of `drive_table`.
    """
    if drive_width(chain, actuation) == 0:
        return np.zeros((count, 0, 3)), np.zeros((count, 0, 2))
    times = t()
    return drive_table(chain, actuation, times, find), actuation.load_table(times)
