"""Whole turns that sections make, or do not make, between two outputs."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

ROD, RUBBER = at.Rectangle(0.02, 0.02), at.Material(E=5e6, density=1100.0)


def crank():
    """A soft arm that turns once from rest to rest, a plate welded to it and a rotor that turns against the plate."""
    arm = at.Beam("arm", (0, 0), (0.2, 0), ROD, RUBBER)
    plate = at.RigidBody("plate", 0.05, 1e-4, (0.2, 0.02), points={"a": (0.2, 0)})
    rotor = at.RigidBody("rotor", 0.02, 1e-5, (0.2, 0.02))
    joints = [
        at.Clamp("arm.start", angle=at.Quintic(2.0 * pi, 2.0)),
        at.Weld("arm.end", "plate.a"),
        at.Weld("plate.center", "rotor.center", angle=at.Quintic(-6.0 * pi, 2.0)),
    ]
    springs = [
        at.RotationalSpring("arm.start", stiffness=1e-4),
        at.RotationalSpring("rotor.center", stiffness=1e-4),
    ]
    return at.Scene("crank", [arm, plate, rotor], joints, gravity=(0, -1.0), connectors=springs)


@pytest.fixture(scope="module")
def often():
    """Told at each step, where velocities count all turns."""
    return at.solve(crank(), mesh=1, dt=0.02, t_end=2.0)


@pytest.mark.parametrize("output", [1.0, 2.0])
def test_turns_from_rest_to_rest_are_those_of_the_drive(often, output):
    """The angle was that without the turn, and so the springs' moments and the reactions."""
    rare = at.solve(crank(), mesh=1, dt=0.02, t_end=2.0, output_dt=output)
    assert rare.status.ok
    assert rare.angle("arm.start")[-1] == pytest.approx(2.0 * pi, abs=1e-9)
    for place in ("arm.start", ("arm", 0.7), "arm.end", "plate.center", "rotor.center"):
        assert rare.angle(place)[-1] == pytest.approx(often.angle(place)[-1], abs=1e-9)
    for spring in crank().connectors:
        assert rare.tension(spring)[-1] == pytest.approx(often.tension(spring)[-1], abs=1e-12)
        assert abs(rare.tension(spring)[-1]) > 1e-4
    for joint in crank().joints:
        np.testing.assert_allclose(rare.reaction(joint)[-1], often.reaction(joint)[-1], atol=1e-9)


def arms(E=5e7):
    """An arm that turns once from rest to rest, and one that turns against it three times the other way."""
    rubber = at.Material(E, density=1100.0)
    one = at.Beam("one", (0, 0), (0.2, 0), ROD, rubber)
    two = at.Beam("two", (0.2, 0), (0.3, 0), ROD, rubber)
    drives = at.Quintic(2.0 * pi, 2.0), at.Quintic(-6.0 * pi, 2.0)
    return at.Scene(
        "arms",
        [one, two],
        [at.Clamp("one.start", drives[0]), at.Weld("one.end", "two.start", angle=drives[1])],
    )


SERIES = ("coordinates", "velocities", "accelerations", "start_angle")


def with_fewer_outputs(solution, every):
    """What a run with fewer outputs gives: each step is the same."""

    def fewer(field):
        return replace(
            field, **{name: x[::every] for name in SERIES if (x := getattr(field, name)) is not None}
        )

    fields = {name: fewer(field) for name, field in solution.fields.items()}
    return replace(solution, t=solution.t[::every], fields=fields)


@pytest.mark.parametrize("make", [crank, arms])
def test_the_global_dae_counts_them_too(make):
    """It lost them where outputs are rare: a driven joint's angle was that without the turn."""
    scene, steps = make(), {"mesh": 1, "dt": 0.02, "t_end": 2.0}
    often = at.solve(scene, **steps)
    assert often.status.ok
    found = global_dae.solve(scene, **steps)
    assert found.status.ok
    for every in (50, 100):
        rare = with_fewer_outputs(found, every)
        for body in scene.bodies:
            rigid = isinstance(body, at.RigidBody)
            for place in [f"{body.name}.center"] if rigid else [(body.name, x) for x in (0.0, 0.6, 1.0)]:
                assert rare.angle(place)[-1] == pytest.approx(often.angle(place)[-1], abs=1e-7)
        for spring in scene.connectors:
            assert rare.tension(spring)[-1] == pytest.approx(often.tension(spring)[-1], abs=1e-10)


def test_exudyn_counts_them_too():
    pytest.importorskip("exudyn", reason="Exudyn (extra `peers`) is not installed")
    from reference.exudyn import cable

    scene = crank()
    scene = at.Scene(
        "crank",
        scene.bodies,
        [*scene.joints[:2], at.Pin("plate.center", "rotor.center")],
        scene.loads,
        scene.gravity,
    )
    often = at.solve(scene, mesh=1, dt=0.02, t_end=2.0)
    rare = cable.solve(scene, mesh=1, dt=0.02, t_end=2.0, output_dt=2.0)
    assert rare.status.code == "ok", rare.status
    for place in ("arm.start", "arm.end", "plate.center"):
        assert rare.angle(place)[-1] == pytest.approx(often.angle(place)[-1], abs=1e-3)


