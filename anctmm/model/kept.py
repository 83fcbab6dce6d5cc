"""Facts of a scene that are found once and stay with it: a scene never changes."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

T = TypeVar("T")


def kept(find: Callable[[Any], T]) -> Callable[[Any], T]:
    """Make a function of a scene look only once.

    Parameters
    ----------
    find : callable
        scene → fact. It calls no function of the user's, whose answers may change, and nobody writes into what it
        finds.
    """
    name = f"_kept {find.__module__}.{find.__qualname__}"

    @wraps(find)
    def get(scene: Any) -> T:
        facts = vars(scene)
        if name not in facts:
            facts[name] = find(scene)
        return facts[name]  # type: ignore[no-any-return]

    return get
