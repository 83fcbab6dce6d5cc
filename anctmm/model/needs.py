"""Features that a scene needs beyond beams, pins, welds and clamps, so that no solver ignores one."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from anctmm.errors import UnsupportedError, shown
from anctmm.model.connectors import CONNECTORS, RotationalSpring, Spring
from anctmm.model.joints import JOINTS, Clamp, Guide, Joint, Prismatic, Slider, Weld
from anctmm.model.loads import Force, LineLoad, Torque
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Scene


def _inside(scene: Scene, *places: Any) -> bool:
    return any(scene.place(place).interior for place in places)


def _free(thing: Any, *kinds: type) -> bool:
    return isinstance(thing, kinds) and thing.stretch == "free"


Need = Callable[[Scene, Any], bool]
#: What mechanisms may need, what it means, and whether a thing of a scene needs it.
_NEEDS: dict[str, tuple[str, Need]] = {
    "rigid-bodies": (
        "rigid bodies of any mass, inertia and points",
        lambda _, x: isinstance(x, RigidBody),
    ),
    "point-masses": ("point masses", lambda _, x: isinstance(x, PointMass)),
    "sliders": ("places that move on a line and are free to turn", lambda _, x: isinstance(x, Slider)),
    "prismatic-joints": (
        "places that move on a line and do not turn",
        lambda _, x: isinstance(x, Prismatic),
    ),
    "driven-guides": (
        "sliders and prismatic joints whose position is a function of time",
        lambda _, x: isinstance(x, Guide) and x.position is not None,
    ),
    "moving-guides": (
        "sliders and prismatic joints on lines that are fixed in rigid bodies",
        lambda _, x: isinstance(x, Guide) and x.body is not None,
    ),
    "driven-welds": (
        "welds whose angle is a function of time",
        lambda _, x: isinstance(x, Weld) and x.angle is not None,
    ),
    "free-stretch": (
        "clamps and welds that hold directions and leave the stretch free",
        lambda _, x: _free(x, Clamp, Weld),
    ),
    "free-welds": ("welds that hold directions and leave the stretch free", lambda _, x: _free(x, Weld)),
    "interior-joints": (
        "joints at nodes between the ends of a beam",
        lambda s, x: isinstance(x, Joint) and _inside(s, *x.places),
    ),
    "springs": (
        "springs and dampers between two places, or to the ground",
        lambda _, x: isinstance(x, Spring),
    ),
    "rotational-springs": (
        "rotational springs and dampers",
        lambda _, x: isinstance(x, RotationalSpring),
    ),
    "driven-springs": (
        "springs whose free length or angle is a function of time",
        lambda _, x: isinstance(x, CONNECTORS) and callable(x.free),
    ),
    "laws": (
        "springs whose force is a function of elongation, rate and time",
        lambda _, x: isinstance(x, CONNECTORS) and x.law is not None,
    ),
    "interior-loads": (
        "loads and connectors between the ends of a beam",
        lambda s, x: (
            (isinstance(x, CONNECTORS) and _inside(s, *x.places))
            or (isinstance(x, Force | Torque) and _inside(s, x.end))
        ),
    ),
    "follower-forces": (
        "forces that turn with their place",
        lambda _, x: isinstance(x, Force) and x.follower,
    ),
    "line-loads": ("forces along a beam", lambda _, x: isinstance(x, LineLoad)),
    "own-joints": (
        "joints of a user's own kind",
        lambda _, x: isinstance(x, Joint) and type(x) not in JOINTS,
    ),
}
#: What mechanisms may need, and what it means.
MECHANISMS = {feature: meaning for feature, (meaning, _) in _NEEDS.items()}
#: Between the features of a combination.
WITH = " + "


def needs(scene: Scene) -> Iterator[tuple[str, object]]:
    """Features of `MECHANISMS` that a scene needs, each with every thing that needs it."""
    for thing in (*scene.bodies, *scene.joints, *scene.connectors, *scene.loads):
        yield from ((feature, thing) for feature, (_, needed) in _NEEDS.items() if needed(scene, thing))


def features_of(scene: Scene) -> Mapping[str, object]:
    """Features of `MECHANISMS` that a scene needs, each with the first thing that needs it."""
    found: dict[str, object] = {}
    for feature, thing in needs(scene):
        found.setdefault(feature, thing)
    return found


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
