"""Compiled twin of `quintic`: the same numbers for a block of elements; layout as in `shear_kernel`.

Derivatives are taken by the five vectors u = (r_O − r_I)/l, r'_I, l r''_I, r'_O, l r''_O: all weights of r' and of
l r'' are numbers then, the same for every element.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.force_blocks import BLOCK, clear_forces, oppose_positions, part, six_rows
from anctmm.elements.quintic import AXIAL, BENDING, QuinticElement
from anctmm.elements.shapes import gauss, quintic
from anctmm.elements.tangent_blocks import SUMS, TANGENT_BLOCK, clear_sums, place, placement
from anctmm.elements.thin_beam import (
    axial_damping,
    axial_force,
    axial_stiffness,
    bending_damping,
    bending_moment,
    bending_stiffness,
    curvature_of,
)
from anctmm.kernels.options import inlined

Array = NDArray[np.float64]

#: Vectors by which derivatives are taken, and sums of their second derivatives, in rows of four: xx, xy, yx, yy.
VECTORS, PAIRS = 5, 15
#: Where the second derivatives of one point stand, behind all sums: by r' twice, by r' and r'', by r'' twice.
POINT = 4 * PAIRS


def _weights(points: int) -> Array:
    """Of each Gauss point the weights of u, r'_I, l r''_I, r'_O, l r''_O in r', those in l r'', and the point's own."""
    xi, w = gauss(points)
    columns = [3, 1, 2, 4, 5]
    return np.column_stack([quintic(xi, 1.0, 1)[:, columns], quintic(xi, 1.0, 2)[:, columns], w])


AXIAL_POINTS, BENDING_POINTS = _weights(AXIAL), _weights(BENDING)


def _blocks() -> list[tuple[int, int, str, int, int]]:
    """Blocks of `placement`: those of r_I and r_O are those of u, times ∓1/l."""
    vector, sign = (0, 1, 2, 0, 3, 4), (-1, 1, 1, 1, 1, 1)
    found = []
    for k in range(6):
        for m in range(k + 1):
            one, two = vector[k], vector[m]
            row, column = max(one, two), min(one, two)
            power = (one == 0) + (two == 0)
            form = "full" if one >= two else "transposed"
            found.append((k, m, form, 4 * (row * (row + 1) // 2 + column), sign[k] * sign[m] * power))
    return found


PLACES = placement(_blocks())


def constants(e: QuinticElement) -> Array:
    """What the kernels need of an element: l, EA, EI."""
    return np.array([e.l, e.EA, e.EI])


def forces(q: Array, first: int, count: int, constants: Array, out: Array) -> None:
    """Elastic forces of a block of elements on their nodes.

    Parameters
    ----------
    q : ndarray, shape (6, nodes)
    first, count : int
        First node of the block, number of its elements, at most BLOCK.
    constants : ndarray, shape (≥ 3,)
        See `constants`.
    out : ndarray, shape (12 * BLOCK,)
        Output, in the layout of `force_blocks`.
    """
    l, EA, EI = constants[0], constants[1], constants[2]  # noqa: E741
    r = 1.0 / l
    done = 0
    while done < count:
        start, some = part(done, count)
        e, to = six_rows(q, first + start), out[start:]
        clear_forces(to, 6, some)
        for p in range(AXIAL):
            W = AXIAL_POINTS[p]
            w = EA * W[10]
            for j in range(some):
                bx, by = _slope(e, j, W, 0, r)
                px, py = axial_force(bx, by, w)
                _add(to, j, l, W, 0, px, py)
        for p in range(BENDING):
            W = BENDING_POINTS[p]
            w = EI * W[10]
            for j in range(some):
                bx, by = _slope(e, j, W, 0, r)
                cx, cy = _slope(e, j, W, 5, r)
                px, py, tx, ty = bending_moment(bx, by, cx * r, cy * r, w)
                _add(to, j, l, W, 0, px, py)
                _add(to, j, l, W, 5, tx * r, ty * r)
        oppose_positions(to, 6, 0, some)
        done = start + some


def damping_forces(
    q: Array, v: Array, first: int, count: int, constants: Array, damping: float, out: Array
) -> None:
    """Kelvin-Voigt forces of a block of elements at velocities v, (6, nodes); the rest as in `forces`.

    damping: τ, s.
    """
    l, EA, EI = constants[0], damping * constants[1], damping * constants[2]  # noqa: E741
    r = 1.0 / l
    done = 0
    while done < count:
        start, some = part(done, count)
        e, f, to = six_rows(q, first + start), six_rows(v, first + start), out[start:]
        clear_forces(to, 6, some)
        for p in range(AXIAL):
            W = AXIAL_POINTS[p]
            w = EA * W[10]
            for j in range(some):
                bx, by = _slope(e, j, W, 0, r)
                gx, gy = _slope(f, j, W, 0, r)
                px, py = axial_damping(bx, by, gx, gy, w)
                _add(to, j, l, W, 0, px, py)
        for p in range(BENDING):
            W = BENDING_POINTS[p]
            w = EI * W[10]
            for j in range(some):
                bx, by = _slope(e, j, W, 0, r)
                cx, cy = _slope(e, j, W, 5, r)
                gx, gy = _slope(f, j, W, 0, r)
                hx, hy = _slope(f, j, W, 5, r)
                px, py, tx, ty = bending_damping(bx, by, cx * r, cy * r, gx, gy, hx * r, hy * r, w)
                _add(to, j, l, W, 0, px, py)
                _add(to, j, l, W, 5, tx * r, ty * r)
        oppose_positions(to, 6, 0, some)
        done = start + some


@inlined
def _slope(e, j, W, at, r):  # type: ignore[no-untyped-def]
    """r' (at = 0) or l r'' (at = 5) of element j at a point of weights W."""
    return (
        W[at] * ((e[0][j + 1] - e[0][j]) * r)
        + W[at + 1] * e[2][j]
        + W[at + 2] * e[4][j]
        + W[at + 3] * e[2][j + 1]
        + W[at + 4] * e[4][j + 1],
        W[at] * ((e[1][j + 1] - e[1][j]) * r)
        + W[at + 1] * e[3][j]
        + W[at + 2] * e[5][j]
        + W[at + 3] * e[3][j + 1]
        + W[at + 4] * e[5][j + 1],
    )


