"""Chains that are kept between runs, with what is found of them: a short run takes less time than its preparation.

Kept are small ones, by the scene itself, which never changes, and an equal discretisation. Not kept is what a function
of the user's answers; and what a run writes into, each run gets for itself.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any, TypeVar

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.jit.copies import Copies
from anctmm.model.kept import forget_structures
from anctmm.model.scene import Scene

T = TypeVar("T")

#: Chains that are kept at most, nodes that each may have, and numbers that the outputs of its runs may have.
CHAINS, NODES, OUTPUTS = 16, 512, 1 << 20


class _Same:
    """A scene as a key: this object, not one that is equal."""

    __slots__ = ("scene",)

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def __hash__(self) -> int:
        return id(self.scene)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.scene is self.scene


_chains: dict[tuple[_Same, Discretisation], Chain] = {}
_lock = Lock()


def chain_of(scene: Scene, run: Discretisation, make: Callable[[Scene, Discretisation], Chain]) -> Chain:
    """The chain of a scene and a discretisation, as kept from a run before, or made.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    make : callable
        Checks both and makes the chain; what it refuses is not kept.
    """
    key = _Same(scene), run
    found = _chains.get(key)
    if found is None:
        found = make(scene, run)
        if _to_be_kept(found):
            with _lock:
                if len(_chains) >= CHAINS:
                    _chains.clear()
                _chains[key] = found
    return found


def forget() -> None:
    """Keep nothing of the runs before: what changes code in a running process needs it."""
    with _lock:
        _chains.clear()
    forget_structures()


def _to_be_kept(chain: Chain) -> bool:
    """Whether a chain is small, and no function of the user's has a part in it."""
    run, nodes = chain.run, chain.bodies.nodes
    outputs = run.steps // run.stride + 2
    return (
        nodes <= NODES
        and outputs * nodes * chain.bodies.rows <= OUTPUTS
        and all(body.velocity is None for body in chain.scene.beams)
        and not (chain.plan.kept and chain.kept.constraints.drives)
    )


def once(chain: Chain, find: Callable[[Chain], T], what: Any = None) -> T:
    """What a function finds of a chain, found once: runs read it and do not write into it.

    Parameters
    ----------
    chain : Chain
    find : callable
        Calls no function of the user's.
    what : object
        What stands for it, where `find` is another function each time.
    """
    found: dict[Any, T] = vars(chain).setdefault("_found", {})
    key = what or find
    if key not in found:
        found[key] = find(chain)
    return found[key]


def is_found(chain: Chain, what: Any) -> bool:
    """Whether `once` has found something of a chain."""
    return what in vars(chain).get("_found", ())


def light(chain: Chain, find: Callable[[Chain], T]) -> T:
    """The same for what takes memory: of long chains it is found each time."""
    return once(chain, find) if chain.bodies.nodes <= NODES else find(chain)


@contextmanager
def own(chain: Chain, find: Callable[[Chain], T]) -> Iterator[T]:
    """The same for one run alone, which may write into its arrays: in the context, and no longer.

    What copies them is made for the second run.
    """
    if chain.bodies.nodes > NODES or not is_found(chain, (own, find)):
        once(chain, lambda _: True, what=(own, find))
        yield find(chain)
    else:
        with once(chain, lambda chain: Copies(find(chain)), what=find).one() as copy:
            yield copy
