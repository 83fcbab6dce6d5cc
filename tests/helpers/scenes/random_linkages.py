"""Random linkages of rigid bodies under gravity, forces and springs, and the equations of their equilibria.

The equations share nothing with the solver: positions and angles of bodies, the energy, and the joints' conditions.
"""

import numpy as np

import anctmm as at
from anctmm.errors import AnctmmError

GRAVITY = 9.81


def random_linkage(seed):
    """A scene of one to five bodies, the same for the same seed; None where the seed gives none that can be.

    Bodies may be held by redundant pins, or by guides alone, and springs may be strained at the start.
    """
    draw = _Draw(np.random.default_rng(seed))
    try:
        return draw.scene(f"linkage {seed}")
    except AnctmmError:
        return None


class _Draw:
    def __init__(self, rng):
        self.rng, self.places, self.ends, self.bodies = rng, [(0.0, 0.0)], {0: []}, []

    def scene(self, name):
        for number in range(int(self.rng.integers(1, 6))):
            self._body(f"b{number}")
        joints = [joint for place in self.ends for joint in self._joints(place)]
        springs = [spring for _ in range(int(self.rng.integers(0, 4))) for spring in self._springs()]
        if self.rng.random() < 0.3:
            stiffness = float(10 ** self.rng.uniform(-1, 2))
            springs.append(at.RotationalSpring("b0.center", stiffness=stiffness))
        loads = []
        if self.rng.random() < 0.5:
            body = self._some(self.bodies)
            force = tuple(map(float, self.rng.normal(size=2) * 5.0))
            loads.append(at.Force(f"{body.name}.{next(iter(body.points))}", force))
        return at.Scene(name, self.bodies, joints, loads, (0.0, -GRAVITY), connectors=springs)

    def _some(self, things):
        return things[int(self.rng.integers(len(things)))]

    def _new_place(self):
        x, y = self._some(self.places)
        angle, away = self.rng.uniform(0.0, 6.28), self.rng.uniform(0.3, 1.0)
        self.places.append((float(x + away * np.cos(angle)), float(y + away * np.sin(angle))))
        self.ends[len(self.places) - 1] = []
        return len(self.places) - 1

    def _body(self, name):
        found = {int(self.rng.integers(len(self.places)))}
        for _ in range(int(self.rng.integers(1, 3))):
            fresh = self.rng.random() < 0.75
            found.add(self._new_place() if fresh else int(self.rng.integers(len(self.places))))
        points = {f"p{j}": self.places[j] for j in found}
        center = np.mean([self.places[j] for j in found], axis=0) + self.rng.normal(size=2) * 0.1
        mass = float(self.rng.uniform(0.5, 2.0))
        self.bodies.append(at.RigidBody(name, mass, 0.1 * mass, tuple(map(float, center)), points=points))
        for j in found:
            self.ends[j].append(f"{name}.p{j}")

    def _joints(self, place):
        ends = self.ends[place]
        if not ends:
            return
        grounded = bool(self.rng.random() < 0.2) or place == 0
        if grounded and self.rng.random() < 0.3:
            angle = self.rng.uniform(0.0, 6.28) if self.rng.random() < 0.5 else 0.0
            yield at.Slider(ends[0], direction=(float(np.cos(angle)), float(np.sin(angle))))
            if len(ends) > 1:
                yield at.Pin(*ends)
        elif len(ends) > 1 or grounded:
            yield at.Pin(*ends, grounded=grounded)

    def _springs(self):
        one = self._some(self.bodies)
        first = f"{one.name}.{self.rng.choice([*one.points, 'center'])}"
        if self.rng.random() < 0.5 or len(self.bodies) == 1:
            second = tuple(map(float, self.rng.uniform(-2.0, 2.0, 2)))
        else:
            other = self._some(self.bodies)
            if other is one:
                return
            second = f"{other.name}.{self.rng.choice([*other.points, 'center'])}"
        length = None if self.rng.random() < 0.5 else float(self.rng.uniform(0.0, 1.5))
        yield at.Spring(first, second, stiffness=float(10 ** self.rng.uniform(0.0, 3.0)), length=length)


class Equations:
    """Energy of a linkage, J, and what its joints leave of positions x, (x, y, angle) of each body."""

    def __init__(self, scene):
        self.scene = scene
        self.first = {body.name: 3 * i for i, body in enumerate(scene.bodies)}
        self.start = np.array([v for body in scene.bodies for v in (*body.center, 0.0)])

    def of(self, solution):
        """x of the last output of a solution."""
        return np.array([
            v
            for body in self.scene.bodies
            for v in (*solution.position(f"{body.name}.center")[-1], solution.angle(body.name)[-1])
        ])  # fmt: skip

    def position(self, x, place):
        if not isinstance(place, str):
            return np.array(place)
        at_ = self.scene.place(place)
        i, (u, v) = self.first[at_.body.name], np.subtract(at_.position, at_.body.center)
        c, s = np.cos(x[i + 2]), np.sin(x[i + 2])
        return np.array([x[i] + c * u - s * v, x[i + 1] + s * u + c * v])

    def gaps(self, x):
        found = []
        for joint in self.scene.joints:
            places = [self.position(x, end) for end in joint.ends]
            off = places[0] - self.position(self.start, joint.ends[0])
            if isinstance(joint, at.Slider):
                found.append(joint.direction[0] * off[1] - joint.direction[1] * off[0])
                continue
            found += [gap for place in places[1:] for gap in place - places[0]]
            found += list(off) if joint.grounded else []
        return np.array(found)

    def energy(self, x):
        total = sum(GRAVITY * body.mass * x[self.first[body.name] + 1] for body in self.scene.bodies)
        total -= sum(np.dot(load.value, self.position(x, load.end)) for load in self.scene.loads)
        for spring in self.scene.connectors:
            if isinstance(spring, at.RotationalSpring):
                body = self.scene.place(spring.first).body
                total += 0.5 * spring.stiffness * x[self.first[body.name] + 2] ** 2
                continue
            now, placed = (
                np.hypot(*(self.position(y, spring.first) - self.position(y, spring.second)))
                for y in (x, self.start)
            )
            free = placed if spring.length is None else spring.length
            total += 0.5 * spring.stiffness * (now - free) ** 2
        return total

    def unbalanced(self, x):
        """Largest part of the forces that joints do not take, of the largest force; and the largest gap, m."""
        step = 1e-6 * np.eye(len(x))
        force = np.array([(self.energy(x + h) - self.energy(x - h)) / 2e-6 for h in step])
        J = np.array([(self.gaps(x + h) - self.gaps(x - h)) / 2e-6 for h in step]).T.reshape(-1, len(x))
        left = force - J.T @ np.linalg.lstsq(J.T, force, rcond=1e-7)[0] if len(J) else force
        return np.abs(left).max() / max(1.0, np.abs(force).max()), np.abs(self.gaps(x)).max(initial=0.0)
