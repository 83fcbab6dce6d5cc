"""Compiled twin of `shear`: the same numbers for a block of elements, laid out so that the compiler vectorises.

Coordinates are stored by component, q[k, node]: k = 0, 1 position, 2, 3 r_x, 4, 5 r_y. Blocks have at most
BLOCK elements, their forces in rows, see `force_blocks`. Nothing is allocated. Notation: anctmm/elimination/method.md,
section 1.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.force_blocks import BLOCK, clear_forces, part, six_rows
from anctmm.elements.shapes import gauss, hermite
from anctmm.elements.shear import POINTS, ShearElement
from anctmm.elements.tangent_blocks import (
    add_full,
    add_symmetric,
    clear_sums,
    place,
    placement,
)
from anctmm.kernels.options import inlined

Array = NDArray[np.float64]

_XI, _W = gauss(POINTS)
#: Each Gauss point: ξ, 1 − ξ, the derivatives l S1', S2', S5' of the Hermite functions (S4' = −S1') and the weight.
TABLE = np.column_stack([_XI, 1.0 - _XI, hermite(_XI, 1.0, 1)[:, [0, 1, 3]], _W])
P0, P1, P2, P3, P4 = (tuple(float(v) for v in row[:5]) for row in TABLE)
W0, W1, W2, W3, W4 = (float(w) for w in _W)

#: Rows of sums of tangents.
ROWS = 52
#: Where they go: 18 rows by u, r_x,I and r_x,O, 24 by r_y,I or r_y,O and one of these, 10 by r_y twice.
PLACES = placement(
    [
        (0, 0, "symmetric", 0, 2),
        (1, 0, "symmetric", 3, -1),
        (1, 1, "symmetric", 6, 0),
        (2, 0, "full", 18, -1),
        (2, 1, "full", 22, 0),
        (2, 2, "symmetric", 42, 0),
        (3, 0, "symmetric", 0, -2),
        (3, 1, "symmetric", 3, 1),
        (3, 2, "transposed", 18, 1),
        (3, 3, "symmetric", 0, 2),
        (4, 0, "symmetric", 9, -1),
        (4, 1, "symmetric", 12, 0),
        (4, 2, "transposed", 26, 0),
        (4, 3, "symmetric", 9, 1),
        (4, 4, "symmetric", 15, 0),
        (5, 0, "full", 30, -1),
        (5, 1, "full", 34, 0),
        (5, 2, "full", 45, 0),
        (5, 3, "full", 30, 1),
        (5, 4, "full", 38, 0),
        (5, 5, "symmetric", 49, 0),
    ]
)


def constants(e: ShearElement) -> Array:
    """What the kernels need of an element: l, ΛA, ΛI, ΛJ, λA, λI, GA, GI."""
    L = e.lam + 2.0 * e.G
    return np.array([e.l, L * e.A, L * e.I, L * e.J, e.lam * e.A, e.lam * e.I, e.G * e.A, e.G * e.I])


@inlined
def _stress(p, w, chord, a, b, d_I, d_O, e, k2, c):  # type: ignore[no-untyped-def]
    """∂W/∂c', ∂W/∂d and ∂W/∂d' at a Gauss point p of weight w."""
    x, y, A, B, C = p
    _, LA, LI, LJ, lA, lI, GA, GI = c
    cx, cy = B * a[0] + C * b[0] - A * chord[0], B * a[1] + C * b[1] - A * chord[1]
    dx, dy = y * d_I[0] + x * d_O[0], y * d_I[1] + x * d_O[1]
    e0 = 0.5 * (cx * cx + cy * cy) - 0.5
    eyy = 0.5 * (dx * dx + dy * dy) - 0.5
    N0 = w * (LA * e0 + LI * k2 + lA * eyy)
    N1 = w * (LI * (cx * e[0] + cy * e[1]))
    N2 = w * (LI * e0 + LJ * k2 + lI * eyy)
    Ny = w * (LA * eyy + lA * e0 + lI * k2)
    Q0 = w * (GA * (cx * dx + cy * dy))
    Q1 = w * (GI * (e[0] * dx + e[1] * dy))
    return (
        (N0 * cx + N1 * e[0] + Q0 * dx, N0 * cy + N1 * e[1] + Q0 * dy),
        (Ny * dx + Q0 * cx + Q1 * e[0], Ny * dy + Q0 * cy + Q1 * e[1]),
        (N1 * cx + N2 * e[0] + Q1 * dx, N1 * cy + N2 * e[1] + Q1 * dy),
    )


@inlined
def _weighted(k, f, c):  # type: ignore[no-untyped-def]
    """Sum over the Gauss points of shape value k times component c of the stresses f."""
    return P0[k] * f[0][c] + P1[k] * f[1][c] + P2[k] * f[2][c] + P3[k] * f[3][c] + P4[k] * f[4][c]


def forces(q: Array, first: int, count: int, constants: Array, out: Array) -> None:
    """Elastic forces of a block of elements on their nodes.

    Parameters
    ----------
    q : ndarray, shape (6, nodes)
    first, count : int
        First node of the block, number of its elements, at most BLOCK.
    constants : ndarray, shape (≥ 8,)
    out : ndarray, shape (12 * BLOCK,)
        Output, in the layout of `force_blocks`.
    """
    l, LA, LI, LJ = constants[0], constants[1], constants[2], constants[3]  # noqa: E741
    lA, lI, GA, GI = constants[4], constants[5], constants[6], constants[7]
    m = (l, LA, LI, LJ, lA, lI, GA, GI)
    r = 1.0 / l
    done = 0
    while done < count:
        start, some = part(done, count)
        n, to = six_rows(q, first + start), out[start:]
        for j in range(some):
            u = ((n[0][j + 1] - n[0][j]) * r, (n[1][j + 1] - n[1][j]) * r)
            a, b = (n[2][j], n[3][j]), (n[2][j + 1], n[3][j + 1])
            d, f = (n[4][j], n[5][j]), (n[4][j + 1], n[5][j + 1])
            e = ((f[0] - d[0]) * r, (f[1] - d[1]) * r)
            k2 = 0.5 * (e[0] * e[0] + e[1] * e[1])
            p0, t0, s0 = _stress(P0, W0, u, a, b, d, f, e, k2, m)
            p1, t1, s1 = _stress(P1, W1, u, a, b, d, f, e, k2, m)
            p2, t2, s2 = _stress(P2, W2, u, a, b, d, f, e, k2, m)
            p3, t3, s3 = _stress(P3, W3, u, a, b, d, f, e, k2, m)
            p4, t4, s4 = _stress(P4, W4, u, a, b, d, f, e, k2, m)
            p, t = (p0, p1, p2, p3, p4), (t0, t1, t2, t3, t4)
            rx, ry = _weighted(2, p, 0), _weighted(2, p, 1)
            sx = s0[0] + s1[0] + s2[0] + s3[0] + s4[0]
            sy = s0[1] + s1[1] + s2[1] + s3[1] + s4[1]
            to[0 * BLOCK + j] = rx
            to[1 * BLOCK + j] = ry
            to[2 * BLOCK + j] = l * _weighted(3, p, 0)
            to[3 * BLOCK + j] = l * _weighted(3, p, 1)
            to[4 * BLOCK + j] = l * _weighted(1, t, 0) - sx
            to[5 * BLOCK + j] = l * _weighted(1, t, 1) - sy
            to[6 * BLOCK + j] = -rx
            to[7 * BLOCK + j] = -ry
            to[8 * BLOCK + j] = l * _weighted(4, p, 0)
            to[9 * BLOCK + j] = l * _weighted(4, p, 1)
            to[10 * BLOCK + j] = l * _weighted(0, t, 0) + sx
            to[11 * BLOCK + j] = l * _weighted(0, t, 1) + sy
        done = start + some


def damping_forces(
    q: Array, v: Array, first: int, count: int, constants: Array, damping: float, out: Array
) -> None:
    """Kelvin-Voigt forces of a block of elements at velocities v, (6, nodes); the rest as in `forces`.

    damping: τ, s.
    """
    l, LA, LI, LJ = constants[0], constants[1], constants[2], constants[3]  # noqa: E741
    lA, lI, GA, GI = constants[4], constants[5], constants[6], constants[7]
    r = 1.0 / l
    done = 0
    while done < count:
        start, some = part(done, count)
        n, o, to = six_rows(q, first + start), six_rows(v, first + start), out[start:]
        clear_forces(to, 6, some)
        for p in range(POINTS):
            x, y, A, B, C, weight = (
                TABLE[p, 0],
                TABLE[p, 1],
                TABLE[p, 2],
                TABLE[p, 3],
                TABLE[p, 4],
                TABLE[p, 5],
            )
            w = damping * weight
            for j in range(some):
                (cx, cy), (dx, dy), (ex, ey) = _vectors(n, j, x, y, A, B, C, r)
                (fx, fy), (gx, gy), (hx, hy) = _vectors(o, j, x, y, A, B, C, r)  # their rates
                stretch, twist, thickness = cx * fx + cy * fy, ex * hx + ey * hy, dx * gx + dy * gy
                N0 = w * (LA * stretch + LI * twist + lA * thickness)
                N1 = w * LI * (fx * ex + fy * ey + cx * hx + cy * hy)
                N2 = w * (LI * stretch + LJ * twist + lI * thickness)
                Ny = w * (LA * thickness + lA * stretch + lI * twist)
                Q0 = w * GA * (fx * dx + fy * dy + cx * gx + cy * gy)
                Q1 = w * GI * (hx * dx + hy * dy + ex * gx + ey * gy)
                px, py = N0 * cx + N1 * ex + Q0 * dx, N0 * cy + N1 * ey + Q0 * dy
                tx, ty = Ny * dx + Q0 * cx + Q1 * ex, Ny * dy + Q0 * cy + Q1 * ey
                sx, sy = N1 * cx + N2 * ex + Q1 * dx, N1 * cy + N2 * ey + Q1 * dy
                to[0 * BLOCK + j] += A * px
                to[1 * BLOCK + j] += A * py
                to[2 * BLOCK + j] += l * B * px
                to[3 * BLOCK + j] += l * B * py
                to[4 * BLOCK + j] += l * y * tx - sx
                to[5 * BLOCK + j] += l * y * ty - sy
                to[6 * BLOCK + j] -= A * px
                to[7 * BLOCK + j] -= A * py
                to[8 * BLOCK + j] += l * C * px
                to[9 * BLOCK + j] += l * C * py
                to[10 * BLOCK + j] += l * x * tx + sx
                to[11 * BLOCK + j] += l * x * ty + sy
        done = start + some


@inlined
def _vectors(n, j, x, y, A, B, C, r):  # type: ignore[no-untyped-def]
    """c', d and d' at a point of element j, from its row of TABLE."""
    return (
        (
            B * n[2][j] + C * n[2][j + 1] - A * (n[0][j + 1] - n[0][j]) * r,
            B * n[3][j] + C * n[3][j + 1] - A * (n[1][j + 1] - n[1][j]) * r,
        ),
        (y * n[4][j] + x * n[4][j + 1], y * n[5][j] + x * n[5][j + 1]),
        ((n[4][j + 1] - n[4][j]) * r, (n[5][j + 1] - n[5][j]) * r),
    )


def energy(q: Array, first: int, count: int, constants: Array) -> float:
    """Strain energy of a row of elements, J."""
    l, LA, LI, LJ = constants[0], constants[1], constants[2], constants[3]  # noqa: E741
    lA, lI, GA, GI = constants[4], constants[5], constants[6], constants[7]
    total = 0.0
    for i in range(first, first + count):
        ex, ey = (q[4, i + 1] - q[4, i]) / l, (q[5, i + 1] - q[5, i]) / l
        k2 = 0.5 * (ex * ex + ey * ey)
        for p in range(POINTS):
            x, y, A, B, C = TABLE[p, 0], TABLE[p, 1], TABLE[p, 2], TABLE[p, 3], TABLE[p, 4]
            cx = B * q[2, i] + C * q[2, i + 1] - A * (q[0, i + 1] - q[0, i]) / l
            cy = B * q[3, i] + C * q[3, i + 1] - A * (q[1, i + 1] - q[1, i]) / l
            dx, dy = y * q[4, i] + x * q[4, i + 1], y * q[5, i] + x * q[5, i + 1]
            e0, eyy = 0.5 * (cx * cx + cy * cy) - 0.5, 0.5 * (dx * dx + dy * dy) - 0.5
            k1, t0, t1 = cx * ex + cy * ey, cx * dx + cy * dy, ex * dx + ey * dy
            density = LA * (e0 * e0 + eyy * eyy) + LI * (k1 * k1 + 2.0 * e0 * k2) + LJ * k2 * k2
            density += 2.0 * eyy * (lA * e0 + lI * k2) + GA * t0 * t0 + GI * t1 * t1
            total += 0.5 * l * TABLE[p, 5] * density
    return total


def tangents(
    q: Array, first: int, count: int, constants: Array, material: float, geometric: float, out: Array
) -> None:
    """Stiffness of a block of elements: derivatives by u = (r_O − r_I)/l and the gradients, then by the nodal vectors.

    Parameters
    ----------
    q : ndarray, shape (6, nodes)
    first, count : int
        First node of the block, number of its elements, at most TANGENT_BLOCK.
    constants : ndarray, shape (≥ 8,)
    material, geometric : float
        As in `cable_kernel.tangents`.
    out : ndarray, shape (TANGENT_BUFFER,)
        Output, in the layout of `tangent_blocks`; nodal vectors r_I, r_x,I, r_y,I, r_O, r_x,O, r_y,O.
    """
    l = constants[0]  # noqa: E741
    v = 1.0 / l
    n = six_rows(q, first)
    clear_sums(out, ROWS)
    for p in range(POINTS):
        x, y, A, B, C = TABLE[p, 0], TABLE[p, 1], -TABLE[p, 2], TABLE[p, 3], TABLE[p, 4]
        f, g = material * TABLE[p, 5] * l, geometric * TABLE[p, 5] * l
        for j in range(count):
            ex, ey = (n[4][j + 1] - n[4][j]) * v, (n[5][j + 1] - n[5][j]) * v
            cx = B * n[2][j] + C * n[2][j + 1] + A * (n[0][j + 1] - n[0][j]) * v
            cy = B * n[3][j] + C * n[3][j + 1] + A * (n[1][j + 1] - n[1][j]) * v
            dx, dy = y * n[4][j] + x * n[4][j + 1], y * n[5][j] + x * n[5][j + 1]
            CC, EC, DC, EE, ED, DD = _second_derivatives(f, g, constants, cx, cy, dx, dy, ex, ey)
            add_symmetric(out, 0, j, A * A, CC)
            add_symmetric(out, 3, j, B * A, CC)
            add_symmetric(out, 6, j, B * B, CC)
            add_symmetric(out, 9, j, C * A, CC)
            add_symmetric(out, 12, j, C * B, CC)
            add_symmetric(out, 15, j, C * C, CC)
            I = _sum(y, DC, -v, EC)  # noqa: E741
            O = _sum(x, DC, v, EC)  # noqa: E741
            add_full(out, 18, j, A, I)
            add_full(out, 22, j, B, I)
            add_full(out, 26, j, C, I)
            add_full(out, 30, j, A, O)
            add_full(out, 34, j, B, O)
            add_full(out, 38, j, C, O)
            add_symmetric(out, 42, j, 1.0, _twice(-v, y, EE, ED, DD))
            add_full(out, 45, j, 1.0, _both(v, x, -v, y, EE, ED, DD))
            add_symmetric(out, 49, j, 1.0, _twice(v, x, EE, ED, DD))
    place(PLACES, v, count, out)


@inlined
def _second_derivatives(f, g, constants, cx, cy, dx, dy, ex, ey):  # type: ignore[no-untyped-def]
    """Of the energy at a Gauss point: by c' twice, d' and c', d and c', d' twice, d' and d, d twice.

    f and g: its weight times the factors of the material and of the geometric part.
    """
    LA, LI, LJ = f * constants[1], f * constants[2], f * constants[3]
    lA, lI, GA, GI = f * constants[4], f * constants[5], f * constants[6], f * constants[7]
    NA, NI, NJ = g * constants[1], g * constants[2], g * constants[3]
    nA, nI, QA, QI = g * constants[4], g * constants[5], g * constants[6], g * constants[7]
    k2 = 0.5 * (ex * ex + ey * ey)
    e0, eyy = 0.5 * (cx * cx + cy * cy) - 0.5, 0.5 * (dx * dx + dy * dy) - 0.5
    N0, N1 = NA * e0 + NI * k2 + nA * eyy, NI * (cx * ex + cy * ey)
    N2, Ny = NI * e0 + NJ * k2 + nI * eyy, NA * eyy + nA * e0 + nI * k2
    Q0, Q1 = QA * (cx * dx + cy * dy), QI * (ex * dx + ey * dy)
    return (
        (
            LA * cx * cx + LI * ex * ex + GA * dx * dx + N0,
            LA * cx * cy + LI * ex * ey + GA * dx * dy,
            LA * cy * cy + LI * ey * ey + GA * dy * dy + N0,
        ),
        (
            2.0 * LI * cx * ex + N1,
            LI * (cy * ex + ey * cx),
            LI * (cx * ey + ex * cy),
            2.0 * LI * cy * ey + N1,
        ),
        (
            (lA + GA) * cx * dx + Q0,
            lA * cy * dx + GA * dy * cx,
            lA * cx * dy + GA * dx * cy,
            (lA + GA) * cy * dy + Q0,
        ),
        (
            LI * cx * cx + LJ * ex * ex + GI * dx * dx + N2,
            LI * cx * cy + LJ * ex * ey + GI * dx * dy,
            LI * cy * cy + LJ * ey * ey + GI * dy * dy + N2,
        ),
        (
            (lI + GI) * ex * dx + Q1,
            lI * ex * dy + GI * dx * ey,
            lI * ey * dx + GI * dy * ex,
            (lI + GI) * ey * dy + Q1,
        ),
        (
            LA * dx * dx + GA * cx * cx + GI * ex * ex + Ny,
            LA * dx * dy + GA * cx * cy + GI * ex * ey,
            LA * dy * dy + GA * cy * cy + GI * ey * ey + Ny,
        ),
    )


@inlined
def _sum(n, B, o, D):  # type: ignore[no-untyped-def]
    """n B + o D."""
    return n * B[0] + o * D[0], n * B[1] + o * D[1], n * B[2] + o * D[2], n * B[3] + o * D[3]


@inlined
def _twice(n, o, EE, ED, DD):  # type: ignore[no-untyped-def]
    """Second derivative by a vector on which d' depends by n and d by o."""
    return (
        n * n * EE[0] + 2.0 * n * o * ED[0] + o * o * DD[0],
        n * n * EE[1] + n * o * (ED[1] + ED[2]) + o * o * DD[1],
        n * n * EE[2] + 2.0 * n * o * ED[3] + o * o * DD[2],
    )


@inlined
def _both(n, o, r, s, EE, ED, DD):  # type: ignore[no-untyped-def]
    """Second derivative by such a vector and another one, of r and s."""
    return (
        n * r * EE[0] + (n * s + o * r) * ED[0] + o * s * DD[0],
        n * r * EE[1] + n * s * ED[1] + o * r * ED[2] + o * s * DD[1],
        n * r * EE[1] + n * s * ED[2] + o * r * ED[1] + o * s * DD[1],
        n * r * EE[2] + (n * s + o * r) * ED[3] + o * s * DD[2],
    )
