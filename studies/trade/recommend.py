"""The cheapest measured setting for a target error, or the best within a budget: chosen from the trade's tables."""

from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError
from anctmm.model.case import Case
from anctmm.results.metrics import history_error, rounding_at, worst
from studies.engine.choices import NONE
from studies.engine.choices import read as read_own
from studies.engine.files import file_name
from studies.engine.fronts import reaching
from studies.engine.identity import identity
from studies.engine.runner import Runner
from studies.engine.study import Options, Result
from studies.engine.timing import least
from studies.engine.trials import NO_BEAMS, Trial, mesh_label
from studies.trade import study
from studies.trade.tables import family_of, setting_of, stepping

#: The trade of the built-in scenes that ships with the package.
KEPT = Path(__file__).parent / "kept"
#: Runs of a rerun; its time is the least.
REPEATS = 3
#: Factor by which a rerun without a target may differ from the table's error: it is the same computation.
SAME = 1.01
#: Part of an interval of output by which times may differ that are the same: tables have nine digits.
SAME_TIME = 1e-3
NEEDED = {
    "front": ("scene", "solver", "element", "quadrature", "integrator", "elements", "dt", "tolerance",
              "newton_tolerance", "error", "mesh_error", "step_error", "reference_error", "error_bound", "cpu_s",
              "status", "asked"),
    "histories": ("scene", "element", "body", "fraction", "t", "u_x", "u_y"),
    "references": ("scene", "element", "from_cable", "case"),
}  # fmt: skip


class RecommendError(AnctmmError, ValueError):
    """A target error, a scene or a table cannot be used."""


@dataclass(frozen=True)
class Measured:
    """Settings of a trade, reference histories and references, and their origin."""

    points: pd.DataFrame
    histories: pd.DataFrame
    references: pd.DataFrame
    origin: str


@dataclass(frozen=True)
class Choice:
    """A recommended setting.

    Parameters
    ----------
    line : mapping
        Row of the points.
    runners_up : DataFrame
        The cheapest of other kinds, with their cost over the chosen one's, "ratio".
    reached : bool
        Whether the target error is met.
    remarks : tuple of str
        Why it is not met.
    """

    line: Mapping[Any, Any]
    runners_up: pd.DataFrame
    reached: bool
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Rerun:
    """A chosen setting run again from its script."""

    error: float
    cpu_s: float
    status: str
    met: bool


def places(case: Case) -> list[Path]:
    """Directories in which a trade of a case may be, the one that `anctmm study trade` writes first."""
    return [
        Path("results") / file_name(case.name) / "trade",
        Path("results/trade"),
        Path("reports/trade"),
        KEPT,
    ]


def find(case: Case) -> Measured | None:
    """The first trade of a case that is there; None without one.

    Raises
    ------
    RecommendError
        If it cannot be read, or was measured before the case was changed.
    """
    for folder in places(case):
        if (folder / "front.csv").is_file():
            measured = read(folder)
            if case.name in set(measured.points["scene"]):
                if folder != KEPT:
                    return measured
                if _is_of(measured, case):
                    return replace(measured, origin="the table that ships with anctmm")
    return None


def read(folder: Path) -> Measured:
    """The tables that `anctmm study trade` left in a directory; of points all, or those of the fronts.

    Raises
    ------
    RecommendError
        If a table is missing, cannot be read, or is another one.
    """
    frames = {}
    for name, needed in NEEDED.items():
        path = (
            folder / "points.csv"
            if name == "front" and (folder / "points.csv").is_file()
            else folder / f"{name}.csv"
        )
        try:
            frames[name] = pd.read_csv(path, dtype={"elements": str, "own": str})
        except (OSError, ValueError, OverflowError) as error:
            raise RecommendError(
                f"table {path} cannot be read ({error}); `anctmm study trade` writes it"
            ) from None
        if missing := [c for c in needed if c not in frames[name].columns]:
            raise RecommendError(
                f"table {path} has no column {missing[0]!r}; one of `anctmm study trade` is needed"
            )
    return Measured(frames["front"], frames["histories"], frames["references"], str(folder))


def of_result(result: Result) -> Measured:
    """The tables of a trade that was measured just now."""
    points, histories, references = (
        result.table(name).frame for name in ("points", "histories", "references")
    )
    return Measured(points, histories, references, "measured now")


def measured_now(case: Case, options: Options, runner: Runner) -> Measured:
    """The trade of a case, measured now.

    Raises
    ------
    RecommendError
        If all of its runs are refused or fail.
    """
    result = study.run(options, runner)
    if not result.good:
        raise RecommendError(f"scene {case.name!r} has no setting with an error: {' '.join(result.findings)}")
    return of_result(result)


def _is_of(measured: Measured, case: Case) -> bool:
    known = measured.references[measured.references["scene"] == case.name]
    return identity(case) in set(known["case"])


