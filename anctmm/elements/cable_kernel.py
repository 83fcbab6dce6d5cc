"""Compiled twin of `cable`: the same numbers for a block of elements; layout as in `shear_kernel`.

Here the loop over the quadrature points is the outer one, so that one kernel serves every rule and the inner loop
over elements is vectorised. Forces take the points of a rule in pairs, ξ and 1 − ξ, and its middle by itself. With
z = ½ − ξ the axis of the element has

    r' = m + z h + 6 z² k,   −l r'' = h + 12 z k,
    m = 3/2 u − ¼ (r'_I + r'_O),   h = r'_I − r'_O,   k = ½ (r'_I + r'_O) − u,   u = (r_O − r_I)/l,

so that sums and differences of what the two points of a pair give are the derivatives by m, h and k. The slopes
themselves are found from u, r'_I and r'_O: where one is zero it is exactly so, and the forces are not finite.
"""

from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.cable import CableElement
from anctmm.elements.force_blocks import BLOCK, four_rows, part
from anctmm.elements.tangent_blocks import (
    add_full,
    add_symmetric,
    clear_sums,
    place,
    placement,
)
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

#: Where the points start among the constants, and how many numbers an axial and a bending point take.
HEAD, AXIAL, BENDING = 5, 4, 7
#: Where the sums of tangents stand: second derivatives by u = (r_O − r_I)/l, r'_I and r'_O.
UU, IU, II, OU, OI, OO = 0, 3, 7, 10, 14, 18
PLACES = placement(
    [
        (0, 0, "symmetric", UU, 2),
        (1, 0, "full", IU, -1),
        (1, 1, "symmetric", II, 0),
        (2, 0, "symmetric", UU, -2),
        (2, 1, "transposed", IU, 1),
        (2, 2, "symmetric", UU, 2),
        (3, 0, "full", OU, -1),
        (3, 1, "full", OI, 0),
        (3, 2, "full", OU, 1),
        (3, 3, "symmetric", OO, 0),
    ]
)


def constants(e: CableElement) -> Array:
    """What the kernels need of an element: l, EA, EI, numbers of axial and bending points, and the points."""
    numbers, points = _points(e.quadrature)
    return np.concatenate([[e.l, e.EA, e.EI], numbers, points])


