"""Chains stored between runs, because the preparation of a short run takes longer than its steps.

Small chains are stored, by the scene, which is immutable, and by an equal discretisation. Values returned by a user's
functions are not stored; arrays that a run changes are new for each run.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any, TypeVar

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.jit.copies import Copies
from anctmm.model.bodies import Beam
from anctmm.model.kept import forget_structures
from anctmm.model.scene import Scene

T = TypeVar("T")

#: Chains that are kept at most, nodes that each may have, and numbers that the outputs of its runs may have.
CHAINS, NODES, OUTPUTS = 16, 512, 1 << 20
#: Of chains of one structure those of other places or masses of which something is kept, at most.
MASSES = 8


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
    found: dict[Any, T] = chain.found
    key = what or find
    if key not in found:
        found[key] = find(chain)
    return found[key]


def once_alike(chain: Chain, find: Callable[[], T], what: Any, kinds: tuple[Any, ...] = ()) -> T:
    """What is found once for all chains alike on which neither loads nor connectors act; of others for each.

    Parameters
    ----------
    chain : Chain
    find : callable
        Compiles a kernel for arguments whose types are the same of all chains alike with these kinds.
    what : object
        The kernel.
    kinds : tuple
        What else the types tell of the arguments.
    """
    acted = chain.scene.loads or chain.scene.connectors
    known = chain.found if acted else chain.facts
    if (what, kinds) not in known:
        known[what, kinds] = find()
    return known[what, kinds]  # type: ignore[no-any-return]


def of_masses(chain: Chain, find: Callable[[], T], what: Any) -> T:
    """What follows from structure, places and masses of a chain, found twice at most for all chains alike in these.

    So are scenes of another stiffness, or with other loads, and runs with other steps. What copies it is made for the
    second chain: scenes that all differ in their places or masses need no copies.

    Parameters
    ----------
    chain : Chain
    find : callable
        Finds it; it calls no function of the user's.
    what : object
        What stands for it.

    Returns
    -------
    T
        With arrays of its own, as far as kernels write into them.
    """
    bodies, facts = chain.bodies, chain.facts
    if bodies.nodes > NODES or chain.start is not None:
        return find()
    others = tuple(body for body in chain.parts.bodies if not isinstance(body, Beam))
    key = bodies.masses.tobytes(), bodies.undeformed.tobytes(), others
    known = facts.setdefault(what, {})
    if known.get(key) is None:
        found = find()
        if key not in known and len(known) >= MASSES:
            known.clear()
        known[key] = Copies(found) if key in known else None
        return found
    return known[key].new()  # type: ignore[no-any-return]


def light(chain: Chain, find: Callable[[Chain], T]) -> T:
    """The same for what takes memory: of long chains it is found each time."""
    return once(chain, find) if chain.bodies.nodes <= NODES else find(chain)


def has_own(chain: Chain, find: Callable[[Chain], T]) -> bool:
    """Whether a run of a chain has had something for itself."""
    return (own, find) in chain.found


@contextmanager
def own(chain: Chain, find: Callable[[Chain], T]) -> Iterator[T]:
    """The same for one run alone, which may write into its arrays: in the context, and no longer.

    What copies them is made for the second run.
    """
    if chain.bodies.nodes > NODES or not has_own(chain, find):
        once(chain, lambda _: True, what=(own, find))
        yield find(chain)
    else:
        with once(chain, lambda chain: Copies(find(chain)), what=find).one() as copy:
            yield copy