def check_case(measured: Measured, case: Case) -> None:
    """Refuse tables of a case that was changed since.

    Raises
    ------
    RecommendError
    """
    if not _is_of(measured, case):
        raise RecommendError(
            f"{measured.origin} was measured before scene {case.name!r}, its probes or its times were changed; "
            f"`anctmm study trade` measures it anew"
        )


def narrowed(points: pd.DataFrame, scene: str, options: Options) -> pd.DataFrame:
    """Rows of a scene, and of some solvers, meshes, steps, of an integrator and an element.

    Raises
    ------
    RecommendError
        If nothing is left.
    """
    mine = points[(points["scene"] == scene) & (points["error_bound"] > 0) & (points["cpu_s"] > 0)]
    if mine.empty:
        names = ", ".join(dict.fromkeys(points["scene"]))
        raise RecommendError(
            f"scene {scene!r} has no setting with an error and a time; scenes of the table: {names}"
        )
    wanted: dict[tuple[str, str], Any] = {
        ("solver", "--solvers"): options.solvers,
        ("integrator", "--integrator"): options.integrator and (options.integrator,),
        ("element", "--element"): options.element and (options.element,),
        ("elements", "--elements"): options.meshes and tuple(map(mesh_label, options.meshes)),
        ("dt", "--dt"): options.steps,
    }
    for (column, typed), values in wanted.items():
        if not values:
            continue
        left = mine[_among(mine[column], values)]
        if left.empty:
            allowed = ", ".join(
                f"{v:g}" if column == "dt" else str(v) for v in mine[column].dropna().unique()
            )
            raise RecommendError(
                f"{typed} is {', '.join(map(str, values))!r}; measured on {scene!r} are {allowed}"
            )
        mine = left
    return mine


def _among(column: pd.Series, values: Sequence[Any]) -> pd.Series:
    """Whether each of a column is one of some values; steps as they are written with three digits, like 3.33 ms."""
    if column.name != "dt":
        return column.isin(values)
    near = np.isclose(column.to_numpy(float)[:, None], np.array(values, float), rtol=2e-3, atol=0.0)
    return pd.Series(near.any(axis=1), column.index)


def models_apart(measured: Measured, scene: str, error: float | None) -> str:
    """A note where the target error is smaller than the difference of the models; empty where it is not."""
    known = measured.references[measured.references["scene"] == scene]["from_cable"].max()
    if error is None or not known > error:
        return ""
    return (
        f"cable and shear elements are two models, {known:.2g} apart on this scene: an error of {error:g} is that of "
        "computing the model named, and --element chooses it"
    )


def choose(points: pd.DataFrame, error: float | None, budget_s: float | None) -> Choice:
    """The cheapest setting whose error bound meets a target, or the one with the smallest bound within a budget.

    Parameters
    ----------
    points : DataFrame
        Of one scene, see `narrowed`.
    error : float, optional
        Target.
    budget_s : float, optional
        CPU time of the steps, s.

    Raises
    ------
    RecommendError
        If neither is given, or one is not positive.
    """
    if error is None and budget_s is None:
        raise RecommendError("neither error nor budget is given; at least one of them is needed")
    for name, value in (("error", error), ("budget (s)", budget_s)):
        if value is not None and not 0.0 < value < np.inf:
            raise RecommendError(f"{name} is {value!r}; a positive number is needed")
    mine = points.sort_values("cpu_s", kind="stable")
    affordable = mine if budget_s is None else mine[mine["cpu_s"] <= budget_s]
    if affordable.empty:
        first = mine.iloc[0]
        remark = f"no measured setting is that cheap: the cheapest one takes {first['cpu_s']:.2g} s"
        return Choice(first.to_dict(), _others(mine.iloc[1:], first), False, (remark,))
    nearest = affordable.sort_values(["error_bound", "cpu_s"]).iloc[0]
    if error is None:
        return Choice(nearest.to_dict(), _others(affordable.drop(nearest.name), nearest), True)
    able = reaching(affordable, error)
    if len(able):
        return Choice(able.iloc[0].to_dict(), _others(able.iloc[1:], able.iloc[0]), True)
    return Choice(
        nearest.to_dict(), _others(affordable.iloc[:0], nearest), False, _why_not(mine, error, budget_s)
    )


def _why_not(mine: pd.DataFrame, error: float, budget_s: float | None) -> tuple[str, ...]:
    able = reaching(mine, error)
    if budget_s is not None and len(able):
        needs = able["cpu_s"].iloc[0]
        return (f"an error of {error:g} takes {needs:.2g} s; this is the best within {budget_s:g} s",)
    least_bound = mine["error_bound"].min()
    said = [f"the measured range does not reach {error:g}: its smallest error bound is {least_bound:.2g}"]
    floor = mine["reference_error"].min()
    if error <= floor:
        said.append(
            f"{error:g} is below the uncertainty of the reference, {floor:.1g}: no run can guarantee it"
        )
    return tuple(said)


