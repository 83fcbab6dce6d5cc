"""Moving scenes, and what steps with a tolerance cost on them beside the best fixed ones of the same error.

By robust errors none, of fixed steps or of steps with a tolerance, counts as smaller than with the tightest bound of
Newton's iteration: what a loose bound leaves may cancel a part of the error, which nobody can choose beforehand. Nor
does any count as smaller than that of a step shorter by up to a half, or of the next tolerance, a tenth: parts of an
error that cancel at one step are no choice either, and who takes a step checks it by one half as long. These are the
rules of the studies, `studies.engine.fronts`. The promise is asked of the error as it is.

The cost of one run says little: where something vibrates steps have two stable lengths, and the same tolerance, a fifth
larger, may cost 0.7 or 1.4 times as much. So costs and errors are geometric means of three tolerances close to another.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from runpy import run_path
from types import SimpleNamespace

import numpy as np
import pandas as pd
from pareto_front import cost_at
from scipy.stats import gmean
from user_cases import FOLDER

import anctmm as at
from reference.exact.andrews import andrews_squeezer
from studies import gallery, scenes
from studies.engine.fronts import robust as robust_errors

GALLERY = Path(gallery.__file__).parent / "scenes"
FOUR_BAR = {"crank": 2, "coupler": 8, "follower": 2}
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
#: Times a tolerance at which the runs are of which a mean is taken.
NEAR = (2.0**-0.25, 1.0, 2.0**0.25)
#: Part of a tolerance, down to whose errors one counts.
NEXT = 0.1
#: Corrections of Newton's iteration that take as long as a factorization: 3.4 to 4.6 with cables, 5 to 8 with shear
#: elements, fitted to the times of fixed steps of these scenes and of longer meshes.
PRICES = {"cable": 4.4, "shear": 6.6}


#: Part by which two steps may differ and be one.
CLOSE = 1e-9


def halved_errors(errors, alike, sizes, part=0.5):
    """Each error, or the largest of the runs alike with steps from its own down to half of it where that is larger.

    Whoever takes a step without a reference checks it by one of half its length. Errors of second order fall by four
    then, and this leaves them as they are. One that grows was small because its parts, or what Newton's iteration left,
    cancelled at that step: nobody can choose such a step beforehand.

    Parameters
    ----------
    errors : Series
        Of runs; NaN of one that failed.
    alike : sequence of hashable
        What a run shares with those that differ from it in the step alone.
    sizes : sequence of float
        Steps, s; or tolerances that steps follow.
    part : float
        Of a size, down to which others count.

    Returns
    -------
    Series
        NaN where `errors` has it.
    """
    rows = pd.DataFrame(
        {"error": errors.to_numpy(float), "alike": list(alike), "size": np.asarray(sizes, dtype=float)}
    )
    found = rows["error"].copy()
    for _, group in rows.groupby("alike"):
        error, size = group["error"].to_numpy(), group["size"].to_numpy()
        checked = (size <= size[:, None] * (1.0 + CLOSE)) & (size >= part * size[:, None] * (1.0 - CLOSE))
        found[group.index] = np.nanmax(np.where(checked, error, -np.inf), axis=1, initial=-np.inf)
    return pd.Series(found.where(rows["error"].notna()).to_numpy(float), index=errors.index)


def written(name):
    """The first case of a file of the helpers, or of the gallery."""
    found = next(path for folder in (FOLDER, GALLERY) if (path := folder / f"{name}.py").exists())
    return run_path(str(found))["CASES"][0]


def of_files(*names):
    """Cases by name, as (maker, mesh, element)."""
    return {name: (partial(written, name), 4, "cable") for name in names}


def squeezer():
    """Andrews' squeezer, as a case."""
    t_end, probes = 0.03, [f"K{k}.center" for k in (1, 2, 5, 7)]
    return at.Case(andrews_squeezer(), probes, t_end=t_end, output_dt=t_end / 75)


