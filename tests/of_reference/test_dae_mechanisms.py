"""The global solver's mechanisms: forces, tangents, constraints, energies, and what a second model of a scene says."""

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import MeshError, StabilityError, UnsupportedError
from reference import global_dae
from reference.global_dae.mechanisms.layout import Layout
from reference.global_dae.mechanisms.system import System

ROD, RUBBER = at.Circle(0.02), at.Material(E=5e6, density=1100.0)
#: Weights of the central difference of eighth order.
STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))


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


def by_time(function, t, h=2e-3):
    """Derivative of a function of time."""
    return derivative(lambda x: function(float(x[0])), np.array([t]), h)[..., 0]


def law(elongation, rate, t):
    """A spring that grows stiff, with friction like a liquid's and a motor that swings."""
    return 30.0 * elongation + 8.0 * elongation**3 + 0.7 * rate * abs(rate) + 0.3 * np.sin(5.0 * t)


def length(t):
    return 0.6 + 0.1 * np.sin(3.0 * t), 0.3 * np.cos(3.0 * t)


def swing(t):
    return 0.3 * np.sin(2.0 * t) ** 2, 0.6 * np.sin(4.0 * t), 2.4 * np.cos(4.0 * t)


def everything(element_of=None, **options):
    """All bodies, joints, connectors and loads at once."""
    bodies = [
        at.Beam("one", (0, 0), (0.5, 0.1), ROD, RUBBER),
        at.Beam("two", (0.5, 0.1), (0.9, 0.0), ROD, RUBBER),
        at.RigidBody("plate", 0.2, 1e-3, (1.0, 0.15), {"a": (0.9, 0.0), "b": (1.2, 0.1)}),
        at.RigidBody("rider", 0.1, 5e-4, (1.25, 0.2), {"in": (1.2, 0.1)}),
        at.RigidBody("block", 0.3, 2e-3, (-0.3, 0.0), {"c": (-0.2, 0.1)}),
        at.PointMass("ball", 0.05, (0.4, -0.4)),
        at.PointMass("bead", 0.05, (1.0, 0.4)),
    ]
    joints = [
        at.Clamp("one.start", angle=swing),
        at.Weld("one.end", "two.start", angle=swing),
        at.Weld("two.end", "plate.a"),
        at.Prismatic("rider.in", (1.0, 0.5), body="plate"),
        at.Slider("block.c", (0.0, 1.0), position=swing),
        at.Slider("bead.center", (0.0, 2.0), body="plate"),
    ]
    connectors = [
        at.Spring("ball.center", (0.1, -0.9), stiffness=20.0, damping=0.05, length=0.5),
        at.Spring("ball.center", ("one", 0.37), stiffness=5.0, damping=0.1, length=length, preload=0.2),
        at.Spring("plate.b", "block.center", law=law),
        at.RotationalSpring("plate.a", "rider.in", stiffness=0.4, damping=2e-3, angle=0.1),
        at.RotationalSpring(("two", 0.6), stiffness=0.1, preload=0.02, angle=lambda t: (0.2 * t, 0.2)),
        at.RotationalSpring("block.center", damping=1e-3),
        at.Spring("rider.center", "bead.center", stiffness=4.0),
    ]
    loads = [
        at.Force(("one", 0.3), (0.1, -0.2)),
        at.Force("plate.b", (0.2, 0.1), follower=True),
        at.Force(("two", 0.55), lambda t: (0.1 * t, 0.2), follower=True),
        at.Force("ball.center", lambda t: (np.sin(t), 0.0)),
        at.Torque("rider.in", 0.01),
        at.Torque(("two", 0.25), lambda t: 0.01 * t),
        at.LineLoad("one", (0.3, -0.4)),
        at.LineLoad("two", lambda t: (0.1, t)),
    ]
    given = {"joints": joints, "loads": loads, "gravity": (0.5, -9.0), "connectors": connectors}
    return at.Scene("everything", bodies, **(given | options))


