"""Times of a step of this checkout and of another one, taken in turn: `python -m studies.bench_steps OTHER_CHECKOUT`.

Each checkout has a process of its own, which builds and runs the scenes below through the public face. After a run to
warm up, both are asked alternately. A time is `Solution.cost.cpu_s` over the number of steps.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import cos, pi, radians, sin, sqrt
from pathlib import Path
from statistics import median, quantiles
from subprocess import PIPE, Popen
from typing import Any

import anctmm as at

#: Share of an explicit run's steps that a method takes, and its options. Explicit steps are short, to be stable.
METHODS: dict[str, tuple[float, dict[str, Any]]] = {
    "explicit": (1.0, {"integrator": "zhai", "dt": 1e-7}),
    "implicit": (0.1, {"integrator": "generalized-alpha", "dt": 1e-3}),
    "esdirk": (0.05, {"integrator": "esdirk", "dt": 2e-3}),
}


def timed(made: Callable[[], at.Scene], method: str, steps: int, **options: Any) -> dict[str, Any]:
    """Build and run a scene; `steps` is the number of explicit steps. Time of a step, µs, and how the run ended."""
    share, usual = METHODS[method]
    t_end = max(5, round(share * steps)) * usual["dt"]
    s = at.solve(made(), t_end=t_end, output_dt=t_end, **usual, **options)
    return {"us": 1e6 * s.cost.cpu_s / s.cost.steps, "status": s.status.code}


beam = partial(at.Beam, section=at.Rectangle(0.01, 0.01), material=at.Material(E=5e6, density=1000.0))
scene = partial(at.Scene, "bench", gravity=(0.0, -9.81))


def chain(length: float = 1.0) -> at.Scene:
    """A clamped beam."""
    return scene([beam("bar", (0.0, 0.0), (length, 0.0))], [at.Clamp("bar.start")])


def springs(count: int) -> at.Scene:
    """A beam of 128 elements with springs from node to node across half of them."""
    nodes = [(2 * k + 1) * 64 // (2 * count) for k in range(count)]
    ties = [at.Spring(("bar", n / 128), ("bar", (n + 64) / 128), stiffness=5.0) for n in nodes]
    return replace(chain(), connectors=tuple(ties))


def frame() -> at.Scene:
    """Two beams welded at 40 degrees."""
    corner, tip = (1.0, 0.0), (1.0 + cos(radians(40.0)), sin(radians(40.0)))
    joints = [at.Clamp("one.start"), at.Weld("one.end", "two.start")]
    return scene([beam("one", (0.0, 0.0), corner), beam("two", corner, tip)], joints)


def ladder(rungs: int, joint: Any) -> at.Scene:
    """Two posts with rungs between nodes of them."""
    posts = [beam(name, (x, 0.0), (x, 0.2 * rungs)) for name, x in (("left", 0.0), ("right", 0.3))]
    steps = [beam(f"rung{k}", (0.0, 0.2 * k), (0.3, 0.2 * k)) for k in range(1, rungs + 1)]
    joints = [at.Clamp("left.start"), at.Clamp("right.start")]
    for post, end in (("left", "start"), ("right", "end")):
        joints += [joint((post, k / rungs), f"rung{k}.{end}") for k in range(1, rungs + 1)]
    return scene([*posts, *steps], joints)


def tree() -> at.Scene:
    """127 beams: each carries two others in a hinge, six times over."""
    bodies, tips = [beam("b1", (0.0, 0.0), (0.0, 1.0))], {1: (0.0, 1.0, pi / 2)}
    joints: list[Any] = [at.Clamp("b1.start")]
    for k in range(1, 64):
        x, y, angle = tips[k]
        for n, turn in ((2 * k, 0.5), (2 * k + 1, -0.5)):
            tips[n] = x + 0.6 * cos(angle + turn), y + 0.6 * sin(angle + turn), angle + turn
            bodies.append(beam(f"b{n}", (x, y), tips[n][:2]))
        joints.append(at.Pin(f"b{k}.end", f"b{2 * k}.start", f"b{2 * k + 1}.start"))
    return scene(bodies, joints)


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
    hinges = at.Pin("crank.end", "coupler.start"), at.Pin("coupler.end", "follower.start")
    return at.Scene("four-bar", bodies, [drive, *hinges, at.Pin("follower.end")])


def items() -> dict[str, Callable[[], dict[str, Any]]]:
    """Everything that is timed, by name."""
    found: dict[str, Callable[[], dict[str, Any]]] = {}

    def add(name: str, made: Any, steps: int, *methods: str, **options: Any) -> None:
        for method in methods or ("explicit", "implicit"):
            found[f"{name}, {method}"] = partial(timed, made, method, steps, **options)

    for element in ("cable", "shear"):
        for mesh in (8, 32, 128):
            add(f"{element} chain of {mesh}", chain, 400_000 // mesh, mesh=mesh, element=element)
    add("cable chain of 32", chain, 8_000, "esdirk", mesh=32)
    for element in ("shear", "cable"):
        add(f"paper's four-bar, {element}", paper, 8_000, mesh=8, element=element)
    for mesh in (8, 32):
        add(f"frame welded at 40 degrees, 2 x {mesh}", frame, 64_000 // mesh, mesh=mesh)
    for kind, joint, rungs in (("welded", at.Weld, 10), ("hinged", at.Pin, 10), ("hinged", at.Pin, 100)):
        meshes = {"left": rungs, "right": rungs} | {f"rung{k}": 2 for k in range(1, rungs + 1)}
        add(f"{kind} ladder of {rungs}", partial(ladder, rungs, joint), 10_000 // rungs, mesh=meshes)
    add("tree of 127 beams", tree, 500, mesh=2)
    for loops in (1, 40):
        add(f"rigid four-bars: {loops}", partial(four_bars, loops), 20_000 // loops)
    for count in (1, 8, 64):
        add(f"springs across 128 cables: {count}", partial(springs, count), 1_500, mesh=128)
    for mesh, steps in ((1_000, 500), (1_000_000, 5)):
        for element in ("cable", "quintic", "shear"):
            made = partial(chain, 0.05 * mesh)
            add(f"{element} chain of {mesh:,}", made, steps, mesh=mesh, element=element)
    return found


def worker_of(checkout: Path) -> Callable[[str], dict[str, Any]]:
    """A function that runs an item in a process of its own, which imports one checkout."""
    command = [sys.executable, "-P", __file__, "--worker", str(checkout)]
    environment = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
    process = Popen(command, env=environment, text=True, stdin=PIPE, stdout=PIPE)

    def run(name: str) -> dict[str, Any]:
        print(name, file=process.stdin, flush=True)
        answer = process.stdout.readline()  # type: ignore[union-attr]  # it is a pipe
        if not answer:
            raise SystemExit(f"the process of {checkout} ended at {name!r}")
        return dict(json.loads(answer))

    return run


def work(checkout: str) -> None:
    """Answer names of items, a line each, by their times."""
    if Path(checkout).resolve() not in Path(at.__file__).resolve().parents:
        raise SystemExit(f"anctmm is imported from {at.__file__}, not from {checkout}")
    for line in sys.stdin:
        try:
            answer = items()[line.strip()]()
        except Exception as error:  # of either checkout, which may lack a feature
            answer = {"us": float("nan"), "status": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


def main() -> None:
    """Print a table: medians with half of their interquartile range, and the median ratio of two times in turn."""
    parser = argparse.ArgumentParser(prog="python -m studies.bench_steps", description=__doc__)
    parser.add_argument("other", help="directory of the other checkout")
    parser.add_argument("--only", default="", help="items whose name contains this text")
    parser.add_argument("--repeats", type=int, default=7, help="runs of each, 7 or more")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        work(given.other)
        return
    names = [name for name in items() if given.only in name]
    if not names:
        parser.error(f"--only {given.only!r} fits no item; items are {'; '.join(items())}")
    if not (Path(given.other) / "anctmm").is_dir() or given.repeats < 7:
        parser.error("a checkout that has a folder anctmm, and 7 repeats or more, are needed")
    workers = [worker_of(Path(p).resolve()) for p in (Path(__file__).parents[1], given.other)]
    print(f"{'time of a step, µs':42s}{'here':>20s}{'other':>20s}{'ratio':>8s}")
    for name in names:
        first = [run(name) for run in workers]  # compiles and warms up
        turns = [[run(name)["us"] for run in workers] for _ in range(given.repeats)]
        shown = ""
        for times in zip(*turns, strict=True):
            low, middle, high = quantiles(times, n=4)
            shown += f"{f'{middle:.4g} ± {(high - low) / 2:.2g}':>20s}"
        ratio = median(here / other for here, other in turns)
        print(f"{name:42s}{shown}{ratio:8.2f}", *{a["status"] for a in first} - {"ok"}, flush=True)


if __name__ == "__main__":
    main()
