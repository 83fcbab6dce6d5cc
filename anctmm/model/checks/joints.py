"""Whether the joints of a scene are compatible with each other and its bodies."""

from collections import Counter, deque
from math import dist

import numpy as np

from anctmm.errors import (
    ContradictingJointsError,
    EndJoinedTwiceError,
    JointGapError,
    RepeatedJointError,
    SceneError,
    UnknownKindError,
    shown,
)
from anctmm.model.checks.guides import check_guides
from anctmm.model.joints import Clamp, Joint, Pin, Prismatic, Revolute, Slider, Weld, built_in, unknown_joint
from anctmm.model.places import End, Place, place_text
from anctmm.model.topology import Graph, Sets

#: Relative gap up to which two ends count as one place (of the bodies' length, plus rounding of coordinates).
GAP = 1e-9
#: The ground, among the ends of bodies.
GROUND: End = ("", -1)


def check_joints(scene: Graph) -> None:
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
        If ends of one place lie apart.
    UnknownKindError
        If a joint holds the direction of a point mass, which has none, or the line of a guide is in no rigid body.
    """
    for joint in built_in(scene.joints):
        _check_ends(scene, joint)
    _check_repeats(scene)
    _check_places(scene)
    check_guides(scene)


def _check_ends(scene: Graph, joint: Joint) -> None:
    """Number of ends, their names, none twice."""
    least = fewest_ends(joint)
    if len(joint.ends) < least:
        needed = "two or more are" if least == 2 else "one or more is"
        raise SceneError(f"{shown(joint)} names {len(joint.ends)} end(s); {needed} needed")
    places = [scene.place(name) for name in joint.ends]
    known = [place.canonical for place in places]
    for place in places:
        if not place.turns and joint.holds_direction:
            raise UnknownKindError(
                f"{shown(joint)} holds the direction of the point mass {place.body.name!r}, which has none; "
                f"a {'Slider' if joint.on_line else 'Pin'} does the same there"
            )
    times = Counter(known)
    for name, end in zip(joint.ends, known, strict=True):
        if times[end] > 1:
            raise EndJoinedTwiceError(
                f"{shown(joint)} names end {shown(name)} {times[end]} times; an end may be in several joints, "
                f"but in each of them once"
            )


def fewest_ends(joint: Joint) -> int:
    """Ends that a joint needs at least."""
    match joint:
        case Pin() | Clamp() | Slider() | Prismatic() | Revolute():
            return 1
        case Weld():
            return 2
    raise unknown_joint(joint)


def _check_repeats(scene: Graph) -> None:
    """Every joint must hold something that the joints before it leave free.

    As ends of flexible bodies move independently, it is enough that the holds of places, drawn as edges between ends
    and the ground, close no circle: what holds a direction (a weld, a clamp) holds the place, too.
    """
    places = Sets[End]()
    edges: dict[End, list[tuple[End, Joint]]] = {}
    for joint in built_in(scene.joints):
        ends = [scene.place(name).canonical for name in joint.ends] + [GROUND] * joint.grounded
        there: dict[End, End] = {}
        for end in ends:
            before = there.setdefault(places.of(end), end)
            if before != end:
                raise _repeated(joint, before, end, _path(edges, before, end))
        for end in ends[1:]:
            places.unite(ends[0], end)
            edges.setdefault(ends[0], []).append((end, joint))
            edges.setdefault(end, []).append((ends[0], joint))


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
    by = " with ".join(map(shown, others))
    clamps = [j for j in (joint, *others) if isinstance(j, Clamp)]
    if len(clamps) == 2 and all(isinstance(j, Clamp | Weld) for j in (joint, *others)):
        driven = any(clamp.angle is not None for clamp in clamps)
        what = f"both hold the direction of {end_text(one)}{', one of them driven' if driven else ''}"
        return (ContradictingJointsError if driven else RepeatedJointError)(
            f"{shown(joint)} beside {by}: two clamps {what}; one clamp is allowed for ends welded to each other"
        )
    held = (
        f"the place of {end_text(one)}"
        if two == GROUND
        else f"{end_text(one)} and {end_text(two)} at one place"
    )
    remedy = "leave one out" if two == GROUND or len(joint.ends) == 2 else "name one of these ends only"
    return RepeatedJointError(
        f"{shown(joint)} holds {held}, as {by} {'does' if len(others) == 1 else 'do'} already; "
        f"an end may be in several joints, but each must hold what the others leave free: {remedy}"
    )


def end_text(end: End) -> str:
    """An end as messages name it."""
    return "the ground" if end == GROUND else place_text(end)


def _check_places(scene: Graph) -> None:
    """Ends of one place lie there."""
    ends = {name: scene.place(name) for joint in built_in(scene.joints) for name in joint.ends}
    places = Sets[End]()
    for joint in built_in(scene.joints):
        for name in joint.ends[1:]:
            places.unite(ends[joint.ends[0]].canonical, ends[name].canonical)
    before: dict[End, Place] = {}
    for joint in built_in(scene.joints):
        first, *others = (ends[name] for name in joint.ends)
        for other in others:
            _check_meeting(joint, first, other)
        # small gaps must not add up from joint to joint
        _check_meeting(joint, before.setdefault(places.of(first.canonical), first), first)


def _check_meeting(joint: Joint, a: Place, b: Place) -> None:
    """Two ends that a joint, maybe with the help of others, holds at one place."""
    p, q = a.position, b.position
    rounding = 8 * np.finfo(float).eps * max(map(abs, p + q))
    extent = min((place.body.extent for place in (a, b) if place.body.extent > 0.0), default=0.0)
    gap, allowed = dist(p, q), GAP * extent + rounding
    if gap > allowed:
        raise JointGapError(
            f"{shown(joint)} joins ends at {p!r} ({a}) and {q!r} ({b}), {gap:.3g} m apart; "
            f"at most {allowed:.3g} m is allowed"
        )
