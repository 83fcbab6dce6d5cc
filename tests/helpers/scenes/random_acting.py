"""Random mechanisms with all that acts on them: springs, dampers, laws, followers, line loads, at any place."""

from dataclasses import replace

import numpy as np
from random_mechanisms import random_mechanism
from random_scenes import Asked

import anctmm as at
from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError

#: Connectors and loads of a scene, at most; those that the model refuses are drawn anew.
MOST, TRIES = 4, 50


def stiffening(elongation, rate, t):
    """A law that stiffens, damps and changes in time."""
    return 4.0 * elongation + 9.0 * elongation**3 + 0.05 * rate + 0.3 * t


def drawn_in(t):
    """A free length that changes."""
    return 0.6 - 0.3 * t + t**2, -0.3 + 2.0 * t


def turned_on(t):
    """A free angle that changes."""
    return 0.5 * t + t**2, 0.5 + 2.0 * t


def gust(t):
    """A force that changes."""
    return 0.2 + t, -0.3 * np.cos(20.0 * t)


def asked_mechanism(seed, peer="global-dae"):
    """A mechanism and a short run, within what both ANC-TMM and a peer take."""
    rng = np.random.default_rng([seed, 1])
    scene = _loaded(rng, random_mechanism(seed, inside=bool(rng.random() < 0.4), welds=True))
    explicit = not peer.startswith("exudyn") and rng.random() < 0.5
    how = (
        {"integrator": "zhai", "dt": 5e-5}
        if explicit
        else {"dt": 1e-3, "newton_tolerance": 1e-12, "spectral_radius": float(rng.choice([0.6, 0.9, 1.0]))}
    )
    elements = ["cable"] if peer.startswith("exudyn") or explicit else ["cable", "shear"]
    run = Discretisation(2, str(rng.choice(elements)), t_end=0.02, output_dt=0.005, **how)
    return Asked(seed, scene, run)


def _loaded(rng, scene):
    for draw, name in ((_connector, "connectors"), (_load, "loads")):
        for _ in range(int(rng.integers(0, MOST + 1))):
            scene = _with(rng, scene, draw, name)
    return scene


def _with(rng, scene, draw, name):
    """One more of them that the model takes."""
    for _ in range(TRIES):
        try:
            return replace(scene, **{name: (*getattr(scene, name), draw(rng, scene))})
        except AnctmmError:
            continue
    return scene


def _place(rng, scene, turning=False):
    bodies = [b for b in scene.bodies if not (turning and isinstance(b, at.PointMass))]
    body = bodies[int(rng.integers(len(bodies)))]
    if isinstance(body, at.Beam):
        return body.name, float(rng.choice([0.0, 0.31, 0.5, 0.83, 1.0]))
    return f"{body.name}.{rng.choice(list(body.keys))}"


def _connector(rng, scene):
    numbers = {
        "stiffness": float(rng.uniform(0.5, 30.0)),
        "damping": float(rng.choice([0.0, 0.02, 0.2])),
        "preload": float(rng.choice([0.0, 0.3])),
    }
    how = numbers if rng.random() < 0.7 else {"law": stiffening}
    if rng.random() < 0.5:
        second = _place(rng, scene) if rng.random() < 0.6 else tuple(map(float, rng.uniform(-1.5, 1.5, 2)))
        return at.Spring(
            _place(rng, scene), second, length=(None, 0.4, drawn_in)[int(rng.integers(3))], **how
        )
    if "stiffness" in how:
        how = {key: 0.05 * value for key, value in how.items()}
    second = _place(rng, scene, True) if rng.random() < 0.6 else None
    angle = (0.0, 0.2, turned_on)[int(rng.integers(3))]
    return at.RotationalSpring(_place(rng, scene, True), second, angle=angle, **how)


def _load(rng, scene):
    value = gust if rng.random() < 0.5 else tuple(map(float, rng.uniform(-0.5, 0.5, 2)))
    beams = [beam.name for beam in scene.beams]
    if beams and rng.random() < 0.3:
        return at.LineLoad(str(rng.choice(beams)), value)
    if rng.random() < 0.3:
        return at.Torque(_place(rng, scene, True), float(rng.uniform(-0.05, 0.05)))
    follower = bool(rng.random() < 0.5)
    return at.Force(_place(rng, scene, follower), value, follower)
