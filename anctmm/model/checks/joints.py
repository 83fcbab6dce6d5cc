"""Whether the joints of a scene are compatible with each other and its bodies."""

from collections.abc import Hashable, Iterator

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
from anctmm.model.checks.conditions import Condition, conditions_of, slope_of
from anctmm.model.joints import JOINTS, Guide, Joint, check_drive
from anctmm.model.places import Graph, Place
from anctmm.model.rigid_bodies import RigidBody
from anctmm.validation import EPS

#: Relative gap up to which two ends count as one place (of the bodies' length, plus rounding of coordinates).
GAP = 1e-9
#: Factor of an equation below which it says nothing new.
INDEPENDENT = 1e-9
Row = dict[Hashable, float]
"""Factors of what an equation depends on: of a component of a vector of a place, or of a drive."""


def check_joints(scene: Graph) -> None:
    """Refuse joints that do not fit the bodies, or each other.

    RepeatedJointError or ContradictingJointsError if joints hold the same, and, if they contradict each other, drives
    move it differently; or another SceneError that names the joint.
    """
    for joint in scene.joints:
        check_drive(joint)
        _check_ends(scene, joint)
        if isinstance(joint, Guide) and joint.body is not None:
            _check_line(scene, joint, joint.body)
    held = _Held()
    for joint in scene.joints:
        conditions = conditions_of(scene, joint)
        if type(joint) in JOINTS:  # redundant ones of a user's own are his own
            held.add(joint, conditions)
        for condition in conditions:
            _check_gap(condition)


def _check_ends(scene: Graph, joint: Joint) -> None:
    """Number of ends, their names, none twice."""
    if len(joint.ends) < joint.fewest:
        raise SceneError(f"{shown(joint)} names {len(joint.ends)} end(s); {joint.fewest} or more are needed")
    places = [scene.place(name) for name in joint.places]
    if joint.holds_direction and (still := [place.body.name for place in places if not place.turns]):
        raise UnknownKindError(
            f"{shown(joint)} holds the direction of the point mass {still[0]!r}, which has none; a "
            f"{'Slider' if joint.on_line else 'Pin'} does the same there"
        )
    seen = [place.canonical for place in places]
    if twice := [place for place in places if seen.count(place.canonical) > 1]:
        raise EndJoinedTwiceError(
            f"{shown(joint)} names end {twice[0]} {len(twice)} times; an end may be in several joints, but in each of "
            f"them once"
        )


def _check_line(scene: Graph, guide: Guide, name: str) -> None:
    body = scene.body(name)
    if not isinstance(body, RigidBody):
        raise UnknownKindError(
            f"{shown(guide)} moves on a line in body {name!r}, a {type(body).__name__}; a RigidBody, or None for the "
            f"ground, is needed"
        )
    if scene.place(guide.place).body.name == name:
        raise RepeatedJointError(
            f"{shown(guide)} guides a place of body {name!r} on a line in the same body, where it is fixed already"
        )


def _check_gap(condition: Condition) -> None:
    """Places are where a joint holds them."""
    allowed = sum(float(np.abs(J).max()) * _gap(place, axis) for place, axis, J in condition.factors)
    gap = float(np.linalg.norm(condition.value))
    if gap > allowed:
        there = " and ".join(f"{place.position!r} ({place})" for place in condition.places)
        raise JointGapError(
            f"{shown(condition.joint)} joins places at {there}, which are {gap:.3g} m apart, or off what it holds; "
            f"at most {allowed:.3g} m is allowed"
        )


def _gap(place: Place, axis: int) -> float:
    """What the position of a place (0), or an axis, may be off by."""
    if axis:
        return GAP
    return GAP * place.body.extent + 8 * EPS * max(map(abs, place.position))


class _Held:
    """What joints hold, as rows of which none follows from others (in echelon form).

    As ends of flexible bodies move independently, each place counts by itself.
    """

    def __init__(self) -> None:
        self._rows: dict[Hashable, tuple[Row, list[Joint]]] = {}

    def add(self, joint: Joint, conditions: list[Condition]) -> None:
        """Add the equations of a joint; raises an error if one holds nothing new."""
        wrong = [found for row in _rows_of(conditions) if (found := self._reduced(row, joint)) is not None]
        if not wrong:
            return
        driven, others = max(wrong, key=lambda found: found[0])
        by = f"{shown(joint)} beside {' with '.join(map(shown, dict.fromkeys(others)))}"
        if driven:
            raise ContradictingJointsError(
                f"{by}: they hold the same, and drives move it differently; one of them is allowed"
            )
        raise RepeatedJointError(
            f"{by}, which hold the same already; each joint of an end must hold what the others leave free: leave one "
            f"out, or name fewer ends"
        )

    def _reduced(self, row: Row, joint: Joint) -> tuple[bool, list[Joint]] | None:
        """None if a row holds something new; else whether drives contradict each other, and the joints that hold it."""
        others: list[Joint] = []
        while (column := next((c for c in row if c in self._rows), None)) is not None:
            pivot, owners = self._rows[column]
            row = _sum(row, pivot, -row[column] / pivot[column])
            row.pop(column, None)
            others += [owner for owner in owners if owner is not joint]
        free = [column for column in row if not isinstance(column, int)]
        if not free:
            return bool(row), others
        self._rows[max(free, key=lambda column: abs(row[column]))] = row, [joint, *others]
        return None


def _rows_of(conditions: list[Condition]) -> Iterator[Row]:
    for condition in conditions:
        for m in range(len(condition.value)):
            row: Row = {}
            for place, axis, J in condition.factors:
                row = _sum(row, {(*place.canonical, axis, k): x for k, x in enumerate(J[m].tolist())})
            for w, b in condition.drives.items():
                row = _sum(row, {id(w.history): float(b[m]) * slope_of(w)})
            yield row


def _sum(row: Row, other: Row, factor: float = 1.0) -> Row:
    """A row and a multiple of another, without what is rounding."""
    found = dict(row)
    for column, value in other.items():
        found[column] = found.get(column, 0.0) + factor * value
    return {column: value for column, value in found.items() if abs(value) > INDEPENDENT}
