"""The ordinary ANCF solver with multipliers: invariants, energy, order, its two linear algebras, statics, bad input."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import DiscretisationError, MeshError, StabilityError, UnknownOptionError
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld, distance
from anctmm.model.sections import Circle, Rectangle
from anctmm.results.metrics import compare
from reference import global_dae
from reference.global_dae import history
from reference.global_dae.explicit import Zhai
from reference.global_dae.implicit import GeneralizedAlpha
from reference.global_dae.model import Model
from reference.global_dae.stability import highest_frequency, limit, null_space

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


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_flying_bar_keeps_momentum(element, integrator):
    """Spinning and drifting without joints: the centre of mass moves as it started, no energy appears."""
    scene = bar(velocity=lambda s: (1.0 - 4.0 * (s - 0.5) * 0.8, 2.0 + 4.0 * (s - 0.5) * 0.6))
    dt = 2e-5 if integrator == "zhai" else 1e-3
    run = Discretisation(mesh=4, element=element, integrator=integrator, dt=dt, t_end=0.2, output_dt=0.02,
                         spectral_radius=1.0)  # fmt: skip
    s = global_dae.solve(scene, run)
    model = Model.of(scene, run)
    mass = SOFT.density * SQUARE.area
    ones = np.zeros(model.vectors)
    ones[model.numbers[0]] = 1.0
    weights = model.scalar_mass @ ones  # its product with the coordinates is the first moment
    q = s.fields["bar"].coordinates.reshape(len(s.t), -1, 2)
    centre = np.einsum("i,nic->nc", weights, q) / mass
    assert s.status.ok
    assert np.allclose(centre - [0.3, 0.4], s.t[:, None] * [1.0, 2.0], rtol=0.0, atol=1e-11)
    assert np.abs(s.energy.balance).max() < 1e-3 * s.energy.kinetic[0]


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


def test_projection_removes_the_drift_of_a_driven_clamp():
    """The prescribed direction is exact with projection; without, the integrator's own error accumulates."""
    drive = Quintic(pi / 2, 0.1)
    scene = bar([Clamp("bar.start", drive)])
    run = zhai(2, 2e-5, 0.2, 0.02)
    theta = drive(run.times(run.output_steps))[0] + np.arctan2(0.8, 0.6)
    exact = np.stack([np.cos(theta), np.sin(theta)], axis=1)
    drift = {}
    for kind in ("projection", "none"):
        s = global_dae.solve(scene, run, stabilization=kind)
        drift[kind] = np.abs(s.fields["bar"].coordinates[:, 0, 1] - exact).max()
    assert drift["projection"] < 1e-14
    assert 1e-12 < drift["none"] < 1e-3


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
    model = Model.of(four_bar(), implicit(MESH, 1e-3, 1.0, element=element))
    assert model.dofs == 6 * 3 + 4 * 9 + 6 * 3
    assert np.allclose(model.mass.toarray(), model.mass.toarray().T)
    assert np.abs((model.constraints @ null_space(model)).toarray()).max() < 1e-14


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
    model = Model.of(scene, zhai(2, 2e-5, 0.1))
    assert not model.separable
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


def test_static_moment_rolls_a_cable_into_an_arc():
    """Under an end moment π EI/L the exact shape is a half circle, however many parts the load takes."""
    EI = SOFT.E * SQUARE.second_moment
    scene = bar([Clamp("bar.start")], [Torque("bar.end", pi * EI)])
    one = global_dae.solve_static(scene, mesh=16)
    four = global_dae.solve_static(scene, mesh=16, load_steps=4)
    assert four.t.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert np.allclose(one.position("bar", 1.0)[-1], four.position("bar", 1.0)[-1], atol=1e-11)
    assert np.allclose(four.position("bar", 1.0)[-1], [-0.8 * 2 / pi, 0.6 * 2 / pi], atol=1e-5)


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
    s = global_dae.solve_static(bar([Pin("bar.start")], gravity=(0.0, -9.81)), mesh=2)
    assert s.status == "diverged"
    assert s.t.tolist() == [0.0]
    assert "bar" in s.status.message


