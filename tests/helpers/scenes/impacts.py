"""Scenes with impacts, and their exact motions: by pieces, between the places where a law bends or jumps."""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from scipy.integrate import solve_ivp

import anctmm as at

GRAVITY = 9.81
#: Distance from a mass to where its spring is fixed, at which a law's elongation is 0, m.
FAR = 10.0


@dataclass(frozen=True)
class Impact:
    """A scene, a place that moves, how long, and its exact displacement: t → (n, 2)."""

    scene: at.Scene
    place: str
    t_end: float
    exact: Callable[[np.ndarray], np.ndarray]


def by_pieces(forces, edges, start, t):
    """States at times t of y' = (v, forces(state, side)), found piece by piece.

    edges: functions of the state that are 0 where the law bends or jumps; side: their signs in this piece, (k,), so
    that what acts is smooth there.
    """
    y, now, states = np.array(start, dtype=float), 0.0, np.zeros((len(t), len(start)))
    half = len(start) // 2
    ends = [lambda _, y, edge=edge: edge(y) for edge in edges]
    for end in ends:
        end.terminal = True
    while True:
        ahead = y + 1e-9 * np.concatenate([y[half:], np.zeros(half)])
        values = np.array([edge(ahead) for edge in edges])
        side = np.sign(values)

        def motion(_, y, side=side):
            return np.concatenate([y[half:], forces(y, side)])

        # an edge that the state stands on is left first, by a step of its own
        rest = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
        leave = now + 1e-9
        begun = solve_ivp(motion, (now, leave), y, **rest)
        found = solve_ivp(motion, (leave, t[-1]), begun.y[:, -1], events=ends, dense_output=True, **rest)
        inside = (t >= now) & (t <= found.t[-1])
        if inside.any():
            states[inside] = found.sol(np.maximum(t[inside], leave)).T
        if found.status == 0:
            return states
        now, y = found.t[-1], found.y[:, -1]


def mass(name, place, velocity=(0.0, 0.0), size=1.0):
    return at.RigidBody(name, size, 1.0, place, velocity=velocity)


def floor_law(stiffness, damping=0.0, force=0.0):
    """A floor that pushes what comes below it."""

    def law(elongation, rate, t):
        return stiffness * elongation + damping * rate - force if elongation < 0.0 else 0.0

    return law


def bounce(frequency, impacts, damping=0.0, force=0.0, height=1.0):
    """A mass of 1 kg that falls on a floor, which answers with so many rad/s."""
    k = frequency**2
    law = floor_law(k, damping, force)
    fall, contact = sqrt(2.0 * height / GRAVITY), pi / frequency
    t_end = fall + (impacts - 1) * (2.0 * fall + contact) + contact + 0.7 * fall
    spring = at.Spring("ball.center", (0.0, -FAR), length=FAR, law=law)
    scene = at.Scene("bounce", [mass("ball", (0.0, height))], gravity=(0.0, -GRAVITY), connectors=[spring])

    def forces(y, side):
        pushed = k * y[0] + damping * y[1] - force if side[0] < 0.0 else 0.0
        return np.array([-GRAVITY - pushed])

    def exact(t):
        y = by_pieces(forces, [lambda y: y[0]], [height, 0.0], t)[:, 0]
        return np.stack([0.0 * t, y - height], axis=1)

    return Impact(scene, "ball.center", t_end, exact)


def between(frequency, crossings, gap=0.5, speed=2.0):
    """A mass that goes to and fro between two stops."""
    k = frequency**2

    def law(elongation, rate, t):
        if elongation > gap:
            return k * (elongation - gap)
        if elongation < -gap:
            return k * (elongation + gap)
        return 0.0

    spring = at.Spring("ball.center", (-FAR, 0.0), length=FAR, law=law)
    scene = at.Scene("between", [mass("ball", (0.0, 0.0), (speed, 0.0))], connectors=[spring])

    def forces(y, side):
        if side[0] > 0.0:
            return np.array([-k * (y[0] - gap)])
        return np.array([-k * (y[0] + gap) if side[1] < 0.0 else 0.0])

    def exact(t):
        x = by_pieces(forces, [lambda y: y[0] - gap, lambda y: y[0] + gap], [0.0, speed], t)[:, 0]
        return np.stack([x, 0.0 * t], axis=1)

    t_end = crossings * (2.0 * gap / speed + pi / frequency)
    return Impact(scene, "ball.center", t_end, exact)


