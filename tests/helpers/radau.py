"""A new solver in one module: joints by their null space; rigid bars by SciPy's Radau, cables by the midpoint rule."""

from time import perf_counter, process_time

import numpy as np
import scipy.integrate
from scipy.linalg import lu_factor, lu_solve, null_space

import anctmm as at
from anctmm.elements.cable import CableElement
from anctmm.errors import UnsupportedError
from anctmm.results.fields import HermiteField
from anctmm.solvers.capabilities import FEATURES, Offer

#: What it has; all else it lacks, and says so.
HAS = {"generalized-alpha", "joints", "rigid"}
ITERATIONS = 30
OFFER = Offer(lacks=FEATURES.keys() - HAS - {"esdirk"}, element="cable")


def solve(scene: at.Scene, run: at.Discretisation) -> at.Solution:
    """Motion of cables, or of rigid bars, with clamps, pins and gravity."""
    if run.integrator == "zhai":
        raise UnsupportedError("Radau has no explicit steps")
    begun, wall = process_time(), perf_counter()
    system, t = System(scene, run), run.times(run.output_steps)
    begin = np.concatenate([np.zeros(2 * system.Z.shape[1]), system.start_velocities().ravel()])
    states, steps = (radau if system.units else midpoint)(system, begin, t, run)
    status = at.Status()
    if len(states) < len(t):
        status = at.Status("diverged", "an iteration does not converge", float(t[len(states)]), steps)
    q = np.array([system.coordinates(y) for y in states])
    fields = {
        name: HermiteField(q[:, part].reshape(len(q), -1, 2, 2), length)
        for name, part, length in system.parts
    }
    cost, energy = at.Cost(process_time() - begun, perf_counter() - wall, steps), at.Energy.unknown(len(q))
    return at.Solution("radau", scene, run, t[: len(q)], fields, energy, cost, status, 2 * system.Z.shape[1])


def radau(system, begin, t, run):
    """States at the times t by SciPy's Radau, and its steps: rigid bars have no stiff vibrations."""
    found = scipy.integrate.solve_ivp(system.rates, (0.0, t[-1]), begin, "Radau", t, rtol=1e-8, atol=1e-10)
    return list(found.y.T), found.nfev


def midpoint(system, begin, t, run):
    """States at the times t by the implicit midpoint rule with the steps of the run, and their number."""
    states, y, taken = [begin], begin, 0
    for k in range(1, len(t)):
        count = max(1, round((t[k] - t[k - 1]) / run.dt))
        for _ in range(count):
            h, change = (t[k] - t[k - 1]) / count, (t[k] - t[k - 1]) / count * system.rates(0.0, y)
            matrix = lu_factor(np.eye(len(y)) - 0.5 * h * system.jacobian(0.0, y + 0.5 * change))
            for _ in range(ITERATIONS):
                correction = lu_solve(matrix, h * system.rates(0.0, y + 0.5 * change) - change)
                change, size = change + correction, np.abs(correction).max()
                if not size > 1e-11 * (1.0 + np.abs(y).max()):
                    break
            else:
                return states, taken
            if not np.isfinite(size):
                return states, taken
            y, taken = y + change, taken + 1
        states.append(y)
    return states, taken


