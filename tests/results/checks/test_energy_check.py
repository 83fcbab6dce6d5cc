"""Energy from nowhere: implicit runs that make it are told, and coarse runs that are right are not."""

from dataclasses import replace

import numpy as np
import pytest
from samples import bar

import anctmm as at
from anctmm.results.checks.divergence import checked
from anctmm.results.solution import Energy
from reference import global_dae
from studies.scenes import cantilever_fall, four_bar

STEEL = at.Material(E=2e11, density=7850.0)
SQUARE = at.Rectangle(0.02, 0.02)


def steel_bar(spin=0.0, torque=0.0, material=STEEL):
    """A metre of steel, pinned at one end, spinning (rad/s) or turned by a torque on its end (N m)."""
    velocity = (lambda s: (0.0, spin * s)) if spin else None
    body = at.Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, material, velocity)
    return at.Scene("steel", [body], [at.Pin("bar.start")], [at.Torque("bar.end", torque)] if torque else [])


#: Runs that make energy: scene and options. Without the check all end with "ok".
MADE = {
    "spinning": (lambda: steel_bar(50.0), {"mesh": 1, "dt": 1e-2}),
    "spinning, few outputs": (lambda: steel_bar(50.0), {"mesh": 1, "dt": 1e-2, "output_dt": 1.0}),
    "torque": (lambda: steel_bar(torque=100.0), {"mesh": 1, "dt": 1e-2, "t_end": 0.18}),
    "short": (lambda: steel_bar(50.0), {"mesh": 4, "dt": 1e-2, "t_end": 0.1, "spectral_radius": 1.0}),
}


@pytest.mark.parametrize("solve", [at.solve, global_dae.solve])
@pytest.mark.parametrize("what", MADE)
def test_implicit_runs_that_make_energy_are_not_ok(what, solve):
    scene, options = MADE[what]
    found = solve(scene(), **{"t_end": 1.0, **options})
    assert found.status.code in ("diverged", "inaccurate"), found.status
    assert f"t = {found.status.time:.6g} s" in found.status.message


#: Coarse runs that are right: scene, coarse options, and the error that they have against steps four times smaller.
RIGHT = {
    "bar": (lambda: steel_bar(50.0), {"mesh": 4, "dt": 1e-3, "t_end": 0.2}),
    "torque": (lambda: steel_bar(torque=100.0), {"mesh": 4, "dt": 1e-3, "t_end": 0.5}),
    "four-bar": (lambda: four_bar().scene, {"mesh": 1, "dt": 2e-2, "t_end": 2.4}),
    "fall": (lambda: cantilever_fall().scene, {"mesh": 8, "dt": 2e-2}),
    "rest": (lambda: bar([at.Pin("bar.start"), at.Pin("bar.end")]), {"mesh": 4, "dt": 1e-2}),
}


@pytest.mark.parametrize("what", RIGHT)
def test_coarse_runs_that_are_right_are_ok(what):
    scene, options = RIGHT[what]
    coarse = at.solve(scene(), **options)
    assert coarse.status.ok, coarse.status
    fine = at.solve(
        scene(), **options | {"dt": options["dt"] / 4, "output_dt": options.get("output_dt", options["dt"])}
    )
    ends = [f"{b.name}.end" for b in scene().bodies]
    assert np.isfinite(fine.energy.balance).all()
    assert at.compare(coarse, fine, ends).error < 0.1


def test_a_bar_that_floats_far_away_is_at_rest():
    """Rounding is all the energy that it has."""
    far = replace(bar().bodies[0], start=(1e6, 1e6), end=(1e6 + 0.6, 1e6 + 0.8))
    for spectral_radius in (0.0, 0.9, 1.0):
        found = at.solve(at.Scene("far", [far]), mesh=4, dt=1e-2, t_end=1.0, spectral_radius=spectral_radius)
        assert found.status.ok, found.status


def test_a_rigid_crank_seen_only_at_the_ends_of_its_turn_is_ok():
    """All is at rest there: the energy that it had on its way is not to be seen."""
    scene = four_bar().scene
    for integrator, element, dt in (("zhai", "rigid", 1e-3), ("generalized-alpha", "cable", 1e-2)):
        run = {"mesh": 1, "element": element, "integrator": integrator, "dt": dt}
        found = at.solve(scene, t_end=2.0, output_dt=2.0, **run)
        assert found.status.ok, found.status


