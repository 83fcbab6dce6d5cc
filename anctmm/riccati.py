"""The Riccati recursion along a chain, compiled (Rong 2014, eqs. 28-35, in the partition P = S δ̈ + e).

At node i the forces transmitted from the inboard side are P = D δ̈ + e, D the condensed mass (or, in a Newton iteration,
the condensed stiffness) of all that lies inboard: symmetric, never singular, whatever stands at the start. A link
passes it on. With a the unknowns, b the loads and the constant matrices of each node

    G_i = (D_i + M_II)⁻¹ on the free components,   L_i = M_OI G_i,   D_{i+1} = M_OO − L_i M_IO,

the recursion is b_{i+1} += −L_i b_i forwards and a_i = G_i b_i − L_i^T a_{i+1} backwards. A pin, a weld and a break
have the same form with other G and L: a pin takes P₃…P₆ = 0 to find the inboard gradients (L_rr = −1,
L_rg = D_rg D_gg⁻¹, G_gg = D_gg⁻¹), a weld only turns (L = −W, G = 0), a break ends (L = 0, G = D⁻¹).

Two forms are kept: `SplitFactors`, where x and y share scalar blocks and r_y is apart (any constant mass without a weld
at an angle), and `BlockFactors`, full 4 × 4 or 6 × 6 blocks.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.actuation import Loads
from anctmm.assembly import Tables, block_tangents, unpack_tangent
from anctmm.chain import PIN, WELD, Chain
from anctmm.compiling import inlined, kernel
from anctmm.elements.shear_kernel import TANGENT_BLOCK, TANGENT_BUFFER

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


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
    """

    L: Array
    G: Array
    D: Array


class BlockFactors(NamedTuple):
    """Factored full blocks, refilled by `factorize`.

    Parameters
    ----------
    unit : tuple of `rows` zeros
        Its type tells the compiler the size of the blocks.
    L, G : ndarray, shape (nodes, rows, rows)
    D : ndarray, shape (rows, rows)
        Scratch, as are the next two.
    K : ndarray, shape (2 rows, 2 rows)
    buffer : ndarray, shape (TANGENT_BUFFER,)
    """

    unit: tuple[int, ...]
    L: Array
    G: Array
    D: Array
    K: Array
    buffer: Array


class Links(NamedTuple):
    """What kernels need of a `Chain`, under the names it has there."""

    link: Ints
    turn: Array
    prescribed: NDArray[np.bool_]


