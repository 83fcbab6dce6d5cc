"""Energy from nowhere: implicit runs that make it are told, and coarse runs that are right are not."""

from dataclasses import replace

import numpy as np
import pytest
from samples import bar

import anctmm as at
from anctmm.results.checks.divergence import checked
from anctmm.results.checks.energy import absorbed, all_energy, energy_findings, from_nowhere
from anctmm.results.solution import Energy
from reference import exudyn_cable, global_dae
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
    "spinning, more damping": (lambda: steel_bar(50.0), {"mesh": 4, "dt": 1e-2, "spectral_radius": 0.8}),
    "softer": (
        lambda: steel_bar(50.0, material=at.Material(E=1e7, density=7850.0)),
        {"mesh": 4, "dt": 1e-2, "spectral_radius": 0.8},
    ),
    "torque": (lambda: steel_bar(torque=100.0), {"mesh": 1, "dt": 1e-2, "t_end": 0.18}),
    "short": (lambda: steel_bar(50.0), {"mesh": 4, "dt": 1e-2, "t_end": 0.1, "spectral_radius": 1.0}),
}


@pytest.mark.parametrize("solve", [at.solve, global_dae.solve])
@pytest.mark.parametrize("what", MADE)
def test_implicit_runs_that_make_energy_are_not_ok(what, solve):
    scene, options = MADE[what]
    found = solve(scene(), **{"t_end": 1.0, **options})
    assert found.status.code in ("diverged", "inaccurate"), found.status
    assert "smaller dt" in found.status.message or "finer mesh" in found.status.message
    assert f"t = {found.status.time:.6g} s" in found.status.message
    assert found.status.body == "bar"


def test_exudyn_is_told_of_the_energy_it_makes():
    found = exudyn_cable.solve(steel_bar(50.0), mesh=1, dt=1e-2, t_end=1.0)
    assert not found.status.ok
    fine = exudyn_cable.solve(steel_bar(50.0), mesh=1, dt=1e-3, t_end=0.1)
    assert fine.status.ok, fine.status


