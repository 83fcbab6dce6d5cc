"""Constraints of the joints and the rigid bodies of a scene, as a textbook writes them."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError, shown
from anctmm.model.joints import Guide, Joint, Prismatic, Slider, drive_of, unknown_joint
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import CENTER, RigidBody
from anctmm.model.scene import Clamp, Pin, Weld
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
                    yield from self._aligned(one, two, stretch == "free")
            case Clamp(stretch=stretch):
                yield from self._together(True)
                yield from self._aligned(None, self.places[0], stretch == "free")
            case Slider():
                yield from self._guided(self.joint)
            case Prismatic(body=name):
                yield from self._guided(self.joint)
                self.drive = None  # it is that of the position
                line = None if name is None else Place(self.layout.scene.body(name), CENTER)
                yield from self._aligned(line, self.places[0])
            case _:
                raise unknown_joint(self.joint)

    def _together(self, grounded: bool) -> Iterator[Row]:
        """Places at one point; if the ground holds it, the first is held."""
        vectors = [self.layout.position(place) for place in self.places]
        if grounded:
            yield from self._equal(vectors[0], Vector.fixed(self._placed(vectors[0])))
        for one, two in pairwise(vectors):
            yield from self._equal(two, one)

    def _aligned(self, one: Place | None, two: Place, free: bool = False) -> Iterator[Row]:
        """The second place turns with the first, or with the ground, turned further by a drive.

        Of beams all gradients do; of rigid bodies, and where a beam is `free` to stretch, only the direction.
        """
        rigid = [place is None or self.layout.is_rigid(place) for place in (one, two)]
        alone = free or all(rigid)
        seconds = [self.layout.direction(two)] if alone or rigid[1] else self.layout.gradients(two)
        firsts = [Vector.fixed(self._placed(second)) for second in seconds]
        if one is not None:
            firsts = [self.layout.direction(one)] if alone or rigid[0] else self.layout.gradients(one)
        if not any(rigid) and len(firsts) != len(seconds):
            names = [place.body.name for place in self.places]
            of = [f"{name!r} of element {self.layout.meshes[name].kind.name!r}" for name in names]
            raise DiscretisationError(
                f"{shown(self.joint)} joins {' to '.join(of)}; one element kind is needed on all sides of a weld"
            )
        turned = self.drive is not None
        for k in range(max(len(firsts), len(seconds))):
            first, second = firsts[min(k, len(firsts) - 1)], seconds[min(k, len(seconds) - 1)]
            turn = self._turn(first, second)
            if alone:
                yield Row((Term(second, QUARTER @ turn, first, turned),), drive=self.drive)
            else:
                yield from self._equal(second, first, turn, turned)

    def _guided(self, guide: Guide) -> Iterator[Row]:
        """A place on its line and, driven, at its position on it."""
        layout, place = self.layout, self.places[0]
        position, along = layout.position(place), np.array(guide.direction)
        directions = [QUARTER @ along, along][: 1 if self.drive is None else 2]
        for direction, drive in zip(directions, (None, self.drive), strict=False):
            term, target = (
                Term(Vector.fixed(direction), BOTH, position),
                float(direction @ self._placed(position)),
            )
            if guide.body is not None:
                (x, y), target = direction, 0.0
                apart = position.minus(layout.point(guide.body, place.position))
                term = Term(apart, np.array([[x, -y], [y, x]]), layout.turning(guide.body))
            held = guide.body is None and self._of_beams(position)
            yield Row((term,), target, drive, along=drive is not None, held=held)

    def _equal(
        self, second: Vector, first: Vector, turn: Array = BOTH, turned: bool = False
    ) -> Iterator[Row]:
        """The second vector is the first, turned by a matrix and, where `turned`, by the drive."""
        held = self._of_beams(first, second) and not (turned and len(first.at))
        for e in BOTH:
            axis = Vector.fixed(e)
            terms = Term(axis, BOTH, second), Term(axis, -turn, first, turned)
            yield Row(terms, drive=self.drive if turned else None, held=bool(held))

    def _of_beams(self, *vectors: Vector) -> bool:
        return all(bool((vector.at < self.layout.flexible).all()) for vector in vectors)

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
