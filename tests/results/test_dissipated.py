"""Energy that damping takes, apart from all other work: against exact motions, and the global equations."""

import numpy as np
import pytest
from samples import SQUARE
from scipy.integrate import solve_ivp

import anctmm as at

MASS, STIFFNESS, DAMPING, FORCE = 2.0, 80.0, 3.0, 5.0
WAY, RATE = 0.1, 6.0
STEPS = {
    "generalized-alpha": {"dt": 1e-3},
    "esdirk": {"dt": 1e-2, "integrator": "esdirk"},
    "zhai": {"dt": 1e-4, "integrator": "zhai"},
    "generalized-alpha, tolerance": {"tolerance": 1e-6, "integrator": "generalized-alpha"},
    "esdirk, tolerance": {"tolerance": 1e-6},
}


def wavy(t):
    """A driven length and its rate."""
    return 1.0 + WAY * np.sin(RATE * t), WAY * RATE * np.cos(RATE * t)


def still(t):
    """The length that a connector has without a drive, and its rate."""
    return 1.0, 0.0


def resisted(**connector):
    """A mass on a guide, pulled by a force, and held by a connector to the ground."""
    mass = at.PointMass("mass", MASS, (1.0, 0.0))
    spring = at.Spring("mass.center", (0.0, 0.0), **connector)
    pull = at.Force("mass.center", lambda t: (FORCE, 0.0))
    return at.Scene("resisted", [mass], [at.Slider("mass.center", (1, 0))], [pull], connectors=[spring])


def taken(length, damping, t):
    """Energy that the damper takes until each time, by the equation of motion with an account of its own."""

    def rates(time, state):
        x, v, _ = state
        free, rate = length(time)
        force = STIFFNESS * (x - free) + damping(v - rate)
        return v, (FORCE - force) / MASS, damping(v - rate) * (v - rate)

    return solve_ivp(rates, (0.0, t[-1]), (1.0, 0.0, 0.0), t_eval=t, rtol=1e-11, atol=1e-13).y[2]


CONNECTORS = {
    "damper": ({"stiffness": STIFFNESS, "damping": DAMPING}, still, lambda r: DAMPING * r),
    "driven": ({"stiffness": STIFFNESS, "damping": DAMPING, "length": wavy}, wavy, lambda r: DAMPING * r),
    "law": (
        {"law": lambda e, r, t: STIFFNESS * e + DAMPING * r * abs(r)}, still, lambda r: DAMPING * r * abs(r)
    ),
    "law that gives": ({"law": lambda e, r, t: STIFFNESS * e - 0.5 * r}, still, lambda r: -0.5 * r),
}  # fmt: skip


@pytest.mark.parametrize("how", STEPS)
@pytest.mark.parametrize("what", CONNECTORS)
def test_what_a_connector_takes_is_that_of_the_exact_motion(what, how):
    connector, length, damping = CONNECTORS[what]
    found = at.solve(resisted(**connector), t_end=2.0, output_dt=0.05, **STEPS[how])
    assert found.status.ok, found.status
    exact = taken(length, damping, found.t)
    assert np.abs(found.energy.dissipated - exact).max() < 1e-4 * np.abs(exact).max()
    assert np.abs(found.energy.work + found.energy.dissipated).max() > 0.1  # that of the force is none of it


@pytest.mark.parametrize("how", STEPS)
def test_what_a_damped_beam_takes_is_what_is_gone(how):
    """A free bar that bends and comes to rest: its energy but that of its rigid motion."""
    rubber = at.Material(E=1e6, density=1000.0, damping=5e-3)
    bar = at.Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, rubber, lambda s: (0.0, np.cos(2.0 * np.pi * s)))
    found = at.solve(at.Scene("free", [bar]), mesh=2, t_end=0.3, output_dt=0.01, **STEPS[how])
    assert found.status.ok, found.status
    energy = found.energy
    assert np.allclose(energy.dissipated, -energy.work, rtol=1e-12, atol=1e-15)
    lost = energy.kinetic[0] - (energy.kinetic + energy.strain)
    assert lost[-1] > 0.05 * energy.kinetic[0]
    assert np.abs(energy.dissipated - lost).max() < 1e-3 * lost[-1]
