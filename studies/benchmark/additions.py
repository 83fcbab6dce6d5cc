"""What one spring, mass, guide or weld adds to a step of a beam of a hundred elements.

Explicit steps cost what they cost whatever moves. Newton's corrections and factorizations depend on the motion: so the
implicit runs are of one motion, along the beam, which a guide along it, a mass of 1e-12 of the beam's and a spring as
soft do not change. Then corrections are equal in number, and so told.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import pandas as pd

from anctmm.model.bodies import Beam
from anctmm.model.connectors import Spring
from anctmm.model.joints import Clamp, Pin, Slider
from anctmm.model.rigid_bodies import PointMass
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from anctmm.solve import solve
from studies.engine.clock import Effort, Samples, between, figures, ratio, sampled_in_turn
from studies.engine.setting import MATERIAL, SECTION, explicit_run, implicit_run
from studies.engine.tables import Table

#: Elements of the beam, its length (m), steps of both integrators (s).
ELEMENTS, LENGTH, EXPLICIT_DT, IMPLICIT_DT = 100, 1.0, 1e-6, 1e-3
#: Of the beam's mass and its stiffness: what does not change a motion that rounding can be told from.
FAINT = 1e-12
PLAIN = "nothing"
#: Part of a step that each may add.
MOST_ADDED = 0.03


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
    for integrator, steps in (("zhai", 10_000), ("generalized-alpha", 100)):
        seen: dict[str, list[Solution]] = {}
        samplers = {}
        for line, found in (("axis", scenes()), ("tilted", scenes(turned=True))):
            for name, scene in found.items():
                label = f"{name}, {line}"
                seen[label] = []
                count = max(10, round(effort.steps * steps))
                samplers[label] = between(runner(scene, integrator), count, 1.0, seen[label], 3)
        times = sampled_in_turn(f"additions, {integrator}", samplers, 3 * effort.rounds, samples)
        for label, values in times.items():
            name, line = label.split(", ")
            last = seen[label][-1]
            rows.append({
                "integrator": integrator, "added": name, "along": line, **figures(values),
                "ratio": ratio(values, times[f"{PLAIN}, {line}"]),
                "corrections": last.cost.newton_iterations, "factorizations": last.cost.factorizations,
                "status": str(last.status),
            })  # fmt: skip
    notes = (
        f"A clamped beam of {ELEMENTS} cables that hangs along gravity, along an axis or tilted; steps of "
        f"{EXPLICIT_DT:g} s and {IMPLICIT_DT:g} s. ns: CPU time of a step; ratio: to the beam alone, same round.",
        f"Mass and spring are {FAINT:g} of the beam's, and the slider's line that of the motion: all motions are one, "
        "and Newton's corrections and factorizations equal in number.",
    )
    return Table(
        "additions", "What one thing adds to a step of a hundred elements", pd.DataFrame(rows), notes
    )


def runner(scene: Scene, integrator: str) -> Callable[[int], Solution]:
    """A call that does so many steps."""
    if integrator == "zhai":
        return lambda steps: solve(scene, explicit_run(scene, ELEMENTS, steps, EXPLICIT_DT))
    return lambda steps: solve(scene, implicit_run(scene, ELEMENTS, steps, IMPLICIT_DT))
