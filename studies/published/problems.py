"""Published problems as scenes, and the numbers asked for: each a function of the elements of a beam."""

from functools import cache
from typing import Any

import numpy as np

import anctmm as at
from anctmm.errors import SolverError
from anctmm.results.solution import Solution
from anctmm.solvers import registry
from reference.exact import Catenary
from reference.exact.andrews import andrews_squeezer, angles_of

#: End of the published run of Andrews' squeezer, s, and its outputs: dense enough to follow whole turns.
SQUEEZED, OUTPUTS = 0.03, 75


def whole(found: Solution) -> Solution:
    """A solution that ended well; SolverError otherwise."""
    if not found.status.ok:
        raise SolverError(f"{found.solver} on {found.scene.name!r}: {found.status}")
    return found


def tip(found: Solution, axis: int, end: str = "beam.end") -> float:
    """Displacement of an end under the whole load, m."""
    return float(whole(found).displacement(end)[-1, axis])


def reissner(scene: at.Scene, **options: Any) -> Solution:
    """Equilibrium by Exudyn's beam of Reissner's kind with the shear factor of Poisson's ratio 0.3."""
    static = registry.static_of("exudyn-reissner", registry.solver("exudyn-reissner"))
    return static(scene, shear_factor=10.0 * 1.3 / (12.0 + 11.0 * 0.3), **options)


def cantilever(section: Any, material: at.Material, length: float, load: Any, **clamp: Any) -> at.Scene:
    """A clamped beam along x."""
    beam = at.Beam("beam", (0, 0), (length, 0), section, material)
    return at.Scene("cantilever", [beam], [at.Clamp("beam.start", **clamp)], [load])


# --- equilibria ----------------------------------------------------------------------------------------------


def elastica(n: int, axis: int, **clamp: Any) -> float:
    """A cantilever bent far by a dead force: F L²/EI = 3."""
    section, steel = at.Rectangle(0.1, 0.1), at.Material(2.07e11, 7850.0)
    force = at.Force("beam.end", (0.0, -3.0 * steel.E * section.second_moment / 4.0))
    return tip(at.solve_static(cantilever(section, steel, 2.0, force, **clamp), mesh=n, load_steps=4), axis)


def roll_up(n: int) -> float:
    """A cantilever bent to a full circle by an end moment."""
    section, material = at.Rectangle(0.01, 0.01), at.Material(1e7, 1000.0)
    moment = at.Torque("beam.end", 2.0 * np.pi * material.E * section.second_moment)
    return tip(at.solve_static(cantilever(section, material, 1.0, moment), mesh=n, load_steps=16), 0)


def thick(n: int, load: float, axis: int) -> float:
    """A thick cantilever, of Reissner's beam; the size of its tip displacement."""
    h, steel = 0.5, at.Material(2.07e11, 7850.0, poisson=0.3)
    scene = cantilever(at.Rectangle(0.1, h), steel, 2.0, at.Force("beam.end", (0.0, -load * h**3)))
    return abs(tip(reissner(scene, mesh=n, load_steps=8), axis))


def lees_frame(n: int, limit: int) -> float:
    """Snap-through (0) or snap-back (1) of a frame: the limit load, N; elements of its shortest part."""
    t = lees_path(n)
    return 2e4 * float(t.min() if limit else t[: t.argmin()].max())


@cache
def lees_path(n: int) -> Any:
    """Load factors of its equilibria."""
    section, material = at.Rectangle(3.0, 2.0), at.Material(7.2e6, 1.0)
    corners = {"post": ((0, 0), (0, 120)), "short": ((0, 120), (24, 120)), "long": ((24, 120), (120, 120))}
    bodies = [at.Beam(name, *ends, section, material) for name, ends in corners.items()]
    welds = at.Weld("post.end", "short.start"), at.Weld("short.end", "long.start")
    joints = [at.Pin("post.start"), *welds, at.Pin("long.end")]
    scene = at.Scene("Lee's frame", bodies, joints, [at.Force("short.end", (0.0, -2e4))])
    return at.solve_static(scene, mesh={"post": 5 * n, "short": n, "long": 4 * n}, path="arclength").t


SPAN, ROPE, WEIGHT, AXIAL, BENDING = 80.0, 100.0, 10.0, 1e7, 1e-4


