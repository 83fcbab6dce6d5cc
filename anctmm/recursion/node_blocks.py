"""The matrices of one node in full blocks: what a factorization in `riccati` does at each node.

Those of an element, of what connects two nodes, or of something within an element are added to them; the node's
unknowns are eliminated, of an element, behind a joint, or at the end of a body; a weld turns what it passes on; and
G and L of the node are kept. They stand in one array, `work`, where `scratch` says.
"""

from anctmm.elements.tangent_blocks import lower
from anctmm.jit.compiling import embedded, inlined
from anctmm.recursion.scratch import matrices, vectors


@embedded
def add_element(size, own, mass, m, stiffness, buffer, j, work):  # type: ignore[no-untyped-def]
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
def invert(size, known, start, i, work):  # type: ignore[no-untyped-def]
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
def store(size, i, work, L, G):  # type: ignore[no-untyped-def]
    """Keep G and L of a node."""
    d = len(size)
    _, A, _, passing = matrices(size)
    for k in range(d):
        for m in range(d):
            L[i, d * k + m] = work[passing + d * k + m]
        for m in range(k + 1):
            G[i, k * (k + 1) // 2 + m] = -work[A + d * k + m]


@embedded
def eliminate(size, known, i, work):  # type: ignore[no-untyped-def]
    """Pass an element: own matrix ← −inverse of itself, L ← K_OI G, D ← K_OO − L K_IO, component by component.

    Not by products with the inverse: of a slender element with an r_y that has a condition of (l/h)², and what bends D
    would be a difference of numbers that are wrong by as much. Returns the number of negative pivots.
    """
    d = len(size)
    _, A, K, L = matrices(size)
    column, beyond, _, _ = vectors(size)
    negative = 0
    for k in range(d):
        if known[k, i]:
            leave_out(size, k, work)
    for k in range(d):
        if known[k, i]:
            continue
        pivot = work[A + d * k + k]
        negative += 0 if pivot > 0.0 else 1
        inverse = 1.0 / pivot
        take_column(size, k, work)
        for n in range(d):
            f, g = work[beyond + n] * inverse, work[column + n] * inverse
            update_row(size, n, f, g, work)
        put_column(size, k, inverse, work)
    for k in range(d * d):
        work[L + k] = work[K + k]
    return negative


@inlined
def leave_out(size, k, work):  # type: ignore[no-untyped-def]
    """Take component k, which is known to rest, out of a node's own matrix and of its coupling with the next node."""
    d = len(size)
    _, A, K, _ = matrices(size)
    for m in range(d):
        work[A + d * max(k, m) + min(k, m)] = work[K + d * m + k] = 0.0


@inlined
def take_column(size, k, work):  # type: ignore[no-untyped-def]
    """Put component k's columns of a node's own matrix and of its coupling into the first two vectors."""
    d = len(size)
    _, A, K, _ = matrices(size)
    column, beyond, _, _ = vectors(size)
    for m in range(d):
        work[column + m] = work[A + d * max(k, m) + min(k, m)]
        work[beyond + m] = work[K + d * m + k]


@inlined
def update_row(size, n, f, g, work):  # type: ignore[no-untyped-def]
    """Take the eliminated component out of row n of D, of the node's own matrix, and of the coupling."""
    d = len(size)
    D, A, K, _ = matrices(size)
    column, beyond, _, _ = vectors(size)
    for m in range(n + 1):
        work[D + d * n + m] -= f * work[beyond + m]
        work[A + d * n + m] -= g * work[column + m]
    for m in range(d):
        work[K + d * n + m] -= f * work[column + m]


@inlined
def put_column(size, k, inverse, work):  # type: ignore[no-untyped-def]
    """Write component k's columns, which `update_row` need not spare."""
    d = len(size)
    _, A, K, _ = matrices(size)
    column, beyond, _, _ = vectors(size)
    for m in range(d):
        work[A + d * max(k, m) + min(k, m)] = work[column + m] * inverse
        work[K + d * m + k] = work[beyond + m] * inverse
    work[A + d * k + k] = -inverse


@embedded
def release(size, passed, work):  # type: ignore[no-untyped-def]
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
def forget(size, passed, work):  # type: ignore[no-untyped-def]
    """Keep of D what goes on beyond a body: that of the components that pass a joint."""
    d = len(size)
    D, _, _, _ = matrices(size)
    for m in range(passed, d):
        for k in range(m + 1):
            work[D + d * m + k] = 0.0


@embedded
def pass_weld(size, c, s, i, work, L, G):  # type: ignore[no-untyped-def]
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
    store(size, i, work, L, G)


@inlined
def add_local_here(size, local, site, i, work):  # type: ignore[no-untyped-def]
    """Add what matrices within elements have of node i, from the next of them on; the one after them."""
    while site < len(local.nodes) and local.nodes[site] == i:
        add_block_here(size, local.blocks[site], work)
        site += 1
    return site


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
