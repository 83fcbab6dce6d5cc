"""The base scenes: each with its probes, run length, assumptions and source in one place."""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt

from anctmm.model.case import Case
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.scene import (
    Beam,
    Clamp,
    Force,
    Joint,
    Load,
    Material,
    Pin,
    Point,
    Probe,
    Scene,
    Torque,
    distance,
)
from anctmm.model.sections import Circle, Rectangle, Section

PAPER = "Rong (2014), Multibody Syst. Dyn., doi:10.1007/s11044-013-9402-7"
#: Implicit steps at which solvers are compared at equal error, s: whole parts of the scenes' output_dt, close enough
#: for a front without large gaps. With 1 and 0.5 ms alone, a solver that just meets a target at 0.8 ms seems dearer.
STEPS = tuple(1e-2 / n for n in (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 40))


@dataclass(frozen=True)
class BaseScene(Case):
    """A case that is built in: it also says where it comes from.

    Parameters
    ----------
    scene, probes, t_end, output_dt, note
        As of `Case`.
    assumptions : tuple of str
        What the source leaves open and was chosen here; shown wherever results are shown.
    source : str
        Where the data come from.
    """

    assumptions: tuple[str, ...] = ()
    source: str = ""


# --- four-bar (Rong 2014, Table 1) -------------------------------------------------------------------------

#: Ground pivots and joints at t = 0, m: crank along +x, coupler at 30°, follower at 60° from its pivot.
CRANK_PIVOT: Point = (0.0, 0.0)
CRANK_END: Point = (0.2, 0.0)
COUPLER_END: Point = (0.2 + 0.45 * sqrt(3.0), 0.45)
FOLLOWER_PIVOT: Point = (0.2 + 0.3 * sqrt(3.0), 0.0)
CRANK_TURN = Quintic(turn=2.0 * pi, duration=2.0)
#: Moment of the variant, N m: carries the crank through about a third of a turn.
CRANK_MOMENT = Pulse(amplitude=0.5, duration=1.0)
FOUR_BAR_PROBES: tuple[Probe, ...] = ("coupler.end", ("coupler", 0.5))
FOUR_BAR_ASSUMPTIONS = (
    "Ground pivots at (0, 0) and (0.7196152, 0) m; at t = 0 crank along +x, coupler at 30°, follower at 60°; "
    "the follower's length is what these ends give (0.5196152 m; the paper prints 0.5196174).",
    "Circular sections of 40, 50 and 30 mm, density from the printed masses, Poisson's ratio 0.",
    "No gravity, no damping, at rest at t = 0.",
)


def _link(name: str, start: Point, end: Point, diameter: float, mass: float, E: float) -> Beam:
    section = Circle(diameter)
    density = mass / (section.area * distance(start, end))
    return Beam(name, start, end, section, Material(E=E, density=density, poisson=0.0))


def _four_bar(name: str, hub: Joint, loads: tuple[Load, ...] = ()) -> Scene:
    bodies = (
        _link("crank", CRANK_PIVOT, CRANK_END, 0.04, 0.6811, 1e9),
        _link("coupler", CRANK_END, COUPLER_END, 0.05, 2.474, 5e6),
        _link("follower", COUPLER_END, FOLLOWER_PIVOT, 0.03, 1.470, 5e8),
    )
    joints = (
        hub,
        Pin("crank.end", "coupler.start"),
        Pin("coupler.end", "follower.start"),
        Pin("follower.end"),
    )
    return Scene(name, bodies, joints, loads)


def four_bar() -> BaseScene:
    """Four-bar whose crank is held by a driven clamp that turns once in 2 s."""
    return BaseScene(
        _four_bar("four-bar", Clamp("crank.start", angle=CRANK_TURN)),
        FOUR_BAR_PROBES,
        t_end=2.4,
        output_dt=0.01,
        assumptions=(
            *FOUR_BAR_ASSUMPTIONS,
            "The crank's clamp turns once, θ(t) = 2π s(t/T), s(x) = 10x³ − 15x⁴ + 6x⁵, T = 2 s; run to 2.4 s.",
        ),
        source=f"{PAPER}, Table 1",
    )


