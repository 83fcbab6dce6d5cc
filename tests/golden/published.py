"""Published and exact numbers: the answer here, and whether it is the published one to the digits given."""

from cmath import exp
from typing import Any

import numpy as np

import anctmm as at
from tests.golden.answers import Answer, Answers, group
from tests.golden.scenes import A
from tests.golden.vary import Variation

#: Angles of Andrews' squeezer at t = 0 and 0.03 s, rad (IVP test set, tolerance 1e-14), and what they are counted of.
START = {
    "beta": -0.0617138900142764496358948458001, "theta": 0.0, "gamma": 0.455279819163070380255912382449,
    "phi": 0.222668390165885884674473185609, "delta": 0.487364979543842550225598953530,
    "omega": -0.222668390165885884674473185609, "epsilon": 1.23054744454982119249735015568,
}  # fmt: skip
SQUEEZED = {
    "beta": 15.81077119629904, "theta": -15.75637105984298, "gamma": 0.04082224013073101,
    "phi": -0.5347301163226948, "delta": 0.5244099658805304, "omega": 0.5347301163226948,
    "epsilon": 1.048080741042263,
}  # fmt: skip
COUNTED = {
    "beta": "K1",
    "theta": "K2-K1",
    "gamma": "K3",
    "phi": "K4-K5",
    "delta": "K5",
    "omega": "K6-K7",
    "epsilon": "K7",
}


def digits(value: Any, published: Any, within: float, allowed: float | None = None) -> Answers:
    """An answer, and whether it is published so."""
    close = np.abs(np.asarray(value) - np.asarray(published)).max() <= within
    return {"value": Answer(value, allowed=allowed), "as published": str(bool(close))}


def cantilever(section: Any, material: Any, length: float, *loads: Any, stretch: str = "held") -> at.Scene:
    """A clamped beam along x."""
    bar = at.Beam("bar", A, (length, 0.0), section, material)
    return at.Scene("cantilever", [bar], [at.Clamp("bar.start", stretch=stretch)], loads)


@group(name="elastica, four cables", mesh=4, tip=(-0.50742872, -1.20553370), off=1e-8)
@group(name="elastica", mesh=32, tip=(-0.508537304326, -1.207239854550), off=2e-6)
def elastica(v: Variation, mesh: int, tip: Any, off: float) -> Answers:
    """F L²/EI = 3; Exudyn's ANCFcantileverTest and the extensible elastica."""
    section, steel = at.Rectangle(0.1, 0.1), at.Material(2.07e11, 7850.0)
    load = at.Force("bar.end", (0.0, -3.0 * steel.E * section.second_moment / 4.0))
    s = v.static(cantilever(section, steel, 2.0, load, stretch="free"), mesh=mesh, load_steps=4)
    return digits(s.displacement("bar.end")[-1], tip, off)


@group(name="roll-up to a circle")
def roll_up(v: Variation) -> Answers:
    """An end moment of 2π EI/L: the tip comes back to the clamp."""
    section, material = at.Rectangle(0.01, 0.01), at.Material(1e7, 1000.0)
    moment = at.Torque("bar.end", 2.0 * np.pi * material.E * section.second_moment)
    s = v.static(cantilever(section, material, 1.0, moment), mesh=16, load_steps=16)
    return digits(s.displacement("bar.end")[-1], (-1.0, 0.0), 2e-4) | {"angle": s.angle("bar.end")[-1]}


@group(name="inextensible elastica")
def inextensible(v: Variation) -> Answers:
    """P L²/EI = 10 of a nearly inextensible cantilever."""
    section, material = at.Rectangle(1.0, 1e-4), at.Material(1.0, 1.0)
    load = at.Force("bar.end", (0.0, 10.0 * material.E * section.second_moment))
    s = v.static(cantilever(section, material, 1.0, load), mesh=32, load_steps=8)
    return digits(s.displacement("bar.end")[-1] + [1.0, 0.0], (0.445004402246, 0.810609024880), 2e-4)


@group(name="catenary without bending")
def catenary(v: Variation) -> Answers:
    """Lowest point of a slack cable from a V, beside the inextensible catenary: its sag for 100 m over 80 m."""
    height = float(np.sqrt(12.0 * 1e-4 / 1e7))
    section, material = at.Rectangle(1.0 / height, height), at.Material(1e7, 10.0 / 9.81)
    bodies = [
        at.Beam("left", A, (40.0, -30.0), section, material),
        at.Beam("right", (40.0, -30.0), (80.0, 0.0), section, material),
    ]
    joints = [at.Pin("left.start"), at.Pin("left.end", "right.start"), at.Pin("right.end")]
    s = v.static(at.Scene("catenary", bodies, joints, gravity=(0.0, -9.81)), mesh=16)
    a = 40.0
    for _ in range(60):  # sinh(40/a) = 50/a by Newton's method
        a -= (a * np.sinh(40.0 / a) - 50.0) / (np.sinh(40.0 / a) - 40.0 / a * np.cosh(40.0 / a))
    return digits(s.displacement("left.end")[-1, 1] - 30.0, -a * (np.cosh(40.0 / a) - 1.0), 1e-2)


@group(name="L-frame")
def l_frame(v: Variation) -> Answers:
    """A right angle of two beams under a dead force; published for Reissner's beam on four elements each."""
    section, steel = at.Rectangle(0.1, 0.05), at.Material(2.1e11, 7800.0, poisson=0.3)
    bodies = [at.Beam("one", A, (1, 0), section, steel), at.Beam("two", (1, 0), (1, 1), section, steel)]
    joints = [at.Clamp("one.start"), at.Weld("one.end", "two.start")]
    s = v.static(at.Scene("L-frame", bodies, joints, [at.Force("two.end", (1e6, 0))]), mesh=4, load_steps=10)
    return {"value": s.displacement("two.end")[-1], "moment": s.section_force("one", 0.0)[-1, 2]}


