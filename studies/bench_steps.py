"""Times of a step of this checkout and of another one, taken in turn: `python -m studies.bench_steps OTHER_CHECKOUT`.

Each checkout has a process of its own, which stays alive and builds and runs the scenes below through the public face.
After a run to warm up, both are asked alternately. A time is `Solution.cost.cpu_s` over the number of steps.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import cos, pi, radians, sin, sqrt
from pathlib import Path
from typing import Any

import anctmm as at

STRIP, RUBBER = at.Rectangle(0.01, 0.01), at.Material(E=5e6, density=1000.0)
EXPLICIT, IMPLICIT, ESDIRK = "explicit", "implicit", "esdirk"
#: Step (s) and options of each method. Explicit steps cost the same at any length: short ones are stable everywhere.
METHODS: dict[str, dict[str, Any]] = {
    EXPLICIT: {"integrator": "zhai", "dt": 1e-7},
    IMPLICIT: {"integrator": "generalized-alpha", "dt": 1e-3},
    ESDIRK: {"integrator": "esdirk", "dt": 2e-3},
}
#: Share of the steps of an explicit run that runs of the other methods take.
SHARE = {EXPLICIT: 1.0, IMPLICIT: 0.1, ESDIRK: 0.05}


@dataclass(frozen=True)
class Item:
    """A scene to be timed: how it is built, run, and how many explicit steps a run takes."""

    scene: Callable[[], at.Scene]
    method: str
    steps: int
    options: dict[str, Any]

    def run(self) -> dict[str, Any]:
        """Time of a step, µs, and how the run ended."""
        options = METHODS[self.method] | self.options
        steps = max(5, round(SHARE[self.method] * self.steps))
        t_end = steps * options["dt"]
        s = at.solve(self.scene(), t_end=t_end, output_dt=t_end, **options)
        return {"us": 1e6 * s.cost.cpu_s / s.cost.steps, "status": s.status.code}


def beam(name: str, start: tuple[float, float], end: tuple[float, float]) -> at.Beam:
    """A beam of rubber."""
    return at.Beam(name, start, end, STRIP, RUBBER)


def scene(bodies: Any, joints: Any, connectors: Any = ()) -> at.Scene:
    """A scene that falls."""
    return at.Scene("bench", bodies, joints, gravity=(0.0, -9.81), connectors=connectors)


def chain(length: float = 1.0) -> at.Scene:
    """A clamped beam."""
    return scene([beam("bar", (0.0, 0.0), (length, 0.0))], [at.Clamp("bar.start")])


def springs(count: int) -> at.Scene:
    """A beam of 128 elements with springs from node to node across half of them."""
    nodes = [(2 * k + 1) * 64 // (2 * count) for k in range(count)]
    ties = [at.Spring(("bar", n / 128), ("bar", (n + 64) / 128), stiffness=5.0) for n in nodes]
    return scene(chain().bodies, chain().joints, ties)


def frame() -> at.Scene:
    """Two beams welded at 40 degrees."""
    bent = (1.0 + cos(radians(40.0)), sin(radians(40.0)))
    bodies = [beam("one", (0.0, 0.0), (1.0, 0.0)), beam("two", (1.0, 0.0), bent)]
    return scene(bodies, [at.Clamp("one.start"), at.Weld("one.end", "two.start")])


def ladder(rungs: int, joint: Any) -> at.Scene:
    """Two posts with rungs between nodes of them."""
    height = 0.2 * rungs
    posts = [beam("left", (0.0, 0.0), (0.0, height)), beam("right", (0.3, 0.0), (0.3, height))]
    steps = [beam(f"rung{k}", (0.0, 0.2 * k), (0.3, 0.2 * k)) for k in range(1, rungs + 1)]
    joints = [at.Clamp("left.start"), at.Clamp("right.start")]
    for k in range(1, rungs + 1):
        for post, end in (("left", "start"), ("right", "end")):
            joints.append(joint((post, k / rungs), f"rung{k}.{end}"))
    return scene([*posts, *steps], joints)


def tree() -> at.Scene:
    """127 beams: each carries two others in a hinge, six times over."""
    bodies, joints, tips = (
        [beam("b1", (0.0, 0.0), (0.0, 1.0))],
        [at.Clamp("b1.start")],
        {1: (0.0, 1.0, pi / 2)},
    )
    for k in range(1, 64):
        x, y, angle = tips[k]
        for n, turn in ((2 * k, 0.5), (2 * k + 1, -0.5)):
            tips[n] = x + 0.6 * cos(angle + turn), y + 0.6 * sin(angle + turn), angle + turn
            bodies.append(beam(f"b{n}", (x, y), tips[n][:2]))
        joints.append(at.Pin(f"b{k}.end", f"b{2 * k}.start", f"b{2 * k + 1}.start"))
    return scene(bodies, joints)


def four_bars(loops: int) -> at.Scene:
    """Rigid bars of 1 m and 1 kg in a row of loops, whose joints move with 1 m/s."""
    inertia = 1.0 / 12.0
    uprights = [
        at.RigidBody(f"p{i}", 1.0, inertia, (i, 0.5), {"a": (i, 0.0), "b": (i, 1.0)}, (-0.5, 0.0), 1.0)
        for i in range(loops + 1)
    ]
    levels = [
        at.RigidBody(f"g{i}", 1.0, inertia, (i + 0.5, 1.0), {"a": (i, 1.0), "b": (i + 1, 1.0)}, (-1.0, 0.0))
        for i in range(loops)
    ]
    joints = [at.Pin(f"p{i}.a") for i in range(loops + 1)]
    for i in range(loops + 1):
        meeting = [f"g{i - 1}.b"] * (i > 0) + [f"g{i}.a"] * (i < loops)
        joints.append(at.Pin(f"p{i}.b", *meeting))
    return scene([*uprights, *levels], joints)


def paper() -> at.Scene:
    """The paper's four-bar (Rong 2014, Table 1)."""
    places = (0.0, 0.0), (0.2, 0.0), (0.2 + 0.45 * sqrt(3.0), 0.45), (0.2 + 0.3 * sqrt(3.0), 0.0)
    bodies = []
    for k, (name, d, mass, E) in enumerate(
        [("crank", 0.04, 0.6811, 1e9), ("coupler", 0.05, 2.474, 5e6), ("follower", 0.03, 1.470, 5e8)]
    ):
        start, end, section = places[k], places[k + 1], at.Circle(d)
        density = mass / (section.area * at.distance(start, end))
        bodies.append(at.Beam(name, start, end, section, at.Material(E=E, density=density)))
    joints = [
        at.Clamp("crank.start", angle=at.Quintic(2.0 * pi, 2.0)),
        at.Pin("crank.end", "coupler.start"),
        at.Pin("coupler.end", "follower.start"),
        at.Pin("follower.end"),
    ]
    return at.Scene("four-bar", bodies, joints)


