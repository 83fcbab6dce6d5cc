"""`anctmm bench`: the cost of a step of scenes of several kinds, beside other solvers, and at length."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console

from anctmm.errors import AnctmmError
from anctmm.model.needs import needs
from anctmm.solvers import registry
from studies.benchmark.scenes import LONG, Item, items, sampled
from studies.engine.study import Result
from studies.engine.tables import Table, show_frame
from studies.engine.timing import in_turn

#: Measured rounds, by whether the run is quick.
ROUNDS = {False: 7, True: 3}
NOTES = (
    "CPU times on one thread, garbage collection off; contestants in turn after one unmeasured round; medians of the "
    "rounds, spread: (largest − smallest) / median. ratio: of a solver's time to the first's, median over the rounds.",
    "ns_element_step: time of a step over the number of elements; call_ms: the whole call of a run of so many steps, "
    "without compiling.",
    "like settings: cables, reduced quadrature, the same step; each solver's own Newton tolerance, so that corrections "
    "per step differ. Exudyn: one thread, modified Newton, the faster of its linear solvers, no files.",
    "the paper's elements: the global solver factors its matrix densely in each step, or sparsely and once.",
)
SHOWN = [
    "contest", "steps_kind", "solver", "elements", "ns_element_step", "spread", "corrections_step", "ratio_step",
    "ratio_call", "status",
]  # fmt: skip
RUN = ["contest", "steps_kind", "elements"]
MEDIANS = [
    "coordinates", "steps", "ns_element_step", "corrections_step", "ratio_step", "call_ms", "ratio_call",
]  # fmt: skip
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
    every: Iterable[Item], calls_of: Calls, rounds: int, tell: Callable[[str], None]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A row an item and contestant, and raw samples; a contestant that cannot run is a row that says so."""
    rows, raw = list[dict[str, Any]](), list[dict[str, Any]]()
    for item in every:
        tell(item.name)
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
    steps = raw["steps"].clip(lower=1)
    raw = raw.assign(step_s=raw["steps_s"] / steps, corrections_step=raw["corrections"] / steps)
    first = raw[raw["solver"] == raw.groupby(RUN)["solver"].transform("first")]
    raw = raw.merge(first[[*RUN, "round", "step_s", "call_s"]], on=[*RUN, "round"], suffixes=("", "_first"))
    raw = raw.assign(
        ns_element_step=1e9 * raw["step_s"] / raw["elements"],
        ratio_step=raw["step_s"] / raw["step_s_first"],
        call_ms=1e3 * raw["call_s"],
        ratio_call=raw["call_s"] / raw["call_s_first"],
    )
    groups = raw.groupby([*RUN, "solver"], sort=False)
    spread = groups["step_s"].agg(lambda times: float(np.ptp(times) / times.median()))
    medians = groups[MEDIANS].median()
    return medians.assign(spread=spread, repeats=groups.size(), status="ok").reset_index()


def bench(quick: bool = False, tell: Callable[[str], None] = lambda text: None) -> Result:
    """Run the benchmark in this process, on one thread.

    Parameters
    ----------
    quick : bool
        Smaller scenes, shorter runs and fewer rounds.
    tell : callable
        Receives the name of each item.
    """
    table, raw = measured(items(quick), lambda item: solvers_of(item, quick), ROUNDS[quick], tell)
    long = table["contest"] == LONG
    tables = (
        Table("contests", "Cost of a step", table[~long], NOTES),
        Table("length", "Cost of a step at length", table[long], NOTES[:2]),
        Table("samples", "Raw samples", raw),
    )
    question = "What does a step cost, beside other solvers, and at length?"
    return Result("bench", "Benchmark", question, (), (), tables)


def show(frame: pd.DataFrame, title: str, console: Console) -> None:
    """Print the rows of `measured`."""
    show_frame(console, title, frame.reindex(columns=SHOWN))
