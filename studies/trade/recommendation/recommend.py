"""The cheapest measured setting for a target error, or the best within a budget: chosen from the trade's table."""

import json
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError
from anctmm.model.case import Case
from anctmm.model.scene import Scene
from anctmm.results.metrics import history_error, rounding_at, worst
from studies.engine.accuracy.dynamics import continuum_of, with_stretch
from studies.engine.choices import read as read_own
from studies.engine.measuring.timing import least, undisturbed
from studies.engine.running.trial import NO_BEAMS, Trial, mesh_label
from studies.engine.storage.files import check_checksum
from studies.engine.study import Options, Result
from studies.engine.tables import milliseconds
from studies.scenes import base_of, moving_scenes
from studies.trade.case_digest import digest_of
from studies.trade.choice import kinds_of, nearest, own_of, reaching, setting_of, stretch_of, sure_errors
from studies.trade.recommendation.snippet import snippet, snippet_of_file

#: The trade of the built-in scenes that ships with the package; `reports/trade` refers to it.
KEPT = Path(__file__).parents[1] / "kept"
#: Where a trade that the user measured may be.
OWN = (Path("results/trade"), Path("reports/trade"))
#: Runs of a rerun; its time is the least.
REPEATS = 3
#: A rerun without a target error that was met must give the measured error to this factor: it is the same computation.
SAME = 1.01
#: Part of an interval of output by which times may differ that are the same: tables keep nine digits.
SAME_TIME = 1e-3
NEEDED = {
    "points": ("scene", "solver", "element", "quadrature", "integrator", "elements", "dt", "tolerance",
               "newton_tolerance", "error", "robust_error", "reference_error", "mesh_error", "step_error", "cpu_s",
               "status", "family"),
    "histories": ("scene", "element", "body", "fraction", "t", "u_x", "u_y"),
    "references": ("scene", "element", "from_cable"),
}  # fmt: skip


class RecommendError(AnctmmError, ValueError):
    """A target error, a scene or a table cannot be used."""


@dataclass(frozen=True)
class Measured:
    """The trade's tables of points, of reference histories and of references, and where they come from."""

    points: pd.DataFrame
    histories: pd.DataFrame
    references: pd.DataFrame
    origin: str


