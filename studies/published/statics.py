"""Published static problems."""

from collections.abc import Iterator
from typing import Literal

import numpy as np

import anctmm as at
from anctmm.errors import SolverError
from anctmm.results.solution import Solution
from reference import exudyn_reissner
from studies.published.problem import DIGITISED, Published, Value, converged, last_digit

EXUDYN = "Exudyn, test models"
NACHBAGAUER = "Nachbagauer et al. 2011, 10.1007/s11044-011-9249-8"
ELASTICA = {"x": ("-0.508537304326", "-0.50742872"), "y": ("-1.207239854550", "-1.20553370")}


def problems(quick: bool) -> Iterator[Published]:
    """All of them; quick ones on coarser meshes."""
    yield from elastica(quick)
    yield roll_up(quick)
    yield from shear_cantilever(quick)
    yield from lees_frame(quick)
    yield catenary(quick)
    yield from l_frame(quick)


def cantilever(
    section: at.Section,
    material: at.Material,
    length: float,
    *loads: at.Force | at.Torque,
    stretch: Literal["held", "free"] = "held",
) -> at.Scene:
    """A clamped beam along x."""
    beam = at.Beam("beam", (0, 0), (length, 0), section, material)
    return at.Scene("cantilever", (beam,), (at.Clamp("beam.start", stretch=stretch),), loads)


def tip(found: Solution, axis: int, end: str = "beam.end") -> float:
    """Displacement of an end under the whole load, m."""
    if not found.status.ok:
        raise SolverError(f"{found.solver} on {found.scene.name!r}: {found.status}")
    return float(found.displacement(end)[-1, axis])


def elastica(quick: bool) -> Iterator[Published]:
    """A cantilever bent far by a dead force: F L²/EI = 3."""
    section, steel = at.Rectangle(0.1, 0.1), at.Material(2.07e11, 7850.0)
    force = 3.0 * steel.E * section.second_moment / 2.0**2
    load = at.Force("beam.end", (0.0, -force))
    scene = cantilever(section, steel, 2.0, load)
    four = at.solve_static(cantilever(section, steel, 2.0, load, stretch="free"), mesh=4, load_steps=4)
    meshes = (16, 32, 64) if quick else (32, 64, 128)
    for axis, name in enumerate("xy"):
        limit, coarse = ELASTICA[name]

        def on(mesh: int, axis: int = axis) -> float:
            return tip(at.solve_static(scene, mesh=mesh, load_steps=4), axis)

        yield Published(
            "elastica, F L²/EI = 3", f"tip displacement {name}", "m", float(limit), last_digit(limit), EXUDYN,
            {"cable": converged(on, meshes)},
            note="the value of a finite mesh of cables, as its source says, not of the limit",
        )  # fmt: skip
        yield Published(
            "elastica, 4 cables", f"tip displacement {name}", "m", float(coarse), last_digit(coarse), EXUDYN,
            {"cable": Value(tip(four, axis))}, note="on the same mesh, with its clamp, which leaves the stretch free",
        )  # fmt: skip


def roll_up(quick: bool) -> Published:
    """A cantilever bent to a full circle by an end moment."""
    section, material = at.Rectangle(0.01, 0.01), at.Material(1e7, 1000.0)
    scene = cantilever(
        section, material, 1.0, at.Torque("beam.end", 2.0 * np.pi * material.E * section.second_moment)
    )
    meshes = (8, 16, 32) if quick else (16, 32, 64)
    return Published(
        "roll-up, M L/EI = 2π", "tip displacement x", "m", -1.0, 1e-15, "exact",
        {"cable": converged(lambda n: tip(at.solve_static(scene, mesh=n, load_steps=16), 0), meshes)}, kind="exact",
    )  # fmt: skip


def shear_cantilever(quick: bool) -> Iterator[Published]:
    """A thick cantilever, of Reissner's beam with a shear factor of Poisson's ratio."""
    nu, h, b = 0.3, 0.5, 0.1
    steel = at.Material(2.07e11, 7850.0, poisson=nu)
    factor = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
    cases = [
        (5e5, 1, "8.09900305e-4", "small"),
        (5e8, 0, "0.15097103", "large"),
        (5e8, 1, "0.71056837", "large"),
    ]
    meshes = (16, 32, 64) if quick else (64, 128, 256)
    for load, axis, text, size in cases:
        scene = cantilever(at.Rectangle(b, h), steel, 2.0, at.Force("beam.end", (0.0, -load * h**3)))

        def reissner(mesh: int, axis: int = axis, scene: at.Scene = scene) -> float:
            found = exudyn_reissner.solve_static(scene, mesh=mesh, load_steps=8, shear_factor=factor)
            return abs(tip(found, axis))

        yield Published(
            f"shear cantilever, {size} force", f"tip displacement {'xy'[axis]}, size", "m", float(text),
            last_digit(text), NACHBAGAUER, {"exudyn-reissner": converged(reissner, meshes)},
            note="needs Reissner's beam: the paper's shear element has Green's strains and locks for ν > 0",
        )  # fmt: skip


