"""Scenes of any topology drawn from a seed: trees, loops, several components, shared ends, pins and welds at angles.

Bodies lie between neighbouring points of a lattice that is bent at random, so that they are of comparable length and
their ends meet exactly. Everything follows from the seed; nothing is drawn elsewhere.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from random import Random

import numpy as np
from random_scenes import Asked, Push, some_method, some_steps

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld
from anctmm.model.sections import Circle, Rectangle
from anctmm.model.topology import Sets

SECTIONS = (Rectangle(0.02, 0.02), Rectangle(0.01, 0.03), Circle(0.03))
MATERIALS = (Material(4e6, 1000.0), Material(1e7, 1000.0, 0.3), Material(3e7, 1200.0))
#: Distance of neighbouring points of the lattice and how far a point may lie off it, m.
SPACING, SHIFT = 0.3, 0.06
NEIGHBOURS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
#: Ends that may meet at a junction; duration of pulses and drives, s.
MOST, PULSE = 6, 0.05


@dataclass(frozen=True)
class Whirl:
    """Initial velocity of a body: that of a rigid motion of the whole scene, and a bulge between its ends, m/s.

    The bulge has neither value nor slope at the ends, so that welds can have it.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float]
    rate: float
    drift: tuple[float, float]
    bulge: tuple[float, float]

    def __call__(self, fraction):
        x, y = (
            (1.0 - fraction) * a + fraction * b - c
            for a, b, c in zip(self.start, self.end, self.centre, strict=True)
        )
        (u, v), (p, q) = self.drift, self.bulge
        bump = 16.0 * (fraction * (1.0 - fraction)) ** 2
        return u - self.rate * y + bump * p, v + self.rate * x + bump * q


@dataclass(frozen=True)
class Kinds:
    """What a drawn scene may have.

    Parameters
    ----------
    bodies : (int, int)
        Fewest and most.
    loops : bool or None
        Whether bodies close loops; None draws it.
    components : int
        Most of them.
    hinges, welds : bool
        Joints between bodies; without both, ends that meet stay apart.
    supports : bool
        Pins to the ground, clamps and driven clamps; without them there are no loads either, and bodies move.
    structure : bool
        Whether the scene is held and stiff, for statics: every component has a clamp, no hinges, dead loads only.
    elements : tuple of str
        Kinds of elements; bodies welded to each other share one.
    """

    bodies: tuple[int, int] = (1, 30)
    loops: bool | None = None
    components: int = 3
    hinges: bool = True
    welds: bool = True
    supports: bool = True
    structure: bool = False
    elements: tuple[str, ...] = ("cable", "shear")


def random_graph(seed, kinds=None, **options):
    """A scene and a discretisation of it.

    Parameters
    ----------
    seed : int
    kinds : Kinds, optional
    **options
        Of the discretisation, beside the mesh (1 to 3 elements a body) and the elements, which are drawn.

    Returns
    -------
    Scene, Discretisation
    """
    return _Drawing(seed, kinds or Kinds()).drawn(options)


def asked_graph(seed, peer="global-dae"):
    """A scene of any topology and a short run, within what both ANC-TMM and a peer take.

    Trees and loops, several components, joints that share ends, every support, drives, loads, initial velocities; both
    integrators with their parameters; tolerances.
    """
    random = Random(seed)
    method = some_method(random, peer)
    elements = ("cable",) if peer.startswith("exudyn") else ("cable", "shear")
    scene, run = random_graph(seed, Kinds(bodies=(2, 8), elements=elements))
    if method == "zhai" and random.random() < 0.25:
        damped = (
            replace(b, material=replace(b.material, damping=random.choice([1e-5, 5e-5])))
            for b in scene.bodies
        )
        scene = replace(scene, bodies=tuple(damped))
    return Asked(seed, scene, some_steps(random, scene, method, run.mesh, run.element))