def random_state(element="cable", scene=None, seed=3):
    """A system with coordinates and velocities near the reference, and a time."""
    run = at.Discretisation(mesh=2, element=element, dt=1e-3, t_end=1.0)
    system = System(Layout(scene or everything(), run))
    rng = np.random.default_rng(seed)
    q = system.layout.reference + 0.05 * rng.standard_normal(system.size)
    return system, q, rng.standard_normal(system.size), 0.37


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_forces_of_springs_are_gradients_of_their_energies(element):
    system, q, _, t = random_state(element)
    for force in system.connectors:
        if force.connector.law is not None:
            continue
        undamped = np.zeros(system.size)
        undamped[force.at] = force.evaluate(q, system.still, t)[0]
        undamped[force.at] += force._pull(force.measure(q)[0], 0.0, t).lost * force.measure(q)[1]
        found = -derivative(lambda x, force=force: force.energy(x, t), q)
        scale = max(1e-3, np.abs(found).max())
        np.testing.assert_allclose(undamped / scale, found / scale, atol=1e-12)


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_tangents_are_derivatives_of_forces(element):
    system, q, v, t = random_state(element)
    for force in system.elements:

        def value(x, y, force=force):
            return force.evaluate(x, y, t)[0]

        _, by_q, by_v = force.evaluate(q, v, t)
        for found, exact in (
            (by_q, -derivative(lambda x: value(x, v), q)),
            (by_v, -derivative(lambda y: value(q, y), v)),
        ):
            scale = max(1e-3, np.abs(exact).max())
            np.testing.assert_allclose(found / scale, exact[:, force.at] / scale, atol=2e-9)
            outside = np.delete(exact, force.at, axis=1)
            assert np.abs(outside).max(initial=0.0) < 1e-9 * scale


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_constraints_have_their_derivatives(element):
    system, q, v, t = random_state(element)
    c = system.constraints
    mu = np.random.default_rng(1).standard_normal(c.count)
    p = c.parameters(t)
    np.testing.assert_allclose(c.jacobian(q, p), derivative(lambda x: c.value(x, p), q), atol=1e-10)
    np.testing.assert_allclose(
        c.hessian(q, p, mu), derivative(lambda x: c.jacobian(x, p).T @ mu, q), atol=1e-10
    )
    np.testing.assert_allclose(c.rate(q, p), by_time(lambda s: c.value(q, c.parameters(s)), t), atol=1e-9)

    def rate(s):  # of Φ on a path with velocity v
        x, ps = q + (s - t) * v, c.parameters(s)
        return c.jacobian(x, ps) @ v + c.rate(x, ps)

    np.testing.assert_allclose(-c.right(q, v, p), by_time(rate, t), atol=1e-8)


def test_the_reference_keeps_all_constraints():
    system, *_ = random_state()
    p = system.constraints.parameters(0.0)
    assert np.abs(system.constraints.value(system.layout.reference, p)).max() < 1e-15


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_energy_balance_closes_with_the_square_of_the_step(integrator):
    dt = {"zhai": 5e-5, "generalized-alpha": 1e-3}[integrator]
    runs = [
        global_dae.solve(
            everything(),
            mesh=1,
            integrator=integrator,
            spectral_radius=1.0,
            dt=h,
            t_end=0.02,
            output_dt=0.005,
        )
        for h in (dt, dt / 2)
    ]
    assert [r.status.code for r in runs] == ["ok", "ok"]
    coarse, fine = (np.abs(r.energy.balance[1:]).max() for r in runs)
    moved = np.abs(runs[1].energy.kinetic).max()
    assert fine < 1e-3 * moved
    assert 3.5 < coarse / fine < 4.6


def test_explicit_and_implicit_steps_tend_to_one_motion():
    probes = [
        "plate.b",
        "rider.center",
        "block.center",
        "ball.center",
        "bead.center",
        "two.end",
        ("one", 0.4),
    ]
    scene, span = everything(), {"t_end": 0.03, "output_dt": 0.01}
    fine = global_dae.solve(scene, mesh=1, integrator="zhai", dt=5e-5, **span)
    far, near = (global_dae.solve(scene, mesh=1, spectral_radius=1.0, dt=h, **span) for h in (1e-3, 5e-4))
    errors = [at.compare(s, fine, probes).error for s in (far, near)]
    assert errors[1] < 2e-4
    assert 3.3 < errors[0] / errors[1] < 4.7


