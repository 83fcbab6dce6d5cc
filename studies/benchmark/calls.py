"""What a call of `solve` costs beside its steps, of small scenes in short runs: there it counts.

A process that has run the rest of the benchmark holds hundreds of scenes, and its calls take a few percent longer. So a
new process measures, in which a user's first study runs, too.
"""

from collections.abc import Callable, Mapping
from itertools import count
from math import pi
from typing import Any

import pandas as pd

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.bodies import Material
from anctmm.model.drives import Quintic
from anctmm.model.scene import Beam, Clamp, Joint, Pin, RigidBody, Scene, Weld
from anctmm.model.sections import Circle
from anctmm.results.solution import Solution
from anctmm.solve import solve
from studies.engine.measuring.clock import Effort, Samples, figures
from studies.engine.measuring.timing import in_turn
from studies.engine.running.pool import in_new_process
from studies.engine.tables import Table

#: Short runs, as `recommend` takes them for errors of some percent.
RUNS = {
    "zhai": Discretisation(mesh=4, integrator="zhai", dt=2e-5, t_end=0.02, output_dt=0.01),
    "generalized-alpha": Discretisation(mesh=4, dt=2e-3, t_end=0.02, output_dt=0.01),
}
AGAIN, STIFFER, LARGER = "the same scene again", "another stiffness", "other lengths and masses"
#: Part by which a number differs from that of the scene before.
STEP = 1e-3
#: Calls for each round of other contests: these are short.
CALLS = 5
#: What a call of a scene that was solved before may take beside its steps, s.
MOST_BUILD = 2e-4


def call_costs(effort: Effort, samples: Samples) -> Table:
    """Times of steps and of all else that a call does, of a scene again and of fresh scenes with other numbers."""
    rows, kept = in_new_process(measured, effort)
    samples.rows += kept.rows
    notes = (
        "cpu_s, build_s: medians of the CPU time of the steps and of all else in the call of `solve`, s; spreads are "
        "(largest − smallest) / median. Calls of one scene and integrator are made in turn, all in one new process.",
        "A fresh scene differs from all before it in its numbers alone: in its stiffness, or in all lengths and "
        "masses. To make the scene itself is not counted.",
    )
    return Table("calls", "What a call costs beside its steps", pd.DataFrame(rows), notes)


def measured(effort: Effort) -> tuple[list[dict[str, Any]], Samples]:
    """Rows of all scenes and integrators, and the samples that they come from, measured in this process."""
    samples = Samples()
    rows = [
        row
        for name, make in SCENES.items()
        for integrator, run in RUNS.items()
        for row in _costs(name, make, integrator, run, effort, samples)
    ]
    return rows, samples


def _costs(
    name: str,
    make: Callable[[float, float], Scene],
    integrator: str,
    run: Discretisation,
    effort: Effort,
    samples: Samples,
) -> list[dict[str, Any]]:
    """Rows of a scene and an integrator."""
    same, numbers = make(1.0, 1.0), count(1)
    calls: Mapping[str, Callable[[], Solution]] = {
        AGAIN: lambda: solve(same, run),
        STIFFER: lambda: solve(make(1.0 + STEP * next(numbers), 1.0), run),
        LARGER: lambda: solve(make(1.0, 1.0 + STEP * next(numbers)), run),
    }
    warm = {call: lambda answer=answer: [answer() for _ in range(3)] for call, answer in calls.items()}
    rows = []
    for call, answers in in_turn(calls, CALLS * effort.rounds, warm).items():
        times = {what: [1e9 * getattr(s.cost, f"{what}_s") for s in answers] for what in ("cpu", "build")}
        for what, values in times.items():
            samples.keep(f"calls, {name}, {integrator}", f"{call}: {what}", values)
        cpu, build = map(figures, times.values())
        rows.append({
            "scene": name, "integrator": integrator, "call": call, "steps": answers[-1].cost.steps,
            "cpu_s": 1e-9 * cpu["ns"], "cpu_spread": cpu["spread"],
            "build_s": 1e-9 * build["ns"], "build_spread": build["spread"], "repeats": build["repeats"],
            "status": next((str(s.status) for s in answers if not s.status.ok), "ok"),
        })  # fmt: skip
    return rows


def _beam(
    name: str, start: tuple[float, float], end: tuple[float, float], stiffness: float, size: float
) -> Beam:
    """A rod of rubber."""
    (x, y), (u, v) = start, end
    rubber = Material(E=5e6 * stiffness, density=1100.0)
    return Beam(name, (size * x, size * y), (size * u, size * v), Circle(0.02 * size), rubber)


def _hung(bodies: list[Any], joints: list[Joint]) -> Scene:
    return Scene("call", bodies, joints, gravity=(0.0, -9.81))


def _pendulum(stiffness: float, size: float) -> Scene:
    return _hung([_beam("arm", (0.0, 0.0), (1.0, 0.0), stiffness, size)], [Pin("arm.start")])


def _driven(stiffness: float, size: float) -> Scene:
    drive = Clamp("arm.start", angle=Quintic(turn=pi / 2, duration=1.0))
    return _hung([_beam("arm", (0.0, 0.0), (1.0, 0.0), stiffness, size)], [drive])


def _plate(stiffness: float, size: float) -> Scene:
    arm = _beam("arm", (0.0, 0.0), (0.5, 0.0), stiffness, size)
    points = {"a": (0.5 * size, 0.0), "b": (0.7 * size, 0.2 * size)}
    plate = RigidBody("plate", 0.5 * size**3, 3.3e-3 * size**5, (0.6 * size, 0.1 * size), points)
    return _hung([arm, plate], [Pin("arm.start"), Pin("arm.end", "plate.a")])


def _fork(stiffness: float, size: float) -> Scene:
    ends = {
        "trunk": ((0.0, 0.0), (0.0, 0.3)),
        "left": ((0.0, 0.3), (-0.2, 0.5)),
        "right": ((0.0, 0.3), (0.2, 0.5)),
    }
    beams = [_beam(name, start, end, stiffness, size) for name, (start, end) in ends.items()]
    return _hung(beams, [Clamp("trunk.start"), Weld("trunk.end", "left.start", "right.start")])


#: (factor of the stiffness, factor of all lengths) → scene, by name.
SCENES: Mapping[str, Callable[[float, float], Scene]] = {
    "pendulum": _pendulum,
    "driven arm": _driven,
    "arm and plate": _plate,
    "fork": _fork,
}
