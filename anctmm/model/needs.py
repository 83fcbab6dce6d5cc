"""Features that a scene needs beyond beams, pins, welds and clamps, so that no solver ignores one."""

from collections.abc import Iterable, Iterator, Mapping

from anctmm.errors import UnsupportedError, shown
from anctmm.model.joints import Joint
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


def needs(scene: Scene) -> Iterator[tuple[str, object]]:
    """Features of `MECHANISMS` that a scene needs, each with every thing that needs it."""
    for thing in (*scene.bodies, *scene.joints, *scene.connectors, *scene.loads):
        yield from ((feature, thing) for feature, needed in thing.features.items() if needed)
        if any(scene.place(place).interior for place in thing.places):
            yield "interior-joints" if isinstance(thing, Joint) else "interior-loads", thing


def features_of(scene: Scene) -> Mapping[str, object]:
    """Features of `MECHANISMS` that a scene needs, each with the first thing that needs it."""
    found: dict[str, object] = {}
    for feature, thing in needs(scene):
        found.setdefault(feature, thing)
    return found


def refuse(scene: Scene, lacks: Iterable[str], who: str, *features: str) -> None:
    """Refuse a scene that needs what a solver, `who`, lacks: an UnsupportedError names the feature and the thing.

    `lacks`: features, or combinations of features joined by " + ", all of which must be needed; `features`: others that
    are needed, such as "statics".
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
