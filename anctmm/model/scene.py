"""The physics of a scene: bodies, joints, loads and gravity. It knows no mesh, no step and no solver."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from math import atan2, hypot
from typing import Any

import numpy as np

from anctmm.errors import (
    DegenerateBodyError,
    DuplicateNameError,
    PropertyError,
    SceneError,
    UnknownNameError,
)
from anctmm.model.drives import tabulate
from anctmm.model.joint_checks import check_joints
from anctmm.model.joints import Clamp, Joint, Pin, Weld
from anctmm.model.sections import Section
from anctmm.validation import not_negative, number, positive, vector, within

Point = tuple[float, float]
Probe = str | tuple[str, float]


def distance(a: Point, b: Point) -> float:
    """Distance of two points, m."""
    return hypot(b[0] - a[0], b[1] - a[1])


@dataclass(frozen=True)
class Material:
    """Isotropic linear (Saint Venant-Kirchhoff) material.

    Parameters
    ----------
    E : float
        Young's modulus, Pa.
    density : float
        kg/m³.
    poisson : float
        Poisson's ratio, in [0, ½). Only the shear element sees it; note its Poisson locking.
    damping : float
        Kelvin-Voigt damping τ, s: the stress is that of the strains plus τ times their rates. A mode of angular
        frequency ω then has the damping ratio τω/2.
    """

    E: float
    density: float
    poisson: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        positive("material E (Pa)", self.E)
        positive("material density (kg/m³)", self.density)
        within("material poisson", self.poisson, 0.0, 0.5, "[)")
        not_negative("material damping (s)", self.damping)

    def __repr__(self) -> str:
        # what is absent is not written: texts and keys of undamped scenes stay as they are
        damping = f", damping={self.damping!r}" if self.damping else ""
        return f"Material(E={self.E!r}, density={self.density!r}, poisson={self.poisson!r}{damping})"

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's first parameter λ and the shear modulus G, Pa."""
        nu = self.poisson
        return self.E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), self.E / (2.0 * (1.0 + nu))


@dataclass(frozen=True)
class Beam:
    """A flexible body, straight and free of stress between `start` and `end`.

    Parameters
    ----------
    name : str
        Its ends are called "name.start" and "name.end".
    start, end : (float, float)
        m.
    section : Section
    material : Material
    velocity : callable, optional
        fraction of the length in [0, 1] → (vx, vy), m/s, at t = 0; at rest without it.
    """

    name: str
    start: Point
    end: Point
    section: Section
    material: Material
    velocity: Callable[[float], Point] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise PropertyError(f"beam name is {self.name!r}; a non-empty string is needed")
        object.__setattr__(self, "start", vector(f"beam {self.name!r} start (m)", self.start))
        object.__setattr__(self, "end", vector(f"beam {self.name!r} end (m)", self.end))
        if not isinstance(self.section, Section):
            raise PropertyError(f"beam {self.name!r} section is {self.section!r}; a Section is needed")
        if not isinstance(self.material, Material):
            raise PropertyError(f"beam {self.name!r} material is {self.material!r}; a Material is needed")
        if self.velocity is not None and not callable(self.velocity):
            raise PropertyError(
                f"beam {self.name!r} velocity is {self.velocity!r}; None or a callable fraction -> (vx, vy) is allowed"
            )
        if self.length == 0.0:
            raise DegenerateBodyError(
                f"beam {self.name!r} has length 0: start and end are both {self.start!r}; "
                f"two distinct points are needed"
            )

    @property
    def length(self) -> float:
        """Undeformed length, m."""
        return distance(self.start, self.end)

    @property
    def angle(self) -> float:
        """Direction from start to end, rad."""
        return atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])

    def velocity_at(self, fraction: float) -> Point:
        """Initial velocity at a fraction of the length, m/s."""
        if self.velocity is None:
            return (0.0, 0.0)
        return vector(f"beam {self.name!r} velocity at fraction {fraction!r} (m/s)", self.velocity(fraction))


@dataclass(frozen=True)
class Force:
    """Dead force on an end: constant (Fx, Fy) or t → (Fx, Fy), N."""

    end: str
    value: Point | Callable[[Any], Point]

    def __post_init__(self) -> None:
        if not callable(self.value):
            object.__setattr__(self, "value", vector(f"force on {self.end!r} (N)", self.value))


