"""Singular positions that a motion comes to: constraints of rigid bodies that depend on each other, or nearly, there.

At a dead centre, or where the bars of a linkage lie on one line, joints and drives do not determine how the bodies move
on. `anctmm.discretise.singular_positions.dead_centres` refuses starts there.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.fitting import constraint_matrix
from anctmm.discretise.junctions.as_written import body_as_written
from anctmm.discretise.junctions.constraints import Constraints
from anctmm.discretise.singular_positions.dependence import NONE
from anctmm.integrators.locking import loosely_closed
from anctmm.model.drives import value_at

Array = NDArray[np.float64]

#: Constraints up to which they are looked at: the time grows with the cube of their number.
MOST = 300
#: Part of its value at the start below which the least singular value is that of a position near to a singular one.
NEAR = 0.1
#: Part of the largest component of a singular vector above which a constraint takes part.
TAKES_PART = 0.2


def singular_at(chain: Chain, q: Array, t: float) -> list[str]:
    """Names of the bodies whose joints and guides are near a singular position.

    Parameters
    ----------
    chain : Chain
    q : ndarray, shape (rows, nodes)
        Coordinates.
    t : float
        s.

    Returns
    -------
    list of str
        None where the position is not singular, or that is not known: constraints are too many, or numbers not finite.
    """
    if not chain.plan.kept or not np.isfinite(q).all():
        return []
    found = chain.kept.constraints
    if not 0 < len(found.names) <= MOST:
        return []
    start, here = (
        np.linalg.svd(_jacobian(chain, at, when), full_matrices=False)
        for at, when in ((chain.start_coordinates(), 0.0), (q, t))
    )
    rank = int((start[1] > NONE * start[1][0]).sum())
    if rank == 0 or here[1][rank - 1] > NEAR * start[1][rank - 1]:
        return []
    stress = np.abs(here[0][:, rank - 1])
    parts = [found.names[k][1] for k in np.flatnonzero(stress > TAKES_PART * stress.max())]
    return list(dict.fromkeys(body_as_written(chain.parts, name) for name in parts))


def advice_at(chain: Chain, q: Array, t: float) -> str | None:
    """What to try where a run ends near a singular position; None elsewhere. Parameters as of `singular_at`."""
    names = singular_at(chain, q, t)
    if not names:
        return None
    which = f"body {names[0]!r} is" if len(names) == 1 else f"bodies {', '.join(map(repr, names))} are"
    return (
        f"{which} near a singular position there, as where a linkage locks or bars lie on one line (the last output "
        f"shows it: `s.plot()`): joints and drives do not determine the motion beyond, and no step is short enough; "
        f"other lengths, another drive, or a flexible body may help{loosely_closed(chain)}"
    )


def _jacobian(chain: Chain, q: Array, t: float) -> Array:
    """J of all constraints at coordinates q, dense, positions relative to the scene's length, rows of length 1."""
    row, node = chain.kept.homes
    J = constraint_matrix(chain, q, _signals(chain.kept.constraints, t)).toarray()
    J = J[:, row * chain.bodies.nodes + node] * np.where(row < 2, chain.length, 1.0)
    size = np.linalg.norm(J, axis=1, keepdims=True)
    return np.asarray(J / np.where(size > 0.0, size, 1.0))


def _signals(found: Constraints, t: float) -> Sequence[float]:
    """What drives the constraints at a time, s: see `anctmm.discretise.junctions.constraints`."""
    signals = [1.0]
    for drive in found.drives:
        value = float(value_at(drive.name, drive.history, t, 3)[0])
        signals += [float(np.cos(value)), float(np.sin(value))] if drive.turns else [value]
    return signals
