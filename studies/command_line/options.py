"""Options of commands. One that cannot be parsed is named with its value and what is allowed."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from anctmm.solvers import registry

#: Units of a duration, s.
UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0}
MESHES = "whole numbers from 1 on for each beam, or for all, such as 2/8/2 or 8"
NUMBERS = "positive numbers such as 1e-3"


def parser(read: Callable[[str], Any], allowed: str, several: bool = False) -> Callable[[str], Any]:
    """A parser of one value, or of several between commas, each once; `read` raises ValueError where it cannot."""

    def parse(text: str) -> Any:
        try:
            items = [read(item.strip()) for item in (text.split(",") if several else [text])]
        except ValueError:
            more = ", or several of these with commas between them" if several else ""
            raise typer.BadParameter(f"{text!r}; allowed are {allowed}{more}") from None
        return tuple(dict.fromkeys(items)) if several else items[0]

    return parse


def solver(text: str) -> str:
    """The name of a registered solver."""
    if text not in registry.names():
        raise typer.BadParameter(f"{text!r}; allowed are {', '.join(registry.names())}")
    return text


def mesh(text: str) -> tuple[int, ...]:
    """2/8/2 as numbers."""
    found = tuple(int(n) for n in text.split("/"))
    if min(found) < 1:
        raise ValueError
    return found


def positive(text: str) -> float:
    """A positive number."""
    number = float(text)
    if not 0.0 < number < float("inf"):
        raise ValueError
    return number


def duration(text: str) -> float:
    """Seconds of 0.5s, 20ms, 3us or 0.5."""
    unit = next((unit for unit in UNITS if text.endswith(unit)), "")
    return UNITS.get(unit, 1.0) * positive(text.removesuffix(unit))


def word(text: str) -> str:
    """A text that is not empty, as it may be where a variable of the shell is not set."""
    if not text.strip("\0 "):
        raise ValueError
    return text


def path(given: str | Path) -> Path:
    """A path as typed, or a default."""
    return Path(parser(word, "paths that are not empty")(str(given)))


def _option(help: str, metavar: str, read: Callable[[str], Any], *names: str) -> Any:
    return typer.Option(*names, help=help, metavar=metavar, parser=read)


_names = parser(word, "names", several=True)
# fmt: off
Text = str | None
Given = Annotated[str, typer.Argument(help="A built-in scene (see `anctmm list`), or a file that defines CASES.")]
Some = Annotated[Text, typer.Argument(help="A built-in scene, or a file that defines CASES.")]
Chosen = Annotated[Text, typer.Option("--case", help="Scene of the file, by name.", metavar="NAME")]
Meshes = Annotated[Any, _option(
    "Elements of each beam, or of all: 2/8/2,16.", "LIST", parser(mesh, MESHES, several=True), "--elements")]
Mesh = Annotated[Any, _option("Elements of each beam, or of all.", "MESH", parser(mesh, MESHES), "--elements")]
Steps = Annotated[Any, _option(
    "Time steps, s: 1e-5,5e-6.", "LIST", parser(positive, NUMBERS, several=True), "--dt")]
Step = Annotated[Any, _option("Time step, s: 1e-3.", "NUMBER", parser(positive, NUMBERS), "--dt")]
Solvers = Annotated[Any, _option(
    "Solvers by name (see `anctmm list`): a,b.", "LIST", parser(solver, "names", several=True))]
Element = Annotated[Literal["cable", "quintic", "shear", "rigid"] | None, typer.Option()]
Integrator = Annotated[Literal["generalized-alpha", "zhai", "esdirk"] | None, typer.Option()]
Target = Annotated[Any, _option("Target error, relative: 1e-3.", "NUMBER", parser(positive, NUMBERS), "--error")]
Budget = Annotated[Any, _option(
    "CPU time of the steps: 0.5s, 20ms.", "TIME", parser(duration, "positive times such as 20ms, 0.5s"))]
Quick = Annotated[bool, typer.Option("--quick", help="The smallest sweep that shows the point.")]
Workers = Annotated[int | None, typer.Option(
    min=1, max=9999, help="Processes that compute errors; times are in turn.")]
Cluster = Annotated[Text, typer.Option(help="Scheduler of a dask cluster that computes errors: tcp://host:8786.")]
Out = Annotated[Any, _option("Where files are written; default: results, in CASE/STUDY.", "PATH", path)]
Trade = Annotated[Any, _option(
    "Directory of a measured trade; default: results/CASE/trade, reports/trade, ours.", "PATH", path)]
Rerun = Annotated[bool, typer.Option(help="Run the recommendation and check its error.")]
Only = Annotated[Any, _option("Parts or patterns of scene/run/solver: four-bar/,*-zhai/*.", "LIST", _names)]
Checked = Annotated[Any, _option("Solvers by name: a,b.", "LIST", _names)]
Update = Annotated[bool, typer.Option("--update", help="Store histories that are new or differ.")]
Scenes = Annotated[Any, _option("Your Python file that defines WATCHED.", "PATH", path)]
Baselines = Annotated[Any, _option(
    "Stored histories: anctmm's, or baselines/ beside your scenes.", "PATH", path)]
# fmt: on
