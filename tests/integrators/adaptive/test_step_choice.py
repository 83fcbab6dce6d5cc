"""Steps that an error drives are chosen by the motion, not by how far below its bound Newton's iteration went."""

import numpy as np
import pytest
from control_costs import squeezer, written

import anctmm as at
from studies.engine.other_numbers import Change
from studies.regression import small_scenes


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("make", "t_end", "bounds"),
    [
        # 5 % off where the estimate was filtered by the matrix of one length of steps and scaled by another
        (small_scenes.pulse, 0.1, (1e-12, 1e-11)),
        # corrections of the size of rounding, and matrices renewed for them, were an effort that shortens steps
        (small_scenes.pulse, 0.03, (1e-10, 1e-9)),
        (small_scenes.stick, 0.1, (1e-12, 1e-11)),
    ],
)
def test_where_newtons_iteration_stops_does_not_choose_the_steps(make, t_end, bounds):
    scene = make()
    one, two = (
        at.solve(
            scene,
            mesh=2,
            integrator="generalized-alpha",
            tolerance=1e-3,
            t_end=t_end,
            output_dt=t_end / 5,
            newton_tolerance=bound,
        )
        for bound in bounds
    )
    assert one.status.ok
    assert two.status.ok
    assert one.cost.steps == two.cost.steps
    apart = [
        np.abs(one.fields[b.name].coordinates - two.fields[b.name].coordinates).max() for b in scene.beams
    ]
    # what single corrections leave below the bound adds up over the steps
    assert max(apart) < 5e-6 * max(np.abs(one.displacement(f"{b.name}.end")).max() for b in scene.beams), (
        apart
    )


@pytest.mark.compiled
def test_a_turned_scene_takes_the_same_steps():
    """What a force does beside its straight line was taken by components, which depend on the axes."""
    scene = small_scenes.pulse()
    one, two = (
        at.solve(
            s,
            mesh=2,
            integrator="generalized-alpha",
            tolerance=1e-3,
            t_end=0.1,
            output_dt=0.02,
            newton_tolerance=1e-12,
        )
        for s in (scene, Change(turn=0.7).scene(scene))
    )
    assert one.cost.steps == two.cost.steps
    ours, theirs = (np.linalg.norm(run.displacement("stick.end"), axis=-1) for run in (one, two))
    assert np.abs(ours - theirs).max() < 1e-8 * ours.max()


def test_a_start_that_dies_out_fast_does_not_hold_back_all_later_steps():
    """Its errors were in the mean over a twentieth of the run: 3.5 million steps for a gripper of damped fingers."""
    mass, damping, stiffness, speed, t_end = 1e-3, 50.0, 2.0, 1.0, 0.3
    ball = at.PointMass("ball", mass=mass, position=(1.0, 0.0), velocity=(speed, 0.0))
    spring = at.Spring("ball.center", (0.0, 0.0), stiffness=stiffness, damping=damping)
    found = at.solve(
        at.Scene("damped", [ball], connectors=[spring]),
        integrator="generalized-alpha",
        tolerance=1e-3,
        t_end=t_end,
        output_dt=t_end / 5,
    )
    fast, slow = np.sort(np.roots([mass, damping, stiffness]))
    exact = speed / (slow - fast) * (np.exp(slow * found.t) - np.exp(fast * found.t))
    moved = found.displacement("ball.center")[:, 0]
    assert found.status.ok
    assert np.abs(moved - exact).max() < 3e-3 * np.abs(exact).max()
    assert found.cost.steps < 6000


@pytest.mark.compiled
def test_a_stiff_pendulum_is_not_turned_inside_out():
    """Newton's iteration found the motion of a beam turned inside out, where no error was estimated; it diverged."""
    beam = at.Beam("beam", (0.0, 0.0), (1.0, 0.0), at.Circle(0.02), at.Material(2e11, 7800.0))
    scene = at.Scene("pendulum", [beam], [at.Pin("beam.start")], gravity=(0.0, -9.81))
    found = at.solve(scene, mesh=2, integrator="generalized-alpha", tolerance=1e-2, t_end=4.0, output_dt=0.05)
    assert found.status.ok, found.status
    assert found.cost.steps < 1000  # 2.7 million until it diverged


