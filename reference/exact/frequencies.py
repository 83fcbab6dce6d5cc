"""Natural frequencies of straight beams: Euler-Bernoulli and Timoshenko bending, axial vibration.

All are angular frequencies in rad/s, ascending; the rigid modes of free beams, at zero, are left out.
"""

from math import ceil, cos, cosh, pi, sqrt, tan, tanh

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from anctmm.errors import UnknownOptionError
from anctmm.validation import one_of, positive

Array = NDArray[np.float64]

#: Coordinates (w, φ) an end holds.
HELD = {"clamped": (0, 1), "pinned": (0,), "free": ()}
BENDING = ("clamped-clamped", "clamped-free", "clamped-pinned", "free-free", "pinned-pinned")
AXIAL = ("clamped-clamped", "clamped-free", "free-free")


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
    The number of frequencies below a trial ω is the number of negative eigenvalues of the exact dynamic stiffness
    matrix, the beam being cut into elements too short to vibrate by themselves (Wittrick & Williams 1971,
    DOI 10.1093/qjmam/24.3.263). Bisection of that number misses no frequency, also not above the shear cut-off or
    where two coincide, as a search for the roots of a determinant may. In lengths of L and ω = b √(EI/ρA)/L²,
    with S = EI/(GA L²) and R = ρI/(ρA L²), the waves e^{ps} have p⁴ + b²(S + R) p² − b²(1 − b²RS) = 0
    (Timoshenko 1921).
    """
    one_of("ends", ends, BENDING)
    scale = _scale(length, bending, mass_per_length)
    S = bending / (positive("shear (N)", shear) * length**2)
    R = positive("rotary_inertia (kg m)", rotary_inertia) / (mass_per_length * length**2)
    rigid = 2 if ends == "free-free" else 0
    return scale * np.array([_bisect(ends, k + rigid, S, R) for k in range(1, _count(count) + 1)])


def _bisect(ends: str, k: int, S: float, R: float) -> float:
    """The dimensionless frequency below which there are k − 1 others, to rounding."""
    low, high = 0.0, 1.0
    while _below(ends, high, S, R) < k:
        low, high = high, 2.0 * high
    while high - low > 4e-16 * high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if _below(ends, middle, S, R) < k else (low, middle)
    return 0.5 * (low + high)


def _below(ends: str, b: float, S: float, R: float) -> int:
    """Number of frequencies below b: negative eigenvalues of the assembled dynamic stiffness."""
    n = _elements(b, S, R)
    element = _dynamic_stiffness(b, S, R, 1.0 / n)
    K = np.zeros((2 * n + 2, 2 * n + 2))
    for e in range(n):
        K[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += element
    first, last = ends.split("-")
    K = np.delete(K, [*HELD[first], *(2 * n + i for i in HELD[last])], axis=0)
    K = np.delete(K, [*HELD[first], *(2 * n + i for i in HELD[last])], axis=1)
    return int((np.linalg.eigvalsh(K) < 0.0).sum()) if K.size else 0


def _elements(b: float, S: float, R: float) -> int:
    """Number of elements that have no frequency up to b with both their ends clamped.

    With ‖φ‖ ≤ l/π ‖φ'‖ and ‖w‖ ≤ l/π (‖w' − φ‖ + ‖φ‖), Rayleigh's quotient is at least
    1/max(2 S q, 2 q² + R q) at q = (l/π)².
    """
    q = min(0.5 / (S * b**2), 2.0 / (b**2 * (R + sqrt(R**2 + 8.0 / b**2))))
    return max(2, ceil(1.01 / (pi * sqrt(q))))


def _dynamic_stiffness(b: float, S: float, R: float, l: float) -> Array:  # noqa: E741
    """Exact stiffness of one element at the frequency b, by (w, φ) of its ends, (4, 4).

    The four waves are taken even and odd about the middle, and in combinations that stay independent where
    the second kind turns from evanescent to travelling, at b²RS = 1.
    """
    travelling = -0.5 * (b**2 * (S + R) + sqrt(b**4 * (S - R) ** 2 + 4.0 * b**2))
    other = -(b**2) * (1.0 - b**2 * R * S) / travelling
    even, odd = [], []
    for p2 in (travelling, other):
        c, s = _cosh_sinh(p2, 0.5 * l)
        g = p2 + b**2 * S
        # w, φ, M = φ', Q = (w' − φ)/S at the right end; w' − φ = −b² S ∫w
        even.append((c, g * s, g * c, -(b**2) * s))
        odd.append((p2 * s, g * c, g * p2 * s, -(b**2) * c))
    return _assemble(np.array(even).T, np.array(odd).T)


def _cosh_sinh(p2: float, t: float) -> tuple[float, float]:
    """Cosh pt and (sinh pt)/p, up to a common factor, for p² of either sign."""
    p = sqrt(abs(p2))
    if p2 > 0.0:
        return 1.0, tanh(p * t) / p
    return cos(p * t), t * float(np.sinc(p * t / pi))


def _assemble(even: Array, odd: Array) -> Array:
    """Stiffness from (w, φ, M, Q) at the right end of two even and two odd waves.

    An even w has an odd φ: at the left end w and M are the same, φ and Q opposite; forces on the element are
    (−Q, −M) at the left and (Q, M) at the right end.
    """
    same, opposite = (np.array([waves[3], waves[2]]) @ np.linalg.inv(waves[:2]) for waves in (even, odd))
    mirror = np.diag([1.0, -1.0])
    total, difference = 0.5 * (same + opposite), 0.5 * (same - opposite)
    return np.block([[mirror @ total @ mirror, mirror @ difference], [difference @ mirror, total]])


def _scale(length: float, bending: float, mass_per_length: float) -> float:
    """√(EI/ρA)/L², rad/s."""
    ratio = positive("bending (N m²)", bending) / positive("mass_per_length (kg/m)", mass_per_length)
    return sqrt(ratio) / positive("length (m)", length) ** 2


def _count(count: int) -> int:
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise UnknownOptionError(f"count is {count!r}; a whole number from 1 on is needed")
    return int(count)
