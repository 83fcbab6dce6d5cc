"""The paper's Table 2 repeated: the same motion by an ordinary ANCF solver, by ANC-TMM and by Exudyn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd

from anctmm.results.solution import Solution
from studies.engine.measuring.timing import Timing, in_turn, settled, summarise
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Reference
from studies.engine.running.trial import Mesh, Trial
from studies.engine.study import Options
from studies.engine.tables import BUILD, Table
from studies.scenes import BaseScene

MESH: Mesh = (2, 8, 2)
EXPLICIT_DT = 1e-5
IMPLICIT_DT = 1e-3
#: In which the contestants take their turns, by whether the run is quick.
ROUNDS = {False: 5, True: 2}
#: How long the dense solver is timed, by whether the run is quick, s.
STRETCH = {False: 0.2, True: 0.04}
#: Rong 2014, Table 2: CPU time in s of the whole run; its length and step are not printed.
PUBLISHED = {"ordinary ANCF, dense": 838.51, "ANC-TMM, explicit": 107.25}
BASELINE = "ordinary ANCF, dense"
COLUMNS = (
    "method", "us_per_step", "ratio_per_step", "cpu_s_full", "full_is", "ratio_full", "published_cpu_s",
    "published_ratio", "error", "reference_error", "solver", "element", "integrator", "elements", "dofs", "dt",
    "steps_full", "steps_measured", "cpu_s_measured", "cpu_spread", "build_s", "repeats", "status",
)  # fmt: skip


@dataclass(frozen=True)
class Contestant:
    """A line of the table."""

    method: str
    solver: str
    element: str
    integrator: str

    @property
    def stretched(self) -> bool:
        """Whether a stretch stands for its whole run: a minute of steps that all cost the same."""
        return self.solver == "global-dae-dense"


CONTESTANTS = (
    Contestant(BASELINE, "global-dae-dense", "shear", "zhai"),
    Contestant("ordinary ANCF, at its best", "global-dae", "shear", "zhai"),
    Contestant("ANC-TMM, explicit", "anctmm", "shear", "zhai"),
    Contestant("ANC-TMM, implicit", "anctmm", "shear", "generalized-alpha"),
    Contestant("Exudyn (cable elements)", "exudyn-cable", "cable", "generalized-alpha"),
)


def paper_table(
    base: BaseScene, references: Mapping[str, Reference], options: Options, runner: Runner
) -> Table | None:
    """Time the contestants in turn and set the published times beside theirs; None if the user left none."""
    cases = contest(base, options)
    if not cases:
        return None
    rounds = _rounds(cases, ROUNDS[options.quick], runner)
    lines = [_line(c, cases[c], rounds[c.method], base, references, runner, options.quick) for c in cases]
    frame = _with_ratios(pd.DataFrame(lines)).reindex(columns=list(COLUMNS))
    return Table("paper_table2", "The paper's Table 2, rebuilt", frame, _notes(STRETCH[options.quick]))


def contest(base: BaseScene, options: Options) -> Mapping[Contestant, Trial]:
    """The contestants that the user has left, with their runs."""
    stretch = STRETCH[options.quick]
    return {
        c: _case(base, c, stretch if c.stretched else base.duration) for c in CONTESTANTS
        if (options.solvers is None or c.solver in options.solvers)
        and options.element in (None, c.element) and options.integrator in (None, c.integrator)
    }  # fmt: skip


def _case(base: BaseScene, contestant: Contestant, t_end: float) -> Trial:
    return Trial(
        base.scene, contestant.solver, MESH, element=contestant.element, integrator=contestant.integrator,
        dt=EXPLICIT_DT if contestant.integrator == "zhai" else IMPLICIT_DT, t_end=t_end,
        output_dt=base.interval,
    )  # fmt: skip


def _rounds(cases: Mapping[Contestant, Trial], repeats: int, runner: Runner) -> dict[str, list[Solution]]:
    """All contestants in turn, remembered as one: ratios of times from two sessions would mean nothing."""

    def measure() -> dict[str, list[Solution]]:
        calls = {
            c.method: partial(settled, partial(runner.attempt, case), runner.short)
            for c, case in cases.items()
        }
        warm = {c.method: partial(runner.warm_up, case) for c, case in cases.items()}
        with runner.alone():
            rounds = in_turn(calls, repeats, warm)
        return {m: [replace(s, t=s.t[:0], fields={}) for s in found] for m, found in rounds.items()}

    key = runner.key(*cases.values())
    scenes = [case.scene for case in cases.values()]
    return runner.remember(key and f"in turn {repeats} times|{key}", measure, scenes)  # type: ignore[no-any-return]


def _line(
    contestant: Contestant,
    case: Trial,
    solutions: Sequence[Solution],
    base: BaseScene,
    references: Mapping[str, Reference],
    runner: Runner,
    quick: bool,
) -> dict[str, object]:
    """One line; its error is that of the whole run, where the dense solver's cheap twin stands in for it."""
    status = next((s.status for s in solutions if not s.status.ok), solutions[0].status)
    timing = summarise([s.cost for s in solutions]) if status.ok else Timing(np.nan, np.nan, np.nan, 0)
    steps, full = solutions[0].cost.steps, round(base.duration / case.dt)
    per_step = timing.cpu_s / steps if steps else float("nan")
    reference = references.get(contestant.element)
    error = _error(base, contestant, reference, runner) if reference and status.ok else float("nan")
    published = PUBLISHED.get(contestant.method, float("nan"))
    return {
        "method": contestant.method,
        "solver": contestant.solver,
        "element": contestant.element,
        "integrator": contestant.integrator,
        "elements": "/".join(map(str, case.mesh)),
        "dofs": solutions[0].dofs,
        "dt": case.dt,
        "steps_measured": steps,
        "cpu_s_measured": timing.cpu_s,
        "cpu_spread": timing.cpu_spread,
        "build_s": timing.build_s,
        "repeats": timing.repeats,
        "us_per_step": 1e6 * per_step,
        "steps_full": full,
        "cpu_s_full": per_step * full,
        "full_is": "measured" if steps == full else f"extrapolated {full / max(steps, 1):.0f}×",
        "published_cpu_s": published,
        "published_ratio": PUBLISHED[BASELINE] / published,
        "error": error,
        "reference_error": reference.uncertainty if reference else float("nan"),
        "status": str(status),
    }


