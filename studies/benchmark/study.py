"""`anctmm bench`: what the kernels cost, beside peers, at any length, and how far they are from the core's limit."""

from collections.abc import Callable, Mapping
from typing import Any

import pandas as pd
from rich.console import Console
from rich.table import Table as RichTable

from studies.benchmark import pictures as bench_pictures
from studies.benchmark.additions import ELEMENTS, MOST_ADDED, PLAIN, added_costs
from studies.benchmark.calls import AGAIN, MOST_BUILD, call_costs
from studies.benchmark.kernels import compile_solvers, kernel_costs
from studies.benchmark.length import BASE, digits, direct_checks, length_costs
from studies.benchmark.peak import rates
from studies.benchmark.peers import DENSE, OURS, SPARSE, exudyn_at_like_settings, methods
from studies.benchmark.precision import equal_error
from studies.engine.console import say, show_table
from studies.engine.measuring.clock import Effort, Samples, records
from studies.engine.study import Result
from studies.engine.tables import Table, text

#: Bounds of memory, bytes of an element; of a difference to a direct solver; of the ratio of times of two lengths.
MOST_BYTES, MOST_DIFFERENCE, MOST_RATIO = 1500.0, 1e-10, 1.5


def bench(quick: bool = False, say: Callable[[str], None] = lambda text: None) -> Result:
    """Run all of the benchmark in this process, on one thread, contestants in turn.

    Parameters
    ----------
    quick : bool
        Smaller lengths and fewer repeats.
    say : callable
        Told what is measured now.

    Returns
    -------
    Result
    """
    effort, samples, tables = Effort(quick), Samples(), {}

    def add(*made: Table) -> None:
        tables.update({t.name: t for t in made})

    say("what a solver compiles")
    compile_solvers()  # before its kernels are compiled apart, as a user has them
    say("kernels")
    add(kernel_costs(effort, samples))
    say("arithmetic and the core's peak")
    add(rates(effort, samples, tables["kernels"]))
    say("Exudyn at like settings")
    add(exudyn_at_like_settings(effort, samples))
    say("Exudyn at equal error")
    add(*equal_error(effort, samples))
    say("the global solver")
    add(methods(effort, samples))
    say("cost against length")
    add(length_costs(effort, samples))
    say("what one thing adds")
    add(added_costs(effort, samples))
    say("calls beside their steps")
    add(call_costs(effort, samples))
    say("a direct solver at length")
    add(direct_checks(effort, samples), digits(effort))
    required = requirements({name: t.frame for name, t in tables.items()}, quick)
    raw = Table("samples", "Raw samples, CPU time of a unit of work", pd.DataFrame(samples.rows))
    return Result(
        "bench",
        "Benchmark",
        "What does a step cost, beside other codes, at any length, and what is left to gain?",
        findings(tables),
        (
            "One process, one thread, garbage collection off, contestants in turn after a round that compiles; "
            "what one thing adds is measured so in several processes, one after another.",
        ),
        (required, *tables.values(), raw),
        bench_pictures.pictures(tables, required),
    )


def requirements(frames: Mapping[str, pd.DataFrame], quick: bool) -> Table:
    """What is required of speed, size and accuracy, and what was found.

    Parameters
    ----------
    frames : mapping of table name to DataFrame
    quick : bool
        Whether lengths are those of a quick run.
    """
    rows = [
        *_explicit(frames["exudyn"]), *_equal_error(frames["equal_error"]), *_methods(frames["methods"]),
        *_length(frames["length"]), *_additions(frames["additions"]), *_calls(frames["calls"]),
        *_direct(frames["direct"]),
    ]  # fmt: skip
    frame = pd.DataFrame(rows)
    met = frame["found"] >= frame["required"]
    frame["met"] = met.where(frame["sense"] == "at least", frame["found"] <= frame["required"])
    frame = frame[["what", "found", "sense", "required", "goal", "met", "status"]]
    notes: tuple[str, ...] = (
        "Ratios with their required bounds; `goal` is the target. All values are from this run.",
    )
    if quick:
        notes += ("A quick run: lengths and repeats are smaller than those the requirements speak of.",)
    return Table("requirements", "Required and found", frame, notes)


def _line(what: str, found: float, required: float, goal: float, sense: str, status: str) -> dict[str, Any]:
    return {
        "what": what, "found": found, "sense": sense, "required": required, "goal": goal, "status": status,
    }  # fmt: skip


