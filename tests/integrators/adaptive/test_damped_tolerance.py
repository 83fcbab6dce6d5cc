"""Error-controlled steps of damped materials: the global equations with fine steps, and where the energy goes."""

from dataclasses import replace

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

RUBBER = at.Material(E=1e7, density=1000.0, damping=1e-3)
SQUARE = at.Rectangle(0.02, 0.02)
OPTIONS = {"mesh": 2, "t_end": 0.2, "output_dt": 0.02, "integrator": "generalized-alpha"}
PROBES = ["bar.end", "tail.end"]


def falling(material=RUBBER, joints=None):
    """Two beams of different damping, turned or held at their start, that fall."""
    bodies = [
        at.Beam("bar", (0.0, 0.0), (0.4, 0.0), SQUARE, material),
        at.Beam("tail", (0.4, 0.0), (0.7, 0.0), SQUARE, replace(material, damping=0.2 * material.damping)),
    ]
    start = joints or at.Clamp("bar.start")
    return at.Scene("damped", bodies, (start, at.Pin("bar.end", "tail.start")), gravity=(0.0, -9.81))


SCENES = {
    "held": falling(),
    "strong": falling(replace(RUBBER, damping=5e-2)),
    "turned": falling(joints=at.Clamp("bar.start", angle=at.Quintic(turn=0.8, duration=0.15))),
    "pulled": replace(falling(), loads=[at.Force("tail.end", lambda t: (0.0, 20.0 * t))]),
}


@pytest.mark.exhaustive
@pytest.mark.compiled
@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("name", SCENES)
def test_a_small_tolerance_tends_to_the_global_equations_and_keeps_the_promise_on_the_way(name, element):
    scene = SCENES[name]
    dae = global_dae.solve(scene, element=element, dt=1e-4, newton_tolerance=1e-9, **OPTIONS)
    assert dae.status.ok
    for tolerance in (1e-2, 1e-3, 1e-4):
        ours = at.solve(scene, element=element, tolerance=tolerance, **OPTIONS)
        assert ours.status.ok, ours.status
        assert at.compare(ours, dae, PROBES).error <= 3.0 * tolerance


@pytest.mark.parametrize("damping", [1e-3, 5e-2])
def test_damping_takes_the_energy_that_the_global_equations_lose(damping):
    scene = falling(replace(RUBBER, damping=damping))
    run = {"mesh": 1, "t_end": 0.1, "output_dt": 0.02, "integrator": "generalized-alpha"}
    ours = at.solve(scene, tolerance=1e-3, **run)
    dae = global_dae.solve(scene, dt=2e-4, newton_tolerance=1e-9, **run)
    lost = np.abs(dae.energy.work).max()
    assert lost > 0.0
    assert np.abs(ours.energy.work - dae.energy.work).max() < 0.02 * lost
    assert np.abs(ours.energy.balance).max() < 0.02 * lost + 1e-2 * np.abs(dae.energy.kinetic).max()


def test_without_damping_nothing_is_added_to_the_kernels_arguments():
    elastic = replace(RUBBER, damping=0.0)
    run = {"mesh": 1, "tolerance": 1e-2, "t_end": 0.02, "output_dt": 0.01, "integrator": "generalized-alpha"}
    plain, slight = (at.solve(falling(m), **run) for m in (elastic, replace(elastic, damping=1e-12)))
    assert plain.cost.steps == slight.cost.steps
    assert np.abs(plain.position("tail.end") - slight.position("tail.end")).max() < 1e-8


def frame(away):
    """An angled frame with a plate on a slider, let go under its load; `away` from the origin, m."""

    def at_(x, y):
        return (x + away, y - away)

    material = at.Material(E=2e8, density=1200.0, damping=1e-4)
    bodies = [
        at.Beam("level", at_(0, 0), at_(1, 0), SQUARE, material),
        at.Beam("post", at_(1, 0), at_(1.3, 0.6), SQUARE, material),
        at.RigidBody("plate", 0.4, 0.01, at_(1.3, 0.7), {"p": at_(1.3, 0.6), "q": at_(1.5, 0.7)}),
    ]
    joints = [
        at.Clamp("level.start"),
        at.Weld("level.end", "post.start"),
        at.Pin("post.end", "plate.p"),
        at.Slider("plate.q", (1, 0.2)),
    ]
    loads = [
        at.Force("level.end", (-1.0, 2.0)),
        at.Force("plate.center", (5.0, -3.0), follower=True),
        at.LineLoad("level", (0.5, -2.0)),
    ]
    return at.Scene("frame", bodies, joints, loads, gravity=(1.0, -9.81))


