"""Steps of fourth order with a tolerance: what it promises, what it costs, outputs within a step, what is refused."""

from functools import partial

import numpy as np
import pytest
from samples import acted_on, bar, linkage

import anctmm as at
from anctmm.integrators.adaptive import controlled_run, stage_control
from anctmm.model.drives import Quintic
from studies import scenes

GRAVITY = (0.0, -9.81)


def falling():
    """A beam let go: what lasts shorter than a step is of small amplitude there."""
    return bar([at.Clamp("bar.start")], gravity=GRAVITY)


def hinge():
    """A beam that a drive turns while its stretch is free."""
    return bar([at.Clamp("bar.start", Quintic(1.0, 0.15), stretch="free")], gravity=GRAVITY)


def struck():
    """A push that is shorter than a step and stated nowhere, and one that jumps."""

    def push(t):
        return (0.0, 8.0 * np.exp(-(((t - 0.0713) / 0.002) ** 2)))

    jump = at.History(lambda t: (0.0, 0.2 if t >= 0.11 else 0.0), breaks=(0.11,))
    return bar([at.Pin("bar.start")], loads=[at.Force("bar.end", push), at.Force("bar.end", jump)])


#: Scenes, and the step of their reference, s.
SCENES = {
    "falling": (falling, 1e-3),
    "hinge": (hinge, 1e-3),
    "linkage": (partial(linkage, 0.1), 1e-3),
    "struck": (struck, 2.5e-4),
    "acted on": (acted_on, 2.5e-3),
}
RUN = {"t_end": 0.2, "output_dt": 0.01, "integrator": "esdirk"}


def mesh_of(scene):
    return 1 if len(scene.beams) > 1 else 2


@pytest.mark.parametrize("name", SCENES)
def test_errors_stay_within_three_times_what_is_asked(name):
    make, dt = SCENES[name]
    scene = make()
    options, probes = RUN | {"mesh": mesh_of(scene)}, [f"{b.name}.end" for b in scene.beams]
    reference = at.solve(scene, dt=dt, newton_tolerance=1e-9, **options)
    for tolerance in (1e-2, 1e-3, 1e-4):
        run = at.solve(scene, tolerance=tolerance, **options)
        assert run.status.ok, run.status
        assert at.compare(run, reference, probes).error <= 3.0 * tolerance
        made = np.abs(run.energy.balance).max()
        assert made <= 6.0 * tolerance * np.abs(reference.energy.kinetic).max() + 1e-12


def test_outputs_within_steps_lie_on_the_motion():
    """Some steps hold more than one output; where the quintic is no motion, steps end at the outputs."""
    scene = linkage(0.1)
    options = RUN | {"mesh": 1}
    many = at.solve(scene, tolerance=1e-3, **options | {"output_dt": 6.25e-4})
    assert many.cost.steps < 0.9 * len(many.t)
    fine = at.solve(scene, dt=6.25e-4, **options | {"output_dt": 6.25e-4})
    for body in scene.beams:
        ours, exact = many.fields[body.name], fine.fields[body.name]
        assert np.abs(ours.coordinates - exact.coordinates)[:, :, 0].max() < 2e-4  # m
        speed = np.abs(exact.velocities).max()
        assert np.abs(ours.velocities - exact.velocities).max() < 0.2 * speed
    turned = [many.angle("crank", 0.0), fine.angle("crank", 0.0)]
    assert np.abs(turned[0] - turned[1]).max() < 1e-12  # of the drive, whatever the steps


def test_a_history_saved_and_loaded_says_what_drove_its_steps(tmp_path):
    run = at.solve(falling(), mesh=1, tolerance=1e-3, **RUN)
    run.save(tmp_path / "run")
    again = at.load(tmp_path / "run")
    assert (again.run.integrator, again.run.tolerance) == ("esdirk", 1e-3)
    assert again.cost.steps == run.cost.steps
    assert np.array_equal(again.position("bar.end"), run.position("bar.end"))


def test_a_motion_that_blows_up_is_named_and_its_history_kept():
    scene = bar(
        [at.Clamp("bar.start")], loads=[at.Force("bar.end", lambda t: (0.0, -1e9 if t > 0.1 else 0.0))]
    )
    run = at.solve(scene, mesh=2, tolerance=1e-3, **RUN)
    assert run.status == "diverged"
    assert 0.09 <= run.status.time <= 0.2
    assert run.t[-1] <= run.status.time + 0.01


