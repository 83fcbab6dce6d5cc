"""The global solver by its public face: invariants, energy, order, its two linear algebras, statics, other models."""

from dataclasses import replace
from math import cos, pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from small_scenes import ROD, RUBBER, swing

import anctmm as at
from anctmm.discretise.discretisation import Discretisation
from anctmm.model.bodies import distance
from anctmm.model.drives import Quintic
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Weld
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


@pytest.mark.parametrize(
    "run", [zhai(MESH, 2e-5, 0.02, 0.01), implicit(MESH, 1e-3, 0.1, 0.01, newton_tolerance=1e-12)]
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