def test_the_turns_are_saved(tmp_path):
    rare = at.solve(crank(), mesh=1, dt=0.02, t_end=2.0, output_dt=2.0)
    again = at.load(rare.save(tmp_path / "rare.npz"))
    assert np.array_equal(again.angle("rotor"), rare.angle("rotor"))
    assert rare.until(1, rare.status).angle("rotor") == 0.0


def test_a_motion_that_starts_from_an_equilibrium_counts_from_there():
    """The arm of a clamp that has turned is bent: its end is counted from what it had in the equilibrium."""
    scene = crank()
    rest = at.solve_static(scene, mesh=1)
    rare = at.solve(scene, start=rest, mesh=1, dt=0.02, t_end=2.0, output_dt=2.0)
    assert rare.angle("arm.start")[-1] == pytest.approx(2.0 * pi, abs=1e-9)
    assert rare.tension(scene.connectors[0])[-1] == pytest.approx(2.0 * pi * 1e-4, abs=1e-9)


def hanging():
    """A soft arm that is let go, and swings to and fro with a plate at its end."""
    arm = at.Beam("arm", (0, 0), (1.0, 0), ROD, RUBBER)
    plate = at.RigidBody("plate", 0.05, 1e-4, (1.0, 0.02), points={"a": (1.0, 0)})
    springs = [
        at.RotationalSpring("arm.end", stiffness=1e-3),
        at.RotationalSpring("plate.center", stiffness=1e-3),
    ]
    joints = [at.Clamp("arm.start"), at.Weld("arm.end", "plate.a")]
    return at.Scene("hanging", [arm, plate], joints, gravity=(0, -9.81), connectors=springs)


def tumbling():
    """A soft beam, free, that turns at a steady rate and shakes."""
    motion = at.RigidVelocity((0.0, 0.0), (1.0, 0.0), center=(0.5, 0.0), spin=3.0)
    beam = at.Beam("beam", (0, 0), (1.0, 0), ROD, RUBBER, velocity=motion)
    push = at.Force("beam.end", lambda t: (0.0, 1.5 * at.Pulse(1.0, 0.1)(t)))
    return at.Scene("tumbling", [beam], loads=[push])


@pytest.mark.parametrize(
    "make", [hanging, tumbling, lambda: arms(5e6)], ids=["hanging", "tumbling", "soft arms"]
)
def test_vibrations_are_no_turns(make):
    """The rates of vibrations, times the way to the next output, were taken for turns, with status ok."""
    scene = make()
    often = at.solve(scene, mesh=2, dt=5e-3, t_end=2.0)
    assert often.status.ok
    for every in (100, 200, 400):
        rare = with_fewer_outputs(often, every)
        for body in scene.bodies:
            beam = isinstance(body, at.Beam)
            for place in [(body.name, x) for x in (0.0, 0.3, 0.5, 1.0)] if beam else [f"{body.name}.center"]:
                angle = often.angle(place)
                assert np.abs(np.diff(angle)).max() < 1.0  # so that there is no doubt about these
                np.testing.assert_allclose(rare.angle(place), angle[::every], atol=1e-9)
        for spring in scene.connectors:
            np.testing.assert_allclose(rare.tension(spring), often.tension(spring)[::every], atol=1e-12)


def pendulum():
    """A bar that swings from the level by half a turn, to and fro."""
    bar = at.RigidBody("bar", 1.0, 1.0 / 12.0, (0.5, 0), points={"a": (0, 0)})
    return at.Scene("pendulum", [bar], [at.Pin("bar.a")], gravity=(0, -9.81))


def double():
    """Two bars, of which a spring counts the turns of the second one."""
    one = at.RigidBody("one", 1.0, 0.1, (0, 0.5), points={"a": (0, 0), "b": (0, 1)})
    two = at.RigidBody("two", 0.5, 0.05, (0.4, 1), points={"b": (0, 1)}, spin=20.0, velocity=(0.0, 8.0))
    joints = [at.Pin("one.a"), at.Pin("one.b", "two.b")]
    springs = [at.RotationalSpring("two.center", stiffness=1e-4)]
    return at.Scene("double", [one, two], joints, gravity=(0, -9.81), connectors=springs)


def swinging():
    """A soft arm drawn from its tip to its pin, with a plate welded to its middle."""
    arm = at.Beam("arm", (-0.5, 0.1), (0, 0), ROD, RUBBER)
    plate = at.RigidBody("plate", 0.05, 1e-4, (-0.25, 0.06), points={"a": (-0.25, 0.05)})
    joints = [at.Weld(("arm", 0.5), "plate.a"), at.Pin("arm.end")]
    return at.Scene("swinging", [plate, arm], joints, gravity=(0, -9.81))