class System:
    """M q̈ = f(q), A q = const, |u| = 1 of rigid bars; q = q₀ + Z z with Z the null space of A. Vectors: (n, 2)."""

    def __init__(self, scene, run):
        _check(scene)
        kinds = run.of(scene)  # refuses a mesh of other bodies
        self.parts, self.elements, self.units, rows, first = [], [], [], [], 0
        self.first = {}
        for beam in scene.beams:
            count, kind = kinds[beam.name]
            if kind not in ("cable", "rigid"):
                raise UnsupportedError(f"element {kind!r} of {beam.name!r}; cable and rigid are offered")
            element = CableElement.of(beam, count)
            self.first[beam.name] = first, first + 2 * count
            self.parts.append((beam.name, slice(first, first + 2 * (count + 1)), beam.length))
            if (
                kind == "rigid"
            ):  # ends and tangents: the tangents are equal, and the line between the ends is one
                rows += [
                    {first + 3: 1.0, first + 1: -1.0},
                    {first + 2: 1.0, first: -1.0, first + 1: -beam.length},
                ]
                self.units.append(first + 1)
            self.elements += [(first + 2 * k, element, kind == "cable") for k in range(count)]
            first += 2 * (count + 1)
        for joint in scene.joints:
            ends = [self._vector(scene, end) for end in joint.ends]
            rows += [{end: 1.0, ends[0]: -1.0} for end in ends[1:]]
            rows += [{ends[0]: 1.0}] if joint.grounded else []
            rows += [{ends[0] + 1: 1.0}] if isinstance(joint, at.Clamp) else []
        A = np.zeros((len(rows), first))
        for k, row in enumerate(rows):
            A[k, list(row)] = list(row.values())
        self.Z = null_space(A) if rows else np.eye(first)
        self.scene, self.start = scene, np.concatenate([_line(b, kinds[b.name][0]) for b in scene.beams])
        mass, self.weight = np.zeros((first, first)), np.zeros((first, 2))
        for at_, element, _ in self.elements:
            mass[at_ : at_ + 4, at_ : at_ + 4] += element.mass
            self.weight[at_ : at_ + 4] += np.outer(element.gravity, scene.gravity)
        self.M = self.Z.T @ mass @ self.Z
        self.inverse = np.linalg.inv(self.M)

    def _vector(self, scene, end):
        place = scene.place(end)
        return self.first[place.body.name][round(float(place.key))]

    def start_velocities(self):
        """Those of the beams, by their reduced coordinates."""
        v = [
            _velocities(beam, (part.stop - part.start) // 2)
            for beam, (_, part, _) in zip(self.scene.beams, self.parts, strict=True)
        ]
        return np.linalg.lstsq(self.Z, np.concatenate(v), rcond=None)[0]

    def coordinates(self, y):
        """All vectors of a state."""
        return self.start + self.Z @ y[: len(y) // 2].reshape(-1, 2)

    def rates(self, t, y):
        """ż and v̇: on the null space of the rows of unit vectors, M a = f, and a particular a keeps them."""
        _, v = np.split(y, 2)
        q, f = self.coordinates(y), self.weight.copy()
        for k, element, bends in self.elements:
            if bends:
                f[k : k + 4] -= element.force(q[k : k + 4])
        f, velocity = self.Z.T @ f, v.reshape(-1, 2)
        if not len(self.units):
            return np.concatenate([v, (self.inverse @ f).ravel()])
        J = np.array([np.outer(self.Z[u], q[u]).ravel() for u in self.units])
        turning = -np.array([(self.Z[u] @ velocity) @ (self.Z[u] @ velocity) for u in self.units])
        N, M = null_space(J), np.kron(self.M, np.eye(2))
        a = np.linalg.lstsq(J, turning, rcond=None)[0]
        a += N @ np.linalg.solve(N.T @ M @ N, N.T @ (f.ravel() - M @ a))
        return np.concatenate([v, a])

    def jacobian(self, t, y):
        """Of the rates, where nothing is rigid."""
        n, q = len(y) // 2, self.coordinates(y)
        K = np.zeros((2 * len(q), 2 * len(q)))
        for k, element, _ in self.elements:
            K[2 * k : 2 * k + 8, 2 * k : 2 * k + 8] += element.tangent(q[k : k + 4]).reshape(8, 8)
        Z = np.kron(self.Z, np.eye(2))
        J = np.zeros((2 * n, 2 * n))
        J[:n, n:] = np.eye(n)
        J[n:, :n] = -np.kron(self.inverse, np.eye(2)) @ (Z.T @ K @ Z)
        return J


def _check(scene):
    """Refuse what it lacks."""
    for thing in (*scene.bodies, *scene.joints, *scene.loads, *scene.connectors):
        damped = isinstance(thing, at.Beam) and thing.material.damping
        plain = isinstance(thing, at.Pin) or (
            isinstance(thing, at.Clamp) and thing.angle is None and thing.stretch == "held"
        )
        inside = plain and any(scene.place(end).interior for end in thing.ends)
        if damped or inside or not (plain or isinstance(thing, at.Beam)):
            raise UnsupportedError(f"Radau has beams, pins, clamps and gravity, and cannot do {thing!r}")


def _line(beam, count):
    """Vectors r, r' of the nodes of a straight beam."""
    places = [np.array(beam.position_at(k / count)) for k in range(count + 1)]
    along = np.subtract(beam.end, beam.start) / beam.length
    return np.array([x for place in places for x in (place, along)])


def _velocities(beam, nodes):
    fractions = np.arange(nodes) / (nodes - 1)
    pairs = ((beam.velocity_at(f), beam.velocity_slope_at(f)) for f in fractions) if beam.moving else ()
    return np.array([x for pair in pairs for x in pair]) if beam.moving else np.zeros((2 * nodes, 2))
