"""Two soft links that fall, with a gravity that bends them much in little time."""

import anctmm as at
from studies.regression.check import Static, Watch

SECTION, SOFT = at.Rectangle(0.02, 0.02), at.Material(E=1e7, density=1000.0)
bodies = [
    at.Beam("upper", (0.0, 0.0), (0.5, 0.0), SECTION, SOFT),
    at.Beam("lower", (0.5, 0.0), (0.9, 0.3), SECTION, SOFT),
]
joints = [at.Clamp("upper.start"), at.Pin("upper.end", "lower.start")]
links = at.Scene("links", bodies, joints, gravity=(0.0, -200.0))
stick = at.Scene("stick", bodies[:1], joints[:1], [at.Force("upper.end", (0.0, -1.5))])


def explicit(element):
    return at.Discretisation(2, element, integrator="zhai", dt=5e-5, t_end=0.02, output_dt=0.005)


def implicit(element):
    return at.Discretisation(2, element, dt=2e-3, t_end=0.04, output_dt=0.01, newton_tolerance=1e-12)


elements = ("cable", "shear")
WATCHED = [
    Watch(links, ["lower.end", ("upper", 0.5)], {f"{e}-explicit": explicit(e) for e in elements}),
    Watch(links, ["lower.end", ("upper", 0.5)], {f"{e}-implicit": implicit(e) for e in elements}),
    Watch(stick, ["upper.end"], {f"{e}-static": Static(2, e) for e in elements}),
]
