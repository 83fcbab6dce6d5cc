"""Initial velocities: whether those of the bodies satisfy joints and drives.

A clamp or a guide replaces what a beam's velocity says of the gradient there; a difference causes a warning, because
the initial energy then depends on the mesh. Everything else must fit.
"""

from math import sqrt
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import JointGapError, StartWarning, shown
from anctmm.model.bodies import Beam
from anctmm.model.checks.conditions import Condition, axes_of, conditions_of, rate_of
from anctmm.model.places import Graph, Place
from anctmm.model.velocities import turned
from anctmm.validation import EPS

Array = NDArray[np.float64]

#: Difference of velocities that counts as none, of the scene's largest speed; and of rates, whose slopes are found by
#: differences.
EQUAL, EQUAL_SLOPES = 1e-9, 1e-6
#: Where velocities that fit come from.
MADE = (
    "anctmm.consistent_velocities(scene), or (name=…, bodies=[…], joints=[…]) of all that Scene takes, gives "
    "velocities that fit"
)


def check_start(scene: Graph) -> None:
    """Refuse initial velocities that joints cannot have, and warn of those that clamps replace.

    A JointGapError names the joint, its places and their velocities.
    """
    conditions = [c for joint in scene.joints for c in conditions_of(scene, joint)]
    if not any(body.moving for body in scene.bodies) and not any(np.any(c.driven) for c in conditions):
        return
    slack = _slack(scene, conditions)
    for condition in conditions:
        rate, allowed = condition.driven, 0.0
        for place, axis, J in condition.factors:
            velocity = velocity_of(place, axis)
            rate = rate + J @ velocity
            near = slack
            if axis:
                size = place.body.extent or scene.length
                near = EQUAL_SLOPES * (float(np.abs(velocity).max()) + slack / (EQUAL * size))
            allowed += float(np.abs(J).max()) * near
        off = float(np.abs(rate).max())
        if off <= allowed:
            continue
        text = f"{_text(condition)}; they must fit to {allowed:.3g} and are off by {off:.6g}; {MADE}"
        beams = all(isinstance(place.body, Beam) for place in condition.places)
        if not (condition.directs and beams and len(condition.joint.places) == 1):
            raise JointGapError(text)
        warn(
            f"{text}. The node starts as the joint does, and the energy of the start depends on the mesh",
            StartWarning,
            stacklevel=4,
        )


def velocity_of(place: Place, axis: int) -> Array:
    """Velocity of the position of a place (0), m/s, or of one of its axes, 1/s, at t = 0, (dim,)."""
    if axis == 0:
        return np.array(place.velocity)
    if isinstance(place.body, Beam):
        return np.divide(place.body.velocity_slope_at(float(place.key)), place.body.length)
    return turned(place.body.spin, axes_of(place)[axis - 1])


def _slack(scene: Graph, conditions: list[Condition]) -> float:
    """Difference of velocities that counts as none, m/s: of the largest one, and of what strains bodies by rounding.

    A velocity of ε times the speed of axial waves strains a beam by ε.
    """
    drives = [abs(rate_of(w)) for condition in conditions for w in condition.drives]
    extents = [place.body.extent for condition in conditions for place in condition.places]
    speeds = [body.speed for body in scene.bodies if body.moving]
    speeds.append(max(drives, default=0.0) * max(extents, default=0.0))
    waves = [sqrt(beam.material.E / beam.material.density) for beam in scene.beams]
    return EQUAL * max(speeds) + EPS * max(waves, default=0.0)


def _text(condition: Condition) -> str:
    """The joint of a condition, and what moves how."""
    moves = list[str]()
    for place, axis, _ in condition.factors:
        what, unit = (f"axis {axis} of {place} changes", "1/s") if axis else (f"{place} moves", "m/s")
        velocity = ", ".join(f"{x + 0.0:.6g}" for x in velocity_of(place, axis))
        moves.append(f"{what} at ({velocity}) {unit}")
    for w in {id(w.history): w for w in condition.drives}.values():
        moves.append(f"{w.name} changes at {float(w.history(0.0)[1]):.6g} per second")
    return f"initial velocities do not fit {shown(condition.joint)}: {', '.join(moves)}"


def check_rigid_start(body: Beam, stacklevel: int = 3) -> None:
    """Warn of initial velocities that stretch or bend a body that is to be rigid."""
    if body.velocity is None:
        return
    fractions = np.linspace(0.0, 1.0, 9)
    v = np.array([body.velocity_at(float(s)) for s in fractions])
    along = np.subtract(body.end, body.start) / body.length
    across = v[-1] - v[0] - ((v[-1] - v[0]) @ along) * along
    rigid = 0.5 * (v[0] + v[-1]) + (fractions[:, None] - 0.5) * across
    off = float(np.linalg.norm(v - rigid, axis=1).max())
    if off > EQUAL_SLOPES * float(np.abs(v).max()):
        warn(
            f"body {body.name!r} is rigid and its initial velocity would stretch or bend it: it is up to {off:.3g} m/s "
            f"off a rigid motion, and the body starts with a rigid one instead; anctmm.RigidVelocity gives one",
            StartWarning,
            stacklevel=stacklevel,
        )
