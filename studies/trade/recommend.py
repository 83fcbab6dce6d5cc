"""The cheapest measured setting for a target error, or the best within a budget: chosen from the trade's tables."""

from ast import literal_eval
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console

from anctmm.model.case import Case
from anctmm.results.metrics import history_error, rounding_at, worst
from anctmm.results.solution import Solution
from studies.engine.files import file_name
from studies.engine.fronts import reaching
from studies.engine.identity import identity
from studies.engine.meshes import mesh_label
from studies.engine.study import Options, Result, StudyError
from studies.engine.tables import milliseconds, say, show_frame
from studies.engine.trials import NO_BEAMS, Trial, solved
from studies.trade.measure import same_continuum
from studies.trade.tables import history, parts_text, setting_of, stepping

#: The trade of the built-in scenes that ships with the package.
KEPT = Path(__file__).parent / "kept"
#: Factor by which a rerun without a target may differ from the table's error: it is the same computation.
SAME = 1.01
#: Tables that are read, and a column that only tables of their kind have.
NEEDED = {"points": "error_bound", "histories": "u_x", "references": "case"}


@dataclass(frozen=True)
class Measured:
    """Settings of a trade, reference histories and references, and their origin."""

    origin: str
    points: pd.DataFrame
    histories: pd.DataFrame
    references: pd.DataFrame

    def is_of(self, case: Case) -> bool:
        """Whether it was measured with this scene, these probes and these times."""
        return identity(case) in set(self.references["case"])


@dataclass(frozen=True)
class Choice:
    """A recommended setting."""

    line: Mapping[Any, Any]  # row of the points
    runners_up: pd.DataFrame  # the cheapest of other kinds, with their cost over the chosen one's, "ratio"
    remarks: tuple[str, ...] = ()  # why the target error is not met

    @property
    def reached(self) -> bool:
        """Whether it meets what was asked for."""
        return not self.remarks


@dataclass(frozen=True)
class Rerun:
    """A chosen setting run again."""

    solution: Solution
    error: float
    met: bool
    goal: str


def find(case: Case) -> Measured | None:
    """The first trade of a case that is there, the one that `anctmm study trade` writes first; None without one."""
    own = Path("results") / file_name(case.name) / "trade"
    for folder in (own, Path("results/trade"), Path("reports/trade"), KEPT):
        found = read(folder) if (folder / "front.csv").is_file() else None
        if found and case.name in set(found.points["scene"]) and (folder != KEPT or found.is_of(case)):
            return found
    return None


def read(folder: Path) -> Measured:
    """The tables that `anctmm study trade` left in a directory; of points all, or those of the fronts.

    StudyError if a table is missing, cannot be read, or is another one.
    """
    frames: list[Any] = []
    for name, needed in NEEDED.items():
        every = name != "points" or (folder / "points.csv").is_file()
        path = folder / f"{name if every else 'front'}.csv"
        try:
            frames.append(pd.read_csv(path, dtype={"elements": str, "own": str}))
        except (OSError, ValueError, OverflowError) as error:
            raise StudyError(f"table {path} cannot be read ({error})") from None
        if needed not in frames[-1]:
            raise StudyError(f"table {path} has no column {needed!r}; one of `study trade` is needed")
    return Measured("the table that ships with anctmm" if folder == KEPT else str(folder), *frames)


def of_result(result: Result) -> Measured:
    """The tables of a trade that was measured just now; StudyError if all of its runs are refused or fail."""
    if not result.good:
        raise StudyError(f"no setting has an error: {' '.join(result.findings)}")
    return Measured("measured now", *(result.table(name).frame for name in NEEDED))


def check_case(measured: Measured, case: Case) -> None:
    """Refuse tables of a case that was changed since."""
    if not measured.is_of(case):
        before = f"was measured before scene {case.name!r}, its probes or its times were changed"
        raise StudyError(f"{measured.origin} {before}; `anctmm study trade` measures it anew")