def test_a_tolerance_that_asks_for_less_than_rounding_is_told():
    """The advice was a finer mesh, of a scene without beams, or a load that does not jump, where none does."""
    body = at.RigidBody("body", 1.0, 0.1, (0.5, 0.0), points={"o": (0.0, 0.0)})
    scene = at.Scene("pendulum", [body], [at.Pin("body.o")], gravity=GRAVITY)
    for integrator in ("esdirk", "generalized-alpha"):
        run = at.solve(scene, integrator=integrator, tolerance=1e-15, t_end=0.2, output_dt=0.1)
        assert run.status == "diverged"
        assert "tolerance 1e-15 of a motion of" in run.status.message
        assert "a larger tolerance is needed" in run.status.message
        assert "mesh" not in run.status.message


@pytest.mark.interpreted
@pytest.mark.parametrize(("t_end", "tolerance"), [(1e7, 1e-2), (1e3, 1e-9)])
def test_a_long_run_starts_with_steps_as_short_as_it_needs(t_end, tolerance):
    """A mass that a damper stops within 0.1 s. A bound of 1e-9 of the run, or rounding taken for an error, ended it."""
    frequency, speed = 100.0, 50.0
    ball = at.PointMass("ball", 1.0, (1.0, 0.0), velocity=(speed, 0.0))
    spring = at.Spring("ball.center", (0.0, 0.0), length=1.0, stiffness=frequency**2, damping=frequency)
    scene = at.Scene("stopped", [ball], connectors=[spring])
    run = at.solve(scene, t_end=t_end, output_dt=t_end, tolerance=tolerance, integrator="esdirk")
    assert run.status.ok, run.status
    assert run.cost.steps < 5000
    assert run.energy.work[-1] == pytest.approx(-0.5 * speed**2, rel=tolerance)
    assert np.abs(run.displacement("ball.center")[-1]).max() < tolerance


#: Base scenes and their meshes.
BASE = {
    "four-bar": (scenes.four_bar, {"crank": 2, "coupler": 8, "follower": 2}),
    "four-bar-moment": (scenes.four_bar_moment, {"crank": 2, "coupler": 8, "follower": 2}),
    "fall": (scenes.cantilever_fall, 8),
}


@pytest.fixture(scope="module", params=BASE)
def base(request):
    """A base scene, its options and a reference."""
    make, mesh = BASE[request.param]
    found = make()
    options = {"mesh": mesh, "t_end": found.t_end, "output_dt": 0.01, "integrator": "esdirk"}
    return found, options, at.solve(found.scene, dt=1.25e-3 / 4, newton_tolerance=1e-10, **options)


@pytest.mark.compiled
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-5])
def test_base_scenes_keep_the_promise(base, tolerance):
    """four-bar-moment moves freely: what Newton's iteration leaves of a velocity once stays until the end."""
    scene, options, reference = base
    run = at.solve(scene.scene, tolerance=tolerance, **options)
    assert run.status.ok, run.status
    assert at.compare(run, reference, scene.probes).error <= 3.0 * tolerance


def kicked(damping):
    """A stiff damped bar at whose end a force jumps: what vibrates dies out within a small part of the run."""
    steel = at.Material(E=2e11, density=7850.0, damping=damping)
    rod = at.Beam("rod", (0.0, 0.0), (1.0, 0.0), at.Circle(0.02), steel)
    push = at.Force("rod.end", at.History(lambda t: (5.0, 50.0 if t >= 0.1 else 0.0), breaks=(0.1,)))
    return at.Scene("kicked", [rod], [at.Pin("rod.start")], [push], gravity=GRAVITY)


def test_steps_grow_soon_after_what_has_died_out(monkeypatch):
    """By the mean of errors alone, one twentieth of the difference at each step, it took 1.5 times the steps."""
    options = RUN | {"mesh": 1, "tolerance": 1e-4, "t_end": 0.5, "output_dt": 0.1}
    with monkeypatch.context() as slow:
        slow.setattr(stage_control, "FADES", 1.0)
        before = at.solve(kicked(1e-3), **options)
    after = at.solve(kicked(1e-3), **options)
    assert after.status.ok
    assert after.cost.steps < 0.8 * before.cost.steps
    assert at.compare(after, before, ["rod.end"]).error <= 1e-4


def test_corrections_of_gradients_count_as_the_displacements_that_they_make(monkeypatch):
    """That saves corrections, for errors as small as was asked; a bound of the user's is of Newton's own size."""
    options = RUN | {"mesh": 2}
    fine = at.solve(hinge(), dt=2.5e-4, newton_tolerance=1e-9, **options)
    options["tolerance"] = 1e-4
    ours, bounded = (at.solve(hinge(), **options | bound) for bound in ({}, {"newton_tolerance": 1e-2}))
    monkeypatch.setattr(controlled_run, "_by_gradient", lambda *_: 1.0)
    dearer = at.solve(hinge(), **options)
    assert ours.cost.newton_iterations < 0.9 * dearer.cost.newton_iterations
    assert bounded.cost.newton_iterations == dearer.cost.newton_iterations
    assert at.compare(ours, fine, ["bar.end"]).error <= 1e-4
