"""Constraints of the joints and the rigid bodies of a scene, as a textbook writes them."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError, shown
from anctmm.model.joints import Guide, Joint, drive_of, unknown_joint
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.scene import Clamp, Pin, Prismatic, Slider, Weld
from reference.global_dae.constraints import Drive, Row, Term
from reference.global_dae.layout import Layout
from reference.global_dae.vectors import QUARTER, Vector

Array = NDArray[np.float64]

BOTH = np.eye(2)


def constraints_of(layout: Layout) -> list[Row]:
    """Rows of rigid bodies, then those of the joints in their order.

    Raises
    ------
    DiscretisationError
        If a weld joins beams whose nodes have different vectors.
    UnknownKindError
        If a kind of joint is not known here.
    """
    found: list[Row] = []
    for name, body in layout.rigid.items():
        if isinstance(body, RigidBody):
            t = layout.turning(name)
            found.append(Row((Term(t, 0.5 * BOTH, t),), 0.5))
    for joint in layout.scene.joints:
        found += JointRows(layout, joint)
    return found


class JointRows:
    """Rows of one joint, one after the other."""

    def __init__(self, layout: Layout, joint: Joint) -> None:
        self.layout, self.joint = layout, joint
        self.places = [layout.scene.place(end) for end in joint.places]
        driven = drive_of(joint)
        self.drive = None if driven is None else Drive(driven[0], driven[1])

    def __iter__(self) -> Iterator[Row]:
        match self.joint:
            case Pin():
                yield from self._together(self.joint.grounded)
            case Weld(stretch=stretch):
                yield from self._together(self.joint.grounded)
                for one, two in pairwise(self.places):
                    yield from self._aligned(one, two) if stretch == "held" else self._parallel(one, two)
            case Clamp(stretch=stretch):
                yield from self._together(True)
                yield from self._directed() if stretch == "held" else self._parallel(None, self.places[0])
            case Slider():
                yield from self._guided(self.joint)
            case Prismatic():
                yield from self._guided(self.joint)
                self.drive = None
                if self.joint.body is None:
                    yield from self._directed()
                else:
                    line = Place(self.layout.scene.body(self.joint.body), "center")
                    yield from self._aligned(line, self.places[0])
            case _:
                raise unknown_joint(self.joint)

    def _together(self, grounded: bool) -> Iterator[Row]:
        """Places at one point; if the ground holds it, the first is held."""
        vectors = [self.layout.position(place) for place in self.places]
        if grounded:
            yield from self._hold(vectors[0])
        for one, two in pairwise(vectors):
            yield from self._equal(two.minus(one), np.zeros(2))

    def _directed(self) -> Iterator[Row]:
        """A place whose direction the ground, or a drive there, gives."""
        place = self.places[0]
        if self.layout.is_rigid(place):
            terms = Term(
                self.layout.direction(place), QUARTER, Vector.fixed((1.0, 0.0)), self.drive is not None
            )
            yield Row((terms,), drive=self.drive)
            return
        for vector in self.layout.gradients(place):
            yield from self._hold(vector, driven=True)

    def _parallel(self, one: Place | None, two: Place) -> Iterator[Row]:
        """The second place, of any stretch, points where the first one, or the ground, does, turned by a drive."""
        second = self.layout.direction(two)
        first = Vector.fixed(self._placed(second)) if one is None else self.layout.direction(one)
        turn = BOTH if one is None else self._turn(first, second)
        yield Row((Term(second, QUARTER @ turn, first, self.drive is not None),), drive=self.drive)

    def _aligned(self, one: Place, two: Place) -> Iterator[Row]:
        """The second place turns with the first, turned further by a drive."""
        layout, rigid = self.layout, [self.layout.is_rigid(place) for place in (one, two)]
        turned = self.drive is not None
        if all(rigid):
            yield Row(
                (Term(layout.direction(two), QUARTER, layout.direction(one), turned),), drive=self.drive
            )
            return
        firsts, seconds = (
            [layout.direction(place)] if still else layout.gradients(place)
            for place, still in zip((one, two), rigid, strict=True)
        )
        if not any(rigid) and len(firsts) != len(seconds):
            raise DiscretisationError(
                f"{shown(self.joint)} joins {self._element(one)} to {self._element(two)}; one element kind is needed "
                f"on all sides of a weld"
            )
        count = max(len(firsts), len(seconds))
        for k in range(count):
            first, second = firsts[min(k, len(firsts) - 1)], seconds[min(k, len(seconds) - 1)]
            turn = self._turn(first, second)
            for e in BOTH:
                axis = Vector.fixed(e)
                terms = Term(axis, BOTH, second), Term(axis, -turn, first, turned)
                yield Row(terms, drive=self.drive, held=not any(rigid) and not turned)

    def _element(self, place: Place) -> str:
        name = place.body.name
        return f"{name!r} of element {self.layout.meshes[name].kind.name!r}"

    def _guided(self, guide: Guide) -> Iterator[Row]:
        """A place on its line and, driven, at its position on it."""
        layout, place = self.layout, self.places[0]
        position, along = layout.position(place), np.array(guide.direction)
        across = QUARTER @ along
        if guide.body is None:
            start = self._placed(position)
            yield self._component(position, across, start)
            if self.drive is not None:
                yield self._component(position, along, start)._replace(drive=self.drive, along=True)
            return
        apart, t = position.minus(layout.point(guide.body, place.position)), layout.turning(guide.body)
        for (x, y), drive in ((across, None), *([(along, self.drive)] if self.drive is not None else [])):
            turn = np.array([[x, -y], [y, x]])
            yield Row((Term(apart, turn, t),), drive=drive, along=drive is not None)

    # --- rows of one vector --------------------------------------------------------------------------------

    def _hold(self, vector: Vector, driven: bool = False) -> Iterator[Row]:
        """A vector with its value of the reference, turned by the drive where `driven`."""
        target = self._placed(vector)
        if self.drive is None or not driven:
            yield from self._equal(vector, target)
            return
        for e in BOTH:
            axis = Vector.fixed(e)
            terms = Term(axis, BOTH, vector), Term(axis, -BOTH, Vector.fixed(target), True)
            yield Row(terms, drive=self.drive, held=self._of_beams(vector))

    def _equal(self, vector: Vector, target: Array) -> Iterator[Row]:
        for e in BOTH:
            yield self._component(vector, e, target)

    def _component(self, vector: Vector, direction: Array, target: Array) -> Row:
        term = Term(Vector.fixed(direction), BOTH, vector)
        return Row((term,), float(direction @ target), held=self._of_beams(vector))

    def _of_beams(self, vector: Vector) -> bool:
        return bool((vector.at < self.layout.flexible).all())

    def _placed(self, vector: Vector) -> Array:
        return vector(self.layout.reference)

    def _turn(self, first: Vector, second: Vector) -> Array:
        """Turn from the first to the second in the reference; where they are in line it is free of rounding."""
        a, b = (complex(*self._placed(vector)) for vector in (first, second))
        turn = b * a.conjugate()
        turn /= abs(turn)
        if abs(turn.imag) < 8 * np.finfo(float).eps:
            turn = complex(round(turn.real))
        return np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
