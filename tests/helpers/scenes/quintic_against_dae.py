"""Scenes of quintic cables, and their motions by ANC-TMM and by the global DAE."""

from typing import Any

import numpy as np

import anctmm as at
from reference import global_dae

SOFT = at.Material(E=1e7, density=1000.0)
DAMPED = at.Material(E=1e7, density=1000.0, damping=1e-3)
THIN, THICK = at.Circle(0.02), at.Circle(0.03)
DOWN = (0.3, -1.0)
#: Steps of each integrator, s, and how many.
STEPS = {"zhai": (1e-5, 10), "generalized-alpha": (2e-3, 6)}


def swing(t: Any) -> tuple[Any, Any, Any]:
    """Angle of a drive, rad, and its derivatives."""
    s = 5.0 * np.asarray(t)
    return 0.2 * np.sin(s) ** 2, np.sin(2.0 * s), 10.0 * np.cos(2.0 * s)


def beam(
    name: str, start: Any, end: Any, section: Any = THIN, material: Any = SOFT, **options: Any
) -> at.Beam:
    """A beam of soft stuff."""
    return at.Beam(name, start, end, section, material, **options)


A = beam("a", (0.0, 0.0), (1.0, 0.0))
B = beam("b", (1.0, 0.0), (1.5, 0.5), THICK)
C = beam("c", (1.5, 0.5), (2.0, 0.5))
ROW = [A, B, C]
SQUARE = [
    A,
    beam("b", (1.0, 0.0), (1.0, 1.0), THICK),
    beam("c", (1.0, 1.0), (0.0, 1.0)),
    beam("d", (0.0, 1.0), (0.0, 0.0)),
]
ROW_JOINTS = [at.Pin("a.start", grounded=True), at.Weld("a.end", "b.start"), at.Pin("b.end", "c.start")]
LOOP_JOINTS = [
    at.Pin("a.start", "d.end", grounded=True),
    at.Weld("a.end", "b.start"),
    at.Weld("b.end", "c.start"),
    at.Pin("c.end", "d.start"),
]
PLATE = at.RigidBody("p", 0.3, 1e-3, (1.1, 0.0), points={"a": (1.0, 0.0), "b": (1.2, 0.1)})
BEHIND = beam("b", (1.2, 0.1), (1.5, 0.5), THICK)


def scene(bodies: Any, joints: Any, loads: Any = (), **options: Any) -> at.Scene:
    """A scene under its weight."""
    return at.Scene("quintic", bodies, joints, loads, gravity=DOWN, **options)


SCENES: dict[str, tuple[at.Scene, Any]] = {
    name: (made, "quintic")
    for name, made in {
        "clamped": scene([A], [at.Clamp("a.start")], [at.Force("a.end", (0.0, -0.3)), at.Torque(("a", 0.4), 0.05)]),
        "driven": scene([A], [at.Clamp("a.start", angle=swing)]),
        "driven at its end": scene([A], [at.Clamp("a.end", angle=swing)]),
        "row": scene(ROW, ROW_JOINTS, [at.LineLoad("b", (0.1, -1.0))]),
        "three at a weld": scene(
            [A, B, beam("c", (1.0, 0.0), (2.0, -0.5))],
            [at.Clamp("a.start"), at.Weld("a.end", "b.start", "c.start")],
            [at.Force(("c", 0.3), (0.1, -0.2))],
        ),
        "loop": scene(SQUARE, LOOP_JOINTS),
        "welded loop with an arm": scene(
            [*SQUARE, beam("e", (1.0, 0.0), (2.0, 0.0))],
            [
                at.Weld("a.start", "d.end"),
                at.Weld("a.end", "b.start", "e.start"),
                at.Weld("b.end", "c.start"),
                at.Weld("c.end", "d.start"),
                at.Pin("e.end", grounded=True),
            ],
        ),
        "free stretch": scene(
            [A, B], [at.Clamp("a.start", stretch="free"), at.Weld("a.end", "b.start", stretch="free")]
        ),
        "rigid body": scene(
            [A, PLATE, BEHIND], [at.Clamp("a.start"), at.Weld("a.end", "p.a"), at.Weld("p.b", "b.start")]
        ),
        "driven weld": scene([A, B], [at.Clamp("a.start"), at.Weld("a.end", "b.start", angle=swing)]),
        "guides": scene(
            [A, B],
            [at.Prismatic("a.start"), at.Weld("a.end", "b.start"), at.Slider("b.end", direction=(0.0, 1.0))],
        ),
        "damped": scene(
            [beam("a", (0.0, 0.0), (1.0, 0.0), material=DAMPED)],
            [at.Clamp("a.start")],
            [at.Force("a.end", (0.0, -0.2), follower=True)],
        ),
        "springs": scene(
            [A],
            [at.Clamp("a.start")],
            connectors=[
                at.Spring(("a", 0.3), (0.3, 1.0), stiffness=20.0, damping=0.1),
                at.RotationalSpring(("a", 0.7), stiffness=0.1),
            ],
        ),
        "thrown": scene(
            [beam("a", (0.0, 0.0), (1.0, 0.0), velocity=lambda s: (0.0, float(np.sin(2.0 * s))))],
            [at.Pin("a.start", grounded=True)],
        ),
    }.items()
} | {
    "row of three kinds": (scene(ROW, ROW_JOINTS), {"a": "quintic", "b": "cable", "c": "shear"}),
    "plain cable before": (scene(ROW, ROW_JOINTS), {"a": "cable", "b": "quintic", "c": "shear"}),
    "rigid bar behind": (scene(ROW, ROW_JOINTS), {"a": "cable", "b": "quintic", "c": "rigid"}),
    "rigid bar before": (scene(ROW, ROW_JOINTS), {"a": "rigid", "b": "quintic", "c": "cable"}),
    "loop of three kinds": (
        scene(SQUARE, LOOP_JOINTS),
        {"a": "cable", "b": "quintic", "c": "quintic", "d": "shear"},
    ),
}  # fmt: skip


def apart(name: str, integrator: str) -> tuple[str, float]:
    """How both solvers ended, and the largest difference of a coordinate."""
    made, element = SCENES[name]
    dt, steps = STEPS[integrator]
    rigid = {n for n, kind in element.items() if kind == "rigid"} if isinstance(element, dict) else set[str]()
    options = {
        "mesh": {body.name: 1 if body.name in rigid else 2 for body in made.beams},
        "element": element,
        "integrator": integrator,
        "dt": dt,
        "t_end": steps * dt,
        "newton_tolerance": 1e-12,
    }
    one, two = at.solve(made, **options), global_dae.solve(made, **options)
    fields: Any = one.fields
    others: Any = two.fields
    far = max(float(np.abs(f.coordinates - others[n].coordinates).max()) for n, f in fields.items())
    return f"{one.status.code} {two.status.code}", far