def pendulum(frequency, swings, stop=-0.6):
    """A bar of 1 m that falls from the level to a rotational stop."""
    inertia, k = 1.0 / 3.0, frequency**2 / 3.0

    def law(angle, rate, t):
        return k * (angle - stop) if angle < stop else 0.0

    body = at.RigidBody("bar", 1.0, 1.0 / 12.0, (0.5, 0.0), {"start": (0.0, 0.0), "end": (1.0, 0.0)})
    spring = at.RotationalSpring("bar.start", law=law)
    scene = at.Scene("pendulum", [body], [at.Pin("bar.start")], gravity=(0.0, -GRAVITY), connectors=[spring])

    def forces(y, side):
        moment = -0.5 * GRAVITY * np.cos(y[0]) - (k * (y[0] - stop) if side[0] < 0.0 else 0.0)
        return np.array([moment / inertia])

    def exact(t):
        angle = by_pieces(forces, [lambda y: y[0] - stop], [0.0, 0.0], t)[:, 0]
        return np.stack([np.cos(angle) - 1.0, np.sin(angle)], axis=1)

    return Impact(scene, "bar.end", 0.9 * swings, exact)


def pair(frequency, t_end, own=20.0):
    """Two masses on a spring, of which the first hits a stop: a body that vibrates after each impact."""
    k, soft = frequency**2, own**2
    law = floor_law(k)
    stop = at.Spring("first.center", (0.0, -FAR), length=FAR, law=law)
    inner = at.Spring("second.center", "first.center", stiffness=soft)
    bodies = [mass("first", (0.0, 0.3)), mass("second", (0.0, 0.8))]
    guides = [at.Slider(f"{body.name}.center", (0.0, 1.0)) for body in bodies]
    scene = at.Scene("pair", bodies, guides, gravity=(0.0, -GRAVITY), connectors=[stop, inner])

    def forces(y, side):
        pull = soft * (y[1] - y[0] - 0.5)
        pushed = k * y[0] if side[0] < 0.0 else 0.0
        return np.array([pull - pushed - GRAVITY, -pull - GRAVITY])

    def exact(t):
        y = by_pieces(forces, [lambda y: y[0]], [0.3, 0.8, 0.0, 0.0], t)[:, 0]
        return np.stack([0.0 * t, y - 0.3], axis=1)

    return Impact(scene, "first.center", t_end, exact)


def collision(frequency, t_end):
    """Two masses that collide, one with a wall behind it: contact between bodies."""
    k = frequency**2

    def contact(elongation, rate, t):
        return k * elongation if elongation < 0.0 else 0.0

    bodies = [mass("left", (-1.0, 0.0), (1.0, 0.0)), mass("right", (0.5, 0.0), size=2.0)]
    springs = [
        at.Spring("left.center", "right.center", length=0.5, law=contact),
        at.Spring("right.center", (FAR + 1.0, 0.0), length=FAR, law=contact),
    ]
    scene = at.Scene("collision", bodies, connectors=springs)

    def forces(y, side):
        push = -k * (y[1] - y[0] - 0.5) if side[0] < 0.0 else 0.0
        wall = k * (y[1] - 1.0) if side[1] > 0.0 else 0.0
        return np.array([-push, 0.5 * (push - wall)])

    def exact(t):
        edges = [lambda y: y[1] - y[0] - 0.5, lambda y: y[1] - 1.0]
        x = by_pieces(forces, edges, [-1.0, 0.5, 1.0, 0.0], t)[:, 0]
        return np.stack([x + 1.0, 0.0 * t], axis=1)

    return Impact(scene, "left.center", t_end, exact)


def rms(found, impact):
    """The rms error of a run, of the largest displacement."""
    exact = impact.exact(found.t)
    missed = found.displacement(impact.place) - exact
    return float(np.sqrt((missed**2).sum(axis=1).mean()) / np.linalg.norm(exact, axis=1).max())


SCENES = {
    **{
        f"bounce {w} x{n}": (lambda w=w, n=n: bounce(float(w), n))
        for w in (20, 100, 1000)
        for n in (1, 3, 10)
    },
    "damped x5": lambda: bounce(200.0, 3, damping=10.0),
    "preloaded x3": lambda: bounce(200.0, 3, force=100.0),
    "preloaded soft x3": lambda: bounce(30.0, 3, force=10.0),
    "between 50 x6": lambda: between(50.0, 6),
    "between 500 x10": lambda: between(500.0, 10),
    "pendulum 50 x1": lambda: pendulum(50.0, 1),
    "pendulum 50 x5": lambda: pendulum(50.0, 5),
    "pendulum 500 x5": lambda: pendulum(500.0, 5),
    "pair 100": lambda: pair(100.0, 1.5),
    "pair 500": lambda: pair(500.0, 0.7),
    "collision 50": lambda: collision(50.0, 3.0),
    "collision 500": lambda: collision(500.0, 3.0),
}