@lru_cache
def _points(quadrature: str) -> tuple[Array, Array]:
    """Numbers of axial and bending points, and the points: none of it depends on the length of an element.

    An axial point is l S1', S2', S5' and the weight, a bending point these three, l² S1'', l S2'', l S5''
    and the weight; S4 = 1 − S1.
    """
    unit, columns = CableElement(1.0, 1.0, 1.0, 1.0, quadrature), [0, 1, 3]
    (Ba, wa), (Bb, Cb, wb) = unit.axial_rule, unit.bending_rule
    axial = np.column_stack([Ba[:, columns], wa])
    bending = np.column_stack([Bb[:, columns], Cb[:, columns], wb])
    return np.array([len(wa), len(wb)]), np.concatenate([axial.ravel(), bending.ravel()])


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
        Output, components k < 4, in the layout of `force_blocks`.
    """
    l, EA, EI = constants[0], constants[1], constants[2]  # noqa: E741
    axial, bending = int(constants[3]), int(constants[4])
    r, behind = 1.0 / l, HEAD + axial * AXIAL
    done = 0
    while done < count:
        start, some = part(done, count)
        e, to = four_rows(q, first + start), out[start:]
        A, B, C, a, b, c, w = _bending_point(constants, behind, r)
        for j in range(some):
            d = _vectors(e, j, r)
            bx, by, dx, dy = _pair(d, A, B, C)
            cx, cy, ex, ey = _pair(d, a, b, c)
            px, py, sx, sy = bending_moment(bx, by, cx, cy, EI * w)
            qx, qy, tx, ty = bending_moment(dx, dy, ex, ey, EI * w)
            _write_bending(to, j, A, B, C, a, b, c, px, py, qx, qy, sx, sy, tx, ty)
        for p in range(axial // 2):
            A, B, C, w = _axial_point(constants, HEAD + p * AXIAL)
            for j in range(some):
                bx, by, dx, dy = _pair(_vectors(e, j, r), A, B, C)
                px, py = axial_force(bx, by, EA * w)
                qx, qy = axial_force(dx, dy, EA * w)
                _add_axial(to, j, A, B, C, px, py, qx, qy)
        if axial % 2 == 1:
            w = constants[HEAD + axial // 2 * AXIAL + 3]
            for j in range(some):
                bx, by, _, _ = _middle(_vectors(e, j, r), r)
                px, py = axial_force(bx, by, EA * w)
                to[0 * BLOCK + j] += px
                to[1 * BLOCK + j] += py
        if bending % 2 == 1:
            w = constants[behind + bending // 2 * BENDING + 6]
            for j in range(some):
                bx, by, cx, cy = _middle(_vectors(e, j, r), r)
                px, py, tx, ty = bending_moment(bx, by, cx, cy, EI * w)
                _add_middle(to, j, r, px, py, tx, ty)
        _on_nodes(to, some, l)
        done = start + some


def damping_forces(
    q: Array, v: Array, first: int, count: int, constants: Array, damping: float, out: Array
) -> None:
    """Kelvin-Voigt forces of a block of elements at velocities v, (≥ 4, nodes); the rest as in `forces`.

    damping: τ, s.
    """
    l, EA, EI = constants[0], damping * constants[1], damping * constants[2]  # noqa: E741
    axial, bending = int(constants[3]), int(constants[4])
    r, behind = 1.0 / l, HEAD + axial * AXIAL
    done = 0
    while done < count:
        start, some = part(done, count)
        e, f, to = four_rows(q, first + start), four_rows(v, first + start), out[start:]
        A, B, C, a, b, c, w = _bending_point(constants, behind, r)
        for j in range(some):
            d, g = _vectors(e, j, r), _vectors(f, j, r)
            bx, by, dx, dy = _pair(d, A, B, C)
            cx, cy, ex, ey = _pair(d, a, b, c)
            fx, fy, hx, hy = _pair(g, A, B, C)
            gx, gy, ix, iy = _pair(g, a, b, c)
            px, py, sx, sy = bending_damping(bx, by, cx, cy, fx, fy, gx, gy, EI * w)
            qx, qy, tx, ty = bending_damping(dx, dy, ex, ey, hx, hy, ix, iy, EI * w)
            _write_bending(to, j, A, B, C, a, b, c, px, py, qx, qy, sx, sy, tx, ty)
        for p in range(axial // 2):
            A, B, C, w = _axial_point(constants, HEAD + p * AXIAL)
            for j in range(some):
                bx, by, dx, dy = _pair(_vectors(e, j, r), A, B, C)
                fx, fy, hx, hy = _pair(_vectors(f, j, r), A, B, C)
                px, py = axial_damping(bx, by, fx, fy, EA * w)
                qx, qy = axial_damping(dx, dy, hx, hy, EA * w)
                _add_axial(to, j, A, B, C, px, py, qx, qy)
        if axial % 2 == 1:
            w = constants[HEAD + axial // 2 * AXIAL + 3]
            for j in range(some):
                bx, by, _, _ = _middle(_vectors(e, j, r), r)
                gx, gy, _, _ = _middle(_vectors(f, j, r), r)
                px, py = axial_damping(bx, by, gx, gy, EA * w)
                to[0 * BLOCK + j] += px
                to[1 * BLOCK + j] += py
        if bending % 2 == 1:
            w = constants[behind + bending // 2 * BENDING + 6]
            for j in range(some):
                bx, by, cx, cy = _middle(_vectors(e, j, r), r)
                gx, gy, hx, hy = _middle(_vectors(f, j, r), r)
                px, py, tx, ty = bending_damping(bx, by, cx, cy, gx, gy, hx, hy, EI * w)
                _add_middle(to, j, r, px, py, tx, ty)
        _on_nodes(to, some, l)
        done = start + some


@inlined
def _axial_point(constants, at):  # type: ignore[no-untyped-def]
    """Weights A, B, C of −u, r'_I, r'_O in r' at a point, and the point's own."""
    return constants[at], constants[at + 1], constants[at + 2], constants[at + 3]


@inlined
def _bending_point(constants, at, r):  # type: ignore[no-untyped-def]
    """The same weights, those in r'', and the point's own; r = 1/l."""
    return (
        constants[at],
        constants[at + 1],
        constants[at + 2],
        constants[at + 3] * r,
        constants[at + 4] * r,
        constants[at + 5] * r,
        constants[at + 6],
    )