@dataclass(frozen=True)
class Torque:
    """Moment on an end, positive counter-clockwise: constant or t → moment, N m.

    It acts on the direction of the section: on r_x of a cable (whose section stays normal to its axis), on
    r_y of a shear-deformable element.
    """

    end: str
    value: float | Callable[[Any], float]

    def __post_init__(self) -> None:
        if not callable(self.value):
            object.__setattr__(self, "value", number(f"torque on {self.end!r} (N m)", self.value))


Load = Force | Torque


@dataclass(frozen=True)
class Scene:
    """A planar system of beams, validated on construction.

    Parameters
    ----------
    name : str
    bodies : iterable of Beam
    joints : iterable of Pin, Weld, Clamp
        Edges of a graph, which may branch and close loops. A body without a joint is free.
    loads : iterable of Force, Torque
    gravity : (float, float)
        m/s².

    Raises
    ------
    SceneError
        Or one of its kinds, naming the thing, its value and what is allowed.
    """

    name: str
    bodies: tuple[Beam, ...]
    joints: tuple[Joint, ...] = ()
    loads: tuple[Load, ...] = ()
    gravity: Point = (0.0, 0.0)
    _by_name: dict[str, Beam] = field(init=False, repr=False, compare=False, hash=False)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        if not isinstance(self.name, str) or not self.name:
            raise PropertyError(f"scene name is {self.name!r}; a non-empty string is needed")
        set_(self, "bodies", _all_of("bodies", self.bodies, (Beam,)))
        set_(self, "joints", _all_of("joints", self.joints, (Pin, Weld, Clamp)))
        set_(self, "loads", _all_of("loads", self.loads, (Force, Torque)))
        set_(self, "gravity", vector("gravity (m/s²)", self.gravity))
        if not self.bodies:
            raise SceneError(f"scene {self.name!r} has no bodies; at least one is needed")
        set_(self, "_by_name", {b.name: b for b in self.bodies})
        if len(self._by_name) < len(self.bodies):
            names = [b.name for b in self.bodies]
            twice = next(n for n in names if names.count(n) > 1)
            raise DuplicateNameError(
                f"body name {twice!r} is used {names.count(twice)} times; once is allowed"
            )
        check_joints(self)
        for joint in self.joints:
            if isinstance(joint, Clamp) and joint.angle is not None:
                _check_angle(joint)
        for load in self.loads:
            self.body_end(load.end)

    def body(self, name: str) -> Beam:
        """The body of a name; raises UnknownNameError."""
        try:
            return self._by_name[name]
        except (KeyError, TypeError):
            raise UnknownNameError(
                f"body {name!r} is not in scene {self.name!r}; it has {', '.join(map(repr, self._by_name))}"
            ) from None

    def body_end(self, end: str) -> tuple[Beam, int]:
        """Body and side (0 start, 1 end) of an end's name such as "crank.start"; raises UnknownNameError."""
        name, dot, side = end.rpartition(".") if isinstance(end, str) else ("", "", "")
        if not dot or side not in ("start", "end"):
            raise UnknownNameError(f"end {end!r} is not a body's end; allowed is 'name.start' or 'name.end'")
        return self.body(name), int(side == "end")

    def probe(self, probe: Probe) -> tuple[str, float]:
        """Body and fraction of its undeformed length of a probe: "name.end" or ("name", fraction)."""
        if isinstance(probe, str):
            body, side = self.body_end(probe)
            return body.name, float(side)
        name, fraction = probe
        return self.body(name).name, within(f"probe fraction on {name!r}", fraction, 0.0, 1.0, "[]")


def _all_of(what: str, things: Iterable[Any], kinds: tuple[type, ...]) -> tuple[Any, ...]:
    if isinstance(things, str) or not isinstance(things, Iterable):
        raise SceneError(
            f"scene {what} is {things!r}; a list of {', '.join(k.__name__ for k in kinds)} is needed"
        )
    things = tuple(things)
    for thing in things:
        if not isinstance(thing, kinds):
            raise SceneError(
                f"scene {what} hold {thing!r}; allowed are {', '.join(k.__name__ for k in kinds)}"
            )
    return things


def _check_angle(clamp: Clamp) -> None:
    if not callable(clamp.angle):
        raise PropertyError(
            f"clamp {clamp.end!r} angle is {clamp.angle!r}; None or a callable t -> (θ, θ', θ'') is allowed"
        )
    start = float(tabulate(f"clamp {clamp.end!r} angle", clamp.angle, np.zeros(1), 3)[0, 0])
    if start != 0.0:
        raise PropertyError(
            f"clamp {clamp.end!r} angle is {start!r} rad at t = 0; 0 is needed: it turns from the reference"
        )
