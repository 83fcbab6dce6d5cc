"""What a tree and ladders of beams cost beside chains of as many beams, and beside the global solver.

A chain is a zigzag of equal beams, clamped at its start, under gravity, as the others are: so many joints of the same
kind, and a motion as lively. Explicit steps cost what they cost whatever moves. Newton's corrections depend on the
motion: so the implicit runs are compared by correction as well as by step.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from anctmm.model.joints import Clamp, Joint, Pin, Weld
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from anctmm.solve import solve
from reference import global_dae
from studies.benchmark.branched import Graph, add_ladder, add_tree, add_zigzag
from studies.benchmark.peers import OURS, SPARSE
from studies.engine.measuring.clock import Effort, Samples, between, figures, ratio, sampled_in_turn
from studies.engine.measuring.setting import (
    ELEMENT_LENGTH,
    GRAVITY,
    MATERIAL,
    SECTION,
    explicit_run,
    implicit_run,
    stable_step,
)
from studies.engine.tables import Table

#: Elements of each beam, beams of the tree, rungs of the ladders; of a quick run.
MESH, TREE, QUICK_TREE = 4, 1000, 127
RUNGS, QUICK_RUNGS = (10, 100, 1000), (10, 100)
#: Step of the implicit runs, s.
IMPLICIT_DT = 1e-3
JOINTS: Mapping[str, Callable[..., Joint]] = {"hinged": Pin, "welded": Weld}
CHAIN, TREES, LADDER = "chain", "tree", "ladder"
#: Rounds in which the global solver takes part: each of its runs orders and factors its matrix anew, in seconds.
ROUNDS, QUICK_ROUNDS = 3, 1
OPTIONS: dict[str, Any] = {"element": "cable"}


@dataclass(frozen=True)
class Framework:
    """Beams that are joined in one way.

    Parameters
    ----------
    kind : str
        CHAIN, TREES or LADDER.
    joints : str
        Of `JOINTS`.
    size : int
        Beams; of a ladder its rungs.
    """

    kind: str
    joints: str
    size: int

    @property
    def beams(self) -> int:
        """Beams: of a ladder its rungs, and one less in either rail."""
        return 3 * self.size - 2 if self.kind == LADDER else self.size

    @property
    def elements(self) -> int:
        """Elements of all beams."""
        return MESH * self.beams

    @property
    def label(self) -> str:
        """As the table of samples calls it."""
        return f"{self.kind} of {self.beams} beams"

    @property
    def chain(self) -> "Framework":
        """The chain of as many beams."""
        return Framework(CHAIN, self.joints, self.beams)

    def scene(self) -> Scene:
        """The scene: clamped at the start of its first beam, under gravity."""
        add, first = {CHAIN: (add_zigzag, "z0"), TREES: (add_tree, "t0_0"), LADDER: (add_ladder, "r0")}[
            self.kind
        ]
        graph = add(Graph(SECTION, MATERIAL), self.size, MESH * ELEMENT_LENGTH)
        return graph.scene(self.label, JOINTS[self.joints], Clamp(f"{first}.start"), gravity=GRAVITY)

    def runner(self, solver: Callable[..., Solution], integrator: str) -> Callable[[int], Solution]:
        """A call that does so many steps."""
        scene = self.scene()
        if integrator == "zhai":
            few = Framework(
                CHAIN, self.joints, 2
            ).scene()  # of the same elements, and so of the same largest step
            dt = stable_step(few, MESH, OPTIONS)
            return lambda steps: solver(scene, explicit_run(scene, MESH, steps, dt, **OPTIONS))
        return lambda steps: solver(scene, implicit_run(scene, MESH, steps, IMPLICIT_DT, **OPTIONS))


def topology_costs(effort: Effort, samples: Samples) -> Table:
    """Times of an element and step of the tree and of ladders beside those of chains and of the global solver."""
    rows = []
    for integrator, joints in product(("zhai", "generalized-alpha"), JOINTS):
        rows += _rows(integrator, joints, effort, samples)
    notes = (
        f"Frameworks of equal beams of {MESH} cables, clamped at the start of one, under gravity: a zigzag chain, a "
        "binary tree, a ladder of squares. The chain has as many beams, and joints of the same kind. Steps: the same "
        f"for all, {IMPLICIT_DT:g} s implicit.",
        "ns: CPU time of an element and step, by the difference of a run and one three times as long, so that start-up "
        "is left out; all frameworks with one integrator and one kind of joint in turn. ratio: to the chain, of the "
        "same round; ratio_length: to the ladder that costs least an element.",
        "Newton's corrections are not the same in all motions: ratio_iteration and ratio_length_iteration are those "
        "of an element and correction, factorizations included.",
        f"ns_dae: of the global solver (linear_algebra={SPARSE!r}); ratio_dae: its time over ANC-TMM's, in a contest "
        "of these two.",
    )
    title = "Trees and ladders beside chains and the global solver"
    return Table("topology", title, pd.DataFrame(rows), notes)


def _rows(integrator: str, joints: str, effort: Effort, samples: Samples) -> list[dict[str, Any]]:
    """Rows of one integrator and one kind of joint."""
    tree, rungs = (QUICK_TREE, QUICK_RUNGS) if effort.quick else (TREE, RUNGS)
    ladders = [Framework(LADDER, joints, n) for n in rungs]
    frameworks = [Framework(TREES, joints, tree), *ladders]
    both = [one for f in frameworks for one in (f, f.chain)]
    seen: dict[str, list[Solution]] = {f.label: [] for f in both}
    samplers = {f.label: _sampler(f, integrator, seen[f.label]) for f in both}
    found = sampled_in_turn(f"topology, {integrator}, {joints}", samplers, effort.rounds, samples)
    least = min(ladders, key=lambda f: figures(found[f.label])["ns"])
    rows = []
    for f in frameworks:
        mine, chains = _of_step(seen[f.label]), _of_step(seen[f.chain.label])
        more = mine["newton"] / chains["newton"]
        row: dict[str, Any] = {
            "scene": f.kind, "joints": joints, "integrator": integrator, "beams": f.beams, "elements": f.elements,
            "coordinates": seen[f.label][1].dofs, **figures(found[f.label]),
            "ratio": ratio(found[f.label], found[f.chain.label]),
            "ratio_length": ratio(found[f.label], found[least.label]) if f.kind == LADDER else np.nan,
            "ns_chain": figures(found[f.chain.label])["ns"],
            "spread_chain": figures(found[f.chain.label])["spread"],
            "newton_per_step": mine["newton"], "newton_chain": chains["newton"],
            "factorizations_per_step": mine["factorizations"], "factorizations_chain": chains["factorizations"],
        }  # fmt: skip
        row["ratio_iteration"] = row["ratio"] / more
        fewer = _of_step(seen[least.label])["newton"] / mine["newton"]
        row["ratio_length_iteration"] = row["ratio_length"] * fewer
        ended = [s for name in (f.label, f.chain.label) for s in seen[name]]
        rows.append(row | _beside_the_global_solver(f, integrator, effort, samples, ended))
    return rows


def _beside_the_global_solver(
    f: Framework, integrator: str, effort: Effort, samples: Samples, ended: list[Solution]
) -> dict[str, Any]:
    """Its time, and the status of all runs."""
    runs: dict[str, list[Solution]] = {OURS: [], SPARSE: []}
    theirs = partial(global_dae.solve, linear_algebra=SPARSE)
    bad = [f"{s.solver} {s.status}" for s in ended if not s.status.ok]
    steps, rounds = _steps(f, integrator), QUICK_ROUNDS if effort.quick else ROUNDS
    samplers = {
        name: between(f.runner(solver, integrator), steps, f.elements, runs[name], _again(f, integrator))
        for name, solver in ((OURS, solve), (SPARSE, theirs))
    }
    part = f"topology, {integrator}, {f.joints}, {f.label}"
    found = sampled_in_turn(part, samplers, rounds, samples)
    shown = figures(found[SPARSE])
    bad += [f"{s.solver} {s.status}" for s in (*runs[OURS], *runs[SPARSE]) if not s.status.ok]
    return {
        "ns_dae": shown["ns"],
        "spread_dae": shown["spread"],
        "repeats_dae": shown["repeats"],
        "newton_dae": _of_step(runs[SPARSE])["newton"],
        "ratio_dae": ratio(found[SPARSE], found[OURS]),
        "status": bad[0] if bad else "ok",
    }


def _steps(f: Framework, integrator: str) -> int:
    """Steps of a short run: of an implicit one as many for all, since Newton's corrections change with time."""
    return max(10, min(2500, round(3e5 / f.elements))) if integrator == "zhai" else 8


def _again(f: Framework, integrator: str) -> int:
    """Pairs of runs of a sample: short implicit ones are repeated until they last some milliseconds."""
    return max(1, min(10, 10_000 // f.elements)) if integrator != "zhai" else 1


def _sampler(f: Framework, integrator: str, seen: list[Solution]) -> Callable[[], float]:
    """Sampler of an element and step."""
    steps = _steps(f, integrator)
    return between(f.runner(solve, integrator), steps, f.elements, seen, _again(f, integrator))


def _of_step(seen: list[Solution]) -> dict[str, float]:
    """Newton's corrections and factorizations of a step; NaN of explicit ones."""
    short, whole = (s.cost for s in seen)
    steps = whole.steps - short.steps
    newton = (whole.newton_iterations - short.newton_iterations) / steps
    factorizations = (whole.factorizations - short.factorizations) / steps
    return {"newton": newton or np.nan, "factorizations": factorizations if newton else np.nan}
