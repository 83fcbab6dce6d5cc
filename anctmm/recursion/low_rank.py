"""Solution with a matrix that differs from that of the recursion by Σ c u vᵀ: Sherman, Morrison and Woodbury.

With U and V the columns u and v, Y = A⁻¹ U by one sweep each, and S = 1 + c Vᵀ Y,

    (A + U c Vᵀ)⁻¹ b = x − Y z = x − A⁻¹ U z,    x = A⁻¹ b,    z = S⁻¹ c Vᵀ x.

Where the columns are few, Y is kept; with more of them the last form takes less, a sweep for each solution. Couplings
of distant nodes have this form (`anctmm.forces.stiffness.Border`), unless they are many: their nodes are kept then
(`anctmm.recursion.kept.coupled`).
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.forces.stiffness import Border, fill_border
from anctmm.jit.compiling import embedded, merged
from anctmm.recursion.riccati import sweep

Array = NDArray[np.float64]


@merged
def factor_border(border, q, stiffness, loads, values, factors):  # type: ignore[no-untyped-def]
    """Bring the columns, Y and S up to date, the rest of the matrix being factored."""
    if border is not None:
        fill_border(border, q, stiffness, loads, values)
        m = len(border.c)
        for j in range(m):
            border.load[:] = 0.0
            _add_column(border, j, 1.0)
            Y = border.Y[j if len(border.Y) == m else 0]
            sweep(factors, border.load, Y)
            for i in range(m):
                border.product[i, j] = _product(border, i, Y)
        for i in range(m):
            for j in range(m):
                border.S[i, j] = border.c[i] * border.product[i, j] + (1.0 if i == j else 0.0)
        _factor(border.S, border.order)


@embedded
def _add_column(border, j, size):  # type: ignore[no-untyped-def]
    """Add u of this size to the loads."""
    for k in range(border.start[j], border.start[j + 1]):
        border.load[border.row[k], border.node[k]] += size * border.left[k, 0]
        border.load[border.row[k] + 1, border.node[k]] += size * border.left[k, 1]


@embedded
def _product(border, j, x):  # type: ignore[no-untyped-def]
    """vᵀ x."""
    total = 0.0
    for k in range(border.start[j], border.start[j + 1]):
        total += border.right[k, 0] * x[border.row[k], border.node[k]]
        total += border.right[k, 1] * x[border.row[k] + 1, border.node[k]]
    return total


@embedded
def _factor(S, order):  # type: ignore[no-untyped-def]
    """L U of S with exchanges of whole rows, in place."""
    m = len(S)
    for k in range(m):
        best = k
        for i in range(k + 1, m):
            if abs(S[i, k]) > abs(S[best, k]):
                best = i
        order[k] = best
        if best != k:
            for j in range(m):
                S[k, j], S[best, j] = S[best, j], S[k, j]
        for i in range(k + 1, m):
            factor = S[i, k] / S[k, k]
            S[i, k] = factor
            for j in range(k + 1, m):
                S[i, j] -= factor * S[k, j]


@embedded
def weights_of(border, x):  # type: ignore[no-untyped-def]
    """S⁻¹ c Vᵀ x of x, (rows, nodes), in `border.z`."""
    S, z, m = border.S, border.z, len(border.c)
    for j in range(m):
        z[j] = border.c[j] * _product(border, j, x)
    for k in range(m):
        best = border.order[k]
        if best != k:
            z[k], z[best] = z[best], z[k]
    for k in range(m):
        total = z[k]
        for j in range(k):
            total -= S[k, j] * z[j]
        z[k] = total
    for k in range(m - 1, -1, -1):
        total = z[k]
        for j in range(k + 1, m):
            total -= S[k, j] * z[j]
        z[k] = total / S[k, k]


@embedded
def _change(border, factors):  # type: ignore[no-untyped-def]
    """Y z in `border.load`. With many columns nothing may be asked of constraints, and their unknowns are lost."""
    load, Y, m = border.load, border.Y, len(border.c)
    load[:] = 0.0
    few = len(Y) == m
    if not few:
        for j in range(m):
            _add_column(border, j, border.z[j])
        sweep(factors, load, Y[0])
        load[:] = 0.0
    for j in range(len(Y)):
        size = border.z[j] if few else 1.0
        for k in range(load.shape[0]):
            for i in range(load.shape[1]):
                load[k, i] += Y[j, k, i] * size


@merged
def correct(border, x, factors):  # type: ignore[no-untyped-def]
    """Make x = A⁻¹ b, (rows, nodes), the solution with the whole matrix; of constraints nothing may be asked."""
    if border is not None:
        weights_of(border, x)
        _change(border, factors)
        for k in range(x.shape[0]):
            for i in range(x.shape[1]):
                x[k, i] -= border.load[k, i]


@embedded
def correct_step(border, found, q, w, c, scale, weight, size, factors):  # type: ignore[no-untyped-def]
    """Correct q and w, to which a solution without the border was added already, and that solution, (nodes, rows).

    Returns the largest component, as `newton` counts it.
    """
    if border is None:
        return size
    weights_of(border, found.T)
    _change(border, factors)
    largest, odd = 0.0, 0.0
    for i in range(q.shape[1]):
        for k in range(q.shape[0]):
            x = border.load[k, i]
            found[i, k] -= x
            q[k, i] -= c.to_q * x
            w[k, i] -= c.to_w * x
            x = found[i, k]
            largest = max(largest, abs(x) * (1.0 / scale if k < 2 else weight))
            odd += x - x  # 0 unless infinite or not a number
    return largest if odd == 0.0 else np.inf


def negative_of(border: Border | None) -> int:
    """Negative eigenvalues that a symmetric border adds to those of the matrix without it (Haynsworth 1968).

    In(A + U c Uᵀ) = In(A) + In(−c⁻¹ − Uᵀ Y) − In(−c⁻¹), counted with the sign that the block matrix gives. Both are
    multiplied by |c|^½ from either side: a spring at rest may have a c across of mere rounding, and its c⁻¹ would hide
    all others.
    """
    if border is None:
        return 0
    used = np.flatnonzero(border.c)
    product = border.product[np.ix_(used, used)]
    if not np.isfinite(product).all():
        return 0  # singular without the border: solutions with it are not finite either, which is found there
    signs, roots = np.sign(border.c[used]), np.sqrt(np.abs(border.c[used]))
    after = np.linalg.eigvalsh(0.5 * np.outer(roots, roots) * (product + product.T) + np.diag(signs))
    return int((after > 0.0).sum()) - int((signs > 0.0).sum())
