"""Scenes that are timed, and how: through the public face of `anctmm` alone, so that any checkout of it can run them.

As a script it is the worker of `python -m studies.benchmark OTHER_CHECKOUT`: it reads names of items, a line each, and
answers by their samples.
"""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import cos, isnan, pi, radians, sin, sqrt
from pathlib import Path
from time import process_time
from typing import Any

import anctmm as at

#: By the kind of steps: options of a run, and elements times steps of one.
METHODS: dict[str, tuple[dict[str, Any], float]] = {
    "explicit": ({"integrator": "zhai", "dt": 1e-6}, 4e5),
    "implicit": ({"integrator": "generalized-alpha", "dt": 1e-3}, 1e5),
    "esdirk": ({"integrator": "esdirk", "dt": 2e-3}, 2e4),
}
FEWEST, MOST = 5, 5000
OURS, EXUDYN, SPARSE, DENSE = "anctmm", "exudyn-cable", "global-dae", "global-dae-dense"
#: Meshes of the four-bar, elements of crank, coupler and follower: the paper's, and four times as many.
FOUR_BARS = ((2, 8, 2), (8, 32, 8))
#: Elements of one clamped beam; the last has 2,000,000 coordinates.
LENGTHS = (1_000, 10_000, 100_000, 500_000)
LONG = "long beam"
Place = tuple[float, float]


@dataclass(frozen=True)
class Item:
    """A run that is timed."""

    contest: str  # name of the scene
    made: Callable[[], at.Scene]
    elements: int  # in all; of rigid bodies their number
    kind: str  # of the steps: a key of METHODS
    options: dict[str, Any] = field(default_factory=dict)  # mesh, element, …; another step
    solvers: tuple[str, ...] = (OURS,)  # in turn in `anctmm bench`; the others are compared with the first

    @property
    def name(self) -> str:
        """Scene, size and steps."""
        return f"{self.contest}, {self.elements} elements, {self.kind}"

    def run(self, quick: bool = False) -> at.Discretisation:
        """So many steps without output between the first and the last."""
        usual, work = METHODS[self.kind]
        options = usual | self.options
        steps = min(MOST, max(FEWEST, round(work / self.elements))) // (10 if quick else 1) or 1
        t_end = steps * options["dt"]
        return at.Discretisation(**options, t_end=t_end, output_dt=t_end)


def sampled(call: Callable[[], at.Solution]) -> dict[str, Any]:
    """CPU time of the steps of a call and of the whole call (without compiling), s, and its counts."""
    begun = process_time()
    found = call()
    cost = found.cost
    compiling = 0.0 if isnan(cost.compile_s) else cost.compile_s
    return {
        "steps_s": cost.cpu_s, "call_s": process_time() - begun - compiling, "steps": cost.steps,
        "corrections": cost.newton_iterations, "coordinates": found.dofs, "status": str(found.status),
    }  # fmt: skip


# --- scenes ----------------------------------------------------------------------------------------------------

beam = partial(at.Beam, section=at.Rectangle(0.01, 0.01), material=at.Material(E=5e6, density=1000.0))
scene = partial(at.Scene, "bench", gravity=(0.0, -9.81))


def joined(bodies: Sequence[at.Beam], joint: Callable[..., Any]) -> list[Any]:
    """A joint wherever ends of beams meet."""
    ends: dict[Place, list[str]] = {}
    for body in bodies:
        for (x, y), side in ((body.start, "start"), (body.end, "end")):
            ends.setdefault((round(x, 9), round(y, 9)), []).append(f"{body.name}.{side}")
    return [joint(*names) for names in ends.values() if len(names) > 1]


def chain(length: float = 1.0) -> at.Scene:
    """A clamped beam."""
    return scene([beam("bar", (0.0, 0.0), (length, 0.0))], [at.Clamp("bar.start")])


def zigzag(beams: int, joint: Any, angle: float = pi / 6) -> at.Scene:
    """Beams in a row, by turns at an angle to either side of the x axis."""
    places = [(k * cos(angle), (k % 2) * sin(angle)) for k in range(beams + 1)]
    bodies = [beam(f"z{k}", *places[k : k + 2]) for k in range(beams)]
    return scene(bodies, [*joined(bodies, joint), at.Clamp("z0.start")])


