"""Loads and connectors at any place: forces, energies, tangents, motions, all against plain formulas."""

import numpy as np
import pytest
from acting_by_hand import ByHand
from samples import KINDS

import anctmm as at
from anctmm.integrators.statics.static_system import StaticSystem

SQUARE, SOFT = at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0)
BODIES = (
    at.Beam("a", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT),
    at.Beam("b", (1.0, 0.0), (1.8, 0.7), SQUARE, SOFT),
)


def cubic(elongation, rate, t):
    return 30.0 * elongation + 50.0 * elongation**3 + 0.1 * rate


CONNECTORS = {
    "to ground": [at.Spring("b.end", (2.0, 2.0), stiffness=40.0, length=0.9)],
    "inside": [at.Spring(("a", 0.37), (0.3, 1.0), stiffness=40.0, length=0.2, preload=0.3)],
    "pulled": [at.Spring(("a", 0.37), ("b", 0.6), stiffness=40.0, length=0.2)],
    "pushed": [at.Spring(("a", 0.37), ("b", 0.6), stiffness=40.0, length=2.0)],
    "at a hinge": [at.RotationalSpring("a.end", "b.start", stiffness=4.0, angle=0.2, preload=-0.1)],
    "turn to ground": [at.RotationalSpring(("b", 0.4), stiffness=4.0, angle=0.2)],
    "in one element": [
        at.Spring(("a", 0.3), ("a", 0.35), stiffness=40.0, length=0.2),
        at.RotationalSpring(("a", 0.3), ("a", 0.35), stiffness=40.0, angle=0.2),
    ],
    "many": [
        at.Spring("a.end", (1.0, 1.0), stiffness=10.0),
        at.Spring("b.end", (1.0, 1.0), stiffness=10.0),
        at.Spring("a.start", ("b", 0.5), stiffness=10.0),
        at.RotationalSpring(("a", 0.5), ("b", 0.5), stiffness=1.0),
    ],
}
LAWS = [
    at.Spring(("a", 0.37), ("b", 0.6), law=cubic, length=0.2),
    at.RotationalSpring("a.end", "b.start", law=cubic),
]
LOADS = {
    "inside": [at.Force(("a", 0.3), (1.0, 2.0)), at.Torque(("b", 0.3), 0.4)],
    "line": [at.LineLoad("b", (0.5, -3.0))],
    "follower": [
        at.Force("b.end", (0.2, 0.7), follower=True),
        at.Force(("a", 0.6), (1.0, 0.0), follower=True),
    ],
}
JOINTS = [at.Clamp("a.start"), at.Pin("a.end", "b.start")]
T_END = 0.05
every_kind = pytest.mark.parametrize("kind", KINDS)


def scene(connectors=(), loads=(), joints=JOINTS, gravity=(0.0, 0.0)):
    return at.Scene("two beams", BODIES, joints, loads, gravity, connectors=connectors)


def somewhere(hand, seed, amount=0.05):
    x = np.random.default_rng(seed).standard_normal(hand.joined.size)
    return hand.reference + amount * hand.joined.spread(x)


@every_kind
@pytest.mark.parametrize("name", CONNECTORS)
def test_forces_of_connectors_are_gradients_of_their_energy(name, kind):
    """A complex step of an energy written down again: 1e-12."""
    hand = ByHand(scene(CONNECTORS[name]), 3, kind)
    system = StaticSystem(hand.chain)
    for seed in range(3):
        q = somewhere(hand, seed)
        system.accept(q, 1.0)
        found = system.residual(q, 1.0) + system.elastic_forces(q)
        gradient = np.array([hand.energy(q.ravel() + 1e-30j * e).imag / 1e-30 for e in np.eye(q.size)])
        assert np.abs(found.ravel() + gradient).max() < 1e-12 * np.abs(gradient).max()
        assert float(system.strain_energy(q, 1.0) - system._elastic_energy(q)) == pytest.approx(
            hand.energy(q), rel=1e-12
        )


@every_kind
@pytest.mark.parametrize("name", LOADS)
def test_loads_act_by_shape_functions(name, kind):
    hand = ByHand(scene(loads=LOADS[name]), 3, kind)
    system = StaticSystem(hand.chain)
    q = somewhere(hand, 5)
    expected = hand.acting(q, np.zeros_like(q), 0.0)
    assert np.abs(system.applied(q, 1.0) - expected).max() < 1e-12 * np.abs(expected).max()


def derivative(system, joined, q):
    """Minus the derivative of the residual, by central differences of two steps, (n, n)."""

    def central(h):
        columns = [
            joined.gather(system.residual(q - h * joined.spread(e), 1.0))
            - joined.gather(system.residual(q + h * joined.spread(e), 1.0))
            for e in np.eye(joined.size)
        ]
        return np.stack(columns, axis=1) / (2.0 * h)

    return (4.0 * central(1e-4) - central(2e-4)) / 3.0


