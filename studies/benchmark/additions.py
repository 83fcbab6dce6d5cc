"""What one spring, mass or guide adds to a step of a beam of a hundred elements.

Explicit steps cost what they cost whatever moves. Newton's corrections and factorizations depend on the motion: so the
implicit runs are of one motion, along the beam, which a guide along it, a mass of 1e-12 of the beam's and a spring as
soft do not change. Then corrections are equal in number, and so told.

What is looked for, some 3 % of a step, is less than what other work on a machine adds to most samples, and than what it
matters where in memory the arrays of a run lie. Both are evened out: samples are many and short, each with its arrays
at other places, and what counts is a low quantile, as nothing makes a step faster than it is.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from anctmm.model.bodies import Beam
from anctmm.model.connectors import Spring
from anctmm.model.joints import Clamp, Pin, Slider
from anctmm.model.rigid_bodies import PointMass
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from anctmm.solve import solve
from studies.engine.measuring.clock import Effort, Sampler, Samples, more_than_noise, sampled_in_turn
from studies.engine.measuring.setting import MATERIAL, SECTION, explicit_run, implicit_run
from studies.engine.tables import Table

#: Elements of the beam, its length (m), steps of both integrators (s).
ELEMENTS, LENGTH, EXPLICIT_DT, IMPLICIT_DT = 100, 1.0, 1e-6, 1e-3
#: Of the beam's mass and its stiffness: what does not change a motion that rounding can be told from.
FAINT = 1e-12
PLAIN = "nothing"
#: Part of a step that each may add.
MOST_ADDED = 0.03
#: Steps of a short run of each integrator: some 2 ms; how many times as many a long one has.
STEPS, LONGER = {"zhai": 400, "generalized-alpha": 100}, 3
#: Runs of each length; what is taken of their times; arrays that lie beside those of a run, and their size, at most.
ROUNDS, QUICK_ROUNDS, LOW, PADS, PAD = 200, 15, 0.1, 12, 700


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
    """Times of a step with each addition beside one without, all in turn."""
    rows: list[dict[str, Any]] = []
    for integrator, steps in STEPS.items():
        seen: dict[str, Solution] = {}
        rounds = QUICK_ROUNDS if effort.quick else ROUNDS
        samplers = _samplers(integrator, steps, seen)
        times = sampled_in_turn(f"additions, {integrator}", samplers, rounds, samples)
        of_step = {
            label: _of_step(times[f"{label}, short"], times[f"{label}, long"], steps) for label in seen
        }
        for label, last in seen.items():
            name, line = label.split(", ")
            rows.append({
                "integrator": integrator, "added": name, "along": line, **of_step[label], "repeats": rounds,
                "ratio": of_step[label]["ns"] / of_step[f"{PLAIN}, {line}"]["ns"],
                "corrections": last.cost.newton_iterations, "factorizations": last.cost.factorizations,
                "status": str(last.status),
            })  # fmt: skip
    notes = (
        f"A clamped beam of {ELEMENTS} cables that hangs along gravity, along an axis or tilted; steps of "
        f"{EXPLICIT_DT:g} s and {IMPLICIT_DT:g} s. ns: CPU time of a step, from the {LOW:.0%} quantiles of runs of "
        "two lengths, all in turn, the arrays of each run at other places in memory; median: from their medians; "
        "ratio: to the beam alone.",
        f"Mass and spring are {FAINT:g} of the beam's, and the slider's line that of the motion: all motions are one, "
        "and Newton's corrections and factorizations equal in number.",
    )
    return Table(
        "additions", "What one thing adds to a step of a hundred elements", pd.DataFrame(rows), notes
    )


def _samplers(integrator: str, steps: int, seen: dict[str, Solution]) -> dict[str, Sampler]:
    """Samplers of short and of long runs of all scenes."""
    samplers = {}
    for line, found in (("axis", scenes()), ("tilted", scenes(turned=True))):
        for name, scene in found.items():
            label, run = f"{name}, {line}", runner(scene, integrator)
            for length, count in (("short", steps), ("long", LONGER * steps)):
                samplers[f"{label}, {length}"] = _sampler(run, count, seen, label)
    return samplers


def _sampler(run: Callable[[int], Solution], steps: int, seen: dict[str, Solution], label: str) -> Sampler:
    """Sampler of whole runs, ns; the last one is left in `seen`, without its history."""
    places = np.random.default_rng(len(seen))

    def sample() -> float:
        # arrays that push those of the run aside
        beside = [np.empty(size) for size in places.integers(2, PAD, PADS)]
        found = run(steps)
        del beside
        seen[label] = replace(found, fields={})
        return 1e9 * found.cost.cpu_s

    return sample


def _of_step(short: Sequence[float], long: Sequence[float], steps: int) -> dict[str, float]:
    """CPU time of a step, ns, by low quantiles and by medians of runs of so many steps and of longer ones."""
    low, middle = (
        float(np.quantile(long, part) - np.quantile(short, part)) / ((LONGER - 1) * steps)
        for part in (LOW, 0.5)
    )
    return {"ns": more_than_noise(low), "median": more_than_noise(middle)}


def runner(scene: Scene, integrator: str) -> Callable[[int], Solution]:
    """A call that does so many steps."""
    if integrator == "zhai":
        return lambda steps: solve(scene, explicit_run(scene, ELEMENTS, steps, EXPLICIT_DT))
    return lambda steps: solve(scene, implicit_run(scene, ELEMENTS, steps, IMPLICIT_DT))
