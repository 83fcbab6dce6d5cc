"""Compiled twin of `cable`: the same numbers for a block of elements; layout as in `shear_kernel`.

Here the loop over the quadrature points is the outer one, so that one kernel serves every rule and the inner loop
over elements is vectorised.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from anctmm.compiling import kernel
from anctmm.elements.cable import CableElement

Array = NDArray[np.float64]

#: Elements handled at once. The buffer has 12 rows of this length, as for the shear element; 8 are used.
BLOCK = 64
#: Where the points start among the constants, and how many numbers an axial and a bending point take.
HEAD, AXIAL, BENDING = 5, 4, 7


def constants(e: CableElement) -> Array:
    """What the kernels need of an element: l, EA, EI, numbers of axial and bending points, and the points.

    An axial point is l S1', S2', S5' and the weight, a bending point these three, l² S1'', l S2'', l S5''
    and the weight; S4 = 1 − S1.
    """
    (Ba, wa), (Bb, Cb, wb) = e.axial_rule, e.bending_rule
    scale = np.array([e.l, 1.0, 1.0])
    columns = [0, 1, 3]
    axial = np.column_stack([Ba[:, columns] * scale, wa / e.l])
    bending = np.column_stack([Bb[:, columns] * scale, Cb[:, columns] * scale * e.l, wb / e.l])
    return np.concatenate([[e.l, e.EA, e.EI, len(wa), len(wb)], axial.ravel(), bending.ravel()])


@kernel
def forces(q: Array, first: int, count: int, constants: Array, out: Array) -> None:
    """Elastic forces of a block of elements on their nodes.

    Parameters
    ----------
    q : ndarray, shape (≥ 4, nodes)
    first, count : int
        First node of the block, number of its elements, at most BLOCK.
    constants : ndarray
        See `constants`.
    out : ndarray, shape (12 * BLOCK,)
        Written: component k < 4 of the force of element j on node I at k BLOCK + j, on node O at (6 + k) BLOCK + j.
    """
    l, EA, EI = constants[0], constants[1], constants[2]  # noqa: E741
    axial, bending = int(constants[3]), int(constants[4])
    r = 1.0 / l
    for k in range(4):
        for j in range(count):
            out[k * BLOCK + j] = 0.0
            out[(6 + k) * BLOCK + j] = 0.0
    for p in range(axial):
        at = HEAD + p * AXIAL
        A, B, C, w = constants[at], constants[at + 1], constants[at + 2], constants[at + 3]
        EAw = EA * w
        for j in range(count):
            i = first + j
            bx = B * q[2, i] + C * q[2, i + 1] - A * (q[0, i + 1] - q[0, i]) * r
            by = B * q[3, i] + C * q[3, i + 1] - A * (q[1, i + 1] - q[1, i]) * r
            n = EAw * (1.0 - 1.0 / sqrt(bx * bx + by * by))
            px, py = n * bx, n * by
            out[0 * BLOCK + j] += A * px
            out[1 * BLOCK + j] += A * py
            out[2 * BLOCK + j] += l * B * px
            out[3 * BLOCK + j] += l * B * py
            out[8 * BLOCK + j] += l * C * px
            out[9 * BLOCK + j] += l * C * py
    for p in range(bending):
        at = HEAD + axial * AXIAL + p * BENDING
        A, B, C = constants[at], constants[at + 1], constants[at + 2]
        a, b, c, w = constants[at + 3], constants[at + 4], constants[at + 5], constants[at + 6]
        EIw = EI * w
        for j in range(count):
            i = first + j
            ux, uy = (q[0, i + 1] - q[0, i]) * r, (q[1, i + 1] - q[1, i]) * r
            bx, by = B * q[2, i] + C * q[2, i + 1] - A * ux, B * q[3, i] + C * q[3, i + 1] - A * uy
            cx, cy = (
                (b * q[2, i] + c * q[2, i + 1] - a * ux) * r,
                (b * q[3, i] + c * q[3, i + 1] - a * uy) * r,
            )
            s = 1.0 / (bx * bx + by * by)
            curvature = (bx * cy - by * cx) * s
            m = EIw * curvature * s
            px, py = m * (cy - 2.0 * curvature * bx), -m * (cx + 2.0 * curvature * by)
            tx, ty = -m * by * r, m * bx * r
            out[0 * BLOCK + j] += A * px + a * tx
            out[1 * BLOCK + j] += A * py + a * ty
            out[2 * BLOCK + j] += l * (B * px + b * tx)
            out[3 * BLOCK + j] += l * (B * py + b * ty)
            out[8 * BLOCK + j] += l * (C * px + c * tx)
            out[9 * BLOCK + j] += l * (C * py + c * ty)
    for k in range(2):
        for j in range(count):
            out[(6 + k) * BLOCK + j] = -out[k * BLOCK + j]


@kernel
def energy(q: Array, first: int, count: int, constants: Array) -> float:
    """Strain energy of a row of elements, J."""
    l, EA, EI = constants[0], constants[1], constants[2]  # noqa: E741
    axial, bending = int(constants[3]), int(constants[4])
    total = 0.0
    for i in range(first, first + count):
        ux, uy = (q[0, i + 1] - q[0, i]) / l, (q[1, i + 1] - q[1, i]) / l
        for p in range(axial):
            at = HEAD + p * AXIAL
            A, B, C, w = constants[at], constants[at + 1], constants[at + 2], constants[at + 3]
            bx, by = B * q[2, i] + C * q[2, i + 1] - A * ux, B * q[3, i] + C * q[3, i + 1] - A * uy
            strain = sqrt(bx * bx + by * by) - 1.0
            total += 0.5 * EA * w * l * strain * strain
        for p in range(bending):
            at = HEAD + axial * AXIAL + p * BENDING
            A, B, C = constants[at], constants[at + 1], constants[at + 2]
            a, b, c, w = constants[at + 3], constants[at + 4], constants[at + 5], constants[at + 6]
            bx, by = B * q[2, i] + C * q[2, i + 1] - A * ux, B * q[3, i] + C * q[3, i + 1] - A * uy
            cx, cy = (
                (b * q[2, i] + c * q[2, i + 1] - a * ux) / l,
                (b * q[3, i] + c * q[3, i + 1] - a * uy) / l,
            )
            curvature = (bx * cy - by * cx) / (bx * bx + by * by)
            total += 0.5 * EI * w * l * curvature * curvature
    return total


@kernel
def tangent(q: Array, i: int, constants: Array, K: Array) -> None:
    """Hessian of the energy of the element between nodes i and i + 1, written into K, (8, 8).

    Rows and columns: the four components of node I, then those of node O.
    """
    l, EA, EI = constants[0], constants[1], constants[2]  # noqa: E741
    axial, bending = int(constants[3]), int(constants[4])
    ux, uy = (q[0, i + 1] - q[0, i]) / l, (q[1, i + 1] - q[1, i]) / l
    for k in range(8):
        for m in range(8):
            K[k, m] = 0.0
    for p in range(axial):
        at = HEAD + p * AXIAL
        A, B, C, w = constants[at], constants[at + 1], constants[at + 2], constants[at + 3]
        bx, by = B * q[2, i] + C * q[2, i + 1] - A * ux, B * q[3, i] + C * q[3, i + 1] - A * uy
        stretch = sqrt(bx * bx + by * by)
        tx, ty = bx / stretch, by / stretch
        f = EA * w * l
        g, h = f * (1.0 - 1.0 / stretch), f / stretch
        xx, xy, yy = g + h * tx * tx, h * tx * ty, g + h * ty * ty
        rows = (A / l, B, -A / l, C)
        for k in range(4):
            for m in range(4):
                n = rows[k] * rows[m]
                K[2 * k, 2 * m] += n * xx
                K[2 * k, 2 * m + 1] += n * xy
                K[2 * k + 1, 2 * m] += n * xy
                K[2 * k + 1, 2 * m + 1] += n * yy
    for p in range(bending):
        at = HEAD + axial * AXIAL + p * BENDING
        A, B, C = constants[at], constants[at + 1], constants[at + 2]
        a, b, c, w = constants[at + 3], constants[at + 4], constants[at + 5], constants[at + 6]
        bx, by = B * q[2, i] + C * q[2, i + 1] - A * ux, B * q[3, i] + C * q[3, i + 1] - A * uy
        cx, cy = (b * q[2, i] + c * q[2, i + 1] - a * ux) / l, (b * q[3, i] + c * q[3, i + 1] - a * uy) / l
        s = 1.0 / (bx * bx + by * by)
        curvature = (bx * cy - by * cx) * s
        # gradient of κ by r' and r'', then its second derivatives (that by r'' twice is zero)
        gx, gy = (cy - 2.0 * curvature * bx) * s, -(cx + 2.0 * curvature * by) * s
        hx, hy = -by * s, bx * s
        xx = -2.0 * (2.0 * bx * gx + curvature) * s
        xy = -2.0 * (bx * gy + by * gx) * s
        yy = -2.0 * (2.0 * by * gy + curvature) * s
        mxx, mxy = -2.0 * bx * hx * s, s - 2.0 * bx * hy * s
        myx, myy = -s - 2.0 * by * hx * s, -2.0 * by * hy * s
        f = EI * w * l
        moment = f * curvature
        rows, curves = (A / l, B, -A / l, C), (a / l**2, b / l, -a / l**2, c / l)
        for k in range(4):
            dx, dy = rows[k] * gx + curves[k] * hx, rows[k] * gy + curves[k] * hy
            for m in range(4):
                ex, ey = rows[m] * gx + curves[m] * hx, rows[m] * gy + curves[m] * hy
                n, o, v = rows[k] * rows[m], rows[k] * curves[m], curves[k] * rows[m]
                K[2 * k, 2 * m] += f * dx * ex + moment * (n * xx + (o + v) * mxx)
                K[2 * k, 2 * m + 1] += f * dx * ey + moment * (n * xy + o * mxy + v * myx)
                K[2 * k + 1, 2 * m] += f * dy * ex + moment * (n * xy + o * myx + v * mxy)
                K[2 * k + 1, 2 * m + 1] += f * dy * ey + moment * (n * yy + (o + v) * myy)
