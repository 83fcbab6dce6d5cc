"""Whether the parts of a scene are of a known kind, and fit each other."""

from typing import Any

from anctmm.errors import SceneError, shown
from anctmm.model.bodies import BODIES
from anctmm.model.checks.joints import check_joints
from anctmm.model.checks.space import check_dimension
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
    check_dimension(scene)
    check_joints(scene)
    for connector in scene.connectors:
        check_connector(scene, connector)
    for load in scene.loads:
        check_load(scene, load)
