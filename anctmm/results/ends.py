"""Ends of bodies over a run, of all bodies together: what joints hold, and what moves most."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution

Complex = NDArray[np.complex128]


class Ends(NamedTuple):
    """Start and end of the first body, of the second, and so on.

    Parameters
    ----------
    place : ndarray of complex, shape (ends, n)
        x + iy, m.
    gradient : ndarray of complex, shape (ends, n)
        r_x there; not a number where a field does not tell.
    """

    place: Complex
    gradient: Complex


def ends_of(solution: Solution) -> Ends:
    """Ends of all bodies of a scene, in its order, at the outputs of a solution that has a field of each."""
    bodies = solution.scene.beams
    # axes: place or gradient, body, start or end, output, x or y
    found = np.full((2, len(bodies), 2, solution.t.size, 2), np.nan)
    for of, body in enumerate(bodies):
        match solution.fields[body.name]:
            case HermiteField(coordinates=q):
                found[:, of] = q[:, :: q.shape[1] - 1, :2].transpose(2, 1, 0, 3)
            case field:
                found[0, of] = [field.position(0.0), field.position(1.0)]
    return Ends(*found.view(np.complex128).reshape(2, 2 * len(bodies), -1))
