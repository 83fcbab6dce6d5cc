"""Compiled twin of `cable`: the same numbers for a block of elements; layout as in `shear_kernel`.

Here the loop over the quadrature points is the outer one, so that one kernel serves every rule and the inner loop
over elements is vectorised.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from anctmm.compiling import inlined, kernel
from anctmm.elements.cable import CableElement
from anctmm.elements.shear_kernel import BLOCK, TANGENT_BLOCK, TANGENTS

Array = NDArray[np.float64]

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
def tangents(q: Array, first: int, count: int, constants: Array, out: Array) -> None:
    """Hessians of the energy of a block of elements.

    Parameters
    ----------
    q : ndarray, shape (≥ 4, nodes)
    first, count : int
        First node of the block, number of its elements, at most TANGENT_BLOCK.
    constants : ndarray
        See `constants`.
    out : ndarray, shape (TANGENT_BUFFER,)
        Written, with scratch behind: entry (2k + r, 2m + s) of element j, k ≤ m < 4 the nodal vectors r_I,
        r'_I, r_O, r'_O, in row 24 k + 4 m + 2 r + s, rows being TANGENT_BLOCK long.
    """
    l, EA, EI = constants[0], constants[1], constants[2]  # noqa: E741
    axial, bending = int(constants[3]), int(constants[4])
    v = 1.0 / l
    for k in range(4):
        for m in range(k, 4):
            for e in range(4):
                for j in range(count):
                    out[(24 * k + 4 * m + e) * TANGENT_BLOCK + j] = 0.0
    for p in range(axial):
        at = HEAD + p * AXIAL
        A, B, C, w = constants[at], constants[at + 1], constants[at + 2], constants[at + 3]
        f = EA * w * l
        for j in range(count):
            i = first + j
            bx = B * q[2, i] + C * q[2, i + 1] - A * (q[0, i + 1] - q[0, i]) * v
            by = B * q[3, i] + C * q[3, i + 1] - A * (q[1, i + 1] - q[1, i]) * v
            s = 1.0 / (bx * bx + by * by)
            h = f * sqrt(s)
            out[TANGENTS + 0 * TANGENT_BLOCK + j] = f - h + h * bx * bx * s
            out[TANGENTS + 1 * TANGENT_BLOCK + j] = h * bx * by * s
            out[TANGENTS + 2 * TANGENT_BLOCK + j] = f - h + h * by * by * s
        rows = (A * v, B, -A * v, C)
        for k in range(4):
            for m in range(k, 4):
                n, row = rows[k] * rows[m], 24 * k + 4 * m
                for j in range(count):
                    out[(row) * TANGENT_BLOCK + j] += n * out[TANGENTS + 0 * TANGENT_BLOCK + j]
                    out[(row + 1) * TANGENT_BLOCK + j] += n * out[TANGENTS + 1 * TANGENT_BLOCK + j]
                    out[(row + 2) * TANGENT_BLOCK + j] += n * out[TANGENTS + 1 * TANGENT_BLOCK + j]
                    out[(row + 3) * TANGENT_BLOCK + j] += n * out[TANGENTS + 2 * TANGENT_BLOCK + j]
    for p in range(bending):
        at = HEAD + axial * AXIAL + p * BENDING
        A, B, C = constants[at], constants[at + 1], constants[at + 2]
        a, b, c = constants[at + 3], constants[at + 4], constants[at + 5]
        _bending_blocks(q, first, count, A, B, C, a, b, c, v, EI * constants[at + 6] * l, out)
        rows, curves = (A * v, B, -A * v, C), (a * v * v, b * v, -a * v * v, c * v)
        for k in range(4):
            for m in range(k, 4):
                n, o, row = rows[k] * rows[m], rows[k] * curves[m], 24 * k + 4 * m
                t, u = curves[k] * rows[m], curves[k] * curves[m]
                for j in range(count):
                    Qxx, Qxy, Qyx, Qyy = (
                        out[TANGENTS + 3 * TANGENT_BLOCK + j],
                        out[TANGENTS + 4 * TANGENT_BLOCK + j],
                        out[TANGENTS + 5 * TANGENT_BLOCK + j],
                        out[TANGENTS + 6 * TANGENT_BLOCK + j],
                    )
                    out[(row) * TANGENT_BLOCK + j] += (
                        n * out[TANGENTS + 0 * TANGENT_BLOCK + j]
                        + (o + t) * Qxx
                        + u * out[TANGENTS + 7 * TANGENT_BLOCK + j]
                    )
                    out[(row + 1) * TANGENT_BLOCK + j] += (
                        n * out[TANGENTS + 1 * TANGENT_BLOCK + j]
                        + o * Qxy
                        + t * Qyx
                        + u * out[TANGENTS + 8 * TANGENT_BLOCK + j]
                    )
                    out[(row + 2) * TANGENT_BLOCK + j] += (
                        n * out[TANGENTS + 1 * TANGENT_BLOCK + j]
                        + o * Qyx
                        + t * Qxy
                        + u * out[TANGENTS + 8 * TANGENT_BLOCK + j]
                    )
                    out[(row + 3) * TANGENT_BLOCK + j] += (
                        n * out[TANGENTS + 2 * TANGENT_BLOCK + j]
                        + (o + t) * Qyy
                        + u * out[TANGENTS + 9 * TANGENT_BLOCK + j]
                    )


@inlined
def _bending_blocks(q, first, count, A, B, C, a, b, c, v, f, out):  # type: ignore[no-untyped-def]
    """Second derivatives of ½ f κ² at a point; rows of the scratch: 0-2 by r' twice, 3-6 by r' and r'', 7-9 by r''."""
    for j in range(count):
        i = first + j
        ux, uy = (q[0, i + 1] - q[0, i]) * v, (q[1, i + 1] - q[1, i]) * v
        bx, by = B * q[2, i] + C * q[2, i + 1] - A * ux, B * q[3, i] + C * q[3, i + 1] - A * uy
        cx, cy = (b * q[2, i] + c * q[2, i + 1] - a * ux) * v, (b * q[3, i] + c * q[3, i + 1] - a * uy) * v
        s = 1.0 / (bx * bx + by * by)
        curvature = (bx * cy - by * cx) * s
        # gradient of κ by r', g, and by r'', h; κ is linear in r''
        gx, gy = (cy - 2.0 * curvature * bx) * s, -(cx + 2.0 * curvature * by) * s
        hx, hy = -by * s, bx * s
        m = f * curvature
        n = 2.0 * m * s
        out[TANGENTS + 0 * TANGENT_BLOCK + j] = f * gx * gx - n * (2.0 * bx * gx + curvature)
        out[TANGENTS + 1 * TANGENT_BLOCK + j] = f * gx * gy - n * (bx * gy + by * gx)
        out[TANGENTS + 2 * TANGENT_BLOCK + j] = f * gy * gy - n * (2.0 * by * gy + curvature)
        out[TANGENTS + 3 * TANGENT_BLOCK + j] = f * gx * hx - n * bx * hx
        out[TANGENTS + 4 * TANGENT_BLOCK + j] = f * gx * hy + m * s - n * bx * hy
        out[TANGENTS + 5 * TANGENT_BLOCK + j] = f * gy * hx - m * s - n * by * hx
        out[TANGENTS + 6 * TANGENT_BLOCK + j] = f * gy * hy - n * by * hy
        out[TANGENTS + 7 * TANGENT_BLOCK + j] = f * hx * hx
        out[TANGENTS + 8 * TANGENT_BLOCK + j] = f * hx * hy
        out[TANGENTS + 9 * TANGENT_BLOCK + j] = f * hy * hy
