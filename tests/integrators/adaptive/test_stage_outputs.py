"""Forces at outputs within steps of fourth order: they are those of the motion, however stiff its parts are."""

import numpy as np
import pytest
from samples import linkage

import anctmm as at
from anctmm.integrators.adaptive import stage_control, stage_outputs

RUN = {"t_end": 0.4, "output_dt": 0.01, "integrator": "esdirk"}


def steel_linkage():
    """Crank, coupler and rocker of square steel bars; the crank is driven."""
    square, steel = at.Rectangle(0.02, 0.02), at.Material(E=2e11, density=7800.0)
    bars = [
        at.Beam("crank", (0.0, 0.0), (0.0, 0.2), square, steel),
        at.Beam("coupler", (0.0, 0.2), (0.5, 0.3), square, steel),
        at.Beam("rocker", (0.5, 0.3), (0.5, 0.0), square, steel),
    ]
    joints = [
        at.Clamp("crank.start", angle=at.Quintic(-1.0, 0.3)),
        at.Pin("crank.end", "coupler.start"),
        at.Pin("coupler.end", "rocker.start"),
        at.Pin("rocker.end"),
    ]
    return at.Scene("steel linkage", bars, joints)


def rod(stiffness):
    """A mass at a driven arm, which a spring holds: in the place of a rod without mass."""
    arm = at.RigidBody("arm", 1.0, 0.05, (0.25, 0.0), points={"pivot": (0.0, 0.0), "tip": (0.5, 0.0)})
    return at.Scene(
        "rod",
        [arm, at.PointMass("mass", 0.5, (0.5, -0.3))],
        [at.Clamp("arm.pivot", angle=at.Quintic(-1.0, 0.3))],
        connectors=[at.Spring("arm.tip", "mass.center", stiffness=stiffness)],
    )


@pytest.fixture(scope="module")
def fine():
    """The steel linkage with small steps."""
    return at.solve(steel_linkage(), mesh=1, dt=1e-3, **RUN)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_reactions_of_a_steel_linkage_are_those_of_small_steps(fine, tolerance):
    """They were 40 and 3 times the largest reaction, with positions as good as was asked, and status ok."""
    scene = steel_linkage()
    run = at.solve(scene, mesh=1, tolerance=tolerance, **RUN)
    assert run.status.ok
    assert run.cost.steps < 65  # for 40 outputs: most lie within
    for joint in scene.joints:
        found, exact = run.reaction(joint)[:, :2], fine.reaction(joint)[:, :2]
        missed = np.abs(found - exact).max()  # of vibrations that neither resolves
        assert missed <= 0.25 * np.abs(exact).max()


def indexed():
    """A steel arm with a ball at its end that a drive turns by quarters of a turn, with rests between them."""

    def quarters(t):
        angle = rate = acceleration = 0.0
        for k in range(4):
            x = min(max((t - 0.5 * k) / 0.3, 0.0), 1.0)
            angle += np.pi / 2.0 * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
            rate += np.pi / 2.0 / 0.3 * 30.0 * (x * (1.0 - x)) ** 2
            acceleration += np.pi / 2.0 / 0.09 * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
        return angle, rate, acceleration

    steel = at.Material(E=2.1e11, density=7850.0, damping=1e-5)
    arm = at.Beam("arm", (0, 0), (0.5, 0), at.Rectangle(0.03, 0.01), steel)
    drive = at.History(quarters, breaks=[0.0, 0.3, 0.5, 0.8, 1.0, 1.3, 1.5, 1.8])
    joints = [at.Clamp("arm.start", angle=drive), at.Pin("arm.end", "ball.center")]
    return at.Scene("indexed", [arm, at.PointMass("ball", 0.5, (0.5, 0))], joints)


@pytest.mark.compiled
@pytest.mark.parametrize("interval", [0.02, 0.01])
def test_forces_at_outputs_are_those_of_the_motion_wherever_stiff_parts_have_turned(interval):
    """With a matrix of another angle, one correction left forces of 70 and 200 times the largest, and status ok."""
    scene, run = indexed(), {"mesh": 6, "t_end": 2.0, "output_dt": interval, "integrator": "esdirk"}
    exact = at.solve(scene, dt=5e-4, newton_tolerance=1e-10, **run)
    found = at.solve(scene, tolerance=1e-2, **run)
    assert found.status.ok
    assert found.cost.steps < 250
    pin = scene.joints[1]
    missed = np.abs(found.reaction(pin) - exact.reaction(pin)).max()
    assert missed < 0.8 * np.abs(exact.reaction(pin)).max()  # of vibrations that the steps do not resolve
    assert np.abs(found.energy.strain - exact.energy.strain).max() < 0.8 * exact.energy.strain.max()


