"""Whether the joints of a scene fit each other and its bodies: no hold twice, no gap, one velocity at a place."""

from collections import deque
from collections.abc import Sequence
from math import hypot
from typing import NamedTuple, Protocol

import numpy as np

from anctmm.errors import (
    ContradictingJointsError,
    EndJoinedTwiceError,
    JointGapError,
    RepeatedJointError,
    SceneError,
)
from anctmm.model.joints import Clamp, Joint, Weld
from anctmm.model.topology import End, Sets, end_of

Point = tuple[float, float]
#: Relative gap up to which two ends count as one place (of the bodies' length, plus rounding of coordinates).
GAP = 1e-9
#: Relative difference up to which two velocities count as equal.
SPEED = 1e-9
#: The ground, among the ends of bodies.
GROUND: End = ("", -1)


class Placed(Protocol):
    """What is asked of a body here; `anctmm.model.scene.Beam` has it."""

    @property
    def name(self) -> str:
        """Unique in its scene."""
        ...

    @property
    def start(self) -> Point:
        """Place of side 0, m."""
        ...

    @property
    def end(self) -> Point:
        """Place of side 1, m."""
        ...

    @property
    def length(self) -> float:
        """Undeformed length, m."""
        ...

    def velocity_at(self, fraction: float) -> Point:
        """Initial velocity, m/s."""
        ...


class Jointed(Protocol):
    """What is asked of a scene here."""

    @property
    def joints(self) -> Sequence[Joint]:
        """All joints."""
        ...

    @property
    def bodies(self) -> Sequence[Placed]:
        """All bodies."""
        ...

    def body_end(self, end: str) -> tuple[Placed, int]:
        """Body and side of an end's name."""
        ...


def check_joints(scene: Jointed) -> None:
    """Refuse joints that do not fit.

    Raises
    ------
    SceneError
        If a joint has too few ends.
    UnknownNameError
        If an end is not part of the scene.
    EndJoinedTwiceError
        If a joint names an end twice.
    RepeatedJointError
        If a joint holds what others hold already.
    ContradictingJointsError
        If two clamps, one of them driven, hold ends that are welded to each other.
    JointGapError
        If ends of one place lie apart or have different velocities, or an end that is held moves.
    """
    for joint in scene.joints:
        _check_ends(scene, joint)
    _check_repeats(scene)
    _check_places(scene)


def _check_ends(scene: Jointed, joint: Joint) -> None:
    """Number of ends, their names, none twice."""
    least = 2 if isinstance(joint, Weld) else 1
    if len(joint.ends) < least:
        needed = "two or more are" if least == 2 else "one or more is"
        raise SceneError(f"{joint!r} names {len(joint.ends)} end(s); {needed} needed")
    known = [end_of(scene, name) for name in joint.ends]
    for name, end in zip(joint.ends, known, strict=True):
        if known.count(end) > 1:
            raise EndJoinedTwiceError(
                f"{joint!r} names end {name!r} {known.count(end)} times; an end may be in several joints, "
                f"but in each of them once"
            )


def _check_repeats(scene: Jointed) -> None:
    """Every joint must hold something that the joints before it leave free.

    As ends of flexible bodies move independently, it is enough that the holds of places, drawn as edges between ends
    and the ground, close no circle: what holds a direction (a weld, a clamp) holds the place, too.
    """
    places = Sets[End]()
    edges: dict[End, list[tuple[End, Joint]]] = {}
    for joint in scene.joints:
        first, *others = (end_of(scene, name) for name in joint.ends)
        for other in [*others, GROUND] if joint.grounded else others:
            if not places.unite(first, other):
                raise _repeated(joint, first, other, _path(edges, first, other))
            edges.setdefault(first, []).append((other, joint))
            edges.setdefault(other, []).append((first, joint))


