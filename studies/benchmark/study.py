"""`anctmm bench`: the cost of a step of scenes of several kinds, beside other solvers, and at length."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import pandas as pd
from rich.console import Console
from rich.table import Table as RichTable

from anctmm.errors import AnctmmError
from anctmm.model.needs import needs
from anctmm.solvers import registry
from studies.benchmark.contests import DENSE, EXUDYN, OURS, SPARSE, Contest, contests, lengths
from studies.benchmark.timing import Sample, in_turn, sampled, summary

#: Measured rounds, by whether the run is quick.
ROUNDS = {False: 7, True: 3}
NOTES = (
    "CPU times on one thread, garbage collection off; contestants in turn after one unmeasured round; medians of the "
    "rounds, spread: (largest − smallest) / median. ratio: of a solver's time to ANC-TMM's, median over the rounds.",
    "ns_element_step: time of a step over the number of elements; call_ms: the whole call of a run of so many steps, "
    "without compiling. ratio_correction: the ratio of times over the ratio of Newton corrections.",
    "like settings: cables, reduced quadrature, the same step; each solver's own Newton tolerance, so that corrections "
    "per step differ. Exudyn: one thread, modified Newton, the faster of its linear solvers, no files.",
    "the paper's elements: the global solver factors its matrix densely in each step, or sparsely and once.",
)
SHOWN = {
    "contest": "scene", "steps_kind": "steps", "solver": "solver", "elements": "elements",
    "ns_element_step": "ns", "spread": "spread", "corrections_step": "corr.", "ratio_step": "ratio",
    "ratio_correction": "by corr.", "ratio_call": "whole call",
}  # fmt: skip


def measured(
    every: Iterable[Contest], rounds: int, say: Callable[[str], None]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows of all contests, a row a solver, and their raw samples; a solver that cannot run is a row that says so."""
    rows: list[dict[str, Any]] = []
    raw: list[dict[str, Any]] = []
    for contest in every:
        say(f"{contest.name}, {contest.steps}, {contest.elements} elements")
        head = {"contest": contest.name, "steps_kind": contest.steps}
        calls: dict[str, Callable[[], Any]] = {}
        for name in contest.solvers:
            call = partial(_solve, name, contest)
            status = _why_not(name, contest) or _status(call)
            if status == "ok":
                calls[name] = call
            else:
                rows.append({**head, "solver": name, "elements": contest.elements, "status": status})
        for name, samples in (found := in_turn(calls, rounds)).items():
            base = found.get(OURS, samples)
            rows.append({**head, "solver": name, **summary(samples, base, contest.elements)})
            raw += [_raw(head, name, contest, k, sample) for k, sample in enumerate(samples)]
    return rows, raw


def _why_not(name: str, contest: Contest) -> str:
    """Why a solver is not timed on a scene: it declares features that it has for verification, not for speed."""
    offer = registry.offer_of(registry.load(name))
    slow = sorted(offer.slow_with & {feature for feature, _ in needs(contest.scene)})
    return f"not timed: {', '.join(slow)} are not made for speed" if slow else ""


def _status(call: Callable[[], Any]) -> str:
    try:
        return sampled(call).status
    except AnctmmError as error:
        return f"refused: {error}"


def _solve(name: str, contest: Contest) -> Any:
    return registry.solver(name)(contest.scene, contest.run)


def _raw(head: dict[str, Any], name: str, contest: Contest, k: int, sample: Sample) -> dict[str, Any]:
    return {**head, "solver": name, "elements": contest.elements, "round": k, **vars(sample)}


def bench(quick: bool = False, say: Callable[[str], None] = lambda text: None) -> Any:
    """Run the benchmark in this process, on one thread.

    Parameters
    ----------
    quick : bool
        Smaller scenes, shorter runs and fewer rounds.
    say : callable
        Receives the name of each contest.

    Returns
    -------
    Result
    """
    from studies.engine.study import Result
    from studies.engine.tables import Table

    rows, raw = measured(contests(quick), ROUNDS[quick], say)
    long_rows, long_raw = measured(lengths(quick), 3, say)
    table, long = pd.DataFrame(rows), pd.DataFrame(long_rows)
    return Result(
        "bench", "Benchmark", "What does a step cost, beside other solvers, and at length?",
        findings(table, long), (),
        (
            Table("contests", "Cost of a step", table, NOTES),
            Table("length", "Cost of a step at length", long, NOTES[:2]),
            Table("samples", "Raw samples", pd.DataFrame(raw + long_raw)),
        ),
    )  # fmt: skip


def findings(table: pd.DataFrame, long: pd.DataFrame) -> tuple[str, ...]:
    """Sentences with numbers from the tables."""
    said = []
    known = table[table["status"] == "ok"]
    for kind, rows in known[known["solver"] == EXUDYN].groupby("steps_kind", sort=False):
        low, high = rows["ratio_step"].min(), rows["ratio_step"].max()
        whole = rows["ratio_call"].min(), rows["ratio_call"].max()
        by_correction = rows["ratio_correction"].dropna()
        said.append(
            f"Exudyn takes {low:.2g} to {high:.2g} times as long for a step, {whole[0]:.2g} to {whole[1]:.2g} times "
            f"for the whole call, at like settings ({kind}, {rows['elements'].min()} to {rows['elements'].max()} "
            "elements, one thread)"
            + (f"; by Newton correction {by_correction.min():.2g} to {by_correction.max():.2g} times." if len(
                by_correction) else ".")
        )  # fmt: skip
    for elements, rows in known[known["contest"].str.contains("paper")].groupby("elements"):
        ratio = rows.set_index("solver")["ratio_step"]
        if {DENSE, SPARSE} <= set(ratio.index):
            said.append(
                f"The paper's four-bar of {elements} elements: ANC-TMM's step takes {ratio[DENSE]:.3g} times less "
                f"than a global solver's that factors a dense matrix in each step. Of this "
                f"{ratio[DENSE] / ratio[SPARSE]:.3g} times is the gain of a sparse matrix that is factored once, "
                f"{ratio[SPARSE]:.3g} times is the method's."
            )
    for kind, rows in long[long["status"] == "ok"].groupby("steps_kind", sort=False):
        ns = rows.set_index("elements")["ns_element_step"]
        said.append(
            f"At {rows['coordinates'].max():,.0f} coordinates an element and {kind} step costs "
            f"{ns.iloc[-1] / ns.iloc[0]:.2g} times as much as at {rows['coordinates'].min():,.0f}."
        )
    return tuple(said)


def glance(result: Any, console: Console) -> None:
    """Print both tables and the findings."""
    shown = RichTable(title=result.title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    for head in SHOWN.values():
        shown.add_column(head, header_style="dim")
    frame = pd.concat([result.table(name).frame for name in ("contests", "length")])
    for row in frame.to_dict("records"):
        if row["status"] == "ok":
            shown.add_row(*(f"{row[c]:.3g}" if isinstance(row[c], float) else str(row[c]) for c in SHOWN))
        else:
            shown.add_row(row["contest"], row["steps_kind"], row["solver"], "", row["status"][:60])
    console.print(shown)
    for finding in result.findings:
        console.print(f"• {finding}")
