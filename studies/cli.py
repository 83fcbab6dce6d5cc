"""The command line. Whatever is slow to import is imported by the command that needs it."""

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from studies.engine.runner import Case, Mesh, Runner
    from studies.engine.study import Options
    from studies.trade.recommend import Measured


class BadOption(Exception):
    """An option's value cannot be read."""


class Commands(TyperGroup):
    """Commands whose errors, if they are the user's or the disk's, are one line and exit code 2."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except (BadOption, OSError) as error:
            reason: Exception = error
        except Exception as error:
            from anctmm.errors import AnctmmError

            if not isinstance(error, AnctmmError):
                raise
            reason = error
        typer.echo(f"anctmm: {' '.join(str(reason).split())}", err=True)
        raise typer.Exit(2)


app = typer.Typer(
    cls=Commands,
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


def main() -> None:
    """Entry point."""
    app()


@app.command("list")
def list_() -> None:
    """Scenes, solvers and studies."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from anctmm.solvers import registry
    from studies.engine.study import STUDIES
    from studies.scenes import BASE_SCENES

    def table(title: str, *columns: str) -> Table:
        shown = Table(title=title, title_justify="left", header_style="bold", box=None, padding=(0, 2, 0, 0))
        for column in columns:
            shown.add_column(column, overflow="fold", no_wrap=column == "name")
        return shown

    scenes = table("Scenes", "name", "bodies", "probes", "source")
    for build in BASE_SCENES:
        base = build()
        bodies = ", ".join(b.name for b in base.scene.bodies)
        scenes.add_row(base.scene.name, bodies, ", ".join(map(_probe, base.probes)), base.source)
    solvers = table("Solvers", "name", "from", "lacks")
    for name, origin in registry.origins():
        solvers.add_row(name, origin, escape(_lacks(name)))
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

    from studies.engine.files import check_writable
    from studies.engine.study import find, write
    from studies.report.terminal import glance

    run = find(name)
    options = read_options(elements, dt, solvers, quick)
    check_writable(out)
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
    from studies.engine.files import check_writable
    from studies.engine.study import STUDIES, Options, find, write
    from studies.report.page import write_page

    check_writable(out)
    results = []
    with sweeping(quick) as runner:
        for done, name in enumerate(STUDIES, 1):
            runner.heading = f"{name} ({done} of {len(STUDIES)}), "
            results.append(find(name)(Options(quick=quick), runner))
            write(results[-1], out)  # an hour later something may fail; this is whole
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

    from studies.trade import recommend as advice
    from studies.trade.recommend_print import show, show_rerun, show_script

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
    from studies.engine.study import Options, find, write
    from studies.trade import recommend as advice

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

    from studies.benchmark import study as benchmark
    from studies.engine.files import check_writable
    from studies.engine.study import write

    check_writable(out)
    with Console(stderr=True).status("starting") as shown:
        result = benchmark.bench(quick, lambda text: shown.update(f"measuring: {text}"))
    folder = write(result, out)
    benchmark.glance(result, Console())
    print(f"\nWritten to {folder}/")


