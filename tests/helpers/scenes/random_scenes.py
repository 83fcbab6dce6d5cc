"""Small scenes drawn at random, for the property tests.

All numbers are drawn from coarse grids: no property is about angles of 1e-13 rad, and a failing example reads well.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, sin

from hypothesis import strategies as st

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld
from anctmm.model.sections import Circle, Rectangle
from reference.global_dae.layout import Layout
from reference.global_dae.stability import largest_step
from reference.global_dae.system import System

EIGHTHS = st.integers(-16, 16).map(lambda n: n / 8)
VECTORS = st.tuples(EIGHTHS, EIGHTHS)
SECTIONS = st.sampled_from([Rectangle(0.02, 0.02), Rectangle(0.01, 0.03), Circle(0.03)])
MATERIALS = st.builds(
    Material, E=st.sampled_from([4e6, 1e7, 3e7]), density=st.just(1000.0), poisson=st.sampled_from([0.0, 0.3])
)
#: Of Newton's iteration, where two solvers are compared.
TOLERANCE = 1e-12
#: Duration of pulses and drives, s: of the order of a run.
PULSE = 0.05


@dataclass(frozen=True)
class Push:
    """Force of time: a pulse in a direction, N."""

    direction: tuple[float, float]
    pulse: Pulse

    def __call__(self, t):
        return tuple(x * self.pulse(t) for x in self.direction)


@dataclass(frozen=True)
class Drawn:
    """A scene, and the mesh and the kind of element of each body."""

    scene: Scene
    mesh: dict[str, int]
    element: dict[str, str]


@dataclass(frozen=True)
class Swirl:
    """Initial velocity of a body in one linear field of the plane that vanishes at `centre`, m/s.

    One field for all bodies, so that joined ends agree; linear, so that its slope along them is found to rounding.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float]
    gradient: tuple[float, float, float, float]

    def __call__(self, fraction):
        x, y = (
            (1.0 - fraction) * a + fraction * b - c
            for a, b, c in zip(self.start, self.end, self.centre, strict=True)
        )
        xx, xy, yx, yy = self.gradient
        return xx * x + xy * y, yx * x + yy * y


@st.composite
def rows(draw, supports=("free", "pin", "clamp", "hub"), varying=True, least=1):
    """Moving rows of one to four bodies: pins and welds, some held at the ground, gaps, loads and velocities.

    Parameters
    ----------
    supports : sequence of str
        Of which two hold the ends of the row; if all are "free", nothing else is held or loaded either.
    varying : bool
        Whether loads may vary in time.
    least : int
        Fewest elements of a body.
    """
    links = draw(st.lists(st.sampled_from(["pin", "weld", "weld", "gap"]), max_size=3))
    bodies = _bodies(draw, [draw(EIGHTHS) for _ in links])
    names = [b.name for b in bodies]
    free = set(supports) == {"free"}
    held = [not free and draw(st.integers(0, 3)) == 3 for _ in links]
    joints = [
        (Pin if link == "pin" else Weld)(f"{a}.end", f"{b}.start", grounded=ground)
        for link, ground, (a, b) in zip(links, held, pairwise(names), strict=True)
        if link != "gap"
    ]
    for end in ("b0.start", f"{names[-1]}.end"):
        joints += _support(draw(st.sampled_from(supports)), end, draw(EIGHTHS))
    loads = [] if free else [_load(draw, names, varying) for _ in range(draw(st.integers(0, 3)))]
    bodies = _thrown(draw, bodies, [j.ends[0] for j in joints if j.grounded], "weld" in links)
    gravity = draw(VECTORS.filter(any))
    scene = Scene("row", bodies, joints, loads, (4.0 * gravity[0], 4.0 * gravity[1]))
    return _discretised(draw, scene, links, ("cable", "shear"), least)


@st.composite
def structures(draw, kinds=("cable", "shear"), torques=True, least=1):
    """Rows that rest under moderate loads: clamped, welded, with a pin only where the far end is held."""
    links = draw(st.lists(st.just("weld"), max_size=3))
    far = draw(st.sampled_from(["free", "pin", "clamp"]))
    if links and far != "free" and draw(st.booleans()):
        links[draw(st.integers(0, len(links) - 1))] = "pin"
    bodies = _bodies(draw, [draw(EIGHTHS) for _ in links])
    names = [b.name for b in bodies]
    joints = [
        (Pin if link == "pin" else Weld)(f"{a}.end", f"{b}.start")
        for link, (a, b) in zip(links, pairwise(names), strict=True)
    ]
    joints += [Clamp("b0.start"), *_support(far, f"{names[-1]}.end", 0.0)]
    length = sum(b.length for b in bodies)
    stiffness = min(b.material.E * b.section.second_moment for b in bodies)
    unit = 0.1 * stiffness / length**2  # of force: at most a tenth of what buckles a cantilever
    mass = sum(b.material.density * b.section.area * b.length for b in bodies)
    loads = []
    for _ in range(draw(st.integers(0, 2))):
        end = _some_end(draw, names)
        if torques and draw(st.booleans()):
            loads.append(Torque(end, unit * length * draw(EIGHTHS)))
        else:
            x, y = draw(VECTORS)
            loads.append(Force(end, (unit * x, unit * y)))
    x, y = draw(VECTORS.filter(any))
    scene = Scene("structure", bodies, joints, loads, (unit / mass * x, unit / mass * y))
    return _discretised(draw, scene, links, kinds, least)


