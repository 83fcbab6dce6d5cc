"""The global solver: its derivatives, energies and statuses, its two ways to march, and ANC-TMM beside it."""

from dataclasses import replace

import numpy as np
import pytest
from samples import RigidLink
from small_scenes import (
    DOWN,
    ROD,
    RUBBER,
    bar,
    everything,
    on_a_plate,
    parallelogram,
    random_beams,
    swing,
)

import anctmm as at
from anctmm.errors import (
    DiscretisationError,
    PropertyError,
    StabilityError,
    UnknownOptionError,
    UnsupportedError,
)
from reference import global_dae
from reference.global_dae import rival
from reference.global_dae.factors import factorise
from reference.global_dae.integrators import Zhai
from reference.global_dae.layout import Layout
from reference.global_dae.stability import highest, largest_step
from reference.global_dae.system import System
from studies.scenes import FOUR_BAR_PROBES, four_bar, four_bar_moment

#: Weights of the central difference of eighth order.
STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
MESH = {"crank": 2, "coupler": 8, "follower": 2}


def derivative(function, x, h=2e-3):
    """Jacobian of a function of an array, its columns by the coordinates."""
    columns = []
    for k in range(len(x)):
        step = np.zeros(len(x))
        step[k] = h
        columns.append(
            sum(w * (np.asarray(function(x + i * step)) - function(x - i * step)) for i, w in STENCIL) / h
        )
    return np.stack(columns, axis=-1)


def by_time(function, t):
    """Derivative of a function of time."""
    return derivative(lambda x: function(float(x[0])), np.array([t]))[..., 0]


def random_state(element="cable", **options):
    """A system with coordinates and velocities near the reference, and a time."""
    run = at.Discretisation(mesh=2, element=element, dt=1e-3, t_end=1.0)
    system = System(Layout(everything(**options), run))
    rng = np.random.default_rng(3)
    q = system.layout.reference + 0.05 * rng.standard_normal(system.size)
    return system, q, rng.standard_normal(system.size), 0.37


def error(one, two, probes):
    """Largest difference over probes and times, relative to the largest displacement; both have ended well."""
    assert one.status.ok, one.status
    assert two.status.ok, two.status
    return at.compare(one, two, probes).largest