def test_rigid_bars_are_those_of_anc_tmm():
    bars = [at.Beam("a", (0, 0), (1, 0), ROD, RUBBER), at.Beam("b", (1, 0), (1.5, -0.5), ROD, RUBBER)]
    joints = [at.Clamp("a.start", angle=swing), at.Pin("a.end", "b.start")]
    scene = at.Scene("bars", bars, joints, [at.Torque("b.end", 0.05)], gravity=(0, -9.81))
    run = {"mesh": 1, "element": "rigid", "integrator": "zhai", "dt": 1e-3, "t_end": 0.3, "output_dt": 0.05}
    ours, dae = at.solve(scene, **run), global_dae.solve(scene, **run)
    assert at.compare(ours, dae, ["b.start", "b.end"]).error < 1e-9


def parallelogram(cranks):
    """A coupler on equal cranks: of three, one holds nothing that the others do not."""
    bars = [
        at.RigidBody(c, 1.0, 0.1, (k, 0.5), {"o": (k, 0.0), "p": (k, 1.0)})
        for k, c in enumerate("xyz"[:cranks])
    ]
    coupler = at.RigidBody("q", 3.0, 1.0, (1.0, 1.0), {c: (k, 1.0) for k, c in enumerate("xyz")})
    joints = [*(at.Pin(f"{b.name}.o") for b in bars), *(at.Pin(f"{b.name}.p", f"q.{b.name}") for b in bars)]
    start = at.Scene("parallelogram", [*bars, coupler], joints, gravity=(2.0, -9.81))
    moving = [at.RigidBody(b.name, b.mass, b.inertia, b.center, b.points, (-0.5, 0.0), 1.0) for b in bars] + [
        at.RigidBody("q", 3.0, 1.0, (1.0, 1.0), coupler.points, (-1.0, 0.0))
    ]
    return at.Scene(start.name, moving, joints, gravity=start.gravity)


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_a_third_crank_may_hold_what_two_hold_already(integrator):
    run = {"mesh": 1, "integrator": integrator, "dt": 2e-3, "t_end": 1.0, "output_dt": 0.1}
    three = global_dae.solve(parallelogram(3), **run)
    assert three.status.ok, three.status
    reference = global_dae.solve(_with_mass_of_three(), **run)
    assert at.compare(three, reference, ["q.center", "q.z", "x.p"]).error < 1e-9


def _with_mass_of_three():
    """Two cranks, the second with the mass and the inertia of two."""
    two = parallelogram(2)
    bodies = [
        at.RigidBody("y", 2.0, 0.2, b.center, b.points, b.velocity, b.spin) if b.name == "y" else b
        for b in two.bodies
    ]
    return at.Scene(two.name, bodies, two.joints, gravity=two.gravity)


def test_a_point_mass_is_a_rigid_body_without_turning():
    def scene(body):
        spring = at.Spring(f"{body.name}.center", (0.3, 0.8), stiffness=30.0, damping=0.1, length=0.5)
        return at.Scene("hung", [body], connectors=[spring], gravity=(0, -9.81))

    run = {"mesh": 1, "dt": 1e-3, "t_end": 0.5}
    one = global_dae.solve(scene(at.PointMass("m", 0.2, (0, 0))), **run)
    two = global_dae.solve(scene(at.RigidBody("m", 0.2, 1.0, (0, 0))), **run)
    assert at.compare(one, two, ["m.center"]).error < 1e-12


