"""The frame in which a scene is at rest: the ground, one that turns with a clamp, or one that moves with guides.

Small motions have modes only if the coefficients of their equations are constant in time. About a motion this is so in
the frame of its drives, if the whole scene moves with it: a clamp with a constant rate that alone holds the scene, or
guides in the ground with one constant velocity. Drives at rest at that time are held.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError, shown
from anctmm.model.connectors import Spring
from anctmm.model.drives import value_at
from anctmm.model.expressions import Signal
from anctmm.model.joints import Clamp, Guide, drive_of
from anctmm.model.scene import Scene

Array = NDArray[np.float64]

#: What counts as none: a rate and an acceleration of a drive, times the time and its square, in rad or of the scene's
#: length; a difference of two velocities, of their size.
STILL = 1e-9
VARYING = (
    "so that the coefficients of small motions change with time, and there are no modes; end the motion where its "
    "drives stand still, or take an equilibrium of solve_static"
)


class Frame(NamedTuple):
    """A frame that turns at the rate `spin`, rad/s, about the place `centre`, (2,)."""

    spin: float
    centre: Array


GROUND = Frame(0.0, np.zeros(2))


def spun(scene: Scene, spin: float, given: str = "spin is given") -> Frame:
    """The frame that turns with the one clamp of a scene; DiscretisationError if it cannot turn steadily."""
    held = [joint for joint in scene.joints if joint.grounded]
    still = [*_guides(scene), *(c for c in scene.connectors if len(c.places) < 2)]
    wrong = ""
    if scene.dim != 2:
        wrong = "is in space; a spin is for the plane"
    elif len(held) != 1 or not isinstance(held[0], Clamp):
        wrong = f"is held by {len(held)} joints; one clamp and no other joint to the ground is needed"
    elif any(scene.gravity) or scene.loads:
        wrong = "has gravity or loads; no steady state turns with them"
    elif still:
        wrong = f"has {shown(still[0])}, which stands still; all must turn with the clamp"
    if wrong:
        raise DiscretisationError(f"{given}, and scene {scene.name!r} {wrong}")
    return Frame(spin, np.array(scene.place(held[0].ends[0]).position))


def frame_at(scene: Scene, time: float, signals: Sequence[Signal] = ()) -> Frame:
    """The frame in which a scene can be steady while its drives move as they do at a time (s) of its motion.

    `signals`: all that joints depend on.

    Raises
    ------
    DiscretisationError
        If there is none: modes do not exist there.
    """
    found = GROUND
    joints = {id(drive[1]): joint for joint in scene.joints if (drive := drive_of(joint))}
    for w in {id(w.history): w for w in signals}.values():
        joint = joints.get(id(w.history))
        _, rate, acceleration = (float(x) for x in value_at(w.name, w.history, time, 3))
        given = f"about ends at t = {time:.6g} s, where {w.name} changes by {rate:.6g} per second"
        still = STILL * (scene.length if isinstance(joint, Guide) else 1.0)
        if abs(acceleration) * time**2 > still:
            raise DiscretisationError(f"{given}, and its rate by {acceleration:.6g} per second, {VARYING}")
        if abs(rate) * time <= still:
            continue
        if isinstance(joint, Clamp):
            found = spun(scene, rate, given)
        elif isinstance(joint, Guide) and joint.body is None:
            _check_carried(scene, rate * np.array(joint.direction), time, given)
        else:
            raise DiscretisationError(
                f"{given}: bodies of scene {scene.name!r} move against each other, {VARYING}"
            )
    return found


def _check_carried(scene: Scene, velocity: Array, time: float, given: str) -> None:
    """Refuse a scene that does not move as a whole with a guide in the ground, as seen from which it is at rest."""
    still: list[Any] = [
        *(joint for joint in scene.joints if joint.grounded),
        *(guide for guide in _guides(scene) if not _follows(guide, velocity, time)),
        *(c for c in scene.connectors if isinstance(c, Spring) and len(c.places) < 2),
    ]
    if still:
        raise DiscretisationError(
            f"{given}, and {shown(still[0])} of scene {scene.name!r} does not move with it, {VARYING}"
        )


def _follows(guide: Guide, velocity: Array, time: float) -> bool:
    """Whether a guide in the ground lets its place have a velocity, and gives it that if it is driven."""
    along, drive = np.array(guide.direction), drive_of(guide)
    rate = float(along @ velocity) if drive is None else float(value_at(drive[0], drive[1], time, 3)[1])
    return bool(np.linalg.norm(rate * along - velocity) <= STILL * np.linalg.norm(velocity))


def _guides(scene: Scene) -> list[Guide]:
    """Guides that are fixed in the ground."""
    return [joint for joint in scene.joints if isinstance(joint, Guide) and joint.body is None]
