"""Data of chains that depend on structure and mesh only, not on numbers: computed once for all chains that share them.

Order of elimination, links and fixed unknowns follow from the structure of the scene (`anctmm.model.kept.alike`) and
from the number and kind of the elements of each beam.
"""

from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar, overload

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.kept import Facts, facts_alike
from anctmm.model.scene import Scene

T = TypeVar("T")

#: Elements of a scene up to which facts are kept.
ELEMENTS = 512


class Structured(Protocol):
    """What has a structure; `anctmm.discretise.chain.Chain` does."""

    @property
    def facts(self) -> Facts:
        """Those of its structure."""
        ...


def facts_of(scene: Scene, run: Discretisation) -> Facts:
    """What is known of all scenes alike one, so cut, to be added to; of large ones each chain has its own."""
    cut = tuple(run.of(scene).values())
    if sum(elements for elements, _ in cut) > ELEMENTS:
        return {}
    facts: Facts = facts_alike(scene).setdefault(cut, {})
    return facts


def common(chain: Structured, find: Callable[[Any], T]) -> T:
    """The result of a function of a chain, computed once for all chains with the same structure: read-only.

    Parameters
    ----------
    chain : Chain
    find : callable
        It reads names, joints and elements only, no numbers.
    """
    facts = chain.facts
    if find not in facts:
        facts[find] = find(chain)
    return facts[find]  # type: ignore[no-any-return]


class shared(Generic[T]):
    """A property of a chain that is found once for all chains alike.

    Parameters
    ----------
    find : callable
        As of `common`.
    """

    def __init__(self, find: Callable[[Any], T]) -> None:
        self.find = find
        self.__doc__ = find.__doc__

    @overload
    def __get__(self, chain: None, kind: type) -> "shared[T]": ...

    @overload
    def __get__(self, chain: Any, kind: type) -> T: ...

    def __get__(self, chain: Any, kind: type) -> Any:
        if chain is None:
            return self
        found = vars(chain)[self.find.__name__] = common(chain, self.find)
        return found
