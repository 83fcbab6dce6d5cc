"""The global solver by its public face: invariants, energy, order, its two linear algebras, statics, other models."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from small_scenes import ROD, RUBBER, swing

import anctmm as at
from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import DiscretisationError, MeshError
from anctmm.model.bodies import distance
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld
from anctmm.model.sections import Circle, Rectangle
from anctmm.results.metrics import compare
from reference import global_dae

SOFT = Material(E=1e7, density=1000.0)
SQUARE = Rectangle(0.02, 0.02)
MESH = {"crank": 2, "coupler": 8, "follower": 2}
PROBES = ["coupler.end", ("coupler", 0.5)]
A, B, C, D = (0.0, 0.0), (0.2, 0.0), (0.2 + 0.45 * 3**0.5, 0.45), (0.2 + 0.3 * 3**0.5, 0.0)


def four_bar(joints=None, order=("crank", "coupler", "follower"), turned=()):
    """Table 1 of Rong 2014; bodies in some order, those in `turned` drawn from their other end."""
    bodies = {}
    for name, start, end, d, mass, E in [
        ("crank", A, B, 0.04, 0.6811, 1e9),
        ("coupler", B, C, 0.05, 2.474, 5e6),
        ("follower", C, D, 0.03, 1.470, 5e8),
    ]:
        section = Circle(d)
        material = Material(E, mass / (section.area * distance(start, end)))
        ends = (end, start) if name in turned else (start, end)
        bodies[name] = Beam(name, *ends, section, material)

    def at(name, side):
        return f"{name}.{({'start': 'end', 'end': 'start'}[side]) if name in turned else side}"

    joints = [
        Clamp(at("crank", "start"), angle=Quintic(2.0 * pi, 2.0)),
        Pin(at("crank", "end"), at("coupler", "start")),
        Pin(at("coupler", "end"), at("follower", "start")),
        Pin(at("follower", "end")),
    ]
    return Scene("four-bar", [bodies[n] for n in order], joints)


def bar(joints=(), loads=(), velocity=None, gravity=(0.0, 0.0), material=SOFT):
    beam = Beam("bar", (0.0, 0.0), (0.6, 0.8), SQUARE, material, velocity)
    return Scene("bar", [beam], joints, loads, gravity)


def zhai(mesh, dt, t_end, output_dt=None, **options):
    return Discretisation(mesh=mesh, integrator="zhai", dt=dt, t_end=t_end, output_dt=output_dt, **options)


def implicit(mesh, dt, t_end, output_dt=None, **options):
    return Discretisation(mesh=mesh, dt=dt, t_end=t_end, output_dt=output_dt, **options)


def test_stiff_pendulum_swings_as_a_rigid_one():
    """A stiff pinned bar follows 2l/3 θ'' = −g cos θ (θ from the horizontal) of a uniform rigid bar."""
    scene = bar([Pin("bar.start")], gravity=(0.0, -9.81), material=Material(1e12, 1000.0))
    s = global_dae.solve(scene, implicit(2, 5e-4, 1.0, 0.1))
    start = np.arctan2(0.8, 0.6)
    rigid = solve_ivp(lambda t, y: [y[1], -1.5 * 9.81 * cos(y[0])], (0, 1), [start, 0.0], t_eval=s.t, rtol=1e-10,
                      atol=1e-10)  # fmt: skip
    tip = np.stack([np.cos(rigid.y[0]), np.sin(rigid.y[0])], axis=1)
    assert np.abs(s.position("bar", 1.0) - tip).max() < 1e-5
    assert np.abs(s.position("bar", 0.0)).max() < 1e-14


@pytest.mark.parametrize(("element", "dt"), [("cable", 2e-5), ("shear", 1e-5)])
def test_energy_balance_closes_with_the_square_of_the_step(element, dt):
    """Drive work, kinetic and strain energy of the driven four-bar (explicit)."""
    gaps = [
        np.abs(global_dae.solve(four_bar(), zhai(MESH, h, 0.4, 0.02, element=element)).energy.balance).max()
        for h in (dt, dt / 2)
    ]
    assert 3.5 < gaps[0] / gaps[1] < 4.5
    assert gaps[0] < 2e-8


def test_energy_balance_with_torque_and_force_of_time():
    scene = bar([Pin("bar.start")], [Torque("bar.start", Pulse(1.0, 0.1)), Force("bar.end", lambda t: (0.0, 5 * t))],
                gravity=(0.0, -9.81))  # fmt: skip
    gaps = [np.abs(global_dae.solve(scene, zhai(2, h, 0.1, 0.01)).energy.balance).max() for h in (2e-5, 1e-5)]
    assert 3.5 < gaps[0] / gaps[1] < 4.5
    assert gaps[1] < 2e-7


def test_implicit_converges_to_explicit_at_second_order():
    scene = bar([Clamp("bar.start", Quintic(pi / 4, 0.2))], gravity=(0.0, -9.81))
    fine = global_dae.solve(scene, zhai(2, 1e-5, 0.2, 0.02))
    errors = [
        compare(
            global_dae.solve(scene, implicit(2, h, 0.2, 0.02, newton_tolerance=1e-12)), fine, ["bar.end"]
        ).error
        for h in (5e-4, 2.5e-4)
    ]
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1
    assert errors[1] < 1e-4


@pytest.mark.parametrize(
    "element", ["cable", "shear", {"crank": "shear", "coupler": "cable", "follower": "shear"}]
)
def test_dense_and_sparse_agree_to_rounding(element):
    """Same equations by LAPACK anew each time and by factors kept: the history is the same, the count is not."""
    explicit = zhai(MESH, 1e-5, 0.02, 0.002, element=element)
    sparse, dense = global_dae.solve(four_bar(), explicit), global_dae.solve_dense(four_bar(), explicit)
    assert compare(sparse, dense, PROBES).largest < 1e-9
    assert (sparse.solver, dense.solver) == ("global-dae", "global-dae-dense")
    assert (sparse.cost.factorizations, dense.cost.factorizations) == (1, explicit.steps + 1)
    newton = implicit(MESH, 1e-3, 0.2, 0.02, element=element, newton_tolerance=1e-12)
    sparse, dense = global_dae.solve(four_bar(), newton), global_dae.solve_dense(four_bar(), newton)
    assert compare(sparse, dense, PROBES).largest < 1e-10
    assert sparse.cost.factorizations < dense.cost.factorizations == dense.cost.newton_iterations


def test_mixed_elements_count_only_their_own_coordinates():
    element = {"crank": "shear", "coupler": "cable", "follower": "shear"}
    found = global_dae.solve(four_bar(), implicit(MESH, 1e-3, 1e-3, element=element))
    assert found.dofs == 2 * (3 * 3 + 2 * 9 + 3 * 3)


@pytest.mark.parametrize(
    "run", [zhai(MESH, 2e-5, 0.1, 0.01), implicit(MESH, 1e-3, 0.1, 0.01, newton_tolerance=1e-12)]
)
def test_order_and_direction_of_bodies_do_not_matter(run):
    usual = global_dae.solve(four_bar(), run)
    other = global_dae.solve(
        four_bar(order=("follower", "crank", "coupler"), turned=("coupler", "crank")), run
    )
    for fraction in (0.0, 0.5, 1.0):
        gap = usual.position("coupler", fraction) - other.position("coupler", 1.0 - fraction)
        assert np.abs(gap).max() < 1e-11


@pytest.mark.parametrize("opposite", [False, True])
@pytest.mark.parametrize("element", ["cable", "shear"])
def test_weld_of_two_halves_is_one_body(opposite, element):
    tip, middle = (0.6, 0.8), (0.3, 0.4)
    ends = (tip, middle) if opposite else (middle, tip)
    halves = [Beam("a", (0.0, 0.0), middle, SQUARE, SOFT), Beam("b", *ends, SQUARE, SOFT)]
    weld = Weld("a.end", "b.end" if opposite else "b.start")
    split = Scene("halves", halves, [Clamp("a.start"), weld], gravity=(0.0, -9.81))
    for run in (zhai(4, 1e-5, 0.02, 0.002, element=element), implicit(4, 1e-3, 0.1, 0.01, element=element)):
        whole = global_dae.solve(bar([Clamp("bar.start")], gravity=(0.0, -9.81)), run)
        parts = global_dae.solve(split, replace(run, mesh=2))
        gap = whole.position("bar", 1.0) - parts.position("b", 0.0 if opposite else 1.0)
        assert np.abs(gap).max() < 1e-10


def test_weld_at_an_angle_keeps_it():
    """A bent frame: x and y mix in the weld, so both run through one matrix."""
    bodies = [Beam("a", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT),
              Beam("b", (1.0, 0.0), (1.0 + 0.5 * cos(1.0), 0.5 * sin(1.0)), SQUARE, SOFT)]  # fmt: skip
    scene = Scene("frame", bodies, [Clamp("a.start"), Weld("a.end", "b.start")], gravity=(0.0, -9.81))
    for run in (zhai(2, 2e-5, 0.1, 0.01), implicit(2, 1e-3, 0.1, 0.01)):
        s = global_dae.solve(scene, run)
        a, b = (s.fields[n].coordinates[:, i, 1] @ [1.0, 1.0j] for n, i in (("a", -1), ("b", 0)))
        assert np.abs(b - a * np.exp(1.0j)).max() < 1e-12
        assert np.abs(s.energy.balance).max() < 1e-2 * np.abs(s.energy.potential).max()
    static = global_dae.solve_static(scene, mesh=2)
    slow = np.abs(static.displacement("b.end")[-1]).max()
    assert static.status.ok
    assert slow > 0.01


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_static_cantilever_under_a_small_load_is_a_linear_beam(element):
    """Tip deflection F L³/(3 E I), with F L/(G A) for shear; the shear element converges at second order only."""
    F, EI = 1e-4, SOFT.E * SQUARE.second_moment
    scene = bar([Clamp("bar.start")], [Force("bar.end", (-0.8 * F, 0.6 * F))])
    s = global_dae.solve_static(scene, mesh=32, element=element)
    shear = F / (SOFT.lame[1] * SQUARE.area) if element == "shear" else 0.0
    deflection = s.displacement("bar.end")[-1] @ [-0.8, 0.6]
    assert s.status.ok
    assert deflection == pytest.approx(F / (3 * EI) + shear, rel=1e-6 if element == "cable" else 2e-3)
    assert s.t.tolist() == [0.0, 1.0]


def test_static_is_where_damped_motion_settles():
    """Numerical damping at ρ∞ = 0 and steps of the lowest period's order end the motion under gravity."""
    scene = bar([Clamp("bar.start")], gravity=(0.0, -0.02))
    rest = global_dae.solve_static(scene, mesh=4).displacement("bar.end")[-1]
    moved = global_dae.solve(scene, implicit(4, 0.5, 100.0, 50.0, spectral_radius=0.0)).displacement(
        "bar.end"
    )[-1]
    assert np.abs(rest).max() > 0.002
    assert np.allclose(moved, rest, rtol=0.0, atol=1e-9)