@inlined
def _vectors(e, j, r):  # type: ignore[no-untyped-def]
    """u = (r_O − r_I)/l, r'_I and r'_O of element j, by components; r = 1/l."""
    ux, uy = (e[0][j + 1] - e[0][j]) * r, (e[1][j + 1] - e[1][j]) * r
    return ux, uy, e[2][j], e[3][j], e[2][j + 1], e[3][j + 1]


@inlined
def _pair(d, A, B, C):  # type: ignore[no-untyped-def]
    """B r'_I + C r'_O − A u, and with B and C exchanged: r' at ξ and 1 − ξ, or r'' at ξ and −r'' at 1 − ξ."""
    ux, uy, ix, iy, ox, oy = d
    x, y = A * ux, A * uy
    return B * ix + C * ox - x, B * iy + C * oy - y, C * ix + B * ox - x, C * iy + B * oy - y


@inlined
def _middle(d, r):  # type: ignore[no-untyped-def]
    """r' = m and r'' = −h/l at ξ = ½."""
    ux, uy, ix, iy, ox, oy = d
    return 1.5 * ux - 0.25 * (ix + ox), 1.5 * uy - 0.25 * (iy + oy), (ox - ix) * r, (oy - iy) * r


@inlined
def _write_bending(out, j, A, B, C, a, b, c, px, py, qx, qy, sx, sy, tx, ty):  # type: ignore[no-untyped-def]
    """Keep derivatives by m, h, k of element j where its forces will stand.

    p and q are those by the two vectors r' of `_pair`, s and t by the two vectors r''.
    """
    y, z, x = A + 1.5, 0.5 * (B - C), 0.5 * (b - c)  # 6 z², z and −1/l
    mx, my = px + qx, py + qy
    out[0 * BLOCK + j] = mx
    out[1 * BLOCK + j] = my
    out[2 * BLOCK + j] = z * (px - qx) + x * (sx - tx)
    out[3 * BLOCK + j] = z * (py - qy) + x * (sy - ty)
    out[8 * BLOCK + j] = y * mx + a * (sx + tx)
    out[9 * BLOCK + j] = y * my + a * (sy + ty)


@inlined
def _add_axial(out, j, A, B, C, px, py, qx, qy):  # type: ignore[no-untyped-def]
    """Add to them what p and q give, the derivatives by the two vectors r' of `_pair`."""
    y, z = A + 1.5, 0.5 * (B - C)
    mx, my = px + qx, py + qy
    out[0 * BLOCK + j] += mx
    out[1 * BLOCK + j] += my
    out[2 * BLOCK + j] += z * (px - qx)
    out[3 * BLOCK + j] += z * (py - qy)
    out[8 * BLOCK + j] += y * mx
    out[9 * BLOCK + j] += y * my


@inlined
def _add_middle(out, j, r, px, py, tx, ty):  # type: ignore[no-untyped-def]
    """Add to them what p and t give, the derivatives by r' and r'' at ξ = ½; r = 1/l."""
    out[0 * BLOCK + j] += px
    out[1 * BLOCK + j] += py
    out[2 * BLOCK + j] -= r * tx
    out[3 * BLOCK + j] -= r * ty


@inlined
def _on_nodes(out, count, l):  # type: ignore[no-untyped-def]  # noqa: E741
    """Put forces on the nodes in the place of derivatives by m, h, k."""
    for i in range(2):
        for j in range(count):
            m, h, k = out[i * BLOCK + j], l * out[(2 + i) * BLOCK + j], out[(8 + i) * BLOCK + j]
            force, mean = k - 1.5 * m, l * (0.5 * k - 0.25 * m)
            out[i * BLOCK + j], out[(6 + i) * BLOCK + j] = force, -force
            out[(2 + i) * BLOCK + j], out[(8 + i) * BLOCK + j] = mean + h, mean - h


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
            curvature, _, _, _ = curvature_of(bx, by, cx, cy)
            total += 0.5 * EI * w * l * curvature * curvature
    return total


