"""Whether sliders, prismatic joints and driven welds are compatible with the other joints and not redundant."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import ContradictingJointsError, RepeatedJointError, UnknownKindError, shown
from anctmm.model.joints import Clamp, Guide, Joint
from anctmm.model.places import End
from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.topology import Graph, Junction, Sets, junctions_of

#: Smallest singular value of the directions that guides of one place hold, below which they hold one twice.
INDEPENDENT = 1e-9


def check_guides(scene: Graph) -> None:
    """Refuse guides that do not fit.

    Raises
    ------
    UnknownKindError
        If the line of a guide is fixed in a body that is not rigid.
    UnknownNameError
        If it is fixed in a body that the scene does not have.
    RepeatedJointError
        If a guide holds what other joints hold already.
    ContradictingJointsError
        If two joints, one of them driven, hold one direction.
    """
    for joint in scene.joints:
        if isinstance(joint, Guide) and joint.body is not None:
            _check_line(scene, joint, joint.body)
    for junction in junctions_of(scene):
        if junction.guides:
            _check_places(junction)
            _check_directions(scene, junction)


def _check_line(scene: Graph, guide: Guide, name: str) -> None:
    body = scene.body(name)
    if not isinstance(body, RigidBody):
        raise UnknownKindError(
            f"{shown(guide)} moves on a line in body {name!r}, a {type(body).__name__}; a RigidBody, or None for the "
            f"ground, is needed"
        )
    if scene.place(guide.place).body.name == name:
        raise RepeatedJointError(
            f"{shown(guide)} guides a place of body {name!r} on a line in the same body, where it is fixed already; "
            f"the ground or another rigid body is needed"
        )


def _check_places(junction: Junction) -> None:
    """In each body, and in the ground, guides hold independent directions, and nothing that is held already."""
    for name in dict.fromkeys(guide.body for guide in junction.guides):
        guides = [guide for guide in junction.guides if guide.body == name]
        there = "the ground" if name is None else f"body {name!r}"
        if junction.grounded if name is None else any(end[0] == name for end in junction.ends):
            raise RepeatedJointError(
                f"{shown(guides[0])} guides a place that other joints hold at one point of {there}; "
                f"leave one of them out"
            )
        held = np.array([row for guide in guides for row in _held(guide)])
        if len(held) > 2 or np.linalg.svd(held, compute_uv=False)[-1] < INDEPENDENT:
            raise RepeatedJointError(
                f"{' and '.join(map(shown, guides))} guide one place and hold {len(held)} components of its position "
                f"in {there}, not all independent; two lines that cross, or one, are allowed"
            )


def _held(guide: Guide) -> Iterator[NDArray[np.float64]]:
    """Directions in which a guide holds its place, (2,)."""
    x, y = guide.direction
    yield np.array([-y, x])
    if guide.position is not None:
        yield np.array([x, y])


def _check_directions(scene: Graph, junction: Junction) -> None:
    """No direction is held twice by the ground or by one body, through welds, fixed or driven."""
    turning = Sets[End]()
    for group in junction.groups:
        for end in group[1:]:
            turning.unite(group[0], end)
    for hinge in junction.hinges:
        first, *others = (scene.place(place).end for place in hinge.ends)
        for end in others:
            turning.unite(first, end)
    holds: dict[tuple[End, str | None], Joint] = {}
    clamped: list[tuple[End, Joint]] = [
        (group[0], clamp)
        for group, clamp in zip(junction.groups, junction.clamps, strict=True)
        if clamp is not None
    ]
    clamped += [(scene.place(hinge.end).end, hinge) for hinge in junction.hinges if isinstance(hinge, Clamp)]
    guided: list[tuple[End, Joint]] = [
        (scene.place(g.place).end, g) for g in junction.guides if g.holds_direction
    ]
    for end, joint in clamped + guided:
        body = None if isinstance(joint, Clamp) else joint.body  # type: ignore[attr-defined]
        other = holds.setdefault((turning.of(end), body), joint)
        if other is not joint:
            driven = any(isinstance(j, Clamp) and j.angle is not None for j in (joint, other))
            raise (ContradictingJointsError if driven else RepeatedJointError)(
                f"{shown(joint)} beside {shown(other)}: both hold the direction of ends welded to each other, or of "
                f"one; one of them is allowed"
            )
