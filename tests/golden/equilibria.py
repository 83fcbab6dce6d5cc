"""Equilibria: load steps, paths by arc length, limit loads, stability and reactions."""

from typing import Any

import numpy as np

import anctmm as at
from tests.golden.answers import Answers, group
from tests.golden.scenes import BLOCK, FIRM, PLAIN, ROD, A, B, C, D, beam, reaction_of, scene, section_of
from tests.golden.vary import Variation

START = at.Clamp("one.start")
ONE, TWO = beam("one", A, B), beam("two", C, B, FIRM, ROD)


def rest_of(s: at.Solution, *places: Any) -> Answers:
    """Displacements, strain energy and stability at the load factors."""
    return {
        "status": s.status.code,
        "stable": _stable(s),
        "displacement": np.stack([s.displacement(p) for p in places], axis=1),
        "strain energy": s.energy.strain[-1:],
        "potential of the loads": s.energy.potential,
    }


def _stable(s: at.Solution) -> str:
    """Whether each equilibrium under a part of the load is stable."""
    return "not known" if s.stable is None else str(s.stable[1:].tolist())


@group(name="equilibrium, cable")
@group(name="equilibrium, cable reduced", quadrature="reduced")
@group(name="equilibrium, cable lobatto", quadrature="lobatto")
@group(name="equilibrium, quintic", element="quintic")
@group(name="equilibrium, shear", element="shear")
def stick(v: Variation, **options: Any) -> Answers:
    """A clamped beam under a force and a torque at its end, and its weight."""
    loads = [at.Force("one.end", (0.02, 0.06)), at.Torque("one.end", 0.004)]
    made = scene("stick", [beam("one", A, (0.4, 0.3))], [START], loads, gravity=(0.5, -0.8))
    s = v.static(made, mesh=3, load_steps=2, **options)
    angle = {"angle": s.angle("one.end")}
    return (
        rest_of(s, "one.end", ("one", 0.4))
        | angle
        | reaction_of(s, START)
        | section_of(s, ("one", 0.0), ("one", 0.5))
    )


@group(name="equilibrium of joints and connectors")
def held(v: Variation) -> Answers:
    """Beams, a plate and a ball with pins, a slider, springs, and loads along a beam."""
    plate = at.RigidBody("plate", 0.06, 3e-4, (0.5, 0.18), {"a": B, "b": (0.62, 0.05), "c": (0.55, 0.3)})
    ball = at.PointMass("ball", 0.03, (0.95, 0.2))
    two = beam("two", (0.9, -0.1), (0.62, 0.05), FIRM, ROD)
    joints = [
        START,
        at.Pin("one.end", "plate.a"),
        at.Pin("plate.b", "two.end"),
        at.Slider("two.start", (1.0, 0.2)),
    ]
    connectors = [
        at.Spring("plate.c", "ball.center", stiffness=30.0, preload=0.15),
        at.Spring("ball.center", (1.2, 0.8), stiffness=25.0, length=0.6),
        at.RotationalSpring("one.end", "plate.a", stiffness=0.3, angle=0.1),
        at.RotationalSpring("two.start", stiffness=0.8),
    ]
    loads = [
        at.LineLoad("one", (0.5, -0.4)),
        at.Force(("two", 0.6), (0.1, 0.05)),
        at.Torque("plate.center", -0.01),
    ]
    s = v.static(scene("held", [ONE, plate, two, ball], joints, loads, connectors, (0.7, -1.1)), mesh=2)
    tension = {"tension": np.stack([s.tension(c)[-1:] for c in s.scene.connectors])}
    return rest_of(s, "plate.c", "two.start", "ball.center") | tension | reaction_of(s, *joints[1:])


@group(name="equilibrium of welds")
def frame(v: Variation) -> Answers:
    """Welds at an angle, straight ones, a grounded one, and clamps that leave the stretch free."""
    bodies = [ONE, TWO, beam("three", C, D, PLAIN, BLOCK), beam("side", B, (0.8, -0.1), PLAIN)]
    joints = [
        at.Clamp("one.start", stretch="free"),
        at.Weld("one.end", "two.end", "side.start"),
        at.Weld("two.start", "three.start", stretch="free"),
        at.Pin("three.end"),
    ]
    loads = [at.Torque("two.end", 0.01), at.Force("side.end", (0.05, 0.02))]
    s = v.static(scene("frame", bodies, joints, loads, gravity=(1.5, -2.5)), mesh=2, load_steps=2)
    return rest_of(s, "two.start", "side.end", ("three", 0.5)) | reaction_of(s, *joints)