# --- equations ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["cable", "shear", "quintic"])
def test_elements_are_those_of_the_readable_classes(element):
    system, q, v, _ = random_state(element)
    beams, force, damping, energy = system.beams, np.zeros(system.size), np.zeros(system.size), 0.0
    K, D = np.zeros((2, system.size, system.size))
    meshes = [mesh for mesh in system.layout.meshes.values() for _ in range(mesh.elements)]
    for mesh, rows in zip(meshes, beams.at, strict=True):
        x, y = q[rows].reshape(-1, 2), v[rows].reshape(-1, 2)
        energy += mesh.element.energy(x)
        force[rows] += mesh.element.force(x).ravel()
        damping[rows] -= mesh.element.damping_force(x, y).ravel()
        K[np.ix_(rows, rows)] += mesh.element.tangent(x).reshape(len(rows), len(rows))
        D[np.ix_(rows, rows)] += mesh.element.damping_matrix(x).reshape(len(rows), len(rows))
    assert beams.energy(q[None])[0] == pytest.approx(energy, rel=1e-13)
    for found, exact in (
        (beams.force(q), force), (beams.damping(q, v), damping),
        (beams.tangent(q).toarray(), K), (beams.tangent(q, 2.0).toarray(), K + 2.0 * D),
    ):  # fmt: skip
        np.testing.assert_allclose(found, exact, atol=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize("factor", [1.0, 0.4])
def test_forces_without_laws_loads_and_dampers_are_gradients_of_energies(factor):
    """At every part of the load."""
    springs = [c for c in everything().connectors if c.law is None and not c.damping]
    system, q, _, t = random_state(connectors=springs, loads=[at.LineLoad("one", (0.3, -0.4))])

    def energy(x):
        found = system.energies(x, system.still, t, np.zeros(2), factor)
        return found[1] + factor * found[2]

    gradient = derivative(energy, q)
    force = system.force(q, system.still, t, factor)
    np.testing.assert_allclose(force, -gradient, atol=1e-9 * np.abs(gradient).max())


def test_tangents_are_derivatives_of_forces():
    system, q, v, t = random_state()
    K = system.tangents(q, v, t)
    beams = system.beams.tangent(q, 1.0) - system.beams.tangent(q)
    D = system.tangents(q, v, t, by_velocity=1.0) - K - beams
    by_q, by_v = (
        -derivative(f, x)
        for f, x in ((lambda x: system.force(x, v, t), q), (lambda y: system.force(q, y, t), v))
    )
    for found, exact in ((K, by_q), (D, by_v)):
        scale = np.abs(exact).max()
        np.testing.assert_allclose(found.toarray() / scale, exact / scale, atol=2e-9)


def test_constraints_have_their_derivatives_and_fit_the_reference():
    system, q, v, t = random_state()
    c = system.constraints
    mu, p = np.random.default_rng(1).standard_normal(c.count), c.parameters(t)
    J, H = c.jacobian(q, p).toarray(), c.hessian(q, p, mu).toarray()
    np.testing.assert_allclose(J, derivative(lambda x: c.value(x, p), q), atol=1e-10)
    np.testing.assert_allclose(H, derivative(lambda x: c.jacobian(x, p).T @ mu, q), atol=1e-10)
    np.testing.assert_allclose(c.rate(q, p), by_time(lambda s: c.value(q, c.parameters(s)), t), atol=1e-9)

    def rate(s):  # of Φ on a path with velocity v
        x, ps = q + (s - t) * v, c.parameters(s)
        return c.jacobian(x, ps) @ v + c.rate(x, ps)

    np.testing.assert_allclose(-c.right(q, v, p), by_time(rate, t), atol=1e-8)
    assert np.abs(c.value(system.layout.reference, c.parameters(0.0))).max() < 1e-15


# --- motions --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha", "esdirk"])
def test_energy_balance_closes_with_the_order_of_the_steps(integrator):
    dt = {"zhai": 5e-5, "generalized-alpha": 1e-3, "esdirk": 2.5e-3}[integrator]
    run = {"mesh": 1, "integrator": integrator, "spectral_radius": 1.0, "t_end": 0.005, "output_dt": 0.005}
    runs = [global_dae.solve(everything(), dt=h, **run) for h in (dt, dt / 2)]
    assert [r.status.code for r in runs] == ["ok", "ok"]
    coarse, fine = (np.abs(r.energy.balance[1:]).max() for r in runs)
    assert fine < 1e-3 * np.abs(runs[1].energy.kinetic).max()
    assert coarse / fine > (3.5 if integrator != "esdirk" else 11.0)


def test_all_integrators_tend_to_one_motion():
    probes = [
        "plate.b",
        "rider.center",
        "block.center",
        "ball.center",
        "bead.center",
        "two.end",
        ("one", 0.4),
    ]
    run = {"mesh": 1, "t_end": 0.01, "output_dt": 0.005, "newton_tolerance": 1e-12}
    fine = global_dae.solve(everything(), integrator="esdirk", dt=5e-4, **run)
    explicit = global_dae.solve(everything(), integrator="zhai", dt=5e-5, **run)
    far, near = (global_dae.solve(everything(), spectral_radius=1.0, dt=h, **run) for h in (1e-3, 5e-4))
    errors = [error(s, fine, probes) for s in (far, near, explicit)]
    assert errors[1] < 1e-3
    assert 3.3 < errors[0] / errors[1] < 4.7
    assert errors[2] < 1e-4


@pytest.mark.parametrize(
    ("options", "level"),
    [
        ({"integrator": "zhai", "dt": 2e-4}, 1e-9),
        ({"dt": 1e-3, "newton_tolerance": 1e-12}, 1e-8),
        ({"integrator": "esdirk", "dt": 2e-3, "newton_tolerance": 1e-12}, 1e-6),
    ],
    ids=["explicit", "implicit", "esdirk"],
)
def test_all_bodies_connectors_and_loads_move_as_by_anc_tmm(options, level):
    """And have the same energies: the same formulas of work, found twice."""
    options = {"mesh": 2, "t_end": 0.1, "output_dt": 0.01} | options
    ours, theirs = at.solve(on_a_plate(), **options), global_dae.solve(on_a_plate(), **options)
    assert error(ours, theirs, ["a.end", ("a", 0.37), "plate.q", "load.center"]) < level
    scale = np.abs(ours.energy.strain).max()
    assert np.abs(ours.energy.strain - theirs.energy.strain).max() < level * scale


@pytest.mark.parametrize(("base", "element"), [(four_bar, "shear"), (four_bar_moment, "cable")])
@pytest.mark.parametrize(
    "options",
    [
        {"integrator": "zhai", "dt": 1e-5, "t_end": 0.1},
        {"dt": 2e-3, "t_end": 0.2, "newton_tolerance": 1e-14},
        {"integrator": "esdirk", "dt": 4e-3, "t_end": 0.1, "newton_tolerance": 1e-14},
    ],
    ids=["zhai", "generalized-alpha", "esdirk"],
)
def test_the_four_bar_moves_as_by_anc_tmm(base, element, options):
    """The same elements, mesh, integrator and step: to rounding, work to what its quadratures differ by."""
    run = at.Discretisation(mesh=MESH, element=element, output_dt=0.02, **options)
    ours, theirs = at.solve(base().scene, run), global_dae.solve(base().scene, run)
    assert error(ours, theirs, FOUR_BAR_PROBES) < 2e-9
    scale = np.abs(ours.energy.kinetic).max()
    for name, series in vars(ours.energy).items():
        assert np.abs(series - getattr(theirs.energy, name)).max() < 1e-5 * scale


def compared(seed, integrator):
    """Both ways to march of a random scene."""
    scene, element = random_beams(seed)
    explicit = integrator == "zhai"
    run = at.Discretisation(
        mesh=2, element=element, integrator=integrator, dt=1e-5 if explicit else 2e-3, newton_tolerance=1e-12,
        output_dt=5e-4 if explicit else 0.01, t_end=2e-3 if explicit else 0.06,
    )  # fmt: skip
    probes = [f"{body.name}.end" for body in scene.bodies]
    return scene, run, probes, global_dae.solve(scene, run), global_dae.solve_plain(scene, run)


def apart(one, two, probes):
    """Largest difference of positions and of their energies, of the sizes of both, 1 m."""
    assert one.status.ok, one.status
    assert two.status.ok, two.status
    places = max(np.abs(one.position(p) - two.position(p)).max() for p in probes)
    scale = max(np.abs(one.energy.kinetic).max(), np.abs(one.energy.potential).max(), 1e-9)
    energies = [np.abs(x - getattr(two.energy, n)).max() / scale for n, x in vars(one.energy).items()]
    return max(places, *energies)


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
@pytest.mark.parametrize("seed", range(6))
def test_both_ways_to_march_agree(seed, integrator):
    _, _, probes, rival, judge = compared(seed, integrator)
    assert apart(rival, judge, probes) < 1e-10


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_a_third_crank_may_hold_what_two_hold_already(integrator):
    run = {"integrator": integrator, "dt": 2e-3, "t_end": 1.0, "output_dt": 0.1}
    two = parallelogram(2)
    heavy = [replace(b, mass=2.0, inertia=0.2) if b.name == "y" else b for b in two.bodies]
    three, reference = (global_dae.solve(s, **run) for s in (parallelogram(3), replace(two, bodies=heavy)))
    assert error(three, reference, ["q.center", "q.z", "x.p"]) < 1e-9


def test_a_joint_may_lie_anywhere_on_a_beam():
    """At a fraction without a node, a finer mesh brings it to where a node lies there."""

    def prop(mesh):
        scene = bar([at.Clamp("bar.start"), at.Pin(("bar", 0.4))], gravity=DOWN)
        return global_dae.solve(scene, mesh=mesh, dt=2e-3, t_end=0.2, output_dt=0.02)

    exact = prop(10)
    errors = [error(prop(mesh), exact, ["bar.end"]) for mesh in (3, 6)]
    assert errors[0] > 2.5 * errors[1]
    assert errors[1] < 0.02
    assert np.abs(prop(3).displacement(("bar", 0.4))).max() < 1e-12


def test_reactions_are_the_multipliers():
    bodies = [
        at.Beam("one", (0, 0), (0.5, 0.1), ROD, RUBBER),
        at.RigidBody("plate", 0.2, 1e-3, (0.6, 0.15), {"a": (0.5, 0.1), "b": (0.8, 0.1)}),
    ]
    joints = [at.Clamp("one.start", angle=swing), at.Pin("one.end", "plate.a")]
    scene = at.Scene("swinging", bodies, joints, gravity=DOWN)
    run = at.Discretisation(mesh=2, integrator="zhai", dt=1e-4, t_end=2e-3)
    solver = Zhai(System(Layout(scene, run)))
    states = [solver.begin()]
    for t in run.times(np.arange(1, 21)).tolist():
        states.append(solver.step(states[-1], t))
    found, mu = global_dae.solve_plain(scene, run), np.array([state.mu for state in states])
    # rows: one of the plate's vector, the clamp's place and gradient, the pin, plate less beam
    pin, place = (found.reaction(joint)[:, :2] for joint in (joints[1], joints[0]))
    np.testing.assert_allclose(pin, mu[:, 5:7], atol=1e-8 * np.abs(pin).max())
    np.testing.assert_allclose(place, -mu[:, 1:3], atol=1e-8 * np.abs(place).max())


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_dense_and_sparse_agree_to_rounding(element):
    """Same equations by LAPACK anew each time and by factors kept: the history is the same, the count is not."""
    scene = four_bar().scene
    run = at.Discretisation(
        mesh=MESH, element=element, integrator="zhai", dt=1e-5, t_end=0.02, output_dt=0.002
    )
    sparse, dense = global_dae.solve(scene, run), global_dae.solve_dense(scene, run)
    assert error(sparse, dense, FOUR_BAR_PROBES) < 1e-9
    assert (sparse.cost.factorizations, dense.cost.factorizations) == (1, run.steps + 1)
    run = at.Discretisation(
        mesh=MESH, element=element, dt=1e-3, t_end=0.2, output_dt=0.02, newton_tolerance=1e-12
    )
    sparse, dense = global_dae.solve(scene, run), global_dae.solve_dense(scene, run)
    assert error(sparse, dense, FOUR_BAR_PROBES) < 1e-10
    assert sparse.cost.factorizations < dense.cost.factorizations == dense.cost.newton_iterations


# --- rest -----------------------------------------------------------------------------------------------------


def test_equilibria_are_those_of_anc_tmm():
    scene = replace(on_a_plate(), loads=[x for x in on_a_plate().loads if not getattr(x, "follower", False)])
    ours, theirs = (
        s(scene, mesh=2, newton_tolerance=1e-12) for s in (at.solve_static, global_dae.solve_static)
    )
    assert error(ours, theirs, ["a.end", ("a", 0.37), "plate.q", "load.center"]) < 1e-9


def test_a_preloaded_spring_stores_the_integral_of_its_force_at_each_part_of_the_load():
    """Its force at a part f of the load is k e + f P; so is its energy ½ k e² + f P e."""
    spring = at.Spring("m.center", (0.0, 1.0), stiffness=40.0, preload=2.0)
    scene = at.Scene("hung", [at.PointMass("m", 0.5, (0.0, 0.0))], gravity=DOWN, connectors=[spring])
    found = global_dae.solve_static(scene, load_steps=4)
    e = (0.5 * 9.81 - 2.0) / 40.0 * found.t
    np.testing.assert_allclose(-found.displacement("m.center")[:, 1], e, atol=1e-12)
    np.testing.assert_allclose(found.energy.strain, 20.0 * e**2 + found.t * 2.0 * e, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_what_rests_on_springs_stays_at_rest_however_it_is_turned(angle):
    turn = complex(np.cos(angle), np.sin(angle))

    def at_(x, y):
        z = complex(x, y) * turn
        return z.real, z.imag

    plate = at.RigidBody("p", 200.0, 50.0, at_(0, 0.5), {"l": at_(-0.6, 0.5), "r": at_(0.6, 0.5)})
    springs = [
        at.Spring(f"p.{k}", at_(x, 0.0), stiffness=2e4, damping=1e3) for k, x in (("l", -0.6), ("r", 0.6))
    ]
    springs += [at.Spring("p.l", at_(-1.6, 0.5), stiffness=2e4)]
    found = global_dae.solve(at.Scene("car", [plate], connectors=springs), dt=1e-3, t_end=0.1)
    assert found.status.ok, found.status
    assert np.abs(found.displacement("p.center")).max() < 1e-12


@pytest.mark.parametrize("scale", [1e-6, 1e5])
def test_the_stability_of_an_equilibrium_does_not_depend_on_the_size(scale):
    section, material = at.Rectangle(0.02 * scale, 0.01 * scale), at.Material(E=5e7 * scale, density=1200.0)
    ends = [(0.0, 0.0), (0.3 * scale, 0.4 * scale), (0.1 * scale, 0.4 * scale), (0.4 * scale, 0.0)]
    beams = [
        at.Beam(name, ends[i], ends[j], section, material)
        for name, i, j in (("left", 0, 1), ("right", 3, 2), ("coupler", 1, 2))
    ]
    joints = [at.Pin("left.start"), at.Pin("right.start"), at.Pin("left.end", "coupler.start"),
              at.Pin("right.end", "coupler.end")]  # fmt: skip
    spring = at.RotationalSpring("left.start", stiffness=2.0 * scale**4)
    scene = at.Scene("linkage", beams, joints, gravity=(0.5, -0.5), connectors=[spring])
    found = global_dae.solve_static(scene, mesh=1)
    assert found.status.ok, found.status


# --- what goes wrong ------------------------------------------------------------------------------------------


def test_a_run_that_diverges_keeps_its_history_and_names_the_place():
    scene = bar([at.Clamp("bar.start")], gravity=DOWN)
    for solve in (global_dae.solve, global_dae.solve_plain):
        s = solve(scene, mesh=4, integrator="zhai", dt=1e-3, t_end=1.0, check_stability=False)
        assert s.status == "diverged"
        assert s.status.body == "bar"
        assert 0 < len(s.t) <= s.status.step < 1000
        assert np.isfinite(s.position("bar", 1.0)).all()


def test_newton_that_fails_keeps_the_history():
    scene = bar([at.Clamp("bar.start")], [at.Force("bar.end", lambda t: (0.0, -1e70 * (t > 0.055)))])
    for solve in (global_dae.solve, global_dae.solve_dense, global_dae.solve_plain):
        s = solve(scene, mesh=4, dt=1e-2, t_end=0.2)
        assert s.status == "diverged"
        assert s.status.time == pytest.approx(0.06)
        assert len(s.t) == 6


@pytest.mark.parametrize("solve", [global_dae.solve, global_dae.solve_plain])
def test_a_history_that_breaks_off_keeps_what_was_found(solve):
    scene = bar([at.Clamp("bar.start")], [at.Force("bar.end", lambda t: (0.0, 1.0) if t < 0.055 else None)])
    with pytest.raises(PropertyError, match=r"force on 'bar\.end'") as caught:
        solve(scene, mesh=2, dt=1e-2, t_end=0.2)
    assert len(caught.value.solution.t) == 6
    assert caught.value.solution.status == "failed"


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_steps_are_stable_up_to_the_limit_and_refused_beyond(element):
    scene = bar([at.Pin("bar.start")], velocity=lambda s: (-0.08 * s, 0.06 * s))
    system = System(Layout(scene, at.Discretisation(mesh=2, element=element, integrator="zhai", dt=1e-5)))
    largest = largest_step(system)[1]
    run = {"mesh": 2, "element": element, "integrator": "zhai"}
    below = global_dae.solve(scene, dt=0.99 * largest, t_end=1980 * largest, output_dt=1980 * largest, **run)
    assert below.status.ok
    with pytest.raises(StabilityError, match="at most"):
        global_dae.solve(scene, dt=1.01 * largest, t_end=2020 * largest, **run)
    with pytest.raises(StabilityError, match="psi"):
        global_dae.solve(scene, dt=0.5 * largest, t_end=largest, psi=0.25, **run)


def test_stiff_springs_and_dampers_bound_the_explicit_step():
    def scene(stiffness, damping=0.0):
        spring = at.Spring("m.center", (0, 1), stiffness=stiffness, damping=damping)
        return at.Scene("mass", [at.PointMass("m", 2.0, (0, 0))], connectors=[spring])

    run = {"integrator": "zhai", "t_end": 0.1}
    assert global_dae.solve(scene(8000.0), dt=0.025, **run).status.ok
    with pytest.raises(StabilityError, match=r"at most 0\.0316"):
        global_dae.solve(scene(8000.0), dt=0.1 / 3.0, **run)
    with pytest.raises(StabilityError, match="at most"):
        global_dae.solve(scene(8000.0, 400.0), dt=0.02, **run)


def test_the_highest_frequency_of_large_scenes_is_that_of_the_dense_solver(monkeypatch):
    system = System(
        Layout(four_bar().scene, at.Discretisation(mesh=MESH, element="shear", dt=1e-5, t_end=1.0))
    )
    dense = highest(system)[0]
    monkeypatch.setattr("reference.global_dae.stability.DENSE", 0)
    assert highest(system)[0] == pytest.approx(dense, rel=1e-7)


def test_bad_input_is_refused_by_name():
    scene, run = bar([at.Clamp("bar.start")]), {"mesh": 2, "dt": 1e-3, "t_end": 0.1}
    with pytest.raises(UnknownOptionError, match="linear_algebra is 'fast'"):
        global_dae.solve(scene, **run, linear_algebra="fast")
    with pytest.raises(DiscretisationError, match="load_steps is 0"):
        global_dae.solve_static(scene, mesh=2, load_steps=0)
    halves = [at.Beam("a", (0, 0), (1, 0), ROD, RUBBER), at.Beam("b", (1, 0), (2, 0), ROD, RUBBER)]
    welded = at.Scene("mixed", halves, [at.Weld("a.end", "b.start")])
    with pytest.raises(DiscretisationError, match=r"'a' of element 'cable' to 'b' of element 'shear'"):
        global_dae.solve(welded, element={"a": "cable", "b": "shear"}, **run)


@pytest.mark.parametrize("solve", [global_dae.solve, global_dae.solve_plain, global_dae.solve_static])
def test_joints_of_a_users_own_are_refused_by_name(solve):
    scene = bar([RigidLink("bar.start", (0.0, 1.0))])
    with pytest.raises(UnsupportedError, match="RigidLink"):
        solve(scene, mesh=2, dt=1e-3, t_end=0.1)


def test_the_rivals_factors_of_a_beam_have_the_fill_of_a_band(monkeypatch):
    found = []
    monkeypatch.setattr(rival, "factorise", lambda *given: found.append(factorise(*given)) or found[-1])
    global_dae.solve(bar([at.Clamp("bar.start")]), mesh=64, dt=1e-3, t_end=1e-3)
    assert found
    assert all(len(factors.lower) <= 12 * len(factors.inverse) for factors, _ in found)
