"""Stability limits of explicit steps with connectors, what connectors hold in statics, forces that follow."""

import numpy as np
import pytest
from acting_by_hand import ByHand

import anctmm as at
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import discretise
from anctmm.errors import DiscretisationError, StabilityError
from anctmm.integrators.connected import Connected
from anctmm.integrators.stability import element_bound, highest_frequency, highest_rate, step_limit

SQUARE, SOFT = at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0)


CLAMPED = (at.Clamp("a.start"),)


def held(*connectors, loads=(), joints=CLAMPED, gravity=(0.0, 0.0)):
    return at.Scene(
        "held",
        [at.Beam("a", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT)],
        joints,
        loads,
        gravity,
        connectors=connectors,
    )


def chain_of(scene, mesh=3):
    return Chain(scene, discretise(None, {"mesh": mesh}))


CASES = {
    "stiff": {"stiffness": 1e5},
    "damped": {"stiffness": 1e5, "damping": 10.0},
    "only damped": {"damping": 1000.0},
}


@pytest.mark.parametrize("name", CASES)
def test_limits_are_those_of_the_dense_matrices(name):
    """Stiffness and damping of a spring across the tip of a beam, by eigenvalues of dense matrices."""
    spring = at.Spring("a.end", (1.0, 1.0), **CASES[name])
    chain, hand = chain_of(held(spring)), ByHand(held(spring), 3)
    J, q, M = hand.joined, hand.reference, hand.mass()
    g = J.gather(hand.gradient(0, q).reshape(q.shape))
    h = 1e-6
    K = np.array(
        [
            J.gather(hand.elastic(q + h * J.spread(e)) - hand.elastic(q - h * J.spread(e)))
            for e in np.eye(J.size)
        ]
    )
    K = K / (2.0 * h) + spring.stiffness * np.outer(g, g)
    frequency = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real.max())
    rate = spring.damping * g @ np.linalg.solve(M, g)
    assert highest_frequency(chain) == pytest.approx(frequency, rel=1e-6)
    assert highest_rate(chain) == pytest.approx(rate, rel=1e-6, abs=1e-9)
    stiff, lossy = Connected(chain).bounds()
    assert element_bound(chain) ** 2 + stiff >= frequency**2
    assert lossy >= rate * (1.0 - 1e-9)
    limit = step_limit(0.5, 0.5, frequency, rate)
    assert limit < 0.999 * step_limit(0.5, 0.5, highest_frequency(chain_of(held())))
    with pytest.raises(StabilityError, match="at most"):
        at.solve(held(spring), mesh=3, integrator="zhai", dt=1.0 / np.floor(0.98 / limit), t_end=1.0)
    wave = held(spring, loads=[at.Force("a.end", (0.0, 0.01))])
    good = at.solve(wave, mesh=3, integrator="zhai", dt=1.0 / np.ceil(1.02 / limit), t_end=1.0, output_dt=1.0)
    assert good.status.ok, good.status


def test_a_spring_holds_a_mechanism_in_statics():
    """A bar on a hinge, held by a rotational spring: moment and weight in balance, from Newton's iteration alone."""
    k, weight = 2.0, 1000.0 * 4e-4 * 9.81
    scene = held(
        at.RotationalSpring("a.start", stiffness=k),
        joints=[at.Pin("a.start", grounded=True)],
        gravity=(0.0, -9.81),
    )
    rest = at.solve_static(scene, mesh=8)
    assert rest.status == "ok", rest.status
    assert rest.status.message == ""
    hand = ByHand(scene, 8)
    q = hand.bodies.flat([rest.fields["a"].coordinates[-1]])
    phi = hand.measure(0, q)
    x = np.trapezoid([rest.position("a", f)[-1, 0] for f in np.linspace(0.0, 1.0, 201)], dx=1.0 / 200)
    assert -k * phi == pytest.approx(weight * x, rel=1e-4)