def narrowed(points: pd.DataFrame, scene: str, options: Options) -> pd.DataFrame:
    """Rows of a scene, and of some solvers, meshes, steps, an integrator and an element; StudyError without any."""
    mine = points[(points["scene"] == scene) & (points["error_bound"] > 0) & (points["cpu_s"] > 0)]
    if mine.empty:
        names = ", ".join(points["scene"].unique())
        raise StudyError(f"scene {scene!r} has no setting with an error and a time; others have: {names}")
    wanted = {
        "--solvers": ("solver", options.solvers), "--elements": ("elements", options.meshes),
        "--dt": ("dt", options.steps), "--element": ("element", options.element and [options.element]),
        "--integrator": ("integrator", options.integrator and [options.integrator]),
    }  # fmt: skip
    for typed, (column, given) in wanted.items():
        values, shown = [_shown(value) for value in given or ()], mine[column].map(_shown)
        if values and not shown.isin(values).any():
            allowed = ", ".join(shown.unique())
            raise StudyError(f"{typed} is {', '.join(values)!r}; measured on {scene!r} are {allowed}")
        mine = mine[shown.isin(values)] if values else mine
    return mine


def _shown(value: Any) -> str:
    """A value as tables show it."""
    mesh = isinstance(value, tuple)
    return mesh_label(value) if mesh else f"{value:.3g}" if isinstance(value, float) else str(value)


def choose(points: pd.DataFrame, error: float | None, budget_s: float | None) -> Choice:
    """The cheapest setting whose error bound meets a target, or the one with the smallest bound within a budget."""
    budget = inf if budget_s is None else budget_s
    mine = points.sort_values("cpu_s", kind="stable")
    affordable = mine[mine["cpu_s"] <= budget]
    if affordable.empty:
        remark = f"no measured setting is that cheap: the cheapest one takes {mine['cpu_s'].iloc[0]:.2g} s"
        return _choice(mine, mine.iloc[0], remark)
    best = affordable.sort_values(["error_bound", "cpu_s"]).iloc[0]
    if error is None:
        return _choice(affordable, best)
    able, anywhere = reaching(affordable, error), reaching(mine, error)
    if len(able):
        return _choice(able, able.iloc[0])
    if len(anywhere):
        takes = f"an error of {error:g} takes {anywhere['cpu_s'].iloc[0]:.2g} s"
        return _choice(able, best, f"{takes}; this is the best within {budget:g} s")
    smallest, floor = mine["error_bound"].min(), mine["reference_error"].min()
    reason = f"the measured range does not reach {error:g}: its smallest error bound is {smallest:.2g}"
    below = f"{error:g} is below the uncertainty of the reference, {floor:.1g}: no run can guarantee it"
    return _choice(able, best, *((reason, below) if error <= floor else (reason,)))


def _choice(rows: pd.DataFrame, chosen: pd.Series, *remarks: str) -> Choice:
    """A row, and of others the cheapest of each solver, element and way to step."""
    rows = rows.drop(index=chosen.name, errors="ignore")
    rows = rows.assign(stepping=stepping(rows), ratio=rows["cpu_s"] / chosen["cpu_s"]).sort_values("ratio")
    return Choice(chosen.to_dict(), rows.drop_duplicates(["solver", "element", "stepping"]).head(5), remarks)


def trial_of(line: Mapping[Any, Any], case: Case) -> Trial:
    """The run of a row of the points."""
    tolerances = {k: float(line[k]) for k in ("tolerance", "newton_tolerance") if line[k] > 0}
    dt, elements = float(line["dt"]), "1" if line["elements"] == NO_BEAMS else str(line["elements"])
    return Trial.of(
        case, str(line["solver"]), tuple(int(n) for n in elements.split("/")), element=str(line["asked"]),
        quadrature="full" if line["quadrature"] == "-" else str(line["quadrature"]), integrator=str(line["integrator"]),
        dt=case.interval / round(case.interval / dt) if dt > 0 else dt,  # a table has nine digits
        options=tolerances | literal_eval(line["own"]),
    )  # fmt: skip


