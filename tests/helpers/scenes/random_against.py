"""Random scenes by ANC-TMM and by another solver: is any answer "ok" and wrong?

    python tests/helpers/scenes/random_against.py [--peer global-dae|exudyn-cable] [--kind graphs|mechanisms]
        [--first 0] [--count 1000] [--out TABLE.csv]

Scenes are graphs of beams: trees and loops, in several components; mechanisms: with rigid bodies, masses, guides,
driven hinges, connectors and loads of every kind.

Both solve the same discrete equations, so that with fixed steps their histories agree to rounding, or as near as the
motion lets anything agree: where they are farther apart, a disturbance of one rounding's size shows how far that leads.
With a tolerance, the other solver's motion is that of ever smaller steps.
"""

import argparse
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from random_acting import asked_mechanism
from random_graphs import asked_graph
from random_scenes import Asked

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError
from anctmm.model.scene import Beam
from anctmm.results.solution import Solution
from anctmm.solvers import registry

#: How far histories may lie apart, of the largest displacement (1 mm at least): rounding and Newton's iterations; a
#: peer that bounds residuals leaves more.
ROUNDING = {"global-dae": 1e-8, "exudyn-cable": 1e-5}
#: Relative size of a disturbance, and its growth beyond which a motion tells nothing of a solver.
DISTURBANCE = 1e-9
#: Part of the tolerance that an error-controlled run may miss its aim by, as promised.
PROMISE = 3.0
OPTIONS = {"exudyn-cable": {"tolerances": (1e-10, 1e-10)}}
#: What is drawn.
DRAWN = {"graphs": asked_graph, "mechanisms": asked_mechanism}
AGREE, WRONG, FAILED, REFUSED, ALONE, WILD = (
    "agree", "ok and wrong", "failed", "refused", "only ours is ok", "wild",
)  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """What came of one scene: how far apart, how far they may be, relative."""

    seed: int
    what: str
    verdict: str
    apart: float = float("nan")
    allowed: float = float("nan")
    reason: str = ""


def judge(seed: int, peer: str = "global-dae", kind: str = "graphs") -> Verdict:
    """Draw a scene, run it by both, compare."""
    case = DRAWN[kind](seed, peer)
    run = case.run
    what = f"{run.integrator} {f'tolerance {run.tolerance:g} ' if run.tolerance else ''}{len(case.scene.bodies)} bodies"
    ours = _solve("anctmm", case.scene, run)
    if isinstance(ours, str):
        return Verdict(seed, what, REFUSED, reason=ours)
    if not ours.status.ok:
        return Verdict(seed, what, FAILED, reason=str(ours.status))
    theirs = _reference(peer, case)
    if isinstance(theirs, str) or not theirs[0].status.ok:
        return Verdict(seed, what, ALONE, reason=theirs if isinstance(theirs, str) else str(theirs[0].status))
    other, doubt = theirs
    scale = max(float(np.abs(_places(other)).max()), 1e-3)
    apart = _apart(ours, other) / scale
    allowed = ROUNDING[peer] if run.tolerance is None else PROMISE * run.tolerance + doubt / scale
    if apart <= allowed:
        return Verdict(seed, what, AGREE, apart, allowed)
    if run.tolerance is None and apart <= 100.0 * ROUNDING[peer] * _growth(case, ours, scale):
        return Verdict(seed, what, WILD, apart, allowed, "a disturbance grows as much")
    return Verdict(seed, what, WRONG, apart, allowed)


def _solve(name: str, scene, run, **options) -> Solution | str:
    """A solution, or why there is none; what is no error of this package is raised."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return registry.solver(name)(scene, run, **options)
    except AnctmmError as error:
        return f"{type(error).__name__}: {error}"


def _reference(peer: str, case: Asked) -> tuple[Solution, float] | str:
    """The other solver's answer, and how far it may be from its own limit, m."""
    run = case.run
    if run.tolerance is None:
        found = _solve(peer, case.scene, run, **OPTIONS.get(peer, {}))
        return found if isinstance(found, str) else (found, 0.0)
    answers = []
    for steps in (200, 400):
        fixed = Discretisation(
            run.mesh, run.element, run.quadrature, dt=run.t_end / steps, t_end=run.t_end,
            output_dt=run.output_dt, newton_tolerance=run.newton_tolerance,
            spectral_radius=run.spectral_radius,
        )  # fmt: skip
        answer = _solve(peer, case.scene, fixed, **OPTIONS.get(peer, {}))
        if isinstance(answer, str):
            return answer
        answers.append(answer)
    return answers[1], _apart(*answers) if answers[0].status.ok and answers[1].status.ok else 0.0


def _places(solution: Solution) -> np.ndarray:
    return np.stack(
        [solution.displacement(place) for body in solution.scene.bodies for place in _looked_at(body)]
    )


def _looked_at(body) -> list:
    if isinstance(body, Beam):
        return [(body.name, f) for f in (0.0, 0.3, 0.5, 1.0)]
    return [f"{body.name}.{key}" for key in body.keys]


def _apart(one: Solution, two: Solution) -> float:
    """Largest distance of any place at any output, m; infinite where one is shorter or has moved its times."""
    if one.t.shape != two.t.shape or np.abs(one.t - two.t).max() > 1e-9 * one.t[-1]:
        return float("inf")
    return float(np.linalg.norm(_places(one) - _places(two), axis=-1).max())


def _growth(case: Asked, ours: Solution, scale: float) -> float:
    """How far a disturbance of the gravity and the loads leads, in units of its own size."""
    g = case.scene.gravity
    kick = DISTURBANCE * max(10.0, *map(abs, g))
    kicked = _solve("anctmm", replace(case.scene, gravity=(g[0] + kick, g[1] + kick)), case.run)
    if isinstance(kicked, str) or not kicked.status.ok:
        return float("inf")
    return max(1.0, _apart(ours, kicked) / scale / DISTURBANCE)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--peer", default="global-dae", choices=sorted(ROUNDING))
    parser.add_argument("--kind", default="graphs", choices=sorted(DRAWN))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--out", type=Path, help="a CSV table")
    options = parser.parse_args()
    rows = []
    for seed in range(options.first, options.first + options.count):
        found = judge(seed, options.peer, options.kind)
        rows.append(vars(found))
        if found.verdict not in (AGREE, REFUSED):
            print(*vars(found).values(), sep=" | ", flush=True)
    counts = {v: sum(r["verdict"] == v for r in rows) for v in dict.fromkeys(r["verdict"] for r in rows)}
    print(", ".join(f"{n} {verdict}" for verdict, n in counts.items()))
    if options.out:
        pd.DataFrame(rows).to_csv(options.out, index=False)
    raise SystemExit(1 if counts.get(WRONG) else 0)


if __name__ == "__main__":
    main()