def _explicit(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"Exudyn / ANC-TMM, explicit, {r['scene']}, {r['elements']} elements",
            r["ratio"],
            7.0,
            12.0,
            "at least",
            r["status"],
        )
        for r in records(frame[frame["integrator"] == "zhai"])
    ]


def _equal_error(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"Exudyn / ANC-TMM, implicit, {r['scene']}, error {r['error']:g}",
            r["ratio_implicit"], 8.0, 15.0, "at least", r["status"],
        )
        for r in records(frame)
    ]  # fmt: skip


def _methods(frame: pd.DataFrame) -> list[dict[str, Any]]:
    bounds = {(DENSE, "2/8/2"): (40.0, 100.0), (DENSE, "8/32/8"): (400.0, float("nan"))}
    rows = []
    for r in records(frame[frame["method"] != OURS]):
        required, goal = bounds.get((r["method"], r["elements"]), (1.0, float("nan")))
        what = f"{r['method']} / ANC-TMM, explicit, four-bar {r['elements']}"
        rows.append(_line(what, r["ratio"], required, goal, "at least", r["status"]))
    return rows


def _length(frame: pd.DataFrame) -> list[dict[str, Any]]:
    lines = []
    longest = frame.groupby(["element", "integrator", "bodies"], sort=False).tail(1)
    for r in records(longest):
        what = f"{r['element']}, {r['integrator']}, {r['elements']} elements in {r['bodies']} bodies"
        time = f"time of an element and step / that at {BASE}: {what}"
        lines.append(_line(time, r["ratio"], MOST_RATIO, 1.0, "at most", r["status"]))
        size = f"bytes of an element: {what}"
        lines.append(_line(size, r["bytes"], MOST_BYTES, float("nan"), "at most", r["status"]))
    return lines


def _additions(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"step of {ELEMENTS} elements with {r['added']} / without: {r['integrator']}, {r['along']}",
            r["ratio"], 1.0 + MOST_ADDED, 1.0, "at most", r["status"],
        )
        for r in records(frame[frame["added"] != PLAIN])
    ]  # fmt: skip


def _calls(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"s that a call takes beside its steps: {r['scene']} again, {r['integrator']}",
            r["build_s"], MOST_BUILD, float("nan"), "at most", r["status"],
        )
        for r in records(frame[frame["call"] == AGAIN])
    ]  # fmt: skip


def _direct(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"accelerations less a banded direct solve's: {r['element']}, {r['elements']} elements "
            f"in {r['bodies']} bodies",
            r['difference'], MOST_DIFFERENCE, float("nan"), "at most", r['status'],
        )
        for r in records(frame[frame["what"] == "accelerations"])
    ]  # fmt: skip


def findings(tables: Mapping[str, Table]) -> tuple[str, ...]:
    """Sentences with numbers from the tables: how much of the gain is the method."""
    frame = tables["methods"].frame
    said = []
    for elements in frame["elements"].unique():
        by = {r["method"]: r for r in records(frame[frame["elements"] == elements])}
        dense, sparse = by[DENSE]["ratio"], by[SPARSE]["ratio"]
        shares = {method: f"{100.0 * r['share_forces']:.0f} %" for method, r in by.items()}
        said.append(
            f"Four-bar {elements}: {dense:.3g} times less than {DENSE}. Of this {dense / sparse:.3g} times is what "
            f"any solver gains by factoring its sparse constant matrix once; {sparse:.3g} times is ANC-TMM's own. "
            f"Elastic forces are {shares[OURS]} of its step and {shares[SPARSE]} of the sparse solver's; "
            "all three share the compiled element kernels."
        )
    return tuple(said)


def glance(result: Result, console: Console) -> None:
    """Print what is required beside what was found."""
    shown = RichTable(title="Required and found", title_justify="left", title_style="bold", box=None)
    for head, numeric in (
        ("", False),
        ("found", True),
        ("", False),
        ("required", True),
        ("goal", True),
        ("", False),
    ):
        shown.add_column(head, justify="right" if numeric else "left", header_style="dim")
    for r in records(result.table("requirements").frame):
        verdict = "" if r["status"] == "ok" else r["status"]
        shown.add_row(
            r["what"], text(float(r["found"])), r["sense"], text(float(r["required"])), text(float(r["goal"])),
            verdict or ("met" if r["met"] else "missed"),
        )  # fmt: skip
    show_table(console, shown)
    for finding in result.findings:
        say(console, f"• {finding}")
