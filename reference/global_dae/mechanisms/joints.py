"""Constraints of the joints and the rigid bodies of a scene."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError, shown
from anctmm.model.joints import Guide, Joint, drive_of, unknown_joint
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.scene import Clamp, Pin, Prismatic, Slider, Weld
from reference.global_dae.mechanisms.constraints import Constraint, Drive, Fixed, Product, Turned
from reference.global_dae.mechanisms.layout import Layout
from reference.global_dae.mechanisms.vectors import QUARTER, Vector

Array = NDArray[np.float64]
BOTH = np.eye(2)


def constraints_of(layout: Layout) -> list[Constraint]:
    """Constraints of rigid bodies, then those of the joints in their order.

    Raises
    ------
    MeshError
        If a joint is where no node lies.
    DiscretisationError
        If a weld joins beams whose nodes have different vectors.
    """
    found: list[Constraint] = []
    for name, body in layout.rigid.items():
        if isinstance(body, RigidBody):
            t = Vector.of([(layout.first[name] + 2, 1.0)])
            found.append(Product(t, t, 0.5 * BOTH, 0.5))
    for joint in layout.scene.joints:
        found += _of_joint(layout, joint)
    return found


def _of_joint(layout: Layout, joint: Joint) -> Iterator[Constraint]:
    places = [layout.scene.place(end) for end in joint.ends]
    for place in places:
        if place.interior and not layout.is_rigid(place):
            layout.gradients(place)  # a node lies there
    match joint:
        case Pin():
            yield from _together(layout, places, joint.grounded)
        case Weld():
            yield from _together(layout, places, joint.grounded)
            for one, two in pairwise(places):
                if joint.stretch == "held":
                    yield from _aligned(layout, joint, one, two, _drive(joint))
                else:
                    yield _parallel(layout, one, two, _drive(joint))
        case Clamp():
            yield from _together(layout, places, True)
            if joint.stretch == "held":
                yield from _directed(layout, places[0], _drive(joint))
            else:
                yield _parallel(layout, None, places[0], _drive(joint))
        case Slider():
            yield from _guided(layout, joint, places[0])
        case Prismatic():
            yield from _guided(layout, joint, places[0])
            if joint.body is None:
                yield from _directed(layout, places[0], None)
            else:
                body = layout.scene.body(joint.body)
                yield from _aligned(layout, joint, Place(body, "center"), places[0], None)
        case _:
            raise unknown_joint(joint)


def _drive(joint: Joint) -> Drive | None:
    found = drive_of(joint)
    return None if found is None else Drive(found[0], found[1])


def _at_reference(layout: Layout, vector: Vector) -> Array:
    return vector(layout.reference)


def _hold(
    layout: Layout, vector: Vector, rows: Array = BOTH, drive: Drive | None = None, *, along: bool = False
) -> Fixed:
    """A vector that keeps its value of the reference, except for what drives it."""
    beams = bool((vector.at < layout.bending).all())
    return Fixed(vector, rows, _at_reference(layout, vector), drive, along, held=beams)


def _together(layout: Layout, places: list[Place], grounded: bool) -> Iterator[Constraint]:
    """Places at one point; if it is held, the first is."""
    vectors = [layout.position(place) for place in places]
    if grounded:
        yield _hold(layout, vectors[0])
    for one, two in pairwise(vectors):
        apart = two.minus(one)
        yield Fixed(apart, BOTH, np.zeros(2), held=bool((apart.at < layout.bending).all()))


def _directed(layout: Layout, place: Place, drive: Drive | None) -> Iterator[Constraint]:
    """A place whose direction the ground, or a drive there, gives."""
    if layout.is_rigid(place):
        t, ex = layout.direction(place), Vector.fixed((1.0, 0.0))
        yield Product(t, ex, QUARTER, 0.0, drive)
        return
    for vector in layout.gradients(place):
        yield _hold(layout, vector, drive=drive)


def _parallel(layout: Layout, one: Place | None, two: Place, drive: Drive | None) -> Constraint:
    """The second place, of any stretch, points where the first one, or the ground, does, turned by a drive."""
    second = layout.direction(two)
    if one is None:
        first, turn = Vector.fixed(tuple(_at_reference(layout, second))), np.eye(2)
    else:
        first = layout.direction(one)
        turn = _turn(layout, first, second)
    return Product(second, first, QUARTER @ turn, 0.0, drive)


def _aligned(
    layout: Layout, joint: Joint, one: Place, two: Place, drive: Drive | None
) -> Iterator[Constraint]:
    """The second place turns with the first, turned further by a drive."""
    rigid = layout.is_rigid(one), layout.is_rigid(two)
    if all(rigid):
        yield Product(layout.direction(two), layout.direction(one), QUARTER, 0.0, drive)
        return
    firsts = [layout.direction(one)] if rigid[0] else layout.gradients(one)
    seconds = [layout.direction(two)] if rigid[1] else layout.gradients(two)
    if not any(rigid) and len(firsts) != len(seconds):
        kinds = " and ".join(f"{layout.cut[p.body.name][1]!r} of {p.body.name!r}" for p in (one, two))
        raise DiscretisationError(
            f"{shown(joint)} joins elements {kinds}; one element kind is needed on all sides of a weld"
        )
    count = max(len(firsts), len(seconds))
    for k in range(count):
        first, second = firsts[min(k, len(firsts) - 1)], seconds[min(k, len(seconds) - 1)]
        yield Turned(first, second, _turn(layout, first, second), drive)


def _turn(layout: Layout, first: Vector, second: Vector) -> Array:
    """Turn from the first to the second in the reference; where they are in line it is free of rounding."""
    a, b = (complex(*_at_reference(layout, vector)) for vector in (first, second))
    turn = b * a.conjugate()
    turn /= abs(turn)
    if abs(turn.imag) < 8 * np.finfo(float).eps:
        turn = complex(round(turn.real))
    return np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])


def _guided(layout: Layout, guide: Guide, place: Place) -> Iterator[Constraint]:
    """A place on its line, and, driven, at its place on it."""
    position, drive = layout.position(place), _drive(guide)
    along = np.array(guide.direction)
    across = QUARTER @ along
    if guide.body is None:
        yield _hold(layout, position, across[None])
        if drive is not None:
            yield _hold(layout, position, along[None], drive, along=True)
        return
    body, at = layout.rigid[guide.body], layout.first[guide.body]
    assert isinstance(body, RigidBody)  # seen by the scene
    x, y = np.array(place.position) - body.center
    t = Vector.of([(at + 2, 1.0)])
    point = Vector(np.arange(at, at + 4), np.array([[1.0, 0.0, x, -y], [0.0, 1.0, y, x]]), np.zeros(2))
    away = position.minus(point)
    for direction, p in ((across, None), *([(along, drive)] if drive is not None else [])):
        turn = np.array([[direction[0], -direction[1]], [direction[1], direction[0]]])
        yield Product(away, t, turn, 0.0, p, along=p is not None)
