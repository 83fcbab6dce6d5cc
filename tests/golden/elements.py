"""Every element with every integrator: two beams, the first on a driven clamp, with loads that vary."""

from typing import Any

import numpy as np

import anctmm as at
from tests.golden.answers import Answer, Answers, group
from tests.golden.scenes import (
    ALPHA,
    ESDIRK,
    FIRM,
    ROD,
    SOFT,
    STRIP,
    ZHAI,
    A,
    B,
    C,
    Ramp,
    beam,
    motion_of,
    reaction_of,
    scene,
    section_of,
    work_of,
)
from tests.golden.vary import Variation

DRIVE = at.Clamp("one.start", at.Quintic(0.9, 0.05))
HINGE = at.Pin("one.end", "two.end")
PLACES = ("one.end", ("one", 0.3), "two.start")
SHORT = {**ZHAI, "dt": 1e-4}


def row() -> at.Scene:
    """A driven clamp, a pin and a beam drawn backwards."""
    loads = [at.Torque("two.start", 0.02), at.Force("one.end", Ramp((0.3, -0.5), (20.0, -400.0)))]
    return scene("row", [beam("one", A, B), beam("two", C, B, FIRM, ROD)], [DRIVE, HINGE], loads)


def moved(v: Variation, **options: Any) -> Answers:
    """Motion, work and forces of the row."""
    s = v.solve(row(), **options)
    found = motion_of(s, *PLACES, angles=["two.start"]) | work_of(s) | reaction_of(s, DRIVE, HINGE)
    return found | section_of(s, ("one", 0.5))


for element, more, quick in (
    ("cable", {}, ZHAI),
    ("cable", {"quadrature": "reduced"}, ZHAI),
    ("cable", {"quadrature": "lobatto"}, ZHAI),
    ("quintic", {}, SHORT),
    ("shear", {}, SHORT),
):
    kind = " ".join([element, *more.values()])
    mesh = 1 if element == "quintic" else 2
    for method, steps in (("zhai", quick), ("generalized-alpha", ALPHA), ("esdirk", ESDIRK)):
        if method != "esdirk" or not more:
            group(moved, name=f"{kind}, {method}", element=element, mesh=mesh, **more, **steps)
for radius in (0.0, 0.5, 1.0):
    group(moved, name=f"cable, spectral radius {radius:g}", mesh=2, spectral_radius=radius, **ALPHA)
group(moved, name="cable, zhai of other parameters", mesh=2, **{**ZHAI, "integrator": at.Zhai(0.6, 0.6)})


def within(v: Variation, tolerance: float, **options: Any) -> Answers:
    """A run with a tolerance: within ten tolerances of the largest displacement."""
    s = v.solve(row(), tolerance=tolerance, t_end=0.05, output_dt=0.01, mesh=2, **options)
    found = motion_of(s, *PLACES)
    part = 10.0 * tolerance
    size = {key: float(np.abs(found[key]).max()) for key in ("displacement", "velocity", "energy")}
    parts = {"displacement": part, "velocity": 5.0 * part, "energy": 5.0 * part}
    return {"status": s.status.code} | {
        key: Answer(found[key], allowed=parts[key] * size[key]) for key in parts
    }


for method in ("esdirk", "generalized-alpha"):
    for tolerance in (1e-3, 1e-5):
        group(within, name=f"tolerance {tolerance:g}, {method}", tolerance=tolerance, integrator=method)


def fall() -> at.Scene:
    """A cantilever that falls."""
    return scene("fall", [beam("one", A, B)], [at.Clamp("one.start")], gravity=(0.0, -9.81))


@group(name="order of zhai", integrator="zhai", dt=4e-4)
@group(name="order of generalized-alpha", dt=1e-3, spectral_radius=0.8)
@group(name="order of esdirk", integrator="esdirk", dt=2e-3)
def order_in_time(v: Variation, dt: float, **options: Any) -> Answers:
    """Binary logarithm of the ratio of two differences between runs of steps that are halved."""
    tips = [
        v.solve(fall(), mesh=1, dt=dt / 2**k, t_end=0.04, output_dt=0.02, **options).displacement("one.end")[
            -1
        ]
        for k in range(3)
    ]
    return {"order": Answer(_order(*tips), allowed=1e-3)}


@group(name="order of meshes, cable", element="cable", first=2)
@group(name="order of meshes, quintic", element="quintic", first=1)
@group(name="order of meshes, shear", element="shear", first=4)
def order_in_space(v: Variation, element: str, first: int) -> Answers:
    """The same of the tip of a bent cantilever on meshes that are refined."""
    clamp = at.Clamp("one.start", stretch="free")
    bent = at.Scene("bent", [beam("one", A, B, SOFT, STRIP)], [clamp], [at.Force("one.end", (0.02, 0.06))])
    tips = [v.static(bent, mesh=first * 2**k, element=element).position("one.end")[-1] for k in range(3)]
    return {"order": Answer(_order(*tips), allowed=1e-2)}


def _order(coarse: Any, middle: Any, fine: Any) -> Any:
    return np.log2(np.linalg.norm(middle - coarse) / np.linalg.norm(fine - middle))
