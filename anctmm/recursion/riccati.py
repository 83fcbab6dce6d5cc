"""The Riccati recursion, compiled (Rong 2014, eqs. 28-35, in the partition P = S δ̈ + e).

At node i the forces transmitted from the inboard side are P = D δ̈ + e, D the condensed mass (or, in a Newton iteration,
the condensed stiffness) of all that lies inboard: symmetric, never singular, whatever stands at the start. A link
passes it on. With a the unknowns, b the loads and the constant matrices of each node

    G_i = (D_i + M_II)⁻¹ on the free components,   L_i = M_OI G_i,   D_{i+1} = M_OO − L_i M_IO,

the recursion is b_{i+1} += −L_i b_i forwards and a_i = G_i b_i − L_i^T a_{i+1} backwards. A pin, a weld and a break
have the same form with other G and L: a pin takes P₃…P₆ = 0 to find the inboard gradients (L_rr = −1,
L_rg = D_rg D_gg⁻¹, G_gg = D_gg⁻¹), a weld only turns (L = −W, G = 0), a break ends (L = 0, G = D⁻¹). A weld of quintic
cables, which leaves their l r_xx free, is both: it takes P₅ = P₆ = 0 to find these, and turns r_x.

Two forms are kept: `SplitFactors`, where x and y share scalar blocks and r_y is apart (any constant mass without a weld
at an angle; what few unknowns are kept adds is apart, `kept_motions`), and `BlockFactors`, full 4 × 4 or 6 × 6 blocks.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables, block_tangents, components
from anctmm.discretise.chain import Chain
from anctmm.discretise.junctions.structure import common
from anctmm.discretise.plan import BREAK, PIN, TANGENT, WELD, Kept
from anctmm.elements.tangent_blocks import TANGENT_BLOCK, TANGENT_BUFFER, lower
from anctmm.forces.loads import Loads
from anctmm.forces.stiffness import fill_local
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined, kernel, separate
from anctmm.jit.copies import writes
from anctmm.jit.mixed_precision import WIDTH, in_double
from anctmm.recursion.branches import Branches, branches, pass_branch
from anctmm.recursion.kept_motions import KeptMotions, kept_motions
from anctmm.recursion.lines import Lines, Turned, lines, turn_back_node, turn_node, turned
from anctmm.recursion.loops import (
    Loops,
    add_start,
    clear,
    eliminate_coupled,
    end_stretch,
    enter_stretch,
    leave_stretch,
    loops,
    pass_start,
    release_coupled,
    turn_coupled,
)
from anctmm.recursion.rows import fill
from anctmm.recursion.scratch import matrices, new_scratch, vectors
from anctmm.recursion.sparse import factorize_kept, solve_kept

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@writes("branches", "lines", "kept")
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
        None where there are none: then nothing of them is compiled.
    """

    L: Array
    G: Array
    D: Array
    branches: Branches
    lines: Lines | None
    kept: KeptMotions | None


@writes("L", "G", "wide", "work", "buffer", "branches", "loops")
@by_address
class BlockFactors(NamedTuple):
    """Factored full blocks, refilled by `factorize`.

    Parameters
    ----------
    size : tuple of `rows` zeros
        Its type tells the compiler the size d of the blocks.
    L : ndarray of float64 or float32, shape (nodes, d²)
        Row by row.
    G : ndarray like L, shape (nodes, at least d (d + 1)/2)
        The lower triangle. Apart from L, which alone the forward sweep reads: long chains are bound by memory.
    wide : ndarray, shape (2, d²)
        Scratch: a row of L and of G in double precision, if they are not kept in it.
    work : ndarray, shape (4 d² + 4 d,)
        Scratch: matrices and vectors of one node; see `anctmm.recursion.scratch`.
    buffer : ndarray, shape (TANGENT_BUFFER,)
    branches : Branches
    loops : Loops or None
        None where there are none: then nothing of them is compiled.
    """

    size: tuple[int, ...]
    L: NDArray[np.floating]
    G: NDArray[np.floating]
    wide: Array
    work: Array
    buffer: Array
    branches: Branches
    loops: Loops | None


@writes()
@by_address
class Links(NamedTuple):
    """What kernels need of a `Chain`; known: components prescribed, or found with the kept unknowns, (rows, nodes).

    Those of a node on a line are along the line and across.
    """

    link: Ints
    turn: Array
    known: NDArray[np.bool_]
    turned: Turned | None