def test_outputs_of_soft_beams_need_no_correction(monkeypatch):
    """What the quintic misses is small beside their stretches: forces are those with corrections."""
    scene, options = linkage(0.1), RUN | {"mesh": 1, "tolerance": 1e-3, "t_end": 0.2, "output_dt": 2e-3}
    run = at.solve(scene, **options)
    monkeypatch.setattr(stage_outputs, "SOUND", -1.0)
    corrected = at.solve(scene, **options)
    assert run.cost.newton_iterations < 0.9 * corrected.cost.newton_iterations
    for joint in scene.joints:
        found, exact = run.reaction(joint), corrected.reaction(joint)
        assert np.abs(found - exact).max() <= 0.02 * np.abs(exact).max()


@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e6])
def test_a_spring_pulls_a_mass_by_its_mass_times_its_acceleration(stiffness):
    """Newton's second law at every output: the tension is that of the motion which is kept."""
    scene = rod(stiffness)
    run = at.solve(scene, tolerance=1e-3, newton_tolerance=1e-9, **RUN)
    arm = run.position("arm.tip") - run.position("mass.center")
    along = arm / np.linalg.norm(arm, axis=1)[:, None]
    tension = run.tension(scene.connectors[0]).ravel()
    inertia = 0.5 * (run.fields["mass"].accelerations[:, 0] * along).sum(axis=1)
    assert np.abs(inertia - tension).max() <= 1e-2 * np.abs(tension).max()


def rigid_loop():
    """Three rigid bars that fall: constraints with multipliers."""
    places = [(0.0, 0.0), (0.0, 0.3), (0.5, 0.4), (0.5, 0.0)]
    bars = [
        at.RigidBody(name, 1.0, 0.02, np.add(a, b) / 2.0, points={"a": a, "b": b})
        for name, a, b in zip(("one", "two", "three"), places, places[1:], strict=False)
    ]
    joints = [at.Pin("one.a"), at.Pin("one.b", "two.a"), at.Pin("two.b", "three.a"), at.Pin("three.b")]
    return at.Scene("rigid loop", bars, joints, gravity=(4.0, -9.81))


@pytest.mark.parametrize(("scene", "mesh"), [(linkage(0.1), {"mesh": 1}), (rigid_loop(), {})])
def test_outputs_leave_nothing_behind(scene, mesh, monkeypatch):
    """What is done for outputs within steps changes no step: the end is the same to the bit."""
    options = RUN | mesh | {"tolerance": 1e-2, "t_end": 0.2}
    monkeypatch.setattr(stage_outputs, "SOUND", -1.0)  # all outputs are corrected
    run = at.solve(scene, **options)
    monkeypatch.setattr(stage_control, "balance_within", lambda *_: None)
    without = at.solve(scene, **options)
    assert (run.cost.steps, run.status.code) == (without.cost.steps, "ok")
    assert run.cost.newton_iterations > without.cost.newton_iterations  # some outputs lie within
    for body in scene.bodies:
        ours, theirs = run.fields[body.name].coordinates, without.fields[body.name].coordinates
        assert np.array_equal(ours[-1], theirs[-1])


@pytest.mark.parametrize(
    ("E", "damping", "mesh"),
    [(7e10, 1e-3, 4), (7e10, 1e-2, 4), (7e10, 1e-2, 8), (2e11, 3e-2, 4), (2e11, 0.1, 4)],
)
def test_an_output_is_no_other_solution(E, damping, mesh):
    """Newton's iteration went there with the matrix of another angle: strain energies of 1e4 to 1e7 J, and back."""
    metal = at.Material(E, 1100.0, damping=damping)
    rod = at.Beam("rod", (0, 0), (0.8, 0), at.Circle(0.02), metal)
    scene = at.Scene("pendulum", [rod], [at.Pin("rod.start")], gravity=(0, -9.81))
    found = at.solve(scene, mesh=mesh, tolerance=1e-2, t_end=2.0, output_dt=0.02)
    assert found.status.ok, found.status
    assert len(found.t) == 101
    assert found.energy.strain.max() < 0.03 * found.energy.kinetic.max()
