"""Published and exact numbers: the answer here, and whether it is the published one to the digits given."""

from typing import Any

import numpy as np

import anctmm as at
from reference.exact.andrews import PUBLISHED as SQUEEZED
from reference.exact.andrews import andrews_squeezer, angles_of
from tests.golden.answers import Answer, Answers, group
from tests.golden.scenes import A
from tests.golden.vary import Variation


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


@group(name="Andrews' squeezer")
def squeezer(v: Variation) -> Answers:
    """Its seven angles at 0.03 s, by 600 steps of fourth order."""
    s = v.solve(andrews_squeezer(), integrator="esdirk", dt=5e-5, t_end=0.03, output_dt=4e-4)
    angles = angles_of({f"K{k}": s.angle(f"K{k}.center") for k in range(1, 8)})
    return digits([angle[-1] for angle in angles.values()], list(SQUEEZED.values()), 2e-4)