def split_factors(chain: Chain) -> SplitFactors:
    """Factor the mass of a chain without angled welds, once for a whole run."""
    n, bodies = chain.bodies.nodes, chain.bodies
    result = SplitFactors(np.zeros((5, n)), np.zeros((4, n)), np.zeros((4, n)))
    masks = np.ones((3, n), dtype=bool)
    masks[: bodies.rows // 2] = chain.prescribed[::2]
    _factorize_split(bodies.first, bodies.masses, chain.link, masks, *result)
    return result


def block_factors(nodes: int, rows: int) -> BlockFactors:
    """Room for the factors of a chain."""
    return BlockFactors(
        (0,) * rows,
        np.zeros((nodes, rows, rows)),
        np.zeros((nodes, rows, rows)),
        np.zeros((rows, rows)),
        np.zeros((2 * rows, 2 * rows)),
        np.zeros(TANGENT_BUFFER),
    )


def links(chain: Chain) -> Links:
    """Arrays of a chain for kernels."""
    return Links(chain.link, chain.turn, chain.prescribed)


def mass_factors(chain: Chain) -> BlockFactors:
    """Factor the mass of any chain in full blocks."""
    bodies = chain.bodies
    factors = block_factors(bodies.nodes, bodies.rows)
    none = Loads(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((2, 0, 2)))
    factorize(bodies.reference(), bodies.tables(), links(chain), 1.0, 0.0, none, np.empty((0, 2)), factors)
    return factors


def solve(factors: BlockFactors, load: Array) -> Array:
    """Unknowns, (rows, nodes), under loads, (rows, nodes); 0 for known components."""
    a = np.empty_like(load)
    sweep(factors.unit, factors.L, factors.G, load.copy(), a)
    return a


@kernel
def _factorize_split(
    first: Ints, masses: Array, link: Ints, masks: NDArray[np.bool_], L: Array, G: Array, D: Array
) -> None:
    rr = rg = gg = dd = 0.0
    for b in range(len(link)):
        m = masses[b]
        last = first[b + 1] - 1
        for i in range(first[b], last + 1):
            D[0, i], D[1, i], D[2, i], D[3, i] = rr, rg, gg, dd
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


@kernel
def factorize(
    q: Array,
    tables: Tables,
    links: Links,
    mass: float,
    stiffness: float,
    loads: Loads,
    load_values: Array,
    factors: BlockFactors,
) -> int:
    """Factor mass · M + stiffness · K_T(q), the stiffness of torques included.

    Parameters
    ----------
    q : ndarray, shape (rows, nodes)
    tables : Tables
    links : Links
    mass, stiffness : float
    loads : Loads
    load_values : ndarray, shape (loads, 2)
        Of the varying loads at this moment.
    factors : BlockFactors
        Written.

    Returns
    -------
    int
        Number of negative pivots: 0 where the matrix is positive definite.
    """
    unit, L, G, D, K, buffer = factors
    first, _, kinds, constants, masses, _ = tables
    link, turn, prescribed = links
    d = len(unit)
    negative = 0
    D[:] = 0.0
    for b in range(len(link)):
        last = first[b + 1] - 1
        for i in range(first[b], last + 1):
            for n in range(len(loads.nodes) if i == first[b] or i == last else 0):  # loads act on ends only
                if loads.nodes[n] == i and loads.rows[n] > 0:
                    _add_torque_stiffness(D, q, i, loads.rows[n], stiffness * load_values[n, 0])
            if i < last:
                j = (i - first[b]) % TANGENT_BLOCK
                if stiffness != 0.0:
                    if j == 0:
                        count = min(TANGENT_BLOCK, last - i)
                        block_tangents(q, i, count, kinds[b], constants[b], buffer)
                    unpack_tangent(buffer, j, kinds[b], K)
                _combine(unit, mass, masses, b, stiffness, K)
                for k in range(d):
                    for m in range(d):
                        D[k, m] += K[k, m]
            elif link[b] == WELD:
                _turn(unit, turn[b, 0], turn[b, 1], L, G, i, D, K)
                continue
            pinned = i == last and link[b] == PIN
            negative += _invert(unit, D, prescribed, 2 if pinned else 0, G, i)
            if i < last:
                _eliminate(unit, K, G, L, i, D)
            elif pinned:
                _release(unit, G, L, i, D)
            else:
                for k in range(d):
                    for m in range(d):
                        L[i, k, m] = D[k, m] = 0.0
    return negative


@kernel
def sweep(unit: tuple[int, ...], L: Array, G: Array, b: Array, a: Array) -> None:
    """Forward and backward sweep.

    Parameters
    ----------
    unit : tuple of `rows` ints
    L, G : ndarray, shape (nodes, rows, rows)
    b : ndarray, shape (rows, nodes)
        Loads; the inboard ones are added to them on the way.
    a : ndarray, shape (rows, nodes)
        Written: the unknowns, 0 for known components.
    """
    d = len(unit)
    nodes = b.shape[1]
    for i in range(nodes - 1):
        for m in range(d):
            carry = 0.0
            for k in range(d):
                carry += L[i, m, k] * b[k, i]
            b[m, i + 1] -= carry
    for k in range(d):
        s = 0.0
        for m in range(d):
            s += G[nodes - 1, k, m] * b[m, nodes - 1]
        a[k, nodes - 1] = s
    for i in range(nodes - 2, -1, -1):
        for k in range(d):
            s = 0.0
            for m in range(d):
                s += G[i, k, m] * b[m, i] - L[i, m, k] * a[m, i + 1]
            a[k, i] = s


@inlined
def _combine(unit, mass, masses, b, stiffness, K):  # type: ignore[no-untyped-def]
    """K ← mass · (m ⊗ I₂) + stiffness · K, m in the six scalar rows of a shear element."""
    d = len(unit)
    for k in range(2 * d):
        for n in range(2 * d):
            K[k, n] = stiffness * K[k, n] if stiffness != 0.0 else 0.0
    for side in range(2):
        for other in range(2):
            for k in range(d // 2):
                for n in range(d // 2):
                    value = mass * masses[b, 3 * side + k, 3 * other + n]
                    K[d * side + 2 * k, d * other + 2 * n] += value
                    K[d * side + 2 * k + 1, d * other + 2 * n + 1] += value


@inlined
def _invert(unit, D, known, start, G, i):  # type: ignore[no-untyped-def]
    """G ← inverse of D on the components from `start` on that are not known, 0 elsewhere; count of negative pivots.

    Gauss-Jordan without exchange of rows: D is symmetric, and positive definite in every stable state.
    """
    d = len(unit)
    negative = 0
    for k in range(d):
        for m in range(d):
            free = k >= start and m >= start and not known[k, i] and not known[m, i]
            G[i, k, m] = D[k, m] if free else 0.0
    for k in range(start, d):
        if known[k, i]:
            continue
        if not G[i, k, k] > 0.0:
            negative += 1
        pivot = 1.0 / G[i, k, k]
        G[i, k, k] = 1.0
        for m in range(d):
            G[i, k, m] *= pivot
        for n in range(d):
            if n != k:
                f = G[i, n, k]
                G[i, n, k] = 0.0
                for m in range(d):
                    G[i, n, m] -= f * G[i, k, m]
    return negative


@inlined
def _eliminate(unit, K, G, L, i, D):  # type: ignore[no-untyped-def]
    """Pass an element: L ← K_OI G, D ← K_OO − L K_IO."""
    d = len(unit)
    for m in range(d):
        for k in range(d):
            s = 0.0
            for n in range(d):
                s += K[d + m, n] * G[i, n, k]
            L[i, m, k] = s
    for m in range(d):
        for k in range(m + 1):
            s = K[d + m, d + k]
            for n in range(d):
                s -= L[i, m, n] * K[n, d + k]
            D[m, k] = s
            D[k, m] = s


@inlined
def _release(unit, G, L, i, D):  # type: ignore[no-untyped-def]
    """Pass a pin: the inboard gradients follow from P₃…P₆ = 0, of G; r and its force pass on."""
    d = len(unit)
    for k in range(d):
        for m in range(d):
            L[i, k, m] = 0.0
    for m in range(2):
        L[i, m, m] = -1.0
        for k in range(2, d):
            s = 0.0
            for n in range(2, d):
                s += D[m, n] * G[i, n, k]
            L[i, m, k] = s
    for m in range(2):
        for k in range(2):
            s = D[m, k]
            for n in range(2, d):
                s -= L[i, m, n] * D[n, k]
            G[i, m, k] = s
    for m in range(d):
        for k in range(d):
            D[m, k] = G[i, m, k] if m < 2 and k < 2 else 0.0
    for m in range(2):
        for k in range(2):
            G[i, m, k] = 0.0


@inlined
def _turn(unit, c, s, L, G, i, D, K):  # type: ignore[no-untyped-def]
    """Pass a weld: gradients turn by W, L ← −W, G ← 0, D ← W D W^T."""
    d = len(unit)
    for k in range(d):
        for m in range(d):
            G[i, k, m] = 0.0
    for k in range(d):
        for m in range(d):
            L[i, k, m] = 0.0
    for k in range(0, d, 2):
        x, y = (1.0, 0.0) if k == 0 else (c, s)
        L[i, k, k] = L[i, k + 1, k + 1] = -x
        L[i, k, k + 1], L[i, k + 1, k] = y, -y
    for m in range(d):
        for k in range(d):
            t = 0.0
            for n in range(d):
                t -= L[i, m, n] * D[n, k]
            K[m, k] = t
    for m in range(d):
        for k in range(d):
            t = 0.0
            for n in range(d):
                t -= K[m, n] * L[i, k, n]
            D[m, k] = t


@inlined
def _add_torque_stiffness(D, q, i, row, moment):  # type: ignore[no-untyped-def]
    """Subtract the derivative of M (−g_y, g_x)/|g|² by g: a torque has the potential −M θ(g)."""
    x, y = q[row, i], q[row + 1, i]
    f = moment / (x * x + y * y) ** 2
    D[row, row] -= f * 2.0 * x * y
    D[row, row + 1] -= f * (y * y - x * x)
    D[row + 1, row] -= f * (y * y - x * x)
    D[row + 1, row + 1] += f * 2.0 * x * y
