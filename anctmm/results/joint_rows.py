"""Equations of joints at the outputs of a solution of any solver: their values, and their derivatives by places.

A joint says in `equations` what is zero, as sums over vectors of its places: the position, and the vectors that turn
with the place (r_x of a beam and r_y of a shear element, u of a rigid body, in space its three axes). Here each place
has vectors of its own, so that the derivatives by them, times a multiplier, are what the joint exerts on that place.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import kind_of
from anctmm.model.bodies import Beam
from anctmm.model.checks.conditions import VectorPlace, axes_of, flat
from anctmm.model.drives import tabulate
from anctmm.model.expressions import QUARTER_TURN, Scalar, Signal, Vector
from anctmm.model.joints import Joint
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass
from anctmm.results.fields import NodalField

Array = NDArray[np.float64]
#: Vectors of a place: its position and up to three that turn with it.
SLOTS = 4


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


@dataclass(frozen=True)
class Row:
    """One equation of a joint, of one component or of dim, at n outputs.

    Its value, (n, rows), and its derivatives, each (n, rows, dim), by the vectors of the joint's places: that of number
    place · SLOTS is the position, and so on.
    """

    value: Array
    slopes: Mapping[int, Array]


class JointAtOutputs:
    """A joint and the vectors of its places at all outputs.

    Parameters
    ----------
    solution : Solution
    joint : Joint
    rigid : frozenset of str
        Bodies that do not bend, see `rigid_bodies`.
    unit : bool
        Whether vectors that turn are divided by their lengths: what a joint holds of the stretch is left out.
    """

    def __init__(self, solution: Any, joint: Joint, rigid: frozenset[str], unit: bool = False) -> None:
        self.solution, self.joint, self.rigid, self.unit = solution, joint, rigid, unit
        self._histories = dict[int, Array]()
        scene = solution.scene
        self._dim = scene.dim
        #: Its places, and points of the ground.
        self.places: list[Any] = [
            end if not isinstance(end, str) and not isinstance(end[0], str) else scene.place(end)
            for end in joint.attached
        ]

    @cached_property
    def vectors(self) -> list[Array]:
        """Vectors of all places, each (n, dim); NaN where a field does not have them."""
        found, nothing = list[Array](), np.full((len(self.solution.t), self._dim), np.nan)
        for place in self.places:
            slots = list(self._of(place)) if isinstance(place, Place) else []
            found += [*slots, *[nothing] * (SLOTS - len(slots))]
        return found

    def _of(self, place: Place) -> Iterator[Array]:
        field: Any = self.solution.fields[place.body.name]
        yield field.position(place.key)
        if isinstance(field, NodalField) and not isinstance(place.body, PointMass):
            for vector in field.gradients(place.key):  # type: ignore[attr-defined]
                if isinstance(place.body, Beam) and place.body.name in self.rigid:
                    vector = vector @ _from_x(place.body)
                yield vector / np.linalg.norm(vector, axis=1, keepdims=True) if self.unit else vector

    def rows(self) -> Iterator[Row]:
        """All its equations."""
        start = np.zeros((SLOTS * len(self.places), self._dim))
        places = [self._seen(start, SLOTS * n, place) for n, place in enumerate(self.places)]
        for equation in flat(self.joint.equations(*places)):
            yield self._of_vector(equation) if isinstance(equation, Vector) else self._of_scalar(equation)

    def _seen(self, start: Array, first: int, place: Any) -> VectorPlace:
        """A place by the numbers of its vectors, whose values in the reference are filled in."""
        eye = np.eye(self._dim)
        rigid = not isinstance(place, Place) or place.body.name in self.rigid
        axes = (eye[:1] if self._dim == 2 else eye) if rigid else self._gradients(place)
        if not isinstance(place, Place):
            position, *fixed = (Vector(start, {}, {None: np.array(x, dtype=float)}) for x in (place, *axes))
            return VectorPlace(position, fixed, True)
        axes = axes[:0] if isinstance(place.body, PointMass) else axes
        start[first : first + 1 + len(axes)] = place.position, *axes
        position, *gradients = (Vector(start, {(first + k, None): eye}) for k in range(1 + len(axes)))
        return VectorPlace(position, gradients, rigid)

    def _gradients(self, place: Place) -> Array:
        """r_x of a beam in the reference and, of a shear element, r_y, as rows."""
        if getattr(self.solution.fields[place.body.name], "sections", False):
            return _from_x(place.body).T
        return axes_of(place)

    def _factor(self, w: Signal | None) -> Array:
        """A signal at the outputs, (n, 1)."""
        if w is None:
            return np.ones((len(self.solution.t), 1))
        if id(w.history) not in self._histories:
            t = 0.0 * self.solution.t if self.solution.static else self.solution.t
            self._histories[id(w.history)] = tabulate(w.name, w.history, t, 3).T
        return np.asarray(w.at(self._histories[id(w.history)])[0][:, None])

    def _of_vector(self, equation: Vector) -> Row:
        value, slopes = np.zeros((len(self.solution.t), self._dim)), dict[int, Array]()
        for (v, w), A in equation.terms.items():
            value += self._factor(w) * (self.vectors[v] @ A.T)
            slopes[v] = slopes.get(v, 0.0) + self._factor(w)[:, :, None] * A
        for w, b in equation.constants.items():
            value += self._factor(w) * b
        return Row(value, slopes)

    def _of_scalar(self, equation: Scalar) -> Row:
        x, value, slopes = self.vectors, np.zeros((len(self.solution.t), 1)), dict[int, Array]()
        for (i, j, w), C in equation.pairs.items():
            factor, left, right = self._factor(w), x[j] @ C.T, x[i] @ C
            value += factor * (x[i] * left).sum(axis=1, keepdims=True)
            for v, slope in ((i, left), (j, right)):
                slopes[v] = slopes.get(v, 0.0) + (factor * slope)[:, None]
        for (v, w), c in equation.terms.items():
            value += self._factor(w) * (x[v] @ c)[:, None]
            slopes[v] = slopes.get(v, 0.0) + (self._factor(w) * c)[:, None]
        for w, number in equation.constants.items():
            value += self._factor(w) * number
        return Row(value, slopes)
