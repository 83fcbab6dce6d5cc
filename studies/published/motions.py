"""Published frequencies and motions."""

from collections.abc import Iterator

import numpy as np

import anctmm as at
from anctmm.errors import SolverError
from reference.exact.andrews import PUBLISHED, andrews_squeezer, angles_of
from studies.published.problem import Published, Value, converged, last_digit

WRIGHT = "Wright et al. 1982, J. Appl. Mech. 49, 197–202"
SIMO = "Simo & Vu-Quoc 1986, J. Appl. Mech. 53, 855–863"
IVP = "Test Set for Initial Value Problem Solvers, tolerance 1e-14"
#: End of the published run of Andrews' squeezer, s, and its outputs: dense enough to follow whole turns.
SQUEEZED, OUTPUTS = 0.03, 75
#: Flap frequencies of a uniform blade on a hub without radius, by the dimensionless speed.
FLAP = {0: "3.5160", 1: "3.6817", 2: "4.1373", 5: "6.4495", 10: "11.2023"}


def problems(quick: bool) -> Iterator[Published]:
    """All of them; quick ones on coarser meshes, and without the squeezer, whose kernels take long to compile."""
    yield from blade(quick)
    yield spin_up(quick)
    if not quick:
        yield from squeezer(quick)


def blade(quick: bool) -> Iterator[Published]:
    """A blade that spins: in the plane its lag frequency, λ² = flap² − γ²."""
    section, steel = at.Rectangle(1e-3, 1e-3), at.Material(2e11, 7800.0)
    unit = float(np.sqrt(steel.E * section.second_moment / (steel.density * section.area)))
    beam = at.Beam("blade", (0, 0), (1, 0), section, steel)
    scene = at.Scene("blade", (beam,), (at.Clamp("blade.start"),))
    for gamma, text in FLAP.items():

        def flap(mesh: int, gamma: int = gamma) -> float:
            found = at.modes(scene, mesh=mesh, count=1, spin=gamma * unit)
            return float(np.hypot(2.0 * np.pi * found.frequencies[0] / unit, gamma))

        yield Published(
            "rotating blade", f"flap frequency at speed {gamma}", "", float(text), last_digit(text), WRIGHT,
            {"cable": converged(flap, (6, 12, 24) if quick else (12, 24, 48))},
            note="from the lag frequency, which is what a planar code finds",
        )  # fmt: skip


def spun(t: float) -> tuple[float, float, float]:
    """Angle of the published spin-up, its rate and acceleration."""
    if t >= 15.0:
        return 6.0 * t - 45.0, 6.0, 0.0
    w = 2.0 * np.pi / 15.0
    return (
        0.4 * (t * t / 2.0 + (np.cos(w * t) - 1.0) / w**2),
        0.4 * (t - np.sin(w * t) / w),
        0.4 * (1.0 - np.cos(w * t)),
    )


def spin_up(quick: bool) -> Published:
    """A flexible beam spun up in 15 s: the stretch of the steady turn that follows, by linear theory."""
    length, axial, bending, mass = 10.0, 2.8e7, 1.4e4, 1.2
    area = 1.0
    section = at.Section(area, bending / axial, 2.0 * (bending / axial) ** 2)
    beam = at.Beam("beam", (0, 0), (length, 0), section, at.Material(axial / area, mass / area))
    motor = at.Clamp("beam.start", angle=at.History(spun, breaks=(15.0,)))
    scene = at.Scene("spin-up", (beam,), (motor,))

    def stretch(mesh: int) -> float:
        found = at.solve(scene, mesh=mesh, dt=5e-3, t_end=20.0, output_dt=0.05)
        if not found.status.ok:
            raise SolverError(f"spin-up: {found.status}")
        steady = found.t >= 15.5
        reach = np.hypot(*found.position("beam.end")[steady].T)
        return float(reach.mean() - length)

    text = "5.143e-4"
    return Published(
        "spin-up", "mean stretch of the steady turn", "m", float(text), last_digit(text), SIMO,
        {"cable": converged(stretch, (4, 8, 16) if quick else (8, 16, 32))},
        note="linear theory, ρA Ω² L³/(3 EA), for a beam that stays straight",
    )  # fmt: skip


def squeezer(quick: bool) -> Iterator[Published]:
    """Andrews' squeezer: seven rigid bodies in three loops, with a spring; its angles at 0.03 s.

    Twice as many steps, of fourth order, change the angles by what stands as their uncertainty. More than 1200 steps
    do not help: rounding, which the motion amplifies, then changes beta and theta by 1e-8 to 1e-6.
    """
    scene = andrews_squeezer()

    def angles(steps: int) -> dict[str, float]:
        found = at.solve(
            scene, integrator="esdirk", dt=SQUEEZED / steps, t_end=SQUEEZED, output_dt=SQUEEZED / OUTPUTS,
            newton_tolerance=1e-12,
        )  # fmt: skip
        if not found.status.ok:
            raise SolverError(f"Andrews' squeezer: {found.status}")
        turns = {body.name: found.angle(f"{body.name}.center") for body in scene.bodies}
        return {name: float(angle[-1]) for name, angle in angles_of(turns).items()}

    before, last = (angles(steps) for steps in ((300, 600) if quick else (600, 1200)))
    for name, value in PUBLISHED.items():
        yield Published(
            "Andrews' squeezer", f"{name} at 0.03 s", "rad", value, 1e-14 * abs(value), IVP,
            {"rigid": Value(last[name], abs(last[name] - before[name]))},
            note="of the finer of two steps of fourth order; uncertainty: how far the two are apart",
        )  # fmt: skip
