"""The frame in which a scene is at rest: the ground, one that rotates with a clamp, or one that moves with guides.

Small motions have modes only if the coefficients of their equations are constant in time. About a motion this is so in
the frame of its drives, if the whole scene moves with it: a clamp with a constant rate that alone holds the scene, or
guides in the ground with one constant velocity. Drives at rest at that time are held.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError, shown
from anctmm.model.connectors import Spring
from anctmm.model.drives import value_at
from anctmm.model.joints import Clamp, Guide, Joint, Pin, Prismatic, Slider, Weld, drive_of
from anctmm.model.scene import Scene

Array = NDArray[np.float64]

#: Rate and acceleration of a drive, times the time and its square, that count as none: rad, or of the scene's length.
STILL = 1e-9
#: Sine of the angle between two directions that count as one.
PARALLEL = 1e-9


class Frame(NamedTuple):
    """A frame that moves steadily.

    Parameters
    ----------
    spin : float
        Its rate of turn, rad/s.
    centre : ndarray, shape (2,)
        Place about which it turns.
    """

    spin: float
    centre: Array


class _Moving(NamedTuple):
    """A joint whose drive moves: the drive's name, its unit, its rate."""

    joint: Joint
    name: str
    unit: str
    rate: float

    def __str__(self) -> str:
        return f"{self.name} changes by {self.rate:.6g} {self.unit}/s"


GROUND = Frame(0.0, np.zeros(2))
VARYING = "so that the coefficients of small motions change with time, and there are no modes"
HINT = "end the motion where its drives stand still, or take an equilibrium of solve_static"


def spun(scene: Scene, spin: float) -> Frame:
    """The frame that turns with the one clamp of a scene.

    Raises
    ------
    DiscretisationError
        If the scene cannot turn steadily.
    """
    return Frame(spin, _centre(scene, "spin is given"))


def frame_at(scene: Scene, time: float) -> Frame:
    """The frame in which a scene can be steady while its drives move as they do at a time of its motion.

    Raises
    ------
    DiscretisationError
        If there is none: modes do not exist there.
    """
    found = GROUND
    for moving in _moving(scene, time):
        given = f"about ends at t = {time:.6g} s, where {moving}"
        match moving.joint:
            case Clamp():
                found = Frame(moving.rate, _centre(scene, given))
            case Slider() | Prismatic() as guide if guide.body is None:
                _check_carried(scene, guide, moving.rate, time, given)
            case Weld() | Slider() | Prismatic() | Pin():
                raise DiscretisationError(
                    f"{given}: bodies of scene {scene.name!r} move against each other, {VARYING}; {HINT}"
                )
    return found


def _moving(scene: Scene, time: float) -> list[_Moving]:
    """Joints whose drives move at a time, each at a constant rate."""
    found = []
    for joint in scene.joints:
        if (drive := drive_of(joint)) is None:
            continue
        name, history, unit = drive
        _, rate, acceleration = (float(x) for x in value_at(name, history, time, 3))
        still = STILL * (1.0 if unit == "rad" else scene.length)
        if abs(acceleration) * time**2 > still:
            raise DiscretisationError(
                f"about ends at t = {time:.6g} s, where {name} changes by {rate:.6g} {unit}/s and {acceleration:.6g} "
                f"{unit}/s²: no frame moves steadily there, {VARYING}; {HINT}"
            )
        if abs(rate) * time > still:
            found.append(_Moving(joint, name, unit, rate))
    return found


def _centre(scene: Scene, given: str) -> Array:
    """Place that a scene turns about with its one clamp."""
    clamps = [joint for joint in scene.joints if isinstance(joint, Clamp)]
    held = [joint for joint in scene.joints if joint.grounded]
    if len(clamps) != 1 or len(held) != 1:
        raise DiscretisationError(
            f"{given}, and scene {scene.name!r} is held by {len(held)} joints, {len(clamps)} of them clamps; "
            f"a steady rotation needs one clamp and no other joint to the ground"
        )
    if any(scene.gravity) or scene.loads:
        raise DiscretisationError(
            f"{given}, and scene {scene.name!r} has gravity or loads; no steady state turns with them"
        )
    still = [*_guides(scene), *(c for c in scene.connectors if len(c.places) < 2)]
    if still:
        raise DiscretisationError(
            f"{given}, and {shown(still[0])} of scene {scene.name!r} stands still; all must turn with the clamp"
        )
    return np.array(scene.place(clamps[0].end).position)


def _check_carried(scene: Scene, guide: Slider | Prismatic, rate: float, time: float, given: str) -> None:
    """Refuse a scene that does not move as a whole with a guide in the ground, as seen from which it is at rest."""
    along = np.array(guide.direction)
    still: list[object] = [
        *(joint for joint in scene.joints if joint.grounded),
        *(other for other in _guides(scene) if not _follows(other, rate * along, time)),
        *(c for c in scene.connectors if isinstance(c, Spring) and len(c.places) < 2),
    ]
    if still:
        raise DiscretisationError(
            f"{given}, and {shown(still[0])} of scene {scene.name!r} does not move with it, {VARYING}; {HINT}"
        )


def _follows(guide: Slider | Prismatic, velocity: Array, time: float) -> bool:
    """Whether a guide in the ground lets its place have a velocity, and gives it that if it is driven."""
    along = np.array(guide.direction)
    if (drive := drive_of(guide)) is not None:
        rate = float(value_at(drive[0], drive[1], time, 3)[1])
    else:
        rate = float(along @ velocity)
    return bool(np.linalg.norm(rate * along - velocity) <= PARALLEL * np.linalg.norm(velocity))


def _guides(scene: Scene) -> list[Guide]:
    """Guides that are fixed in the ground."""
    return [joint for joint in scene.joints if isinstance(joint, Guide) and joint.body is None]
