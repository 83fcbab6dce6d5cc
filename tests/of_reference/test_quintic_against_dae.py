"""Motion of quintic cables beside the global DAE: every joint, load and mixture of kinds, explicit and implicit."""

from functools import partial

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

SOFT = at.Material(E=1e7, density=1000.0)
DAMPED = at.Material(E=1e7, density=1000.0, damping=1e-3)
#: Steps of each integrator, s, and how many; largest difference of a coordinate, m or 1, that rounding and Newton's
#: tolerance may make.
STEPS = {"zhai": (1e-5, 10, 1e-13), "generalized-alpha": (2e-3, 6, 1e-9)}


def swing(t):
    """Angle of a drive, rad, and its derivatives."""
    s = 5.0 * np.asarray(t)
    return 0.2 * np.sin(s) ** 2, np.sin(2.0 * s), 10.0 * np.cos(2.0 * s)


beam = partial(at.Beam, section=at.Circle(0.02), material=SOFT)
scene = partial(at.Scene, "quintic", gravity=(0.3, -1.0))
clamp, weld = at.Clamp("a.start"), at.Weld("a.end", "b.start")
A, C = beam("a", (0.0, 0.0), (1.0, 0.0)), beam("c", (1.5, 0.5), (2.0, 0.5))
B = beam("b", (1.0, 0.0), (1.5, 0.5), section=at.Circle(0.03))
# fmt: off
SQUARE = [
    A, beam("b", (1.0, 0.0), (1.0, 1.0), section=at.Circle(0.03)), beam("c", (1.0, 1.0), (0.0, 1.0)),
    beam("d", (0.0, 1.0), (0.0, 0.0)),
]
ROW = scene([A, B, C], [at.Pin("a.start"), weld, at.Pin("b.end", "c.start")], [at.LineLoad("b", (0.1, -1.0))])
LOOP = scene(SQUARE, [at.Pin("a.start", "d.end", grounded=True), weld, at.Weld("b.end", "c.start"),
                      at.Pin("c.end", "d.start")])
PLATE = at.RigidBody("p", 0.3, 1e-3, (1.1, 0.0), points={"a": (1.0, 0.0), "b": (1.2, 0.1)})
SCENES = {
    "clamped": scene([A], [clamp], [at.Force("a.end", (0.0, -0.3)), at.Torque(("a", 0.4), 0.05)]),
    "driven": scene([A], [at.Clamp("a.start", angle=swing)]),
    "driven at its end": scene([A], [at.Clamp("a.end", angle=swing)]),
    "row": ROW,
    "three at a weld": scene([A, B, beam("c", (1.0, 0.0), (2.0, -0.5))],
                             [clamp, at.Weld("a.end", "b.start", "c.start")], [at.Force(("c", 0.3), (0.1, -0.2))]),
    "loop": LOOP,
    "welded loop with an arm": scene(
        [*SQUARE, beam("e", (1.0, 0.0), (2.0, 0.0))],
        [at.Weld("a.start", "d.end"), at.Weld("a.end", "b.start", "e.start"), at.Weld("b.end", "c.start"),
         at.Weld("c.end", "d.start"), at.Pin("e.end")]),
    "free stretch": scene([A, B], [at.Clamp("a.start", stretch="free"), at.Weld("a.end", "b.start", stretch="free")]),
    "rigid body": scene([A, PLATE, beam("b", (1.2, 0.1), (1.5, 0.5))],
                        [clamp, at.Weld("a.end", "p.a"), at.Weld("p.b", "b.start")]),
    "driven weld": scene([A, B], [clamp, at.Weld("a.end", "b.start", angle=swing)]),
    "guides": scene([A, B], [at.Prismatic("a.start"), weld, at.Slider("b.end", direction=(0.0, 1.0))]),
    "damped": scene([beam("a", (0.0, 0.0), (1.0, 0.0), material=DAMPED)], [clamp],
                    [at.Force("a.end", (0.0, -0.2), follower=True)]),
    "springs": scene([A], [clamp], connectors=[at.Spring(("a", 0.3), (0.3, 1.0), stiffness=20.0, damping=0.1),
                                               at.RotationalSpring(("a", 0.7), stiffness=0.1)]),
    "thrown": scene([beam("a", (0.0, 0.0), (1.0, 0.0), velocity=lambda s: (0.0, float(np.sin(2.0 * s))))],
                    [at.Pin("a.start")]),
}
MIXED = {
    "row of three kinds": (ROW, {"a": "quintic", "b": "cable", "c": "shear"}),
    "plain cable before": (ROW, {"a": "cable", "b": "quintic", "c": "shear"}),
    "rigid bar behind": (ROW, {"a": "cable", "b": "quintic", "c": "rigid"}),
    "rigid bar before": (ROW, {"a": "rigid", "b": "quintic", "c": "cable"}),
    "loop of three kinds": (LOOP, {"a": "cable", "b": "quintic", "c": "quintic", "d": "shear"}),
}
# fmt: on


@pytest.mark.parametrize("integrator", STEPS)
@pytest.mark.parametrize("name", [*SCENES, *MIXED])
def test_motions_are_those_of_the_global_dae(name, integrator):
    made, element = MIXED[name] if name in MIXED else (SCENES[name], "quintic")
    dt, steps, allowed = STEPS[integrator]
    mesh = {b.name: 1 if element != "quintic" and element[b.name] == "rigid" else 2 for b in made.beams}
    options = {"dt": dt, "t_end": steps * dt, "integrator": integrator, "newton_tolerance": 1e-12}
    one, two = (f(made, mesh=mesh, element=element, **options) for f in (at.solve, global_dae.solve))
    assert one.status.ok
    assert two.status.ok
    for body, field in one.fields.items():
        assert np.abs(field.coordinates - two.fields[body].coordinates).max() < allowed
