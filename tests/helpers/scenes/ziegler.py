"""Ziegler's pendulum, which a following force makes flutter, and its rates in closed form."""

import numpy as np

import anctmm as at


def ziegler(load, damping):
    """Two bars of 1 m with masses of 2 and 1 kg, springs of 1 N m and dampers at the hinges, a force along the second.

    Ziegler 1952: without damping it flutters from 2.086 N on, with little from 1.464 N on.
    """
    bars = [
        at.RigidBody(name, mass, 1e-9, (x, 0.0), {"hinge": (x - 1.0, 0.0)})
        for name, mass, x in (("a", 2.0, 1.0), ("b", 1.0, 2.0))
    ]
    springs = [
        at.RotationalSpring(*ends, stiffness=1.0, damping=damping)
        for ends in (("a.hinge",), ("a.hinge", "b.hinge"))
    ]
    follower = at.Force("b.center", (-load, 0.0), follower=True)
    joints = [at.Pin("a.hinge"), at.Pin("a.center", "b.hinge")]
    return at.Scene("ziegler", bars, joints, [follower], connectors=springs)


def growth(load, damping):
    """Largest real part of the rates of its small motions, 1/s."""
    mass, turns = np.array([[3.0, 1.0], [1.0, 1.0]]), np.array([[2.0, -1.0], [-1.0, 1.0]])
    stiffness = turns + load * np.array([[-1.0, 1.0], [0.0, 0.0]])
    lower = [-np.linalg.solve(mass, stiffness), -damping * np.linalg.solve(mass, turns)]
    return np.linalg.eigvals(np.block([[np.zeros((2, 2)), np.eye(2)], lower])).real.max()
