"""What one spring, mass or guide adds to a step of a beam of a hundred elements.

Explicit steps cost what they cost whatever moves. Newton's corrections and factorizations depend on the motion: so the
implicit runs are of one motion, along the beam, which a guide along it, a mass of 1e-12 of the beam's and a spring as
soft do not change. Then corrections are equal in number, and so told.

What is looked for, some 3 % of a step, is less than what other work on a machine adds to most samples, and than what it
matters where in memory the arrays of a run lie. Both are evened out: samples are many and short, each with its arrays
at other places, and what counts is a low quantile, as nothing makes a step faster than it is. Where the code itself
lies matters as much, and that stays as long as a process does: so several processes measure, each for itself, one after
another, and what counts of their ratios is the median.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from anctmm.model.bodies import Beam
from anctmm.model.connectors import Spring
from anctmm.model.joints import Clamp, Pin, Slider
from anctmm.model.rigid_bodies import PointMass
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from anctmm.solve import solve
from studies.engine.measuring.clock import Effort, Sampler, Samples, more_than_noise
from studies.engine.measuring.setting import MATERIAL, SECTION, explicit_run, implicit_run
from studies.engine.measuring.timing import in_turn
from studies.engine.running.pool import in_new_process
from studies.engine.tables import Table

#: Elements of the beam, its length (m), steps of both integrators (s).
ELEMENTS, LENGTH, EXPLICIT_DT, IMPLICIT_DT = 100, 1.0, 1e-6, 1e-3
#: Part of the beam's mass and stiffness that changes its motion by no more than rounding.
FAINT = 1e-12
PLAIN = "nothing"
#: Part of a step that each may add.
MOST_ADDED = 0.03
#: Steps of a short run of each integrator: some 2 ms; how many times as many a long one has.
STEPS, LONGER = {"zhai": 400, "generalized-alpha": 100}, 3
#: Processes that measure, and the runs of each length in each of them.
PROCESSES, QUICK_PROCESSES, ROUNDS, QUICK_ROUNDS = 9, 2, 40, 8
#: What is taken of their times; arrays that lie beside those of a run, and their size, at most.
LOW, PADS, PAD = 0.1, 12, 700


class Measured(NamedTuple):
    """What one process has measured with one integrator.

    Parameters
    ----------
    times : mapping of str to list of float
        Of the runs of each label and length, ns.
    of_step : mapping of str to float
        CPU time of a step by label, ns.
    counts : mapping of str to tuple
        Newton's corrections, factorizations and status of the last run of each label.
    """

    times: Mapping[str, list[float]]
    of_step: Mapping[str, float]
    counts: Mapping[str, tuple[int, int, str]]


def scenes(turned: bool = False) -> dict[str, Scene]:
    """The clamped beam alone and with each addition, hanging along gravity; `turned` lies in no axis."""
    x, y = (0.6, -0.8) if turned else (0.0, -1.0)
    beam = Beam("beam", (0.0, 0.0), (LENGTH * x, LENGTH * y), SECTION, MATERIAL)
    tip, clamp = (LENGTH * x, LENGTH * y), Clamp("beam.start")
    mass = PointMass("mass", FAINT * MATERIAL.density * SECTION.area * LENGTH, tip)
    spring = Spring(
        "beam.end", (2.0 * tip[0], 2.0 * tip[1]), stiffness=FAINT * MATERIAL.E * SECTION.area / LENGTH
    )
    make = partial(Scene, gravity=(9.81 * x, 9.81 * y))
    return {
        PLAIN: make("plain", [beam], [clamp]),
        "a grounded spring": make("spring", [beam], [clamp], connectors=[spring]),
        "a tip mass": make("mass", [beam, mass], [clamp, Pin("beam.end", "mass.center")]),
        "a slider": make("slider", [beam], [clamp, Slider("beam.end", direction=(x, y))]),
    }


def added_costs(effort: Effort, samples: Samples) -> Table:
    """Times of a step with each addition beside one without, in several processes, in each of them all in turn."""
    processes = QUICK_PROCESSES if effort.quick else PROCESSES
    rounds = QUICK_ROUNDS if effort.quick else ROUNDS
    rows: list[dict[str, Any]] = []
    for integrator in STEPS:
        for process in range(processes):
            found: Measured = in_new_process(measured, integrator, ELEMENTS, rounds, process)
            for label, values in found.times.items():
                samples.keep(f"additions, {integrator}, process {process}", label, values)
            rows += _rows(integrator, found)
    frame = _summary(pd.DataFrame(rows)).assign(processes=processes, repeats=rounds)
    notes = (
        f"A clamped beam of {ELEMENTS} cables that hangs along gravity, along an axis or tilted; steps of "
        f"{EXPLICIT_DT:g} s and {IMPLICIT_DT:g} s. In each process: CPU time of a step, from the {LOW:.0%} quantiles "
        "of runs of two lengths, all in turn, the arrays of each run at other places in memory.",
        "Of the processes, one after another: ns: median of these times; ratio: median of the ratios to the beam "
        "alone; least, most: their range, as they differ by where the code of a process lies.",
        f"Mass and spring are {FAINT:g} of the beam's, and the slider's line that of the motion: all motions are one, "
        "and Newton's corrections and factorizations equal in number.",
    )
    return Table("additions", "What one thing adds to a step of a hundred elements", frame, notes)


def measured(integrator: str, elements: int, rounds: int, process: int) -> Measured:
    """Times of a step of all scenes, in turn, in this process.

    Parameters
    ----------
    integrator : str
    elements : int
        Of the beam.
    rounds : int
        Runs of each length.
    process : int
        Its number: each has arrays of other sizes beside those of its runs.
    """
    steps, seen = STEPS[integrator], dict[str, Solution]()
    times = in_turn(_samplers(integrator, elements, process, seen), rounds)
    of_step = {label: _of_step(times[f"{label}, short"], times[f"{label}, long"], steps) for label in seen}
    counts = {
        label: (last.cost.newton_iterations, last.cost.factorizations, str(last.status))
        for label, last in seen.items()
    }
    return Measured(times, of_step, counts)


def _rows(integrator: str, found: Measured) -> list[dict[str, Any]]:
    """What one process has found, a row a scene."""
    rows = []
    for label, ns in found.of_step.items():
        name, line = label.split(", ")
        corrections, factorizations, status = found.counts[label]
        rows.append({
            "integrator": integrator, "added": name, "along": line, "ns": ns,
            "ratio": ns / found.of_step[f"{PLAIN}, {line}"],
            "corrections": corrections, "factorizations": factorizations, "status": status,
        })  # fmt: skip
    return rows


def _summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Of the rows of all processes one for each scene; times lost in noise, NaN, are left out."""
    scenes = rows.groupby(["integrator", "added", "along"], sort=False)
    return scenes.agg(
        ns=("ns", "median"),
        ratio=("ratio", "median"),
        least=("ratio", "min"),
        most=("ratio", "max"),
        corrections=("corrections", "max"),
        factorizations=("factorizations", "max"),
        status=("status", _worst),
    ).reset_index()


