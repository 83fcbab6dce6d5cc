"""Facts computed once: of a scene, which is immutable, or of all scenes with the same structure.

Scenes have the same structure if they have the same bodies by kind and name, and the same joints, as in a parameter
study. The connections follow from these alone; places, sections, materials, velocities, gravity, loads and connectors
do not affect them.
"""

from collections.abc import Callable
from functools import wraps
from threading import Lock
from typing import Any, TypeVar

T = TypeVar("T")
Facts = dict[Any, Any]

#: Structures whose facts are kept at most, bodies that each may have, and numbers in arrays that describe one.
STRUCTURES, BODIES, NUMBERS = 32, 512, 4096
#: What names of facts of a scene begin with, and the name of those of its structure.
PREFIX = "_kept "
_STRUCTURE = f"{PREFIX}structure"

_structures: dict[Any, Facts] = {}
_tables: list[dict[Any, Any]] = [_structures]
_lock = Lock()


def kept(find: Callable[[Any], T]) -> Callable[[Any], T]:
    """Make a function of a scene look only once.

    Parameters
    ----------
    find : callable
        scene → fact. It calls no function of the user's, whose answers may change, and nobody writes into what it
        finds.
    """
    name = f"{PREFIX}{find.__module__}.{find.__qualname__}"

    @wraps(find)
    def get(scene: Any) -> T:
        facts = vars(scene)
        if name not in facts:
            facts[name] = find(scene)
        return facts[name]  # type: ignore[no-any-return]

    return get


def kept_beside(find: Callable[[Any, Any], T]) -> Callable[[Any, Any], T]:
    """Make a function of a scene and something else look only once for each of these after another.

    Parameters
    ----------
    find : callable
        (scene, other) → fact, of an other that never changes; as of `kept`.
    """
    name = f"{PREFIX}{find.__module__}.{find.__qualname__}"

    @wraps(find)
    def get(scene: Any, other: Any) -> T:
        facts = vars(scene)
        found = facts.get(name)
        if found is None or found[0] is not other:
            found = facts[name] = other, find(scene, other)
        return found[1]  # type: ignore[no-any-return]

    return get


def alike(find: Callable[[Any], T]) -> Callable[[Any], T]:
    """Make a function of a scene look only once at all scenes of a structure.

    Parameters
    ----------
    find : callable
        scene → fact. It reads the kinds and names of bodies, and joints, but no number of a body, load or connector.
        Nobody writes into what it finds.
    """

    @wraps(find)
    def get(scene: Any) -> T:
        facts = facts_alike(scene)
        if find not in facts:
            facts[find] = find(scene)
        return facts[find]  # type: ignore[no-any-return]

    return get


def facts_alike(scene: Any) -> Facts:
    """What is known of all scenes of a scene's structure, to be added to; of large ones each has its own."""
    facts: Facts | None = vars(scene).get(_STRUCTURE)
    if facts is None:
        facts = vars(scene)[_STRUCTURE] = _facts(scene)
    return facts


def _facts(scene: Any) -> Facts:
    if len(scene.bodies) > BODIES:
        return {}
    key = tuple((type(body), body.name, getattr(body, "keys", None)) for body in scene.bodies), scene.joints
    try:
        found = _structures.get(key)
    except Exception:  # a history of the user's that cannot be hashed or compared
        return {}
    if found is None:
        with _lock:
            if len(_structures) >= STRUCTURES:
                _structures.clear()
            found = _structures.setdefault(key, {})
    return found
