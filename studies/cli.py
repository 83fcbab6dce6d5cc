"""The command line. Modules that are slow to import are imported by the command that needs them."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from studies.command_line.ending import CODES, BadOption, Code, Command, Commands
from studies.command_line.options import duration, path, positive, read_options, texts, whole
from studies.command_line.progress import bar, sweeping

if TYPE_CHECKING:
    from collections.abc import Iterable

    from studies.regression.check import Finding
    from studies.regression.scenes import Watch

__all__ = ["app", "main", "read_options", "sweeping"]

app = typer.Typer(
    cls=Commands, epilog=CODES, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False,
)  # fmt: skip


def _text(help: str, metavar: str, *names: str) -> Any:
    """An option that is read as text and checked by the command."""
    return typer.Option(*names, help=help, metavar=metavar)


def _path(help: str) -> Any:
    """An option that is a path."""
    return typer.Option(help=help, parser=path, metavar="PATH")


Text = str | None
Elements = Annotated[Text, _text("Meshes: elements of each body, or of all: 2/8/2,4/16/4 or 8,16.", "LIST")]
Mesh = Annotated[Text, _text("Elements of each beam, or of all: 2/8/2 or 8.", "MESH", "--elements")]
Steps = Annotated[Text, _text("Time steps, s: 1e-5,5e-6.", "LIST", "--dt")]
Step = Annotated[Text, _text("Time step, s: 1e-3.", "NUMBER", "--dt")]
Solvers = Annotated[Text, _text("Solvers by name (see `anctmm list`): a,b.", "LIST")]
Given = Annotated[
    str, typer.Argument(help="A built-in scene (see `anctmm list`), or a file that defines CASES.")
]
Some = Annotated[Text, typer.Argument(help="A built-in scene, or a file that defines CASES.")]
Chosen = Annotated[Text, _text("Scene of the file, by name.", "NAME", "--case")]
Target = Annotated[Text, _text("Target error, relative: 1e-3.", "NUMBER", "--error")]
Budget = Annotated[Text, _text("CPU time that may be spent: 0.5s, 20ms.", "TIME")]
Element = Annotated[Text, typer.Option(help="Element: cable, quintic, shear, rigid.")]
Integrator = Annotated[Text, typer.Option(help="Integrator: generalized-alpha, zhai, esdirk.")]
Quick = Annotated[bool, typer.Option("--quick", help="The smallest sweep that shows the point.")]
Workers = Annotated[
    Text, _text("Processes that compute errors side by side; times are measured in turn.", "NUMBER")
]
Cluster = Annotated[
    Text, _text("Scheduler of a dask cluster that computes errors: tcp://host:8786.", "ADDRESS")
]
RunOut = Annotated[Path | None, _path("Where files are written; default: results/CASE.")]
StudyOut = Annotated[Path, _path("Where tables and pictures are written, in CASE/STUDY.")]
PageOut = Annotated[
    Path | None, _path("Where page and tables are written; default: reports, or results/NAME for a file.")
]
Trade = Annotated[
    Path | None, _path("Directory of a measured trade; default: results/CASE/trade, reports/trade, ours.")
]
Rerun = Annotated[bool, typer.Option(help="Run the recommendation and check its error.")]
Only = Annotated[Text, _text("Parts or patterns of scene/run/solver: four-bar/,*-zhai/*.", "LIST")]
Update = Annotated[bool, typer.Option("--update", help="Store histories that are new or differ.")]
Scenes = Annotated[Path | None, _path("Your Python file that defines WATCHED.")]
Baselines = Annotated[
    Path | None, _path("Stored histories: those of anctmm, or baselines/ beside your scenes.")
]
RESULTS = Path("results")


def main() -> None:
    """Entry point."""
    app()


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"anctmm {version('anctmm')}")
        raise typer.Exit


@app.callback()
def whole_command(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_show_version)
    ] = False,
) -> None:
    """Accuracy, stability and cost of planar flexible multibody solvers."""


@app.command("list", cls=Command)
def list_(
    file: Annotated[str | None, typer.Argument(help="Your file: list its cases only.")] = None,
) -> None:
    """Scenes, solvers and studies; or the cases of a file."""
    from rich.console import Console

    from studies.cases import built_in, cases_in
    from studies.command_line.listing import scenes, solvers, studies
    from studies.engine.console import show_table

    shown = [scenes(cases_in(file))] if file is not None else [scenes(built_in()), solvers(), studies()]
    console = Console()
    for table in shown:
        show_table(console, table)
        console.print()


@app.command(cls=Command)
def run(
    scene: Given,
    case: Chosen = None,
    error: Target = None,
    elements: Mesh = None,
    dt: Step = None,
    element: Element = None,
    integrator: Integrator = None,
    solvers: Solvers = None,
    out: RunOut = None,
) -> None:
    """Run one case: values with their uncertainty, and its solution, histories, plot and animation as files."""
    from studies.cases import find_case

    wanted = find_case(scene, case)  # before the slower imports

    from rich.console import Console

    from studies.command_line.options import one, read_options, setup_of
    from studies.engine.files import check_writable, file_name
    from studies.engine.study import without_beams, without_motion
    from studies.single_run import run_case, show, write_run

    target, options = positive("--error", error), read_options(elements, dt, solvers, quick=True)
    names = options.solvers or ("anctmm",)
    setup = setup_of(names[0], element, integrator)
    given = replace(options, element=element, integrator=integrator)
    without_beams([wanted], given)  # refuses what has no effect
    without_motion([wanted], given)
    folder = out or Path("results") / file_name(wanted.name)
    check_writable(folder)
    with sweeping(quick=True) as runner:
        done = run_case(
            wanted, runner, error=target, mesh=one("--elements", options.meshes), dt=one("--dt", options.steps),
            setup=setup, others=names[1:],
        )  # fmt: skip
    show(done, Console())
    written = write_run(done, folder)
    print(f"\nWritten to {folder}/" if written else "\nNothing was written: the run has no output.")
    if done.missed:
        raise typer.Exit(Code.DIFFERS)
    if done.absent:
        raise typer.Exit(Code.NOT_RUN)


@app.command(cls=Command)
def study(
    name: Annotated[str, typer.Argument(help="trade, convergence, … (see `anctmm list`)")],
    scene: Some = None,
    case: Chosen = None,
    elements: Elements = None,
    dt: Steps = None,
    solvers: Solvers = None,
    element: Element = None,
    integrator: Integrator = None,
    error: Target = None,
    quick: Quick = False,
    workers: Workers = None,
    cluster: Cluster = None,
    out: StudyOut = RESULTS,
) -> None:
    """Run one study: tables as CSV and Markdown, pictures as SVG."""
    from rich.console import Console

    from studies.cases import chosen
    from studies.command_line.options import setup_of
    from studies.engine.files import check_writable
    from studies.engine.study import check_taken, known

    known(name)  # before the slower imports

    from studies.report.terminal import glance
    from studies.report.whole import run_study, write_study

    setup_of("anctmm", element, integrator)  # refuses what is not known
    options = replace(
        read_options(elements, dt, solvers, quick),
        cases=chosen(scene, case), element=element, integrator=integrator, error=positive("--error", error),
    )  # fmt: skip
    check_taken(options, name)
    check_writable(out)
    console = Console()
    good = False
    with sweeping(quick, whole("--workers", workers), cluster) as runner:
        for done in run_study(name, options, runner):
            folder = write_study(done, out)
            glance(done.result, console)
            console.print(f"\nWritten to {folder}/", highlight=False, soft_wrap=True)
            good = good or done.result.good
    if not good:
        print("anctmm: all runs are refused or fail, as said above", file=sys.stderr)
        raise typer.Exit(Code.DIFFERS)


@app.command(cls=Command)
def report(
    file: Some = None,
    case: Chosen = None,
    quick: Quick = False,
    workers: Workers = None,
    cluster: Cluster = None,
    out: PageOut = None,
) -> None:
    """Run every study and write one page; of a file those that take its cases."""
    from studies.cases import chosen
    from studies.engine.files import check_writable, file_name
    from studies.report.whole import run_all, write_report

    cases = chosen(file, case)
    folder = out or (Path("results") / file_name(Path(file).stem) if file else Path("reports"))
    check_writable(folder)
    with sweeping(quick, whole("--workers", workers), cluster) as runner:
        done = []
        for one in run_all(cases, quick, runner):
            done.append(one)
            write_report(done, folder, quick, (file, case))  # an hour later something may fail; this is whole
            print(f"anctmm: {one.result.name} {one.case} is done", file=sys.stderr)
    print(f"Written to {folder}/index.html")
    if not any(one.result.good for one in done):
        raise typer.Exit(Code.DIFFERS)


@app.command(cls=Command)
def recommend(
    scene: Given,
    case: Chosen = None,
    error: Target = None,
    budget: Budget = None,
    elements: Elements = None,
    dt: Steps = None,
    solvers: Solvers = None,
    element: Element = None,
    integrator: Integrator = None,
    table: Trade = None,
    quick: Quick = False,
    workers: Workers = None,
    cluster: Cluster = None,
    rerun: Rerun = True,
) -> None:
    """Print the cheapest measured setting for an error, or the best within a budget, and the script that runs it."""
    from rich.console import Console

    from studies.cases import find_case, is_file
    from studies.command_line.options import setup_of
    from studies.engine.study import without_beams
    from studies.trade import recommend as advice
    from studies.trade.printed import show, show_rerun, show_script

    target, limit = positive("--error", error), duration("--budget", budget)
    if target is None and limit is None:
        raise BadOption("--error and --budget are both missing; at least one of them is needed")
    narrow = replace(read_options(elements, dt, solvers, quick), element=element, integrator=integrator)
    setup_of("anctmm", None, integrator)  # refuses what is not known
    own = find_case(scene, case)
    without_beams([own], narrow)
    given = str(Path(scene).resolve()) if is_file(scene) else own.name
    measured = advice.read(table) if table is not None else advice.find(own)
    if measured is None:
        options = replace(narrow, cases=(own,), error=target)
        with sweeping(quick, whole("--workers", workers), cluster) as runner:
            measured = advice.measured_now(own, options, runner)
    advice.check_case(measured, own)
    choice = advice.choose(advice.narrowed(measured.points, own.name, narrow), target, limit)
    console = Console()
    show(choice, measured.origin, advice.models_apart(measured, own.name, target), console)
    show_script(advice.script(choice.line, own, given), console)
    if rerun:
        again = advice.rerun(choice.line, own, given, measured, target, choice.reached)
        show_rerun(again, choice, target, console)
        if not again.met:
            raise typer.Exit(Code.DIFFERS)
    if not choice.reached:
        raise typer.Exit(Code.DIFFERS)


@app.command(cls=Command)
def bench(
    quick: Quick = False,
    out: StudyOut = RESULTS,
) -> None:
    """Measure kernels, peers, length, trees, memory, first results: tables as CSV and Markdown, pictures as SVG."""
    from rich.console import Console

    from studies.benchmark import study as benchmark
    from studies.engine.files import check_writable
    from studies.report.whole import Done, write_study

    check_writable(out)
    with Console(stderr=True).status("starting") as shown:
        result = benchmark.bench(quick, lambda text: shown.update(f"measuring: {text}"))
    folder = write_study(Done("", result), out)
    benchmark.glance(result, Console())
    print(f"\nWritten to {folder}/")


@app.command(cls=Command)
def check(
    file: Some = None,
    case: Chosen = None,
    elements: Mesh = None,
    dt: Step = None,
    only: Only = None,
    solver: Annotated[Text, _text("Solvers by name: a,b.", "LIST")] = None,
    update: Update = False,
    scenes: Scenes = None,
    baselines: Baselines = None,
    out: StudyOut = RESULTS,
) -> None:
    """Displacement histories against the stored ones; exit 1 and a table where they differ."""
    from rich.console import Console

    from studies.engine.files import check_writable
    from studies.engine.runner import processors
    from studies.regression import check as checking
    from studies.regression.report import show, write_check
    from studies.regression.scenes import tasks_of

    asked, solvers = texts("--only", only), texts("--solver", solver)
    every = tasks_of(_watches(file, case, elements, dt, scenes))
    tasks = checking.select(every, asked, solvers)
    own = scenes or (Path(file) if file else None)
    stored = baselines or (own.parent / "baselines" if own else checking.BASELINES)
    name = " ".join(own.name.split()) if own else ""  # it becomes a line of a header
    check_writable(out / "check")
    work = (
        checking.update(tasks, stored, name)
        if update
        else checking.check(
            tasks,
            stored,
            whole=not asked and not solvers and not case,
            workers=processors(),
            file=name,
        )
    )
    findings = checking.in_order(_shown_in_turn(work, len(tasks)), tasks)
    write_check(findings, out / "check")
    show(findings, Console())
    print(f"\nWritten to {out / 'check'}/; stored histories are in {stored}/")
    raise typer.Exit(_verdict(findings))


def _shown_in_turn(work: "Iterable[tuple[Finding, ...]]", total: int) -> "list[Finding]":
    """All findings of a check, whose progress is shown as they come."""
    from rich.console import Console

    findings: list[Finding] = []
    with bar(Console(stderr=True)) as progress:
        task = progress.add_task("running", total=total)
        for found in work:
            findings += found
            progress.update(task, description=found[-1].name, advance=1)
    return findings


def _watches(
    file: str | None, case: str | None, elements: str | None, dt: str | None, scenes: Path | None
) -> "tuple[Watch, ...]":
    """Watched scenes: cases of a file, those that another declares, or the built-in ones."""
    from studies.cases import cases_in, find_cases
    from studies.command_line.options import one
    from studies.engine.study import without_beams
    from studies.regression.of_cases import watches_of
    from studies.regression.scenes import declared_in
    from studies.regression.watches import all_watches

    if file is None:
        for option, value in (("--case", case), ("--elements", elements), ("--dt", dt)):
            if value is not None:
                raise BadOption(f"{option} is {value!r} without a file; a file that defines CASES is needed")
        return declared_in(scenes) if scenes else all_watches()
    if scenes is not None:
        raise BadOption(f"--scenes is {str(scenes)!r} beside file {file!r}; one of them is allowed")
    options = read_options(elements, dt, None, quick=True)
    cases = cases_in(file) if case is None else find_cases(file, case)
    for remark in without_beams(cases, options):
        print(f"anctmm: {remark}", file=sys.stderr)
    return watches_of(cases, one("--elements", options.meshes), one("--dt", options.steps))


@app.command("compile", cls=Command)
def compile_() -> None:
    """Compile all kernels beforehand, some minutes once a machine and version; later runs start at once."""
    from studies.command_line.compiling import compile_kernels

    compile_kernels(lambda kind: print(f"compiled: {kind}", flush=True))


@app.command(cls=Command)
def conform(name: Annotated[str, typer.Argument(help="A registered solver (see `anctmm list`).")]) -> None:
    """Test a solver against the rules of all solvers: exit 1 where it breaks one, 4 where it is not installed."""
    from rich.console import Console

    from studies.conformance import check as conforming

    findings = []
    with Console(stderr=True).status("starting") as shown:
        for finding in conforming.conform(name):
            shown.update(f"tested: {finding.rule}")
            findings.append(finding)
    conforming.show(name, findings, Console())
    raise typer.Exit(conforming.exit_code(findings))


def _verdict(findings: "list[Finding]") -> Code:
    """The exit code of a check."""
    from studies.regression import check as checking

    if all(f.verdict == checking.NOT_RUN for f in findings):
        return Code.NOT_RUN
    return Code.DONE if checking.passed(findings) else Code.DIFFERS
