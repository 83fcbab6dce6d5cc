"""A solver of one module: a double pendulum of rigid bodies on the null space of its pins, by SciPy's Radau IIA."""

from time import process_time

import numpy as np
from scipy.integrate import solve_ivp

import anctmm as at
from anctmm.solvers.capabilities import Offer

OFFER = Offer(
    lacks={"zhai", "statics", "stability", "energy", "springs", "laws", "sliders", "point-masses"},
    choices=({"newton_tolerance": 1e-10},),  # Radau has bounds of its own
)


def turned(angle, vector):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


class Field:
    """Motion of a body by that of its centre and its angle."""

    def __init__(self, body, center, angle):
        self.body, self.center, self.turn = body, center, angle

    def position(self, place):
        """Positions of a point, (n, 2), m."""
        arm = np.subtract(self.body.position_at(place), self.body.center)
        return self.center + turned(self.turn, arm).T


def solve(scene, run):
    """Angles θ of both bodies: with the null space N of the pins, NᵀM N θ̈ = Nᵀ (f − M Ṅ θ̇)."""
    first, second = scene.bodies
    ground, elbow = (scene.place(joint.ends[0]).position for joint in scene.joints)
    g1, d1, g2 = (np.subtract(b, a) for a, b in (
        (ground, first.center), (ground, elbow), (elbow, second.center),
    ))  # fmt: skip
    mass = np.diag([first.mass] * 2 + [first.inertia] + [second.mass] * 2 + [second.inertia])
    force = mass @ [*scene.gravity, 0.0, *scene.gravity, 0.0]

    def rates(t, y):
        (a, b), rate = y[:2], y[2:]
        null, curved = np.zeros((6, 2)), np.zeros(6)
        null[2, 0] = null[5, 1] = 1.0
        for row, k, arm in ((0, 0, turned(a, g1)), (3, 0, turned(a, d1)), (3, 1, turned(b, g2))):
            null[row : row + 2, k] += -arm[1], arm[0]
            curved[row : row + 2] -= arm * rate[k] ** 2
        return [*rate, *np.linalg.solve(null.T @ mass @ null, null.T @ (force - mass @ curved))]

    t, began = run.times(run.output_steps), process_time()
    found = solve_ivp(rates, (0.0, run.t_end), np.zeros(4), "Radau", t, rtol=1e-6, atol=1e-8)
    a, b = found.y[:2]
    place = np.array(ground) + turned(a, d1).T
    fields = {
        first.name: Field(first, np.array(ground) + turned(a, g1).T, a),
        second.name: Field(second, place + turned(b, g2).T, b),
    }
    cost = at.Cost(process_time() - began, process_time() - began, len(found.t), found.nlu)
    return at.Solution("null-space", scene, run, t, fields, at.Energy.unknown(len(t)), cost, dofs=2)