def driven_arm(first, second):
    """An arm of two links that drives move as a whole."""
    links = [
        at.RigidBody(
            name, mass=m, inertia=0.1, center=(x, 0.0), points={"a": (x - 0.25, 0.0), "b": (x + 0.25, 0.0)}
        )
        for name, m, x in (("upper", 5.0, 0.25), ("lower", 2.0, 0.75))
    ]
    joints = [at.Clamp("upper.a", angle=first), at.Weld("upper.b", "lower.a", angle=second)]
    return at.Scene("driven-arm", links, joints, gravity=(0.0, -9.81))


def swings(size, rate):
    """A drive that begins to move softly: size sin³(rate t)."""

    def angle(t):
        s, c = np.sin(rate * t), np.cos(rate * t)
        return size * s**3, 3 * size * rate * s * s * c, 3 * size * rate**2 * s * (2 * c * c - s * s)

    return angle


@pytest.mark.parametrize(
    ("integrator", "drives"),
    [
        # velocities were wrong by 0.06 of the largest, the kinetic energy by 0.13
        ("generalized-alpha", (at.Quintic(np.pi, 0.5), at.Quintic(-np.pi / 2, 0.7))),
        # the work was wrong by half
        ("esdirk", (swings(0.5, 6.0), swings(0.3, 13.0))),
    ],
)
def test_what_drives_move_as_a_whole_has_velocities_and_work_within_three_times_the_tolerance(
    integrator, drives
):
    """Its positions are exact whatever the steps: the estimate of their error saw nothing."""
    scene, tolerance = driven_arm(*drives), 1e-2
    found = at.solve(scene, tolerance=tolerance, t_end=0.5, output_dt=0.125, integrator=integrator)
    assert found.status.ok
    (a, w, _), (b, u, _) = (np.array([drive(t) for t in found.t]).T for drive in drives)
    v = 0.5 * w * np.exp(1j * (a + np.pi / 2)) + 0.5 * (w + u) * np.exp(1j * (a + b + np.pi / 2))
    off = np.abs(found.velocity("lower.b") @ [1.0, 1j] - v).max()
    assert off < 3.0 * tolerance * np.abs(v).max()
    energy = found.energy
    assert np.abs(energy.balance).max() < 3.0 * tolerance * np.abs(energy.work).max()


@pytest.mark.compiled
def test_corrections_that_only_show_what_is_left_are_no_reason_to_renew_a_matrix():
    """After each of them 2 factorizations and a correction were spent: 127 for these 4,655 steps, which took 1.28."""
    case = written("three_supports")
    found = at.solve(
        case.scene, mesh=4, tolerance=1e-5, integrator="generalized-alpha",
        t_end=case.duration, output_dt=case.interval,
    )  # fmt: skip
    assert found.status.ok
    assert found.cost.factorizations < 0.015 * found.cost.steps
    assert found.cost.newton_iterations < 1.1 * found.cost.steps


@pytest.mark.compiled
@pytest.mark.parametrize("tolerance", [2.512e-5, 3.981e-5])
def test_what_newtons_iteration_leaves_of_linkages_of_rigid_bodies_is_no_large_part_of_their_error(tolerance):
    """With three times that part it was up to 3.5 times the tolerance, at those between those of `test_alpha_cost`.

    It is 0.2 to 2.3 times the tolerance, as steps fall: changes of the size of rounding choose others.
    """
    case = squeezer()
    options = {"t_end": case.duration, "output_dt": case.interval}
    fine = at.solve(case.scene, dt=case.interval / 32, integrator="esdirk", newton_tolerance=1e-11, **options)
    found = at.solve(case.scene, tolerance=tolerance, integrator="generalized-alpha", **options)
    assert at.compare(found, fine, case.probes).error < 2.6 * tolerance
