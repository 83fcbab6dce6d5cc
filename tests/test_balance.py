"""Momentum and moment of momentum of scenes with every connector and load, balanced by forces that the tests write."""

from math import cos, sin

import numpy as np
import pytest

import anctmm as at

SOFT = at.Material(E=2e5, density=1000.0, poisson=0.3, damping=2e-4)
GRAVITY = np.array([2.0, -9.0])


def swung(t):
    """Free length of a driven spring, and its rate."""
    return 0.5 + 0.4 * sin(9.0 * t), 3.6 * cos(9.0 * t)


def law(elongation, rate, t):
    """Tension of a spring of a user's own, N."""
    return 9.0 * elongation + 40.0 * elongation**3 + 0.2 * rate + t


def varying(t):
    """A force that grows and turns, N."""
    return 0.4 + 6.0 * t, -0.3 + 20.0 * t * t


def flying():
    """A beam, a plate and a ball that nothing holds but springs between them, under loads of every kind."""
    plate = at.RigidBody("plate", 0.06, 3e-4, (0.6, 0.2), {"a": (0.5, 0.1), "b": (0.7, 0.3)}, (0.2, 0.1), 3.0)
    start, end = (0.0, 0.0), (0.5, 0.1)
    turning = at.RigidVelocity(start, end, end, 3.0, (0.2 + 3.0 * 0.1, 0.1 - 3.0 * 0.1))
    beam = at.Beam("beam", start, end, at.Rectangle(0.02, 0.02), SOFT, turning)
    ball = at.PointMass("ball", 0.03, (0.9, 0.4), (0.3, -0.2))
    connectors = [
        at.Spring("plate.b", "ball.center", stiffness=30.0, damping=0.2, preload=0.15),
        at.Spring(("beam", 0.3), "ball.center", stiffness=20.0, damping=0.1, length=swung),
        at.Spring("beam.start", "plate.b", law=law),
        at.Spring("beam.start", (-0.4, 0.5), stiffness=25.0, damping=0.1),
        at.RotationalSpring("beam.end", "plate.a", stiffness=0.3, damping=2e-3, preload=0.05),
    ]
    loads = [
        at.Force("plate.b", (0.4, -0.3), follower=True),
        at.Force(("beam", 0.7), varying),
        at.Force("beam.start", (0.2, 0.1), follower=True),
        at.Torque("plate.center", -0.02),
        at.Torque(("beam", 0.4), 0.012),
        at.LineLoad("beam", (0.5, -0.4)),
    ]
    return at.Scene(
        "flying", [beam, plate, ball], [at.Pin("beam.end", "plate.a")], loads, tuple(GRAVITY), connectors
    )


@pytest.fixture(scope="module", params=["esdirk", "generalized-alpha"])
def flown(request):
    dt = 1e-4 if request.param == "esdirk" else 5e-5
    options = {"integrator": request.param, "dt": dt, "newton_tolerance": 1e-12}
    found = at.solve(flying(), mesh=4, t_end=0.1, output_dt=5e-4, **options)
    assert found.status.ok
    return found


# --- by hand ---------------------------------------------------------------------------------------------------


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def along_beam(values):
    """Mean over the length, of values at 33 equal fractions: Simpson's rule."""
    weights = np.tile([2.0, 4.0], 17)[:-1][:33] / (3.0 * 32)
    weights[[0, -1]] = 1.0 / (3.0 * 32)
    return np.einsum("k,nk...->n...", weights, values)


def momentum(s):
    """Momentum and moment of momentum about the origin, (n, 2) and (n,)."""
    beam, plate, ball = s.scene.bodies
    fractions = np.linspace(0.0, 1.0, 33)
    r, v = s.position("beam", fractions), s.velocity("beam", fractions)
    p, turning = beam.mass * along_beam(v), beam.mass * along_beam(cross(r, v))
    for place, body in (("plate.center", plate), ("ball.center", ball)):
        r, v = s.position(place), s.velocity(place)
        p, turning = p + body.mass * v, turning + body.mass * cross(r, v)
    return p, turning + plate.inertia * s.spin("plate")


