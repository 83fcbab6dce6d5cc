"""Loads and connectors of small scenes of beams by plain formulas, and their motion by another integrator.

Nothing here is shared with `anctmm.forces`: places are matrices found from shape functions, forces written down again,
and the equations of motion solved as a dense system by SciPy.
"""

import itertools
from functools import cached_property

import numpy as np
from scipy.integrate import solve_ivp

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import discretise
from anctmm.discretise.joined import Joined
from anctmm.elements.shapes import hermite, hermite_load
from anctmm.model.connectors import Spring
from anctmm.model.scene import Force, LineLoad, Torque


class ByHand:
    """A scene of beams of one kind, cut by a mesh."""

    def __init__(self, scene, mesh, element="cable"):
        self.scene, self.options = scene, {"mesh": mesh, "element": element}
        self.chain = Chain(scene, discretise(None, self.options))
        self.bodies, self.joined = self.chain.bodies, Joined(self.chain)
        self.reference = self.bodies.reference()
        self._known = {}

    def linear(self, place, what):
        """A vector of a place as a matrix of all coordinates, (2, rows * nodes)."""
        if (place, what) not in self._known:
            unit = np.eye(self.reference.size).reshape(-1, *self.reference.shape)
            self._known[place, what] = np.stack([self._vector(e, place, what) for e in unit], axis=1)
        return self._known[place, what]

    def _vector(self, q, place, what):
        body = self.scene.place(place).body
        key = float(self.scene.place(place).key)
        nodes = self.bodies.by_body(q)[body.name]
        elements = len(nodes) - 1
        i = min(int(key * elements + 1e-12), elements - 1)
        x, length = key * elements - i, body.length / elements
        both = np.concatenate([nodes[i, :2], nodes[i + 1, :2]])
        if what == "place":
            return hermite(x, length)[0] @ both
        if nodes.shape[1] == 3:
            return (1.0 - x) * nodes[i, 2] + x * nodes[i + 1, 2]
        return hermite(x, length, order=1)[0] @ both

    def along(self, name):
        """∫ r dx of a beam."""
        if name in self._known:
            return self._known[name]
        n, out = self.reference.size, []
        for k in range(n):
            nodes = self.bodies.by_body(np.eye(n)[k].reshape(self.reference.shape))[name]
            length = self.scene.beam(name).length / (len(nodes) - 1)
            pairs = [np.concatenate([a[:2], b[:2]]) for a, b in itertools.pairwise(nodes)]
            out.append(sum(hermite_load(length) @ pair for pair in pairs))
        self._known[name] = np.stack(out, axis=1)
        return self._known[name]

    @cached_property
    def ends(self):
        """Both vectors of each connector: matrix and constant."""
        found = []
        for c in self.scene.connectors:
            what = "place" if isinstance(c, Spring) else "direction"
            one = (self.linear(c.first, what), np.zeros(2))
            if isinstance(c, Spring) and c.ground is not None:
                two = (np.zeros_like(one[0]), np.array(c.ground))
            elif c.second is None:
                one, two = (np.zeros_like(one[0]), np.array([1.0, 0.0])), one
            else:
                two = (self.linear(c.second, what), np.zeros(2))
            found.append((one, two))
        return found

    def measure(self, k, q):
        """Length or angle of connector k, also at complex coordinates near the reference."""
        (A, a), (B, b) = self.ends[k]
        one, two = A @ q.ravel() + a, B @ q.ravel() + b
        if isinstance(self.scene.connectors[k], Spring):
            d = two - one
            return np.sqrt(d @ d)
        here = np.array([one @ two, one[0] * two[1] - one[1] * two[0]])
        if np.iscomplexobj(here):  # of the angle, within half a turn of the real one
            base = np.arctan2(here[1].real, here[0].real)
            turned = np.array([[np.cos(base), np.sin(base)], [-np.sin(base), np.cos(base)]]) @ here
            angle = base + np.arctan(turned[1] / turned[0])
        else:
            angle = np.arctan2(here[1], here[0])
        return angle - self._placed(k)

    def _placed(self, k):
        (A, a), (B, b) = self.ends[k]
        one, two = A @ self.reference.ravel() + a, B @ self.reference.ravel() + b
        return np.arctan2(one[0] * two[1] - one[1] * two[0], one @ two)

    def free(self, k, t):
        """Free length or angle, and its rate."""
        c = self.scene.connectors[k]
        free = c.length if isinstance(c, Spring) else c.angle
        if callable(free):
            return free(t)
        return (self.measure(k, self.reference) if free is None else free), 0.0

    def energy(self, q, t=0.0):
        """Of connectors without a law."""
        total = 0.0
        for k, c in enumerate(self.scene.connectors):
            x = self.measure(k, q) - self.free(k, t)[0]
            total += 0.5 * c.stiffness * x**2 + c.preload * x
        return total

    def gradient(self, k, q):
        """Of a measure: of the distance the unit vector, of an angle that across, over the length."""
        (A, a), (B, b) = self.ends[k]
        one, two = A @ q.ravel() + a, B @ q.ravel() + b
        if isinstance(self.scene.connectors[k], Spring):
            return (B - A).T @ (two - one) / np.hypot(*(two - one))
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
        return B.T @ (two @ turn) / (two @ two) - A.T @ (one @ turn) / (one @ one)

    def acting(self, q, v, t):
        """Generalized forces of all loads and connectors, gravity apart, (rows, nodes)."""
        f = np.zeros(q.size)
        for load in self.scene.loads:
            value = np.array(load.value(t) if callable(load.value) else load.value, dtype=float)
            match load:
                case Force():
                    if load.follower:
                        D = self.linear(load.end, "direction")
                        (x, y), (gx, gy) = D @ self.reference.ravel(), D @ q.ravel()
                        turn = np.arctan2(x * gy - y * gx, x * gx + y * gy)
                        c, s = np.cos(turn), np.sin(turn)
                        value = np.array([[c, -s], [s, c]]) @ value
                    f += self.linear(load.end, "place").T @ value
                case Torque():
                    D = self.linear(load.end, "direction")
                    gx, gy = D @ q.ravel()
                    f += D.T @ np.array([-gy, gx]) * value / (gx**2 + gy**2)
                case LineLoad():
                    f += self.along(load.body).T @ value
        for k, c in enumerate(self.scene.connectors):
            free, rate = self.free(k, t)
            gradient = self.gradient(k, q)
            x, u = self.measure(k, q) - free, gradient @ v.ravel() - rate
            force = c.law(x, u, t) if c.law else c.stiffness * x + c.damping * u + c.preload
            f -= force * gradient
        return f.reshape(q.shape)

    def elastic(self, q):
        """Elastic forces by the readable elements."""
        total = []
        for mesh in self.bodies.meshes:
            nodes = self.bodies.flat([self.bodies.by_body(q)[m.body.name] for m in self.bodies.meshes])
            first = self.bodies.first_node(mesh.body.name)
            own = nodes[: 2 * mesh.vectors, first : first + mesh.nodes].T.reshape(mesh.nodes, mesh.vectors, 2)
            f = np.zeros_like(own)
            for i in range(mesh.elements):
                part = np.concatenate([own[i], own[i + 1]])
                both = mesh.element.force(part).reshape(2, mesh.vectors, 2)
                f[i] += both[0]
                f[i + 1] += both[1]
            total.append(f)
        return self.bodies.flat(total)

    def mass(self):
        """Mass matrix of the independent unknowns."""
        from anctmm.discretise.assembly import mass_product

        J, out = self.joined, []
        for k in range(J.size):
            p = np.empty_like(self.reference)
            x = J.spread(np.eye(J.size)[k])
            mass_product(x, self.bodies.first, self.bodies.masses, self.bodies.buffer(), p)
            out.append(J.gather(p))
        return np.array(out)

    def path(self, place, t_end, rtol=1e-9):
        """Positions of a place at t_end, by an explicit Runge-Kutta method of high order."""
        J, weight = self.joined, self.bodies.weight()
        inverse = np.linalg.inv(self.mass())
        start = J.unknowns(self.reference)
        base = self.reference - J.spread(start)

        def rate(t, y):
            q, v = base + J.spread(y[: J.size]), J.spread(y[J.size :])
            force = self.acting(q, v, t) + weight - self.elastic(q)
            return np.concatenate([y[J.size :], inverse @ J.gather(force)])

        y = np.concatenate([start, J.unknowns(self.chain.initial_velocity())])
        found = solve_ivp(rate, (0.0, t_end), y, method="DOP853", rtol=rtol, atol=1e-3 * rtol)
        q = base + J.spread(found.y[: J.size, -1])
        return self._vector(q, place, "place")
