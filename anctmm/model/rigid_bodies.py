"""Bodies that do not deform: rigid bodies of any shape, and point masses."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import hypot
from typing import TYPE_CHECKING, Any, final

from anctmm.errors import PropertyError, shown
from anctmm.model.accepted import BodyKind, PairLike
from anctmm.model.velocities import Point
from anctmm.validation import LONGEST, FrozenMapping, number, positive, text, vector

#: The point that every rigid body and point mass has: its centre of mass.
CENTER = "center"


@final
@dataclass(frozen=True)
class RigidBody(BodyKind):
    """A rigid body in the plane.

    Parameters
    ----------
    name : str
        Its points are called "name.point"; "name.center" is its centre of mass.
    mass : float
        kg.
    inertia : float
        Moment of inertia about the centre of mass, kg m².
    center : (float, float)
        Centre of mass in the reference, m.
    points : mapping of str to (float, float)
        Places where joints, connectors, loads and probes can be, in the reference, m; "center" is there without it.
    velocity : (float, float)
        Of the centre of mass at t = 0, m/s.
    spin : float
        Rate of turning at t = 0, counter-clockwise, rad/s.

    Raises
    ------
    PropertyError
        If one of them is of another kind or out of its range.
    """

    name: str
    mass: float
    inertia: float
    center: Point
    points: Mapping[str, Point] = field(default_factory=dict)
    velocity: Point = (0.0, 0.0)
    spin: float = 0.0

    if TYPE_CHECKING:  # what is accepted; attributes hold what became of it

        def __init__(
            self,
            name: str,
            mass: float,
            inertia: float,
            center: PairLike,
            points: Mapping[str, PairLike] = ...,
            velocity: PairLike = ...,
            spin: float = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "name", text("rigid body name", self.name))
        what = f"rigid body {self.name!r}"
        set_(self, "mass", positive(f"{what} mass (kg)", self.mass))
        set_(self, "inertia", positive(f"{what} inertia (kg m²)", self.inertia))
        set_(self, "center", vector(f"{what} center (m)", self.center, high=LONGEST))
        set_(self, "points", _points(what, self.points))
        set_(self, "velocity", vector(f"{what} velocity (m/s)", self.velocity))
        set_(self, "spin", number(f"{what} spin (rad/s)", self.spin))

    @cached_property
    def extent(self) -> float:
        """Largest distance of a point from the centre, m; 0 if there is none."""
        return max((hypot(*self.arm(key)) for key in self.points), default=0.0)

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of all points, "center" first."""
        return (CENTER, *self.points)

    def has(self, key: str) -> bool:
        """Whether there is a point of this name."""
        return key == CENTER or key in self.points

    @cached_property
    def first_at(self) -> Mapping[Point, str]:
        """First of the points at each position, which stands for all that coincide there."""
        return {self.position_at(key): key for key in reversed(self.keys)}

    def position_at(self, key: str) -> Point:
        """Place of a point in the reference, m."""
        return self.center if key == CENTER else self.points[key]

    def arm(self, key: str) -> Point:
        """Offset of a point from the centre of mass in the reference, m."""
        x, y = self.position_at(key)
        return x - self.center[0], y - self.center[1]

    def velocity_at(self, key: str) -> Point:
        """Velocity of a point at t = 0, m/s."""
        x, y = self.arm(key)
        return self.velocity[0] - self.spin * y, self.velocity[1] + self.spin * x

    @property
    def moving(self) -> bool:
        """Whether it moves at t = 0."""
        return bool(self.spin or any(self.velocity))

    @property
    def speed(self) -> float:
        """Largest component of the velocities of its points at t = 0, m/s."""
        return max(abs(v) for key in self.keys for v in self.velocity_at(key))


@final
@dataclass(frozen=True)
class PointMass(BodyKind):
    """A mass at a point, which does not turn.

    Parameters
    ----------
    name : str
        Its place is "name.center".
    mass : float
        kg.
    position : (float, float)
        In the reference, m.
    velocity : (float, float)
        At t = 0, m/s.

    Raises
    ------
    PropertyError
        If one of them is of another kind or out of its range.
    """

    name: str
    mass: float
    position: Point
    velocity: Point = (0.0, 0.0)

    if TYPE_CHECKING:  # what is accepted; attributes hold what became of it

        def __init__(
            self,
            name: str,
            mass: float,
            position: PairLike,
            velocity: PairLike = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "name", text("point mass name", self.name))
        what = f"point mass {self.name!r}"
        set_(self, "mass", positive(f"{what} mass (kg)", self.mass))
        set_(self, "position", vector(f"{what} position (m)", self.position, high=LONGEST))
        set_(self, "velocity", vector(f"{what} velocity (m/s)", self.velocity))

    @property
    def center(self) -> Point:
        """Centre of mass: its position, m."""
        return self.position

    @property
    def extent(self) -> float:
        """None."""
        return 0.0

    @property
    def keys(self) -> tuple[str, ...]:
        """The name of its one place."""
        return (CENTER,)

    def has(self, key: str) -> bool:
        """Whether there is a point of this name."""
        return key == CENTER

    def position_at(self, key: str) -> Point:
        """Its place in the reference, m."""
        return self.position

    def velocity_at(self, key: str) -> Point:
        """Its velocity at t = 0, m/s."""
        return self.velocity

    @property
    def moving(self) -> bool:
        """Whether it moves at t = 0."""
        return any(map(bool, self.velocity))

    @property
    def speed(self) -> float:
        """Largest component of its velocity at t = 0, m/s."""
        return max(map(abs, self.velocity))


def _points(what: str, points: Any) -> FrozenMapping:
    needed = "a mapping of names to points (x, y) in the reference is needed, such as {'a': (0.5, 0.0)}"
    if not isinstance(points, Mapping):
        raise PropertyError(f"{what} points is {shown(points)}; {needed}")
    found: dict[str, Point] = {}
    for name, place in points.items():
        key = text(f"{what} name of a point", name)
        if "." in key:
            raise PropertyError(f"{what} has a point {key!r}; a name without a dot is needed")
        if key == CENTER:
            raise PropertyError(
                f"{what} has a point {CENTER!r}; this name is that of the centre of mass: another is needed"
            )
        found[key] = vector(f"{what} point {key!r} (m)", place, high=LONGEST)
    return FrozenMapping(found)
