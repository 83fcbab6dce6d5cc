"""The frame in which a scene is at rest: the ground, or one that turns with a clamp.

Small motions have modes only if the coefficients of their equations are constant in time. About a motion this is so in
the frame of a clamp with a constant rate that alone holds the scene. Drives at rest at that time are held.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError, shown
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
    still: list[object] = [joint for joint in scene.joints if isinstance(joint, Guide) and joint.body is None]
    still += [connector for connector in scene.connectors if len(connector.places) < 2]
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

    `signals`: all that joints depend on. DiscretisationError if there is none: modes do not exist there.
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
        if not isinstance(joint, Clamp):
            who = f"bodies of scene {scene.name!r} move against each other or the ground"
            raise DiscretisationError(f"{given}: {who}, {VARYING}")
        found = spun(scene, rate, given)
    return found
