"""Natural frequencies of straight beams: Euler-Bernoulli bending and axial vibration.

All are angular frequencies in rad/s, ascending; the rigid modes of free beams, at zero, are left out.
"""

from math import cos, cosh, pi, sqrt, tan, tanh

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from anctmm.errors import UnknownOptionError
from anctmm.validation import one_of, positive

Array = NDArray[np.float64]

BENDING = ("clamped-clamped", "clamped-free", "clamped-pinned", "free-free", "pinned-pinned")
AXIAL = ("clamped-clamped", "clamped-free", "free-free")


def euler_bernoulli_frequencies(
    ends: str, count: int, length: float, bending: float, mass_per_length: float
) -> Array:
    """Bending frequencies ω_k = (βL)_k² √(EI/ρA)/L², (count,), rad/s, of EI (N m²) and ρA (kg/m).

    `ends` is "clamped-clamped", "clamped-free", "clamped-pinned", "free-free" or "pinned-pinned" (Weaver, Timoshenko &
    Young 1990, "Vibration Problems in Engineering", section 5).
    """
    one_of("ends", ends, BENDING)
    ratio = positive("bending (N m²)", bending) / positive("mass_per_length (kg/m)", mass_per_length)
    scale = sqrt(ratio) / positive("length (m)", length) ** 2
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

    `ends` is "clamped-clamped", "clamped-free" or "free-free", `axial` EA, N, and `mass_per_length` ρA, kg/m.
    """
    one_of("ends", ends, AXIAL)
    speed = sqrt(positive("axial (N)", axial) / positive("mass_per_length (kg/m)", mass_per_length))
    waves = np.arange(1, _count(count) + 1) - (0.5 if ends == "clamped-free" else 0.0)
    return np.asarray(waves * pi * speed / positive("length (m)", length))


def _count(count: int) -> int:
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise UnknownOptionError(f"count is {count!r}; a whole number from 1 on is needed")
    return int(count)