def items() -> dict[str, Item]:
    """Everything that is timed, by name."""
    found: dict[str, Item] = {}

    def add(
        name: str,
        made: Callable[[], at.Scene],
        steps: int,
        methods: Any = (EXPLICIT, IMPLICIT),
        **options: Any,
    ) -> None:
        found.update({f"{name}, {method}": Item(made, method, steps, options) for method in methods})

    for element in ("cable", "shear"):
        for mesh in (8, 32, 128):
            add(f"{element} chain of {mesh}", chain, 160_000 // mesh, mesh=mesh, element=element)
    add("cable chain of 32", chain, 8_000, [ESDIRK], mesh=32)
    for element in ("shear", "cable"):
        add(f"paper's four-bar, {element}", paper, 8_000, mesh=8, element=element)
    for mesh in (8, 32):
        add(f"frame welded at 40 degrees, 2 x {mesh}", frame, 64_000 // mesh, mesh=mesh)
    add("welded ladder of 10", partial(ladder, 10, at.Weld), 1_000, mesh=_ladder_mesh(10))
    for rungs in (10, 100):
        add(
            f"hinged ladder of {rungs}",
            partial(ladder, rungs, at.Pin),
            10_000 // rungs,
            mesh=_ladder_mesh(rungs),
        )
    add("tree of 127 beams", tree, 500, mesh=2)
    for loops in (1, 40):
        add(f"{loops} rigid four-bar{'s' * (loops > 1)}", partial(four_bars, loops), 20_000 // loops)
    for count in (1, 8, 64):
        add(f"{count} spring{'s' * (count > 1)} across 128 cables", partial(springs, count), 1_500, mesh=128)
    for element in ("cable", "quintic", "shear"):
        for mesh, steps in ((1_000, 200), (1_000_000, 5)):
            made = partial(chain, 0.05 * mesh)
            add(f"{element} chain of {mesh:,}", made, steps, mesh=mesh, element=element)
    return found


def _ladder_mesh(rungs: int) -> dict[str, int]:
    return {"left": rungs, "right": rungs} | {f"rung{k}": 2 for k in range(1, rungs + 1)}


class Worker:
    """A process that imports one checkout and runs items on demand."""

    def __init__(self, checkout: Path) -> None:
        environment = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-P", __file__, "--worker", str(checkout)]
        self.process = subprocess.Popen(
            command, env=environment, cwd=checkout, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def run(self, name: str) -> dict[str, Any]:
        """Run an item."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(name, file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline()
        if not answer:
            raise SystemExit(f"the process of {self.process.args!r} ended at {name!r}")
        return dict(json.loads(answer))


def work(checkout: str) -> None:
    """Answer names of items, a line each, by their times."""
    if Path(checkout).resolve() not in Path(at.__file__).resolve().parents:
        raise SystemExit(f"anctmm is imported from {at.__file__}, not from {checkout}")
    known = items()
    for line in sys.stdin:
        try:
            answer = known[line.strip()].run()
        except Exception as error:  # of either checkout, which may lack a feature
            answer = {"us": float("nan"), "status": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


def main() -> None:
    """Print a table: median time of a step here and there with half the interquartile range, and their ratio."""
    parser = argparse.ArgumentParser(prog="python -m studies.bench_steps", description=__doc__)
    parser.add_argument("other", help="directory of the other checkout")
    parser.add_argument("--only", default="", help="items whose name contains this text")
    parser.add_argument("--repeats", type=int, default=7, help="runs of each, 7 or more (default 7)")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        return work(given.other)
    names = [name for name in items() if given.only in name]
    if not names:
        parser.error(f"--only {given.only!r} fits no item; items are {'; '.join(items())}")
    if not (Path(given.other) / "anctmm").is_dir() or given.repeats < 7:
        parser.error("a checkout that has a folder anctmm, and 7 repeats or more, are needed")
    workers = [Worker(Path(path).resolve()) for path in (Path(__file__).parents[1], given.other)]
    print(f"{'time of a step, µs':42s}{'here':>22s}{'other':>22s}{'ratio':>8s}")
    for name in names:
        first = [worker.run(name) for worker in workers]  # compiles and warms up
        turns = [[worker.run(name)["us"] for worker in workers] for _ in range(given.repeats)]
        here, other = (_spread([turn[k] for turn in turns]) for k in (0, 1))
        bad = {run["status"] for run in first} - {"ok"}
        ratio, note = here[0] / other[0], f"  {'; '.join(sorted(bad))}" if bad else ""
        shown = "".join(f"{f'{median:.4g} ± {half:.2g}':>22s}" for median, half in (here, other))
        print(f"{name:42s}{shown}{ratio:8.2f}{note}", flush=True)
    return None


def _spread(times: list[float]) -> tuple[float, float]:
    """Median and half of the interquartile range."""
    times = sorted(times)
    n = len(times)
    return times[n // 2], 0.5 * (times[3 * n // 4] - times[n // 4])


if __name__ == "__main__":
    main()
