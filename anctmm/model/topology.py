"""Order of the chains, derived from the joints as edges of a graph."""

from typing import Any, NamedTuple

from anctmm.errors import BranchError, ClosedLoopError

End = tuple[str, int]
"""Body and side: 0 its start, 1 its end."""


class Link(NamedTuple):
    """A body of a chain, passed from its inboard to its outboard end, with the joints at both.

    A joint between two bodies is the `outboard` one of the first and the `inboard` one of the next.
    """

    body: str
    reversed: bool
    inboard: Any | None
    outboard: Any | None


def chains_of(bodies: list[str], joints: list[tuple[Any, tuple[End, ...]]]) -> list[list[Link]]:
    """Chains from ground or free end to ground or free end, in the order of their first bodies.

    Parameters
    ----------
    bodies : list of str
    joints : list of (joint, ends)
        With one end (to ground) or two.

    Raises
    ------
    BranchError
        If a joint has more than two ends.
    ClosedLoopError
        If bodies are left that no end of a chain leads to.
    """
    at: dict[End, tuple[Any, End | None]] = {}
    for joint, ends in joints:
        if len(ends) > 2:
            raise BranchError(
                f"{joint!r} joins {len(ends)} ends; at most two are allowed: trees are not supported yet"
            )
        for i, end in enumerate(ends):
            at[end] = (joint, ends[1 - i] if len(ends) == 2 else None)
    free: tuple[Any, End | None] = (None, None)
    chains: list[list[Link]] = []
    seen: set[str] = set()
    for name in bodies:
        for side in (0, 1):
            if name not in seen and at.get((name, side), free)[1] is None:
                chain = _walk((name, side), at, free)
                seen.update(link.body for link in chain)
                chains.append(chain)
    left = [name for name in bodies if name not in seen]
    if left:
        raise ClosedLoopError(
            f"bodies {', '.join(map(repr, left))} close a loop that does not pass through the ground; "
            f"a chain from ground or free end to ground or free end is needed"
        )
    return chains


def _walk(first: End, at: dict[End, tuple[Any, End | None]], free: tuple[Any, End | None]) -> list[Link]:
    chain: list[Link] = []
    entry: End | None = first
    while entry is not None:
        body, side = entry
        inboard = at.get(entry, free)[0]
        outboard, entry = at.get((body, 1 - side), free)
        chain.append(Link(body, side == 1, inboard, outboard))
    return chain
