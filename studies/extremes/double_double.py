"""Sums of products to twice the digits of a number: pairs of numbers whose sum is meant (Dekker 1971)."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: A high part and a low one, each an array.
Double = tuple[Array, Array]
#: Splits a number of 53 bits into two of 26.
SPLITTER = 2.0**27 + 1.0


def two_sum(a: Array, b: Array) -> Double:
    """a + b without error (Knuth)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def two_product(a: float | Array, b: Array) -> Double:
    """a · b without error, where it does not overflow (Dekker, Veltkamp)."""
    p = a * b
    a_high, a_low = _halves(np.asarray(a))
    b_high, b_low = _halves(b)
    return p, a_low * b_low - (((p - a_high * b_high) - a_low * b_high) - a_high * b_low)


def plus(x: Double, y: Array) -> Double:
    """x + y."""
    s, e = two_sum(x[0], y)
    return _renormalised(s, e + x[1])


def minus_products(x: Double, factor: float, y: Double) -> Double:
    """x − factor · y."""
    p, e = two_product(-factor, y[0])
    s, f = two_sum(x[0], p)
    return _renormalised(s, f + (x[1] + (e - factor * y[1])))


def _halves(a: Array) -> Double:
    t = SPLITTER * a
    high = t - (t - a)
    return high, a - high


def _renormalised(high: Array, low: Array) -> Double:
    s = high + low
    return s, low - (s - high)