def lee_scene() -> at.Scene:
    """Lee's frame under the load 20e3."""
    section, material = at.Rectangle(3.0, 2.0), at.Material(7.2e6, 1.0)
    bodies = (
        at.Beam("post", (0.0, 0.0), (0.0, 120.0), section, material),
        at.Beam("short", (0.0, 120.0), (24.0, 120.0), section, material),
        at.Beam("long", (24.0, 120.0), (120.0, 120.0), section, material),
    )
    joints = (
        at.Pin("post.start", grounded=True),
        at.Weld("post.end", "short.start"),
        at.Weld("short.end", "long.start"),
        at.Pin("long.end", grounded=True),
    )
    return at.Scene("Lee's frame", bodies, joints, (at.Force("short.end", (0.0, -2e4)),))


def lees_frame(quick: bool) -> Iterator[Published]:
    """Snap-through and snap-back of a frame: its two limit loads."""
    scene = lee_scene()
    paths = {}
    for n in (1, 2, 4) if quick else (2, 4, 8):
        mesh = {"post": 5 * n, "short": n, "long": 4 * n}
        t = at.solve_static(scene, mesh=mesh, path="arclength").t
        paths[n] = 2e4 * t[: t.argmin()].max(), 2e4 * t.min()
    for k, (name, value) in enumerate([("first limit load", 18.7e3), ("second limit load", -9.3e3)]):
        yield Published(
            "Lee's frame", name, "N", value, DIGITISED * abs(value), "digitised",
            {"cable": converged(lambda n, k=k: paths[n][k], tuple(paths))}, kind="curve",  # type: ignore[misc]
        )  # fmt: skip


def catenary(quick: bool) -> Published:
    """A slack cable without bending stiffness, from a V of two straight ones."""
    from reference.exact import Catenary

    span, length, weight, axial, bending = 80.0, 100.0, 10.0, 1e7, 1e-4
    height = float(np.sqrt(12.0 * bending / axial))
    section, material = at.Rectangle(1.0 / height, height), at.Material(axial, weight / 9.81)
    bodies = (
        at.Beam("left", (0.0, 0.0), (40.0, -30.0), section, material),
        at.Beam("right", (40.0, -30.0), (span, 0.0), section, material),
    )
    joints = (at.Pin("left.start"), at.Pin("left.end", "right.start"), at.Pin("right.end"))
    scene = at.Scene("catenary", bodies, joints, gravity=(0.0, -9.81))
    exact = float(Catenary((span, 0.0), length, weight, axial).position(0.5)[1])
    meshes = (8, 16, 32) if quick else (16, 32, 64)
    return Published(
        "catenary, EI → 0", "lowest point y", "m", exact, 1e-6 * span, "exact (extensible)",
        {"cable": converged(
            lambda n: float(at.solve_static(scene, mesh=n).position("left.end")[-1, 1]), meshes
        )},
        kind="exact",
    )  # fmt: skip


def l_frame(quick: bool) -> Iterator[Published]:
    """A right angle of two beams on the same mesh as published; two versions of the code print two numbers."""
    section, steel = at.Rectangle(0.1, 0.05), at.Material(2.1e11, 7800.0, poisson=0.3)
    bodies = (
        at.Beam("one", (0, 0), (1, 0), section, steel),
        at.Beam("two", (1, 0), (1, 1), section, steel),
    )
    joints = (at.Clamp("one.start"), at.Weld("one.end", "two.start"))
    scene = at.Scene("L-frame", bodies, joints, (at.Force("two.end", (1e6, 0)),))
    factor = 10.0 * 1.3 / (12.0 + 11.0 * 0.3)
    linear = exudyn_reissner.solve_static(scene, mesh=4, load_steps=10, shear_factor=factor, order=1)
    found = {
        "exudyn-reissner, linear elements": Value(tip(linear, 1, "two.end")),
        "cable": Value(tip(at.solve_static(scene, mesh=16 if quick else 64, load_steps=10), 1, "two.end")),
    }
    for text, source in [
        ("-0.9181474510515214", "Exudyn LShapeGeomExactBeam2D, as quoted"),
        ("-2.2115028353806547", "Exudyn LShapeGeomExactBeam2D, commit 30ec2d5"),
    ]:
        yield Published(
            "L-frame, 4 + 4 elements", "tip displacement y", "m", float(text), 1e-13, source, found,
            note="cables have no shear and stand on a fine mesh: the published number is one of its coarse mesh",
        )  # fmt: skip