@inlined
def _add(out, j, l, W, at, px, py):  # type: ignore[no-untyped-def]  # noqa: E741
    """Add what p, the energy's derivative by r' or l r'', gives on the coordinates of element j, r of node I apart."""
    out[2 * BLOCK + j] += l * W[at + 1] * px
    out[3 * BLOCK + j] += l * W[at + 1] * py
    out[4 * BLOCK + j] += l * W[at + 2] * px
    out[5 * BLOCK + j] += l * W[at + 2] * py
    out[6 * BLOCK + j] += W[at] * px
    out[7 * BLOCK + j] += W[at] * py
    out[8 * BLOCK + j] += l * W[at + 3] * px
    out[9 * BLOCK + j] += l * W[at + 3] * py
    out[10 * BLOCK + j] += l * W[at + 4] * px
    out[11 * BLOCK + j] += l * W[at + 4] * py


def energy(q: Array, first: int, count: int, constants: Array) -> float:
    """Strain energy of a row of elements, J."""
    l, EA, EI = constants[0], constants[1], constants[2]  # noqa: E741
    r = 1.0 / l
    e = six_rows(q, first)
    total = 0.0
    for j in range(count):
        for p in range(AXIAL):
            bx, by = _slope(e, j, AXIAL_POINTS[p], 0, r)
            strain = sqrt(bx * bx + by * by) - 1.0
            total += 0.5 * EA * AXIAL_POINTS[p, 10] * l * strain * strain
        for p in range(BENDING):
            bx, by = _slope(e, j, BENDING_POINTS[p], 0, r)
            cx, cy = _slope(e, j, BENDING_POINTS[p], 5, r)
            curvature, _, _, _ = curvature_of(bx, by, cx * r, cy * r)
            total += 0.5 * EI * BENDING_POINTS[p, 10] * l * curvature * curvature
    return total