@dataclass(frozen=True)
class Choice:
    """What is recommended.

    Parameters
    ----------
    line : mapping
        Row of the points.
    runners_up : DataFrame
        The cheapest of other kinds, with their cost over the chosen one's, "ratio".
    reached : bool
        Whether the target error is met.
    remarks : tuple of str
        What to know of it: why the target error is not met, or that it is met by chance.
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


def read(folder: Path) -> Measured:
    """The tables that `anctmm study trade` left in a directory.

    Raises
    ------
    RecommendError
        If a table is missing, cannot be read, is another one, or is not the one that was written.
    """
    frames = {}
    for name, needed in NEEDED.items():
        path = folder / f"{name}.csv"
        if path.exists() and not path.is_file():
            raise RecommendError(f"table {path} is no file; `anctmm study trade` writes it")
        try:
            frames[name] = pd.read_csv(path, dtype={"elements": str})
        except (OSError, ValueError, OverflowError) as error:
            raise RecommendError(
                f"table {path} cannot be read ({error}); `anctmm study trade` writes it"
            ) from None
        if missing := [c for c in needed if c not in frames[name].columns]:
            raise RecommendError(
                f"table {path} has no column {missing[0]!r}; one of `anctmm study trade` is needed"
            )
        if wrong := check_checksum(path):
            raise RecommendError(
                f"table {path} may be damaged ({wrong}); a complete one of `anctmm study trade` is needed"
            )
    return Measured(**frames, origin=str(folder))


def kept() -> Measured:
    """What the user measured in this directory, or else the tables that ship with the package; errors as of `read`."""
    own = next((folder for folder in OWN if (folder / "points.csv").exists()), None)
    if own is not None:
        return read(own)
    machine = json.loads((KEPT / "machine.json").read_text(encoding="utf-8"))["machine"]["processor"]
    return replace(read(KEPT), origin=f"the table that ships with anctmm, measured on {machine}")


def check_case(measured: Measured, case: Case) -> None:
    """Refuse tables of a case that was changed since; older tables, which do not say of what case they are, pass.

    Raises
    ------
    RecommendError
    """
    known = measured.references
    mine = known[known["scene"] == case.name]
    if "case" in mine and len(mine) and digest_of(case) not in set(mine["case"]):
        raise RecommendError(
            f"{measured.origin} was measured before scene {case.name!r}, its probes or its times were changed; "
            f"`anctmm study trade` measures it anew"
        )


def narrowed(points: pd.DataFrame, scene: str, options: Options, integrator: str | None) -> pd.DataFrame:
    """Rows of some solvers, meshes and steps, and of an integrator.

    Raises
    ------
    RecommendError
        If nothing of the scene is left of them.
    """
    wanted: dict[tuple[str, str], Any] = {
        ("solver", "--solvers"): options.solvers,
        ("integrator", "--integrator"): integrator and (integrator,),
        ("elements", "--elements"): options.meshes and tuple(map(mesh_label, options.meshes)),
        ("dt", "--dt"): options.steps,
    }
    for (column, typed), values in wanted.items():
        if not values:
            continue
        mine = points[points["scene"] == scene]
        points = points[_among(points[column], values)]
        if scene not in set(points["scene"]):
            allowed = ", ".join(
                f"{v:g}" if column == "dt" else str(v) for v in mine[column].dropna().unique()
            )
            raise RecommendError(
                f"{typed} is {', '.join(map(str, values))!r}; measured on scene {scene!r} are {allowed}"
            )
    return points


def _among(column: pd.Series, values: Sequence[Any]) -> pd.Series:
    """Whether each of a column is one of some values; steps as they are written with three digits, like 3.33 ms."""
    if column.name != "dt":
        return column.isin(values)
    near = np.isclose(column.to_numpy(float)[:, None], np.array(values, float), rtol=2e-3, atol=0.0)
    return pd.Series(near.any(axis=1), column.index)


def of_result(result: Result) -> Measured:
    """The tables of a trade that was measured just now."""
    return Measured(**{name: result.table(name).frame for name in NEEDED}, origin="measured now")


def models_apart(measured: Measured, scene: str, error: float | None) -> str:
    """A warning where the target error is smaller than the distance of the two models; empty where it is not."""
    known = measured.references[measured.references["scene"] == scene]["from_cable"].max()
    if error is None or not known > error:
        return ""
    return (
        f"cable and shear elements are two models, {known:.2g} apart on this scene: an error of {error:g} is that of "
        "computing the model named, and --element chooses it"
    )


def choose(
    points: pd.DataFrame, scene: str, error: float | None, budget_s: float | None, element: str | None = None
) -> Choice:
    """The cheapest setting of a scene that surely meets an error, or the best within a budget.

    Parameters
    ----------
    points : DataFrame
        Of the trade.
    scene : str
    error : float, optional
        Target; met by a setting whose error and whose reference's uncertainty together are no larger.
    budget_s : float, optional
        CPU time, s.
    element : str, optional
        Kind of element; any without it.

    Raises
    ------
    RecommendError
        If neither is given, or one is not positive, or nothing of the scene, or of the element, was measured.
    """
    if error is None and budget_s is None:
        raise RecommendError("neither error nor budget is given; at least one of them is needed")
    for name, value in (("error", error), ("budget (s)", budget_s)):
        if value is not None and not 0.0 < value < np.inf:
            raise RecommendError(f"{name} is {value!r}; a positive number is needed")
    mine = points[(points["scene"] == scene) & (points["error"] > 0) & (points["cpu_s"] > 0)]
    if mine.empty:
        tried = points[points["scene"] == scene]
        if len(tried):
            bad = tried.loc[tried["status"] != "ok", "status"]
            why = (
                f"{len(bad)} of {len(tried)} runs did not end well, most of them: {bad.mode()[0]}"
                if len(bad)
                else "-"
            )
            raise RecommendError(
                f"scene {scene!r} has no setting of which an error and a time are known: {why}"
            )
        names = ", ".join(dict.fromkeys(points["scene"]))
        raise RecommendError(f"scene {scene!r} has no measured setting; those of the table are {names}")
    if element is not None:
        allowed = ", ".join(sorted(set(mine["element"])))
        mine = mine[mine["element"] == element]
        if mine.empty:
            raise RecommendError(f"element is {element!r}; measured on scene {scene!r} are {allowed}")
    mine = mine.assign(sure=sure_errors(mine)).sort_values("cpu_s", kind="stable")
    affordable = mine if budget_s is None else mine[mine["cpu_s"] <= budget_s]
    if affordable.empty:
        first = mine.iloc[0]
        remark = f"no measured setting is that cheap: the cheapest one takes {first['cpu_s']:.2g} s"
        return Choice(first.to_dict(), _others(mine.iloc[1:], first), False, (remark,))
    if error is None:
        best = nearest(affordable).iloc[0]
        return Choice(best.to_dict(), _others(affordable.drop(best.name).sort_values("sure"), best), True)
    able = reaching(affordable, error)
    if len(able):
        return Choice(able.iloc[0].to_dict(), _others(able.iloc[1:], able.iloc[0]), True, _luck(able, error))
    best = nearest(affordable).iloc[0]
    return Choice(best.to_dict(), _others(affordable.iloc[:0], best), False, _why_not(mine, error, budget_s))


def _luck(able: pd.DataFrame, error: float) -> tuple[str, ...]:
    """Whether the first setting meets the error only because those of mesh and step cancel in part."""
    both = able["mesh_error"] + able["step_error"] + able["reference_error"]
    if not both.iloc[0] > error:
        return ()
    said = "its errors of mesh and step cancel in part, which may not happen in another motion"
    safe = able[both <= error]
    if safe.empty:
        return (f"{said}; no measured setting meets {error:g} without",)
    first = safe.iloc[0]
    return (f"{said}; without, {setting_of(first.to_dict())} takes {milliseconds(first['cpu_s'])}",)


def _why_not(mine: pd.DataFrame, error: float, budget_s: float | None) -> tuple[str, ...]:
    able = reaching(mine, error)
    if budget_s is not None and len(able):
        needs = able["cpu_s"].iloc[0]
        return (f"an error of {error:g} takes {needs:.2g} s; this is the best within {budget_s:g} s",)
    best = mine.sort_values("sure").iloc[0]
    said = [
        f"the measured range does not reach {error:g}: it ends at {best['robust_error']:.2g} "
        f"± {best['reference_error']:.1g}"
    ]
    floor = mine["reference_error"].min()
    if error <= floor:
        said.append(
            f"{error:g} is below the reference's own uncertainty, {floor:.1g}: no run can guarantee it"
        )
    return tuple(said)


def _others(rows: pd.DataFrame, chosen: pd.Series) -> pd.DataFrame:
    """The first row of each other kind, and the next of the same kind with another text."""
    told = setting_of(chosen.to_dict())
    rows = rows[np.array([setting_of(line) != told for line in rows.to_dict("records")], dtype=bool)]
    kind = kinds_of(rows)
    shown = rows.assign(kind=kind, ratio=rows["cpu_s"] / chosen["cpu_s"]).drop_duplicates("kind")
    return shown.sort_values("ratio").head(5)


# --- running it ----------------------------------------------------------------------------------------------


def scene_name(given: str) -> str:
    """The base scene a user means by its name or the beginning of it.

    Raises
    ------
    RecommendError
        If there is none, or more than one.
    """
    names = [base.scene.name for base in moving_scenes()]
    found = [n for n in names if n == given] or [n for n in names if n.startswith(given)]
    if len(found) != 1:
        raise RecommendError(f"scene {given!r} is unknown; allowed are {', '.join(names)}")
    return found[0]


@dataclass(frozen=True)
class Origin:
    """A case, and how a script comes to its scene.

    Parameters
    ----------
    case : Case
    file : str
        The user's file; empty for a scene that is built in, which is written out.
    """

    case: Case
    file: str = ""

    @classmethod
    def of(cls, line: Mapping[Any, Any]) -> "Origin":
        """The base scene of a row of the points."""
        return cls(base_of(str(line["scene"])))


def case_of(line: Mapping[Any, Any], base: Case) -> Trial:
    """The run of a row of the points."""
    options = tuple((k, float(line[k])) for k in ("tolerance", "newton_tolerance") if line[k] > 0)
    dt, elements = float(line["dt"]), "1" if line["elements"] == NO_BEAMS else str(line["elements"])
    # a table keeps nine digits; a run of a million steps needs them all
    step = base.interval / round(base.interval / dt) if dt > 0 else dt
    return Trial(
        with_stretch(base.scene, stretch_of(line)), str(line["solver"]),
        tuple(int(n) for n in elements.split("/")),
        element=str(line["family"]), quadrature="full" if line["quadrature"] == "-" else str(line["quadrature"]),
        integrator=str(line["integrator"]), dt=step, t_end=base.duration, output_dt=base.interval, options=options,
        own=read_own(own_of(line)),
    )  # fmt: skip


def script(line: Mapping[Any, Any], origin: Origin | None = None) -> str:
    """The script that runs a row of the points; of the base scene of its name without an origin."""
    origin = origin or Origin.of(line)
    case, trial = origin.case, case_of(line, origin.case)
    run = trial.run()
    if not case.scene.beams:
        run = replace(run, mesh=None, element=Discretisation.element, quadrature=Discretisation.quadrature)
    if origin.file:
        return snippet_of_file(origin.file, case.name, run, trial.solver, case.probes, own_of(line))
    return snippet(trial.scene, run, trial.solver, case.probes, own_of(line))


def rerun(
    line: Mapping[Any, Any],
    histories: pd.DataFrame,
    error: float | None,
    met: bool,
    origin: Origin | None = None,
) -> Rerun:
    """Run the script of a row of the points and measure its error against the kept reference.

    Parameters
    ----------
    line : mapping
    histories : DataFrame
        Of the references.
    error : float or None
        Target.
    met : bool
        Whether the table says that the target error is met; else the measured error has to come again.
    origin : Origin, optional
        As of `script`.
    """
    text, found = compile(script(line, origin), "<recommended>", "exec"), []
    with undisturbed():
        for _ in range(REPEATS + 1):  # the first one compiles
            space: dict[str, Any] = {}
            with redirect_stdout(StringIO()):
                exec(text, space)
            found.append(space["solution"])
    wrong = error_against(found[-1], histories, str(line["scene"]), str(line["family"]))
    limit = error if error is not None and met else SAME * line["error"] + line["reference_error"]
    sure = wrong + line["reference_error"]
    return Rerun(wrong, least([s.cost for s in found[1:]]).cpu_s, str(found[-1].status), bool(sure <= limit))


def error_against(solution: Any, histories: pd.DataFrame, scene: str, element: str) -> float:
    """Error of a solution against the kept history of a reference; NaN if it is not whole.

    Raises
    ------
    RecommendError
        If the history has other output times: it is that of another case.
    """
    if not solution.status.ok:
        return float("nan")
    of_scene = histories[histories["scene"] == scene]
    mine = of_scene[of_scene["element"] == continuum_of(element, of_scene["element"].unique())]
    errors = []
    for (body, key), path in mine.groupby(["body", "fraction"], sort=False):
        place = _place(solution.scene, str(body), key)
        _check_times(scene, solution.t, path["t"].to_numpy(float))
        known = path[["u_x", "u_y"]].to_numpy(float)
        errors.append(history_error(solution.displacement(place), known, rounding_at(solution, place)))
    return worst(errors)


def _check_times(scene: str, mine: NDArray[np.float64], known: NDArray[np.float64]) -> None:
    """Refuse a history whose samples are not those of a run, except for the digits that tables keep."""
    step = known[-1] / max(len(known) - 1, 1)
    if mine.shape != known.shape or not np.allclose(mine, known, rtol=0.0, atol=SAME_TIME * step):
        told = (f"{len(t) - 1} outputs up to {t[-1]:g} s" for t in (known, mine))
        raise RecommendError(
            "the table's reference of scene {!r} has {}, and the case now {}: it was measured before the case was "
            "changed; `anctmm study trade` measures it anew".format(scene, *told)
        )


def _place(scene: Scene, body: str, key: Any) -> str | tuple[str, float]:
    """A probe as a table has it: a fraction of a beam's length, or a point of another body."""
    beams = {beam.name for beam in scene.beams}
    return (body, float(key)) if body in beams else f"{body}.{key}"