def tangents(
    q: Array, first: int, count: int, constants: Array, material: float, geometric: float, out: Array
) -> None:
    """Stiffness of a block of elements: derivatives by u = (r_O − r_I)/l, r'_I and r'_O, then by the nodal vectors.

    Parameters
    ----------
    q : ndarray, shape (≥ 4, nodes)
    first, count : int
        First node of the block, number of its elements, at most TANGENT_BLOCK.
    constants : ndarray
        See `constants`.
    material, geometric : float
        Factors of the material stiffness, products of first derivatives of strains, and of the geometric one, stresses
        times second derivatives: 1 and 1 give the Hessian of the energy, τ and 0 the damping matrix.
    out : ndarray, shape (TANGENT_BUFFER,)
        Output, in the layout of `tangent_blocks`; nodal vectors r_I, r'_I, r_O, r'_O.
    """
    v, EA, EI = 1.0 / constants[0], constants[1] * constants[0], constants[2] * constants[0]
    axial, bending = int(constants[3]), int(constants[4])
    e = four_rows(q, first)
    clear_sums(out, 21)
    for p in range(axial):
        at = HEAD + p * AXIAL
        A, B, C, w = -constants[at], constants[at + 1], constants[at + 2], constants[at + 3]
        f, g = material * EA * w, geometric * EA * w
        for j in range(count):
            bx = B * e[2][j] + C * e[2][j + 1] + A * (e[0][j + 1] - e[0][j]) * v
            by = B * e[3][j] + C * e[3][j + 1] + A * (e[1][j + 1] - e[1][j]) * v
            S = axial_stiffness(bx, by, f, g)
            F = S[0], S[1], S[1], S[2]
            add_symmetric(out, UU, j, A * A, S)
            add_full(out, IU, j, B * A, F)
            add_symmetric(out, II, j, B * B, S)
            add_full(out, OU, j, C * A, F)
            add_full(out, OI, j, C * B, F)
            add_symmetric(out, OO, j, C * C, S)
    for p in range(bending):
        at = HEAD + axial * AXIAL + p * BENDING
        A, B, C = -constants[at], constants[at + 1], constants[at + 2]
        a, b, c = -constants[at + 3] * v, constants[at + 4] * v, constants[at + 5] * v
        m = EI * constants[at + 6]
        f, g = material * m, geometric * m
        for j in range(count):
            ux, uy = (e[0][j + 1] - e[0][j]) * v, (e[1][j + 1] - e[1][j]) * v
            bx, by = B * e[2][j] + C * e[2][j + 1] + A * ux, B * e[3][j] + C * e[3][j + 1] + A * uy
            cx, cy = b * e[2][j] + c * e[2][j + 1] + a * ux, b * e[3][j] + c * e[3][j + 1] + a * uy
            D = bending_stiffness(bx, by, cx, cy, f, g)
            add_symmetric(out, UU, j, 1.0, _twice(A, a, D))
            add_full(out, IU, j, 1.0, _both(B, b, A, a, D))
            add_symmetric(out, II, j, 1.0, _twice(B, b, D))
            add_full(out, OU, j, 1.0, _both(C, c, A, a, D))
            add_full(out, OI, j, 1.0, _both(C, c, B, b, D))
            add_symmetric(out, OO, j, 1.0, _twice(C, c, D))
    place(PLACES, v, count, out)


@inlined
def _twice(R, r, D):  # type: ignore[no-untyped-def]
    """Second derivative by a vector on which r' depends by R and r'' by r."""
    P, Q, S = D
    n, o, u = R * R, R * r, r * r
    return (
        n * P[0] + 2.0 * o * Q[0] + u * S[0],
        n * P[1] + o * (Q[1] + Q[2]) + u * S[1],
        n * P[2] + 2.0 * o * Q[3] + u * S[2],
    )


@inlined
def _both(R, r, C, c, D):  # type: ignore[no-untyped-def]
    """Second derivative by such a vector and another one, of C and c."""
    P, Q, S = D
    n, o, t, u = R * C, R * c, r * C, r * c
    return (
        n * P[0] + (o + t) * Q[0] + u * S[0],
        n * P[1] + o * Q[1] + t * Q[2] + u * S[1],
        n * P[1] + o * Q[2] + t * Q[1] + u * S[1],
        n * P[2] + (o + t) * Q[3] + u * S[2],
    )
