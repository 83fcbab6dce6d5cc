"""Rigid bodies: own equations of motion, the limit of stiff cables, every joint."""

import warnings
from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from samples import SQUARE, frequency_of, gap, system_of
from scipy.integrate import solve_ivp

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import MeshError, StartWarning
from anctmm.integrators.stability import highest_frequency
from anctmm.model.drives import Quintic
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld
from anctmm.solve import solve
from studies.scenes import four_bar

SOFT = Material(E=1e7, density=1000.0)
G = 9.81


def beam(name, start, end, material=SOFT, velocity=None):
    return Beam(name, start, end, SQUARE, material, velocity)


def pendulum(turned=False):
    """Two bars, one pinned to the ground, one hanging from it; or the second drawn the other way."""
    second = ((1.0, -0.7), (1.0, 0.0)) if turned else ((1.0, 0.0), (1.0, -0.7))
    hinge = "two.end" if turned else "two.start"
    return Scene("pendulum", [beam("one", (0.0, 0.0), (1.0, 0.0)), beam("two", *second)],
                 [Pin("one.start"), Pin("one.end", hinge)], gravity=(0.0, -G))  # fmt: skip


def lagrange(t_end, n):
    """Tip of the double pendulum of thin rigid bars by its own equations of motion, (n, 2)."""
    l1, l2, m1, m2 = 1.0, 0.7, 0.4, 0.28  # kg: 1000 · 0.02²

    def rate(_, y):
        a, b, w, u = y
        c, s = 0.5 * m2 * l1 * l2 * cos(a - b), 0.5 * m2 * l1 * l2 * sin(a - b)
        M = [[(m1 / 3 + m2) * l1**2, c], [c, m2 * l2**2 / 3]]
        f = [-s * u * u - (0.5 * m1 + m2) * G * l1 * cos(a), s * w * w - 0.5 * m2 * G * l2 * cos(b)]
        return [w, u, *np.linalg.solve(M, f)]

    y = solve_ivp(rate, (0.0, t_end), [0.0, -0.5 * pi, 0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-13,
                  t_eval=np.linspace(0.0, t_end, n)).y  # fmt: skip
    return np.stack([l1 * np.cos(y[0]) + l2 * np.cos(y[1]), l1 * np.sin(y[0]) + l2 * np.sin(y[1])], axis=1)


def rigidly(scene, dt, t_end=0.5, **options):
    """Explicit run with 10 outputs, all bodies rigid unless told otherwise."""
    common = {"mesh": 1, "element": "rigid", **options}
    return solve(scene, integrator="zhai", dt=dt, t_end=t_end, output_dt=t_end / 10, **common)


def test_a_start_that_would_stretch_a_rigid_body_moves_it_as_a_whole():
    """Velocities are projected by the mass: a stretch about the centre gives rest, one about an end its mean."""
    for about, mean in ((0.5, 0.0), (0.0, 0.5)):
        bar = beam("bar", (0.0, 0.0), (1.0, 0.0), velocity=lambda s, about=about: (s - about, 0.0))
        ours = rigidly(Scene("stretched", [bar], ()), 1e-3, 1e-2)
        assert ours.energy.kinetic == pytest.approx(np.full(11, 0.5 * 0.4 * mean**2), abs=1e-13)
        moved = ours.displacement(("bar", 0.3))
        assert np.abs(moved - np.outer(ours.t, [mean, 0.0])).max() < 1e-14


@pytest.mark.parametrize(
    ("velocity", "told"),
    [
        (lambda s: (s, 0.2 * s), "off a rigid motion"),
        (lambda s: (0.0, s * s), "off a rigid motion"),
        (lambda s: (0.3 - 0.8 * s, 0.1 + 0.6 * s), None),
    ],
    ids=["stretched", "bent", "rigid"],
)
def test_a_start_that_a_rigid_body_cannot_have_is_told_by_name(velocity, told):
    body = Beam("bar", (0.0, 0.0), (0.6, 0.8), SQUARE, Material(1e6, 1e3), velocity)
    run = {"mesh": 1, "element": "rigid", "integrator": "zhai", "dt": 1e-3, "t_end": 2e-3}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solve(Scene("thrown", [body]), **run)
        solve(Scene("thrown", [body]), **{**run, "element": "cable", "check_stability": False})
    said = [str(w.message) for w in caught if w.category is StartWarning]
    assert len(said) == bool(told), said
    assert all("'bar'" in text and told in text and "anctmm.RigidVelocity" in text for text in said)


@pytest.mark.parametrize("turned", [False, True])
def test_double_pendulum_moves_by_its_own_equations(turned):
    exact = lagrange(1.0, 11)
    tip = ("two", 0.0 if turned else 1.0)
    errors = []
    for dt in (1e-4, 5e-6):
        ours = rigidly(pendulum(turned), dt, 1.0)
        errors.append(np.abs(ours.position(*tip) - exact).max())
    assert errors[1] < 1e-8
    assert errors[0] / errors[1] == pytest.approx(400.0, rel=0.05)  # second order
    for body, length in (("one", 1.0), ("two", 0.7)):
        span = ours.position(body, 1.0) - ours.position(body, 0.0)
        assert np.abs(np.hypot(*span.T) - length).max() < 1e-13
        assert np.abs(ours.position(body, 0.5) - ours.position(body, 0.0) - span / 2).max() < 1e-13
    assert np.abs(ours.position("one", 1.0) - ours.position("two", 1.0 - tip[1])).max() < 1e-12
    assert np.abs(ours.energy.balance).max() < 1e-7 * ours.energy.kinetic.max()


def test_rigid_crank_and_follower_are_the_limit_of_stiff_ones():
    """In the four-bar: ten times the stiffness, a tenth of the distance; as the paper gives it, the modelling error."""
    base = four_bar().scene
    mesh, t_end = {"crank": 1, "coupler": 2, "follower": 1}, 0.8
    kinds = {"crank": "rigid", "coupler": "cable", "follower": "rigid"}
    rigid = solve(base, mesh=mesh, element=kinds, integrator="zhai", dt=1e-4, t_end=t_end, output_dt=0.1)
    distances = []
    for factor, dt in ((1.0, 1e-5), (10.0, 4e-6), (40.0, 2e-6)):
        stiff = tuple(
            b if b.name == "coupler" else replace(b, material=replace(b.material, E=factor * b.material.E))
            for b in base.bodies
        )
        run = Discretisation(mesh=mesh, integrator="zhai", dt=dt, t_end=t_end, output_dt=0.1)
        distances.append(gap(rigid, solve(replace(base, bodies=stiff), run), body="coupler"))
    assert distances[0] < 4e-4  # m: of a path of about 1 m
    assert distances[1] / distances[2] == pytest.approx(4.0, rel=0.1)
    assert np.abs(rigid.energy.balance).max() < 1e-5  # J: the account of the drive's work, too


def elbow(bend):
    """Two bars welded at an angle, which hang from a pin, and the tip of the second one."""
    tip = (1.0 + 0.5 * cos(bend), 0.5 * sin(bend))
    bodies = [beam("one", (0.0, 0.0), (1.0, 0.0)), beam("two", (1.0, 0.0), tip)]
    joints = [Pin("one.start"), Weld("one.end", "two.start")]
    return Scene("bent", bodies, joints, gravity=(0.0, -G)), tip


def directions(found):
    """Tangents of both bars where they meet, as complex numbers."""
    return (
        found.fields[name].coordinates[:, node, 1] @ [1.0, 1.0j] for name, node in (("one", -1), ("two", 0))
    )


@pytest.mark.parametrize("bend", [0.0, 0.7])
def test_two_welded_rigid_bodies_are_a_physical_pendulum(bend):
    """Of known inertia."""
    scene, tip = elbow(bend)
    ours = rigidly(scene, 1e-4)
    m, place = np.array([0.4, 0.2]), np.array([[0.5, 0.0], [0.5 * (1.0 + tip[0]), 0.5 * tip[1]]])
    about = (m * np.array([1.0, 0.25]) / 12.0 + m * (place**2).sum(axis=1)).sum()
    x, y = m @ place

    def rate(_, s):
        return [s[1], -G * (x * cos(s[0]) - y * sin(s[0])) / about]

    angle = solve_ivp(rate, (0.0, 0.5), [0.0, 0.0], rtol=1e-12, atol=1e-12, t_eval=ours.t).y[0]
    one, _ = directions(ours)
    assert np.abs(np.angle(one) - angle).max() < 1e-6


def test_free_rigid_bar_keeps_momentum_under_force_and_torque():
    """Thrown and spinning, pushed at its centre line's end by a force and turned by a torque: Newton and Euler."""
    spin, m, l, force, torque = 3.0, 0.4, 1.0, 0.3, 0.05  # noqa: E741
    bar = beam("bar", (0.0, 0.0), (l, 0.0), velocity=lambda s: (1.0, spin * (s - 0.5)))
    ours = rigidly(Scene("thrown", [bar], (), [Torque("bar.start", torque)]), 1e-4)
    middle, span = ours.position("bar", 0.5), ours.position("bar", 1.0) - ours.position("bar", 0.0)
    angle = np.unwrap(np.arctan2(span[:, 1], span[:, 0]))
    assert np.abs(middle - np.stack([0.5 + ours.t, 0.0 * ours.t], axis=1)).max() < 1e-6
    assert np.abs(angle - spin * ours.t - 0.5 * torque / (m * l * l / 12) * ours.t**2).max() < 1e-6
    pushed = rigidly(Scene("pushed", [bar], (), [Force("bar.end", (force, 0.0))]), 1e-4)
    x = pushed.position("bar", 0.5)[:, 0]
    assert np.abs(x - 0.5 - pushed.t - 0.5 * force / m * pushed.t**2).max() < 1e-6


def slider_that_locks(reach):
    """A crank that a drive turns, pinned to a coupler whose far end is pinned to the ground: it cannot move."""
    bodies = [beam("crank", (0.0, 0.0), (0.2, 0.0)), beam("coupler", (0.2, 0.0), reach)]
    turn = Quintic(turn=2.0 * pi, duration=2.0)
    return Scene("locked", bodies,
                 [Clamp("crank.start", angle=turn), Pin("crank.end", "coupler.start"), Pin("coupler.end")])  # fmt: skip


def driven_four_bar(crank, coupler, follower, ground):
    """A four-bar whose crank stands upright at first and is to make a whole turn."""
    along = np.arctan2(-crank, ground)  # from the crank's end to the follower's ground
    far = np.hypot(crank, ground)
    angle = along + np.arccos((coupler**2 + far**2 - follower**2) / (2.0 * coupler * far))
    knee = (coupler * cos(angle), crank + coupler * sin(angle))
    bodies = [
        beam("crank", (0.0, 0.0), (0.0, crank)),
        beam("coupler", (0.0, crank), knee),
        beam("follower", knee, (ground, 0.0)),
    ]
    turn = Quintic(turn=2.0 * pi, duration=2.0)
    joints = [Clamp("crank.start", angle=turn), Pin("crank.end", "coupler.start"),
              Pin("coupler.end", "follower.start"), Pin("follower.end")]  # fmt: skip
    return Scene("four-bar", bodies, joints)


LOCKS = {
    "no mobility": lambda: slider_that_locks((0.6, 0.3)),
    "no mobility, square": lambda: slider_that_locks((0.2, 0.3)),
    "not Grashof": lambda: driven_four_bar(0.3, 0.45, 0.3, 0.6),
    "long crank": lambda: driven_four_bar(0.5, 0.45, 0.4, 0.6),
    "welded crank": lambda: replace(
        slider_that_locks((0.6, 0.3)),
        joints=(Pin("crank.start"), Weld("crank.end", "coupler.start"), Clamp("coupler.end", angle=Quintic(1.0, 1.0))),
    ),
}  # fmt: skip


def locked(what, dt, output_dt):
    """The run of a linkage that locks."""
    return solve(
        LOCKS[what](), mesh=1, element="rigid", integrator="zhai", dt=dt, t_end=2.0, output_dt=output_dt
    )


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
@pytest.mark.parametrize("what", LOCKS)
def test_a_linkage_that_locks_has_failed_where_it_locks(what, dt):
    ours = locked(what, dt, 0.05)
    assert ours.status == "failed", ours.status
    assert any(f"'{body}" in ours.status.message for body in ("crank", "coupler", "follower"))
    assert f"t = {ours.status.time:.6g} s" in ours.status.message
    assert 0 < len(ours.t) < len(ours.run.output_steps)
    assert stretched(ours) < 1e-6


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
@pytest.mark.parametrize("what", ["no mobility", "no mobility, square"])
def test_it_has_failed_though_its_crank_comes_back_to_where_it_was(what, dt):
    assert locked(what, dt, 2.0).status == "failed"


@pytest.mark.parametrize("lengths", [(0.2, 0.5, 0.4, 0.6), (0.3, 0.5, 0.3, 0.5), (0.15, 0.4, 0.4, 0.6)])
@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_a_linkage_that_can_turn_is_whole(lengths, dt):
    """Grashof's, and the parallelogram that passes through its change points."""
    ours = solve(driven_four_bar(*lengths), mesh=1, element="rigid", integrator="zhai", dt=dt, t_end=2.0)
    assert ours.status.ok, ours.status
    assert stretched(ours) < 1e-9


def stretched(solution):
    """Largest strain of the bodies of a solution."""
    ends = {b: solution.position(b.name, 1.0) - solution.position(b.name, 0.0) for b in solution.scene.bodies}
    return max(float(np.abs(np.hypot(*span.T) / b.length - 1.0).max()) for b, span in ends.items())


def test_step_limit_is_that_of_what_can_still_move():
    """A rigid crank and follower leave the coupler's limit; rigid bodies alone have none."""
    base, mesh = four_bar().scene, {"crank": 1, "coupler": 2, "follower": 1}
    kinds = {"crank": "rigid", "coupler": "cable", "follower": "rigid"}
    system = system_of(base, mesh=mesh, element=kinds, integrator="zhai", dt=1e-5)
    limit = 2.0 / highest_frequency(system, system.mesh.reference)
    assert limit > 5.0 * 2.0 / frequency_of(base, mesh=mesh)
    for factor, ok in ((0.98, True), (1.05, False)):
        dt = factor * limit
        ours = solve(base, mesh=mesh, element=kinds, integrator="zhai", dt=dt, t_end=3000 * dt, output_dt=3000 * dt,
                     check_stability=False)  # fmt: skip
        assert ours.status.ok == ok
    assert solve(pendulum(), mesh=1, element="rigid", integrator="zhai", dt=0.1, t_end=0.1).status is not None


def test_a_rigid_bar_is_one_element():
    with pytest.raises(MeshError, match="mesh is 2 for rigid body 'one'; 1 is needed"):
        rigidly(pendulum(), 1e-3, mesh=2)