#: Python takes these steps, but of soft arms, which need smaller ones: those are for long looks, compiled.
STEPS = {
    "zhai": {"integrator": "zhai", "dt": 2e-3},
    "alpha": {"integrator": "generalized-alpha", "dt": 2e-3},
    "esdirk": {"integrator": "esdirk", "dt": 0.02},
}
SOFT = {
    "zhai": {"integrator": "zhai", "dt": 2e-4},
    "alpha": {"integrator": "generalized-alpha", "dt": 2e-3},
    "esdirk": {"integrator": "esdirk", "dt": 4e-3},
}
LONG = [pytest.mark.exhaustive, pytest.mark.compiled]


def angles(solution):
    """By body its angle, (n,), rad."""
    names = [body.name for body in solution.scene.bodies]
    return {name: solution.angle((name, 1.0) if name == "arm" else name) for name in names}


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("make", [pendulum, double, pytest.param(swinging, marks=LONG)])
def test_turns_of_what_is_free_to_turn_are_counted_in_the_steps(make, steps):
    """They were guessed from the rates at outputs: a pendulum seen once a period was wrong by four turns."""
    scene, run = make(), {"mesh": 2, **SOFT[steps]} if make is swinging else STEPS[steps]
    often = at.solve(scene, t_end=2.4, output_dt=0.02, **run)
    rare = at.solve(scene, t_end=2.4, output_dt=1.2, **run)
    assert often.status.ok
    assert rare.status.ok
    for name, angle in angles(often).items():
        assert np.abs(np.diff(angle)).max() < 1.5  # so that there is no doubt about these
        np.testing.assert_allclose(angles(rare)[name], angle[::60], atol=1e-9)
    for spring in scene.connectors:
        np.testing.assert_allclose(rare.tension(spring), often.tension(spring)[::60], atol=1e-9)


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
@pytest.mark.parametrize("make", [pendulum, pytest.param(swinging, marks=LONG)])
def test_they_are_counted_where_an_error_drives_the_steps(make, integrator):
    scene, mesh = make(), {"mesh": 2} if make is swinging else {}
    run = {"t_end": 2.4, "tolerance": 1e-4, "integrator": integrator, **mesh}
    often, rare = (at.solve(scene, output_dt=dt, **run) for dt in (0.02, 1.2))
    assert often.status.ok
    assert rare.status.ok
    for name, angle in angles(often).items():
        np.testing.assert_allclose(angles(rare)[name], angle[::60], atol=0.05)


def test_rates_at_outputs_do_not_tell_them():
    """What a solver that does not count them gives."""
    rare = at.solve(pendulum(), t_end=2.4, output_dt=1.2, **STEPS["alpha"])
    fields = {name: replace(field, start_angle=None) for name, field in rare.fields.items()}
    assert abs(replace(rare, fields=fields).angle("bar")[1] - rare.angle("bar")[1]) > 6.0


def arm():
    """A soft arm alone."""
    beam = at.Beam("arm", (0, 0), (-0.5, 0), ROD, RUBBER)
    return at.Scene("arm", [beam], [at.Pin("arm.start")], gravity=(0, -9.81))


@pytest.mark.parametrize(
    ("make", "steps"),
    [
        (pendulum, STEPS["zhai"]),
        (arm, SOFT["alpha"]),
        pytest.param(double, STEPS["alpha"], marks=LONG),
        pytest.param(arm, SOFT["esdirk"], marks=LONG),
        pytest.param(arm, SOFT["zhai"], marks=LONG),
        pytest.param(swinging, SOFT["alpha"], marks=LONG),
    ],
)
def test_the_global_dae_counts_free_turns_too(make, steps):
    scene, mesh = make(), {} if make in (pendulum, double) else {"mesh": 2}
    run = {"t_end": 2.4, "output_dt": 1.2, **mesh, **steps}
    ours, other = at.solve(scene, **run), global_dae.solve(scene, **run)
    assert ours.status.ok
    assert other.status.ok
    for name, angle in angles(other).items():
        np.testing.assert_allclose(angle, angles(ours)[name], atol=1e-2)


def test_a_file_has_the_turns_of_a_drive_whose_function_it_has_not(tmp_path):
    arm = at.Beam("arm", (0, 0), (0.2, 0), ROD, RUBBER)
    turn = at.Clamp("arm.start", angle=lambda t: at.Quintic(2.0 * pi, 2.0)(t))
    rare = at.solve(at.Scene("arm", [arm], [turn]), mesh=1, dt=0.02, t_end=2.0, output_dt=2.0)
    assert rare.angle("arm.end")[-1] == pytest.approx(2.0 * pi, abs=1.0)
    assert np.array_equal(at.load(rare.save(tmp_path / "rare.npz")).angle("arm.end"), rare.angle("arm.end"))