def tree(beams: int, joint: Any) -> at.Scene:
    """A tree, clamped at its foot, whose beams part in two; at each level by less."""
    bodies, ways = [beam("t0", (0.0, 0.0), (0.0, 1.0))], [0.5 * pi]
    for k in range(1, beams):
        parent, level = (k - 1) // 2, (k + 1).bit_length() - 1
        ways.append(ways[parent] + (0.6 if k % 2 else -0.6) / level)
        x, y = bodies[parent].end
        bodies.append(beam(f"t{k}", (x, y), (x + cos(ways[k]), y + sin(ways[k]))))
    return scene(bodies, [*joined(bodies, joint), at.Clamp("t0.start")])


def ladder(rungs: int, joint: Any) -> at.Scene:
    """Two posts with rungs between nodes of them."""
    posts = [beam(name, (x, 0.0), (x, 0.2 * rungs)) for name, x in (("left", 0.0), ("right", 0.3))]
    steps = [beam(f"rung{k}", (0.0, 0.2 * k), (0.3, 0.2 * k)) for k in range(1, rungs + 1)]
    joints = [at.Clamp("left.start"), at.Clamp("right.start")]
    for post, end in (("left", "start"), ("right", "end")):
        joints += [joint((post, k / rungs), f"rung{k}.{end}") for k in range(1, rungs + 1)]
    return scene([*posts, *steps], joints)