def split_factors(chain: Chain) -> SplitFactors:
    """Factor the mass of a chain of scalar blocks (`Chain.split`), once for a whole run; what is kept is held there."""
    n, bodies = chain.bodies.nodes, chain.bodies
    L, G, D, places = np.zeros((5, n)), np.zeros((4, n)), np.zeros((4, n)), branches(chain)
    masks = np.ones((3, n), dtype=bool)
    masks[: bodies.rows // 2] = (chain.prescribed | chain.held)[::2]
    link = np.where([isinstance(step.to, Kept) for step in chain.plan.steps], BREAK, chain.link)
    _factorize_split(bodies.first, bodies.masses, link, masks, L, G, D, places)
    return SplitFactors(L, G, D, places, lines(chain, L, G), kept_motions(chain, L))


def no_split_factors(chain: Chain) -> SplitFactors:
    """What stands in their place where there are none."""
    L, G, D = np.zeros((3, 1, 1))
    return SplitFactors(L, G, D, branches(chain), None, None)


def block_factors(chain: Chain, single: bool = False) -> BlockFactors:
    """Room for the factors of a scene; with `single` they are found in double precision and kept in single."""
    nodes, rows, places = chain.bodies.nodes, chain.bodies.rows, branches(chain)
    triangle = rows * (rows + 1) // 2
    kind, more = (np.float32, -triangle % WIDTH) if single else (np.float64, 0)
    return BlockFactors(
        (0,) * rows,
        np.zeros((nodes, rows * rows), kind),
        np.zeros((nodes, triangle + more), kind),
        np.zeros((2, rows * rows)),
        new_scratch(rows),
        np.zeros(TANGENT_BUFFER),
        places,
        loops(chain, places),
    )


def links(chain: Chain) -> Links:
    """Arrays of a chain for kernels."""
    return Links(chain.link, chain.turn, common(chain, _known), turned(chain))


def _known(chain: Chain) -> NDArray[np.bool_]:
    """Components prescribed, or found with the kept unknowns."""
    known = chain.prescribed.copy()
    for b, step in enumerate(chain.plan.steps):
        if step.start is not None:
            held = 2 if step.start.group is None else chain.bodies.meshes[b].held
            known[:held, chain.bodies.first[b]] = True
    for guided in chain.guided:
        known[1, chain.node(guided.carrier)] = True
    return known


def mass_factors(chain: Chain, q: Array | None = None) -> BlockFactors:
    """Factor the mass of any chain in full blocks, with constraints at coordinates q, or those of the reference."""
    factors = block_factors(chain)
    factorize(*mass_arguments(chain, chain.bodies.reference() if q is None else q, factors))
    return factors


def mass_arguments(chain: Chain, q: Array, factors: BlockFactors) -> tuple[Any, ...]:
    """Arguments of `factorize` for the mass."""
    return q, chain.bodies.tables(), links(chain), 1.0, None, None, None, factors


def solve(factors: BlockFactors, load: Array) -> Array:
    """Unknowns, (rows, nodes), under loads, (rows, nodes); 0 for known components."""
    a = np.empty_like(load)
    sweep(factors, load.copy(), a)
    return a


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


@separate
def factorize(
    q: Array,
    tables: Tables,
    links: Links,
    mass: float,
    stiffness: float | None,
    loads: Loads | None,
    load_values: Array | None,
    factors: BlockFactors,
) -> int:
    """Factor mass · M + stiffness · K_T(q), the stiffness of torques included.

    For the mass alone stiffness and loads are None: tangents are then not compiled either.

    Parameters
    ----------
    q : ndarray, shape (rows, nodes)
    tables : Tables
    links : Links
    mass : float
    stiffness : float or None
    loads : Loads or None
    load_values : ndarray, shape (loads, 2), or None
        Of the varying loads at this moment.
    factors : BlockFactors
        Written.

    Returns
    -------
    int
        Number of negative pivots: 0 where the matrix is positive definite.
    """
    return _factorize(  # type: ignore[no-any-return]
        q, tables, links, mass, stiffness, loads, load_values, factors, factors.loops, links.turned
    )


@embedded
def _factorize(q, tables, links, mass, stiffness, loads, load_values, factors, loops, turned):  # type: ignore[no-untyped-def]
    """The same; only of arguments that are None the compiler leaves out what needs them."""
    size, L, G, _, work, buffer, places, _ = factors
    first, formulations, kinds, constants, masses, _ = tables
    link, turn, known, _ = links
    d = len(size)
    D, _, _, _ = matrices(size)
    negative, place, port, site, line = 0, 0, -1, 0, 0
    work[:] = 0.0
    if stiffness is not None:
        fill_local(q, stiffness, loads, load_values)
    if loops is not None:
        loops.matrix.values[:] = 0.0
    for b in range(len(link)):
        last = first[b + 1] - 1
        for i in range(first[b], last + 1):
            if i == places.at[place]:
                port = _pass_place(size, places, loops, place, work)
                place += 1
            here = site
            if stiffness is not None:
                site = _add_local_here(size, loads.local, site, i, work)
            if i < last:
                j = (i - first[b]) % TANGENT_BLOCK
                if stiffness is not None:  # noqa: SIM102 - None is known to the compiler, numbers are not
                    if j == 0 and stiffness != 0.0:
                        block_tangents(
                            formulations, q, i, min(TANGENT_BLOCK, last - i), kinds[b], constants[b], buffer
                        )
                _add_element(
                    size, components(formulations, kinds[b]), mass, masses[b], stiffness, buffer, j, work
                )
                if stiffness is not None:
                    for n in range(here, site):
                        add_block_beyond(size, loads.local.blocks[n], work)
                if turned is not None and turned.node[line] == i:
                    turn_node(size, turned.along[line, 0], turned.along[line, 1], work)
                if loops is None:
                    negative += _eliminate(size, known, i, work)
                else:
                    negative += eliminate_coupled(size, loops, port, known, i, work)
                    port = -1
                if turned is not None and turned.node[line] == i:
                    turn_back_node(size, turned.along[line, 0], turned.along[line, 1], work)
                    line += 1
                _store(size, i, work, L, G)
                continue
            if i == first[b]:  # a body of one node
                for k in range(d):
                    work[D + d * k + k] += mass * masses[b][k // 2, k // 2]
            if link[b] == WELD:
                _turn(size, turn[b, 0], turn[b, 1], i, work, L, G)
                if loops is not None:
                    turn_coupled(size, loops, i, work)
            else:
                negative += _end_body(size, loops, turned, line, link[b], turn[b], known, i, work, L, G)
                if turned is not None and turned.node[line] == i:
                    line += 1
    if loops is not None:
        _pass_place(size, places, loops, place, work)
        fill(loops.rows, loops.matrix, q, stiffness)
        negative += factorize_kept(loops.matrix)
    return negative


@inlined
def _add_local_here(size, local, site, i, work):  # type: ignore[no-untyped-def]
    """Add what matrices within elements have of node i, from the next of them on; the one after them."""
    while site < len(local.nodes) and local.nodes[site] == i:
        add_block_here(size, local.blocks[site], work)
        site += 1
    return site


@embedded
def _end_body(size, loops, turned, line, link, turn, known, i, work, L, G):  # type: ignore[no-untyped-def]
    """Eliminate the last node of a body, behind a joint that passes some of its components on, or none.

    Returns the negative pivots.
    """
    d = len(size)
    D, A, _, _ = matrices(size)
    passed = 2 if link == PIN else 4 if link == TANGENT else 0
    negative = 0
    for k in range(d * d):
        work[A + k] = work[D + k]
    if turned is not None and turned.node[line] == i:
        turn_node(size, turned.along[line, 0], turned.along[line, 1], work)
    if loops is not None and passed > 0:
        negative += release_coupled(size, loops, passed, turn, known, i, work)
    else:
        negative += _invert(size, known, passed, i, work)
        _release(size, passed, work)
    if passed == 4:
        turn_passed(size, turn[0], turn[1], work)
    if turned is not None and turned.node[line] == i:
        turn_back_node(size, turned.along[line, 0], turned.along[line, 1], work)
    _store(size, i, work, L, G)
    _forget(size, passed, work)
    return negative


@inlined
def _pass_place(size, places, loops, place, work):  # type: ignore[no-untyped-def]
    """Where condensed matrices part and meet. Returns the port at which a stretch begins, or −1."""
    D, _, _, _ = matrices(size)
    if loops is not None and loops.end[place] >= 0:
        end_stretch(size, loops, place, work)
    pass_branch(place, places.to, places.take, places.matrices, work, D)
    return loops.begin[place] if loops is not None else -1


@kernel
def sweep(factors: BlockFactors, b: Array, a: Array) -> None:
    """Forward and backward sweep.

    Parameters
    ----------
    factors : BlockFactors
    b : ndarray, shape (rows, nodes)
        Loads; the inboard ones are added to them on the way.
    a : ndarray, shape (rows, nodes)
        Written: the unknowns, 0 for known components.
    """
    _sweep(factors, factors.loops, b, a)


@embedded
def _sweep(factors, loops, b, a):  # type: ignore[no-untyped-def]
    size, L, G, wide, work, _, places, _ = factors
    d, at = len(size), places.at
    load, _, found, _ = vectors(size)
    start_sweep(size, loops, work)
    begin = 0
    for place in range(len(at)):
        for i in range(begin, at[place]):
            for k in range(d):
                work[load + k] = b[k, i]
            pass_outboard(size, L, wide, loops, i, work)
            for k in range(d):
                b[k, i] = work[load + k]
        part_outboard(size, places, loops, place, work)
        begin = at[place]
    turn_back(size, loops, work)
    for place in range(len(at) - 1, -1, -1):
        meet_inboard(size, places, loops, place, a.T, work)
        begin = at[place - 1] if place > 0 else 0
        for i in range(at[place] - 1, begin - 1, -1):
            for k in range(d):
                work[load + k] = b[k, i]
            find_unknowns(size, L, G, wide, loops, i, work)
            for k in range(d):
                a[k, i] = work[found + k]


@inlined
def start_sweep(size, loops, work):  # type: ignore[no-untyped-def]
    """Nothing has come yet to the first node of a forward sweep, nor to what is kept."""
    _, come, _, _ = vectors(size)
    for k in range(len(size)):
        work[come + k] = 0.0
    if loops is not None:
        clear(loops)


@inlined
def part_outboard(size, places, loops, place, work):  # type: ignore[no-untyped-def]
    """Forward at a place: what comes leaves the row, and what waits here comes."""
    _, come, _, _ = vectors(size)
    if loops is not None:
        leave_stretch(loops, place, work, come)
    pass_branch(place, places.to, places.take, places.vectors, work, come)


@inlined
def turn_back(size, loops, work):  # type: ignore[no-untyped-def]
    """Between the sweeps: the kept unknowns are found, and beyond the last node there is none."""
    _, _, found, _ = vectors(size)
    for k in range(len(size)):
        work[found + k] = 0.0
    if loops is not None:
        solve_kept(loops.matrix, loops.x)


@inlined
def meet_inboard(size, places, loops, place, known, work):  # type: ignore[no-untyped-def]
    """Backward at a place: the unknowns of the node that the one before passed on to, among those known, (nodes, d)."""
    _, _, found, _ = vectors(size)
    if places.node[place] >= 0:
        for k in range(len(size)):
            work[found + k] = known[places.node[place], k]
    if loops is not None:
        enter_stretch(loops, place, work, found)


@inlined
def pass_outboard(size, L, wide, loops, i, work):  # type: ignore[no-untyped-def]
    """Forward at node i: its loads and those that come sum up; −L b goes on."""
    d = len(size)
    load, come, _, _ = vectors(size)
    M, r = in_double(L, i, wide, 0)
    for k in range(d):
        work[load + k] += work[come + k]
    for m in range(d):
        s = t = 0.0
        for k in range(0, d, 2):
            s -= M[r, d * m + k] * work[load + k]
            t -= M[r, d * m + k + 1] * work[load + k + 1]
        work[come + m] = s + t
    if loops is not None:
        pass_start(loops, i, work, load)


@inlined
def find_unknowns(size, L, G, wide, loops, i, work):  # type: ignore[no-untyped-def]
    """Backward at node i: unknowns G b − L^T a from the loads and the unknowns of the node outboard."""
    d = len(size)
    load, _, x, out = vectors(size)
    M, r = in_double(L, i, wide, 0)
    S, n = in_double(G, i, wide, 1)
    for k in range(d):
        work[out + k] = work[x + k]
    for k in range(d):
        s = t = 0.0
        for m in range(d):
            low, high = min(k, m), max(k, m)
            s += S[n, high * (high + 1) // 2 + low] * work[load + m]
            t += M[r, d * m + k] * work[out + m]
        work[x + k] = s - t
    if loops is not None:
        add_start(loops, i, work, x)


@inlined
def follow_unknowns(size, L, wide, loops, i, work):  # type: ignore[no-untyped-def]
    """Backward at node i without loads: unknowns −L^T a from those of the node outboard."""
    d = len(size)
    _, _, x, out = vectors(size)
    M, r = in_double(L, i, wide, 0)
    for k in range(d):
        work[out + k] = work[x + k]
    for k in range(d):
        t = 0.0
        for m in range(d):
            t += M[r, d * m + k] * work[out + m]
        work[x + k] = -t
    if loops is not None:
        add_start(loops, i, work, x)


@embedded
def _add_element(size, own, mass, m, stiffness, buffer, j, work):  # type: ignore[no-untyped-def]
    """Add element j of the buffer: the node's own matrix ← D + K_II, the coupling ← K_OI, D ← K_OO.

    An element with fewer components, `own`, than the nodes leaves the others without stiffness; None has none.
    """
    d = len(size)
    D, A, K, _ = matrices(size)
    if stiffness is None:
        for k in range(d):
            for n in range(d):
                work[K + d * k + n] = 0.0
                if n <= k:
                    work[A + d * k + n], work[D + d * k + n] = work[D + d * k + n], 0.0
    else:
        for k in range(d):
            for n in range(d):
                given = k < own and n < own and stiffness != 0.0
                work[K + d * k + n] = stiffness * buffer[lower(own + k, n) + j] if given else 0.0
                if n <= k:
                    work[A + d * k + n] = work[D + d * k + n] + (
                        stiffness * buffer[lower(k, n) + j] if given else 0.0
                    )
                    work[D + d * k + n] = stiffness * buffer[lower(own + k, own + n) + j] if given else 0.0
    for k in range(d // 2):
        for n in range(d // 2):
            for c in range(2):
                at = d * (2 * k + c) + 2 * n + c
                work[K + at] += mass * m[3 + k, n]
                if n <= k:
                    work[A + at] += mass * m[k, n]
                    work[D + at] += mass * m[3 + k, 3 + n]


@embedded
def _invert(size, known, start, i, work):  # type: ignore[no-untyped-def]
    """The node's own matrix ← −inverse of itself on the components from `start` on that are not known, 0 elsewhere.

    The symmetric form of Gauss-Jordan's method ("sweep operator") without exchange of rows: the matrix is positive
    definite in every stable state. Returns the number of negative pivots.
    """
    d = len(size)
    _, A, _, _ = matrices(size)
    column, _, _, _ = vectors(size)
    negative = 0
    for k in range(d):
        if k < start or known[k, i]:
            for m in range(d):
                work[A + d * max(k, m) + min(k, m)] = 1.0 if m == k else 0.0
    for k in range(d):
        pivot = work[A + d * k + k]
        negative += 0 if pivot > 0.0 else 1
        inverse = 1.0 / pivot
        for m in range(d):
            work[column + m] = work[A + d * max(k, m) + min(k, m)]
        for n in range(d):
            if n != k:
                f = work[column + n] * inverse
                for m in range(n + 1):
                    if m != k:
                        work[A + d * n + m] -= f * work[column + m]
        for m in range(d):
            work[A + d * max(k, m) + min(k, m)] = work[column + m] * inverse
        work[A + d * k + k] = -inverse
    for k in range(d):
        if k < start or known[k, i]:
            work[A + d * k + k] = 0.0
    return negative


@inlined
def _store(size, i, work, L, G):  # type: ignore[no-untyped-def]
    """Keep G and L of a node."""
    d = len(size)
    _, A, _, passing = matrices(size)
    for k in range(d):
        for m in range(d):
            L[i, d * k + m] = work[passing + d * k + m]
        for m in range(k + 1):
            G[i, k * (k + 1) // 2 + m] = -work[A + d * k + m]


@embedded
def _eliminate(size, known, i, work):  # type: ignore[no-untyped-def]
    """Pass an element: own matrix ← −inverse of itself, L ← K_OI G, D ← K_OO − L K_IO, component by component.

    Not by products with the inverse: of a slender element with an r_y that has a condition of (l/h)², and what bends D
    would be a difference of numbers that are wrong by as much. Returns the number of negative pivots.
    """
    d = len(size)
    D, A, K, L = matrices(size)
    column, beyond, _, _ = vectors(size)
    negative = 0
    for k in range(d):
        if known[k, i]:
            for m in range(d):
                work[A + d * max(k, m) + min(k, m)] = work[K + d * m + k] = 0.0
    for k in range(d):
        if known[k, i]:
            continue
        pivot = work[A + d * k + k]
        negative += 0 if pivot > 0.0 else 1
        inverse = 1.0 / pivot
        for m in range(d):
            work[column + m] = work[A + d * max(k, m) + min(k, m)]
            work[beyond + m] = work[K + d * m + k]
        for n in range(d):
            f, g = work[beyond + n] * inverse, work[column + n] * inverse
            for m in range(n + 1):
                work[D + d * n + m] -= f * work[beyond + m]
                work[A + d * n + m] -= g * work[column + m]
            for m in range(d):
                work[K + d * n + m] -= f * work[column + m]
        for m in range(d):  # column k, which the loops above need not spare
            work[A + d * max(k, m) + min(k, m)] = work[column + m] * inverse
            work[K + d * m + k] = work[beyond + m] * inverse
        work[A + d * k + k] = -inverse
    for k in range(d * d):
        work[L + k] = work[K + k]
    return negative


@embedded
def _release(size, passed, work):  # type: ignore[no-untyped-def]
    """Pass a joint: the first components and their forces pass on, the others follow from P = 0, of G. Or end a chain.

    A pin passes r, two components; the joint that passes r_x too, but not l r_xx, four.
    """
    d = len(size)
    D, A, _, L = matrices(size)
    for k in range(d * d):
        work[L + k] = 0.0
    for m in range(passed):
        work[L + d * m + m] = -1.0
        for k in range(passed, d):
            s = 0.0
            for n in range(passed, d):
                s -= work[D + d * n + m] * work[A + d * max(n, k) + min(n, k)]
            work[L + d * m + k] = s
    for m in range(passed):
        for k in range(m + 1):
            for n in range(passed, d):
                work[D + d * m + k] -= work[L + d * m + n] * work[D + d * n + k]


@embedded
def turn_passed(size, c, s, work):  # type: ignore[no-untyped-def]
    """Turn r_x behind a joint that passes it: L ← W L, D ← W D W^T."""
    d = len(size)
    D, _, _, L = matrices(size)
    for k in range(d):
        _turn_rows(c, s, L + 2 * d + k, L + 3 * d + k, work)
    two, three = D + 2 * d, D + 3 * d
    for k in range(2):
        _turn_rows(c, s, two + k, three + k, work)
    xx, xy, yy = work[two + 2], work[three + 2], work[three + 3]
    work[two + 2] = c * c * xx - 2.0 * c * s * xy + s * s * yy
    work[three + 2] = c * s * (xx - yy) + (c * c - s * s) * xy
    work[three + 3] = s * s * xx + 2.0 * c * s * xy + c * c * yy


@inlined
def _turn_rows(c, s, one, two, work):  # type: ignore[no-untyped-def]
    """Turn two entries of a column."""
    x, y = work[one], work[two]
    work[one], work[two] = c * x - s * y, s * x + c * y


@inlined
def _forget(size, passed, work):  # type: ignore[no-untyped-def]
    """Keep of D what goes on beyond a body: that of the components that pass a joint."""
    d = len(size)
    D, _, _, _ = matrices(size)
    for m in range(passed, d):
        for k in range(m + 1):
            work[D + d * m + k] = 0.0


@embedded
def _turn(size, c, s, i, work, L, G):  # type: ignore[no-untyped-def]
    """Pass a weld: gradients turn by W, L ← −W, G ← 0, D ← W D W^T."""
    d = len(size)
    D, A, K, W = matrices(size)
    for k in range(d * d):
        work[A + k] = work[W + k] = 0.0
    for k in range(0, d, 2):
        x, y = (1.0, 0.0) if k == 0 else (c, s)
        work[W + d * k + k] = work[W + d * (k + 1) + k + 1] = -x
        work[W + d * k + k + 1], work[W + d * (k + 1) + k] = y, -y
    for m in range(d):
        for k in range(d):
            t = 0.0
            for n in range(d):
                t -= work[W + d * m + n] * work[D + d * max(n, k) + min(n, k)]
            work[K + d * m + k] = t
    for m in range(d):
        for k in range(m + 1):
            t = 0.0
            for n in range(d):
                t -= work[K + d * m + n] * work[W + d * k + n]
            work[D + d * m + k] = t
    _store(size, i, work, L, G)


@inlined
def add_block_here(size, block, work):  # type: ignore[no-untyped-def]
    """Add a matrix of a node and the next one to D: the node's own part."""
    d = len(size)
    D, _, _, _ = matrices(size)
    for m in range(d):
        for k in range(m + 1):
            work[D + d * m + k] += block[m, k]


@inlined
def add_block_beyond(size, block, work):  # type: ignore[no-untyped-def]
    """Add the other parts: to the coupling with the next node, and to its D."""
    d = len(size)
    D, _, K, _ = matrices(size)
    for m in range(d):
        for k in range(d):
            work[K + d * m + k] += block[d + m, k]
        for k in range(m + 1):
            work[D + d * m + k] += block[d + m, d + k]