def _bodies(draw, turns):
    corner, angle, bodies = (0.0, 0.0), draw(EIGHTHS), []
    for i, turn in enumerate([0.0, *turns]):
        angle += turn
        length = draw(st.integers(4, 12)) / 16
        tip = (corner[0] + length * cos(angle), corner[1] + length * sin(angle))
        bodies.append(Beam(f"b{i}", corner, tip, draw(SECTIONS), draw(MATERIALS)))
        corner = tip
    return bodies


def _thrown(draw, bodies, held, welded):
    """Bodies with an initial velocity, unless more than one place is held; welded ones stretch and turn alike."""
    places = {f"{b.name}.{side}": getattr(b, side) for b in bodies for side in ("start", "end")}
    held = sorted({places[end] for end in held})
    if len(held) > 1 or draw(st.integers(0, 3)) == 0:
        return bodies
    centre = held[0] if held else draw(VECTORS)
    gradient = tuple(draw(EIGHTHS) for _ in range(4))
    if welded:  # the same along bodies at an angle: a field that stretches all directions alike
        gradient = (gradient[0], -gradient[2], gradient[2], gradient[0])
    return [replace(b, velocity=Swirl(b.start, b.end, centre, gradient)) for b in bodies]


def _support(name, end, turn):
    return {
        "free": [],
        "pin": [Pin(end)],
        "clamp": [Clamp(end)],
        "hub": [Clamp(end, Quintic(0.5 * turn, PULSE))],
    }[name]


def _some_end(draw, names):
    return f"{draw(st.sampled_from(names))}.{draw(st.sampled_from(['start', 'end']))}"


def _load(draw, names, varying):
    end, varying = _some_end(draw, names), varying and draw(st.booleans())
    if draw(st.booleans()):
        x, y = draw(VECTORS)
        return Force(end, Push((4.0 * x, 4.0 * y), Pulse(1.0, PULSE)) if varying else (x, y))
    moment = 0.1 * draw(EIGHTHS)
    return Torque(end, Pulse(moment, PULSE) if varying else moment)


def _discretised(draw, scene, links, kinds, least):
    mesh, element, kind = {}, {}, draw(st.sampled_from(kinds))
    for body, link in zip(scene.bodies, ["weld", *links], strict=True):
        kind = kind if link == "weld" else draw(st.sampled_from(kinds))  # a weld joins elements of one kind
        mesh[body.name], element[body.name] = draw(st.integers(least, 3)), kind
    return Drawn(scene, mesh, element)


# --- by a seed: how scenes are run -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Asked:
    """A scene and its run, drawn by a seed."""

    seed: int
    scene: Scene
    run: Discretisation


def some_method(random, peer):
    """Zhai's steps, implicit ones, or those that a tolerance drives; Exudyn has no explicit joints."""
    method = random.choice([*["zhai", "generalized-alpha"] * 4, "tolerance"])
    return "generalized-alpha" if peer.startswith("exudyn") else method


def some_steps(random, scene, method, mesh, element):
    """An integrator with its parameters; steps below the stability limit, where there is one."""
    quadrature = random.choice(["full", "full", "reduced", "lobatto"])
    options = {"mesh": mesh, "element": element, "quadrature": quadrature, "newton_tolerance": TOLERANCE}
    if method == "tolerance":
        options["integrator"] = "generalized-alpha"
        return Discretisation(tolerance=random.choice([1e-2, 1e-3]), t_end=0.1, output_dt=0.02, **options)
    if method == "generalized-alpha":
        dt, steps = random.choice([5e-4, 2e-3, 4e-3]), 20
        options["spectral_radius"] = random.choice([0.9, 0.9, 0.5, 0.0, 1.0])
    else:
        psi = random.choice([0.5, 0.5, 0.7, 1.0])
        options |= {"psi": psi, "phi": psi}
        coarse = Discretisation(integrator="zhai", dt=1.0, t_end=1.0, **options)
        limit = largest_step(System(Layout(scene, coarse)))[1]
        dt, steps = float(f"{min(0.5 * limit, 2e-3):.2g}"), 40
    return Discretisation(
        integrator=method, dt=dt, t_end=dt * steps, output_dt=dt * steps / 4, check_stability=False, **options
    )