#: Coarse runs that are right: scene, coarse options, and the error that they have against steps four times smaller.
RIGHT = {
    "bar, a twentieth of a radian a step": (lambda: steel_bar(50.0), {"mesh": 4, "dt": 1e-3, "t_end": 0.2}),
    "torque": (lambda: steel_bar(torque=100.0), {"mesh": 4, "dt": 1e-3, "t_end": 0.5}),
    "four-bar": (lambda: four_bar().scene, {"mesh": 1, "dt": 2e-2, "t_end": 2.4}),
    "four-bar, both ends of the motion": (
        lambda: four_bar().scene,
        {"mesh": 1, "dt": 1e-2, "t_end": 2.4, "output_dt": 1.2},
    ),
    "four-bar, annihilating": (
        lambda: four_bar().scene,
        {"mesh": 1, "dt": 2e-2, "t_end": 2.4, "spectral_radius": 0.0},
    ),
    "fall": (lambda: cantilever_fall().scene, {"mesh": 8, "dt": 2e-2}),
    "fall, no damping of the method": (
        lambda: cantilever_fall().scene,
        {"mesh": 8, "dt": 1e-2, "spectral_radius": 1.0},
    ),
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
        run = {
            "mesh": 1,
            "element": element,
            "integrator": integrator,
            "dt": dt,
            "t_end": 2.0,
            "output_dt": 2.0,
        }
        found = at.solve(scene, **run)
        assert found.status.ok, found.status


@pytest.mark.parametrize("stiffness", [1e4, 1e12])
def test_stiff_springs_excuse_no_energy_where_outputs_are_few(stiffness):
    """A mass on a spring of 1e12 N/m had 2100 J instead of 2 J, and was ok: the spring might have borne 5e11 J."""
    arm = at.RigidBody("arm", 1.0, 0.1, (0.5, 0.0), points={"o": (0.0, 0.0), "e": (1.0, 0.0)})
    mass = at.PointMass("mass", 0.5, (1.0, -0.3))
    rope = at.Spring("arm.e", "mass.center", stiffness)
    scene = at.Scene("rope", [arm, mass], [at.Pin("arm.o")], gravity=(0.0, -9.81), connectors=[rope])
    found = at.solve(scene, integrator="esdirk", dt=1e-3, t_end=0.2, output_dt=0.02)
    assert found.status.ok
    assert not list(energy_findings(found))
    more = np.linspace(0.0, 1.0, len(found.t)) ** 2
    made = replace(found, energy=replace(found.energy, strain=found.energy.strain + more))
    assert [finding.code for finding in energy_findings(made)] == ["inaccurate"]


def test_rigid_bodies_of_too_long_steps_are_told():
    """Nothing vibrates, so that nothing excuses an energy that is wrong: here the bar turns a radian a step."""
    found = at.solve(steel_bar(50.0), mesh=1, element="rigid", integrator="zhai", dt=2e-2, t_end=1.0)
    assert found.status.code in ("inaccurate", "diverged"), found.status


def test_undamped_forces_of_constraints_are_told():
    """A rigid body that forces turn: no smaller step helps where the spectral radius is 1."""
    body = at.RigidBody(
        "body", 2.0, 0.3, (1.0, 2.0), points={"p": (1.4, 2.3)}, velocity=(0.3, -0.2), spin=4.0
    )
    loads = [at.Force("body.p", lambda t: (3.0 * np.cos(5.0 * t), 2.0 * t))]
    scene = at.Scene("pushed", [body], [], [*loads, at.Torque("body.center", 0.5)], gravity=(-3.0, 4.0))
    grown = at.solve(scene, dt=5e-3, t_end=4.0, spectral_radius=1.0)
    assert grown.status == "diverged"
    assert "or a spectral_radius of 0.9 or less" in grown.status.message
    assert at.solve(scene, dt=5e-3, t_end=4.0).status.ok


@pytest.mark.parametrize("damping", [1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_damping_within_a_step_makes_no_energy(damping, speed):
    """Stretching velocities die out within the first step, whatever damping takes there."""
    body = at.Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, at.Material(E=1e9, density=1000.0, damping=damping),
                   lambda s: (speed * s, 0.3 * speed * s))  # fmt: skip
    scene = at.Scene("damped", [body], [at.Pin("bar.start")], gravity=(0.0, -9.81))
    for dt in (2e-4, 5e-4):
        found = at.solve(scene, mesh=2, dt=dt, t_end=0.1)
        assert found.status.ok, found.status


@pytest.mark.parametrize("spectral_radius", [0.5, 0.9])
def test_both_roads_count_the_same_work_of_damping(spectral_radius):
    body = at.Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, at.Material(E=1e9, density=1000.0, damping=1e-3),
                   lambda s: (s, 0.3 * s))  # fmt: skip
    scene = at.Scene("damped", [body], [at.Pin("bar.start")], gravity=(0.0, -9.81))
    run = at.Discretisation(
        mesh=2, dt=5e-4, t_end=0.02, spectral_radius=spectral_radius, newton_tolerance=1e-13
    )
    ours, theirs = at.solve(scene, run), global_dae.solve(scene, run)
    assert (ours.status, theirs.status) == ("ok", "ok")
    assert np.abs(ours.energy.work - theirs.energy.work).max() < 1e-11


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
    coarse = at.solve(scene, mesh=1, dt=2e-4, t_end=2e-2)
    assert np.abs(coarse.energy.balance).max() < 0.3 * coarse.energy.kinetic[0]


def test_an_inaccurate_run_is_kept_whole():
    """A bar of rubber that swings and falls at ten steps a swing: a fifth of its energy comes from nowhere."""
    energy = Energy(np.linspace(1.0, 1.5, 11), np.zeros(11), np.zeros(11), np.zeros(11))
    found = at.solve(bar([at.Pin("bar.start")]), mesh=2, dt=1e-2, t_end=0.1)
    told = checked(replace(found, energy=energy))
    assert told.status == "inaccurate"
    assert told.status.time == pytest.approx(0.03)
    assert len(told.t) == 11
    assert "was created by numerical error (0.15 J of 1.15 J)" in told.status.message
    assert checked(replace(found, energy=energy), energies=False).status.ok
    lost = Energy(energy.kinetic[::-1], energy.strain, energy.potential, energy.work)
    told = checked(replace(found, energy=lost)).status
    assert told == "inaccurate"
    assert "vanished" in told.message
    assert "a larger spectral_radius may help" in told.message
    undamped = at.Discretisation(mesh=2, dt=1e-2, t_end=0.1, spectral_radius=1.0)
    told = checked(replace(found, energy=lost, run=undamped)).status
    assert "vanished" in told.message
    assert "a larger spectral_radius" not in told.message
    settled = Energy(0.1 * energy.kinetic, energy.strain, np.linspace(0.0, -1.0, 11), energy.work)
    assert checked(replace(found, energy=settled)).status == "inaccurate"  # a fall that is not followed
    settled = Energy(energy.kinetic, np.linspace(0.0, 0.5, 11), np.linspace(0.0, -1.1, 11), energy.work)
    assert checked(replace(found, energy=settled)).status.ok  # a load that has come to rest


def test_a_run_with_a_tolerance_may_begin_with_that_part_of_its_energy_wrong():
    """The work of the first steps is known to a part of all energy that there will be, as of a stiff crank."""
    kinetic = np.linspace(0.0, 1.0, 11) ** 4
    work = kinetic + 0.01 * (kinetic > 0.0)
    begun = Energy(kinetic, np.zeros(11), np.zeros(11), work)
    found = replace(at.solve(bar([at.Pin("bar.start")]), mesh=2, dt=1e-2, t_end=0.1), energy=begun)
    assert checked(found).status == "inaccurate"
    for tolerance, code in ((1e-2, "ok"), (1e-3, "inaccurate")):
        run = at.Discretisation(mesh=2, tolerance=tolerance, t_end=0.1)
        assert checked(replace(found, run=run)).status == code


#: Runs that lose their motion to numerical dissipation: without the check all end with "ok".
LOST = {
    "spinning, annihilating": (lambda: steel_bar(50.0), {"mesh": 1, "dt": 5e-3, "spectral_radius": 0.0}),
    "spinning": (lambda: steel_bar(50.0), {"mesh": 1, "dt": 1e-2, "spectral_radius": 0.5}),
    "vibrating": (
        lambda: at.Scene(
            "free", [at.Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, at.Material(E=1e7, density=1000.0),
                             lambda s: (0.0, 0.1 * np.cos(2.0 * np.pi * s)))],
        ),
        {"mesh": 4, "dt": 0.1, "spectral_radius": 0.0},
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("what", "solve"), [*((what, at.solve) for what in LOST), ("vibrating", global_dae.solve)]
)
def test_runs_that_lose_their_motion_to_dissipation_are_inaccurate(what, solve):
    scene, options = LOST[what]
    found = solve(scene(), **{"t_end": 1.0, **options})
    assert found.status == "inaccurate", found.status
    assert "vanished" in found.status.message
    assert f"(spectral_radius {options['spectral_radius']:g})" in found.status.message
    fine = solve(scene(), **{"t_end": 1.0, **options, "dt": 2.0**-10, "spectral_radius": 0.9})
    assert fine.status.ok, fine.status


@pytest.mark.parametrize("spectral_radius", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("dt", [1e-2, 4e-2])
def test_a_load_whose_vibration_dissipation_brings_to_rest_is_ok(spectral_radius, dt):
    """What dissipation is for: the run ends in the static equilibrium."""
    scene = bar([at.Clamp("bar.start")], [at.Force("bar.end", (0.0, -0.1))])
    options = {"mesh": 4, "element": "cable"}
    found = at.solve(scene, dt=dt, t_end=5.0, spectral_radius=spectral_radius, **options)
    assert found.status.ok, found.status


def test_parts_of_all_energy():
    zero = np.zeros(3)
    energy = Energy(np.array([1.0, 1.15, 1.3]), zero, zero, zero)
    assert from_nowhere(energy, 0.2).tolist() == [False, False, True]
    assert from_nowhere(energy, 0.2, least=10.0).tolist() == [False, False, False]
    lost = Energy(np.array([1.0, 0.9, 0.5]), zero, zero, zero)
    assert from_nowhere(lost, 0.2).tolist() == [False, False, False]
    assert from_nowhere(lost, 0.2, lost=True).tolist() == [False, False, True]


def test_energy_that_a_law_takes_as_it_is_made_is_seen():
    """A step above the stability limit feeds a vibration that damping eats: what is there stays small."""
    zero, growing = np.zeros(11), np.linspace(0.0, 6e5, 11)
    damper = at.Spring("bar.end", (1.0, 1.0), stiffness=10.0, damping=0.1)
    scene = replace(steel_bar(0.1), connectors=(damper,))
    ours = at.solve(scene, mesh=1, dt=1e-6, t_end=1e-5, integrator="zhai")
    assert ours.status.ok
    energy = Energy(zero + 1.0, zero, zero, -growing)
    assert absorbed(energy).tolist() == [growing[k] - growing[1] > 100.0 for k in range(11)]
    told = checked(replace(ours, energy=energy))
    assert told.status == "diverged"
    assert "was created by numerical error" in told.status.message
    at_once = Energy(zero + 1.0, zero, zero, np.where(np.arange(11) > 0, -300.0, 0.0))
    assert not absorbed(at_once).any()


def loaded_bar(tau, force=10.0, of_time=False):
    """A metre of aluminium under an axial force that acts at once; its exact motion is that of a rod."""
    bar = at.Beam("bar", (0, 0), (1, 0), at.Rectangle(0.02, 0.005), at.Material(7e10, 2700.0, damping=tau))
    load = at.Force("bar.end", (lambda t: (force, 0.0)) if of_time else (force, 0.0))
    return at.Scene("loaded", [bar], [at.Clamp("bar.start", stretch="free")], [load])


@pytest.mark.parametrize(("tau", "dt"), [(1e-4, 1e-3), (1e-3, 1e-4), (1e-3, 1e-3)])
def test_a_force_may_be_a_function_of_time(tau, dt):
    """What damping takes in the first step, known badly, was subtracted from the work of such a force: "inaccurate"."""
    options = {"mesh": 4, "dt": dt, "t_end": 0.1, "integrator": "esdirk"}
    constant, function = (at.solve(loaded_bar(tau, of_time=of), **options) for of in (False, True))
    for run in (constant, function):
        assert run.status.ok, run.status
        assert run.position("bar.end")[-1, 0] - 1.0 == pytest.approx(10.0 / 7e6, rel=0.05)
    assert np.allclose(constant.energy.dissipated, function.energy.dissipated, rtol=1e-6)
    assert np.abs(function.energy.balance[1]) > 0.1 * all_energy(function.energy)[1]  # the check looks at it


def test_the_same_of_a_damper_or_a_law_beside_a_mass():
    """A mass on a stiff spring with a damper, or with a law that does the same."""
    mass, guide = at.PointMass("mass", 1.0, (1.0, 0.0)), at.Slider("mass.center", (1, 0))
    load = at.Force("mass.center", lambda t: (10.0, 0.0))
    for integrator, dt in (("esdirk", 1e-2), ("generalized-alpha", 1e-3)):
        for spring in (
            at.Spring("mass.center", (0.0, 0.0), stiffness=1e6, damping=1e4),
            at.Spring("mass.center", (0.0, 0.0), law=lambda e, r, t: 1e6 * e + 1e4 * r),
        ):
            scene = at.Scene("stiff", [mass], [guide], [load], connectors=[spring])
            found = at.solve(scene, dt=dt, t_end=1.0, output_dt=1e-2, integrator=integrator)
            assert found.status.ok, found.status
            assert found.position("mass.center")[-1, 0] - 1.0 == pytest.approx(1e-5, rel=1e-3)


@pytest.mark.parametrize("solve", [at.solve, global_dae.solve])
@pytest.mark.parametrize(("tau", "dt"), [(1e-3, 1e-3), (1e-2, 1e-3), (1e-2, 1e-2), (1e-1, 1e-2)])
def test_damping_that_gives_energy_is_told(tau, dt, solve):
    """Steps of generalized-α overshoot by up to 170 times the displacement at rest, in balance with that work."""
    options = {"mesh": 4, "dt": dt, "t_end": 50 * dt}
    found = solve(loaded_bar(tau, 1e3), **options)
    assert found.status == "inaccurate"
    assert len(found.t) == 51
    assert "damping, which can only take energy, has given" in found.status.message
    assert "integrator='esdirk' may help" in found.status.message
    assert np.abs(found.energy.balance).max() < 0.1 * found.energy.strain.max()
    moved = (found.position("bar.end")[:, 0] - 1.0) / (1e3 / 7e6)
    assert moved.min() < -0.5  # against the force
    right = at.solve(loaded_bar(tau, 1e3), **options, integrator="esdirk")
    assert right.status.ok, right.status
    moved = (right.position("bar.end")[:, 0] - 1.0) / (1e3 / 7e6)
    assert moved.min() == 0.0
    assert moved.max() < 1.05


def test_what_damping_seems_to_have_given_has_not_vanished():
    """The account of damping is wrong, and the motion right; not so where a law gives energy."""
    zero, rest = np.zeros(11), np.ones(11)
    given = np.linspace(0.0, 2.0, 11)
    energy = Energy(rest, zero, -0.1 * rest, given, -given)
    beam = at.Material(E=2e11, density=7850.0, damping=1e-3)
    options = {"mesh": 2, "dt": 1e-3, "t_end": 1e-2, "integrator": "esdirk"}
    found = at.solve(steel_bar(0.5, material=beam), **options)
    assert checked(replace(found, energy=energy)).status.ok
    law = at.RotationalSpring("bar.start", law=lambda e, r, t: -0.5 * r)
    found = at.solve(replace(steel_bar(0.5, material=beam), connectors=(law,)), **options)
    assert checked(replace(found, energy=energy)).status == "inaccurate"


def test_a_law_may_give_energy():
    """A bar that turns, and is driven by its own speed."""
    drive = at.RotationalSpring("bar.start", law=lambda e, r, t: -0.5 * r)
    found = at.solve(replace(steel_bar(0.5), connectors=(drive,)), mesh=2, dt=5e-3, t_end=1.0)
    assert found.status.ok, found.status
    assert found.energy.dissipated[-1] < -0.1 * found.energy.kinetic.max()


@pytest.mark.parametrize("meter", [1.0, 1e3])
def test_no_unit_of_length_hides_energy_under_a_line_load(meter):
    """In millimetres the work that such a load might do was a thousand times too large, and the status ok."""
    # the units of mass and time stay: forces are N in metres, mN in millimetres
    material = at.Material(2e11 / meter, 7850.0 / meter**3)
    spin = at.RigidVelocity((0, 0), (meter, 0), (0, 0), 50.0)
    body = at.Beam("bar", (0, 0), (meter, 0), at.Rectangle(0.02 * meter, 0.02 * meter), material, spin)
    scene = at.Scene("steel", [body], [at.Pin("bar.start")], [at.LineLoad("bar", (0.0, -100.0))])
    found = at.solve(scene, mesh=4, dt=1e-2, t_end=0.2, output_dt=0.2)
    assert found.status.code == "inaccurate", found.status


def driven_bar(damper=None):
    """A bar of damped rubber on a driven clamp, and maybe a damper at its end; with so many outputs."""
    rubber = at.Material(E=1e7, density=1000.0, damping=1e-3)
    body = at.Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, rubber)
    clamp = at.Clamp("bar.start", angle=at.Quintic(0.5, 0.1))
    springs = [] if damper is None else [at.Spring("bar.end", (1.0, 1.0), stiffness=1.0, damping=damper)]
    return at.Scene("driven", [body], [clamp], connectors=springs)


@pytest.mark.parametrize("outputs", [20, 100])
@pytest.mark.parametrize("damper", [None, 0.1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_damping_excuses_no_work_that_bodies_never_had(outputs, damper, sign):
    """The work of a drive was 1e7 times the energy there ever was, with status ok: damping might have taken it."""
    found = at.solve(driven_bar(damper), mesh=2, dt=1e-3, t_end=0.1, output_dt=0.1 / outputs)
    assert found.status.ok, found.status
    garbage = np.where(np.arange(len(found.t)) > outputs // 2, sign * 1e7 * found.energy.kinetic.max(), 0.0)
    wrong = replace(found, energy=replace(found.energy, work=found.energy.work + garbage))
    assert "inaccurate" in [finding.code for finding in energy_findings(wrong)]


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
@pytest.mark.parametrize("damping", [1e2, 1e4, 1e6, 1e8])
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