def _others(rows: pd.DataFrame, chosen: pd.Series) -> pd.DataFrame:
    """The cheapest rows of other kinds: solver, element, way to step."""
    kind = rows["solver"] + ", " + rows["element"] + ", " + stepping(rows) if len(rows) else rows["solver"]
    own = setting_of(chosen.to_dict())
    other = np.array([setting_of(line) != own for line in rows.to_dict("records")], dtype=bool)
    shown = rows.assign(kind=kind, ratio=rows["cpu_s"] / chosen["cpu_s"])[other].drop_duplicates("kind")
    return shown.sort_values("ratio").head(5)


# --- running it ----------------------------------------------------------------------------------------------


def trial_of(line: Mapping[Any, Any], case: Case) -> Trial:
    """The run of a row of the points."""
    options = tuple((k, float(line[k])) for k in ("tolerance", "newton_tolerance") if line[k] > 0)
    dt, elements = float(line["dt"]), "1" if line["elements"] == NO_BEAMS else str(line["elements"])
    step = case.interval / round(case.interval / dt) if dt > 0 else dt  # a table has nine digits
    return Trial(
        case.scene, str(line["solver"]), tuple(int(n) for n in elements.split("/")), str(line["asked"]),
        "full" if line["quadrature"] == "-" else str(line["quadrature"]), str(line["integrator"]), step, case.duration,
        case.interval, options, read_own(str(line["own"])),
    )  # fmt: skip


def script(line: Mapping[Any, Any], case: Case, given: str) -> str:
    """A script that runs a row of the points and leaves `solution`.

    Parameters
    ----------
    line : mapping
    case : Case
    given : str
        The file of the case, or the name of a built-in scene.
    """
    run, solver, own = trial_of(line, case).run(), str(line["solver"]), str(line["own"])
    ours = solver == "anctmm"
    solve = "at.solve" if ours else f"registry.solver({solver!r})"
    lines = [
        "import anctmm as at", *([] if ours else ["from anctmm.solvers import registry"]),
        "from studies.cases import find_case", "", f"scene = find_case({given!r}, {case.name!r}).scene",
        f"run = at.Discretisation({_arguments(run)})",
        f"solution = {solve}(scene, run{'' if own == NONE else f', {own}'})",
        'print(f"{solution.status}: {1e3 * solution.cost.cpu_s:.3g} ms")',
        *(f"print({probe!r}, solution.position({probe!r})[-1])" for probe in case.probes),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _arguments(run: Discretisation) -> str:
    """Fields of a discretisation as Python writes them, without those that have their defaults."""
    plain = Discretisation()
    always = ("element",) if run.mesh is not None else ()
    names = [
        "mesh",
        "element",
        "quadrature",
        "integrator",
        "dt",
        "t_end",
        "output_dt",
        "tolerance",
        "newton_tolerance",
    ]
    given = {n: getattr(run, n) for n in names if n in always or getattr(run, n) != getattr(plain, n)}
    if run.tolerance is not None:
        given.pop("dt", None)
    return ", ".join(f"{n}={dict(v) if isinstance(v, dict) else v!r}" for n, v in given.items())


def rerun(
    line: Mapping[Any, Any], case: Case, given: str, measured: Measured, target: float | None, reached: bool
) -> Rerun:
    """Run the script of a row, and compare the solution with the histories of the reference.

    With a target error that the row meets, the rerun meets it, too, if its error and the uncertainty of the reference
    do; else its error must be the table's.
    """
    code, costs = compile(script(line, case, given), "<script>", "exec"), []
    with redirect_stdout(StringIO()):
        for _ in range(REPEATS):
            names: dict[str, Any] = {}
            exec(code, names)
            costs.append(names["solution"].cost)
    solution = names["solution"]
    known = measured.histories[measured.histories["scene"] == case.name]
    element = family_of(str(line["asked"]), list(dict.fromkeys(known["element"])))
    error = worst(_error_at(solution, probe, known[known["element"] == element]) for probe in case.probes)
    if target is not None and reached:
        met = error + float(line["reference_error"]) <= target
    else:
        met = error <= SAME * float(line["error"]) + float(line["reference_error"])
    return Rerun(
        error, least(costs).cpu_s, str(solution.status), bool(solution.status.ok and met and isfinite(error))
    )


def _is_key(given: Any, key: Any) -> bool:
    """Whether a cell of a table is the key of a place: a point's name, or a fraction."""
    try:
        return abs(float(given) - float(key)) < 1e-6
    except ValueError:
        return str(given) == str(key)


def _error_at(solution: Any, probe: Any, known: pd.DataFrame) -> float:
    """Error of a solution at a probe against a history of the reference."""
    body, key = solution.scene.probe(probe)
    mine = known[(known["body"] == body) & known["fraction"].map(lambda f: _is_key(f, key))]
    u = solution.displacement(probe)
    if not solution.status.ok or len(mine) < 2 or len(u) < len(mine):
        return float("nan")
    t = mine["t"].to_numpy()
    near = np.abs(solution.t[: len(t)] - t).max() <= SAME_TIME * (t[1] - t[0])
    reference = mine[["u_x", "u_y"]].to_numpy()
    return history_error(u[: len(t)], reference, rounding_at(solution, probe)) if near else float("nan")
