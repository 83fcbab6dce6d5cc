"""Natural frequencies of straight beams: Euler-Bernoulli and Timoshenko bending, axial vibration.

All are angular frequencies in rad/s, ascending; the rigid modes of free beams, at zero, are left out.
"""

from math import cos, cosh, pi, sqrt, tan, tanh

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import brentq

from anctmm.errors import UnknownOptionError
from anctmm.validation import one_of, positive
from reference.exact.legendre import gauss

Array = NDArray[np.float64]

#: Coordinates (w, φ) an end holds.
HELD = {"clamped": (0, 1), "pinned": (0,), "free": ()}
BENDING = ("clamped-clamped", "clamped-free", "clamped-pinned", "free-free", "pinned-pinned")
AXIAL = ("clamped-clamped", "clamped-free", "free-free")
#: Degree of polynomials, to which four are added for each frequency.
DEGREE = 16


def euler_bernoulli_frequencies(
    ends: str, count: int, length: float, bending: float, mass_per_length: float
) -> Array:
    """Bending frequencies ω_k = (βL)_k² √(EI/ρA)/L², (count,), rad/s.

    Parameters
    ----------
    ends : str
        "clamped-clamped", "clamped-free", "clamped-pinned", "free-free" or "pinned-pinned".
    count : int
        How many.
    length : float
        m.
    bending : float
        EI, N m².
    mass_per_length : float
        ρA, kg/m.

    References
    ----------
    Weaver, Timoshenko & Young 1990, "Vibration Problems in Engineering", section 5.
    """
    one_of("ends", ends, BENDING)
    scale = _scale(length, bending, mass_per_length)
    return scale * np.array([_wave_number(ends, k) ** 2 for k in range(1, _count(count) + 1)])


def _wave_number(ends: str, k: int) -> float:
    """k-th root (βL)_k > 0 of the frequency equation, scaled so that it does not overflow."""
    if ends == "pinned-pinned":
        return k * pi
    if ends == "clamped-free":
        return brentq(lambda x: cos(x) + 1.0 / cosh(x), (k - 1) * pi, k * pi, xtol=1e-15, rtol=1e-15)
    if ends == "clamped-pinned":
        return brentq(lambda x: tan(x) - tanh(x), k * pi, (k + 0.49) * pi, xtol=1e-15, rtol=1e-15)
    return brentq(lambda x: cos(x) - 1.0 / cosh(x), k * pi, (k + 1) * pi, xtol=1e-15, rtol=1e-15)


def axial_frequencies(ends: str, count: int, length: float, axial: float, mass_per_length: float) -> Array:
    """Axial frequencies k π c/L, or (k − ½) π c/L with one end clamped, c = √(EA/ρA), (count,), rad/s.

    Parameters
    ----------
    ends : str
        "clamped-clamped", "clamped-free" or "free-free".
    count : int
        How many.
    length : float
        m.
    axial : float
        EA, N.
    mass_per_length : float
        ρA, kg/m.
    """
    one_of("ends", ends, AXIAL)
    speed = sqrt(positive("axial (N)", axial) / positive("mass_per_length (kg/m)", mass_per_length))
    waves = np.arange(1, _count(count) + 1) - (0.5 if ends == "clamped-free" else 0.0)
    return np.asarray(waves * pi * speed / positive("length (m)", length))


def timoshenko_frequencies(
    ends: str,
    count: int,
    length: float,
    bending: float,
    shear: float,
    mass_per_length: float,
    rotary_inertia: float,
) -> Array:
    """Bending frequencies of a Timoshenko beam, (count,), rad/s, both spectra in their order.

    Parameters
    ----------
    ends : str
        "clamped-clamped", "clamped-free", "clamped-pinned", "free-free" or "pinned-pinned".
    count : int
        How many.
    length : float
        m.
    bending : float
        EI, N m².
    shear : float
        Shear factor times GA, N.
    mass_per_length : float
        ρA, kg/m.
    rotary_inertia : float
        ρI, kg m.

    Notes
    -----
    By Ritz's method in polynomials of a high degree, of lengths of L and ω = b √(EI/ρA)/L² with S = EI/(GA L²) and
    R = ρI/(ρA L²): ∫ φ'² + (w' − φ)²/S = b² ∫ w² + R φ².
    """
    one_of("ends", ends, BENDING)
    scale = _scale(length, bending, mass_per_length)
    S = bending / (positive("shear (N)", shear) * length**2)
    R = positive("rotary_inertia (kg m)", rotary_inertia) / (mass_per_length * length**2)
    rigid, degree = (2 if ends == "free-free" else 0), DEGREE + 4 * _count(count)
    x, weights = gauss(degree + 2)
    first, last = (HELD[end] for end in ends.split("-"))
    (w, slope), (phi, bend) = (_polynomials(x, degree, k in first, k in last) for k in (0, 1))
    zero = np.zeros_like
    strains = np.vstack([np.hstack([zero(w), bend]), np.hstack([slope, -phi]) / sqrt(S)])
    motions = np.vstack([np.hstack([w, zero(phi)]), sqrt(R) * np.hstack([zero(w), phi])])
    both = np.tile(weights, 2)[:, None]
    values = eigh(strains.T @ (both * strains), motions.T @ (both * motions), eigvals_only=True)
    return np.asarray(scale * np.sqrt(values[rigid : rigid + count]))


def _polynomials(x: Array, degree: int, first: bool, last: bool) -> tuple[Array, Array]:
    """Polynomials that vanish at the ends that are held, and their derivatives, at points, (points, degree + 1)."""
    bubble = Polynomial([0.0, 1.0]) ** int(first) * Polynomial([1.0, -1.0]) ** int(last)
    series = [Legendre.basis(k, domain=[0.0, 1.0]) for k in range(degree + 1)]
    values = [bubble(x) * p(x) for p in series]
    slopes = [bubble(x) * p.deriv()(x) + bubble.deriv()(x) * p(x) for p in series]
    return np.array(values).T, np.array(slopes).T


def _scale(length: float, bending: float, mass_per_length: float) -> float:
    """√(EI/ρA)/L², rad/s."""
    ratio = positive("bending (N m²)", bending) / positive("mass_per_length (kg/m)", mass_per_length)
    return sqrt(ratio) / positive("length (m)", length) ** 2


def _count(count: int) -> int:
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise UnknownOptionError(f"count is {count!r}; a whole number from 1 on is needed")
    return int(count)
