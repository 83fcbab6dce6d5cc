"""Closed forms of the static cantilever: arc, inextensible elastica, linear beam, Poisson locking."""

from math import asin, cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipkinc, ellipkm1

from anctmm.validation import number, positive, within

Array = NDArray[np.float64]


def moment_arc(length: float, bending: float, moment: float, fraction: float) -> Array:
    """Position on a cantilever along x under an end moment, (2,), m.

    There is no force, so neither stretch nor shear: a circle of curvature M/EI, for every rod model here.
    """
    turn = positive("length (m)", length) * number("moment (N m)", moment)
    turn /= positive("bending (N m²)", bending)
    half = 0.5 * turn * fraction
    chord = length * fraction * float(np.sinc(half / pi))
    return chord * np.array([cos(half), sin(half)])


def inextensible_tip(load: float) -> tuple[float, float, float]:
    """Tip of Euler's elastica as a cantilever under a force across it, by elliptic integrals.

    Parameters
    ----------
    load : float
        PL²/EI, in (0, 200].

    Returns
    -------
    x, y, angle : float
        Tip's coordinates along and across the undeformed rod, of its length, and slope, rad.

    References
    ----------
    Bisshopp & Drucker 1945, "Large deflection of cantilever beams", Quart. Appl. Math. 3, 272-275.
    """
    root = sqrt(within("load PL²/EI", load, 0.0, 200.0, "(]"))

    def excess(steepness: float) -> float:
        m = cos(0.5 * steepness) ** 2
        return ellipkm1(sin(0.5 * steepness) ** 2) - ellipkinc(asin(sqrt(0.5 / m)), m) - root

    # The slope is counted from the force's direction, where it would cancel in 1 − sin(slope).
    steepness = brentq(excess, 1e-7, 0.5 * pi, xtol=1e-16, rtol=1e-15)
    m = cos(0.5 * steepness) ** 2
    rise = 1.0 - 2.0 / root * (ellipe(m) - ellipeinc(asin(sqrt(0.5 / m)), m))
    return sqrt(2.0 * cos(steepness)) / root, float(rise), 0.5 * pi - steepness


def timoshenko_tip_deflection(length: float, force: float, bending: float, shear: float) -> float:
    """Linear deflection under a force at the tip, PL³/3EI + PL/GA, m.

    Parameters
    ----------
    length : float
        m.
    force : float
        N.
    bending : float
        EI, N m².
    shear : float
        Shear factor times GA, N; infinite for Euler-Bernoulli's.
    """
    return force * length**3 / (3.0 * bending) + force * length / shear


def poisson_locking_factor(poisson: float) -> float:
    """Bending stiffness of the paper's shear-deformable element over EI, (1 − ν)/((1 + ν)(1 − 2ν)).

    ε_yy is constant over the section and cannot follow the −ν ε_xx of bending, so λ + 2G acts in E's place.
    No mesh cures it.
    """
    nu = within("poisson", poisson, 0.0, 0.5, "[)")
    return (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
