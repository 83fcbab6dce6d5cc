"""The command line. Whatever is slow to import is imported by the command that needs it."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from studies.recommend import Measured
    from studies.runner import Case, Mesh, Runner
    from studies.study import Options

app = typer.Typer(
    help="Accuracy, stability and cost of planar flexible multibody solvers.",
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False,
)  # fmt: skip

Elements = Annotated[
    str | None,
    typer.Option(help="Meshes: elements of each body, or of all: 2/8/2,4/16/4 or 8,16.", metavar="LIST"),
]
Steps = Annotated[str | None, typer.Option("--dt", help="Time steps, s: 1e-5,5e-6.", metavar="LIST")]
Solvers = Annotated[
    str | None, typer.Option(help="Solvers by name (see `anctmm list`): a,b.", metavar="LIST")
]
Quick = Annotated[bool, typer.Option("--quick", help="The smallest sweep that shows the point.")]


class BadOption(Exception):
    """An option's value cannot be read."""


def main() -> None:
    """Entry point: errors of ours are one line and exit code 2, an interrupt says what is kept."""
    from anctmm.errors import AnctmmError

    try:
        app()
    except (AnctmmError, BadOption) as error:
        print(f"anctmm: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:
        print(f"anctmm: {error}", file=sys.stderr)
        sys.exit(2)


@app.command("list")
def list_() -> None:
    """Scenes, solvers and studies."""
    from rich.console import Console
    from rich.table import Table

    from anctmm import registry
    from studies.scenes import BASE_SCENES
    from studies.study import STUDIES

    def table(title: str, *columns: str) -> Table:
        shown = Table(title=title, title_justify="left", header_style="bold", box=None, padding=(0, 2, 0, 0))
        for column in columns:
            shown.add_column(column, overflow="fold")
        return shown

    scenes = table("Scenes", "name", "bodies", "probes", "source")
    for build in BASE_SCENES:
        base = build()
        bodies = ", ".join(b.name for b in base.scene.bodies)
        scenes.add_row(base.scene.name, bodies, ", ".join(map(_probe, base.probes)), base.source)
    solvers = table("Solvers", "name", "from")
    for name, origin in registry_origins(registry.GROUP):
        solvers.add_row(name, origin)
    studies = table("Studies", "name", "question")
    for name, (_, question) in STUDIES.items():
        studies.add_row(name, question)
    console = Console()
    for shown in (scenes, solvers, studies):
        console.print(shown, "")


@app.command()
def study(
    name: Annotated[str, typer.Argument(help="four-bar, cantilever, … (see `anctmm list`)")],
    elements: Elements = None,
    dt: Steps = None,
    solvers: Solvers = None,
    quick: Quick = False,
    out: Annotated[Path, typer.Option(help="Where tables and pictures go.")] = Path("results"),
) -> None:
    """Run one study: tables as CSV and Markdown, pictures as SVG."""
    from rich.console import Console

    from studies.glance import glance
    from studies.study import find, write

    run = find(name)
    options = read_options(elements, dt, solvers, quick)
    with sweeping(quick) as runner:
        result = run(options, runner)
    folder = write(result, out)
    glance(result, Console())
    print(f"\nWritten to {folder}/")


@app.command()
def report(
    quick: Quick = False,
    out: Annotated[Path, typer.Option(help="Where the page, tables and pictures go.")] = Path("reports"),
) -> None:
    """Run every study and write one page."""
    from studies.page import write_page
    from studies.study import STUDIES, Options, find, write

    results = []
    with sweeping(quick) as runner:
        for name in STUDIES:
            results.append(find(name)(Options(quick=quick), runner))
    for result in results:
        write(result, out)
    print(f"Written to {write_page(results, out, quick)}")


@app.command()
def recommend(
    scene: Annotated[str, typer.Argument(help="four-bar or cantilever-fall, or the beginning of it.")],
    error: Annotated[str | None, typer.Option(help="Error wished, relative: 1e-3.", metavar="NUMBER")] = None,
    budget: Annotated[
        str | None, typer.Option(help="CPU time that may be spent: 0.5s, 20ms.", metavar="TIME")
    ] = None,
    element: Annotated[str | None, typer.Option(help="Only this kind: cable, shear, reissner.")] = None,
    table: Annotated[
        Path | None,
        typer.Option(
            help="Directory of a measured trade; else reports/trade, results/trade, or measure now."
        ),
    ] = None,
    rerun: Annotated[bool, typer.Option(help="Run the recommendation and check its error.")] = True,
) -> None:
    """Print the cheapest measured setting for an error, or the best within a budget, and the script that runs it."""
    from rich.console import Console

    from studies import recommend as advice
    from studies.recommend_print import show, show_rerun, show_script

    name = advice.scene_name(scene)
    wish, limit = _positive("--error", error), _duration("--budget", budget)
    if wish is None and limit is None:
        raise BadOption("--error and --budget are both missing; at least one of them is needed")
    measured = _measured_trade(table)
    choice = advice.choose(measured.points, name, wish, limit, element)
    console = Console()
    show(choice, measured.origin, advice.models_apart(measured, name, wish), console)
    show_script(advice.script(choice.line), console)
    if rerun:
        again = advice.rerun(choice.line, measured.histories, wish, choice.reached)
        show_rerun(again, choice, wish, console)
        if not again.met:
            raise typer.Exit(1)


def _measured_trade(table: Path | None) -> "Measured":
    """A kept trade, from a directory, or one measured now and kept."""
    from studies import recommend as advice
    from studies.study import Options, find, write

    if table is not None:
        return advice.read(table)
    for folder in (Path("reports/trade"), Path("results/trade")):
        if (folder / "points.csv").exists():
            return advice.read(folder)
    print("No measured trade in reports/trade or results/trade: measuring (some minutes) …", file=sys.stderr)
    with sweeping(quick=False) as runner:
        result = find("trade")(Options(), runner)
    write(result, Path("results"))
    return advice.of_result(result)


@app.command()
def bench(
    quick: Quick = False,
    out: Annotated[Path, typer.Option(help="Where tables and pictures go.")] = Path("results"),
) -> None:
    """Measure kernels, peers, length and memory: tables as CSV and Markdown, pictures as SVG."""
    from rich.console import Console

    from studies import bench as benchmark
    from studies.study import write

    with Console(stderr=True).status("starting") as shown:
        result = benchmark.bench(quick, lambda text: shown.update(f"measuring: {text}"))
    folder = write(result, out)
    benchmark.glance(result, Console())
    print(f"\nWritten to {folder}/")


def read_options(elements: str | None, dt: str | None, solvers: str | None, quick: bool) -> "Options":
    """Options as typed to options as meant.

    Raises
    ------
    BadOption
        Naming the option, its value and what is allowed.
    """
    from studies.study import Options

    return Options(
        quick=quick,
        meshes=_list("--elements", elements, _mesh, "whole numbers from 1 on such as 2/8/2,4/16/4 or 8,16"),
        steps=_list("--dt", dt, _step, "positive numbers of seconds such as 1e-5,5e-6"),
        solvers=_list("--solvers", solvers, _solver, "; ".join(_solver_names())),
    )


@contextmanager
def sweeping(quick: bool) -> "Iterator[Runner]":
    """A runner that shows its progress; on an interrupt it says what is kept and exits with 130."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from studies.runner import Runner

    cache = cache_directory()
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"),
        TimeRemainingColumn(),
    )  # fmt: skip
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("starting", total=None)

        def on_done(case: "Case", done: int, total: int) -> None:
            what = f"{case.scene.name} · {case.solver} {case.element} {case.integrator}"
            progress.update(task, description=what, completed=done, total=total)

        runner = Runner(cache, repeats=1 if quick else 3, budget_s=1.0 if quick else 20.0, on_done=on_done)
        try:
            yield runner
        except KeyboardInterrupt:
            progress.stop()
            console.print(
                f"Interrupted. Finished runs ({runner.computed} of this session) are kept in {cache}; "
                f"the same command goes on from there."
            )
            raise typer.Exit(130) from None


def cache_directory() -> Path:
    """Where finished runs are kept: beside the compiled kernels."""
    base = os.environ.get("ANCTMM_CACHE") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "anctmm" / "runs"


def registry_origins(group: str) -> list[tuple[str, str]]:
    """Names of the registered solvers with the package and function each comes from."""
    from importlib.metadata import entry_points

    return sorted((e.name, f"{e.dist.name if e.dist else '?'}: {e.value}") for e in entry_points(group=group))


def _list(option: str, text: str | None, read: Callable[[str], Any], allowed: str) -> tuple[Any, ...] | None:
    if text is None:
        return None
    values = []
    for item in text.split(","):
        try:
            values.append(read(item.strip()))
        except ValueError:
            raise BadOption(f"{option} has {item.strip()!r}; allowed are {allowed}") from None
    return tuple(dict.fromkeys(values))


def _mesh(item: str) -> "Mesh":
    mesh = tuple(int(n) for n in item.split("/"))
    if min(mesh) < 1:
        raise ValueError
    return mesh


def _step(item: str) -> float:
    dt = float(item)
    if not 0.0 < dt < float("inf"):
        raise ValueError
    return dt


def _positive(option: str, text: str | None) -> float | None:
    if text is None:
        return None
    try:
        return _step(text)
    except ValueError:
        raise BadOption(f"{option} has {text!r}; allowed are positive numbers such as 1e-3") from None


def _duration(option: str, text: str | None) -> float | None:
    """Seconds of 0.5s, 20ms, 3us or 0.5."""
    if text is None:
        return None
    for unit, factor in (("us", 1e-6), ("ms", 1e-3), ("s", 1.0), ("", 1.0)):
        if text.endswith(unit):
            try:
                return factor * _step(text.removesuffix(unit))
            except ValueError:
                break
    raise BadOption(f"{option} has {text!r}; allowed are positive times such as 0.5s, 20ms or 0.5")


def _solver(item: str) -> str:
    if item not in _solver_names():
        raise ValueError
    return item


def _solver_names() -> list[str]:
    from anctmm import registry

    return registry.names()


def _probe(probe: Any) -> str:
    return probe if isinstance(probe, str) else f"{probe[0]} at {probe[1]:g}"
