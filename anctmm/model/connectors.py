"""Connectors: springs and dampers between two places, or between a place and the ground.

The force of a spring is N = k (L − l) + c (L' − l') + preload, L the distance of its places, positive if it pulls them
together; the moment of a rotational spring is M = k (φ − φ₀) + c (φ' − φ₀') + preload, positive if it works against φ.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import dist
from typing import Any, ClassVar, final

from anctmm.errors import PropertyError, RepeatedJointError, UnknownKindError, shown
from anctmm.model.accepted import ConnectorKind, Point
from anctmm.model.drives import breaks_of, value_at
from anctmm.model.places import Graph, Place, Written, place_text, written
from anctmm.model.rigid_bodies import RigidBody
from anctmm.validation import answer_of, has_length, not_negative, number, point

Pair = Callable[[Any], tuple[Any, Any]]
"""t (s) → a value and its rate."""
Law = Callable[[float, float, float], float]
"""(elongation, its rate, t) → the force or moment that works against it."""


class _Connecting(ConnectorKind):
    """What all connectors are: places, coefficients or a law, and a free value, whose name and units each kind says."""

    called: ClassVar[str]
    free_name: ClassVar[str]
    units: ClassVar[tuple[str, str, str]]
    first: Written
    second: Any
    law: Law | None

    @property
    def features(self) -> dict[str, bool]:
        return {
            f"{self.called.replace(' ', '-')}s": True,
            "driven-springs": callable(self.free),
            "laws": self.law is not None,
        }

    @property
    def free(self) -> Any:
        """Its free length or angle."""
        return getattr(self, self.free_name)

    @property
    def ground(self) -> Point | None:
        """The point of the ground that it is fixed to."""
        pair = has_length(self.second, (2, 3)) and not isinstance(self.second[0], str)
        return self.second if pair else None

    @property
    def places(self) -> tuple[Written, ...]:
        """Places of bodies that it acts on."""
        return (self.first,) if self.second is None or self.ground is not None else (self.first, self.second)

    def _check(self) -> None:
        """Check and keep its places and coefficients."""
        set_, law = object.__setattr__, self.law
        set_(self, "first", written(self.first))
        if isinstance(self, Spring) and self.ground is not None:
            set_(self, "second", point("spring's point of the ground (m)", self.second))
        elif self.second is not None or isinstance(self, Spring):
            set_(self, "second", written(self.second))
        name, given = name_of(self), []
        for what, unit in zip(("stiffness", "damping", "preload"), self.units, strict=True):
            check = number if what == "preload" else not_negative
            set_(self, what, check(f"{name} {what} ({unit})", getattr(self, what)))
            given += [what] if getattr(self, what) else []
        if law is not None and not callable(law):
            raise PropertyError(
                f"{name} law is {shown(law)}; a callable (elongation, rate, t) -> number is needed"
            )
        if (law is None) == (not given):
            has = f"a law beside {' and '.join(given)}" if given else "no stiffness, damping, preload or law"
            raise PropertyError(f"{name} has {has}; a law alone, or one or more of the others, is needed")


@final
@dataclass(frozen=True)
class Spring(_Connecting):
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

    in_space = True
    called, free_name, units = "spring", "length", ("N/m", "N s/m", "N")
    first: Written
    second: Written | Point
    stiffness: float = 0.0
    damping: float = 0.0
    length: float | Pair | None = None
    law: Law | None = None
    preload: float = 0.0

    def __post_init__(self) -> None:
        self._check()
        if self.length is not None and not callable(self.length):
            length = not_negative(f"{name_of(self)} length (m)", self.length)
            object.__setattr__(self, "length", length)


@final
@dataclass(frozen=True)
class RotationalSpring(_Connecting):
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

    called, free_name, units = "rotational spring", "angle", ("N m/rad", "N m s/rad", "N m")
    first: Written
    second: Written | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    angle: float | Pair = 0.0
    law: Law | None = None
    preload: float = 0.0

    def __post_init__(self) -> None:
        self._check()
        if not callable(self.angle):
            object.__setattr__(self, "angle", number(f"{name_of(self)} angle (rad)", self.angle))


Connector = Spring | RotationalSpring
#: All kinds. None may be a subclass of another: solvers distinguish them by class.
CONNECTORS = (Spring, RotationalSpring)


def name_of(connector: Any) -> str:
    """A connector as messages name it."""
    to = "the ground" if connector.second is None else f"the point {connector.second!r}"
    if len(connector.places) == 2:
        to = place_text(connector.second)
    return f"{connector.called} from {place_text(connector.first)} to {to}"


def ends_of(scene: Graph, connector: Connector) -> tuple[Place, Place | Point | None]:
    """Both ends of a connector: places, or a point of the ground, or, of a rotational spring, the ground."""
    first, *second = map(scene.place, connector.places)
    return first, second[0] if second else connector.ground


def free_of(connector: Connector, reference: float, time: float) -> tuple[float, float]:
    """Free length (m) or angle (rad) of a connector at a time, and its rate; `reference` is the length as placed."""
    free = connector.free
    if callable(free):
        value, rate = value_at(f"{name_of(connector)} {free_name(connector)}", free, time, 2)
        return float(value), float(rate)
    return (reference if free is None else float(free)), 0.0


def free_name(connector: Connector) -> str:
    """What the free value of a connector is called."""
    return connector.free_name


def check_connector(scene: Graph, connector: Connector) -> None:
    """Refuse a connector that does not fit the scene, or whose functions give nothing at t = 0."""
    first, second = ends_of(scene, connector)
    places = [place for place in (first, second) if isinstance(place, Place)]
    if len({place.canonical for place in places}) < len(places):
        raise RepeatedJointError(f"{name_of(connector)} names one place twice; two places are needed")
    if len(places) == 2 and isinstance(first.body, RigidBody) and first.body is places[1].body:
        raise RepeatedJointError(
            f"{name_of(connector)} acts between points of one rigid body, which do not move relative to each other; "
            f"places of two bodies are needed"
        )
    start = 0.0
    if isinstance(connector, Spring):
        p, q = first.position, connector.ground or places[1].position
        start = dist(p, q)
        if start <= 1e-14 * max(map(abs, (*p, *q))):
            raise PropertyError(
                f"{name_of(connector)} joins places at one point {p!r}; two points apart are needed, which give it a "
                f"direction"
            )
    elif still := [place for place in places if not place.turns]:
        raise UnknownKindError(
            f"{name_of(connector)} acts on the point mass {still[0].body.name!r}, which does not turn; a place of a "
            f"beam or a rigid body is needed"
        )
    _check_functions(connector, start)


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
    """What a law answers; PropertyError unless it is one finite number."""
    asked = f"{name} law (elongation, rate, t) at elongation {elongation!r}, rate {rate!r}, t = {time!r} s"
    return float(answer_of(asked, law, elongation, rate, time, count=1)[0])
