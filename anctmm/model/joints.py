"""Joints: connections of places of bodies with each other or with the ground, and guides along lines."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import PropertyError, shown, unknown_kind
from anctmm.model.accepted import JointKind, Point
from anctmm.model.drives import Angle, breaks_of, value_at
from anctmm.model.expressions import QUARTER_TURN, Scalar, Signal, Vector
from anctmm.model.places import Written, written
from anctmm.model.rigid_bodies import ROUNDING, RigidBody
from anctmm.validation import flag, is_point, one_of, point, several, text, vector

#: Whether a clamp or a weld holds the stretch of beams beside their direction.
STRETCH = ("held", "free")


Equation = Scalar | Vector | Sequence[Scalar]
"""Each is zero; a vector stands for its components. Scalars of one sequence are eliminated together."""


class Joint(JointKind):
    """Base of all joints, and of kinds of joint of a user's own.

    A kind of one's own gives its places to this constructor and says in `equations` what is zero:

    >>> class RigidLink(Joint):
    ...     def equations(self, a, b):
    ...         d = b.position - a.position
    ...         return [d @ d - float(d.start @ d.start)]

    Parameters
    ----------
    *places : place or point
        A point, of two or three numbers, is one of the ground.

    Raises
    ------
    UnknownNameError
        If one of them is neither a place nor a point.
    """

    #: Whether it holds the direction of its places; whether its place moves on a line, along which a drive moves it;
    #: whether all its places are at one point, and share their position.
    holds_direction, on_line, shares_position = False, False, False
    #: Whether it is offered in space, too, as those of a user's own; places that it needs at least.
    in_space, fewest = True, 1
    ends: tuple[Any, ...]
    #: Whether one of its places is of the ground.
    grounded: bool

    def __init__(self, *places: Any) -> None:
        found = tuple(point("joint place (m)", p) if is_point(p) else written(p) for p in places)
        object.__setattr__(self, "ends", found)
        object.__setattr__(self, "grounded", any(map(is_point, found)))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(repr, self.ends))})"

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash((type(self), self.ends))

    @property
    def label(self) -> str:
        """Its kind and places, as messages name it."""
        kind = type(self).__name__.lower()
        return f"{kind} {shown(self.ends[0])}" if len(self.ends) == 1 else f"{kind} of {shown(self.ends)}"

    @property
    def places(self) -> tuple[Written, ...]:
        """Its places that are of bodies."""
        return tuple(end for end in self.ends if not is_point(end))

    @property
    def attached(self) -> tuple[Any, ...]:
        """What `equations` takes: places, points of the ground, and of guides the body that carries the line."""
        return self.ends

    @property
    def features(self) -> dict[str, bool]:
        return {"own-joints": type(self) not in JOINTS}

    def equations(self, *places: Any) -> list[Equation]:
        """What is zero, as sums of vectors of places and of products of them.

        Parameters
        ----------
        *places
            In the order of the constructor. Each has vectors: `position`; `axis(k)`, unit vector k of the reference as
            it turns with the place, of a beam r_x for k = 0; `gradients`, all that a weld holds; `direction`, which a
            torque turns. `rigid`: whether it is of a rigid body or the ground, with which `fixed_point(p)` moves.
        """
        raise NotImplementedError(f"{type(self).__name__} has no equations")


def turned(vector: Vector, joint: Any) -> Vector:
    """A vector turned by the driven angle of a joint."""
    if (angle := getattr(joint, "angle", None)) is None:
        return vector
    name = f"{joint.label} angle"
    return vector * Signal(angle, "cos", name) + vector.normal * Signal(angle, "sin", name)


def rotation(one: NDArray[Any], two: NDArray[Any]) -> NDArray[Any]:
    """Matrix that turns the direction of one vector of the plane into that of another."""
    sizes = float(np.hypot(*one) * np.hypot(*two))
    c, s = float(one @ two) / sizes, float(one @ (QUARTER_TURN.T @ two)) / sizes
    if abs(s) < ROUNDING and c > 0.0:
        return np.eye(2)
    return c * np.eye(2) + s * QUARTER_TURN


def _same_direction(a: Any, b: Any, joint: Any) -> list[Equation]:
    """The second place is turned against the first one by an angle from the reference, fixed or driven."""
    free, driven = (getattr(joint, name, None) for name in ("stretch", "angle"))
    if free == "free" or (a.rigid and b.rigid and driven is not None):
        one, two = a.direction, b.direction
        return [turned(one.mapped(rotation(one.start, two.start)), joint).normal @ two]
    found: list[Equation] = []
    for k in range(max(len(a.gradients), len(b.gradients))):
        one, two = (place.gradients[min(k, len(place.gradients) - 1)] for place in (a, b))
        found.append(two - turned(one.mapped(rotation(one.start, two.start)), joint))
    return found


@final
@dataclass(frozen=True, init=False)
class Pin(Joint):
    """Hinge of any number of places, or of one place with the ground.

    Parameters
    ----------
    *places : place
        One or more; one place alone is pinned to the ground. A place may be in several joints, if no joint repeats a
        constraint of the others.
    grounded : bool
        Whether several places are also pinned to the ground, as by a support.
    ends : iterable of place, optional
        The places as one argument, as `dataclasses.replace` passes them; then `places` must be empty.
    """

    shares_position = True
    ends: tuple[Written, ...]
    grounded: bool

    def __init__(
        self, *places: Written, grounded: bool = False, ends: Iterable[Written] | None = None
    ) -> None:
        object.__setattr__(self, "ends", _ends("pin", places, ends))
        object.__setattr__(self, "grounded", flag("pin grounded", grounded) or len(self.ends) == 1)

    def equations(self, *places: Any) -> list[Equation]:
        """All positions are one, that of the ground if it is grounded."""
        first = places[0].position
        held: list[Equation] = [first - first.start] if self.grounded else []
        return held + [place.position - first for place in places[1:]]


@final
@dataclass(frozen=True, init=False)
class Weld(Joint):
    """Rigid connection of positions and directions of places, at their angles in the reference configuration.

    Parameters
    ----------
    *places : place
        Two or more. A place may be in several joints, if no joint repeats a constraint of the others.
    grounded : bool
        Whether the place is also pinned to the ground, as where a continuous beam passes over a support.
    angle : callable, optional
        A driven hinge of two places: t (s) → (θ, θ', θ'') in rad, rad/s, rad/s², the rotation of the second relative to
        the first; θ(0) = 0.
    stretch : str
        "held": beams share whole gradients, and therefore their stretch; "free": they share directions only, and each
        end has its own stretch.
    ends : iterable of place, optional
        As of `Pin`.
    """

    in_space, holds_direction, fewest = False, True, 2
    ends: tuple[Written, ...]
    grounded: bool
    angle: Angle | None
    stretch: str

    def __init__(
        self,
        *places: Written,
        grounded: bool = False,
        angle: Angle | None = None,
        stretch: str = "held",
        ends: Iterable[Written] | None = None,
    ) -> None:
        object.__setattr__(self, "ends", _ends("weld", places, ends))
        object.__setattr__(self, "grounded", flag("weld grounded", grounded))
        object.__setattr__(self, "angle", angle)
        object.__setattr__(self, "stretch", one_of(f"{self.label} stretch", stretch, STRETCH))
        _check_callable(f"{self.label} angle", angle, "(θ, θ', θ'')")
        if angle is not None and len(self.ends) != 2:
            raise PropertyError(f"{self.label} has an angle and {len(self.ends)} place(s); two are needed")

    @property
    def features(self) -> dict[str, bool]:
        return {
            "driven-welds": self.angle is not None,
            "free-stretch": self.stretch == "free",
            "free-welds": self.stretch == "free",
        }

    def equations(self, *places: Any) -> list[Equation]:
        """Positions are one; directions are those of the first place, at the angles of the reference."""
        first = places[0]
        found: list[Equation] = [first.position - first.position.start] if self.grounded else []
        for place in places[1:]:
            found.append(place.position - first.position)
            found += _same_direction(first, place, self)
        return found


@final
@dataclass(frozen=True)
class Clamp(Joint):
    """A place clamped to the ground, fixed or rotated by a drive (a driven clamp).

    Parameters
    ----------
    end : place
    angle : callable, optional
        t (s) → (θ, θ', θ'') in rad, rad/s, rad/s², from the reference direction, θ(0) = 0. Default: fixed.
    stretch : str
        "held": the whole gradient of a beam, and therefore its stretch, is that of the reference, rotated; "free": only
        the direction is prescribed, so that the beam can stretch at the clamp.
    """

    holds_direction, grounded = True, True
    end: Written
    angle: Angle | None = None
    stretch: str = "held"

    def __post_init__(self) -> None:
        object.__setattr__(self, "end", written(self.end))
        object.__setattr__(self, "stretch", one_of(f"{self.label} stretch", self.stretch, STRETCH))
        _check_callable(f"{self.label} angle", self.angle, "(θ, θ', θ'')")

    @property
    def features(self) -> dict[str, bool]:
        return {"free-stretch": self.stretch == "free"}

    def misfit(self, scene: Any) -> str:
        free = scene.dim == 3 and (self.angle is not None or self.stretch == "free")
        return "is in space; a fixed clamp that holds the stretch is allowed" if free else ""

    @property
    def ends(self) -> tuple[Written, ...]:  # type: ignore[override]
        """The one place it holds."""
        return (self.end,)

    def equations(self, place: Any) -> list[Equation]:  # type: ignore[override]
        """The position is fixed, and the direction, or its angle is driven."""
        start = place.position.start
        vectors = [place.direction] if self.stretch == "free" else place.gradients
        known = [turned(vector.initial, self) for vector in vectors]
        if self.stretch == "free":
            return [place.position - start, known[0].normal @ vectors[0]]
        return [place.position - start, *(v - w for v, w in zip(vectors, known, strict=True))]


@dataclass(frozen=True)
class _LineGuide(Joint):
    """What both kinds of guide are: a place that moves on a straight line; parameters are those of `Slider`."""

    in_space, on_line, grounded = False, True, False
    place: Written
    direction: Point = (1.0, 0.0)
    body: str | None = None
    position: Angle | None = None

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "place", written(self.place))
        set_(self, "direction", _unit(f"{self.label} direction", self.direction, 2))
        if self.body is not None:
            set_(self, "body", text(f"{self.label} body", self.body))
        _check_callable(f"{self.label} position", self.position, "(s, s', s'')")

    @property
    def features(self) -> dict[str, bool]:
        return {
            "prismatic-joints" if self.holds_direction else "sliders": True,
            "driven-guides": self.position is not None,
            "moving-guides": self.body is not None,
        }

    @property
    def ends(self) -> tuple[Written, ...]:  # type: ignore[override]
        """The one place it guides."""
        return (self.place,)

    @property
    def attached(self) -> tuple[Any, ...]:
        """The place, and the body that carries the line."""
        return (self.place, (0.0, 0.0) if self.body is None else f"{self.body}.center")

    def equations(self, place: Any, line: Any) -> list[Equation]:  # type: ignore[override]
        """The place stays on the line, or moves along it as it is driven; a prismatic joint holds the direction."""
        away = place.position - line.fixed_point(place.position.start)
        x, y = self.direction
        along = line.direction.mapped(x * np.eye(2) + y * QUARTER_TURN)
        found: list[Equation] = [along.normal @ away]
        if self.position is not None:
            found.append(along @ away - Signal(self.position, "value", f"{self.label} position"))
        return found + (_same_direction(line, place, self) if self.holds_direction else [])


@final
@dataclass(frozen=True, init=False)  # that of both kinds
class Slider(_LineGuide):
    """A place that moves on a straight line through its reference position, and is free to rotate.

    Parameters
    ----------
    place : place
    direction : (float, float)
        Of the line in the reference, of any length; stored as a unit vector.
    body : str, optional
        The rigid body in which the line is fixed, and with which it moves. Default: the ground.
    position : callable, optional
        Drive along the line: t (s) → (s, s', s'') in m, m/s, m/s² from the reference position, s(0) = 0. Default: free.

    Raises
    ------
    PropertyError
        If the direction has no length, or the position cannot be called.
    """


@final
@dataclass(frozen=True, init=False)  # that of both kinds
class Prismatic(_LineGuide):
    """A place that moves on a straight line through its reference position, and cannot rotate relative to it.

    Parameters and errors are those of `Slider`.
    """

    holds_direction = True


@final
@dataclass(frozen=True, init=False)
class Revolute(Joint):
    """Hinge in space: two places, or one place and the ground, stay together and turn about one axis.

    Parameters
    ----------
    *places : place
        Of rigid bodies; one place alone is hinged to the ground.
    axis : (float, float, float)
        Direction of the axis in the reference, of any length; stored as a unit vector.
    ends : iterable of place, optional
        As of `Pin`.

    Raises
    ------
    PropertyError
        If the axis has no length, or there are more than two places.
    """

    holds_direction, on_line, shares_position = True, False, True
    ends: tuple[Written, ...]
    axis: Point

    def __init__(
        self,
        *places: Written,
        axis: Point = (0.0, 0.0, 1.0),
        ends: Iterable[Written] | None = None,
    ) -> None:
        object.__setattr__(self, "ends", _ends("revolute joint", places, ends))
        what = f"revolute joint of {shown(self.ends)}"
        if not 1 <= len(self.ends) <= 2:
            raise PropertyError(f"{what} has {len(self.ends)} places; one or two are needed")
        object.__setattr__(self, "axis", _unit(f"{what} axis", axis, 3))

    def __repr__(self) -> str:
        return f"Revolute({', '.join(map(repr, self.ends))}, axis={self.axis!r})"

    def misfit(self, scene: Any) -> str:
        if scene.dim == 2:
            return "is for space; a Pin is one in the plane"
        rigid = all(isinstance(scene.place(end).body, RigidBody) for end in self.ends)
        return "" if rigid else "holds a place of another body; places of rigid bodies are allowed"

    @property
    def grounded(self) -> bool:  # type: ignore[override]
        """Whether it has one place alone."""
        return len(self.ends) == 1

    def equations(self, *places: Any) -> list[Equation]:
        """Positions are one, and two vectors across the axis of the second body stay across that of the first."""
        axis = np.asarray(self.axis)
        across = np.linalg.svd(axis[None])[2][1:]
        last, *first = reversed(places)
        line = _fixed_in(first[0], axis) if first else last.position.initial * 0.0 + axis
        met = first[0].position if first else last.position.start
        return [last.position - met, [line @ _fixed_in(last, vector) for vector in across]]


def _fixed_in(place: Any, direction: NDArray[Any]) -> Vector:
    """The vector that turns with a place and is a direction in the reference."""
    found = place.axis(0) * float(direction[0])
    for k in (1, 2):
        found = found + place.axis(k) * float(direction[k])
    return found


Guide = Slider | Prismatic
#: All kinds of this package. None may be a subclass of another: solvers distinguish them by class.
JOINTS = (Pin, Weld, Clamp, Slider, Prismatic, Revolute)


def unknown_joint(joint: Any) -> Exception:
    """What to raise for a joint of a kind that somebody does not know."""
    return unknown_kind("joint", joint, JOINTS)  # type: ignore[arg-type]


def built_in(joints: Iterable[Joint]) -> Iterator[Any]:
    """The joints of this package's kinds among joints: what knows these kinds alone leaves the others out."""
    return (joint for joint in joints if type(joint) in JOINTS)


def drive_of(joint: Joint) -> tuple[str, Angle, str] | None:
    """Name of the history that drives a joint, the history and its unit; None where nothing drives it."""
    what, unit = ("position", "m") if joint.on_line else ("angle", "rad")
    history = getattr(joint, what, None) if type(joint) in JOINTS else None
    return None if history is None else (f"{joint.label} {what}", history, unit)


def check_drive(joint: Joint) -> None:
    """Refuse a joint whose history gives nothing, or is not zero, at t = 0."""
    if (drive := drive_of(joint)) is None:
        return
    name, history, unit = drive
    breaks_of(name, history)
    start = float(value_at(name, history, 0.0, 3)[0])
    if abs(start) > ROUNDING:
        raise PropertyError(f"{name} is {start!r} {unit} at t = 0; 0 is needed, as of the reference")


def _ends(kind: str, places: tuple[Written, ...], ends: Iterable[Written] | None) -> tuple[Written, ...]:
    """Places of a joint of several, which are given one by one or as `ends`."""
    if ends is None:
        return tuple(map(written, places))
    if places:
        raise PropertyError(
            f"{kind} of {shown(places)} has ends {shown(ends)}, too; places are given one by one or as ends"
        )
    return tuple(map(written, several(f"{kind} ends is", ends, "a list of places is needed", PropertyError)))


def _unit(name: str, given: Any, dim: int) -> Point:
    """The unit vector along a vector of some length."""
    along = np.array(vector(name, given, dims=(dim,)))
    if not along.any():
        raise PropertyError(f"{name} is {shown(given)}; a vector of some length is needed")
    for _ in range(2):  # the second division makes the length 1 to the last digit
        along /= np.linalg.norm(along)
    return tuple(along.tolist())


def _check_callable(name: str, history: object, answer: str) -> None:
    if history is not None and not callable(history):
        raise PropertyError(f"{name} is {shown(history)}; None or a callable t -> {answer} is allowed")
