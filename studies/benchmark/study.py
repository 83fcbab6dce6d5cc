"""`anctmm bench`: what kernels and steps cost beside peers, at any length and topology; what a newcomer waits for."""

from collections.abc import Callable, Mapping

import pandas as pd
from rich.console import Console
from rich.table import Table as RichTable

from studies.benchmark import pictures as bench_pictures
from studies.benchmark.additions import added_costs
from studies.benchmark.calls import call_costs
from studies.benchmark.first import first_results
from studies.benchmark.kernels import compile_solvers, kernel_costs
from studies.benchmark.length import digits, direct_checks, length_costs
from studies.benchmark.peak import rates
from studies.benchmark.peers import DENSE, OURS, SPARSE, exudyn_at_like_settings, methods
from studies.benchmark.precision import equal_error
from studies.benchmark.required import requirements
from studies.benchmark.topology import topology_costs
from studies.engine.console import say, show_table
from studies.engine.measuring.clock import Effort, Samples, records
from studies.engine.study import Result
from studies.engine.tables import Table, text


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
    say("trees and ladders")
    add(topology_costs(effort, samples))
    say("a direct solver at length")
    add(direct_checks(effort, samples), digits(effort))
    say("first results of a newcomer")
    add(first_results(effort, samples))
    required = requirements({name: t.frame for name, t in tables.items()}, quick)
    raw = Table(
        "samples", "Raw samples: CPU time of a unit of work, or as they say", pd.DataFrame(samples.rows)
    )
    return Result(
        "bench",
        "Benchmark",
        "What does a step cost, beside other codes, at any length, and what is left to gain?",
        findings(tables),
        (
            "One process, one thread, garbage collection off, contestants in turn after a round that compiles; "
            "what one thing adds is measured so in several processes, one after another; first results are those of "
            "whole processes, which may use every core.",
        ),
        (required, *tables.values(), raw),
        bench_pictures.pictures(tables, required),
    )


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
