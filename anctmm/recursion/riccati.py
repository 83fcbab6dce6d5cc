"""The Riccati recursion, compiled (Rong 2014, eqs. 28-35, in the partition P = S δ̈ + e).

At node i the forces transmitted from the inboard side are P = D δ̈ + e, D the condensed mass (or, in a Newton iteration,
the condensed stiffness) of all that lies inboard: symmetric, never singular, whatever stands at the start. A link
passes it on. With a the unknowns, b the loads and the constant matrices of each node

    G_i = (D_i + M_II)⁻¹ on the free components,   L_i = M_OI G_i,   D_{i+1} = M_OO − L_i M_IO,

the recursion is b_{i+1} += −L_i b_i forwards and a_i = G_i b_i − L_i^T a_{i+1} backwards. A pin, a weld and a break
have the same form with other G and L: a pin takes P₃…P₆ = 0 to find the inboard gradients (L_rr = −1,
L_rg = D_rg D_gg⁻¹, G_gg = D_gg⁻¹), a weld only turns (L = −W, G = 0), a break ends (L = 0, G = D⁻¹). A weld of quintic
cables, which leaves their l r_xx free, is both: it takes P₅ = P₆ = 0 to find these, and turns r_x.

Two forms are kept: `BlockFactors` here, full 4 × 4 or 6 × 6 blocks, whose matrices of one node are those of
`node_blocks`, and `SplitFactors` in `split`, where x and y share scalar blocks and r_y is apart.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables, block_tangents, components
from anctmm.discretise.chain import Chain
from anctmm.discretise.junctions.structure import common
from anctmm.discretise.plan import PIN, TANGENT, WELD
from anctmm.elements.tangent_blocks import TANGENT_BLOCK, TANGENT_BUFFER
from anctmm.forces.loads import Loads
from anctmm.forces.stiffness import fill_local
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined, kernel, separate
from anctmm.jit.copies import writes
from anctmm.jit.mixed_precision import WIDTH, in_double
from anctmm.recursion.branches import Branches, branches, pass_branch
from anctmm.recursion.kept.coupled import add_coupled
from anctmm.recursion.kept.loops import (
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
from anctmm.recursion.kept.rows import fill
from anctmm.recursion.kept.sparse import factorize_kept, solve_kept
from anctmm.recursion.lines import Turned, turn_back_node, turn_node, turned
from anctmm.recursion.node_blocks import (
    add_block_beyond,
    add_element,
    add_local_here,
    eliminate,
    forget,
    invert,
    pass_weld,
    release,
    store,
    turn_passed,
)
from anctmm.recursion.scratch import matrices, new_scratch, vectors

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


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
    """Body of `factorize`.

    `loops` and `turned` are separate arguments so that numba omits the code for them where they are None.
    """
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
                site = add_local_here(size, loads.local, site, i, work)
            if i < last:
                j = (i - first[b]) % TANGENT_BLOCK
                if stiffness is not None:  # noqa: SIM102 - None is known to the compiler, numbers are not
                    if j == 0 and stiffness != 0.0:
                        block_tangents(
                            formulations, q, i, min(TANGENT_BLOCK, last - i), kinds[b], constants[b], buffer
                        )
                add_element(
                    size, components(formulations, kinds[b]), mass, masses[b], stiffness, buffer, j, work
                )
                if stiffness is not None:
                    for n in range(here, site):
                        add_block_beyond(size, loads.local.blocks[n], work)
                if turned is not None and turned.node[line] == i:
                    turn_node(size, turned.along[line, 0], turned.along[line, 1], work)
                if loops is None:
                    negative += eliminate(size, known, i, work)
                else:
                    negative += eliminate_coupled(size, loops, port, known, i, work)
                    port = -1
                if turned is not None and turned.node[line] == i:
                    turn_back_node(size, turned.along[line, 0], turned.along[line, 1], work)
                    line += 1
                store(size, i, work, L, G)
                continue
            if i == first[b]:  # a body of one node
                for k in range(d):
                    work[D + d * k + k] += mass * masses[b][k // 2, k // 2]
            if link[b] == WELD:
                pass_weld(size, turn[b, 0], turn[b, 1], i, work, L, G)
                if loops is not None:
                    turn_coupled(size, loops, i, work)
            else:
                negative += _end_body(size, loops, turned, line, link[b], turn[b], known, i, work, L, G)
                if turned is not None and turned.node[line] == i:
                    line += 1
    if loops is not None:
        _pass_place(size, places, loops, place, work)
        if stiffness is not None:
            add_coupled(loops.coupled, loops.matrix, q, stiffness, loads.connectors, load_values)
        fill(loops.rows, loops.matrix, q, stiffness)
        negative += factorize_kept(loops.matrix)
    return negative


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
        negative += invert(size, known, passed, i, work)
        release(size, passed, work)
    if passed == 4:
        turn_passed(size, turn[0], turn[1], work)
    if turned is not None and turned.node[line] == i:
        turn_back_node(size, turned.along[line, 0], turned.along[line, 1], work)
    store(size, i, work, L, G)
    forget(size, passed, work)
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
