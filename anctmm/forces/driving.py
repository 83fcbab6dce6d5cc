"""Histories of all drives of a scene: of driven clamps, and of constraints behind them."""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.junctions.constraints import Drive
from anctmm.forces.actuation import Actuation
from anctmm.model.drives import tabulate

Array = NDArray[np.float64]


def drives_of(chain: Chain, actuation: Actuation) -> list[Drive]:
    """All drives, those of driven clamps before those of constraints."""
    clamps = [
        Drive(f"clamp {c.end!r} angle", c.angle, True) for _, c in actuation.driven if c.angle is not None
    ]
    return clamps + (chain.kept.constraints.drives if chain.plan.kept else [])


def drive_table(chain: Chain, actuation: Actuation, t: Array) -> Array:
    """Value, rate and acceleration of each drive at times `t`, (n, drives, 3)."""
    tables = [tabulate(drive.name, drive.history, t, 3) for drive in drives_of(chain, actuation)]
    return np.stack(tables, axis=1) if tables else np.zeros((len(t), 0, 3))


def drive_width(chain: Chain, actuation: Actuation) -> int:
    """Numbers that the tables of drives and loads hold for each time."""
    return actuation.width + 3 * (len(drives_of(chain, actuation)) - len(actuation.driven))
