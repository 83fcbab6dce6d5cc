"""The built-in scenes: a file of cases like a user's, which defines CASES."""

from itertools import pairwise
from math import pi, sqrt

import anctmm as at
from anctmm.model.bodies import distance
from anctmm.model.case import Case
from anctmm.model.scene import Joint, Load, Point, Probe

PAPER = "Rong (2014), Multibody Syst. Dyn., doi:10.1007/s11044-013-9402-7, Table 1"

# --- four-bar (Rong 2014, Table 1) -------------------------------------------------------------------------

#: Ends of the links at t = 0, m: crank along +x, coupler at 30°, follower at 60° from its pivot.
CORNERS: tuple[Point, ...] = (
    (0.0, 0.0),
    (0.2, 0.0),
    (0.2 + 0.45 * sqrt(3.0), 0.45),
    (0.2 + 0.3 * sqrt(3.0), 0.0),
)
CRANK_TURN = at.Quintic(turn=2.0 * pi, duration=2.0)
#: Moment of the variant, N m: carries the crank through about a third of a turn.
CRANK_MOMENT = at.Pulse(amplitude=0.5, duration=1.0)
FOUR_BAR_PROBES: tuple[Probe, ...] = ("coupler.end", ("coupler", 0.5))
FOUR_BAR_NOTE = (
    f"{PAPER}. Ground pivots at (0, 0) and (0.7196152, 0) m; at t = 0 crank along +x, coupler at 30°, follower at 60°; "
    "the follower's length is that between these ends (0.5196152 m; the paper prints 0.5196174). Circular sections of "
    "40, 50 and 30 mm, density from the printed masses, Poisson's ratio 0. No gravity, no damping, at rest at t = 0."
)


def _four_bar(name: str, hub: Joint, loads: tuple[Load, ...] = ()) -> at.Scene:
    links = ("crank", 0.04, 0.6811, 1e9), ("coupler", 0.05, 2.474, 5e6), ("follower", 0.03, 1.470, 5e8)
    bodies = []
    for (link, diameter, mass, E), (start, end) in zip(links, pairwise(CORNERS), strict=True):
        section = at.Circle(diameter)
        density = mass / (section.area * distance(start, end))
        material = at.Material(E=E, density=density, poisson=0.0)
        bodies.append(at.Beam(link, start, end, section, material))
    pins = (
        at.Pin("crank.end", "coupler.start"),
        at.Pin("coupler.end", "follower.start"),
        at.Pin("follower.end"),
    )
    return at.Scene(name, bodies, (hub, *pins), loads)


def four_bar() -> Case:
    """Four-bar whose crank is held by a driven clamp that turns once in 2 s."""
    scene = _four_bar("four-bar", at.Clamp("crank.start", angle=CRANK_TURN))
    drive = "The crank's clamp turns once, θ(t) = 2π s(t/T), s(x) = 10x³ − 15x⁴ + 6x⁵, T = 2 s."
    return Case(scene, FOUR_BAR_PROBES, t_end=2.4, output_dt=0.01, note=f"{FOUR_BAR_NOTE} {drive}")


def four_bar_moment() -> Case:
    """The same four-bar with a pinned crank, driven by a moment pulse: no prescribed motion."""
    scene = _four_bar("four-bar-moment", at.Pin("crank.start"), (at.Torque("crank.start", CRANK_MOMENT),))
    drive = (
        f"The crank is pinned and driven by a moment M(t) = {CRANK_MOMENT.amplitude:g} N m · sin²(πt/T), "
        f"T = {CRANK_MOMENT.duration:g} s."
    )
    return Case(scene, FOUR_BAR_PROBES, t_end=1.2, output_dt=0.01, note=f"{FOUR_BAR_NOTE} {drive}")


# --- cantilever --------------------------------------------------------------------------------------------

LENGTH = 2.0
SECTION = at.Rectangle(0.01, 0.005)
MATERIAL = at.Material(E=1e9, density=2000.0, poisson=0.0)
CANTILEVER_PROBES: tuple[Probe, ...] = ("beam.end", ("beam", 0.5))
CANTILEVER_NOTE = (
    "L = 2 m, rectangle 10 mm × 5 mm (height in the plane), E = 1 GPa, density 2000 kg/m³, Poisson's ratio 0."
)
#: Tip forces of the equilibria as P L²/(E I), and their end moment as M L/(E I).
TIP_FORCES = (0.5, 1.0, 3.0, 10.0)
END_MOMENT = pi


def _cantilever(
    name: str, loads: tuple[Load, ...] = (), gravity: Point = (0.0, 0.0), section: at.Section = SECTION,
    material: at.Material = MATERIAL,
) -> at.Scene:  # fmt: skip
    beam = at.Beam("beam", (0.0, 0.0), (LENGTH, 0.0), section, material)
    return at.Scene(name, (beam,), (at.Clamp("beam.start"),), loads, gravity)


def cantilever_tip_force(
    load: float, section: at.Section = SECTION, material: at.Material = MATERIAL, name: str = ""
) -> Case:
    """Cantilever at rest under a downward dead tip force of P L²/(E I) = `load`."""
    force = load * material.E * section.second_moment / LENGTH**2
    loads = (at.Force("beam.end", (0.0, -force)),)
    scene = _cantilever(name or f"cantilever-force-{load:g}", loads, section=section, material=material)
    note = f"{CANTILEVER_NOTE} Downward dead tip force, P L²/(E I) = {load:g}: extensible elastica."
    return Case(scene, CANTILEVER_PROBES, t_end=None, note=note)


def cantilever_end_moment(moment: float = END_MOMENT) -> Case:
    """Cantilever at rest under an end moment of M L/(E I) = `moment`."""
    value = moment * MATERIAL.E * SECTION.second_moment / LENGTH
    scene = _cantilever(f"cantilever-moment-{moment:.3g}", (at.Torque("beam.end", value),))
    note = f"{CANTILEVER_NOTE} End moment, M L/(E I) = {moment:.6g}: pure bending, an arc of a circle."
    return Case(scene, CANTILEVER_PROBES, t_end=None, note=note)


def cantilever_fall() -> Case:
    """Cantilever released at rest under gravity."""
    scene = _cantilever("cantilever-fall", gravity=(0.0, -9.81))
    note = f"{CANTILEVER_NOTE} Released straight and at rest under gravity 9.81 m/s²."
    return Case(scene, CANTILEVER_PROBES, t_end=1.0, output_dt=0.01, note=note)


CASES = [
    four_bar(),
    four_bar_moment(),
    *(cantilever_tip_force(load) for load in TIP_FORCES),
    cantilever_end_moment(),
    cantilever_fall(),
]


def moving_scenes() -> list[Case]:
    """The two scenes of the studies of accuracy and cost, where none is named."""
    return [four_bar(), cantilever_fall()]