@group(name="rotating blade")
def blade(v: Variation) -> Answers:
    """Flap frequencies of a uniform blade from its lag frequencies (Wright et al. 1982)."""
    section, steel = at.Rectangle(1e-3, 1e-3), at.Material(2e11, 7800.0)
    unit = float(np.sqrt(steel.E * section.second_moment / (steel.density * section.area)))
    made, published = cantilever(section, steel, 1.0), (3.5160, 3.6817, 4.1373, 6.4495, 11.2023)
    speeds = (0.0, 1.0, 2.0, 5.0, 10.0)
    lag = [2.0 * np.pi * v.modes(made, mesh=12, count=1, spin=g * unit).frequencies[0] / unit for g in speeds]
    return digits(np.hypot(lag, speeds), published, 1e-3)


@group(name="spin-up")
def spin_up(v: Variation) -> Answers:
    """A flexible beam spun up (Simo & Vu-Quoc 1986), on a coarse mesh, to 3 s."""
    section = at.Section(1.0, 1.4e4 / 2.8e7, 2.0 * (1.4e4 / 2.8e7) ** 2)
    motor = at.Clamp("bar.start", angle=at.History(_spun, breaks=(15.0,)))
    bar = at.Beam("bar", A, (10.0, 0.0), section, at.Material(2.8e7, 1.2))
    s = v.solve(at.Scene("spin-up", [bar], [motor]), mesh=4, dt=5e-3, t_end=3.0, output_dt=1.0)
    return {
        "displacement": s.displacement("bar.end"),
        "energy": np.stack([s.energy.kinetic, s.energy.strain]),
    }


def _spun(t: float) -> tuple[float, float, float]:
    if t >= 15.0:
        return 6.0 * t - 45.0, 6.0, 0.0
    w = 2.0 * np.pi / 15.0
    angle = 0.4 * (t * t / 2.0 + (np.cos(w * t) - 1.0) / w**2)
    return angle, 0.4 * (t - np.sin(w * t) / w), 0.4 * (1.0 - np.cos(w * t))


def andrews() -> at.Scene:
    """Andrews' squeezer at rest (Hairer & Wanner, Solving Ordinary Differential Equations II, VII.7)."""
    D, DA, E, EA, RR, RA, SS, SA, SB, SC, SD = (
        28e-3, 115e-4, 2e-2, 1421e-5, 7e-3, 92e-5, 35e-3, 1874e-5, 1043e-5, 18e-3, 2e-2)  # fmt: skip
    TA, TB, U, UA, UB, ZF, ZT, FA = 2308e-5, 916e-5, 4e-2, 1228e-5, 449e-5, 2e-2, 4e-2, 1421e-5
    masses = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
    inertias = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
    origin, b, c = -0.06934 - 0.00227j, -0.03635 + 0.03273j, 0.014 + 0.072j
    q = START
    beta, gamma, delta, epsilon = (exp(1j * q[name]) for name in ("beta", "gamma", "delta", "epsilon"))
    rod, four, six = (
        exp(1j * (q[i] + q[k])) for i, k in (("beta", "theta"), ("phi", "delta"), ("omega", "epsilon"))
    )
    P = RR * beta
    F, d, e, h = P - D * rod, b + (SD - 1j * SC) * gamma, origin + ZT * delta, origin - 1j * U * epsilon
    centers = (
        RA * beta, P - DA * rod, b + (SB - 1j * SA) * gamma, e - 1j * (E - EA) * four,
        origin + (TA + 1j * TB) * delta, h + (ZF - FA) * six, origin + (UB - 1j * UA) * epsilon,
    )  # fmt: skip
    points = (
        {"o": 0j, "p": P}, {"p": P, "f": F}, {"b": b, "d": d, "f": b - 1j * SS * gamma},
        {"e": e, "f": e - 1j * E * four}, {"a": origin, "e": e}, {"h": h, "f": h + ZF * six},
        {"a": origin, "h": h},
    )  # fmt: skip
    bodies = [
        at.RigidBody(
            f"K{k + 1}", masses[k], inertias[k], _xy(centers[k]), {n: _xy(z) for n, z in points[k].items()}
        )
        for k in range(7)
    ]
    joints = [
        at.Pin("K1.o"), at.Pin("K3.b"), at.Pin("K5.a"), at.Pin("K7.a"), at.Pin("K1.p", "K2.p"),
        at.Pin("K4.e", "K5.e"), at.Pin("K6.h", "K7.h"), at.Pin("K2.f", "K3.f", "K4.f", "K6.f"),
    ]  # fmt: skip
    spring = at.Spring("K3.d", _xy(c), stiffness=4530.0, length=0.07785)
    return at.Scene("squeezer", bodies, joints, [at.Torque("K1.o", 0.033)], connectors=[spring])


def _xy(z: complex) -> tuple[float, float]:
    return z.real, z.imag


@group(name="Andrews' squeezer")
def squeezer(v: Variation) -> Answers:
    """Its seven angles at 0.03 s, by 600 steps of fourth order."""
    s = v.solve(andrews(), integrator="esdirk", dt=5e-5, t_end=0.03, output_dt=4e-4)
    turned = {f"K{k}": float(s.angle(f"K{k}.center")[-1]) for k in range(1, 8)}
    found = []
    for name, bodies in COUNTED.items():
        body, _, base = bodies.partition("-")
        found.append(START[name] + turned[body] - turned.get(base, 0.0))
    return digits(found, list(SQUEEZED.values()), 2e-4)
