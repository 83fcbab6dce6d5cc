"""The command line. Modules that are slow to import are imported by the command that needs them."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from studies.command_line import options as read
from studies.command_line.ending import CODES, BadOption, Code, Command, Commands
from studies.command_line.progress import bar, sweeping

if TYPE_CHECKING:
    from collections.abc import Iterable

    from studies.regression.check import Finding
    from studies.regression.scenes import Watch

app = typer.Typer(
    cls=Commands, epilog=CODES, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False,
)  # fmt: skip


def _option(help: str, metavar: str, parser: Any, *names: str) -> Any:
    return typer.Option(*names, help=help, metavar=metavar, parser=parser)


Text = str | None
Given = Annotated[
    str, typer.Argument(help="A built-in scene (see `anctmm list`), or a file that defines CASES.")
]
Some = Annotated[Text, typer.Argument(help="A built-in scene, or a file that defines CASES.")]
Chosen = Annotated[Text, typer.Option("--case", help="Scene of the file, by name.", metavar="NAME")]
Elements = Annotated[
    Any, _option("Elements of each beam, or of all.", "LIST", read.listed(read.mesh, read.MESHES))
]
Mesh = Annotated[
    Any,
    _option("Elements of each beam, or of all.", "MESH", read.parser(read.mesh, read.MESHES), "--elements"),
]
Steps = Annotated[
    Any, _option("Time steps, s: 1e-5,5e-6.", "LIST", read.listed(read.positive, read.NUMBERS), "--dt")
]
Step = Annotated[
    Any, _option("Time step, s: 1e-3.", "NUMBER", read.parser(read.positive, read.NUMBERS), "--dt")
]
Solvers = Annotated[
    Any, _option("Solvers by name (see `anctmm list`): a,b.", "LIST", read.named(read.solvers, True))
]
Element = Annotated[
    Any, _option("Element: cable, quintic, shear, rigid.", "NAME", read.named(read.element_names))
]
Integrator = Annotated[
    Any, _option("Integrator: generalized-alpha, zhai, esdirk.", "NAME", read.named(read.integrator_names))
]
Target = Annotated[
    Any,
    _option("Target error, relative: 1e-3.", "NUMBER", read.parser(read.positive, read.NUMBERS), "--error"),
]
Budget = Annotated[
    Any,
    _option(
        "CPU time of the steps: 0.5s, 20ms.",
        "TIME",
        read.parser(read.duration, "positive times such as 20ms, 0.5s"),
    ),
]
Quick = Annotated[bool, typer.Option("--quick", help="The smallest sweep that shows the point.")]
Workers = Annotated[
    int | None, typer.Option(min=1, max=9999, help="Processes that compute errors; times are in turn.")
]
Cluster = Annotated[
    Text, typer.Option(help="Scheduler of a dask cluster that computes errors: tcp://host:8786.")
]
RunOut = Annotated[Any, _option("Where files are written; default: results/CASE.", "PATH", read.path)]
StudyOut = Annotated[Any, _option("Where tables and pictures are written, in CASE/STUDY.", "PATH", read.path)]
PageOut = Annotated[
    Any, _option("Of page and tables; default: reports, or results/NAME for a file.", "PATH", read.path)
]
Trade = Annotated[
    Any,
    _option(
        "Directory of a measured trade; default: results/CASE/trade, reports/trade, ours.", "PATH", read.path
    ),
]
Rerun = Annotated[bool, typer.Option(help="Run the recommendation and check its error.")]
Names = read.listed(read.word, "names")
Only = Annotated[Any, _option("Parts or patterns of scene/run/solver: four-bar/,*-zhai/*.", "LIST", Names)]
Checked = Annotated[Any, _option("Solvers by name: a,b.", "LIST", Names)]
Update = Annotated[bool, typer.Option("--update", help="Store histories that are new or differ.")]
Scenes = Annotated[Any, _option("Your Python file that defines WATCHED.", "PATH", read.path)]
Baselines = Annotated[
    Any, _option("Stored histories: anctmm's, or baselines/ beside your scenes.", "PATH", read.path)
]
RESULTS = Path("results")


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
def list_(file: Annotated[Text, typer.Argument(help="Your file: list its cases only.")] = None) -> None:
    """Scenes, solvers and studies; or the cases of a file."""
    from rich.console import Console

    from studies.cases import built_in, cases_in
    from studies.command_line.listing import scenes, solvers, studies
    from studies.engine.tables import show_table

    shown = [scenes(cases_in(file))] if file is not None else [scenes(built_in()), solvers(), studies()]
    console = Console()
    for table in shown:
        show_table(console, table)


@app.command(cls=Command)
def run(
    scene: Given, case: Chosen = None, error: Target = None, elements: Mesh = None, dt: Step = None,
    element: Element = None, integrator: Integrator = None, solvers: Solvers = None,
    out: RunOut = None,
) -> None:  # fmt: skip
    """Run one case: values with their uncertainty, and its solution, histories, plot and animation as files."""
    from rich.console import Console

    from studies.cases import find_case
    from studies.engine.files import check_writable, file_name
    from studies.engine.refinement import Setup
    from studies.engine.study import Options, check_fits
    from studies.single_run import run_case, show, write_run

    wanted, names = find_case(scene, case), solvers or (Setup.solver,)
    setup = Setup(names[0], element or Setup.element, integrator or Setup.integrator)
    check_fits(Options(element=element, integrator=integrator), wanted)
    folder = out or RESULTS / file_name(wanted.name)
    check_writable(folder)
    with sweeping(quick=True) as runner:
        done = run_case(wanted, runner, error=error, mesh=elements, dt=dt, setup=setup, others=names[1:])
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
    scene: Some = None, case: Chosen = None, elements: Elements = None, dt: Steps = None,
    solvers: Solvers = None, element: Element = None, integrator: Integrator = None,
    error: Target = None, quick: Quick = False, workers: Workers = None, cluster: Cluster = None,
    out: StudyOut = RESULTS,
) -> None:  # fmt: skip
    """Run one study: tables as CSV and Markdown, pictures as SVG."""
    from rich.console import Console

    from studies.cases import chosen
    from studies.engine.files import check_writable
    from studies.engine.study import Options, check_taken, find
    from studies.report.terminal import glance
    from studies.report.whole import run_study, write_study

    find(name)
    options = Options(quick, elements, dt, solvers, chosen(scene, case), element, integrator, error)
    check_taken(options, name)
    check_writable(out)
    console, good = Console(), False
    with sweeping(quick, workers, cluster) as runner:
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
    file: Some = None, case: Chosen = None, quick: Quick = False, workers: Workers = None,
    cluster: Cluster = None, out: PageOut = None,
) -> None:  # fmt: skip
    """Run every study and write one page; of a file those that take its cases."""
    from studies.cases import chosen
    from studies.engine.files import check_writable, file_name
    from studies.report.whole import run_all, write_report

    cases = chosen(file, case)
    folder = out or (RESULTS / file_name(Path(file).stem) if file else Path("reports"))
    check_writable(folder)
    done = []
    with sweeping(quick, workers, cluster) as runner:
        for one in run_all(cases, quick, runner):
            done.append(one)
            write_report(done, folder, quick, (file, case))  # an hour later something may fail; this is whole
            print(f"anctmm: {one.result.name} {one.case} is done", file=sys.stderr)
    print(f"Written to {folder}/index.html")
    if not any(one.result.good for one in done):
        raise typer.Exit(Code.DIFFERS)


@app.command(cls=Command)
def recommend(
    scene: Given, case: Chosen = None, error: Target = None, budget: Budget = None,
    elements: Elements = None, dt: Steps = None, solvers: Solvers = None, element: Element = None,
    integrator: Integrator = None, table: Trade = None, quick: Quick = False, workers: Workers = None,
    cluster: Cluster = None, rerun: Rerun = True,
) -> None:  # fmt: skip
    """Print the cheapest measured setting for an error, or the best within a budget, and the script that runs it."""
    from rich.console import Console

    from studies.cases import find_case, is_file
    from studies.engine.study import Options, check_fits
    from studies.trade import recommend as advice
    from studies.trade.study import run as run_trade

    if error is None and budget is None:
        raise BadOption("--error and --budget are both missing; at least one of them is needed")
    own = find_case(scene, case)
    options = Options(quick, elements, dt, solvers, (own,), element, integrator, error)
    check_fits(options, own)
    given = str(Path(scene).resolve()) if is_file(scene) else own.name
    measured = advice.read(table) if table is not None else advice.find(own)
    if measured is None:
        with sweeping(quick, workers, cluster) as runner:
            measured = advice.of_result(run_trade(options, runner))
    advice.check_case(measured, own)
    choice = advice.choose(advice.narrowed(measured.points, own.name, options), error, budget)
    console = Console()
    advice.show(choice, measured.origin, advice.models_apart(measured, own.name, error), console)
    print(f"\n{advice.script(choice.line, own, given)}")
    good = choice.reached
    if rerun:
        again = advice.rerun(choice.line, own, given, measured, error, choice.reached)
        advice.show_rerun(again, choice, error, console)
        good = good and again.met
    if not good:
        raise typer.Exit(Code.DIFFERS)


@app.command(cls=Command)
def bench(quick: Quick = False, out: StudyOut = RESULTS) -> None:
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
    file: Some = None, case: Chosen = None, elements: Mesh = None, dt: Step = None, only: Only = None,
    solver: Checked = None, update: Update = False, scenes: Scenes = None, baselines: Baselines = None,
    out: StudyOut = RESULTS,
) -> None:  # fmt: skip
    """Displacement histories against the stored ones; exit 1 and a table where they differ."""
    from rich.console import Console

    from studies.engine.files import check_writable
    from studies.engine.runner import processors
    from studies.regression import check as checking
    from studies.regression.report import show, write_check
    from studies.regression.scenes import tasks_of

    every = tasks_of(_watches(file, case, elements, dt, scenes))
    tasks = checking.select(every, only or (), solver or ())
    own = scenes or (Path(file) if file else None)
    stored = baselines or (own.parent / "baselines" if own else checking.BASELINES)
    name = " ".join(own.name.split()) if own else ""  # it becomes a line of a header
    check_writable(out / "check")
    if update:
        work = checking.update(tasks, stored, name)
    else:
        whole = not (only or solver or case)
        work = checking.check(tasks, stored, whole=whole, workers=processors(), file=name)
    findings = _shown_in_turn(work, len(tasks))
    write_check(findings, out / "check")
    show(findings, Console())
    print(f"\nWritten to {out / 'check'}/; stored histories are in {stored}/")
    if all(f.verdict == checking.NOT_RUN for f in findings):
        raise typer.Exit(Code.NOT_RUN)
    raise typer.Exit(Code.DONE if checking.passed(findings) else Code.DIFFERS)


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
    file: Text, case: Text, elements: Any, dt: float | None, scenes: Path | None
) -> "tuple[Watch, ...]":
    """Watched scenes: cases of a file, those that another declares, or the built-in ones."""
    from studies.cases import cases_in, find_cases
    from studies.engine.study import Options, check_fits
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
    cases = cases_in(file) if case is None else find_cases(file, case)
    for one in cases:
        check_fits(Options(meshes=(elements,) if elements else None, steps=(dt,) if dt else None), one)
    return watches_of(cases, elements, dt)


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
