"""The command line."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Annotated, Any

import matplotlib as mpl
import pandas as pd
import typer
from joblib import cpu_count
from rich.console import Console

from anctmm.errors import PluginError
from anctmm.solvers import registry
from studies import single_run
from studies.benchmark import study as benchmark
from studies.cases import built_in, cases_in, chosen, find_case, find_cases, is_file, place_name
from studies.command_line import options as given
from studies.command_line.compiling import compile_kernels
from studies.command_line.ending import CODES, BadOption, Code, Command
from studies.command_line.progress import bar, sweeping
from studies.conformance import check as conforming
from studies.engine.files import check_writable, file_name
from studies.engine.study import STUDIES, Options, check_fits, check_taken
from studies.engine.tables import show_frame
from studies.regression import check as checking
from studies.regression.report import show, write_check
from studies.regression.scenes import Watch, declared_in, tasks_of
from studies.regression.watches import all_watches, watches_of
from studies.report import terminal, whole
from studies.trade import recommend as advice
from studies.trade.study import run as run_trade

RESULTS = Path("results")
mpl.use("agg")  # pictures are files
app = typer.Typer(epilog=CODES, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"anctmm {version_of('anctmm')}")
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
    scenes = [
        {
            "name": case.name, "bodies": ", ".join(body.name for body in case.scene.bodies),
            "probes": ", ".join(map(place_name, case.probes)),
            "run": "static" if case.static else f"{case.duration:g} s",
            "note": case.note if len(case.note) <= 60 else f"{case.note[:59]}…",
        }
        for case in (built_in() if file is None else cases_in(file))
    ]  # fmt: skip
    show_frame(Console(), "Scenes", pd.DataFrame(scenes))
    if file is None:
        solvers = [{"name": n, "from": origin, "lacks": _lacks(n)} for n, origin in registry.origins()]
        show_frame(Console(), "Solvers", pd.DataFrame(solvers))
        studies = [{"name": name, "question": about[1]} for name, about in STUDIES.items()]
        show_frame(Console(), "Studies", pd.DataFrame(studies))


def _lacks(solver: str) -> str:
    """Features that a solver lacks, or why it cannot be loaded."""
    try:
        return ", ".join(sorted(registry.offer_of(registry.load(solver)).lacks))
    except PluginError as error:
        return f"broken: {' '.join(str(error).split())}"


@app.command(cls=Command)
def run(
    scene: given.Given, case: given.Chosen = None, error: given.Target = None, elements: given.Mesh = None,
    dt: given.Step = None, element: given.Element = None, integrator: given.Integrator = None,
    solvers: given.Solvers = None, out: given.Out = None,
) -> Code:  # fmt: skip
    """Run one case: values with their uncertainty, and its solution, histories, plot and animation as files."""
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
    return Code.DIFFERS if done.missed else Code.NOT_RUN if done.absent else Code.DONE


@app.command(cls=Command)
def study(
    name: Annotated[str, typer.Argument(help="trade, convergence, … (see `anctmm list`)")],
    scene: given.Some = None, case: given.Chosen = None, elements: given.Meshes = None, dt: given.Steps = None,
    solvers: given.Solvers = None, element: given.Element = None, integrator: given.Integrator = None,
    error: given.Target = None, quick: given.Quick = False, workers: given.Workers = None,
    cluster: given.Cluster = None, out: given.Out = RESULTS,
) -> Code:  # fmt: skip
    """Run one study: tables as CSV and Markdown, pictures as SVG."""
    options = Options(quick, elements, dt, solvers, chosen(scene, case), element, integrator, error)
    check_taken(options, name)
    check_writable(out)
    good = False
    with sweeping(quick, workers, cluster) as runner:
        for done in whole.run_study(name, options, runner):
            folder = whole.write_study(done, out)
            terminal.glance(done, Console())
            print(f"\nWritten to {folder}/")
            good = good or done.good
    if not good:
        print("anctmm: all runs are refused or fail, as said above", file=sys.stderr)
    return Code.DONE if good else Code.DIFFERS


@app.command(cls=Command)
def report(
    file: given.Some = None, case: given.Chosen = None, quick: given.Quick = False, workers: given.Workers = None,
    cluster: given.Cluster = None, out: given.Out = None,
) -> Code:  # fmt: skip
    """Run every study and write one page; of a file those that take its cases. Default of --out: reports."""
    cases = chosen(file, case)
    folder = out or (RESULTS / file_name(Path(file).stem) if file else Path("reports"))
    check_writable(folder)
    done = []
    with sweeping(quick, workers, cluster) as runner:
        for one in whole.run_all(cases, quick, runner):
            done.append(one)
            whole.write_report(done, folder, quick, (file, case))  # whole, whatever fails an hour later
            print(f"anctmm: {one.name} {one.case} is done", file=sys.stderr)
    print(f"Written to {folder}/index.html")
    return Code.DONE if any(one.good for one in done) else Code.DIFFERS


@app.command(cls=Command)
def recommend(
    scene: given.Given, case: given.Chosen = None, error: given.Target = None, budget: given.Budget = None,
    elements: given.Meshes = None, dt: given.Steps = None, solvers: given.Solvers = None,
    element: given.Element = None, integrator: given.Integrator = None, table: given.Trade = None,
    quick: given.Quick = False, workers: given.Workers = None, cluster: given.Cluster = None,
    rerun: given.Rerun = True,
) -> Code:  # fmt: skip
    """Print the cheapest measured setting for an error, or the best within a budget, and the script that runs it."""
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
    again = advice.rerun(choice, own, measured, error) if rerun else None
    if again:
        advice.show_rerun(again, Console())
    return Code.DONE if choice.reached and (not again or again.met) else Code.DIFFERS


@app.command(cls=Command)
def bench(quick: given.Quick = False, out: given.Out = RESULTS) -> None:
    """Measure steps beside peers, at length and of trees: tables as CSV and Markdown."""
    check_writable(out)
    with Console(stderr=True).status("starting") as shown:
        result = benchmark.bench(quick, lambda text: shown.update(f"measuring: {text}"))
    folder = whole.write_study(result, out)
    for table in result.tables[:2]:
        benchmark.show(table.frame, table.title, Console())
    print(f"\nWritten to {folder}/")


@app.command(cls=Command)
def check(
    file: given.Some = None, case: given.Chosen = None, elements: given.Mesh = None, dt: given.Step = None,
    only: given.Only = None, solver: given.Checked = None, update: given.Update = False,
    scenes: given.Scenes = None, baselines: given.Baselines = None, out: given.Out = RESULTS,
) -> Code:  # fmt: skip
    """Displacement histories against the stored ones; exit 1 and a table where they differ."""
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
        return Code.NOT_RUN
    return Code.DONE if checking.passed(findings) else Code.DIFFERS


def _watches(
    file: str | None, case: str | None, elements: Any, dt: float | None, scenes: Path | None
) -> tuple[Watch, ...]:
    """Watched scenes: cases of a file, those that another declares, or the built-in ones."""
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
    compile_kernels(lambda kind: print(f"compiled: {kind}", flush=True))


@app.command(cls=Command)
def conform(name: Annotated[str, typer.Argument(help="A registered solver (see `anctmm list`).")]) -> Code:
    """Test a solver against the rules of all solvers: exit 1 where it breaks one, 4 where it is not installed."""
    findings = []
    with Console(stderr=True).status("starting") as shown:
        for finding in conforming.conform(name):
            shown.update(f"tested: {finding.rule}")
            findings.append(finding)
    conforming.show(name, findings, Console())
    return Code(conforming.exit_code(findings))
