"""Initial velocities: whether those of the bodies satisfy joints and drives.

Velocities of joined ends must be equal, and those of fixed ends zero. At a weld the gradients must also rotate
together. At a clamp the ground or the drive prescribes the gradient, whatever the velocity of the body; a difference
causes a warning, because the initial energy then depends on the mesh. A rigid body has no such freedom: it must move
as its joints do.
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
from anctmm.model.joints import Clamp, Guide, Joint, built_in, drive_of
from anctmm.model.places import Place, Written
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.topology import Graph, Junction, junctions_of
from anctmm.model.velocities import Point

#: Difference of velocities that counts as none, of the scene's largest speed; and of rates, whose slopes are found by
#: differences.
EQUAL, EQUAL_SLOPES = 1e-9, 1e-6
#: Where velocities that fit drives come from.
MADE = (
    "anctmm.consistent_velocities(name=…, bodies=[…], joints=[…]), of all that Scene takes, makes a scene with "
    "velocities that fit"
)
EPS = float(np.finfo(float).eps)


class Starting(Graph, Protocol):
    """The part of a scene that this module needs; `anctmm.model.scene.Scene` has it."""

    @property
    def dim(self) -> int:
        """Components of a place."""
        ...

    @property
    def beams(self) -> Sequence[Beam]:
        """Bodies that bend."""
        ...


def check_start(scene: Starting) -> None:
    """Refuse initial velocities that joints cannot have, and warn of those that clamps replace.

    Raises
    ------
    JointGapError
        Naming the ends, the velocities or rates, and what is needed.
    """
    driven = any(map(drive_rate, scene.joints))
    if not (driven or any(b.moving for b in scene.bodies)) or not scene.joints:
        return
    try:
        _check_junctions(scene)
    except JointGapError as error:
        raise JointGapError(f"{error}; {MADE}" if driven else str(error)) from None


def _check_junctions(scene: Starting) -> None:
    allowed = EQUAL * _largest_speed(scene) + EPS * _wave_speed(scene)
    allowed_turning = EQUAL_SLOPES / EQUAL * allowed
    for junction in junctions_of(scene):
        ends = [Moving(scene.place(_as_written(end))) for end in junction.ends]
        _check_velocities(ends, junction.grounded, allowed)
        if scene.dim == 3:  # rates of turning become the nearest that the joints allow
            continue
        for group, clamp in zip(junction.groups, junction.clamps, strict=True):
            first, *others = (Moving(scene.place(_as_written(end))) for end in group)
            for other in others:
                _check_gradients(first, other, 0.0, allowed_turning)
            if clamp is not None:
                _compare_turning(clamp, first, drive_rate(clamp), allowed_turning)
        _check_moving_joints(scene, junction, allowed, allowed_turning)


def _check_moving_joints(scene: Starting, junction: Junction, allowed: float, allowed_turning: float) -> None:
    """Driven welds and guides of a junction; `allowed_turning` is for velocities that come of turning, m/s."""
    for hinge in junction.hinges:
        one, *others = (Moving(scene.place(end)) for end in hinge.ends)
        for two in others:
            _check_gradients(one, two, drive_rate(hinge), allowed_turning, hinge.stretch == "held")
        if isinstance(hinge, Clamp):
            _compare_turning(hinge, one, drive_rate(hinge), allowed_turning, 7)
    for guide in junction.guides:
        spin = _check_guide(scene, guide, allowed)
        if guide.holds_direction:
            _compare_turning(guide, Moving(scene.place(guide.place)), spin, allowed_turning, 7)


def drive_rate(joint: Joint) -> float:
    """Rate at t = 0 of what drives a joint, rad/s or m/s; 0 where nothing does."""
    if (drive := drive_of(joint)) is None:
        return 0.0
    return float(value_at(drive[0], drive[1], 0.0, 3)[1])


def _largest_speed(scene: Starting) -> float:
    """Largest speed of bodies and drives at t = 0, m/s."""
    speeds = [b.speed for b in scene.bodies if b.moving]
    for joint in built_in(scene.joints):
        extent = 1.0 if joint.on_line else scene.place(joint.ends[0]).body.extent
        speeds.append(abs(drive_rate(joint)) * extent)
    return max(speeds, default=0.0)


def _wave_speed(scene: Starting) -> float:
    """Largest speed of axial waves, m/s: a velocity of ε times it strains a body by ε, which rounding hides."""
    return max((sqrt(b.material.E / b.material.density) for b in scene.beams), default=0.0)


def _as_written(end: tuple[str, float | str]) -> Written:
    return f"{end[0]}.{end[1]}" if isinstance(end[1], str) else end  # type: ignore[return-value]


@dataclass(frozen=True)
class Moving:
    """A place and how it moves at t = 0; vectors of the plane are complex numbers."""

    place: Place

    @property
    def velocity(self) -> Point:
        """m/s."""
        return self.place.velocity

    @property
    def gradient_rate(self) -> complex:
        """Rate of the gradient r_x, or of the unit vector that turns with a rigid body, 1/s."""
        match self.place.body:
            case Beam() as beam:
                return complex(*beam.velocity_slope_at(float(self.place.key))) / beam.length
            case RigidBody() as rigid:
                return 1j * rigid.spin
            case PointMass():
                return 0j

    @property
    def axis(self) -> complex:
        """That vector in the reference, of length 1."""
        body = self.place.body
        if not isinstance(body, Beam):
            return 1.0 + 0j
        (x, y), (u, v) = body.start, body.end
        return complex(u - x, v - y) / body.length

    @property
    def turning(self) -> complex:
        """Rate of stretching and i times that of turning, 1/s."""
        return self.gradient_rate / self.axis

    def __str__(self) -> str:
        return str(self.place)


def _check_velocities(ends: list[Moving], grounded: bool, allowed: float) -> None:
    first, v = ends[0], ends[0].velocity
    for end in ends if grounded else ():
        if max(map(abs, end.velocity)) > allowed:
            raise JointGapError(
                f"end {end} is held and its initial velocity is {end.velocity!r} m/s; 0 is needed"
            )
    for end in ends[1:]:
        if max(abs(a - b) for a, b in zip(end.velocity, v, strict=True)) > allowed:
            raise JointGapError(
                f"ends {first} and {end} are joined and their initial velocities are {v!r} and {end.velocity!r} m/s; "
                f"they must be equal"
            )


def _check_gradients(one: Moving, two: Moving, driven: float, allowed: float, stretch: bool = True) -> None:
    """Gradients that are welded are one, turned: so are their rates, except for what a drive adds."""
    rates = one.gradient_rate, two.gradient_rate
    extents = [m.place.body.extent for m in (one, two) if m.place.body.extent > 0.0]
    slack = EQUAL_SLOPES * max(map(abs, rates)) + max((allowed / extent for extent in extents), default=0.0)
    apart = two.turning - one.turning - 1j * driven
    if abs(apart if stretch else apart.imag) <= slack:
        return
    turn = two.axis / one.axis
    if driven:
        raise JointGapError(
            f"end {two} is driven against {one} at {driven:.6g} rad/s at t = 0, and their velocities turn them at "
            f"{two.turning.imag:.6g} and {one.turning.imag:.6g} rad/s; the difference must be that of the drive"
        )
    turned = f", turned by {phase(turn):.6g} rad," if abs(turn - 1.0) > EQUAL else ""
    raise JointGapError(
        f"ends {one} and {two} are welded and velocities change along their bodies by {_pair(rates[0])} and "
        f"{_pair(rates[1])} 1/s there; these must be equal{turned} as a weld turns and stretches both alike"
    )


def _check_guide(scene: Starting, guide: Guide, allowed: float) -> float:
    """Refuse a velocity across the line of a guide, or, driven, along it; returns the rate at which the line turns."""
    place, line = scene.place(guide.place), complex(*guide.direction)
    velocity, spin, moves = complex(*place.velocity), 0.0, "the ground"
    if guide.body is not None:
        body = scene.body(guide.body)
        assert isinstance(body, RigidBody)  # seen by the check of joints
        arm = complex(*place.position) - complex(*body.center)
        spin, moves = body.spin, f"body {body.name!r}"
        velocity -= complex(*body.velocity) + 1j * spin * arm
    along, across = (velocity * line.conjugate()).real, (velocity * line.conjugate()).imag
    if abs(across) > allowed:
        raise JointGapError(
            f"place {place} moves on a line in {moves} and its initial velocity has {across:.6g} m/s across it; "
            f"0 is needed"
        )
    if guide.position is not None and abs(along - drive_rate(guide)) > allowed:
        raise JointGapError(
            f"place {place} is driven along a line in {moves} at {drive_rate(guide):.6g} m/s at t = 0 and its initial "
            f"velocity along it is {along:.6g} m/s; they must be equal"
        )
    return spin


def _compare_turning(joint: Joint, end: Moving, rate: float, allowed: float, level: int = 6) -> None:
    """The direction that a clamp or a prismatic joint gives to an end, turning at a rate, rad/s."""
    given, body = end.turning, end.place.body
    slack = allowed / body.extent if body.extent > 0.0 else EQUAL_SLOPES * max(abs(rate), abs(given))
    apart = given - 1j * rate
    free = isinstance(joint, Clamp) and joint.stretch == "free"
    if abs(apart.imag if free else apart) <= slack:
        return
    name = f"{type(joint).__name__.lower()} {shown(joint.ends[0])}"
    if isinstance(body, RigidBody):
        raise JointGapError(
            f"{name} turns at {rate:.6g} rad/s at t = 0 and rigid body {body.name!r} at {given.imag:.6g} rad/s; "
            f"they must be equal"
        )
    warn(
        f"{name} turns at {rate:.6g} rad/s at t = 0 and body {body.name!r} there at "
        f"{given.imag:.6g} rad/s, stretching by {given.real:.3g} 1/s: the clamp's node starts as the clamp does, "
        f"and the energy of the start depends on the mesh; "
        "anctmm.consistent_velocities(scene) gives velocities that fit",
        StartWarning,
        stacklevel=level,
    )


def check_rigid_start(body: Beam, stacklevel: int = 3) -> None:
    """Warn of initial velocities that stretch or bend a body that is to be rigid.

    Parameters
    ----------
    body : Beam
    stacklevel : int
        Of the warning.
    """
    if body.velocity is None:
        return
    fractions = np.linspace(0.0, 1.0, 9)
    v = np.array([complex(*body.velocity_at(float(s))) for s in fractions])
    normal = 1j * (complex(*body.end) - complex(*body.start)) / body.length
    apart = ((v[-1] - v[0]) * normal.conjugate()).real * normal
    rigid = 0.5 * (v[0] + v[-1]) + (fractions - 0.5) * apart
    off = float(np.abs(v - rigid).max())
    if off > EQUAL_SLOPES * float(np.abs(v).max()):
        warn(
            f"body {body.name!r} is rigid and its initial velocity would stretch or bend it: it is up to {off:.3g} m/s "
            f"off a rigid motion, and the body starts with a rigid one instead; anctmm.RigidVelocity gives one",
            StartWarning,
            stacklevel=stacklevel,
        )


def _pair(value: complex) -> str:
    return f"({value.real:.6g}, {value.imag:.6g})"
