"""Andrews' squeezing mechanism: seven rigid bodies in three loops, driven by a moment against a spring.

Data and end values: Hairer & Wanner, Solving Ordinary Differential Equations II, section VII.7; Test Set for Initial
Value Problem Solvers, "Andrews' squeezing mechanism", computed there with a tolerance of 1e-14.
"""

from cmath import exp

import numpy as np
from numpy.typing import NDArray

from anctmm.model.connectors import Spring
from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.scene import Pin, Point, Scene, Torque

#: Angles at t = 0, rad.
START = {
    "beta": -0.0617138900142764496358948458001,
    "theta": 0.0,
    "gamma": 0.455279819163070380255912382449,
    "phi": 0.222668390165885884674473185609,
    "delta": 0.487364979543842550225598953530,
    "omega": -0.222668390165885884674473185609,
    "epsilon": 1.23054744454982119249735015568,
}
#: The same at t = 0.03 s.
PUBLISHED = {
    "beta": 15.81077119629904,
    "theta": -15.75637105984298,
    "gamma": 0.04082224013073101,
    "phi": -0.5347301163226948,
    "delta": 0.5244099658805304,
    "omega": 0.5347301163226948,
    "epsilon": 1.048080741042263,
}
#: Body and the body against which each angle is counted.
ANGLES = {
    "beta": ("K1", None),
    "theta": ("K2", "K1"),
    "gamma": ("K3", None),
    "phi": ("K4", "K5"),
    "delta": ("K5", None),
    "omega": ("K6", "K7"),
    "epsilon": ("K7", None),
}
A, B, C = -0.06934 - 0.00227j, -0.03635 + 0.03273j, 0.014 + 0.072j
D, DA, E, EA, RR, RA, SS, SA, SB, SC, SD = (
    28e-3, 115e-4, 2e-2, 1421e-5, 7e-3, 92e-5, 35e-3, 1874e-5, 1043e-5, 18e-3, 2e-2,
)  # fmt: skip
TA, TB, U, UA, UB, ZF, ZT, FA = 2308e-5, 916e-5, 4e-2, 1228e-5, 449e-5, 2e-2, 4e-2, 1421e-5
MASSES = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
INERTIAS = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
STIFFNESS, FREE, MOMENT = 4530.0, 0.07785, 0.033


def andrews_squeezer() -> Scene:
    """The mechanism at t = 0, at rest; bodies "K1" to "K7"."""
    q = START
    beta, gamma, delta, epsilon = (exp(1j * q[name]) for name in ("beta", "gamma", "delta", "epsilon"))
    rod, four, six = (
        exp(1j * (q[a] + q[b])) for a, b in (("beta", "theta"), ("phi", "delta"), ("omega", "epsilon"))
    )
    P = RR * beta
    F, D_, E_, H = P - D * rod, B + (SD - 1j * SC) * gamma, A + ZT * delta, A - 1j * U * epsilon
    centers = (
        RA * beta,
        P - DA * rod,
        B + (SB - 1j * SA) * gamma,
        E_ - 1j * (E - EA) * four,
        A + (TA + 1j * TB) * delta,
        H + (ZF - FA) * six,
        A + (UB - 1j * UA) * epsilon,
    )
    points = (
        {"o": 0j, "p": P},
        {"p": P, "f": F},
        {"b": B, "d": D_, "f": B - 1j * SS * gamma},
        {"e": E_, "f": E_ - 1j * E * four},
        {"a": A, "e": E_},
        {"h": H, "f": H + ZF * six},
        {"a": A, "h": H},
    )
    bodies = tuple(
        RigidBody(
            f"K{k + 1}", MASSES[k], INERTIAS[k], _xy(centers[k]), {n: _xy(z) for n, z in points[k].items()}
        )
        for k in range(7)
    )
    joints = (
        Pin("K1.o"), Pin("K3.b"), Pin("K5.a"), Pin("K7.a"), Pin("K1.p", "K2.p"), Pin("K4.e", "K5.e"),
        Pin("K6.h", "K7.h"), Pin("K2.f", "K3.f", "K4.f", "K6.f"),
    )  # fmt: skip
    spring = Spring("K3.d", _xy(C), stiffness=STIFFNESS, length=FREE)
    return Scene("Andrews' squeezer", bodies, joints, (Torque("K1.o", MOMENT),), connectors=(spring,))


def angles_of(turns: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """The seven angles, (n,), from the bodies' turns since t = 0, rad."""
    return {
        name: START[name] + turns[body] - (0.0 if base is None else turns[base])
        for name, (body, base) in ANGLES.items()
    }


def _xy(z: complex) -> Point:
    return z.real, z.imag
