"""Random mechanisms: beams, rigid bodies, point masses; pins, welds, supports, guides and drives between them."""

import numpy as np

import anctmm as at
from anctmm.errors import AnctmmError

SECTION, MATERIAL = at.Rectangle(0.02, 0.01), at.Material(E=1e8, density=1000.0)


def turn(t):
    """A drive that starts at rest."""
    return 0.4 * t**2, 0.8 * t, 0.8 + 0.0 * t


def shift(t):
    """A position that starts at rest."""
    return 0.1 * t**2, 0.2 * t, 0.2 + 0.0 * t


def random_mechanism(seed, drives=True, most=7, inside=False, welds=False):
    """A scene that the model takes, the same for the same seed.

    With `inside` bodies are joined to beams at half their length, too; with `welds` ends are welded and clamped, too.
    """
    for attempt in range(200):
        rng = np.random.default_rng([seed, attempt])
        try:
            return _Builder(rng, drives, inside, welds).scene(f"mechanism {seed}", int(rng.integers(2, most)))
        except AnctmmError:
            continue
    raise AssertionError(f"no mechanism of seed {seed} is sound")


class _Builder:
    def __init__(self, rng, drives, inside, welds):
        self.rng, self.drives, self.inside, self.welds = rng, drives, inside, welds
        self.places, self.ends, self.bodies = [self._point()], {0: []}, []

    def scene(self, name, count):
        for number in range(count):
            self._body(number)
        for i, ends in self.ends.items():
            if self.rng.random() < 0.2:
                self.bodies.append(at.PointMass(f"m{i}", float(self.rng.uniform(0.01, 0.5)), self.places[i]))
                ends.append(f"m{i}.center")
        joints = [joint for i in self.ends for joint in self._joints(i)]
        if not any(isinstance(joint, at.Clamp) or joint.grounded for joint in joints):
            joints.append(at.Pin(self.ends[0][0]))
        end = self.ends[len(self.places) - 1][0]
        return at.Scene(name, self.bodies, joints, [at.Force(end, (0.3, 0.1))], (1.0, -9.81))

    def _point(self):
        return tuple(map(float, self.rng.uniform(-1.0, 1.0, 2)))

    def _place(self, fresh):
        """A place that is there, or a new one."""
        if fresh or self.rng.random() < 0.6:
            self.places.append(self._point())
            self.ends[len(self.places) - 1] = []
            return len(self.places) - 1
        return int(self.rng.integers(len(self.places)))

    def _body(self, number):
        first = int(self.rng.integers(len(self.places)))
        name = f"b{number}"
        if self.rng.random() < 0.5:
            second = self._place(False)
            if second == first:
                second = self._place(True)
            self.bodies.append(at.Beam(name, self.places[first], self.places[second], SECTION, MATERIAL))
            self.ends[first].append(f"{name}.start")
            self.ends[second].append(f"{name}.end")
            if self.inside and self.rng.random() < 0.6:
                self.places.append(self.bodies[-1].position_at(0.5))
                self.ends[len(self.places) - 1] = [(name, 0.5)]
            return
        found = {first, *(self._place(False) for _ in range(int(self.rng.integers(1, 4))))}
        points = {f"p{i}": self.places[i] for i in sorted(found)}
        mass = float(self.rng.uniform(0.05, 0.5))
        self.bodies.append(at.RigidBody(name, mass, 0.1 * mass, self._point(), points))
        for i in sorted(found):
            self.ends[i].append(f"{name}.p{i}")

    def _firm(self, i):
        """A weld or a clamp, driven or not, and a pin of what else is there; nothing where bodies only meet."""
        ends = list(self.ends[i])
        self.rng.shuffle(ends)
        turning = [end for end in ends if not isinstance(end, str) or not end.startswith("m")]
        angle = turn if self.drives and self.rng.random() < 0.5 else None
        if len(turning) > 1 and self.rng.random() < 0.6:
            firm, held = at.Weld(*turning[:2], angle=angle), turning[:2]
        elif turning and self.rng.random() < 0.3:
            firm, held = at.Clamp(turning[0], angle), turning[:1]
        else:
            return []
        rest = [end for end in ends if end not in held]
        return [firm, at.Pin(held[0], *rest)] if rest else [firm]

    def _joints(self, i):
        if self.welds and (firm := self._firm(i)):
            yield from firm
            return
        rng, ends = self.rng, self.ends[i]
        ends = [ends[k] for k in rng.permutation(len(ends))]
        turning = [end for end in ends if not str(end).startswith("m")]
        grounded = rng.random() < 0.2
        if len(ends) > 1:
            yield at.Pin(*ends, grounded=bool(grounded))
        elif grounded:
            yield at.Pin(ends[0])
        if len(turning) > 1 and rng.random() < 0.5:
            angle = turn if self.drives and rng.random() < 0.4 else None
            yield at.Weld(*turning[:2], angle=angle)
        if len(turning) > 2 and rng.random() < 0.5:
            yield at.Weld(*turning[1:3])
        if grounded and turning and rng.random() < 0.4:
            yield at.Clamp(turning[-1], angle=turn if self.drives and rng.random() < 0.5 else None)
        elif not grounded and turning and rng.random() < 0.3:
            yield self._guide(turning[0])

    def _guide(self, end):
        kind = at.Slider if self.rng.random() < 0.6 else at.Prismatic
        rigid = [body.name for body in self.bodies if isinstance(body, at.RigidBody)]
        body = str(self.rng.choice(rigid)) if rigid and self.rng.random() < 0.5 else None
        position = shift if self.drives and self.rng.random() < 0.4 else None
        return kind(end, self._point(), body, position)