#: Those by which constants of the step control were chosen, and others.
CHOSEN_BY = {
    "four-bar": (scenes.four_bar, FOUR_BAR, "cable"),
    "four-bar-moment": (scenes.four_bar_moment, FOUR_BAR, "cable"),
    "fall": (scenes.cantilever_fall, 8, "cable"),
} | of_files("double_pendulum", "three_supports", "portal_frame", "thrown_chain")
OTHERS = {
    "four-bar-shear": (scenes.four_bar, FOUR_BAR, "shear"),
    "fall-shear": (scenes.cantilever_fall, 8, "shear"),
} | of_files("soft_pendulum", "thrown_triangle", "straight_line", "motor_arm", "rotating_blade")
#: Those with constraints between rigid bodies or guides.
CONSTRAINED = of_files("half_car", "gantry_crane") | {"squeezer": (squeezer, None, None)}


def work(run):
    """Corrections, and factorizations, each as so many of them."""
    price = max(
        (PRICES[run.run.of(run.scene)[beam.name][1]] for beam in run.scene.beams), default=PRICES["cable"]
    )
    return run.cost.newton_iterations + price * run.cost.factorizations


@dataclass(frozen=True)
class Costs:
    """Runs of a case: with tolerances, as (tolerance, promised, error, work), and fixed steps, as errors and costs.

    Errors are robust ones; promised: the largest error over the one asked for.
    """

    name: str
    runs: list
    fixed: list

    @property
    def ratios(self):
        """Work of each tolerance over that of the best fixed step of the same error; no error is below all of these."""
        return [_ratio(self.fixed, error, cost) for _, _, error, cost in self.runs]

    @property
    def promised(self):
        """Largest error over the one asked for."""
        return max(promised for _, promised, _, _ in self.runs)


def _ratio(fixed, error, cost):
    """A cost over that of the best fixed step of an error."""
    return cost / cost_at(fixed, max(error, min(step.error for step in fixed)))


def costs(name, integrator, parts, bounds, reference_by):
    """Costs of a case; fixed steps are `parts` of the interval of output, each with all `bounds` of Newton's iteration.

    Parameters
    ----------
    reference_by : tuple of str and int
        Integrator of the reference, and its steps between two outputs.
    """
    make, mesh, element = (CHOSEN_BY | OTHERS | CONSTRAINED)[name]
    case = make()
    dt, beams = case.interval, {"mesh": mesh, "element": element} if case.scene.beams else {}
    options = {"t_end": case.duration, "output_dt": dt} | beams
    by, finest = reference_by
    reference = at.solve(case.scene, dt=dt / finest, newton_tolerance=1e-11, integrator=by, **options)
    assert reference.status.ok, reference.status

    def error(run):
        return at.compare(run, reference, case.probes).error if run.status.ok else float("nan")

    settings = list(product(bounds, parts))
    # with loose bounds of Newton's iteration some runs make energy
    steps = [
        at.solve(case.scene, dt=dt / part, newton_tolerance=bound, integrator=integrator, **options)
        for bound, part in settings
    ]
    tightest = [bound == min(bounds) for bound, _ in settings]
    own = pd.Series([error(step) for step in steps])
    robust = robust_errors(own, [part for _, part in settings], tightest)
    robust = halved_errors(robust, [bound for bound, _ in settings], [dt / part for _, part in settings])
    runs = [_runs(case, e, error, integrator, min(bounds), options) for e in TOLERANCES]
    sure = halved_errors(pd.Series([run[2] for run in runs]), [name] * len(runs), TOLERANCES, NEXT)
    runs = [(asked, promised, e, cost) for (asked, promised, _, cost), e in zip(runs, sure, strict=True)]
    return Costs(name, runs, _priced(robust, steps))


def _priced(errors, steps):
    """Errors and costs of whole runs."""
    return [
        SimpleNamespace(error=e, cpu_s=float(work(s)))
        for e, s in zip(errors, steps, strict=True)
        if s.status.ok
    ]


def _runs(case, tolerance, error, integrator, tightest, options):
    """Runs with tolerances close to one, as `Costs` has them."""
    found = np.array([_run(case, near * tolerance, error, integrator, tightest, options) for near in NEAR])
    promised, errors, costs = found.T
    return tolerance, promised.max(), gmean(errors), gmean(costs)


def _run(case, tolerance, error, integrator, tightest, options):
    """Error over the one asked for, robust error and work of a run with a tolerance."""
    run, tight = (
        at.solve(case.scene, tolerance=tolerance, integrator=integrator, **options | bound)
        for bound in ({}, {"newton_tolerance": tightest})
    )
    assert run.status.ok, run.status
    assert tight.status.ok, tight.status
    found = error(run)
    return found / tolerance, max(found, error(tight)), work(run)
