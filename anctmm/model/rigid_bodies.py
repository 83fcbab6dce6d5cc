"""Bodies that do not deform: rigid bodies of any shape, and point masses."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import hypot
from typing import Any, ClassVar, final

import numpy as np

from anctmm.errors import PropertyError, shown
from anctmm.model.accepted import BodyKind, Point
from anctmm.model.velocities import turned
from anctmm.validation import LONGEST, FrozenMapping, number, point, positive, reals, text, vector

#: The point that every rigid body and point mass has: its centre of mass.
CENTER = "center"
#: What is rounding of numbers that a user states: part of moments of inertia; of drives at t = 0, rad or m; sine of
#: turns between places.
ROUNDING = 1e-12


class WithPoints(BodyKind):
    """What rigid bodies and point masses are: a centre of mass, and points with names that move with it."""

    in_space = True
    name: str
    center: Point
    points: Mapping[str, Point]
    velocity: Point
    spin: Any

    @property
    def dim(self) -> int:
        """Components of its places."""
        return len(self.center)

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of all points, "center" first."""
        return (CENTER, *self.points)

    @cached_property
    def extent(self) -> float:
        """Largest distance of a point from the centre, m; 0 if there is none."""
        return max((hypot(*self.arm(key)) for key in self.points), default=0.0)

    @cached_property
    def first_at(self) -> Mapping[Point, str]:
        """First of the points at each position, which stands for all that coincide there."""
        return {self.position_at(key): key for key in reversed(self.keys)}

    def position_at(self, key: str) -> Point:
        """Place of a point in the reference, m."""
        return self.center if key == CENTER else self.points[key]

    def arm(self, key: str) -> Point:
        """Offset of a point from the centre of mass in the reference, m."""
        return tuple(a - b for a, b in zip(self.position_at(key), self.center, strict=True))

    def velocity_at(self, key: str) -> Point:
        """Velocity of a point at t = 0, m/s."""
        if key == CENTER:
            return self.velocity
        return tuple((self.velocity + turned(self.spin, self.arm(key))).tolist())

    @property
    def moving(self) -> bool:
        """Whether it moves at t = 0."""
        return bool(np.any(self.spin) or any(self.velocity))

    @property
    def speed(self) -> float:
        """Largest component of the velocities of its points at t = 0, m/s."""
        return max(abs(v) for key in self.keys for v in self.velocity_at(key))


@final
@dataclass(frozen=True)
class RigidBody(WithPoints):
    """A rigid body, in the plane or in space.

    Parameters
    ----------
    name : str
        Its points are called "name.point"; "name.center" is its centre of mass.
    mass : float
        kg.
    inertia : float, or array
        Moment of inertia about the centre of mass, kg m². In space the tensor, 3 × 3, or its principal values along the
        axes of the reference, none larger than the sum of the others.
    center : (float, float), or (float, float, float) in space
        Centre of mass in the reference, m.
    points : mapping of str to place
        Places where joints, connectors, loads and probes can be, in the reference, m; "center" is there without it.
    velocity : sequence of float, optional
        Of the centre of mass at t = 0, m/s. Default: at rest.
    spin : float, or (float, float, float) in space
        Rate of turning at t = 0, counter-clockwise, rad/s; in space the angular velocity. Default: 0.

    Raises
    ------
    PropertyError
        If one of them is of another kind or out of its range.
    """

    name: str
    mass: float
    inertia: Any
    center: Point
    points: Mapping[str, Point] = field(default_factory=dict)
    velocity: Point = None  # type: ignore[assignment]
    spin: Any = None

    features: ClassVar[dict[str, bool]] = {"rigid-bodies": True}

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "name", text("rigid body name", self.name))
        what = f"rigid body {self.name!r}"
        set_(self, "mass", positive(f"{what} mass (kg)", self.mass))
        set_(self, "center", point(f"{what} center (m)", self.center))
        set_(self, "points", _points(what, self.points, self.dim))
        set_(self, "velocity", _velocity(what, self.velocity, self.dim))
        name, spin = f"{what} spin (rad/s)", self.spin
        if self.dim == 2:
            set_(self, "inertia", positive(f"{what} inertia (kg m²)", self.inertia))
            set_(self, "spin", 0.0 if spin is None else number(name, spin))
        else:
            set_(self, "inertia", _tensor(f"{what} inertia (kg m²)", self.inertia))
            set_(self, "spin", (0.0, 0.0, 0.0) if spin is None else vector(name, spin, dims=(3,)))


