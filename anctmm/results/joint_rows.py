"""Equations of joints at the outputs of a solution of any solver: their values, and their derivatives by places.

A joint says in `equations` what is zero, as sums over vectors of its places: the position, and the vectors that turn
with the place (r_x of a beam and r_y of a shear element, u of a rigid body, in space its three axes). Here each place
has vectors of its own, so that the derivatives by them, times a multiplier, are what the joint exerts on that place.
"""

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import kind_of
from anctmm.model.bodies import Beam
from anctmm.model.checks.conditions import as_vectors, axes_of, ends_of, flat
from anctmm.model.drives import tabulate
from anctmm.model.expressions import QUARTER_TURN, Linearised, Signal
from anctmm.model.joints import Joint
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass
from anctmm.results.fields import NodalField

Array = NDArray[np.float64]


def _from_x(body: Any) -> Array:
    """Matrix that turns e_x into the direction of a beam in the plane in the reference."""
    x, y = np.subtract(body.end, body.start) / body.length
    return x * np.eye(2) + y * QUARTER_TURN


def rigid_bodies(solution: Any) -> frozenset[str]:
    """Names of the bodies that do not bend in a solution: beams by their elements."""
    cut = {} if solution.run is None else solution.run.of(solution.scene)
    bending = {body.name for body in solution.scene.beams if body.name not in cut}
    bending |= {name for name, (_, kind) in cut.items() if not kind_of(kind).rigid}
    return frozenset(body.name for body in solution.scene.bodies if body.name not in bending)


class JointAtOutputs:
    """A joint of a solution and the vectors of its places at all outputs.

    `rigid`: names of bodies that do not bend; `unit`: whether vectors that turn are divided by their lengths, so that
    what a joint holds of the stretch is left out.
    """

    def __init__(self, solution: Any, joint: Joint, rigid: frozenset[str], unit: bool = False) -> None:
        self.solution, self.rigid, self.unit = solution, rigid, unit
        self._histories = dict[int, Array]()
        #: Its places, and points of the ground.
        self.places = ends_of(solution.scene, joint)
        still = [not isinstance(place, Place) or place.body.name in rigid for place in self.places]
        axes = [self._axes(place, *at) for place, *at in zip(self.places, still, strict=True)]
        seen, self.owners = as_vectors(self.places, axes, still)
        self._equations = list(flat(joint.equations(*seen)))

    def _axes(self, place: Any, rigid: bool) -> Array:
        """Axes in the reference, (axes, dim): r_x of a beam and, of a shear element, r_y."""
        if isinstance(place, Place) and isinstance(place.body, Beam):
            if rigid:
                return axes_of(place.position)
            if getattr(self.solution.fields[place.body.name], "sections", False):
                return _from_x(place.body).T
        return axes_of(place)

    @cached_property
    def vectors(self) -> list[Array]:
        """All vectors, each (n, dim), whose places are `owners`; NaN where a field does not have them."""
        nothing = np.full((len(self.solution.t), self.solution.scene.dim), np.nan)
        known = [list(self._of(place)) if isinstance(place, Place) else [] for place in self.places]
        return [known[n][k] if k < len(known[n]) else nothing for n, k in self.owners]

    def _of(self, place: Place) -> Iterator[Array]:
        field: Any = self.solution.fields[place.body.name]
        yield field.position(place.key)
        if isinstance(field, NodalField) and not isinstance(place.body, PointMass):
            for vector in field.gradients(place.key):  # type: ignore[attr-defined]
                if isinstance(place.body, Beam) and place.body.name in self.rigid:
                    vector = vector @ _from_x(place.body)
                yield vector / np.linalg.norm(vector, axis=1, keepdims=True) if self.unit else vector

    def rows(self) -> Iterator[Linearised]:
        """All its equations, each of one component or of dim, with their derivatives by its vectors."""
        return (equation.linearised(self.vectors, self._factor) for equation in self._equations)

    def _factor(self, w: Signal | None) -> Array:
        """A signal at the outputs, (n, 1)."""
        if w is None:
            return np.ones((len(self.solution.t), 1))
        if id(w.history) not in self._histories:
            t = 0.0 * self.solution.t if self.solution.static else self.solution.t
            self._histories[id(w.history)] = tabulate(w.name, w.history, t, 3).T
        return np.asarray(w.at(self._histories[id(w.history)])[0][:, None])
