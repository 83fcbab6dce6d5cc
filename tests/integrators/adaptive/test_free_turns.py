"""Bodies that turn freely many times: errors stay within what a tolerance asks; nothing else has other steps."""

from itertools import pairwise
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import anctmm as at
from anctmm.integrators.adaptive import controlled_run

LONG = pytest.mark.exhaustive
LENGTH, SPIN, OUTPUTS = 0.3, 100.0, 20  # m, rad/s
#: A thin bar's gravity over its speed, rad/s²: 3 g / (2 L).
FALLING = 1.5 * 9.81 / LENGTH
CRANK, ROD, CRANK_SPIN = 0.2, 0.6, 20.0  # m, m, rad/s


def rod(name, start, end, mass, velocity, spin):
    """A thin bar as a rigid body."""
    a, b = np.array(start), np.array(end)
    inertia = mass * ((b - a) @ (b - a)) / 12.0
    points = {"start": start, "end": end}
    return at.RigidBody(name, mass, inertia, tuple((a + b) / 2.0), points, velocity=velocity, spin=spin)


def pinned_bar(gravity=0.0, spin=SPIN):
    body = rod("bar", (0.0, 0.0), (LENGTH, 0.0), 1.0, (0.0, 0.5 * spin * LENGTH), spin)
    return at.Scene("pinned", [body], [at.Pin("bar.start")], gravity=(0.0, -gravity))


def free_bar():
    """It flies as it turns."""
    return at.Scene("free", [rod("bar", (-0.15, 0.0), (0.15, 0.0), 1.0, (1.0, 0.0), SPIN)])


def stiff_beam(pinned, damping):
    """A bar of 0.3 m that bends and stretches by a millionth of its length; free, it turns about its middle."""
    start, end = (0.0, 0.0), (LENGTH, 0.0)
    motion = at.RigidVelocity(start, end, start if pinned else (0.5 * LENGTH, 0.0), SPIN)
    material = at.Material(2e11, 1100.0, damping=damping)
    beam = at.Beam("bar", start, end, at.Circle(0.02), material, motion)
    return at.Scene("stiff", [beam], [at.Pin("bar.start")] if pinned else [])


def slider_crank(wheel, joint, gravity=0.0):
    """A crank with the moment of inertia of a `wheel` about its axle, that turns; a rod, and a slide."""
    spin = -CRANK_SPIN * CRANK / ROD
    crank = at.RigidBody("crank", 5.0, wheel, (0.0, 0.0), {"pin": (CRANK, 0.0)}, spin=CRANK_SPIN)
    coupler = rod("rod", (CRANK, 0.0), (CRANK + ROD, 0.0), 0.8, (0.0, 0.5 * CRANK_SPIN * CRANK), spin)
    joints = [joint, at.Pin("crank.pin", "rod.start"), at.Slider("rod.end", (1.0, 0.0))]
    return at.Scene("slider-crank", [crank, coupler], joints, gravity=(0.0, -gravity))


def freely_turning(wheel):
    return slider_crank(wheel, at.Pin("crank.center"))


def driven_crank():
    def turn(t):
        return CRANK_SPIN * t, CRANK_SPIN + 0.0 * t, 0.0 * t

    return slider_crank(0.01, at.Clamp("crank.center", angle=turn), gravity=9.81)


def end_of_bar(t, gravity=0.0, spin=SPIN):
    """The exact place of the end of a bar at a pin."""
    found = solve_ivp(
        lambda _, y: [y[1], -gravity * cos(y[0])],
        (0.0, t[-1]), [0.0, spin], method="DOP853", rtol=1e-13, atol=1e-12, t_eval=t,
    )  # fmt: skip
    return LENGTH * np.stack([np.cos(found.y[0]), np.sin(found.y[0])], axis=1)


def slide(t, wheel):
    """The exact place of the slide of a slider-crank that turns freely, by its one coordinate and its energy."""

    def inertia(angle):
        """Of all that moves, and its derivative by the angle."""
        u = -CRANK * sin(angle) / ROD  # sine of the rod's angle
        v = sqrt(1.0 - u * u)
        turn = -CRANK * cos(angle) / (ROD * v)
        bend = (CRANK * sin(angle) / ROD + u * turn * turn) / v
        way = np.array([-CRANK * sin(angle) - 0.5 * ROD * u * turn, 0.5 * CRANK * cos(angle)])
        change = np.array(
            [-CRANK * cos(angle) - 0.5 * ROD * (v * turn * turn + u * bend), -0.5 * CRANK * sin(angle)]
        )
        own = 0.8 * ROD**2 / 12.0
        return wheel + own * turn * turn + 0.8 * way @ way, 2.0 * (own * turn * bend + 0.8 * way @ change)

    def motion(_, y):
        size, slope = inertia(y[0])
        return [y[1], -0.5 * slope * y[1] ** 2 / size]

    found = solve_ivp(
        motion, (0.0, t[-1]), [0.0, CRANK_SPIN], method="DOP853", rtol=1e-12, atol=1e-11, t_eval=t
    )
    angle = found.y[0]
    return np.stack([CRANK * np.cos(angle) + np.sqrt(ROD**2 - (CRANK * np.sin(angle)) ** 2), 0.0 * t], axis=1)