@every_kind
@pytest.mark.parametrize(
    "scene_",
    [
        *(scene(c) for c in CONNECTORS.values()),
        scene(LAWS),
        *(scene(loads=found) for found in LOADS.values()),
        scene([*CONNECTORS["many"], *LAWS], [*LOADS["follower"], *LOADS["inside"]]),
    ],
    ids=[*CONNECTORS, "laws", *(f"load {name}" for name in LOADS), "all"],
)
def test_solutions_are_those_with_the_derivative_of_all_forces(scene_, kind):
    """Locally added blocks and border together; of symmetric ones also the number of negative eigenvalues."""
    hand = ByHand(scene_, 3, kind)
    system, joined = StaticSystem(hand.chain), hand.joined
    for seed, amount in ((0, 1e-4), (1, 0.05)):
        q = somewhere(hand, seed, amount)
        system.accept(q, 1.0)
        K = derivative(system, joined, q)
        negative = system.factorize(q, 1.0)
        force = np.random.default_rng(9).standard_normal(joined.size)
        x = joined.unknowns(system.solve(joined.load(force)))
        assert np.abs(K @ x - force).max() < 1e-9 * np.abs(K).max() * np.abs(x).max()
        if system.conservative:
            assert np.abs(K - K.T).max() < 1e-9 * np.abs(K).max()
            assert negative == (np.linalg.eigvalsh(0.5 * (K + K.T)) < 0.0).sum()


def wavy(t):
    return 0.9 + 0.1 * np.sin(2.0 * t), 0.2 * np.cos(2.0 * t)


def busy(kind):
    """Every kind of load and connector at once."""
    del kind
    connectors = [
        at.Spring("b.end", (2.0, 2.0), stiffness=40.0, length=wavy, damping=0.05, preload=0.2),
        at.Spring(("a", 0.37), ("b", 0.6), stiffness=40.0, damping=0.1),
        at.RotationalSpring("a.end", "b.start", stiffness=0.4, damping=0.01, angle=0.2),
        at.RotationalSpring(("b", 0.4), stiffness=0.4, preload=0.1),
        at.RotationalSpring(("a", 0.4), ("b", 0.1), stiffness=0.1, angle=lambda t: (0.1 * t, 0.1)),
        at.Spring(("a", 0.3), ("b", 0.35), law=cubic),
    ]
    loads = [
        at.Force(("a", 0.3), lambda t: (1.0 * t, 2.0)),
        at.Torque(("b", 0.3), 0.04),
        at.LineLoad("b", lambda t: (0.0, -0.3 * t)),
        at.LineLoad("a", (0.1, 0.2)),
        at.Force("b.end", (0.2, 0.7), follower=True),
    ]
    return scene(connectors, loads, gravity=(0.0, -1.0))


@pytest.fixture(scope="module")
def exact_tip():
    """End of the second beam at the end, one element each."""
    found = {}
    for kind in KINDS:
        mesh = 1
        found[kind] = ByHand(busy(kind), mesh, kind).path("b.end", T_END)
    return found


@pytest.mark.exhaustive
@pytest.mark.compiled
@every_kind
@pytest.mark.parametrize(
    ("options", "level"),
    [
        ({"integrator": "zhai", "dt": (5e-5, 2.5e-5)}, 2e-6),
        ({"spectral_radius": 1.0, "dt": (2e-4, 1e-4)}, 2e-4),
    ],
    ids=["explicit", "implicit"],
)
def test_motions_converge_to_those_of_the_equations(kind, options, level, exact_tip):
    """At second order, and so does the balance of energy."""
    options = dict(options)
    errors, balances = [], []
    for dt in options.pop("dt"):
        found = at.solve(busy(kind), mesh=1, element=kind, t_end=T_END, dt=dt, output_dt=0.005, **options)
        assert found.status.ok, found.status
        errors.append(np.abs(found.position("b", 1.0)[-1] - exact_tip[kind]).max())
        balances.append(np.abs(found.energy.balance).max() / np.abs(found.energy.strain).max())
    assert errors[1] < level
    assert np.log2(errors[0] / errors[1]) > 1.7
    assert np.log2(balances[0] / balances[1]) > 1.7


@pytest.mark.exhaustive
@pytest.mark.compiled
def test_steps_by_tolerance_see_connectors(exact_tip):
    """The target error, relative to the largest displacement, with dampers, laws and driven lengths."""
    for tolerance in (1e-3, 1e-4):
        found = at.solve(
            busy("cable"), mesh=1, t_end=T_END, integrator="generalized-alpha", tolerance=tolerance
        )
        assert found.status.ok, found.status
        largest = np.abs(found.displacement("b.end")).max()
        assert np.abs(found.position("b", 1.0)[-1] - exact_tip["cable"]).max() < tolerance * largest


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
@pytest.mark.parametrize("by_law", [False, True])
def test_a_damper_that_passes_through_its_length_0_takes_energy_there_too(integrator, by_law):
    """Its force changes its sign there as its length does: of that step the work was 0, 0.03 of all energy."""
    ball = at.PointMass("ball", mass=1.0, position=(0.5, 0.0), velocity=(-2.0, 0.0))
    given = {"law": lambda x, rate, t: 50.0 * x + rate} if by_law else {"stiffness": 50.0, "damping": 1.0}
    spring = at.Spring("ball.center", (0.0, 0.0), length=0.0, **given)
    s = at.solve(at.Scene("through", [ball], connectors=[spring]), dt=2e-3, t_end=0.6, integrator=integrator)
    assert s.status.ok
    assert (s.position("ball.center")[:, 0] < 0.0).any()
    assert np.abs(s.energy.balance).max() < 1e-3 * s.energy.kinetic.max()
