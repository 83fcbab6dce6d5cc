"""Legendre polynomials on [0, 1]: nodes, series and integration, all accurate to rounding."""

import numpy as np
from numpy.polynomial import Legendre
from numpy.polynomial.legendre import leggauss, legint, legvander
from numpy.typing import NDArray

Array = NDArray[np.float64]


def gauss(n: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss-Legendre quadrature on [0, 1], exact to degree 2n − 1."""
    x, w = leggauss(n)
    return 0.5 * (1.0 + x), 0.5 * w


def analysis(n: int) -> Array:
    """Matrix from the values at the n Gauss nodes to the Legendre coefficients of their interpolant."""
    x, w = leggauss(n)
    return (np.arange(n) + 0.5)[:, None] * legvander(x, n - 1).T * w


def integration(n: int) -> Array:
    """Matrix from the values at the n Gauss nodes to the integrals from 0 to those nodes.

    Exact for polynomials of degree n − 1. Unlike a differentiation matrix it does not amplify rounding.
    """
    x, _ = leggauss(n)
    return legvander(x, n) @ legint(np.eye(n), lbnd=-1, scl=0.5) @ analysis(n)


def interpolant(values: Array) -> Legendre:
    """Polynomial on [0, 1] through values at the Gauss nodes."""
    return Legendre(analysis(len(values)) @ values, domain=[0.0, 1.0])


def tail(series: Legendre) -> float:
    """Largest of the last four coefficients: what the truncation has left out, to order of magnitude."""
    return float(np.abs(series.coef[-4:]).max())