def test_a_line_load_is_weight():
    beam = at.Beam("b", (0, 0), (1, 0), ROD, RUBBER)
    line = RUBBER.density * ROD.area
    run = {"mesh": 3, "dt": 1e-3, "t_end": 0.05}
    hung = at.Scene("hung", [beam], [at.Clamp("b.start")], gravity=(0, -9.81))
    loaded = at.Scene("loaded", [beam], [at.Clamp("b.start")], [at.LineLoad("b", (0, -9.81 * line))])
    assert at.compare(global_dae.solve(loaded, **run), global_dae.solve(hung, **run), ["b.end"]).error < 1e-9


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_statics_holds_springs_and_rigid_bodies(element):
    scene = everything(joints=[j for j in everything().joints if not (isinstance(j, at.Weld) and j.angle)]
        + [at.Weld("one.end", "two.start")])  # fmt: skip
    found = global_dae.solve_static(scene, mesh=2, element=element, load_steps=2)
    assert found.status.ok, found.status
    assert len(found.t) == 3


def test_hung_by_a_spring_it_comes_to_rest_where_force_is_weight():
    ball = at.PointMass("m", 0.5, (0.2, 0.0))
    scene = at.Scene("hung", [ball], connectors=[at.Spring("m.center", (0, 1), stiffness=40.0, length=0.8)],
        gravity=(0, -9.81))  # fmt: skip
    found = global_dae.solve_static(scene, mesh=1)
    assert found.status.ok, found.status
    np.testing.assert_allclose(
        found.position("m.center")[-1], [0.0, 1.0 - 0.8 - 0.5 * 9.81 / 40.0], atol=1e-9
    )


def test_a_pendulum_finds_its_lowest_place():
    plate = at.RigidBody("p", 1.0, 0.1, (0.5, 0.0), {"o": (0.0, 0.0)})
    scene = at.Scene("pendulum", [plate], [at.Pin("p.o")], gravity=(0, -9.81))
    found = global_dae.solve_static(scene, mesh=1)
    assert found.status.ok, found.status
    np.testing.assert_allclose(found.position("p.center")[-1], [0.0, -0.5], atol=1e-8)


def test_joints_between_nodes_are_refused():
    beam = at.Beam("b", (0, 0), (1, 0), ROD, RUBBER)
    scene = at.Scene("propped", [beam], [at.Clamp("b.start"), at.Pin(("b", 0.5))])
    assert global_dae.solve(scene, mesh=2, dt=1e-3, t_end=1e-3).status.ok
    with pytest.raises(MeshError, match=r"\('b', 0.5\) .* between nodes of 3 elements"):
        global_dae.solve(scene, mesh=3, dt=1e-3, t_end=1e-3)


def test_stiff_springs_bound_the_explicit_step():
    def scene(stiffness, damping=0.0):
        spring = at.Spring("m.center", (0, 1), stiffness=stiffness, damping=damping)
        return at.Scene("mass", [at.PointMass("m", 2.0, (0, 0))], connectors=[spring])

    run = {"mesh": 1, "integrator": "zhai", "t_end": 0.1}
    largest = 2.0 / np.sqrt(8000.0 / 2.0)
    assert global_dae.solve(scene(8000.0), dt=0.1 / np.ceil(0.1 / largest), **run).status.ok
    with pytest.raises(StabilityError, match=r"at most 0\.0316"):
        global_dae.solve(scene(8000.0), dt=0.1 / np.floor(0.1 / largest), **run)
    with pytest.raises(StabilityError, match="at most"):
        global_dae.solve(scene(8000.0, 400.0), dt=0.02, **run)


def test_drift_is_not_left_in_mechanisms():
    with pytest.raises(UnsupportedError, match="stabilization is 'none'"):
        global_dae.solve(
            parallelogram(2), mesh=1, integrator="zhai", dt=1e-3, t_end=1e-3, stabilization="none"
        )


def swinging():
    """A driven beam, a plate welded to it, and a block on a line, held by a spring."""
    bodies = [
        at.Beam("one", (0, 0), (0.5, 0.1), ROD, RUBBER),
        at.RigidBody("plate", 0.2, 1e-3, (0.6, 0.15), {"a": (0.5, 0.1), "b": (0.8, 0.1)}),
        at.RigidBody("block", 0.3, 2e-3, (0.9, 0.0), {"c": (0.8, 0.1)}),
    ]
    joints = [at.Clamp("one.start", angle=swing), at.Pin("one.end", "plate.a"), at.Slider("block.c", (1.0, 0.0)),
        at.Pin("plate.b", "block.c")]  # fmt: skip
    spring = at.Spring("block.center", (1.5, -0.5), stiffness=10.0, damping=0.1)
    return at.Scene("swinging", bodies, joints, gravity=(0, -9.81), connectors=[spring])


