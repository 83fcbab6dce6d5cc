"""Rigid mechanisms that drives and joints move as a whole: positions are exact with any steps, velocities are not.

An estimate of positions sees nothing of that: with generalized-alpha velocities were wrong by 0.02 … 0.2 of the largest
at any tolerance, and the work of the drive by 0.07; with esdirk the work by 0.01 at 1e-5.
"""

import numpy as np

import anctmm as at

CRANK, ROD, ROCKER, GROUND = 0.1, 0.2, 0.25, 0.3
COUPLER = 0.3
RATE, T_END, INTERVAL = 30.0, 0.25, 0.05
#: Error of velocities, and of the balance of energy, over the tolerance.
VELOCITIES, BALANCE = 3.0, {"generalized-alpha": 6.5, "esdirk": 3.0}


def steady(t):
    return RATE * t, RATE + 0.0 * t, 0.0 * t


def swinging(t):
    """It begins softly: 1.5 sin³(12 t)."""
    s, c = np.sin(12.0 * t), np.cos(12.0 * t)
    return 1.5 * s**3, 54.0 * s * s * c, 648.0 * s * (2.0 * c * c - s * s)


def bar(name, start, end, mass):
    """A rigid body between two places, complex numbers."""
    middle, points = 0.5 * (start + end), {"a": (start.real, start.imag), "b": (end.real, end.imag)}
    inertia = mass * abs(end - start) ** 2 / 12.0
    return at.RigidBody(name, mass=mass, inertia=inertia, center=(middle.real, middle.imag), points=points)


def slider_crank(drive):
    """The scene, and places and velocities of rod's end at given times."""
    bodies = [
        bar("crank", 0j, CRANK + 0j, 1.0),
        bar("rod", CRANK + 0j, CRANK + ROD + 0j, 0.5),
        at.PointMass("piston", mass=0.5, position=(CRANK + ROD, 0.0)),
    ]
    joints = [
        at.Clamp("crank.a", angle=drive),
        at.Pin("crank.b", "rod.a"),
        at.Pin("rod.b", "piston.center"),
        at.Slider("piston.center", direction=(1.0, 0.0)),
    ]

    def exact(crank, speed):
        along = np.sqrt(ROD**2 - crank.imag**2)
        return crank.real + along + 0j, speed.real - crank.imag * speed.imag / along + 0j

    return at.consistent_velocities(name="slider-crank", bodies=bodies, joints=joints), "rod.b", exact


def four_bar(drive):
    """The scene, and places and velocities of the rocker's end at given times."""

    def end(crank):
        line = GROUND - crank
        along = (COUPLER**2 - ROCKER**2 + abs(line) ** 2) / (2.0 * abs(line))
        return crank + line / abs(line) * (along + 1j * np.sqrt(COUPLER**2 - along**2))

    def exact(crank, speed):
        """By |e − c| and |e − ground| that stay: (e − c)·(e' − c') = 0, e' = i ω (e − ground)."""
        e = end(crank)
        coupler, turned = e - crank, 1j * (e - GROUND)
        return e, turned * (coupler * speed.conj()).real / (coupler * turned.conj()).real

    start = end(CRANK + 0j)
    bodies = [
        bar("crank", 0j, CRANK + 0j, 1.0),
        bar("coupler", CRANK + 0j, start, 0.5),
        bar("rocker", start, GROUND + 0j, 0.6),
    ]
    joints = [
        at.Clamp("crank.a", angle=drive),
        at.Pin("crank.b", "coupler.a"),
        at.Pin("coupler.b", "rocker.a"),
        at.Pin("rocker.b"),
    ]
    return at.consistent_velocities(name="four-bar", bodies=bodies, joints=joints), "rocker.a", exact


def errors(make, drive, tolerance, integrator):
    """Steps, and errors of velocities and of the balance of energy over the tolerance."""
    scene, place, exact = make(drive)
    found = at.solve(scene, tolerance=tolerance, t_end=T_END, output_dt=INTERVAL, integrator=integrator)
    assert found.status.ok, found.status
    angle, rate = np.array([drive(t)[:2] for t in found.t]).T
    crank = CRANK * np.exp(1j * angle)
    where, speeds = exact(crank, 1j * rate * crank)
    assert np.abs(found.position(place) @ [1.0, 1j] - where).max() < 1e-6
    largest = max(np.abs(speeds).max(), CRANK * np.abs(rate).max())
    wrong = max(
        np.abs(found.velocity("crank.b") @ [1.0, 1j] - 1j * rate * crank).max(),
        np.abs(found.velocity(place) @ [1.0, 1j] - speeds).max(),
    )
    balance = np.abs(found.energy.balance).max() / np.abs(found.energy.kinetic).max()
    return found.cost.steps, wrong / largest / tolerance, balance / tolerance
