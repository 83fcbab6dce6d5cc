"""Whether the joints of a scene are compatible with each other and its bodies."""

from collections import Counter
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
from anctmm.model.checks.conditions import Condition, conditions_of
from anctmm.model.expressions import Signal
from anctmm.model.joints import JOINTS, Guide, Joint, check_drive
from anctmm.model.places import Graph, Place
from anctmm.model.rigid_bodies import RigidBody

#: Relative gap up to which two ends count as one place (of the bodies' length, plus rounding of coordinates).
GAP = 1e-9
#: Factor of an equation below which it says nothing new.
INDEPENDENT = 1e-9
Row = dict[Hashable, float]
"""Factors of what an equation depends on: of a component of a vector of a place, or of a drive."""


def check_joints(scene: Graph) -> None:
    """Refuse joints that do not fit.

    Raises
    ------
    SceneError
        If a joint has too few ends.
    UnknownNameError
        If an end is not part of the scene.
    PropertyError
        If a history gives nothing, or is not zero, at t = 0.
    EndJoinedTwiceError
        If a joint names an end twice.
    RepeatedJointError
        If a joint holds what others hold already.
    ContradictingJointsError
        If two joints hold one direction or position, and drives move it differently.
    JointGapError
        If the places of a joint are not where it holds them.
    UnknownKindError
        If a joint holds the direction of a point mass, which has none, or the line of a guide is in no rigid body.
    """
    held = _Held()
    for joint in scene.joints:
        check_drive(joint)
        _check_ends(scene, joint)
        if isinstance(joint, Guide) and joint.body is not None:
            _check_line(scene, joint, joint.body)
    for joint in scene.joints:
        conditions = conditions_of(scene, joint)
        if type(joint) in JOINTS:  # redundant ones of a user's own are his own
            held.add(joint, conditions)
        for condition in conditions:
            _check_gap(condition)


def _check_ends(scene: Graph, joint: Joint) -> None:
    """Number of ends, their names, none twice."""
    if len(joint.ends) < joint.fewest:
        needed = "two or more are" if joint.fewest == 2 else "one or more is"
        raise SceneError(f"{shown(joint)} names {len(joint.ends)} end(s); {needed} needed")
    places = [scene.place(name) for name in joint.places]
    for place in places:
        if not place.turns and joint.holds_direction:
            raise UnknownKindError(
                f"{shown(joint)} holds the direction of the point mass {place.body.name!r}, which has none; "
                f"a {'Slider' if joint.on_line else 'Pin'} does the same there"
            )
    times = Counter(place.canonical for place in places)
    for place in places:
        if times[place.canonical] > 1:
            raise EndJoinedTwiceError(
                f"{shown(joint)} names end {place} {times[place.canonical]} times; an end may be in several joints, "
                f"but in each of them once"
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
            f"{shown(guide)} guides a place of body {name!r} on a line in the same body, where it is fixed already; "
            f"the ground or another rigid body is needed"
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
    return GAP * place.body.extent + 8 * float(np.finfo(float).eps) * max(map(abs, place.position))


class _Held:
    """What joints hold, as rows of which none follows from others (in echelon form).

    As ends of flexible bodies move independently, each place counts by itself.
    """

    def __init__(self) -> None:
        self._rows: dict[Hashable, tuple[Row, list[Joint]]] = {}

    def add(self, joint: Joint, conditions: list[Condition]) -> None:
        """Add the equations of a joint; raises an error if one holds nothing new."""
        wrong = [found for row in _rows_of(conditions) if (found := self._reduced(row, joint)) is not None]
        if wrong:
            driven, others = max(wrong, key=lambda found: found[0])
            _raise(joint, list(dict.fromkeys(others)), driven)

    def _reduced(self, row: Row, joint: Joint) -> tuple[bool, list[Joint]] | None:
        """None if a row holds something new; else whether drives contradict each other, and the joints that hold it."""
        others: list[Joint] = []
        while (column := next((c for c in row if c in self._rows), None)) is not None:
            pivot, owners = self._rows[column]
            row = _combined(row, -row[column] / pivot[column], pivot, column)
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
                for k, value in enumerate(J[m].tolist()):
                    column = *place.canonical, axis, k
                    row[column] = row.get(column, 0.0) + value
            for w, b in condition.drives.items():
                drive = id(w.history)
                row[drive] = row.get(drive, 0.0) + float(b[m]) * _slope(w)
            yield {column: value for column, value in row.items() if abs(value) > INDEPENDENT}


def _slope(w: Signal) -> float:
    """Derivative of a signal by its history at the start."""
    return float(w.at(np.array([[w.history(0.0)[0]], [1.0], [0.0]], dtype=float))[1, 0])


def _combined(row: Row, factor: float, other: Row, without: Hashable) -> Row:
    found = dict(row)
    for column, value in other.items():
        found[column] = found.get(column, 0.0) + factor * value
    return {c: value for c, value in found.items() if c != without and abs(value) > INDEPENDENT}


def _raise(joint: Joint, others: list[Joint], driven: bool) -> None:
    by = " with ".join(map(shown, others))
    if driven:
        raise ContradictingJointsError(
            f"{shown(joint)} beside {by}: they hold the same, and drives move it differently; one of them is allowed"
        )
    raise RepeatedJointError(
        f"{shown(joint)} holds what {by} {'holds' if len(others) == 1 else 'hold'} already; an end may be in several "
        f"joints, but each must hold what the others leave free: leave one out, or name fewer ends"
    )