def exact_catenary() -> float:
    """Its lowest point, m."""
    return float(Catenary((SPAN, 0.0), ROPE, WEIGHT, AXIAL).position(0.5)[1])


def catenary(n: int) -> float:
    """A slack cable without bending stiffness, from a V of two straight ones: its lowest point, m."""
    height = float(np.sqrt(12.0 * BENDING / AXIAL))
    section, material = at.Rectangle(1.0 / height, height), at.Material(AXIAL, WEIGHT / 9.81)
    places = {"left": ((0, 0), (40, -30)), "right": ((40, -30), (SPAN, 0))}
    bodies = [at.Beam(name, *ends, section, material) for name, ends in places.items()]
    joints = [at.Pin("left.start"), at.Pin("left.end", "right.start"), at.Pin("right.end")]
    scene = at.Scene("catenary", bodies, joints, gravity=(0.0, -9.81))
    return float(whole(at.solve_static(scene, mesh=n)).position("left.end")[-1, 1])


def l_frame(n: int) -> float:
    """A right angle of two beams of linear elements, as published: its end, m."""
    section, steel = at.Rectangle(0.1, 0.05), at.Material(2.1e11, 7800.0, poisson=0.3)
    places = {"one": ((0, 0), (1, 0)), "two": ((1, 0), (1, 1))}
    bodies = [at.Beam(name, *ends, section, steel) for name, ends in places.items()]
    joints = [at.Clamp("one.start"), at.Weld("one.end", "two.start")]
    scene = at.Scene("L-frame", bodies, joints, [at.Force("two.end", (1e6, 0))])
    return tip(reissner(scene, mesh=n, load_steps=10, order=1), 1, "two.end")


# --- frequencies and motions ---------------------------------------------------------------------------------


def flap(n: int, speed: float) -> float:
    """Flap frequency of a uniform blade on a hub without radius, from the lag frequency: λ² = flap² − γ²."""
    section, steel = at.Rectangle(1e-3, 1e-3), at.Material(2e11, 7800.0)
    unit = float(np.sqrt(steel.E * section.second_moment / (steel.density * section.area)))
    beam = at.Beam("blade", (0, 0), (1, 0), section, steel)
    scene = at.Scene("blade", [beam], [at.Clamp("blade.start")])
    lag = at.modes(scene, mesh=n, count=1, spin=speed * unit).frequencies[0]
    return float(np.hypot(2.0 * np.pi * lag / unit, speed))


def spun(t: float) -> tuple[float, float, float]:
    """Angle of the published spin-up, its rate and acceleration."""
    if t >= 15.0:
        return 6.0 * t - 45.0, 6.0, 0.0
    w = 2.0 * np.pi / 15.0
    angle = 0.4 * (t * t / 2.0 + (np.cos(w * t) - 1.0) / w**2)
    return angle, 0.4 * (t - np.sin(w * t) / w), 0.4 * (1.0 - np.cos(w * t))


def spin_up(n: int) -> float:
    """A flexible beam spun up in 15 s: the mean stretch of the steady turn that follows, m."""
    length, axial, bending, mass = 10.0, 2.8e7, 1.4e4, 1.2
    section = at.Section(1.0, bending / axial, 2.0 * (bending / axial) ** 2)
    beam = at.Beam("beam", (0, 0), (length, 0), section, at.Material(axial, mass))
    motor = at.Clamp("beam.start", angle=at.History(spun, breaks=(15.0,)))
    found = at.solve(at.Scene("spin-up", [beam], [motor]), mesh=n, dt=5e-3, t_end=20.0, output_dt=0.05)
    steady = found.t >= 15.5
    return float(np.hypot(*whole(found).position("beam.end")[steady].T).mean() - length)


def squeezer(steps: int, name: str) -> float:
    """An angle of Andrews' squeezer at 0.03 s, rad: seven rigid bodies in three loops, with a spring."""
    return float(angles_of(_turns_of_squeezer(steps))[name][-1])


@cache
def _turns_of_squeezer(steps: int) -> dict[str, Any]:
    scene = andrews_squeezer()
    times: dict[str, Any] = {"dt": SQUEEZED / steps, "t_end": SQUEEZED, "output_dt": SQUEEZED / OUTPUTS}
    found = whole(at.solve(scene, integrator="esdirk", newton_tolerance=1e-12, **times))
    return {body.name: found.angle(f"{body.name}.center") for body in scene.bodies}
