"""Beams and their materials."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import atan2, dist
from typing import Any

import numpy as np

from anctmm.errors import DegenerateBodyError, PropertyError, UnknownKindError, shown
from anctmm.model.accepted import BodyKind, Point
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.sections import Circle, Section
from anctmm.model.velocities import size_of, slope_of
from anctmm.validation import (
    LONGEST,
    SHORTEST,
    answer_of,
    not_negative,
    point,
    positive,
    text,
    vector,
    within,
)


def distance(a: Point, b: Point) -> float:
    """Distance of two points, m; PropertyError unless they are two pairs, or two triples, of finite numbers."""
    one, two = vector("distance from (m)", a, dims=(2, 3)), vector("distance to (m)", b, dims=(2, 3))
    if len(one) != len(two):
        raise PropertyError(f"distance from {shown(a)} to {shown(b)}; as many numbers in both are needed")
    return dist(one, two)


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

    Raises
    ------
    PropertyError
        If a number is not finite, has the wrong sign or is out of its range.
    """

    E: float
    density: float
    poisson: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "E", positive("material E (Pa)", self.E))
        set_(self, "density", positive("material density (kg/m³)", self.density))
        set_(self, "poisson", within("material poisson", self.poisson, 0.0, 0.5, "[)"))
        set_(self, "damping", not_negative("material damping (s)", self.damping))

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's first parameter λ and the shear modulus G, Pa."""
        nu = self.poisson
        return self.E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), self.E / (2.0 * (1.0 + nu))


@dataclass(frozen=True)
class Beam(BodyKind):
    """A flexible body, straight and free of stress between `start` and `end`.

    Parameters
    ----------
    name : str
        Its ends are called "name.start" and "name.end".
    start, end : (float, float), or (float, float, float) in space
        m.
    section : Section
    material : Material
    velocity : callable, optional
        fraction of the length in [0, 1] → (vx, vy), m/s, at t = 0; at rest without it.

    Raises
    ------
    PropertyError
        If one of them is of another kind or out of its range.
    DegenerateBodyError
        If the beam has no length.
    """

    name: str
    start: Point
    end: Point
    section: Section
    material: Material
    velocity: Callable[[float], Point] | None = None

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "name", text("beam name", self.name))
        given = f"start {shown(self.start)} and end {shown(self.end)}"
        set_(self, "start", point(f"beam {self.name!r} start (m)", self.start))
        set_(self, "end", point(f"beam {self.name!r} end (m)", self.end))
        if len(self.start) != len(self.end):
            raise PropertyError(f"beam {self.name!r} has {given}; as many numbers in both are needed")
        for kind, thing in ((Section, self.section), (Material, self.material)):
            if not isinstance(thing, kind):
                what = f"beam {self.name!r} {kind.__name__.lower()}"
                raise PropertyError(f"{what} is {shown(thing)}; a {kind.__name__} is needed")
        if self.velocity is not None and not callable(self.velocity):
            raise PropertyError(
                f"beam {self.name!r} velocity is {shown(self.velocity)}; a callable fraction -> (vx, vy) is needed"
            )
        positive(f"beam {self.name!r} length (m)", self.length, DegenerateBodyError, SHORTEST, LONGEST)

    def misfit(self, scene: Any) -> str:
        if scene.dim == 3 and not isinstance(self.section, Circle):
            return "has another section than a Circle, which alone is offered in space"
        damped = scene.dim == 3 and self.material.damping > 0.0
        return f"has damping {self.material.damping!r} s; 0 is needed in space" if damped else ""

    @property
    def length(self) -> float:
        """Undeformed length, m."""
        return dist(self.start, self.end)

    @property
    def dim(self) -> int:
        """Components of its places."""
        return len(self.start)

    @property
    def mass(self) -> float:
        """ρ A l, kg."""
        return self.material.density * self.section.area * self.length

    @property
    def angle(self) -> float:
        """Direction from start to end in the plane, rad."""
        return atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])

    @property
    def center(self) -> Point:
        """Centre of mass in the reference, m."""
        return self.position_at(0.5)

    @property
    def extent(self) -> float:
        """Its length, m: what gaps between it and others are compared with."""
        return self.length

    @property
    def moving(self) -> bool:
        """Whether it has a velocity at t = 0."""
        return self.velocity is not None

    def position_at(self, fraction: float) -> Point:
        """Place at a fraction of the length in the reference, m."""
        if fraction in (0.0, 1.0):
            return self.end if fraction else self.start
        return tuple(a + fraction * (b - a) for a, b in zip(self.start, self.end, strict=True))

    def velocity_at(self, fraction: float) -> Point:
        """Initial velocity at a fraction of the length, m/s; PropertyError if the callable does not give one."""
        if self.velocity is None:
            return (0.0,) * self.dim
        what = f"beam {self.name!r} velocity (m/s) at fraction {fraction!r}"
        return tuple(answer_of(what, self.velocity, fraction, count=self.dim).tolist())

    def velocity_slope_at(self, fraction: float) -> Point:
        """Derivative of the initial velocity by the fraction of the length, m/s; PropertyError if there is none."""
        if self.velocity is None:
            return (0.0,) * self.dim
        slope, error = slope_of(self.velocity_at, fraction, self.speed)
        if not error <= 1e-4 * max(self.speed, *np.abs(slope)):
            raise PropertyError(
                f"beam {self.name!r} velocity has no slope at fraction {fraction!r} (differences give "
                f"{slope.tolist()!r} m/s, known to {error:.2g}); a smooth function is needed"
            )
        return tuple(slope.tolist())

    @cached_property
    def speed(self) -> float:
        """Size of the initial velocity, m/s; 1 without one."""
        return size_of(self.velocity_at)


Body = Beam | RigidBody | PointMass
#: All kinds. None may be a subclass of another: solvers distinguish them by class.
BODIES = (Beam, RigidBody, PointMass)


def beam_of(body: Body) -> Beam:
    """Return a beam, for what knows beams only; UnknownKindError for a body of another kind."""
    if not isinstance(body, Beam):
        raise UnknownKindError(
            f"body {body.name!r} is a {type(body).__name__}; a Beam, which alone has ends and elements, is needed here"
        )
    return body