def script(line: Mapping[Any, Any], case: Case, given: str) -> str:
    """A script that runs a row of the points and leaves `solution`."""
    trial = trial_of(line, case)
    run = ", ".join(f"{name}={value!r}" for name, value in trial.arguments.items())
    own = "".join(f", {name}={value!r}" for name, value in trial.own.items())
    return "\n".join([
        "import anctmm as at",
        "from anctmm.solvers import registry",
        "from studies.cases import find_case",
        "",
        f"scene = find_case({given!r}, {case.name!r}).scene",
        f"run = at.Discretisation({run})",
        f"solution = registry.solver({trial.solver!r})(scene, run{own})",
        'print(f"{solution.status}: {1e3 * solution.cost.cpu_s:.3g} ms")',
        *(f"print({probe!r}, solution.position({probe!r})[-1])" for probe in case.probes),
        "",
    ])  # fmt: skip


def rerun(choice: Choice, case: Case, measured: Measured, target: float | None) -> Rerun:
    """Run a choice again, and compare the solution with the histories of the reference.

    With a target error that the choice meets, the rerun meets it, too, if its error and the uncertainty of the
    reference do; else its error must be the table's.
    """
    line, solution = choice.line, solved(trial_of(choice.line, case))
    known = measured.histories[measured.histories["scene"] == case.name]
    element = same_continuum(str(line["asked"]), dict.fromkeys(known["element"]))
    error, sure = _error(case, solution, known[known["element"] == element]), float(line["reference_error"])
    aim, goal = SAME * float(line["error"]) + 2.0 * sure, f"the table's {line['error']:.2g}"
    if target is not None and choice.reached:
        aim, goal = target, f"the target error {target:g}"
    met = solution.status.ok and isfinite(error) and error + sure <= aim
    return Rerun(solution, error, bool(met), goal)


def _error(case: Case, solution: Solution, known: pd.DataFrame) -> float:
    """Error of a solution against the histories of a reference; NaN where they have other times."""
    mine = history(case, solution)
    if not (solution.status.ok and len(mine) == len(known) and np.allclose(mine["t"], known["t"])):
        return float("nan")
    shape = len(case.probes), -1, 2
    u, v = (frame[["u_x", "u_y"]].to_numpy().reshape(shape) for frame in (mine, known))
    rounding = [rounding_at(solution, probe) for probe in case.probes]
    return worst(map(history_error, u, v, rounding))


def show(choice: Choice, origin: str, console: Console) -> None:
    """Print the setting, its cost and error, and the runners-up."""
    line, others = choice.line, choice.runners_up
    for remark in choice.remarks:
        say(console, f"Not reached: {remark}.", "yellow")
    say(console, f"{'Recommended' if choice.reached else 'Nearest'}: {setting_of(line)}", "bold")
    cost, bound = milliseconds(line["cpu_s"]), f"{line['error_bound']:.2g} ({parts_text(line)})"
    say(console, f"expected {cost} of CPU time; error bound {bound}; from {origin}")
    if len(others):
        others = others.assign(setting=others.apply(setting_of, axis="columns"))
        title = "Runners-up, the cheapest of each kind"
        show_frame(console, title, others[["setting", "cpu_s", "ratio", "error_bound"]])


def show_rerun(again: Rerun, console: Console) -> None:
    """Print the result of a rerun."""
    status, cost = again.solution.status, milliseconds(again.solution.cost.cpu_s)
    said = f"Rerun of this setting: {status}, error {again.error:.3g} {'meets' if again.met else 'MISSES'} {again.goal}"
    say(console, f"{said}; {cost} of CPU time.", "green" if again.met else "red")