def tangents(
    q: Array, first: int, count: int, constants: Array, material: float, geometric: float, out: Array
) -> None:
    """Stiffness of a block of elements: derivatives by the five vectors, then by the nodal ones.

    At each point the second derivatives by r' and l r'' come first, for all elements; then each pair of vectors takes
    its parts of them.

    Parameters
    ----------
    q : ndarray, shape (6, nodes)
    first, count : int
        First node of the block, number of its elements, at most TANGENT_BLOCK.
    constants : ndarray, shape (≥ 3,)
    material, geometric : float
        As in `cable_kernel.tangents`.
    out : ndarray, shape (TANGENT_BUFFER,)
        Output, in the layout of `tangent_blocks`; nodal vectors r_I, r'_I, l r''_I, r_O, r'_O, l r''_O.
    """
    v, EA, EI = 1.0 / constants[0], constants[1] * constants[0], constants[2] * constants[0]
    e = six_rows(q, first)
    clear_sums(out, POINT)
    for p in range(AXIAL):
        W = AXIAL_POINTS[p]
        f, g = material * EA * W[10], geometric * EA * W[10]
        for j in range(count):
            bx, by = _slope(e, j, W, 0, v)
            xx, xy, yy = axial_stiffness(bx, by, f, g)
            _keep(out, j, 0, xx, xy, yy)
        row = 0
        for k in range(VECTORS):
            for m in range(k + 1):
                n = W[k] * W[m]
                for j in range(count):
                    xx, xy, yy = _kept(out, j, 0)
                    _add_block(out, row, j, n * xx, n * xy, n * xy, n * yy)
                row += 1
    for p in range(BENDING):
        W = BENDING_POINTS[p]
        f, g = material * EI * W[10], geometric * EI * W[10]
        for j in range(count):
            bx, by = _slope(e, j, W, 0, v)
            cx, cy = _slope(e, j, W, 5, v)
            P, Q, S = bending_stiffness(bx, by, cx * v, cy * v, f, g)
            _keep(out, j, 0, P[0], P[1], P[2])
            _keep(out, j, 3, Q[0], Q[1], Q[2])
            _keep(out, j, 6, Q[3], S[0], S[1])
            out[(SUMS + POINT + 9) * TANGENT_BLOCK + j] = S[2]
        row = 0
        for k in range(VECTORS):
            for m in range(k + 1):
                n, u = W[k] * W[m], (v * W[5 + k]) * (v * W[5 + m])
                o, t = W[k] * (v * W[5 + m]), (v * W[5 + k]) * W[m]
                for j in range(count):
                    Pxx, Pxy, Pyy = _kept(out, j, 0)
                    Qxx, Qxy, Qyx = _kept(out, j, 3)
                    Qyy, Sxx, Sxy = _kept(out, j, 6)
                    Syy = out[(SUMS + POINT + 9) * TANGENT_BLOCK + j]
                    _add_block(
                        out,
                        row,
                        j,
                        n * Pxx + (o + t) * Qxx + u * Sxx,
                        n * Pxy + o * Qxy + t * Qyx + u * Sxy,
                        n * Pxy + o * Qyx + t * Qxy + u * Sxy,
                        n * Pyy + (o + t) * Qyy + u * Syy,
                    )
                row += 1
    place(PLACES, v, count, out)


@inlined
def _keep(out, j, row, a, b, c):  # type: ignore[no-untyped-def]
    """Keep three numbers of a point and an element."""
    at = (SUMS + POINT + row) * TANGENT_BLOCK + j
    out[at], out[at + TANGENT_BLOCK], out[at + 2 * TANGENT_BLOCK] = a, b, c


@inlined
def _kept(out, j, row):  # type: ignore[no-untyped-def]
    """Three numbers of a point and an element."""
    at = (SUMS + POINT + row) * TANGENT_BLOCK + j
    return out[at], out[at + TANGENT_BLOCK], out[at + 2 * TANGENT_BLOCK]


@inlined
def _add_block(out, row, j, xx, xy, yx, yy):  # type: ignore[no-untyped-def]
    """Add a block to the sums of a pair of vectors."""
    at = (SUMS + 4 * row) * TANGENT_BLOCK + j
    out[at] += xx
    out[at + TANGENT_BLOCK] += xy
    out[at + 2 * TANGENT_BLOCK] += yx
    out[at + 3 * TANGENT_BLOCK] += yy