def test_springs_between_hinged_bars_hold_a_chain():
    """Every hinge of a chain has a rotational spring: without them it is a mechanism; stable and found at once."""
    n = 5
    bodies = [at.Beam(f"b{i}", (0.2 * i, 0.0), (0.2 * (i + 1), 0.0), SQUARE, SOFT) for i in range(n)]
    joints = [at.Clamp("b0.start"), *(at.Pin(f"b{i}.end", f"b{i + 1}.start") for i in range(n - 1))]
    springs = [at.RotationalSpring(f"b{i}.end", f"b{i + 1}.start", stiffness=50.0) for i in range(n - 1)]
    rest = at.solve_static(
        at.Scene("chain", bodies, joints, gravity=(0.0, -9.81), connectors=springs), mesh=2
    )
    assert rest.status.ok, rest.status
    assert rest.status.message == ""
    assert rest.stable[-1]
    free = at.solve_static(at.Scene("chain", bodies, joints, gravity=(0.0, -9.81)), mesh=2)
    assert "stabilised path" in free.status.message


def test_a_hundred_springs_at_hinges():
    """All couple distant nodes, a border of a hundred rows: the run keeps its energy, and statics its count."""
    n = 100
    bodies = [at.Beam(f"b{i}", (0.1 * i, 0.0), (0.1 * (i + 1), 0.0), SQUARE, SOFT) for i in range(n)]
    joints = [at.Clamp("b0.start"), *(at.Pin(f"b{i}.end", f"b{i + 1}.start") for i in range(n - 1))]
    springs = [at.RotationalSpring(f"b{i}.end", f"b{i + 1}.start", stiffness=50.0) for i in range(n - 1)]
    scene = at.Scene("chain", bodies, joints, gravity=(0.0, -0.01), connectors=springs)
    rest = at.solve_static(scene, mesh=1)
    assert rest.status.ok, rest.status
    assert rest.stable[-1]
    found = at.solve(scene, mesh=1, dt=1e-2, t_end=0.2, spectral_radius=1.0)
    assert found.status.ok, found.status
    assert np.abs(found.energy.balance).max() < 1e-6 * np.abs(found.energy.potential).max()
    assert found.cost.newton_iterations <= 4 * found.cost.steps


def test_a_preloaded_spring_that_pushes_a_column_makes_it_unstable():
    """A spring along a cantilever's axis to a far point pushes as a dead load: unstable from Euler's load on."""
    euler = SOFT.E * SQUARE.second_moment * np.pi**2 / 4.0
    for part, code in ((0.9, "ok"), (1.1, "unstable")):
        spring = at.Spring("a.end", (1000.0, 0.0), preload=-part * euler)
        assert at.solve_static(held(spring), mesh=8).status == code


def test_laws_in_statics_are_springs():
    """The same equilibrium as with the spring that the law says."""
    one = at.Spring("a.end", (1.0, 1.0), stiffness=3.0, length=0.5)
    two = at.Spring("a.end", (1.0, 1.0), law=lambda x, v, t: 3.0 * x, length=0.5)
    ends = [at.solve_static(held(c), mesh=3).position("a", 1.0)[-1] for c in (one, two)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
    assert np.abs(ends[0] - [1.0, 0.0]).max() > 1e-3


EI = SOFT.E * SQUARE.second_moment


def beck(load):
    """A cantilever under a force that follows its end, along its axis (Beck 1952)."""
    return held(loads=[at.Force("a.end", (-load * EI, 0.0), follower=True)])


def test_a_follower_along_a_column_makes_it_flutter_at_becks_load():
    """20.05 EI/L², by the dynamic criterion; no static one says so."""
    for load, code in ((19.8, "ok"), (20.3, "unstable")):
        found = at.solve_static(beck(load), mesh=8, load_steps=4)
        assert found.status == code, found.status
    assert "flutter" in found.status.message


def test_newton_converges_quadratically_with_followers():
    """A force that stays across the end of a beam bends it by more than a right angle."""
    scene = held(loads=[at.Force("a.end", (0.0, 4.0 * EI), follower=True)])
    rest = at.solve_static(scene, mesh=4, newton_tolerance=1e-12, load_steps=8)
    assert rest.status.ok, rest.status
    assert rest.cost.newton_iterations <= 8 * 7
    hand = ByHand(scene, 4)
    q = hand.bodies.flat([rest.fields["a"].coordinates[-1]])
    left = hand.joined.gather(hand.acting(q, np.zeros_like(q), 0.0) - hand.elastic(q))
    assert np.abs(left).max() < 1e-8 * 4.0 * EI
    assert rest.position("a", 1.0)[-1, 0] < 0.4


def test_followers_have_no_stable_branch():
    with pytest.raises(
        DiscretisationError, match=r"turns with its place in scene 'held'.*no potential energy"
    ):
        at.solve_static(beck(1.0), mesh=1, branch="stable")