def test_static_that_cannot_stand_says_so_and_keeps_the_start():
    s = global_dae.solve_static(bar(gravity=(0.0, -9.81)), mesh=2)
    assert s.status == "diverged"
    assert s.t.tolist() == [0.0]
    assert "bar" in s.status.message


# --- other models of one scene --------------------------------------------------------------------------------


def bars():
    """A driven bar and a hinged one under a torque."""
    bodies = [at.Beam("a", (0, 0), (1, 0), ROD, RUBBER), at.Beam("b", (1, 0), (1.5, -0.5), ROD, RUBBER)]
    joints = [at.Clamp("a.start", angle=swing), at.Pin("a.end", "b.start")]
    return at.Scene("bars", bodies, joints, [at.Torque("b.end", 0.05)], gravity=(0, -9.81))


def test_rigid_bars_tend_to_those_of_anc_tmm():
    """Coordinates are others, so that steps, of second order, differ by what is of third order."""
    run = {"mesh": 1, "element": "rigid", "integrator": "zhai", "t_end": 0.3, "output_dt": 0.05}
    one, two = (
        at.compare(*(s(bars(), **run, dt=dt) for s in (at.solve, global_dae.solve)), ["b.start", "b.end"])
        for dt in (5e-4, 2.5e-4)
    )
    assert two.error < 1e-9
    assert one.error / two.error == pytest.approx(8.0, rel=0.1)


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_reactions_of_beams_are_those_of_anc_tmm(integrator):
    run = {"mesh": 2, "integrator": integrator, "dt": 1e-4, "t_end": 0.01, "output_dt": 1e-3}
    scene = bars()
    ours, dae = at.solve(scene, **run), global_dae.solve(scene, **run)
    for joint in scene.joints:
        one, two = ours.reaction(joint), dae.reaction(joint)
        np.testing.assert_allclose(one, two, atol=1e-7 * np.abs(two).max())


