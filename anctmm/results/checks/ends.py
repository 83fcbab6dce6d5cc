"""Ends of bodies over a run, of all bodies together: places fixed by joints, and those that move most."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.model.bodies import Beam
from anctmm.model.rigid_bodies import CENTER
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution

Complex = NDArray[np.complex128]


class Ends(NamedTuple):
    """Start and end of the first beam, of the second, and so on, and then the centre of each other body.

    Parameters
    ----------
    place : ndarray of complex, shape (ends, n)
        x + iy, m.
    gradient : ndarray of complex, shape (ends, n)
        r_x there; NaN where a field does not have it.
    """

    place: Complex
    gradient: Complex


def ends_of(solution: Solution) -> Ends | None:
    """Ends of all bodies of a scene at the outputs of a solution; None if there are none, or a body has no field."""
    bodies, beams = solution.scene.bodies, solution.scene.beams
    if solution.t.size == 0 or solution.fields.keys() != {body.name for body in bodies}:
        return None
    # axes: place or gradient, end, output, x or y
    found = np.full((2, len(bodies) + len(beams), solution.t.size, 2), np.nan)
    for of, body in enumerate(beams):
        match solution.fields[body.name]:
            case HermiteField(coordinates=q):
                found[:, 2 * of : 2 * of + 2] = q[:, :: q.shape[1] - 1, :2].transpose(2, 1, 0, 3)
            case field:
                found[0, 2 * of : 2 * of + 2] = [field.position(0.0), field.position(1.0)]
    others = [body for body in bodies if not isinstance(body, Beam)]
    for of, other in enumerate(others, start=2 * len(beams)):
        found[0, of] = solution.fields[other.name].position(CENTER)
    return Ends(*found.view(np.complex128)[..., 0])