def forces(s):
    """Sum of all outer forces, and of their moments about the origin."""
    beam, plate, ball = s.scene.bodies
    force, moment = np.zeros((len(s.t), 2)), np.zeros(len(s.t))
    fractions = np.linspace(0.0, 1.0, 33)
    center = along_beam(s.position("beam", fractions))
    pull = beam.mass * GRAVITY + beam.length * np.array([0.5, -0.4])
    acting = [
        (center, np.broadcast_to(pull, center.shape)),
        (s.position("plate.center"), np.broadcast_to(plate.mass * GRAVITY, center.shape)),
        (s.position("ball.center"), np.broadcast_to(ball.mass * GRAVITY, center.shape)),
        (s.position("beam", 0.7), np.array([varying(t) for t in s.t])),
        (s.position("plate.b"), turned(s.angle("plate"), (0.4, -0.3))),
        (s.position("beam.start"), turned(s.angle("beam.start"), (0.2, 0.1))),
        (s.position("beam.start"), to_ground(s)),
    ]
    for place, value in acting:
        force, moment = force + value, moment + cross(place, value)
    return force, moment - 0.02 + 0.012


def turned(angle, vector):
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]], axis=1)


def line(s, first, second, still=None):
    """Length, rate, and direction from the first place to the second, or to a place of the ground."""
    there, faster = (still, 0.0) if second is None else (s.position(second), s.velocity(second))
    apart = there - s.position(first)
    length = np.hypot(*apart.T)
    direction = apart / length[:, None]
    return length, np.einsum("nc,nc->n", direction, faster - s.velocity(first)), direction


def to_ground(s):
    """Pull of the spring to the ground on the start of the beam."""
    length, rate, direction = line(s, "beam.start", None, np.array([-0.4, 0.5]))
    return (25.0 * (length - np.hypot(0.4, 0.5)) + 0.1 * rate)[:, None] * direction


def gained(t, series):
    """Integral of a rate from the first time on, by Simpson's rule, at every other output."""
    h = t[1] - t[0]
    parts = h / 3.0 * (series[:-2:2] + 4.0 * series[1:-1:2] + series[2::2])
    return np.concatenate([np.zeros((1, *series.shape[1:])), np.cumsum(parts, axis=0)])


# --- balances --------------------------------------------------------------------------------------------------


def test_momentum_changes_by_the_outer_forces_alone(flown):
    """A force of a spring on one of its places without the opposite one on the other would make momentum."""
    p, _ = momentum(flown)
    force, _ = forces(flown)
    change = p[::2] - p[0]
    assert np.abs(change - gained(flown.t, force)).max() < 2e-6 * np.abs(change).max()


def test_moment_of_momentum_changes_by_the_moments_of_outer_forces_alone(flown):
    """A follower that does not turn, or a moment on one side of a rotational spring alone, would show."""
    _, turning = momentum(flown)
    _, moment = forces(flown)
    change = turning[::2] - turning[0]
    assert np.abs(change - gained(flown.t, moment)).max() < 1e-4 * np.abs(change).max()


def test_tensions_are_those_of_elongations_and_rates(flown):
    damped, driven, own, ground, _ = flown.scene.connectors

    def tension_is(connector, expected):
        np.testing.assert_allclose(flown.tension(connector), expected, rtol=1e-9, atol=1e-11)

    length, rate, _ = line(flown, "plate.b", "ball.center")
    tension_is(damped, 30.0 * (length - length[0]) + 0.2 * rate + 0.15)
    length, rate, _ = line(flown, ("beam", 0.3), "ball.center")
    free, faster = np.array([swung(t) for t in flown.t]).T
    tension_is(driven, 20.0 * (length - free) + 0.1 * (rate - faster))
    length, rate, _ = line(flown, "beam.start", "plate.b")
    tension_is(own, [law(*state) for state in zip(length - length[0], rate, flown.t, strict=True)])
    length, rate, _ = line(flown, "beam.start", None, np.array([-0.4, 0.5]))
    tension_is(ground, 25.0 * (length - np.hypot(0.4, 0.5)) + 0.1 * rate)