def test_a_point_mass_is_a_rigid_body_without_turning():
    def scene(body):
        spring = at.Spring(f"{body.name}.center", (0.3, 0.8), stiffness=30.0, damping=0.1, length=0.5)
        return at.Scene("hung", [body], connectors=[spring], gravity=(0, -9.81))

    run = {"dt": 1e-3, "t_end": 0.5}
    one = global_dae.solve(scene(at.PointMass("m", 0.2, (0, 0))), **run)
    two = global_dae.solve(scene(at.RigidBody("m", 0.2, 1.0, (0, 0))), **run)
    assert at.compare(one, two, ["m.center"]).error < 1e-12


def test_a_line_load_is_weight():
    beam = at.Beam("b", (0, 0), (1, 0), ROD, RUBBER)
    load = at.LineLoad("b", (0, -9.81 * RUBBER.density * ROD.area))
    run = {"mesh": 3, "dt": 1e-3, "t_end": 0.05}
    hung = at.Scene("hung", [beam], [at.Clamp("b.start")], gravity=(0, -9.81))
    loaded = at.Scene("loaded", [beam], [at.Clamp("b.start")], [load])
    assert at.compare(global_dae.solve(loaded, **run), global_dae.solve(hung, **run), ["b.end"]).error < 1e-9


def test_bad_discretisations_are_refused_by_name():
    scene = bar([Clamp("bar.start")])
    with pytest.raises(DiscretisationError, match="'colour'"):
        global_dae.solve(scene, mesh=2, colour=3)
    with pytest.raises(DiscretisationError, match="'path'"):
        global_dae.solve_static(scene, mesh=2, path="arclength")
    with pytest.raises(MeshError, match="every beam"):
        global_dae.solve(scene, mesh={"beam": 2})
