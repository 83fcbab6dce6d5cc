"""The factored mass in scalar blocks: x and y share them, and r_y is separate.

Any constant mass without a weld at an angle has this form; the contribution of what is kept is separate: of places in
`kept_places`, of few unknowns in `kept_motions`. It is factored once for a whole run. Other matrices need the full
blocks of `riccati`, which describes the recursion.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.plan import BREAK, PIN, WELD, Kept
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import kernel
from anctmm.jit.copies import writes
from anctmm.recursion.branches import Branches, branches
from anctmm.recursion.kept.motions import KeptMotions, kept_motions
from anctmm.recursion.kept.places import KeptPlaces, kept_places
from anctmm.recursion.lines import Lines, lines

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@writes("branches", "lines", "kept", "places")
@by_address
class SplitFactors(NamedTuple):
    """Factored mass in scalar blocks.

    Parameters
    ----------
    L : ndarray, shape (5, nodes)
        L_rr, L_rg, L_gr, L_gg, L_dd of each node.
    G : ndarray, shape (4, nodes)
        G_rr, G_rg, G_gg, G_dd.
    D : ndarray, shape (4, nodes)
        Condensed mass of all that lies inboard of the node.
    branches : Branches
    lines : Lines or None
    kept : KeptMotions or None
    places : KeptPlaces or None
        None where there are none: then nothing of them is compiled.
    """

    L: Array
    G: Array
    D: Array
    branches: Branches
    lines: Lines | None
    kept: KeptMotions | None
    places: KeptPlaces | None


def split_factors(chain: Chain) -> SplitFactors:
    """Factor the mass of a chain of scalar blocks (`Chain.split`), once for a whole run.

    What is kept is held there, unless that are places alone (`kept_places`).
    """
    n, bodies = chain.bodies.nodes, chain.bodies
    L, G, D, meeting = np.zeros((5, n)), np.zeros((4, n)), np.zeros((4, n)), branches(chain)
    masks = np.ones((3, n), dtype=bool)
    masks[: bodies.rows // 2] = (chain.prescribed | chain.held)[::2]
    link = chain.link
    if chain.plan.kept and not chain.kept.pinned:
        link = np.where([isinstance(step.to, Kept) for step in chain.plan.steps], BREAK, link)
    _factorize_split(bodies.first, bodies.masses, link, masks, L, G, D, meeting)
    kept, places = kept_motions(chain, L), kept_places(chain, L, G, D)
    return SplitFactors(L, G, D, meeting, lines(chain, L, G), kept, places)


def no_split_factors(chain: Chain) -> SplitFactors:
    """What stands in their place where there are none."""
    L, G, D = np.zeros((3, 1, 1))
    return SplitFactors(L, G, D, branches(chain), None, None, None)


@kernel
def _factorize_split(
    first: Ints,
    masses: Array,
    link: Ints,
    masks: NDArray[np.bool_],
    L: Array,
    G: Array,
    D: Array,
    places: Branches,
) -> None:
    at, to, take, _, _, waiting = places
    place = 0
    rr = rg = gg = dd = 0.0
    for b in range(len(link)):
        m = masses[b]
        last = first[b + 1] - 1
        for i in range(first[b], last + 1):
            if i == at[place]:
                if to[place] >= 0:
                    S = waiting[to[place]]
                    S[0], S[1], S[2], S[3] = S[0] + rr, S[1] + rg, S[2] + gg, S[3] + dd
                    rr = rg = gg = dd = 0.0
                if take[place] >= 0:
                    S = waiting[take[place]]
                    rr, rg, gg, dd = rr + S[0], rg + S[1], gg + S[2], dd + S[3]
                    S[:4] = 0.0
                place += 1
            D[0, i], D[1, i], D[2, i], D[3, i] = rr, rg, gg, dd
            if first[b] == last:  # a body of one node
                rr, gg = rr + m[0, 0], gg + m[1, 1]
            if i < last:
                rr, rg, gg, dd = rr + m[0, 0], rg + m[0, 1], gg + m[1, 1], dd + m[2, 2]
            if i == last and link[b] == WELD:
                L[0, i] = L[3, i] = L[4, i] = -1.0
                continue
            pinned = i == last and link[b] == PIN
            _invert_split(rr, rg, gg, dd, masks[0, i] or pinned, masks[1, i], masks[2, i], G[:, i])
            if pinned:
                L[0, i], L[1, i] = -1.0, rg * G[2, i]
                rr, rg, gg, dd = rr - rg * G[2, i] * rg, 0.0, 0.0, 0.0
            elif i == last:
                rr = rg = gg = dd = 0.0
            else:
                for k in range(2):
                    L[2 * k, i] = m[3 + k, 0] * G[0, i] + m[3 + k, 1] * G[1, i]
                    L[2 * k + 1, i] = m[3 + k, 0] * G[1, i] + m[3 + k, 1] * G[2, i]
                L[4, i] = m[5, 2] * G[3, i]
                rr = m[3, 3] - L[0, i] * m[0, 3] - L[1, i] * m[1, 3]
                rg = m[3, 4] - L[0, i] * m[0, 4] - L[1, i] * m[1, 4]
                gg = m[4, 4] - L[2, i] * m[0, 4] - L[3, i] * m[1, 4]
                dd = m[5, 5] - L[4, i] * m[2, 5]


@kernel
def _invert_split(
    rr: float, rg: float, gg: float, dd: float, no_r: bool, no_g: bool, no_d: bool, G: Array
) -> None:
    """Inverse of [[rr, rg], [rg, gg]] ⊕ dd on the components that are not left out."""
    G[:] = 0.0
    if not no_r and not no_g:
        det = rr * gg - rg * rg
        G[0], G[1], G[2] = gg / det, -rg / det, rr / det
    elif not no_r:
        G[0] = 1.0 / rr
    elif not no_g:
        G[2] = 1.0 / gg
    if not no_d:
        G[3] = 1.0 / dd