def run(scene, turns, spin=SPIN, **options):
    """A run of so many turns, less a little: at the very end of a turn errors of some places vanish."""
    t_end = 2.0 * pi * 0.97 * turns / spin
    return at.solve(scene, t_end=t_end, output_dt=t_end / OUTPUTS, **options)


def steps(solution):
    """What its steps cost."""
    return solution.cost.steps, solution.cost.newton_iterations, solution.cost.factorizations


def error(solution, place, exact):
    """The rms error of a place, of its largest displacement."""
    assert solution.status.ok, solution.status
    missed = solution.position(place) - exact
    moved = np.linalg.norm(exact - exact[0], axis=1).max()
    return sqrt((missed**2).sum(axis=1).mean()) / moved


@pytest.mark.parametrize("gravity", [0.0, 9.81])
@pytest.mark.parametrize(
    ("turns", "tolerance"),
    [
        (1.8, 1e-3),
        (4, 1e-2),
        (4, 1e-4),
        (16, 1e-2),
        pytest.param(16, 1e-4, marks=LONG),
        pytest.param(64, 1e-2, marks=LONG),
    ],
)
def test_a_bar_that_turns_at_a_pin_has_the_error_asked_for(turns, tolerance, gravity):
    """Four turns missed by 9 times the tolerance, sixteen by 43 times."""
    found = run(pinned_bar(gravity), turns, tolerance=tolerance, integrator="esdirk")
    exact = end_of_bar(found.t, FALLING if gravity else 0.0)
    assert error(found, "bar.end", exact) <= 2.0 * tolerance


def test_a_bar_that_gravity_all_but_stops_has_the_error_asked_for():
    found = run(pinned_bar(9.81, 15.0), 4, 15.0, tolerance=1e-2, integrator="esdirk")
    assert error(found, "bar.end", end_of_bar(found.t, FALLING, 15.0)) <= 2e-2


@pytest.mark.parametrize(
    ("integrator", "turns", "tolerance"),
    [
        ("generalized-alpha", 4, 1e-2),
        pytest.param("generalized-alpha", 16, 1e-3, marks=LONG),
        pytest.param("esdirk", 16, 1e-2, marks=LONG),
    ],
)
@pytest.mark.parametrize("damping", [0.0, pytest.param(1e-4, marks=LONG)])  # other kernels
@pytest.mark.parametrize("pinned", [True, False])
def test_a_stiff_beam_that_spins_has_the_error_asked_for(pinned, damping, integrator, turns, tolerance):
    """The first step took a part of its speed: generalized-alpha missed by 30 to 600 times the tolerance, or diverged.

    Steps of fourth order took a little each, and missed by up to 17 times it.
    """
    found = run(stiff_beam(pinned, damping), turns, tolerance=tolerance, integrator=integrator, mesh=2)
    turning = LENGTH * np.stack([np.cos(SPIN * found.t), np.sin(SPIN * found.t)], axis=1)
    exact = turning if pinned else 0.5 * (turning + np.array([LENGTH, 0.0]))
    assert error(found, "bar.end", exact) <= 1.5 * tolerance


@pytest.mark.compiled
@pytest.mark.parametrize(("t_end", "tolerance"), [(20.0, 1e-2), (20.0, 3e-3), (15.0, 1e-3)])
def test_a_satellite_rests_after_its_drives_have_folded_its_panels(t_end, tolerance):
    """All its momentum is 0. It went on turning, by up to 25 times the tolerance: of what Newton's iteration left."""
    panel, metal = at.Rectangle(0.3, 0.01), at.Material(E=7e10, density=2700.0, damping=1e-4)
    bodies = [
        at.RigidBody("bus", 100.0, 20.0, (0, 0), {"r": (0.5, 0), "l": (-0.5, 0)}),
        at.Beam("right", (0.5, 0), (2.5, 0), panel, metal),
        at.Beam("left", (-0.5, 0), (-2.5, 0), panel, metal),
    ]
    folds = [
        at.Weld("bus.r", "right.start", angle=at.Quintic(1.2, 2.0)),
        at.Weld("bus.l", "left.start", angle=at.Quintic(0.5, 1.0)),
    ]
    options = {"mesh": 2, "t_end": t_end, "output_dt": t_end / 100, "integrator": "esdirk"}
    scene = at.Scene("satellite", bodies, folds)
    exact = at.solve(scene, dt=5e-3, newton_tolerance=1e-10, **options)
    found = at.solve(scene, tolerance=tolerance, **options)
    assert found.status.ok
    assert at.compare(found, exact, ["bus.r", "right.end", "left.end"]).error < 2.0 * tolerance


