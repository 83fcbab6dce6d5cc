"""Initial velocities: whether joints and drives can have those of the bodies.

Velocities of joined ends must be equal, and those of held ends zero. At a weld the gradients turn together, too: what
else is given has no meaning. At a clamp the ground or the drive says what the gradient does, whatever the body's
velocity; a difference is told by a warning, since the energy of the start then depends on the mesh.
"""

from cmath import phase
from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Protocol
from warnings import warn

import numpy as np

from anctmm.errors import JointGapError, StartWarning, shown
from anctmm.model.bodies import Beam
from anctmm.model.drives import value_at
from anctmm.model.joints import SIDES, Clamp, Joint
from anctmm.model.topology import End, junctions_of
from anctmm.model.velocities import Point

#: Difference of velocities that counts as none, of the scene's largest speed; and of rates, whose slopes are found by
#: differences.
EQUAL, EQUAL_SLOPES = 1e-9, 1e-6
EPS = float(np.finfo(float).eps)


class Starting(Protocol):
    """What is asked of a scene here; `anctmm.model.scene.Scene` has it."""

    @property
    def bodies(self) -> Sequence[Beam]:
        """All bodies."""
        ...

    @property
    def joints(self) -> Sequence[Joint]:
        """All joints."""
        ...

    def body(self, name: str) -> Beam:
        """The body of a name."""
        ...

    def body_end(self, end: str) -> tuple[Beam, int]:
        """Body and side of an end's name."""
        ...


def check_start(scene: Starting) -> None:
    """Refuse initial velocities that joints cannot have, and warn of those that clamps replace.

    Raises
    ------
    JointGapError
        Naming the ends, the velocities or rates, and what is needed.
    """
    moving = any(b.velocity is not None for b in scene.bodies) or any(map(turning_rate, scene.joints))
    if not moving or not scene.joints:
        return
    allowed = EQUAL * _largest_speed(scene) + EPS * _wave_speed(scene)
    for junction in junctions_of(scene):
        ends = [Moving.of(scene, end) for end in junction.ends]
        _check_velocities(ends, junction.grounded, allowed)
        for group, clamp in zip(junction.groups, junction.clamps, strict=True):
            first, *others = (Moving.of(scene, end) for end in group)
            for other in others:
                _check_gradients(first, other, EQUAL_SLOPES / EQUAL * allowed)
            if clamp is not None:
                _compare_turning(clamp, first, EQUAL_SLOPES / EQUAL * allowed)


def turning_rate(joint: Joint) -> float:
    """Rate at which a driven clamp turns at t = 0, rad/s; 0 of any other joint."""
    if not isinstance(joint, Clamp) or joint.angle is None:
        return 0.0
    return float(value_at(f"clamp {shown(joint.end)} angle", joint.angle, 0.0, 3)[1])


def _largest_speed(scene: Starting) -> float:
    """Largest speed of bodies and driven clamps at t = 0, m/s."""
    speeds = [b.speed for b in scene.bodies if b.velocity is not None]
    for joint in scene.joints:
        speeds.append(abs(turning_rate(joint)) * scene.body_end(joint.ends[0])[0].length)
    return max(speeds, default=0.0)


def _wave_speed(scene: Starting) -> float:
    """Largest speed of axial waves, m/s: a velocity of ε times it strains a body by ε, which rounding hides."""
    return max(sqrt(b.material.E / b.material.density) for b in scene.bodies)


@dataclass(frozen=True)
class Moving:
    """An end of a body and how it moves at t = 0; vectors of the plane are complex numbers."""

    body: Beam
    side: int

    @classmethod
    def of(cls, scene: Starting, end: End) -> "Moving":
        """That of an end's name."""
        return cls(scene.body(end[0]), end[1])

    @property
    def velocity(self) -> Point:
        """m/s."""
        return self.body.velocity_at(float(self.side))

    @property
    def gradient_rate(self) -> complex:
        """Rate of the gradient r_x, 1/s."""
        return complex(*self.body.velocity_slope_at(float(self.side))) / self.body.length

    @property
    def axis(self) -> complex:
        """Direction of the body, of length 1."""
        (x, y), (u, v) = self.body.start, self.body.end
        return complex(u - x, v - y) / self.body.length

    def __str__(self) -> str:
        return repr(f"{self.body.name}.{SIDES[self.side]}")


def _check_velocities(ends: list[Moving], grounded: bool, allowed: float) -> None:
    first, v = ends[0], ends[0].velocity
    for end in ends if grounded else ():
        if max(map(abs, end.velocity)) > allowed:
            raise JointGapError(
                f"end {end} is held and its initial velocity is {end.velocity!r} m/s; (0, 0) is needed"
            )
    for end in ends[1:]:
        if max(abs(a - b) for a, b in zip(end.velocity, v, strict=True)) > allowed:
            raise JointGapError(
                f"ends {first} and {end} are joined and their initial velocities are {v!r} and {end.velocity!r} m/s; "
                f"they must be equal"
            )


def _check_gradients(one: Moving, two: Moving, allowed: float) -> None:
    """Gradients that are welded are one, turned: so are their rates."""
    turn, rates = two.axis / one.axis, (one.gradient_rate, two.gradient_rate)
    if abs(rates[1] - turn * rates[0]) <= allowed / min(one.body.length, two.body.length):
        return
    turned = f", turned by {phase(turn):.6g} rad," if abs(turn - 1.0) > EQUAL else ""
    raise JointGapError(
        f"ends {one} and {two} are welded and velocities change along their bodies by {_pair(rates[0])} and "
        f"{_pair(rates[1])} 1/s there; these must be equal{turned} as a weld turns and stretches both alike"
    )


def _compare_turning(clamp: Clamp, end: Moving, allowed: float) -> None:
    rate, given = turning_rate(clamp), end.gradient_rate / end.axis
    if abs(given - 1j * rate) <= allowed / end.body.length:
        return
    warn(
        f"clamp {shown(clamp.end)} turns at {rate:.6g} rad/s at t = 0 and body {end.body.name!r} there at "
        f"{given.imag:.6g} rad/s, stretching by {given.real:.3g} 1/s: the clamp's node starts as the clamp does, "
        f"and the energy of the start depends on the mesh; anctmm.consistent_velocities(scene) gives velocities "
        f"that fit",
        StartWarning,
        stacklevel=5,
    )


def _pair(value: complex) -> str:
    return f"({value.real:.6g}, {value.imag:.6g})"