@pytest.mark.parametrize(("damping", "speed"), [(1e-4, 1.0), (1e-3, 0.1), (1e-2, 1.0)])
def test_damping_within_a_step_makes_no_energy(damping, speed):
    """Stretching velocities die out within the first step, whatever damping takes there."""
    body = at.Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, at.Material(E=1e9, density=1000.0, damping=damping),
                   lambda s: (speed * s, 0.3 * speed * s))  # fmt: skip
    scene = at.Scene("damped", [body], [at.Pin("bar.start")], gravity=(0.0, -9.81))
    for dt in (2e-4, 5e-4):
        found = at.solve(scene, mesh=2, dt=dt, t_end=0.1)
        assert found.status.ok, found.status


def test_the_work_of_damping_closes_the_balance():
    """Over steps that resolve the decay it is second order, and a tenth of the energy at 30 radians a step."""
    body = at.Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, at.Material(E=1e9, density=1000.0, damping=1e-3),
                   lambda s: (s, 0.3 * s))  # fmt: skip
    scene = at.Scene("damped", [body], [at.Pin("bar.start")])
    errors = []
    for dt in (4e-6, 2e-6):
        found = at.solve(scene, mesh=1, dt=dt, t_end=2e-3, output_dt=1e-4)
        errors.append(np.abs(found.energy.balance).max() / found.energy.kinetic[0])
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)


@pytest.mark.parametrize(("spectral_radius", "dt"), [(0.0, 1e-2), (0.5, 4e-2), (0.9, 4e-2)])
def test_a_load_whose_vibration_dissipation_brings_to_rest_is_ok(spectral_radius, dt):
    """What dissipation is for: the run ends in the static equilibrium."""
    scene = bar([at.Clamp("bar.start")], [at.Force("bar.end", (0.0, -0.1))])
    found = at.solve(scene, mesh=4, dt=dt, t_end=5.0, spectral_radius=spectral_radius)
    assert found.status.ok, found.status


def test_energy_that_a_law_takes_as_it_is_made_is_seen():
    """A step above the stability limit feeds a vibration that damping eats: what is there stays small."""
    zero, growing = np.zeros(11), np.linspace(0.0, 6e5, 11)
    damper = at.Spring("bar.end", (1.0, 1.0), stiffness=10.0, damping=0.1)
    scene = replace(steel_bar(0.1), connectors=(damper,))
    ours = at.solve(scene, mesh=1, dt=1e-6, t_end=1e-5, integrator="zhai")
    assert ours.status.ok
    found = checked(replace(ours, energy=Energy(zero + 1.0, zero, zero, -growing)))
    assert found.status == "diverged"
    assert "was created by numerical error" in found.status.message


def test_a_law_may_give_energy():
    """A bar that turns, and is driven by its own speed."""
    drive = at.RotationalSpring("bar.start", law=lambda e, r, t: -0.5 * r)
    found = at.solve(replace(steel_bar(0.5), connectors=(drive,)), mesh=2, dt=5e-3, t_end=1.0)
    assert found.status.ok, found.status
    assert found.energy.dissipated[-1] < -0.1 * found.energy.kinetic.max()


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
@pytest.mark.parametrize("damping", [1e2, 1e5, 1e8])
def test_strong_dampers_beside_drives_are_ok(integrator, damping):
    """The motion of a mass that a damper ties to a driven one is right, whatever the sum of the damper's work."""
    slow = at.Quintic(0.2, 1.0)
    bodies = [at.PointMass("driven", 1.0, (0.0, 0.0)), at.PointMass("tied", 1.0, (1.0, 0.0))]
    joints = [at.Slider("driven.center", (1, 0), position=slow), at.Slider("tied.center", (1, 0))]
    damper = at.Spring("driven.center", "tied.center", stiffness=0.0, damping=damping)
    scene = at.Scene("tied", bodies, joints, connectors=[damper])
    found = at.solve(scene, integrator=integrator, dt=1e-2, t_end=1.0)
    assert found.status.ok, found.status
    apart = np.abs(found.displacement("tied.center")[:, 0] - slow(found.t)[0]).max()
    assert apart < 2.0 / damping + 1e-3


def pendulum():
    bar = at.RigidBody("bar", 1.0, 1.0 / 12.0, (0.5, 0.0), points={"a": (0.0, 0.0)})
    return at.Scene("pendulum", [bar], [at.Pin("bar.a")], gravity=(0.0, -9.81))


@pytest.mark.parametrize("road", [at.solve, global_dae.solve], ids=["anctmm", "global-dae"])
@pytest.mark.parametrize(("radius", "dt"), [(0.0, 0.05), (0.5, 0.1)])
def test_a_pendulum_that_loses_its_swing_is_inaccurate(road, radius, dt):
    found = road(pendulum(), dt=dt, t_end=4.0, spectral_radius=radius, output_dt=0.1)
    assert found.energy.balance.min() < -1.0
    assert found.status == "inaccurate"
    assert "vanished" in str(found.status)