def _path(edges: dict[End, list[tuple[End, Joint]]], start: End, goal: End) -> list[Joint]:
    """Joints that connect two ends, each once, in their order on the shortest way."""
    came: dict[End, tuple[End, Joint]] = {}
    queue = deque([start])
    while goal not in came:
        here = queue.popleft()
        for there, joint in edges.get(here, []):
            if there not in came and there != start:
                came[there] = here, joint
                queue.append(there)
    way, here = [], goal
    while here != start:
        here, joint = came[here]
        way.append(joint)
    return list(dict.fromkeys(reversed(way)))


def _repeated(joint: Joint, one: End, two: End, others: list[Joint]) -> SceneError:
    """The error that says what a joint repeats."""
    by = " with ".join(map(repr, others))
    clamps = [j for j in (joint, *others) if isinstance(j, Clamp)]
    if len(clamps) == 2 and all(isinstance(j, Clamp | Weld) for j in (joint, *others)):
        driven = any(clamp.angle is not None for clamp in clamps)
        what = f"both hold the direction of {_text(one)}{', one of them driven' if driven else ''}"
        return (ContradictingJointsError if driven else RepeatedJointError)(
            f"{joint!r} beside {by}: two clamps {what}; one clamp is allowed for ends welded to each other"
        )
    held = f"the place of {_text(one)}" if two == GROUND else f"{_text(one)} and {_text(two)} at one place"
    remedy = "leave one out" if two == GROUND or len(joint.ends) == 2 else "name one of these ends only"
    return RepeatedJointError(
        f"{joint!r} holds {held}, as {by} {'does' if len(others) == 1 else 'do'} already; "
        f"an end may be in several joints, but each must hold what the others leave free: {remedy}"
    )


def _text(end: End) -> str:
    """An end as messages name it."""
    return "the ground" if end == GROUND else repr(f"{end[0]}.{('start', 'end')[end[1]]}")


class Met(NamedTuple):
    """An end of a body as joints meet it: place (m), length of its body (m), initial velocity (m/s)."""

    end: End
    place: Point
    length: float
    velocity: Point


def _met(scene: Jointed, name: str) -> Met:
    body, side = scene.body_end(name)
    return Met((body.name, side), (body.start, body.end)[side], body.length, body.velocity_at(float(side)))


def _check_places(scene: Jointed) -> None:
    """Ends of one place lie there and move as one; an end that is held rests."""
    ends = {name: _met(scene, name) for joint in scene.joints for name in joint.ends}
    places = Sets[End]()
    for joint in scene.joints:
        for name in joint.ends[1:]:
            places.unite(ends[joint.ends[0]].end, ends[name].end)
    before: dict[End, Met] = {}
    for joint in scene.joints:
        first, *others = (ends[name] for name in joint.ends)
        for other in others:
            _check_meeting(joint, first, other)
        # small gaps must not add up from joint to joint
        _check_meeting(joint, before.setdefault(places.of(first.end), first), first)
        if joint.grounded and first.velocity != (0.0, 0.0):
            raise JointGapError(
                f"{joint!r} holds {_text(first.end)}, whose initial velocity is {first.velocity!r} m/s; "
                f"(0, 0) is needed"
            )


def _check_meeting(joint: Joint, a: Met, b: Met) -> None:
    """Two ends that a joint, maybe with the help of others, holds at one place."""
    (p, q), (u, v) = (a.place, b.place), (a.velocity, b.velocity)
    rounding = 8 * np.finfo(float).eps * max(map(abs, p + q))
    gap, allowed = hypot(q[0] - p[0], q[1] - p[1]), GAP * min(a.length, b.length) + rounding
    if gap > allowed:
        raise JointGapError(
            f"{joint!r} joins ends at {p!r} ({_text(a.end)}) and {q!r} ({_text(b.end)}), {gap:.3g} m apart; "
            f"at most {allowed:.3g} m is allowed"
        )
    if hypot(v[0] - u[0], v[1] - u[1]) > SPEED * max(map(abs, (*u, *v))):
        raise JointGapError(
            f"{joint!r} joins ends whose initial velocities are {u!r} ({_text(a.end)}) and {v!r} "
            f"({_text(b.end)}) m/s; they must be equal"
        )
