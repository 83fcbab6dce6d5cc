"""The command line. Modules that are slow to import are imported by the command that needs them."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from studies.command_line import options as given
from studies.command_line.ending import CODES, BadOption, Code, Command
from studies.command_line.progress import bar, sweeping

if TYPE_CHECKING:
    from studies.regression.scenes import Watch

RESULTS = Path("results")
os.environ["MPLBACKEND"] = "agg"  # pictures are files
app = typer.Typer(epilog=CODES, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


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
def list_(file: Annotated[given.Text, typer.Argument(help="Your file: list its cases only.")] = None) -> None:
    """Scenes, solvers and studies; or the cases of a file."""
    from studies.cases import built_in, cases_in
    from studies.command_line import listing
    from studies.engine.tables import show_frame

    show_frame(Console(), "Scenes", listing.scenes(built_in() if file is None else cases_in(file)))
    if file is None:
        show_frame(Console(), "Solvers", listing.solvers())
        show_frame(Console(), "Studies", listing.studies())


@app.command(cls=Command)
def run(
    scene: given.Given, case: given.Chosen = None, error: given.Target = None, elements: given.Mesh = None,
    dt: given.Step = None, element: given.Element = None, integrator: given.Integrator = None,
    solvers: given.Solvers = None, out: given.Out = None,
) -> None:  # fmt: skip
    """Run one case: values with their uncertainty, and its solution, histories, plot and animation as files."""
    from studies import single_run
    from studies.cases import find_case
    from studies.engine.files import check_writable, file_name
    from studies.engine.study import Options

    wanted = find_case(scene, case)
    meshes, steps = (elements,) if elements else None, (dt,) if dt else None
    options = Options(True, meshes, steps, solvers, (wanted,), element, integrator, error)
    folder = out or RESULTS / file_name(wanted.name)
    check_writable(folder)
    with sweeping(quick=True) as runner:
        done = single_run.run_case(options, runner)
    single_run.show(done, Console())
    written = single_run.write_run(done, folder)
    print(f"\nWritten to {folder}/" if written else "\nNothing was written: the run has no output.")
    if done.missed:
        raise typer.Exit(Code.DIFFERS)
    if done.absent:
        raise typer.Exit(Code.NOT_RUN)


@app.command(cls=Command)
def study(
    name: Annotated[str, typer.Argument(help="trade, convergence, … (see `anctmm list`)")],
    scene: given.Some = None, case: given.Chosen = None, elements: given.Meshes = None, dt: given.Steps = None,
    solvers: given.Solvers = None, element: given.Element = None, integrator: given.Integrator = None,
    error: given.Target = None, quick: given.Quick = False, workers: given.Workers = None,
    cluster: given.Cluster = None, out: given.Out = RESULTS,
) -> None:  # fmt: skip
    """Run one study: tables as CSV and Markdown, pictures as SVG."""
    from studies.cases import chosen
    from studies.engine.files import check_writable
    from studies.engine.study import Options, check_taken
    from studies.report import terminal, whole

    options = Options(quick, elements, dt, solvers, chosen(scene, case), element, integrator, error)
    check_taken(options, name)
    check_writable(out)
    good = False
    with sweeping(quick, workers, cluster) as runner:
        for done in whole.run_study(name, options, runner):
            folder = whole.write_study(done, out)
            terminal.glance(done.result, Console())
            print(f"\nWritten to {folder}/")
            good = good or done.result.good
    if not good:
        print("anctmm: all runs are refused or fail, as said above", file=sys.stderr)
        raise typer.Exit(Code.DIFFERS)


@app.command(cls=Command)
def report(
    file: given.Some = None, case: given.Chosen = None, quick: given.Quick = False, workers: given.Workers = None,
    cluster: given.Cluster = None, out: given.Out = None,
) -> None:  # fmt: skip
    """Run every study and write one page; of a file those that take its cases. Default of --out: reports."""
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
    scene: given.Given, case: given.Chosen = None, error: given.Target = None, budget: given.Budget = None,
    elements: given.Meshes = None, dt: given.Steps = None, solvers: given.Solvers = None,
    element: given.Element = None, integrator: given.Integrator = None, table: given.Trade = None,
    quick: given.Quick = False, workers: given.Workers = None, cluster: given.Cluster = None,
    rerun: given.Rerun = True,
) -> None:  # fmt: skip
    """Print the cheapest measured setting for an error, or the best within a budget, and the script that runs it."""
    from studies.cases import find_case, is_file
    from studies.engine.study import Options, check_fits
    from studies.trade import recommend as advice
    from studies.trade.study import run as run_trade

    if error is None and budget is None:
        raise BadOption("--error and --budget are both missing; at least one of them is needed")
    own = find_case(scene, case)
    options = Options(quick, elements, dt, solvers, (own,), element, integrator, error)
    check_fits(options, own)
    measured = advice.read(table) if table is not None else advice.find(own)
    if measured is None:
        with sweeping(quick, workers, cluster) as runner:
            measured = advice.of_result(run_trade(options, runner))
    advice.check_case(measured, own)
    choice = advice.choose(advice.narrowed(measured.points, own.name, options), error, budget)
    advice.show(choice, measured.origin, Console())
    written = str(Path(scene).resolve()) if is_file(scene) else own.name
    print(f"\n{advice.script(choice.line, own, written)}")
    again = advice.rerun(choice, own, written, measured, error) if rerun else None
    if again:
        advice.show_rerun(again, Console())
    if not choice.reached or (again and not again.met):
        raise typer.Exit(Code.DIFFERS)


@app.command(cls=Command)
def bench(quick: given.Quick = False, out: given.Out = RESULTS) -> None:
    """Measure kernels, peers, length, trees, memory, first results: tables as CSV and Markdown, pictures as SVG."""
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
    file: given.Some = None, case: given.Chosen = None, elements: given.Mesh = None, dt: given.Step = None,
    only: given.Only = None, solver: given.Checked = None, update: given.Update = False,
    scenes: given.Scenes = None, baselines: given.Baselines = None, out: given.Out = RESULTS,
) -> None:  # fmt: skip
    """Displacement histories against the stored ones; exit 1 and a table where they differ."""
    from joblib import cpu_count

    from studies.engine.files import check_writable
    from studies.regression import check as checking
    from studies.regression.report import show, write_check
    from studies.regression.scenes import tasks_of

    tasks = checking.select(tasks_of(_watches(file, case, elements, dt, scenes)), only or (), solver or ())
    own = scenes or (Path(file) if file else None)
    stored = baselines or (own.parent / "baselines" if own else checking.BASELINES)
    check_writable(out / "check")
    work = checking.check(tasks, stored, update, cpu_count())
    findings: list[Any] = []
    with bar() as progress:
        shown = progress.add_task("running", total=len(tasks))
        for found in work:
            findings += found
            progress.update(shown, description=found[-1].name, advance=1)
    write_check(findings, out / "check")
    show(findings, Console())
    print(f"\nWritten to {out / 'check'}/; stored histories are in {stored}/")
    if all(f.verdict == checking.NOT_RUN for f in findings):
        raise typer.Exit(Code.NOT_RUN)
    raise typer.Exit(Code.DONE if checking.passed(findings) else Code.DIFFERS)


def _watches(
    file: str | None, case: str | None, elements: Any, dt: float | None, scenes: Path | None
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
    from studies.conformance import check as conforming

    findings = []
    with Console(stderr=True).status("starting") as shown:
        for finding in conforming.conform(name):
            shown.update(f"tested: {finding.rule}")
            findings.append(finding)
    conforming.show(name, findings, Console())
    raise typer.Exit(conforming.exit_code(findings))
