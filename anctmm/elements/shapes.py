"""Shape functions and their exact integrals, shared by the elements (anctmm/elimination/method.md, section 1).

An element of length l has nodes I and O; ξ = x/l. Its coordinates are the rows of q, each a vector in the plane.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def hermite(xi: ArrayLike, l: float, order: int = 0) -> Array:  # noqa: E741
    """Cubic Hermite functions of [r_I, r'_I, r_O, r'_O], or a derivative with respect to x.

    Parameters
    ----------
    xi : array_like, shape (m,)
    l : float
        Element length, m.
    order : int
        Of the derivative: 0, 1 or 2.

    Returns
    -------
    ndarray, shape (m, 4)
        S1, l S2, S4, l S5 of Rong 2014, eq. 3 (S5 corrected: −ξ² + ξ³), or their derivatives.
    """
    x = np.atleast_1d(np.asarray(xi, dtype=float))
    if order == 0:
        rows = [1 - 3 * x**2 + 2 * x**3, l * (x - 2 * x**2 + x**3), 3 * x**2 - 2 * x**3, l * (x**3 - x**2)]
    elif order == 1:
        rows = [6 * (x**2 - x) / l, 1 - 4 * x + 3 * x**2, 6 * (x - x**2) / l, 3 * x**2 - 2 * x]
    else:
        rows = [(12 * x - 6) / l**2, (6 * x - 4) / l, (6 - 12 * x) / l**2, (6 * x - 2) / l]
    return np.stack(rows, axis=-1)


#: Coefficients, (degree, function), of functions of ξ: each is 1 in its value, first or second derivative at 0 or 1.
QUINTIC = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
        [-10.0, -6.0, -1.5, 10.0, -4.0, 0.5],
        [15.0, 8.0, 1.5, -15.0, 7.0, -1.0],
        [-6.0, -3.0, -0.5, 6.0, -3.0, 0.5],
    ]
)


def quintic(xi: ArrayLike, l: float, order: int = 0) -> Array:  # noqa: E741
    """Quintic Hermite functions of [r_I, r'_I, l r''_I, r_O, r'_O, l r''_O], or a derivative with respect to x.

    Parameters
    ----------
    xi : array_like, shape (m,)
    l : float
        Element length, m.
    order : int
        Of the derivative: 0 to 5.

    Returns
    -------
    ndarray, shape (m, 6)
    """
    x = np.atleast_1d(np.asarray(xi, dtype=float))
    coefficients = np.polynomial.polynomial.polyder(QUINTIC, order) / l**order
    return np.polynomial.polynomial.polyval(x, coefficients).T * _scales(l)


def _scales(l: float) -> Array:  # noqa: E741
    """What a unit of each coordinate is in a function of ξ."""
    return np.array([1.0, l, l, 1.0, l, l])


def quintic_mass(l: float) -> Array:  # noqa: E741
    """∫ N N^T dx of the quintic Hermite functions, (6, 6)."""
    degree = np.arange(6)
    moments = 1.0 / (degree[:, None] + degree + 1.0)
    scales = _scales(l)
    return l * (QUINTIC.T @ moments @ QUINTIC) * np.outer(scales, scales)  # type: ignore[no-any-return]


def quintic_load(l: float) -> Array:  # noqa: E741
    """∫ N dx of the quintic Hermite functions, (6,)."""
    return np.array([l / 2, l**2 / 10, l**2 / 120, l / 2, -(l**2) / 10, l**2 / 120])


@lru_cache
def gauss(points: int) -> tuple[Array, Array]:
    """Gauss points and weights on [0, 1], exact for polynomials of degree 2·points − 1."""
    x, w = np.polynomial.legendre.leggauss(points)
    return 0.5 * (x + 1.0), 0.5 * w


@lru_cache
def lobatto(points: int) -> tuple[Array, Array]:
    """Lobatto points and weights on [0, 1], both ends included, exact to degree 2·points − 3."""
    inner = np.polynomial.legendre.Legendre.basis(points - 1)
    x = np.concatenate([[-1.0], np.sort(inner.deriv().roots()), [1.0]])
    w = 2.0 / (points * (points - 1) * inner(x) ** 2)
    return 0.5 * (x + 1.0), 0.5 * w


#: 420 ∫ N N^T dx of the Hermite functions of an element of length 1.
_HERMITE_MASS = np.array(
    [
        [156.0, 22.0, 54.0, -13.0],
        [22.0, 4.0, 13.0, -3.0],
        [54.0, 13.0, 156.0, -22.0],
        [-13.0, -3.0, -22.0, 4.0],
    ]
)


def hermite_mass(l: float) -> Array:  # noqa: E741
    """∫ N N^T dx of the Hermite functions, (4, 4)."""
    scales = np.array([1.0, l, 1.0, l])
    return _HERMITE_MASS * (scales[:, None] * scales) * l / 420.0  # type: ignore[no-any-return]


def hermite_load(l: float) -> Array:  # noqa: E741
    """∫ N dx of the Hermite functions, (4,)."""
    return np.array([l / 2, l**2 / 12, l / 2, -(l**2) / 12])
