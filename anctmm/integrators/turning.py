"""Angles of bodies that are free to turn, counted at each step."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.by_address import by_address
from anctmm.kernels.options import part
from anctmm.model.bodies import Beam
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import CENTER
from anctmm.model.topology import turning_bodies
from anctmm.system.acting import Forms, forms_of
from anctmm.system.mesh import JointPlace
from anctmm.system.system import System

Array = NDArray[np.float64]


@by_address
class Turning(NamedTuple):
    """Directions whose angles are counted, for kernels.

    Parameters
    ----------
    forms : Forms
    angle : ndarray, shape (n,)
        Angle of each since t = 0, rad.
    direction : ndarray, shape (n, dim)
        As it was last.
    """

    forms: Forms
    angle: Array
    direction: Array


def turning_of(system: System) -> Turning:
    """Directions of the bodies that `turning_bodies` names, before the start; none in space."""
    vectors = []
    for name in turning_bodies(system.scene) if system.mesh.dim == 2 else ():
        body = system.scene.body(name)
        key = 0 if isinstance(body, Beam) else CENTER
        vectors.append(JointPlace(system.mesh, Place(body, key)).direction)
    count = len(vectors)
    return Turning(forms_of(system.mesh, vectors), np.zeros(count), np.zeros((count, system.mesh.dim)))


@part
def count_turns(turning: Turning, q: Array) -> None:
    """Count the angles at the next step, between which directions turn by less than half a turn."""
    forms = turning.forms
    for n in range(len(turning.angle)):
        x, y = 0.0, 0.0
        for t in range(forms.start[n], forms.start[n + 1]):
            i, a = forms.node[t], forms.component[t]
            x += forms.A[t, 0, 0] * q[a, i] + forms.A[t, 0, 1] * q[a + 1, i]
            y += forms.A[t, 1, 0] * q[a, i] + forms.A[t, 1, 1] * q[a + 1, i]
        u, w = turning.direction[n, 0], turning.direction[n, 1]
        if u != 0.0 or w != 0.0:
            turning.angle[n] += np.arctan2(u * y - w * x, u * x + w * y)
        turning.direction[n, 0], turning.direction[n, 1] = x, y