@final
@dataclass(frozen=True)
class PointMass(WithPoints):
    """A mass at a point, which does not turn.

    Parameters
    ----------
    name : str
        Its place is "name.center".
    mass : float
        kg.
    position : (float, float), or (float, float, float) in space
        In the reference, m.
    velocity : sequence of float, optional
        At t = 0, m/s. Default: at rest.

    Raises
    ------
    PropertyError
        If one of them is of another kind or out of its range.
    """

    points: ClassVar[Mapping[str, Point]] = {}  # type: ignore[misc]
    spin: ClassVar[float] = 0.0  # type: ignore[misc]
    name: str
    mass: float
    position: Point
    velocity: Point = None  # type: ignore[assignment]

    features: ClassVar[dict[str, bool]] = {"point-masses": True}

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "name", text("point mass name", self.name))
        what = f"point mass {self.name!r}"
        set_(self, "mass", positive(f"{what} mass (kg)", self.mass))
        set_(self, "position", point(f"{what} position (m)", self.position))
        set_(self, "velocity", _velocity(what, self.velocity, self.dim))

    @property
    def center(self) -> Point:  # type: ignore[override]
        """Centre of mass: its position, m."""
        return self.position


def _velocity(what: str, velocity: Any, dim: int) -> Point:
    """A velocity at t = 0, zero if there is none."""
    return (0.0,) * dim if velocity is None else vector(f"{what} velocity (m/s)", velocity, dims=(dim,))


def _tensor(what: str, inertia: Any) -> tuple[tuple[float, ...], ...]:
    """A tensor of inertia from itself or its principal values; PropertyError if no distribution of mass has it."""
    needed = "three positive principal values, or a symmetric 3 × 3 array of them in other axes"
    try:
        given = reals(inertia)
    except (TypeError, ValueError):
        given = np.empty(0)
    tensor = np.diag(given) if given.shape == (3,) else given
    symmetric = tensor.shape == (3, 3) and np.abs(tensor - tensor.T).max() <= ROUNDING * np.abs(tensor).max()
    if not symmetric:  # nor where a number is none
        raise PropertyError(f"{what} is {shown(inertia)}; {needed}, is needed")
    tensor = 0.5 * (tensor + tensor.T)
    moments = np.linalg.eigvalsh(tensor)
    if not moments[0] > 0.0 or not moments[2] <= moments[:2].sum() * (1.0 + ROUNDING):
        raise PropertyError(
            f"{what} is {shown(inertia)}, with principal values {moments.tolist()}; {needed}, none larger than the sum "
            f"of the others, is needed"
        )
    return tuple(map(tuple, tensor.tolist()))


def _points(what: str, points: Any, dim: int) -> FrozenMapping:
    needed = "a mapping of names to points (x, y) in the reference is needed, such as {'a': (0.5, 0.0)}"
    if not isinstance(points, Mapping):
        raise PropertyError(f"{what} points is {shown(points)}; {needed}")
    found: dict[str, Point] = {}
    for name, place in points.items():
        key = text(f"{what} name of a point", name)
        if "." in key or key == CENTER:
            raise PropertyError(
                f"{what} has a point {key!r}; a name without a dot, and not that of the centre of mass, is needed"
            )
        found[key] = vector(f"{what} point {key!r} (m)", place, high=LONGEST, dims=(dim,))
    return FrozenMapping(found)