@pytest.mark.compiled
@pytest.mark.parametrize("away", [0.0, 1e4])
def test_a_frame_that_no_long_step_can_move_is_seen_to_move(away):
    """Errors were relative to a millionth of its size: 7,561 steps, and from 1 km off the origin on it diverged."""
    run = at.solve(
        frame(away), mesh={"level": 8, "post": 4}, integrator="generalized-alpha", tolerance=1e-3, t_end=0.4,
        output_dt=0.02,
    )  # fmt: skip
    assert run.status.ok, run.status
    assert run.cost.steps < 2000


def rope(damping):
    """Two ropes that a mass pulls straight as it falls between their ends."""
    material = at.Material(E=1e9, density=1200.0, damping=damping)
    bodies = [
        at.Beam("left", (0, 0), (5, -1), at.Circle(0.012), material),
        at.Beam("right", (5, -1), (10, 0), at.Circle(0.012), material),
        at.PointMass("mass", 50.0, (5, -1)),
    ]
    joints = [at.Pin("left.start"), at.Pin("right.end"), at.Pin("left.end", "right.start", "mass.center")]
    return at.Scene("rope", bodies, joints, gravity=(0.0, -9.81))


@pytest.mark.compiled
@pytest.mark.parametrize("element", ["cable", "quintic", "shear"])
def test_damping_of_what_is_under_tension_costs_no_corrections(element):
    """Fixed steps diverged, and controlled ones were six times as many: stresses of the matrix were too large."""
    run = {"mesh": 4, "t_end": 0.5, "output_dt": 0.1, "element": element, "dt": 1e-2}
    free, damped = (at.solve(rope(tau), integrator="esdirk", **run) for tau in (0.0, 1e-2))
    assert damped.status.ok, damped.status
    assert damped.cost.newton_iterations < 1.5 * free.cost.newton_iterations
    implicit = at.solve(rope(1e-2), integrator="generalized-alpha", **run)
    assert implicit.status.ok, implicit.status


@pytest.mark.compiled
def test_strong_damping_of_what_is_under_tension_needs_no_small_steps():
    """It took 379 steps with 6.3 factorizations each."""
    run = at.solve(rope(0.1), mesh=6, t_end=1.0, output_dt=0.1, tolerance=1e-2)
    assert run.status.ok
    assert run.cost.steps < 150


@pytest.mark.parametrize(
    ("E", "damping", "t_end", "tolerance"),
    [
        (5e7, 1e-2, 5.0, 1e-4),
        (5e7, 1e-2, 5.0, 1e-5),
        (2e9, 1e-2, 10.0, 1e-4),
        (2e9, 1e-2, 10.0, 1e-5),
        (5e8, 0.1, 3.0, 1e-5),
    ],
)
def test_a_pendulum_of_one_damped_beam_keeps_its_promise(E, damping, t_end, tolerance):
    """A step takes a part of its speed, of an order less than the estimate: it missed by 5.6 to 15 times."""
    rod = at.Beam("rod", (0, 0), (0.8, 0), at.Circle(0.02), at.Material(E, 1100.0, damping=damping))
    scene = at.Scene("pendulum", [rod], [at.Pin("rod.start")], gravity=(0, -9.81))
    run = {"mesh": 4, "t_end": t_end, "output_dt": 0.1}
    fine = at.solve(scene, dt=2.5e-4, integrator="esdirk", newton_tolerance=1e-12, **run)
    found = at.solve(scene, tolerance=tolerance, **run)
    assert found.status.ok, found.status
    assert at.compare(found, fine, ["rod.end"]).error < 3.0 * tolerance