def test_diverging_run_keeps_its_history_and_names_the_place():
    run = zhai(4, 1e-3, 1.0, 1e-3, check_stability=False)
    s = global_dae.solve(bar([Clamp("bar.start")], gravity=(0.0, -9.81)), run)
    assert s.status == "diverged"
    assert s.status.body == "bar"
    assert 0 <= s.status.element < 4
    assert 0 < len(s.t) == s.status.step < run.steps
    assert np.isfinite(s.position("bar", 1.0)).all()
    assert np.isfinite(s.energy.strain).all()


def test_newton_that_fails_keeps_the_history():
    """A jerk of the load beyond all reach."""
    scene = bar([Clamp("bar.start")], [Force("bar.end", lambda t: (0.0, -1e70 * (t > 0.055)))])
    for solve in (global_dae.solve, global_dae.solve_dense):
        s = solve(scene, implicit(4, 1e-2, 0.2))
        assert s.status == "diverged"
        assert s.status.time == pytest.approx(0.06)
        assert len(s.t) == 6
        assert "Newton" in s.status.message


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_stable_up_to_the_limit_and_refused_beyond(element):
    scene = bar([Pin("bar.start")], velocity=lambda s: (-0.08 * s, 0.06 * s))
    largest = limit(0.5, 0.5) / highest_frequency(Model.of(scene, zhai(2, 1e-5, 1.0, element=element)))
    below, above = (factor * largest for factor in (0.99, 1.01))
    s = global_dae.solve(scene, zhai(2, below, 2000 * below, 2000 * below, element=element))
    assert s.status.ok
    with pytest.raises(StabilityError, match="at most"):
        global_dae.solve(scene, zhai(2, above, 2000 * above, element=element))
    s = global_dae.solve(scene, zhai(2, above, 2000 * above, element=element, check_stability=False))
    assert not s.status.ok or np.abs(s.energy.balance).max() > s.energy.kinetic[0]
    with pytest.raises(StabilityError, match="psi"):
        global_dae.solve(scene, zhai(2, below, below, psi=0.25))


def test_largest_frequency_is_that_of_the_dense_and_the_sparse_eigenvalue_solver(monkeypatch):
    model = Model.of(four_bar(), zhai(MESH, 1e-5, 1.0, element="shear"))
    dense = highest_frequency(model)
    monkeypatch.setattr("reference.global_dae.stability.DENSE", 0)
    assert highest_frequency(model) == pytest.approx(dense, rel=1e-7)


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
@pytest.mark.parametrize("solve", [global_dae.solve, global_dae.solve_dense])
def test_what_is_set_up_is_no_cost_of_steps(solve, integrator, monkeypatch):
    """By a clock that ticks at set-up alone: ANC-TMM's chains stand beside its steps, too."""
    clock = [0.0]
    for kind in (GeneralizedAlpha, Zhai):

        def ticks(self, prepare=kind.prepare):
            prepare(self)
            clock[0] += 1.0

        monkeypatch.setattr(kind, "prepare", ticks)
    monkeypatch.setattr(history, "process_time", lambda: clock[0])
    cost = solve(bar([Pin("bar.start")]), mesh=2, dt=1e-4, t_end=1e-3, integrator=integrator).cost
    assert (clock, cost.cpu_s, cost.steps) == ([1.0], 0.0, 10)


def test_bad_input_is_refused_by_name():
    scene = bar([Clamp("bar.start")])
    run = implicit(2, 1e-3, 0.1)
    with pytest.raises(UnknownOptionError, match="linear_algebra is 'fast'"):
        global_dae.solve(scene, run, linear_algebra="fast")
    with pytest.raises(UnknownOptionError, match="stabilization is 'some'"):
        global_dae.solve(scene, run, stabilization="some")
    with pytest.raises(DiscretisationError, match="'colour'"):
        global_dae.solve(scene, mesh=2, colour=3)
    with pytest.raises(MeshError, match="every beam"):
        global_dae.solve(scene, mesh={"beam": 2})
    with pytest.raises(DiscretisationError, match="load_steps is 0"):
        global_dae.solve_static(scene, mesh=2, load_steps=0)
    halves = [
        Beam("a", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT),
        Beam("b", (1.0, 0.0), (2.0, 0.0), SQUARE, SOFT),
    ]
    welded = Scene("mixed", halves, [Weld("a.end", "b.start")])
    with pytest.raises(DiscretisationError, match=r"'a' of element 'cable' to 'b' of element 'shear'"):
        global_dae.solve(welded, mesh=2, element={"a": "cable", "b": "shear"})
