"""Connectors: springs and dampers between two places, or between a place and the ground.

The force of a spring is N = k (L − l) + c (L' − l') + preload, L the distance of its places, positive if it pulls them
together; the moment of a rotational spring is M = k (φ − φ₀) + c (φ' − φ₀') + preload, positive if it works against φ.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import dist
from typing import TYPE_CHECKING, Any, final

from anctmm.errors import PropertyError, RepeatedJointError, UnknownKindError, reason, shown
from anctmm.model.accepted import ConnectorKind, PairLike
from anctmm.model.drives import breaks_of, value_at
from anctmm.model.places import Graph, Place, Written, place_text, written
from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.velocities import Point
from anctmm.validation import has_length, not_negative, number, point, reals

Pair = Callable[[Any], tuple[Any, Any]]
"""t (s) → a value and its rate."""
Law = Callable[[float, float, float], float]
"""(elongation, its rate, t) → the force or moment that works against it."""
#: Distance of a spring's places, of the sizes of their coordinates, that counts as none.
NEAR = 1e-14


@final
@dataclass(frozen=True)
class Spring(ConnectorKind):
    """A spring and damper between two places, or between a place and a point of the ground.

    Parameters
    ----------
    first : place
    second : place or point
        Two numbers, or three in space, are a point of the ground, m.
    stiffness : float
        N/m.
    damping : float
        N s/m.
    length : float or callable, optional
        Free length, m, or t (s) → (l, l') in m, m/s. Default: the distance in the reference configuration.
    law : callable, optional
        (elongation (m), rate (m/s), t (s)) → tension (N), in place of stiffness, damping and preload; the elongation is
        the distance less the free length. A plain function that numba can compile.
    preload : float
        Tension at the free length, N.

    Raises
    ------
    PropertyError
        If a value is of another kind or out of its range, or no stiffness, damping, preload or law is given.
    """

    first: Written
    second: Written | Point
    stiffness: float = 0.0
    damping: float = 0.0
    length: float | Pair | None = None
    law: Law | None = None
    preload: float = 0.0

    if TYPE_CHECKING:  # what is accepted; attributes hold what became of it

        def __init__(
            self,
            first: Written,
            second: Written | PairLike,
            stiffness: float = ...,
            damping: float = ...,
            length: float | Pair | None = None,
            law: Law | None = None,
            preload: float = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "first", written(self.first))
        set_(self, "second", _place_or_point(self.second))
        _check_coefficients(self, "N/m", "N s/m", "N")
        if self.length is not None and not callable(self.length):
            set_(self, "length", not_negative(f"{name_of(self)} length (m)", self.length))

    @property
    def free(self) -> float | Pair | None:
        """Its free length."""
        return self.length

    @property
    def places(self) -> tuple[Written, ...]:
        """Places of bodies that it acts on."""
        return (self.first,) if self.ground is not None else (self.first, self.second)  # type: ignore[return-value]

    @property
    def ground(self) -> Point | None:
        """The point of the ground that it is fixed to."""
        pair: Any = self.second
        return None if isinstance(pair, str) or isinstance(pair[0], str) else pair


@final
@dataclass(frozen=True)
class RotationalSpring(ConnectorKind):
    """A rotational spring and damper between two places, or between a place and the ground.

    Parameters
    ----------
    first : place
    second : place, optional
        The angle is that of `second` less that of `first` since t = 0, with whole turns. Default: that of `first`.
    stiffness : float
        N m/rad.
    damping : float
        N m s/rad.
    angle : float or callable
        Free angle, rad, or t (s) → (φ, φ') in rad, rad/s.
    law : callable, optional
        (angle less the free angle (rad), rate (rad/s), t (s)) → moment (N m) against the angle, instead of stiffness,
        damping and preload. A plain function that numba can compile.
    preload : float
        Moment at the free angle, N m.

    Raises
    ------
    PropertyError
        If a value is of another kind or out of its range, or no stiffness, damping, preload or law is given.
    """

    first: Written
    second: Written | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    angle: float | Pair = 0.0
    law: Law | None = None
    preload: float = 0.0

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "first", written(self.first))
        if self.second is not None:
            set_(self, "second", written(self.second))
        _check_coefficients(self, "N m/rad", "N m s/rad", "N m")
        if not callable(self.angle):
            set_(self, "angle", number(f"{name_of(self)} angle (rad)", self.angle))

    @property
    def free(self) -> float | Pair | None:
        """Its free angle."""
        return self.angle

    @property
    def places(self) -> tuple[Written, ...]:
        """Places of bodies that it acts on."""
        return (self.first,) if self.second is None else (self.first, self.second)


Connector = Spring | RotationalSpring
#: All kinds. None may be a subclass of another: solvers distinguish them by class.
CONNECTORS = (Spring, RotationalSpring)


def name_of(connector: Connector) -> str:
    """A connector as messages name it."""
    kind = "spring" if isinstance(connector, Spring) else "rotational spring"
    to = "the ground" if connector.second is None else _end_text(connector.second)
    return f"{kind} from {place_text(connector.first)} to {to}"


def ends_of(scene: Graph, connector: Connector) -> tuple[Place, Place | Point | None]:
    """Both ends of a connector: places, or a point of the ground, or, of a rotational spring, the ground."""
    second: Any = connector.second
    if second is not None and (isinstance(connector, RotationalSpring) or connector.ground is None):
        second = scene.place(second)
    return scene.place(connector.first), second


def free_of(connector: Connector, reference: float, time: float) -> tuple[float, float]:
    """Free length (m) or angle (rad) of a connector at a time, and its rate; `reference` is the length as placed."""
    free = connector.free
    if callable(free):
        value, rate = value_at(f"{name_of(connector)} {free_name(connector)}", free, time, 2)
        return float(value), float(rate)
    return (reference if free is None else float(free)), 0.0


def free_name(connector: Connector) -> str:
    """What the free value of a connector is called."""
    return "length" if isinstance(connector, Spring) else "angle"


def check_connector(scene: Graph, connector: Connector) -> None:
    """Refuse a connector that does not fit the scene, or whose functions give nothing at t = 0.

    Raises
    ------
    UnknownNameError
        If a place is not of the scene.
    UnknownKindError
        If a rotational spring acts on a place that has no direction.
    RepeatedJointError
        If both places are one, or of one rigid body.
    PropertyError
        If a spring has no direction, or a function gives no finite numbers at t = 0.
    """
    first, second = ends_of(scene, connector)
    _check_apart(connector, first, second)
    start = 0.0
    if isinstance(connector, Spring):
        p = first.position
        q = second.position if isinstance(second, Place) else second
        assert q is not None  # a spring has a place or a point there
        start = dist(p, q)
        if start <= NEAR * max(map(abs, (*p, *q))):
            raise PropertyError(
                f"{name_of(connector)} joins places at one point {p!r}; two points apart are needed, which give it a "
                f"direction"
            )
    else:
        for place in (first, second):
            if isinstance(place, Place) and not place.turns:
                raise UnknownKindError(
                    f"{name_of(connector)} acts on the point mass {place.body.name!r}, which does not turn; a "
                    f"place of a beam or a rigid body is needed"
                )
    _check_functions(connector, start)


def _check_apart(connector: Connector, first: Place, second: Place | Point | None) -> None:
    if not isinstance(second, Place):
        return
    if first.canonical == second.canonical:
        raise RepeatedJointError(f"{name_of(connector)} names one place twice; two places are needed")
    if isinstance(first.body, RigidBody) and first.body.name == second.body.name:
        raise RepeatedJointError(
            f"{name_of(connector)} acts between points of one rigid body, which do not move relative to each other; "
            f"places of two bodies are needed"
        )


def _check_functions(connector: Connector, start: float) -> None:
    """Driven length or angle, and law, at t = 0."""
    name = name_of(connector)
    breaks_of(f"{name} {free_name(connector)}", connector.free)
    value, rate = free_of(connector, start, 0.0)
    if isinstance(connector, Spring) and value < 0.0:
        raise PropertyError(f"{name} length is {value!r} m at t = 0; a length of at least 0 is needed")
    if connector.law is not None:
        law_value(name, connector.law, start - value, -rate, 0.0)


def law_value(name: str, law: Law, elongation: float, rate: float, time: float) -> float:
    """What a law answers.

    Raises
    ------
    PropertyError
        If it raises, or answers with something else than one finite number.
    """
    asked = f"{name} law at elongation {elongation!r}, rate {rate!r}, t = {time!r} s"
    needed = "a function (elongation, rate, t) -> one finite number is needed"
    try:
        answer: Any = law(elongation, rate, time)
    except (Exception, SystemExit) as error:  # a user's function may do anything
        raise PropertyError(f"{asked} raises {reason(error)}; {needed}") from error
    try:
        found = reals(answer).reshape(())
    except (TypeError, ValueError):
        raise PropertyError(f"{asked} gives {shown(answer)}; {needed}") from None
    return number(asked, float(found))


def _check_coefficients(connector: Connector, stiffness: str, damping: str, preload: str) -> None:
    set_, name = object.__setattr__, name_of(connector)
    set_(connector, "stiffness", not_negative(f"{name} stiffness ({stiffness})", connector.stiffness))
    set_(connector, "damping", not_negative(f"{name} damping ({damping})", connector.damping))
    set_(connector, "preload", number(f"{name} preload ({preload})", connector.preload))
    given = [n for n in ("stiffness", "damping", "preload") if getattr(connector, n)]
    if connector.law is None and not given:
        raise PropertyError(f"{name} has no stiffness, damping, preload or law; one of them is needed")
    if connector.law is not None and not callable(connector.law):
        raise PropertyError(
            f"{name} law is {shown(connector.law)}; None or a callable (elongation, rate, t) -> number is allowed"
        )
    if connector.law is not None and given:
        raise PropertyError(
            f"{name} has a law beside {' and '.join(given)}; the law alone, or these, are allowed"
        )


def _place_or_point(value: object) -> Written | Point:
    """A place of a body, or a point of the ground."""
    pair: Any = value
    if not isinstance(value, str) and has_length(value, (2, 3)) and not isinstance(pair[0], str):
        return point("spring's point of the ground (m)", value)
    return written(value)


def _end_text(end: Written | Point) -> str:
    pair: Any = end
    return place_text(pair) if isinstance(pair, str) or isinstance(pair[0], str) else f"the point {pair!r}"