def four_bar_moment() -> BaseScene:
    """The same four-bar with a pinned crank, driven by a moment pulse: no prescribed motion."""
    return BaseScene(
        _four_bar("four-bar-moment", Pin("crank.start"), (Torque("crank.start", CRANK_MOMENT),)),
        FOUR_BAR_PROBES,
        t_end=1.2,
        output_dt=0.01,
        assumptions=(
            *FOUR_BAR_ASSUMPTIONS,
            f"The crank is pinned and driven by a moment M(t) = {CRANK_MOMENT.amplitude:g} N m · sin²(πt/T), "
            f"T = {CRANK_MOMENT.duration:g} s; run to 1.2 s.",
        ),
        source=f"{PAPER}, Table 1",
    )


# --- cantilever --------------------------------------------------------------------------------------------

LENGTH = 2.0
SECTION = Rectangle(0.01, 0.005)
MATERIAL = Material(E=1e9, density=2000.0, poisson=0.0)
CANTILEVER_PROBES: tuple[Probe, ...] = ("beam.end", ("beam", 0.5))
CANTILEVER_ASSUMPTIONS = (
    "L = 2 m, rectangle 10 mm × 5 mm (height in the plane), E = 1 GPa, density 2000 kg/m³, ν = 0.",
)
#: Tip forces of the static study as P L²/(E I), and its end moment as M L/(E I).
TIP_FORCES = (0.5, 1.0, 3.0, 10.0)
END_MOMENT = pi


def _cantilever(
    name: str,
    loads: tuple[Load, ...] = (),
    gravity: Point = (0.0, 0.0),
    section: Section = SECTION,
    material: Material = MATERIAL,
) -> Scene:
    beam = Beam("beam", (0.0, 0.0), (LENGTH, 0.0), section, material)
    return Scene(name, (beam,), (Clamp("beam.start"),), loads, gravity)


def cantilever_tip_force(
    load: float, section: Section = SECTION, material: Material = MATERIAL, name: str = ""
) -> BaseScene:
    """Cantilever at rest under a downward dead tip force of P L²/(E I) = `load`."""
    force = load * material.E * section.second_moment / LENGTH**2
    return BaseScene(
        _cantilever(
            name or f"cantilever-force-{load:g}",
            (Force("beam.end", (0.0, -force)),),
            section=section,
            material=material,
        ),
        CANTILEVER_PROBES,
        t_end=None,
        assumptions=(*CANTILEVER_ASSUMPTIONS, f"Downward dead tip force, P L²/(E I) = {load:g}."),
        source="extensible elastica",
    )


def cantilever_end_moment(moment: float = END_MOMENT) -> BaseScene:
    """Cantilever at rest under an end moment of M L/(E I) = `moment`."""
    value = moment * MATERIAL.E * SECTION.second_moment / LENGTH
    return BaseScene(
        _cantilever(f"cantilever-moment-{moment:.3g}", (Torque("beam.end", value),)),
        CANTILEVER_PROBES,
        t_end=None,
        assumptions=(*CANTILEVER_ASSUMPTIONS, f"End moment, M L/(E I) = {moment:.6g}."),
        source="pure bending: an arc of a circle",
    )


def cantilever_fall() -> BaseScene:
    """Cantilever released at rest under gravity."""
    return BaseScene(
        _cantilever("cantilever-fall", gravity=(0.0, -9.81)),
        CANTILEVER_PROBES,
        t_end=1.0,
        output_dt=0.01,
        assumptions=(
            *CANTILEVER_ASSUMPTIONS,
            "Released straight and at rest under gravity 9.81 m/s² for 1 s.",
        ),
        source="a common benchmark of large-deformation beams",
    )


#: Every base scene by its name, for `anctmm list`.
BASE_SCENES: tuple[Callable[[], BaseScene], ...] = (
    four_bar,
    four_bar_moment,
    *(lambda load=load: cantilever_tip_force(load) for load in TIP_FORCES),  # type: ignore[misc]
    cantilever_end_moment,
    cantilever_fall,
)


def moving_scenes() -> list[BaseScene]:
    """The two base scenes that errors and costs are traded on."""
    return [four_bar(), cantilever_fall()]


def base_of(name: str) -> BaseScene:
    """The base scene of a name that `moving_scenes` has."""
    return next(base for base in moving_scenes() if base.scene.name == name)