@app.command()
def check(
    only: Annotated[
        str | None,
        typer.Option(help="Parts or patterns of scene/run/solver: four-bar/,*-zhai/*.", metavar="LIST"),
    ] = None,
    solver: Annotated[str | None, typer.Option(help="Solvers by name: a,b.", metavar="LIST")] = None,
    update: Annotated[bool, typer.Option("--update", help="Store what is new or differs.")] = False,
    scenes: Annotated[
        Path | None, typer.Option(help="A Python file of your own that defines WATCHED.", dir_okay=False)
    ] = None,
    baselines: Annotated[
        Path | None,
        typer.Option(help="Stored histories: those of anctmm, or baselines/ beside your scenes."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Where table, JUnit XML and pictures go.")] = Path("results"),
) -> None:
    """Displacement histories against the stored ones; exit 1 and a table where they differ."""
    from rich.console import Console

    from studies.engine.files import check_writable
    from studies.regression import check as checking
    from studies.regression.report import show, write_check
    from studies.regression.scenes import declared_in, tasks_of
    from studies.regression.small_watches import all_watches

    every = tasks_of(declared_in(scenes) if scenes else all_watches())
    texts, solvers = _texts(only), _texts(solver)
    tasks = checking.select(every, texts, solvers)
    stored = baselines or (scenes.parent / "baselines" if scenes else checking.BASELINES)
    check_writable(out / "check")
    findings: list[checking.Finding] = []
    work = (
        checking.update(tasks, stored)
        if update
        else checking.check(tasks, stored, whole=not texts and not solvers)
    )
    with _progress(Console(stderr=True)) as progress:
        bar = progress.add_task(tasks[0].name, total=len(tasks))
        for done, found in enumerate(work, 1):
            findings += found
            following = tasks[done].name if done < len(tasks) else "writing"
            progress.update(bar, description=following, completed=min(done, len(tasks)))
        write_check(findings, out / "check")
    show(findings, Console())
    print(f"\nWritten to {out / 'check'}/; stored histories are in {stored}/")
    raise typer.Exit(0 if checking.passed(findings) else 1)


@app.command()
def conform(name: Annotated[str, typer.Argument(help="A registered solver (see `anctmm list`).")]) -> None:
    """Test a solver against the rules every solver keeps: exit 1 where it breaks one, 2 where it is not installed."""
    from rich.console import Console

    from studies.conformance import check as conforming

    findings = []
    with Console(stderr=True).status("starting") as shown:
        for finding in conforming.conform(name):
            shown.update(f"tested: {finding.rule}")
            findings.append(finding)
    conforming.show(name, findings, Console())
    raise typer.Exit(conforming.exit_code(findings))


def read_options(elements: str | None, dt: str | None, solvers: str | None, quick: bool) -> "Options":
    """Options as typed to options as meant.

    Raises
    ------
    BadOption
        Naming the option, its value and what is allowed.
    """
    from studies.engine.study import Options

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

    from anctmm.jit.cache_dir import kept_in
    from studies.engine.runner import Runner

    cache = kept_in("runs")
    console = Console(stderr=True)
    with _progress(console) as progress:
        task = progress.add_task("starting", total=None)

        def on_done(case: "Case", done: int, total: int) -> None:
            what = f"{case.scene.name} · {case.solver} {case.element} {case.integrator}"
            on_job(what, done, total)

        def on_job(label: str, done: int, total: int) -> None:
            progress.update(task, description=f"{runner.heading}{label}", completed=done, total=total)

        def note(text: str) -> None:
            console.print(f"anctmm: {text}", style="yellow", markup=False, highlight=False, soft_wrap=True)

        runner = Runner(
            cache,
            repeats=1 if quick else 3,
            budget_s=1.0 if quick else 20.0,
            on_done=on_done,
            note=note,
            on_job=on_job,
        )
        try:
            yield runner
        except KeyboardInterrupt:
            progress.stop()
            again = shlex.join(["anctmm", *sys.argv[1:]])
            kept = (
                f"Finished runs ({runner.computed} of this session) are kept in {cache}; go on with: {again}"
            )
            if cache is None:
                kept = "Nothing is kept, for no directory could be written."
            console.print(f"Interrupted. {kept}", soft_wrap=True, markup=False, highlight=False)
            raise typer.Exit(130) from None


def _lacks(solver: str) -> str:
    """What a solver says it lacks, or why it cannot be loaded."""
    from anctmm.errors import PluginError
    from anctmm.solvers import registry

    try:
        return ", ".join(sorted(registry.offer_of(registry.load(solver)).lacks))
    except PluginError as error:
        return f"broken: {error}"


def _progress(console: "Console") -> "Progress":
    """A bar that goes away when it is done."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"),
        TimeRemainingColumn(),
    )  # fmt: skip
    return Progress(*columns, console=console, transient=True)


def _texts(text: str | None) -> tuple[str, ...]:
    """Items of a list as typed."""
    return tuple(item for item in (t.strip() for t in (text or "").split(",")) if item)


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
    from anctmm.solvers import registry

    return registry.names()


def _probe(probe: Any) -> str:
    return probe if isinstance(probe, str) else f"{probe[0]} at {probe[1]:g}"
