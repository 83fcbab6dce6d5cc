"""Whether all of a scene has the same number of components, and in space only what is offered there.

In space are offered: cables with a circular section and without damping, clamped, pinned or free, rigid bodies, point
masses, pins (ball joints), revolute joints of rigid bodies, joints of a user's own, springs, forces, line loads and
gravity. All else is refused by name.
"""

from collections.abc import Iterable
from typing import Any

from anctmm.errors import ResultError, SceneError, UnsupportedError, shown
from anctmm.model.connectors import Spring
from anctmm.model.loads import Force, LineLoad


def check_dimension(scene: Any) -> None:
    """Refuse what has another number of components than a scene's first body, or is not offered in so many."""
    dim = scene.dim
    for thing, count in _components(scene):
        if count != dim:
            raise SceneError(
                f"{shown(thing)} has {count} components; {dim} are needed, as body {scene.bodies[0].name!r} of scene "
                f"{scene.name!r} has"
            )
    for thing in [*scene.bodies, *scene.joints, *scene.loads, *scene.connectors]:
        if why := thing.misfit(scene):
            raise UnsupportedError(f"{shown(thing)} {why}")


def check_plane(scene: Any, what: str) -> None:
    """Refuse a result that is offered in the plane alone, by a ResultError."""
    if scene.dim == 3:
        raise ResultError(f"{what} are offered in the plane, and scene {scene.name!r} is in space")


def _components(scene: Any) -> Iterable[tuple[Any, int]]:
    """Things with a number of components, and the number."""
    for body in scene.bodies:
        yield body, body.dim
    for load in scene.loads:
        if isinstance(load, Force | LineLoad) and not callable(load.value):
            yield load, len(load.value)
    for connector in scene.connectors:
        if isinstance(connector, Spring) and connector.ground is not None:
            yield connector, len(connector.ground)