def _worst(statuses: pd.Series) -> str:
    """The first status that is not "ok", if there is one."""
    return str(next((status for status in statuses if status != "ok"), "ok"))


def _samplers(integrator: str, elements: int, process: int, seen: dict[str, Solution]) -> dict[str, Sampler]:
    """Samplers of short and of long runs of all scenes."""
    samplers = dict[str, Sampler]()
    for line, found in (("axis", scenes()), ("tilted", scenes(turned=True))):
        for name, scene in found.items():
            label, run = f"{name}, {line}", runner(scene, integrator, elements)
            for length, count in (("short", STEPS[integrator]), ("long", LONGER * STEPS[integrator])):
                places = np.random.default_rng([process, len(samplers)])
                samplers[f"{label}, {length}"] = _sampler(run, count, places, seen, label)
    return samplers


def _sampler(
    run: Callable[[int], Solution],
    steps: int,
    places: np.random.Generator,
    seen: dict[str, Solution],
    label: str,
) -> Sampler:
    """Sampler of whole runs, ns; the last one is left in `seen`, without its history."""

    def sample() -> float:
        # arrays that push those of the run aside
        beside = [np.empty(size) for size in places.integers(2, PAD, PADS)]
        found = run(steps)
        del beside
        seen[label] = replace(found, fields={})
        return 1e9 * found.cost.cpu_s

    return sample


def _of_step(short: Sequence[float], long: Sequence[float], steps: int) -> float:
    """CPU time of a step, ns, by low quantiles of runs of so many steps and of longer ones."""
    return more_than_noise(float(np.quantile(long, LOW) - np.quantile(short, LOW)) / ((LONGER - 1) * steps))


def runner(scene: Scene, integrator: str, elements: int) -> Callable[[int], Solution]:
    """A call that does so many steps of a beam of so many elements."""
    if integrator == "zhai":
        return lambda steps: solve(scene, explicit_run(scene, elements, steps, EXPLICIT_DT))
    return lambda steps: solve(scene, implicit_run(scene, elements, steps, IMPLICIT_DT))
