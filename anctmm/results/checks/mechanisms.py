"""Violated guides and directions of mechanisms: places that have left their line, welds that have rotated.

For scenes with rigid bodies, guides, driven welds or joints between the ends of beams. What joints hold in place or
together, and directions of beams joined at their ends, are checked by `anctmm.results.checks.constraints`.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.model.bodies import Beam
from anctmm.model.drives import table_of
from anctmm.model.joints import Guide, Joint, built_in, drive_of
from anctmm.model.kept import kept
from anctmm.model.needs import features_of
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import CENTER
from anctmm.model.scene import Clamp, Scene
from anctmm.results.checks.finding import Finding
from anctmm.results.checks.places import joined_places
from anctmm.results.fields import HermiteField, RigidField
from anctmm.results.solution import Solution

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

ADVICE = "smaller steps or a smaller newton_tolerance may help"


@kept
def is_mechanism(scene: Scene) -> bool:
    """Whether a scene has more than beams joined at their ends."""
    return bool(features_of(scene))


def mechanism_findings(
    solution: Solution, parted: float, turned: float, *, static: bool = False
) -> Iterator[Finding]:
    """Joints that are not kept.

    Parameters
    ----------
    solution : Solution
    parted, turned : float
        Distances (m) and angles (rad) above which one is not.
    static : bool
        Whether its times are load factors.
    """
    look = _Look(solution, static)
    for joint, places in _directed(solution.scene):
        for sizes, allowed, (what, *named), unit in _misfits(look, joint, places, parted, turned):
            if np.count_nonzero(sizes > allowed):  # quicker than any() where arrays are small
                k = int((sizes > allowed).argmax())
                what, body = what.format(*named), places[0].body.name
                yield Finding(k, "failed", f"{what} {sizes[k]:.2g} {unit} at {{when}}; {ADVICE}", body)
                break


@kept
def _directed(scene: Scene) -> tuple[tuple[Joint, tuple[Place, ...]], ...]:
    """Joints that hold more than positions, and the places that each joins."""
    joints = zip(built_in(scene.joints), joined_places(scene), strict=True)
    return tuple(
        (joint, places) for joint, places in joints if isinstance(joint, Guide) or joint.holds_direction
    )


#: Sizes, what is allowed, a text with what is named in it, which nearly never is asked for, and the unit.
Misfit = tuple[Array, float, tuple[Any, ...], str]


def _misfits(
    look: "_Look", joint: Joint, places: tuple[Place, ...], parted: float, turned: float
) -> Iterator[Misfit]:
    first, *others = places
    if isinstance(joint, Guide):
        yield from _from_line(look, joint, first, parted)
    if joint.holds_direction:
        yield from _from_direction(look, joint, first, others, turned)


def _from_line(look: "_Look", guide: Guide, place: Place, parted: float) -> Iterator[Misfit]:
    moved = look.path(place) - complex(*place.position)
    line = np.full(1, complex(*guide.direction))
    if guide.body is not None:
        body = look.scene.body(guide.body)
        turn, center = look.turn(Place(body, CENTER)), look.path(Place(body, CENTER))
        arm = complex(*place.position) - complex(*body.position_at(CENTER))  # type: ignore[arg-type]
        moved, line = look.path(place) - center - arm * turn, line * turn
    apart = moved * np.conj(line)
    yield np.abs(apart.imag), parted, ("{} has left its line by", place), "m"
    if guide.position is not None:
        off = np.abs(apart.real - look.history(guide))
        yield off, parted, ("{}, which is driven, is off its place on its line by", place), "m"


def _from_direction(
    look: "_Look", joint: Joint, first: Place, others: list[Place], turned: float
) -> Iterator[Misfit]:
    if isinstance(joint, Guide):
        against = np.ones(1) if joint.body is None else look.turn(Place(look.scene.body(joint.body), CENTER))
        off = np.abs(look.turn(first) - against)
        yield off, turned, ("{}, which does not turn against its line, has turned by", first), "rad"
        return
    driven = np.exp(1j * look.history(joint))
    if isinstance(joint, Clamp):
        off = np.abs(look.turn(first) - driven)
        yield off, turned, ("{}, which is clamped, has left its direction by", first), "rad"
    for other in others:
        off = np.abs(look.turn(other) - look.turn(first) * driven)
        what = "{} and {}, which are welded, have turned from each other by", first, other
        yield off, turned, what, "rad"


class _Look:
    """Paths and turns of places, as complex numbers, and histories of drives."""

    def __init__(self, solution: Solution, static: bool) -> None:
        self.solution, self.scene, self.static = solution, solution.scene, static

    def path(self, place: Place) -> Complex:
        """(n,), m."""
        found = np.ascontiguousarray(self.solution.fields[place.body.name].position(place.key))
        return np.asarray(found.view(np.complex128)[:, 0])

    def turn(self, place: Place) -> Complex:
        """Turn since the reference, of size 1, (n,); NaN where a field does not have it."""
        match self.solution.fields[place.body.name]:
            case RigidField(coordinates=q):
                return np.asarray(q[:, 1] @ np.array([1.0, 1.0j]))
            case HermiteField(coordinates=q) as field:
                beam = place.body
                assert isinstance(beam, Beam)
                node, section = round(float(place.key) * (q.shape[1] - 1)), field.sections
                gradient = q[:, node, 2 if section else 1] @ np.array([1.0, 1.0j]) * (-1j if section else 1.0)
                return np.asarray(gradient / np.abs(gradient) * np.exp(-1j * beam.angle))
            case _:
                return np.full(self.solution.t.size, np.nan + 0j)

    def history(self, joint: Joint) -> Array:
        """Angle or place of a drive at the outputs; zeros without one."""
        t = np.zeros(1) if self.static else self.solution.t
        drive = drive_of(joint)
        return np.zeros(len(t)) if drive is None else table_of(drive[0], drive[1], t, 3)[:, 0]
