"""`anctmm bench`: the cost of a step of scenes of several kinds, beside other solvers, and at length."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console
from rich.table import Table as RichTable

from anctmm.errors import AnctmmError
from anctmm.model.needs import needs
from anctmm.solvers import registry
from studies.benchmark.scenes import DENSE, EXUDYN, LONG, SPARSE, Item, items, sampled
from studies.engine.study import Result
from studies.engine.tables import Table
from studies.engine.timing import in_turn

#: Measured rounds, by whether the run is quick.
ROUNDS = {False: 7, True: 3}
NOTES = (
    "CPU times on one thread, garbage collection off; contestants in turn after one unmeasured round; medians of the "
    "rounds, spread: (largest − smallest) / median. ratio: of a solver's time to the first's, median over the rounds.",
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
RUN = ["contest", "steps_kind", "elements"]
Sample = dict[str, Any]
#: A call of an item by each of its contestants, or why it is not timed.
Calls = Callable[[Item], Mapping[str, Callable[[], Sample] | str]]


def solvers_of(item: Item, quick: bool) -> dict[str, Callable[[], Sample] | str]:
    """The solvers of an item; not those that declare features of its scene for verification, not for speed."""
    scene, run, calls = item.made(), item.run(quick), dict[str, Callable[[], Sample] | str]()
    for name in item.solvers:
        offer = registry.offer_of(registry.load(name))
        slow = sorted(offer.slow_with & {feature for feature, _ in needs(scene)})
        call = partial(sampled, partial(registry.solver(name), scene, run))
        calls[name] = f"not timed: {', '.join(slow)} are not made for speed" if slow else call
    return calls


def measured(
    every: Iterable[Item], calls_of: Calls, rounds: int, say: Callable[[str], None]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A row an item and contestant, and raw samples; a contestant that cannot run is a row that says so."""
    rows, raw = list[dict[str, Any]](), list[dict[str, Any]]()
    for item in every:
        say(item.name)
        head = {"contest": item.contest, "steps_kind": item.kind, "elements": item.elements}
        calls = calls_of(item)
        status = {name: call if isinstance(call, str) else _status(call) for name, call in calls.items()}
        rows += [{**head, "solver": name, "status": said} for name, said in status.items() if said != "ok"]
        timed: dict[str, Any] = {name: call for name, call in calls.items() if status[name] == "ok"}
        for name, samples in in_turn(timed, rounds).items():
            raw += [{**head, "solver": name, "round": k, **sample} for k, sample in enumerate(samples)]
    frame = pd.DataFrame(raw)
    return pd.concat([summary(frame) if raw else frame, pd.DataFrame(rows)], ignore_index=True), frame


def _status(call: Callable[[], Sample]) -> str:
    try:
        return str(call()["status"])
    except AnctmmError as error:
        return f"refused: {error}"


def summary(raw: pd.DataFrame) -> pd.DataFrame:
    """Medians and spreads of all contestants, and their ratios to the first, which ran in the same rounds."""
    step_s, corrections = (
        raw["steps_s"] / raw["steps"].clip(lower=1),
        raw["corrections"] / raw["steps"].clip(lower=1),
    )
    raw = raw.assign(step_s=step_s, corrections_step=corrections.replace(0.0, np.nan))
    names = ["step_s", "call_s", "corrections_step"]
    first = raw[raw["solver"] == raw.groupby(RUN)["solver"].transform("first")]
    raw = raw.merge(first[[*RUN, "round", *names]], on=[*RUN, "round"], suffixes=("", "_first"))
    ratio = {name: raw[name] / raw[f"{name}_first"] for name in names}
    raw = raw.assign(
        ns_element_step=1e9 * raw["step_s"] / raw["elements"], call_ms=1e3 * raw["call_s"], ratio_call=ratio["call_s"],
        ratio_step=ratio["step_s"], ratio_correction=ratio["step_s"] / ratio["corrections_step"],
    )  # fmt: skip
    groups = raw.groupby([*RUN, "solver"], sort=False)
    medians = groups[[
        "coordinates", "steps", "ns_element_step", "corrections_step", "ratio_step", "ratio_correction", "call_ms",
        "ratio_call",
    ]].median()  # fmt: skip
    spread = groups["step_s"].agg(lambda times: float(np.ptp(times) / times.median()))
    return medians.assign(spread=spread, repeats=groups.size(), status="ok").reset_index()


