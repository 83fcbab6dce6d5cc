"""A bead that a drive moves along a chord of a disc, which turns freely: the motion by angular momentum."""

from math import hypot

import numpy as np
from scipy.integrate import solve_ivp

import anctmm as at

MASS, INERTIA, SPIN = 0.3, 0.05, 5.0
BEAD, WAY = np.array([0.2, 0.05]), np.array([-1.0, 2.0]) / hypot(1.0, 2.0)
POSITION = at.Quintic(0.3, 0.4)


def bead(position=POSITION):
    """A bead that a drive moves along a chord of a disc, which turns freely."""
    disc = at.RigidBody("disc", mass=1.0, inertia=INERTIA, center=(0, 0), spin=SPIN)
    mass = at.PointMass("bead", MASS, BEAD, velocity=SPIN * np.array([-BEAD[1], BEAD[0]]))
    guide = at.Slider("bead.center", WAY, body="disc", position=position)
    return at.Scene("bead", [disc, mass], [at.Pin("disc.center"), guide])


def force_on_bead(t):
    """m a of the bead, (n, 2): the angular momentum of both is kept."""
    momentum = (INERTIA + MASS * BEAD @ BEAD) * SPIN

    def motion(time):
        s, v, a = map(float, POSITION(time))
        p, turning = BEAD + s * WAY, MASS * (WAY[1] * BEAD[0] - WAY[0] * BEAD[1])
        inertia, grown = INERTIA + MASS * p @ p, 2.0 * MASS * (p @ WAY) * v
        spin = (momentum - turning * v) / inertia
        return s, v, a, spin, (-turning * a - spin * grown) / inertia

    angle = solve_ivp(
        lambda time, _: [motion(time)[3]], (0, t[-1]), [0.0], rtol=1e-10, atol=1e-12, t_eval=t
    ).y[0]
    way = complex(*WAY)
    found = []
    for time, turned in zip(t, angle, strict=True):
        s, v, a, spin, more = motion(time)
        p = complex(*BEAD) + s * way
        second = a * way + 2j * spin * v * way + (1j * more - spin**2) * p
        found.append(MASS * second * np.exp(1j * turned))
    return np.stack([np.real(found), np.imag(found)], axis=1)