@group(name="equilibrium, follower force and law")
def follower(v: Variation) -> Answers:
    """A force that turns with the end of a beam, which a law holds."""
    stay = at.Spring("one.end", (0.5, 0.9), law=_stay)
    made = scene(
        "follower", [ONE], [START], [at.Force("one.end", (0.02, -0.05), follower=True)], [stay], (0.0, 0.0)
    )
    s = v.static(made, mesh=3, load_steps=2)
    return {"displacement": s.displacement("one.end"), "tension": s.tension(s.scene.connectors[0])}


def _stay(elongation: float, rate: float, t: float) -> float:
    return 0.4 * elongation + 2.0 * elongation**3


@group(name="slack spring")
def slack(v: Variation) -> Answers:
    """A weight that hangs by a spring which lies level at first."""
    hang = at.Spring("one.end", "ball.center", stiffness=15.0)
    bodies = [ONE, at.PointMass("ball", 0.02, (0.8, 0.1))]
    s = v.static(scene("slack", bodies, [START], connectors=[hang], gravity=(0.6, -1.4)), mesh=1)
    return {
        "displacement": s.displacement("ball.center")[-1],
        "tension": s.tension(s.scene.connectors[0])[-1],
    }


@group(name="column beyond its critical load")
def column(v: Variation) -> Answers:
    """Straight, hardly bent, and where it comes to rest."""
    steel, section = at.Material(E=2.1e11, density=7850.0), at.Rectangle(0.03, 0.003)
    euler = np.pi**2 * steel.E * section.second_moment / 4

    def under_load(push: float, load: float) -> at.Scene:
        force = at.Force("one.end", (push * euler, -load * euler))
        return at.Scene("column", [at.Beam("one", A, (0.0, 1.0), section, steel)], [START], [force])

    straight = v.static(under_load(0.0, 1.1), mesh=8, load_steps=4)
    bent = v.static(under_load(0.05, 1.1), mesh=8, load_steps=4)
    found = v.static(under_load(0.0, 1.1), mesh=8, branch="stable")
    return {
        "status, straight": straight.status.code,
        "stable, straight": _stable(straight),
        "displacement, bent": bent.displacement("one.end"),
        "status, bent": bent.status.code,
        "displacement, found": np.abs(found.displacement("one.end")[-1]),
        "status, found": found.status.code,
    }


@group(name="path of a truss by arc length")
def truss(v: Variation) -> Answers:
    """Two bars that snap through: limit load factors, and the stable end."""
    bars = [beam("left", (-1.0, 0.0), (0.0, 0.3)), beam("right", (0.0, 0.3), (1.0, 0.0), PLAIN)]
    joints = [at.Pin("left.start"), at.Pin("left.end", "right.start"), at.Pin("right.end")]
    stay = at.Spring("left.end", (0.6, 1.4), stiffness=0.8)
    made = scene("truss", bars, joints, [at.Force("left.end", (0.4, -6.0))], [stay], (0.0, 0.0))
    s = v.static(made, mesh=1, load_steps=8, path="arclength")
    return {
        "limit load factors": _limits(s),
        "status": s.status.code,
        "displacement at the end": s.displacement("left.end")[-1],
        "stable at the end": str(_stable(s).endswith("True]")),
        "some of the path is unstable": str("False" in _stable(s)),
    }


def _limits(s: at.Solution) -> Any:
    """Load factors where the path turns."""
    turns = np.diff(np.sign(np.diff(s.t))) != 0.0
    return s.t[1:-1][turns]


@group(name="Lee's frame by arc length")
def lee(v: Variation) -> Answers:
    """Limit loads of Lee's frame on a coarse mesh."""
    E, section = at.Material(E=7.2e6, density=1.0), at.Rectangle(3.0, 2.0)
    bodies = [
        at.Beam("post", (0.0, 0.0), (0.0, 120.0), section, E),
        at.Beam("near", (0.0, 120.0), (24.0, 120.0), section, E),
        at.Beam("far", (24.0, 120.0), (120.0, 120.0), section, E),
    ]
    joints = [
        at.Pin("post.start"),
        at.Weld("post.end", "near.start"),
        at.Weld("near.end", "far.start"),
        at.Pin("far.end"),
    ]
    made = at.Scene("Lee", bodies, joints, [at.Force("near.end", (0.0, -20e3))])
    s = v.static(made, mesh={"post": 5, "near": 1, "far": 4}, path="arclength")
    limits = _limits(s)
    return {"limit load factors": limits, "status": s.status.code, "end": s.displacement("near.end")[-1]}
