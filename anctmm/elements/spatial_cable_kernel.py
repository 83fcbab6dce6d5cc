"""Compiled cable in space; the readable twin is `cable`, layouts are those of `force_blocks` and `tangent_blocks`.

With b = r', c = r'', s = b·b, d = b·c and e = c − (d/s) b, the part of c across b, the strains are ε = √s − 1 and
κ² = |b × c|²/s² = e·e/s, whose derivative by c is 2 e/s and by b is −2 (e·e b + d e)/s².
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.cable import CableElement
from anctmm.elements.force_blocks import BLOCK, clear_forces
from anctmm.elements.tangent_blocks import SUMS, TANGENT_BLOCK, lower
from anctmm.kernels.options import inlined

Array = NDArray[np.float64]

#: Where the points start among the constants, and how many numbers an axial and a bending point take.
HEAD, AXIAL, BENDING = 4, 5, 9


def constants(e: CableElement) -> Array:
    """What the kernels need of an element: EA, EI, numbers of axial and bending points, and the points.

    An axial point is B, with r' = Σ B_k q_k over the four nodal vectors, and the weight; a bending point B, C of r'',
    and the weight.
    """
    (Ba, wa), (Bb, Cb, wb) = e.axial_rule, e.bending_rule
    axial, bending = np.column_stack([Ba, wa]), np.column_stack([Bb, Cb, wb])
    return np.concatenate([[e.EA, e.EI, len(wa), len(wb)], axial.ravel(), bending.ravel()])


@inlined
def _sum(q, i, constants, at):  # type: ignore[no-untyped-def]
    """Σ B_k q_k over the nodal vectors of the element behind node i; B stands at `at`."""
    a, b, c, d = constants[at], constants[at + 1], constants[at + 2], constants[at + 3]
    return (
        a * q[0, i] + b * q[3, i] + c * q[0, i + 1] + d * q[3, i + 1],
        a * q[1, i] + b * q[4, i] + c * q[1, i + 1] + d * q[4, i + 1],
        a * q[2, i] + b * q[5, i] + c * q[2, i + 1] + d * q[5, i + 1],
    )


@inlined
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def _scaled(a, x, b, y):  # type: ignore[no-untyped-def]
    """a x + b y."""
    return a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]


@inlined
def _curvature(b, c):  # type: ignore[no-untyped-def]
    """s, d and e of the strains."""
    s, d = _dot(b, b), _dot(b, c)
    return s, d, _scaled(1.0, c, -d / s, b)


@inlined
def _push(out, j, constants, at, force):  # type: ignore[no-untyped-def]
    """Add B_k times a force to the nodal vectors k of element j."""
    for n in range(3):
        out[n * BLOCK + j] += constants[at] * force[n]
        out[(3 + n) * BLOCK + j] += constants[at + 1] * force[n]
        out[(6 + n) * BLOCK + j] += constants[at + 2] * force[n]
        out[(9 + n) * BLOCK + j] += constants[at + 3] * force[n]


def forces(q: Array, first: int, count: int, constants: Array, out: Array) -> None:
    """Elastic forces of a block of elements on their nodes.

    Parameters
    ----------
    q : ndarray, shape (≥ 6, nodes)
    first, count : int
        First node of the block, number of its elements, at most BLOCK.
    constants : ndarray
        See `constants`.
    out : ndarray, shape (12 * BLOCK,)
        Output, in the layout of `force_blocks`.
    """
    EA, EI, axial, bending = constants[0], constants[1], int(constants[2]), int(constants[3])
    clear_forces(out, 6, count)
    for j in range(count):
        for p in range(axial):
            at = HEAD + p * AXIAL
            b = _sum(q, first + j, constants, at)
            n = EA * constants[at + 4] * (1.0 - 1.0 / sqrt(_dot(b, b)))
            _push(out, j, constants, at, (n * b[0], n * b[1], n * b[2]))
        for p in range(bending):
            at = HEAD + axial * AXIAL + p * BENDING
            b, c = _sum(q, first + j, constants, at), _sum(q, first + j, constants, at + 4)
            s, d, e = _curvature(b, c)
            m = EI * constants[at + 8] / s
            _push(out, j, constants, at, _scaled(-m * _dot(e, e) / s, b, -m * d / s, e))
            _push(out, j, constants, at + 4, (m * e[0], m * e[1], m * e[2]))


def energy(q: Array, first: int, count: int, constants: Array) -> float:
    """Strain energy of a row of elements, J."""
    EA, EI, axial, bending = constants[0], constants[1], int(constants[2]), int(constants[3])
    total = 0.0
    for i in range(first, first + count):
        for p in range(axial):
            at = HEAD + p * AXIAL
            b = _sum(q, i, constants, at)
            strain = sqrt(_dot(b, b)) - 1.0
            total += 0.5 * EA * constants[at + 4] * strain * strain
        for p in range(bending):
            at = HEAD + axial * AXIAL + p * BENDING
            s, _, e = _curvature(_sum(q, i, constants, at), _sum(q, i, constants, at + 4))
            total += 0.5 * EI * constants[at + 8] * _dot(e, e) / s
    return total


def tangents(
    q: Array, first: int, count: int, constants: Array, material: float, geometric: float, out: Array
) -> None:
    """Stiffness of a block of elements; parameters as of `forces`.

    material, geometric : float
        As in `cable_kernel.tangents`; equal, as such elements have no damping.
    out : ndarray, shape (TANGENT_BUFFER,)
        Output, in the layout of `tangent_blocks`; nodal vectors r_I, r'_I, r_O, r'_O.
    """
    EA, EI = geometric * constants[0], geometric * constants[1]
    axial, bending = int(constants[2]), int(constants[3])
    for k in range(SUMS * TANGENT_BLOCK):
        out[k] = 0.0
    for j in range(count):
        for p in range(axial):
            at = HEAD + p * AXIAL
            b = _sum(q, first + j, constants, at)
            s = _dot(b, b)
            n = EA * constants[at + 4] * (1.0 - 1.0 / sqrt(s))
            m = EA * constants[at + 4] / (s * sqrt(s))
            for x in range(3):
                for y in range(3):
                    h = m * b[x] * b[y] + (n if x == y else 0.0)
                    _add(out, j, constants, at, at, x, y, h)
        for p in range(bending):
            at = HEAD + axial * AXIAL + p * BENDING
            b, c = _sum(q, first + j, constants, at), _sum(q, first + j, constants, at + 4)
            _add_bending(out, j, constants, at, b, c, EI * constants[at + 8])


@inlined
def _add_bending(out, j, constants, at, b, c, m):  # type: ignore[no-untyped-def]
    """Add the second derivatives of ½ m κ² by b = r' and c = r''.

    With κ² = p/s − d²/s², p = c·c, written by e: p = e·e + d²/s.
    """
    s, d, e = _curvature(b, c)
    n, r = _dot(e, e), d / s
    f = m / s
    for x in range(3):
        for y in range(3):
            one = 1.0 if x == y else 0.0
            bb = f * ((4.0 * n * b[x] * b[y] / s - n * one) / s - e[x] * e[y] / s)
            bb += f * (3.0 * r * (b[x] * e[y] + e[x] * b[y]) / s + r * r * (one - b[x] * b[y] / s))
            bc = -f * (2.0 * b[x] * e[y] / s + e[x] * b[y] / s + r * (one - b[x] * b[y] / s))
            cc = f * (one - b[x] * b[y] / s)
            _add(out, j, constants, at, at, x, y, bb)
            _add(out, j, constants, at, at + 4, x, y, bc)
            _add(out, j, constants, at + 4, at, y, x, bc)
            _add(out, j, constants, at + 4, at + 4, x, y, cc)


@inlined
def _add(out, j, constants, one, two, x, y, h):  # type: ignore[no-untyped-def]
    """Add h B_k B_m to entries (x of vector k, y of vector m), B_k at `one`, B_m at `two`, in the lower triangle."""
    for k in range(4):
        for m in range(k + 1):
            if k > m or x >= y:
                out[lower(3 * k + x, 3 * m + y) + j] += h * constants[one + k] * constants[two + m]
