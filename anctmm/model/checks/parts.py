"""Whether the parts of a scene are of a known kind, have the same number of components, and fit each other.

In space are offered: cables with a circular section and without damping, clamped, pinned or free, rigid bodies, point
masses, pins (ball joints), revolute joints of rigid bodies, joints of a user's own, springs, forces, line loads and
gravity. All else is refused by name.
"""

from typing import Any

from anctmm.errors import ResultError, SceneError, UnsupportedError, shown
from anctmm.model.bodies import BODIES
from anctmm.model.checks.joints import check_joints
from anctmm.model.connectors import CONNECTORS, check_connector
from anctmm.model.joints import JOINTS, Joint
from anctmm.model.loads import LOADS, check_load
from anctmm.validation import several

#: All kinds of parts, by what a scene calls them.
KINDS: dict[str, tuple[type, ...]] = {
    "bodies": BODIES, "joints": JOINTS, "loads": LOADS, "connectors": CONNECTORS
}  # fmt: skip


def parts_of(what: str, things: object) -> tuple[Any, ...]:
    """Things of an ordered iterable, each of exactly one of the kinds, or a joint of a user's own kind."""
    kinds = KINDS[what]
    names = ", ".join(kind.__name__ for kind in kinds)
    found = several(f"scene {what} is", things, f"a list of {names} is needed", SceneError)
    for thing in found:
        own = what == "joints" and isinstance(thing, Joint) and not isinstance(thing, kinds)
        if type(thing) not in kinds and not own:
            raise SceneError(
                f"scene {what} hold {shown(thing)} of type {type(thing).__name__}; allowed are {names}"
            )
    return tuple(found)


def check_parts(scene: Any) -> None:
    """Refuse parts that do not fit each other; errors as of `check_joints`, `check_connector` and `check_load`."""
    _check_dimension(scene)
    check_joints(scene)
    for connector in scene.connectors:
        check_connector(scene, connector)
    for load in scene.loads:
        check_load(scene, load)


def _check_dimension(scene: Any) -> None:
    """Refuse what has another number of components than a scene's first body, or is not offered in so many."""
    counts = [(body, body.dim) for body in scene.bodies]
    counts += [(load, len(load.value)) for load in scene.loads if isinstance(load.value, tuple)]
    counts += [(c, len(c.ground)) for c in scene.connectors if c.ground is not None]
    for thing, count in counts:
        if count != scene.dim:
            raise SceneError(
                f"{shown(thing)} has {count} components; {scene.dim} are needed, as body {scene.bodies[0].name!r} of "
                f"scene {scene.name!r} has"
            )
    for thing in [*scene.bodies, *scene.joints, *scene.loads, *scene.connectors]:
        if why := thing.misfit(scene):
            raise UnsupportedError(f"{shown(thing)} {why}")


def check_plane(scene: Any, what: str) -> None:
    """Refuse a result that is offered in the plane alone, by a ResultError."""
    if scene.dim == 3:
        raise ResultError(f"{what} are offered in the plane, and scene {scene.name!r} is in space")