def springs(count: int) -> at.Scene:
    """A beam of 128 elements with springs from node to node across half of them."""
    nodes = [(2 * k + 1) * 64 // (2 * count) for k in range(count)]
    ties = [at.Spring(("bar", n / 128), ("bar", (n + 64) / 128), stiffness=5.0) for n in nodes]
    return replace(chain(), connectors=tuple(ties))


def four_bars(loops: int) -> at.Scene:
    """Rigid bars of 1 m and 1 kg in a row of loops, whose joints move with 1 m/s."""
    bodies, joints = [], []
    for i in range(loops + 1):
        ends, next_ = {"a": (i, 0.0), "b": (i, 1.0)}, {"a": (i, 1.0), "b": (i + 1, 1.0)}
        bodies.append(at.RigidBody(f"p{i}", 1.0, 1 / 12, (i, 0.5), ends, (-0.5, 0.0), 1.0))
        if i < loops:
            bodies.append(at.RigidBody(f"g{i}", 1.0, 1 / 12, (i + 0.5, 1.0), next_, (-1.0, 0.0)))
        meeting = [f"g{i - 1}.b"] * (i > 0) + [f"g{i}.a"] * (i < loops)
        joints += [at.Pin(f"p{i}.a"), at.Pin(f"p{i}.b", *meeting)]
    return scene(bodies, joints)


def paper() -> at.Scene:
    """The paper's four-bar (Rong 2014, Table 1)."""
    places = (0.0, 0.0), (0.2, 0.0), (0.2 + 0.45 * sqrt(3.0), 0.45), (0.2 + 0.3 * sqrt(3.0), 0.0)
    data = ("crank", 0.04, 0.6811, 1e9), ("coupler", 0.05, 2.474, 5e6), ("follower", 0.03, 1.470, 5e8)
    bodies = []
    for (name, diameter, mass, E), start, end in zip(data, places, places[1:], strict=False):
        section = at.Circle(diameter)
        density = mass / (section.area * at.distance(start, end))
        bodies.append(at.Beam(name, start, end, section, at.Material(E=E, density=density)))
    drive = at.Clamp("crank.start", angle=at.Quintic(2.0 * pi, 2.0))
    return at.Scene("four-bar", bodies, [drive, *joined(bodies, at.Pin), at.Pin("follower.end")])


# --- items -----------------------------------------------------------------------------------------------------


PAIR = ("explicit", "implicit")
#: What other solvers are not timed on: name, scene, elements of each beam, and options.
OWN: list[tuple[str, Callable[[], at.Scene], int, dict[str, Any]]] = [
    *((f"{element} chain", partial(chain, 1.0 if n <= 128 else 0.05 * n), n, {"element": element})
      for element in ("cable", "shear", "quintic") for n in (8, 32, 128, 1_000_000)),
    ("cable chain", chain, 32, {"kinds": ("esdirk",)}),
    *((f"four-bar, {element}", paper, 8, {"element": element, "kinds": (kind,), "dt": dt})
      for element in ("shear", "cable") for kind, dt in (("explicit", 2e-6), ("implicit", 1e-3))),
    *(("frame welded at 40 degrees", partial(zigzag, 2, at.Weld, radians(20.0)), n, {}) for n in (8, 32)),
    *((f"{kind} ladder of {n} rungs", partial(ladder, n, joint), 2, {})
      for kind, joint, n in (("welded", at.Weld, 10), ("hinged", at.Pin, 10), ("hinged", at.Pin, 100))),
    ("tree of 127 beams", partial(tree, 127, at.Pin), 2, {}),
    *((f"rigid four-bars: {n}", partial(four_bars, n), 1, {}) for n in (1, 40)),
    *((f"springs across 128 cables: {n}", partial(springs, n), 128, {}) for n in (1, 8, 64)),
]  # fmt: skip


def items(quick: bool = False) -> Iterator[Item]:
    """Everything that is timed."""
    size, like = 10 if quick else 40, {"quadrature": "reduced"}
    for n in (8, 32) if quick else (8, 32, 128):
        yield from _items("clamped beam, like settings", chain, n, solvers=(OURS, EXUDYN), **like)
    for mesh in FOUR_BARS[: 1 if quick else None]:
        yield from _items("four-bar, like settings", paper, mesh, ("implicit",), (OURS, EXUDYN), **like)
        # the drive begins slowly: in shorter steps nothing would move by more than rounding
        options: dict[str, Any] = {"element": "shear", "dt": 1e-5, "solvers": (OURS, SPARSE, DENSE)}
        yield from _items("four-bar, the paper's elements", paper, mesh, ("explicit",), **options)
    yield from _items("hinged chain", partial(zigzag, size, at.Pin), 2, solvers=(OURS, SPARSE))
    yield from _items("welded tree", partial(tree, size, at.Weld), 2, solvers=(OURS, SPARSE))
    yield from _items("hinged ladder", partial(ladder, size // 2, at.Pin), 2, solvers=(OURS, SPARSE))
    for n in LENGTHS[: 2 if quick else None]:
        yield from _items(LONG, partial(chain, 0.05 * n), n)
    for name, made, n, options in () if quick else OWN:
        yield from _items(name, made, n, **options)


def _items(
    name: str, made: Callable[[], at.Scene], mesh: int | Sequence[int], kinds: Sequence[str] = PAIR,
    solvers: tuple[str, ...] = (OURS,), **options: Any,
) -> Iterator[Item]:  # fmt: skip
    """Steps of a scene, with a mesh of each beam, or of all; posts of a ladder have a node at each rung."""
    beams = [body.name for body in made().beams]
    rungs = sum(name.startswith("rung") for name in beams)
    each = [mesh] * len(beams) if isinstance(mesh, int) else mesh
    meshes = {n: rungs if rungs and not n.startswith("rung") else m for n, m in zip(beams, each, strict=True)}
    elements = sum(meshes.values()) or len(made().bodies)
    for kind in kinds:
        yield Item(name, made, elements, kind, {"mesh": meshes or mesh, **options}, solvers)


# --- the worker ------------------------------------------------------------------------------------------------


def work(checkout: str, quick: bool) -> None:
    """Answer names of items, a line each, by their samples."""
    if Path(checkout).resolve() not in Path(at.__file__).resolve().parents:
        raise SystemExit(f"anctmm is imported from {at.__file__}, not from {checkout}")
    known = {item.name: item for item in items(quick)}
    for line in sys.stdin:
        item = known[line.strip()]
        try:
            answer = sampled(partial(at.solve, item.made(), item.run(quick)))
        except Exception as error:  # of another checkout, which may lack a feature
            answer = {"status": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    work(sys.argv[1], "--quick" in sys.argv)
