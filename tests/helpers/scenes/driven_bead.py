"""A bead that a drive moves along a chord of a disc, which turns freely: the motion by angular momentum."""

from math import hypot

import numpy as np

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
