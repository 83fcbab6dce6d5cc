"""Strains of a thin beam at a point of its axis, ε = |r'| − 1 and κ = (r' × r'')/|r'|², and their derivatives.

For kernels of every element whose axis has them: an element says what r' and r'' are, and how they depend on its
coordinates. Arguments: b = r', c = r''; g and h: rates of these.
"""

from math import sqrt

from anctmm.kernels.options import inlined


@inlined
def axial_force(bx, by, n):  # type: ignore[no-untyped-def]
    """Derivative of ½ n ε² by r'."""
    n = n * (1.0 - 1.0 / sqrt(bx * bx + by * by))
    return n * bx, n * by


@inlined
def axial_damping(bx, by, gx, gy, n):  # type: ignore[no-untyped-def]
    """n ε̇ times the derivative of ε by r'."""
    n = n * (bx * gx + by * gy) / (bx * bx + by * by)
    return n * bx, n * by


@inlined
def curvature_of(bx, by, cx, cy):  # type: ignore[no-untyped-def]
    """κ, and s, u with s u its derivative by r'; that by r'' is s (−b_y, b_x)."""
    s = 1.0 / (bx * bx + by * by)
    curvature = (bx * cy - by * cx) * s
    return curvature, s, cy - 2.0 * curvature * bx, -(cx + 2.0 * curvature * by)


@inlined
def bending_moment(bx, by, cx, cy, m):  # type: ignore[no-untyped-def]
    """Derivatives of ½ m κ²: by r', and by r''."""
    curvature, s, ux, uy = curvature_of(bx, by, cx, cy)
    m = m * curvature * s
    return m * ux, m * uy, -m * by, m * bx


@inlined
def bending_damping(bx, by, cx, cy, gx, gy, hx, hy, m):  # type: ignore[no-untyped-def]
    """m κ̇ times the derivatives of κ by r' and r''."""
    _, s, ux, uy = curvature_of(bx, by, cx, cy)
    m = m * (ux * gx + uy * gy - by * hx + bx * hy) * s * s
    return m * ux, m * uy, -m * by, m * bx


@inlined
def axial_stiffness(bx, by, f, g):  # type: ignore[no-untyped-def]
    """f ∂ε ∂ε + g ε ∂²ε by r', (xx, xy, yy): with f = g the second derivative of ½ f ε²."""
    s = 1.0 / (bx * bx + by * by)
    n = g - g * sqrt(s)
    m = (f - n) * s
    return n + m * bx * bx, m * bx * by, n + m * by * by


@inlined
def bending_stiffness(bx, by, cx, cy, f, g):  # type: ignore[no-untyped-def]
    """f ∂κ ∂κ + g κ ∂²κ: by r' twice, (xx, xy, yy); by r' and r'', (xx, xy, yx, yy); by r'' twice, (xx, xy, yy)."""
    curvature, s, ux, uy = curvature_of(bx, by, cx, cy)
    # gradient of κ by r', g, and by r'', h; κ is linear in r''
    gx, gy = ux * s, uy * s
    hx, hy = -by * s, bx * s
    m = g * curvature
    n = 2.0 * m * s
    return (
        (
            f * gx * gx - n * (2.0 * bx * gx + curvature),
            f * gx * gy - n * (bx * gy + by * gx),
            f * gy * gy - n * (2.0 * by * gy + curvature),
        ),
        (
            f * gx * hx - n * bx * hx,
            f * gx * hy + m * s - n * bx * hy,
            f * gy * hx - m * s - n * by * hx,
            f * gy * hy - n * by * hy,
        ),
        (f * hx * hx, f * hx * hy, f * hy * hy),
    )
