"""Places of bodies over a run, of all bodies together: those that joints hold, and those that move most."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.model.bodies import Beam
from anctmm.model.joints import built_in
from anctmm.model.kept import alike, kept
from anctmm.model.places import End, Place
from anctmm.model.rigid_bodies import CENTER
from anctmm.model.scene import Scene
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution

Complex = NDArray[np.complex128]


class Places(NamedTuple):
    """Paths of places, in the order of `names_of`.

    Parameters
    ----------
    place : ndarray of complex, shape (places, n)
        x + iy, m.
    gradient : ndarray of complex, shape (places, n)
        r_x there; NaN where a field does not have it, and beside the ends of beams.
    """

    place: Complex
    gradient: Complex


@alike
def names_of(scene: Scene) -> tuple[End, ...]:
    """Start and end of each beam, one after the other; the centre of each other body; other places that joints have."""
    ends: list[End] = [(body.name, side) for body in scene.beams for side in (0, 1)]
    ends += [(body.name, CENTER) for body in scene.bodies if not isinstance(body, Beam)]
    joined = (place.end for places in joined_places(scene) for place in places)
    return tuple(dict.fromkeys([*ends, *joined]))


@kept
def joined_places(scene: Scene) -> tuple[tuple[Place, ...], ...]:
    """Places that each joint of the package's kinds joins."""
    return tuple(tuple(map(scene.place, joint.ends)) for joint in built_in(scene.joints))


def places_of(solution: Solution) -> Places | None:
    """Places of all bodies of a scene at the outputs of a solution; None if there are none, or a body has no field."""
    scene, fields = solution.scene, solution.fields
    bodies, beams = scene.bodies, scene.beams
    if solution.t.size == 0 or fields.keys() != {body.name for body in bodies}:
        return None
    names = names_of(scene)
    # axes: place or gradient, place, output, x or y
    found = np.full((2, len(names), solution.t.size, 2), np.nan)
    for of, body in enumerate(beams):
        match fields[body.name]:
            case HermiteField(coordinates=q):
                found[:, 2 * of : 2 * of + 2] = q[:, :: q.shape[1] - 1, :2].transpose(2, 1, 0, 3)
            case field:
                found[0, 2 * of : 2 * of + 2] = [field.position(0.0), field.position(1.0)]
    for of, (name, key) in enumerate(names[2 * len(beams) :], start=2 * len(beams)):
        found[0, of] = fields[name].position(key)
    return Places(*found.view(np.complex128)[..., 0])
