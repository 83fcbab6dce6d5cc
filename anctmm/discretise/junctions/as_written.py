"""Joints, loads and connectors at other places: on the parts of a beam that is cut, and back, as the user wrote them.

Messages name what the user wrote: names of parts are in no scene of the user's.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from anctmm.errors import unknown_kind
from anctmm.model.connectors import CONNECTORS, Connector, RotationalSpring, Spring
from anctmm.model.joints import JOINTS, Clamp, Joint, Pin, Prismatic, Slider, Weld
from anctmm.model.kept import PREFIX
from anctmm.model.loads import Force, LineLoad, Load, Torque
from anctmm.model.places import SIDES, End, Written, place_text
from anctmm.model.scene import Scene

Thing = TypeVar("Thing", Joint, Load, Connector)
Place = Callable[[Written], Written]

#: Where a scene of parts has its names.
_NAMES = f"{PREFIX}names"


class Names(NamedTuple):
    """Places of the user's by those of parts, and names of beams by those of parts."""

    places: Mapping[Written, Written]
    bodies: Mapping[str, str]

    def place(self, place: Written) -> Written:
        """A place as the user wrote it."""
        return self.places.get(place, place)


def name_parts(parts: Scene, names: Names) -> None:
    """Tell a scene of parts what the user wrote."""
    vars(parts)[_NAMES] = names


def as_written(scene: Scene, thing: Thing) -> Thing:
    """A joint, a load or a connector of a scene, of parts or not, as the user wrote it."""
    names: Names | None = vars(scene).get(_NAMES)
    if names is None:
        return thing
    found: Any = thing
    if isinstance(found, LineLoad):
        found = replace(found, body=names.bodies.get(found.body, found.body))
    else:
        found = at_places(found, names.place)
    return found  # type: ignore[no-any-return]


def end_as_written(scene: Scene, end: End) -> str:
    """The end of a body, or of a part, as messages name it."""
    names: Names | None = vars(scene).get(_NAMES)
    name, key = end
    if names is None or name not in names.bodies:
        return place_text(end)
    return place_text(names.place(f"{name}.{SIDES[int(key)]}"))


def body_as_written(scene: Scene, name: str) -> str:
    """The body that a part belongs to, or a body itself."""
    names: Names | None = vars(scene).get(_NAMES)
    return name if names is None else names.bodies.get(name, name)


def places_of(scene: Scene) -> Iterator[Written]:
    """Places of a scene where something acts."""
    yield from (load.end for load in scene.loads if not isinstance(load, LineLoad))
    yield from (place for connector in scene.connectors for place in connector.places)
    yield from (place for joint in scene.joints for place in joint.ends)


def at_places(thing: Any, place: Place) -> Any:
    """A joint, a force, a torque or a connector at other places.

    Raises
    ------
    UnknownKindError
        If it is none of these.
    """
    match thing:
        case Pin():
            return Pin(*map(place, thing.ends), grounded=thing.grounded)
        case Weld():
            return Weld(
                *map(place, thing.ends), grounded=thing.grounded, angle=thing.angle, stretch=thing.stretch
            )
        case Clamp() | Force() | Torque():
            return replace(thing, end=place(thing.end))
        case Slider() | Prismatic():
            return replace(thing, place=place(thing.place))
        case Spring():
            second = thing.ground if thing.ground is not None else place(thing.places[1])
            return replace(thing, first=place(thing.first), second=second)
        case RotationalSpring():
            return replace(
                thing, first=place(thing.first), second=None if thing.second is None else place(thing.second)
            )
        case _:
            raise unknown_kind("joint, load or connector", thing, (*JOINTS, Force, Torque, *CONNECTORS))