class _Drawing:
    """One scene, as it is being drawn."""

    def __init__(self, seed, kinds):
        self.seed, self.kinds, self.rng = seed, kinds, np.random.default_rng(seed)
        self.bodies, self.joints, self.loads = [], [], []
        self.meeting = {}  # point (component, i, j) -> ends there
        self.held = []  # places held
        self.alike = Sets()  # bodies whose elements are of one kind

    def drawn(self, options):
        low, high = self.kinds.bodies
        count = round(low * (high / low) ** self.rng.random())
        parts = int(self.rng.integers(1, min(count, self.kinds.components) + 1))
        for part in range(parts):
            self._grow(part, count // parts + (part < count % parts))
        for point in sorted(self.meeting):
            self._join(point)
        self.rng.shuffle(self.joints)
        names = [body.name for body in self.bodies]
        if self.kinds.supports or self.kinds.structure:
            self.loads = [self._load(names) for _ in range(int(self.rng.integers(0, 4)))]
        self._throw()
        kinds = {}
        for name in names:
            self._kind_of(name, kinds)
        element = {name: kinds[self.alike.of(name)] for name in names}
        mesh = {name: int(self.rng.integers(1, 4)) for name in names}
        gravity = (float(self.rng.uniform(-4, 4)), float(self.rng.uniform(-4, 4)))
        scene = Scene(f"graph {self.seed}", self.bodies, self.joints, self.loads, self._scaled(gravity))
        return scene, Discretisation(**{"mesh": mesh, "element": element, "t_end": 0.02, **options})

    def _kind_of(self, name, kinds):
        kinds.setdefault(self.alike.of(name), str(self.rng.choice(self.kinds.elements)))

    # --- bodies --------------------------------------------------------------------------------------------

    def _grow(self, part, count):
        """A connected component: bodies from points that are there to new ones or, in loops, to others."""
        loops = bool(self.rng.integers(2)) if self.kinds.loops is None else self.kinds.loops
        place = {(0, 0): self._place((0, 0))}
        degree, growing, drawn = {(0, 0): 0}, [(0, 0)], set()
        while count:
            k = int(self.rng.integers(len(growing)))
            here = growing[k]
            around = [(here[0] + i, here[1] + j) for i, j in NEIGHBOURS]
            free = [p for p in around if degree.get(p, 0) < MOST and (here, p) not in drawn]
            new, there = [p for p in free if p not in place], [p for p in free if p in place]
            choice = there if loops and there and (not new or self.rng.random() < 0.5) else new
            if not choice or degree[here] >= MOST:
                growing[k] = growing[-1]  # nothing more can grow here
                growing.pop()
                continue
            far = choice[int(self.rng.integers(len(choice)))]
            if far not in place:
                place[far] = self._place(far)
                growing.append(far)
            drawn |= {(here, far), (far, here)}
            self._body((part, *here), (part, *far), place[here], place[far])
            for point in (here, far):
                degree[point] = degree.get(point, 0) + 1
            count -= 1

    def _place(self, point):
        x, y = self.rng.uniform(-SHIFT, SHIFT, 2)
        return (SPACING * point[0] + float(x), SPACING * point[1] + float(y))

    def _body(self, one, two, p, q):
        if self.rng.integers(2):
            one, two, p, q = two, one, q, p
        name = f"b{len(self.bodies)}"
        section, material = (things[int(self.rng.integers(3))] for things in (SECTIONS, MATERIALS))
        self.bodies.append(Beam(name, p, q, section, material))
        self.meeting.setdefault(one, []).append((f"{name}.start", p))
        self.meeting.setdefault(two, []).append((f"{name}.end", q))

    # --- joints --------------------------------------------------------------------------------------------

    def _join(self, point):
        """Joints of the ends at a point: groups of welded ends, hinged to each other; maybe a hold."""
        ends = [end for end, _ in self.meeting[point]]
        place = self.meeting[point][0][1]
        self.rng.shuffle(ends)
        groups = self._groups(ends)
        joints = []
        for group in groups:
            joints += self._connected(Weld, group)
            for end in group[1:]:
                self.alike.unite(group[0].split(".")[0], end.split(".")[0])
        if self.kinds.hinges:
            joints += self._connected(Pin, [group[int(self.rng.integers(len(group)))] for group in groups])
        self.joints += self._hold(point, ends, joints, place)

    def _groups(self, ends):
        """Ends welded to each other; all of them in a structure."""
        if self.kinds.structure:
            return [ends]
        if not self.kinds.welds or self.rng.random() < 0.25:
            return [[end] for end in ends]
        count = (
            1 if not self.kinds.hinges or self.rng.random() < 0.4 else int(self.rng.integers(len(ends))) + 1
        )
        groups = [[end] for end in ends[:count]]
        for end in ends[count:]:
            groups[int(self.rng.integers(count))].append(end)
        return groups

    def _connected(self, kind, ends):
        """One joint of all ends, or several that share ends."""
        if len(ends) < 2:
            return []
        if self.rng.random() < 0.5:
            return [kind(*ends)]
        hub = self.rng.random() < 0.5  # all to the first, or each to the one before
        return [kind(ends[0] if hub else a, b) for a, b in pairwise(ends)]

    def _hold(self, point, ends, joints, place):
        """The joints, and maybe a support at the place of connected ends."""
        first = point[1:] == (0, 0)
        if self.kinds.structure:
            wanted = "clamp" if first else None
        elif not self.kinds.supports or self.rng.random() > (0.6 if first else 0.12):
            wanted = None
        else:
            wanted = str(self.rng.choice(["pin", "grounded", "clamp", "drive"]))
        if wanted is None:
            return joints
        self.held.append(place)
        end = ends[int(self.rng.integers(len(ends)))]
        if wanted == "grounded" and joints:
            chosen = int(self.rng.integers(len(joints)))
            joints[chosen] = type(joints[chosen])(*joints[chosen].ends, grounded=True)
            return joints
        if wanted == "clamp":
            return [*joints, Clamp(end)]
        if wanted == "drive":
            return [*joints, Clamp(end, Quintic(float(self.rng.uniform(-1, 1)), PULSE))]
        return [*joints, Pin(end)]

    # --- loads and motion ----------------------------------------------------------------------------------

    def _scaled(self, force):
        """A force that a structure bears without buckling; a force as it is for what moves anyhow."""
        if not self.kinds.structure:
            return force
        return tuple(0.02 * x / max(1, len(self.bodies)) for x in force)

    def _load(self, names):
        end = f"{self.rng.choice(names)}.{self.rng.choice(['start', 'end'])}"
        x, y, moment = (float(v) for v in self.rng.uniform(-2, 2, 3))
        dead = self.kinds.structure or self.rng.random() < 0.5
        if self.rng.random() < 0.6:
            return Force(end, self._scaled((x, y)) if dead else Push((4.0 * x, 4.0 * y), Pulse(1.0, PULSE)))
        moment = 0.1 * self._scaled((moment, 0.0))[0]
        return Torque(end, moment if dead else Pulse(moment, PULSE))

    def _throw(self):
        """An initial velocity, where at most one place is held, and no direction."""
        places = set(self.held)
        clamped = any(isinstance(joint, Clamp) for joint in self.joints)
        if clamped or len(places) > 1 or self.rng.random() < 0.25:
            return
        centre = next(iter(places)) if places else tuple(map(float, self.rng.uniform(-1, 1, 2)))
        rate, drift = float(self.rng.uniform(-4, 4)), tuple(map(float, self.rng.uniform(-2, 2, 2)))
        drift = (0.0, 0.0) if places else drift
        for k, b in enumerate(self.bodies):
            bulge = tuple(map(float, self.rng.uniform(-0.3, 0.3, 2)))
            self.bodies[k] = replace(b, velocity=Whirl(b.start, b.end, centre, rate, drift, bulge))
