"""Features that a scene needs beyond beams, pins, welds and clamps, so that no solver ignores one."""

from collections.abc import Iterable, Iterator, Mapping

from anctmm.errors import UnsupportedError, shown, unknown_kind
from anctmm.model.bodies import BODIES, Beam
from anctmm.model.connectors import CONNECTORS, RotationalSpring, Spring
from anctmm.model.joints import JOINTS, Clamp, Pin, Prismatic, Slider, Weld
from anctmm.model.kept import alike, kept
from anctmm.model.loads import LOADS, Force, LineLoad, Torque
from anctmm.model.places import Written
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Scene

#: What mechanisms may need, and what it means.
MECHANISMS = {
    "rigid-bodies": "rigid bodies of any mass, inertia and points",
    "point-masses": "point masses",
    "sliders": "places that move on a line and are free to turn",
    "prismatic-joints": "places that move on a line and do not turn",
    "driven-guides": "sliders and prismatic joints whose position is a function of time",
    "moving-guides": "sliders and prismatic joints on lines that are fixed in rigid bodies",
    "driven-welds": "welds whose angle is a function of time",
    "free-stretch": "clamps and welds that hold directions and leave the stretch free",
    "free-welds": "welds that hold directions and leave the stretch free",
    "interior-joints": "joints at nodes between the ends of a beam",
    "springs": "springs and dampers between two places, or to the ground",
    "rotational-springs": "rotational springs and dampers",
    "driven-springs": "springs whose free length or angle is a function of time",
    "laws": "springs whose force is a function of elongation, rate and time",
    "interior-loads": "loads and connectors between the ends of a beam",
    "follower-forces": "forces that turn with their place",
    "line-loads": "forces along a beam",
    "own-joints": "joints of a user's own kind",
}
#: Between the features of a combination.
WITH = " + "


@kept
def features_of(scene: Scene) -> Mapping[str, object]:
    """Features of `MECHANISMS` that a scene needs, each with the first thing that needs it."""
    found: dict[str, object] = {}
    for feature, thing in needs(scene):
        found.setdefault(feature, thing)
    return found


def needs(scene: Scene) -> Iterator[tuple[str, object]]:
    """Features of `MECHANISMS` that a scene needs, each with the thing that needs it."""
    for body in scene.bodies:
        match body:
            case Beam():
                pass
            case RigidBody():
                yield "rigid-bodies", body
            case PointMass():
                yield "point-masses", body
            case _:
                raise unknown_kind("body", body, BODIES)
    yield from _of_joints(scene)
    yield from _connectors(scene)
    yield from _loads(scene)


def refuse(scene: Scene, lacks: Iterable[str], who: str, *features: str) -> None:
    """Refuse a scene that needs what a solver lacks.

    Parameters
    ----------
    scene : Scene
    lacks : iterable of str
        Features, or combinations of features joined by " + ", all of which must be needed.
    who : str
        The solver, for the message.
    *features : str
        Other features needed, such as "statics".

    Raises
    ------
    UnsupportedError
    """
    asked = features_of(scene)
    for parts in (lack.split(WITH) for lack in (sorted(lacks) if asked else ())):
        found = [part for part in parts if part in asked]
        if found and all(part in asked or part in features for part in parts):
            others = [part for part in parts if part not in asked]
            beside = f" with {', '.join(others)}" if others else ""
            raise UnsupportedError(
                f"{who} cannot do {shown(asked[found[0]])} of scene {scene.name!r}{beside}: {MECHANISMS[found[0]]} "
                f"are not offered"
            )


def _inside(scene: Scene, places: Iterable[Written]) -> bool:
    return any(scene.place(place).interior for place in places)


@alike
def _of_joints(scene: Scene) -> tuple[tuple[str, object], ...]:
    return tuple(_joints(scene))


def _joints(scene: Scene) -> Iterator[tuple[str, object]]:
    for joint in scene.joints:
        if _inside(scene, joint.places):
            yield "interior-joints", joint
        match joint:
            case Pin():
                pass
            case Clamp() | Weld():
                if isinstance(joint, Weld) and joint.angle is not None:
                    yield "driven-welds", joint
                if joint.stretch == "free":
                    yield "free-stretch", joint
                    if isinstance(joint, Weld):
                        yield "free-welds", joint
            case Slider() | Prismatic():
                yield "sliders" if isinstance(joint, Slider) else "prismatic-joints", joint
                if joint.position is not None:
                    yield "driven-guides", joint
                if joint.body is not None:
                    yield "moving-guides", joint
            case _ if type(joint) not in JOINTS:
                yield "own-joints", joint


def _connectors(scene: Scene) -> Iterator[tuple[str, object]]:
    for connector in scene.connectors:
        match connector:
            case Spring():
                yield "springs", connector
                if callable(connector.length):
                    yield "driven-springs", connector
            case RotationalSpring():
                yield "rotational-springs", connector
                if callable(connector.angle):
                    yield "driven-springs", connector
            case _:
                raise unknown_kind("connector", connector, CONNECTORS)
        if connector.law is not None:
            yield "laws", connector
        if _inside(scene, connector.places):
            yield "interior-loads", connector


def _loads(scene: Scene) -> Iterator[tuple[str, object]]:
    for load in scene.loads:
        match load:
            case Force() | Torque():
                if _inside(scene, (load.end,)):
                    yield "interior-loads", load
                if isinstance(load, Force) and load.follower:
                    yield "follower-forces", load
            case LineLoad():
                yield "line-loads", load
            case _:
                raise unknown_kind("load", load, LOADS)