def test_reactions_are_the_multipliers():
    from reference.global_dae.mechanisms.explicit import Zhai
    from reference.global_dae.mechanisms.march import Record
    from reference.global_dae.mechanisms.system import Account

    scene = swinging()
    system = System(Layout(scene, at.Discretisation(mesh=2, integrator="zhai", dt=1e-4, t_end=2e-3)))
    solver = Zhai(system)
    solver.account, record, multipliers = Account(system), Record(system, 21), []
    state = solver.begin()
    times = solver.run.times(np.arange(21))
    for n in range(21):
        state = solver.step(state, n, float(times[n])) if n else state
        record.keep(state.q, state.v, state.a, np.zeros(5))
        multipliers.append(state.mu)
    found = record.solution("global-dae", times, at.Cost(), at.Status())
    mu = np.array(multipliers)
    c = system.constraints
    rows = {k: slice(c.first[k], c.first[k + 1]) for k in range(len(c.parts))}
    # two of rigid bodies; the clamp's place and gradient; the first pin, plate less beam; the line; the second pin
    pin = found.reaction(scene.joints[1])[:, :2]
    np.testing.assert_allclose(pin, mu[:, rows[4]], atol=1e-8 * np.abs(pin).max())
    place = found.reaction(scene.joints[0])[:, :2]
    np.testing.assert_allclose(place, -mu[:, rows[2]], atol=1e-8 * np.abs(place).max())


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_reactions_of_beams_are_those_of_anc_tmm(integrator):
    bars = [at.Beam("a", (0, 0), (1, 0), ROD, RUBBER), at.Beam("b", (1, 0), (1.5, -0.5), ROD, RUBBER)]
    joints = [at.Clamp("a.start", angle=swing), at.Pin("a.end", "b.start")]
    scene = at.Scene("bars", bars, joints, [at.Torque("b.end", 0.05)], gravity=(0, -9.81))
    run = {"mesh": 2, "integrator": integrator, "dt": 1e-4, "t_end": 0.01, "output_dt": 1e-3}
    ours, dae = at.solve(scene, **run), global_dae.solve(scene, **run)
    for joint in joints:
        one, two = ours.reaction(joint), dae.reaction(joint)
        np.testing.assert_allclose(one, two, atol=1e-7 * np.abs(two).max())


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e5])
def test_the_stability_of_an_equilibrium_does_not_depend_on_the_size(scale):
    """Lengths and stiffnesses times a scale: rows of lengths and of gradients differ by it, strains stay."""
    section, material = at.Rectangle(0.02 * scale, 0.01 * scale), at.Material(E=5e7 * scale, density=1200.0)
    ends = [(0.0, 0.0), (0.3 * scale, 0.4 * scale), (0.1 * scale, 0.4 * scale), (0.4 * scale, 0.0)]
    beams = [
        at.Beam("left", ends[0], ends[1], section, material),
        at.Beam("right", ends[3], ends[2], section, material),
        at.Beam("coupler", ends[1], ends[2], section, material),
    ]
    joints = [at.Pin("left.start"), at.Pin("right.start"), at.Pin("left.end", "coupler.start"),
              at.Pin("right.end", "coupler.end")]  # fmt: skip
    spring = at.RotationalSpring("left.start", stiffness=2.0 * scale**4)
    scene = at.Scene("linkage", beams, joints, gravity=(0.5, -0.5), connectors=[spring])
    found = global_dae.solve_static(scene, mesh=1)
    assert found.status.ok, found.status
    ours = at.solve_static(scene, mesh=1)
    assert ours.status.ok, ours.status
    apart = np.abs(found.position("coupler", 0.5) - ours.position("coupler", 0.5)).max()
    assert apart < 1e-9 * scale