@pytest.mark.parametrize(("integrator", "tolerance"), [("esdirk", 1e-4), ("generalized-alpha", 1e-3)])
def test_a_body_that_turns_as_it_flies_has_the_error_asked_for(integrator, tolerance):
    """It missed by 11 times the tolerance with steps of fourth order, by 28 times with generalized-alpha."""
    found = run(free_bar(), 4, tolerance=tolerance, integrator=integrator)
    angle = SPIN * found.t
    exact = np.stack([found.t + 0.15 * np.cos(angle), 0.15 * np.sin(angle)], axis=1)
    assert error(found, "bar.end", exact) <= 2.0 * tolerance


@pytest.mark.parametrize(
    ("integrator", "turns", "tolerance"),
    [
        ("esdirk", 4, 1e-2),
        pytest.param("esdirk", 16, 1e-2, marks=LONG),
        pytest.param("generalized-alpha", 16, 1e-3, marks=LONG),
    ],
)
@pytest.mark.parametrize("wheel", [0.01, 0.2])
def test_a_slider_crank_that_turns_freely_has_the_error_asked_for(wheel, integrator, turns, tolerance):
    """With generalized-alpha it missed by 35 times the tolerance; over 16 turns now by 0.3 to 3.2 times it."""
    found = run(freely_turning(wheel), turns, CRANK_SPIN, tolerance=tolerance, integrator=integrator)
    assert error(found, "rod.end", slide(found.t, wheel)) <= 3.5 * tolerance


@pytest.mark.parametrize(("integrator", "tolerance"), [("esdirk", 1e-2), ("generalized-alpha", 1e-4)])
def test_what_a_drive_turns_does_not_turn_freely(integrator, tolerance, monkeypatch):
    """All steps are those that they were without a look at turns."""
    options = {"spin": CRANK_SPIN, "tolerance": tolerance, "integrator": integrator}
    ours = run(driven_crank(), 3, **options)
    assert ours.status.ok
    monkeypatch.setattr(controlled_run, "ANEW", 0)
    assert steps(ours) == steps(run(driven_crank(), 3, **options))


def test_what_follows_a_drive_does_not_turn_freely(monkeypatch):
    """The other crank of a parallelogram turns as the driven one does."""

    def turn(t):
        return CRANK_SPIN * t, CRANK_SPIN + 0.0 * t, 0.0 * t

    ends = [(0.0, 0.0), (0.0, CRANK), (ROD, CRANK), (ROD, 0.0)]
    links = [rod(f"link {k}", a, b, 1.0, (0.0, 0.0), 0.0) for k, (a, b) in enumerate(pairwise(ends))]
    joints = [
        at.Clamp("link 0.start", angle=turn),
        at.Pin("link 0.end", "link 1.start"),
        at.Pin("link 1.end", "link 2.start"),
        at.Pin("link 2.end"),
    ]
    scene = at.consistent_velocities(name="parallelogram", bodies=links, joints=joints)
    options = {"spin": CRANK_SPIN, "tolerance": 1e-2, "integrator": "esdirk"}
    ours = run(scene, 0.95 * 2, **options)
    assert abs(ours.angle("link 2.center")[-1]) > 1.5 * pi
    monkeypatch.setattr(controlled_run, "ANEW", 0)
    assert steps(ours) == steps(run(scene, 0.95 * 2, **options))


def test_what_swings_does_not_turn_freely(monkeypatch):
    """A bar that falls from the level swings by half a turn."""
    scene = pinned_bar(9.81, 0.0)
    ours = at.solve(scene, t_end=2.4, output_dt=0.2, tolerance=1e-2, integrator="esdirk")
    monkeypatch.setattr(controlled_run, "ANEW", 0)
    unseen = at.solve(scene, t_end=2.4, output_dt=0.2, tolerance=1e-2, integrator="esdirk")
    assert steps(ours) == steps(unseen)


def test_a_body_that_turns_late_is_found():
    """A torque turns it from rest; it missed by 14 times the tolerance."""
    body = rod("bar", (-0.15, 0.0), (0.15, 0.0), 1.0, (0.0, 0.0), 0.0)
    torque = 2.0 * 10.0 * pi * body.inertia  # five turns in a second
    scene = at.Scene("turned up", [body], [at.Pin("bar.center")], loads=[at.Torque("bar.center", torque)])
    found = at.solve(scene, t_end=1.0, output_dt=0.05, tolerance=1e-4, integrator="esdirk")
    angle = 10.0 * pi * found.t**2
    exact = 0.15 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert error(found, "bar.end", exact) <= 3e-4