def _error(base: BaseScene, contestant: Contestant, reference: Reference, runner: Runner) -> float:
    """Error over the whole run; dense and sparse linear algebra differ by rounding only."""
    solver = "global-dae" if contestant.solver == "global-dae-dense" else contestant.solver
    solution = runner.solve(_case(base, replace(contestant, solver=solver), base.duration)).solution
    return reference.error_of(solution) if solution.status.ok else float("nan")


def _with_ratios(frame: pd.DataFrame) -> pd.DataFrame:
    """How many times faster than the baseline, by the step where steps are alike, and by the whole run."""
    baseline = frame[frame["method"] == BASELINE]
    per_step = float(baseline["us_per_step"].iloc[0]) if len(baseline) else float("nan")
    full = float(baseline["cpu_s_full"].iloc[0]) if len(baseline) else float("nan")
    alike = frame["integrator"] == "zhai"
    return frame.assign(
        ratio_per_step=(per_step / frame["us_per_step"]).where(alike), ratio_full=full / frame["cpu_s_full"]
    )


def _notes(stretch: float) -> tuple[str, ...]:
    return (
        f"All contestants ran in turn in one session; explicit steps are {EXPLICIT_DT:g} s, implicit ones "
        f"{IMPLICIT_DT:g} s. The dense solver is timed over the first {stretch:g} s of the motion, whose "
        "steps all cost the same, and extrapolated to the whole run; all others ran it whole.",
        "ratio_per_step and ratio_full: the dense solver's time over this row's. The paper publishes "
        "838.51 s against 107.25 s, a ratio of 7.8, for a run whose length, step and drive are not printed.",
        BUILD,
        "Exudyn has no planar shear-deformable ANCF element: its row is of cable elements, against the "
        "cable's own reference, and so is no like-for-like comparison.",
        "error: of the whole run against the reference of the same element; the dense solver's is its sparse "
        "twin's, from which it differs by rounding only.",
    )