def bench(quick: bool = False, say: Callable[[str], None] = lambda text: None) -> Result:
    """Run the benchmark in this process, on one thread.

    Parameters
    ----------
    quick : bool
        Smaller scenes, shorter runs and fewer rounds.
    say : callable
        Receives the name of each item.
    """
    table, raw = measured(items(quick), lambda item: solvers_of(item, quick), ROUNDS[quick], say)
    long = table["contest"] == LONG
    return Result(
        "bench", "Benchmark", "What does a step cost, beside other solvers, and at length?", findings(table), (),
        (
            Table("contests", "Cost of a step", table[~long], NOTES),
            Table("length", "Cost of a step at length", table[long], NOTES[:2]),
            Table("samples", "Raw samples", raw),
        ),
    )  # fmt: skip


def findings(table: pd.DataFrame) -> tuple[str, ...]:
    """Sentences with numbers from the table."""
    known = table[table["status"] == "ok"]
    peers = known[known["solver"] == EXUDYN].groupby("steps_kind", sort=False)
    paper = known[known["contest"].str.contains("the paper's")].groupby("elements")
    long = known[known["contest"] == LONG].groupby("steps_kind", sort=False)
    return (
        *(_beside_exudyn(str(kind), rows) for kind, rows in peers),
        *(_gain(n, rows.set_index("solver")["ratio_step"]) for n, rows in paper if len(rows) == 3),
        *(_at_length(str(kind), rows) for kind, rows in long),
    )


def _beside_exudyn(kind: str, rows: pd.DataFrame) -> str:
    def between(column: str) -> str:
        return f"{rows[column].min():.2g} to {rows[column].max():.2g} times"

    by_correction = f"; by Newton correction {between('ratio_correction')}." if kind == "implicit" else "."
    return (
        f"Exudyn takes {between('ratio_step')} as long for a step, {between('ratio_call')} for the whole call, at like "
        f"settings ({kind}, {rows['elements'].min()} to {rows['elements'].max()} elements, one thread){by_correction}"
    )


def _gain(elements: Any, ratio: "pd.Series[float]") -> str:
    dense, sparse = ratio[DENSE], ratio[SPARSE]
    return (
        f"The paper's four-bar of {elements} elements: ANC-TMM's step takes {dense:.3g} times less than a global "
        f"solver's that factors a dense matrix in each step. Of this {dense / sparse:.3g} times is the gain of a "
        f"sparse matrix that is factored once, {sparse:.3g} times is the method's."
    )


def _at_length(kind: str, rows: pd.DataFrame) -> str:
    ns, size = rows["ns_element_step"], rows["coordinates"]
    return (
        f"At {size.max():,.0f} coordinates an element and {kind} step costs {ns.iloc[-1] / ns.iloc[0]:.2g} times as "
        f"much as at {size.min():,.0f}."
    )


def glance(result: Result, console: Console) -> None:
    """Print both tables and the findings."""
    show(pd.concat([result.table(name).frame for name in ("contests", "length")]), result.title, console)
    for finding in result.findings:
        console.print(f"• {finding}")


def show(frame: pd.DataFrame, title: str, console: Console) -> None:
    """Print the rows of `measured`."""
    shown = RichTable(title=title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    for head in SHOWN.values():
        shown.add_column(head, header_style="dim")
    for row in frame.to_dict("records"):
        if row["status"] == "ok":
            shown.add_row(*(f"{row[c]:.3g}" if isinstance(row[c], float) else str(row[c]) for c in SHOWN))
        else:
            shown.add_row(row["contest"], row["steps_kind"], row["solver"], "", row["status"][:60])
    console.print(shown)
