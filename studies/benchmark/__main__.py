"""Times of a step of this checkout and of another one, taken in turn: `python -m studies.benchmark OTHER_CHECKOUT`.

Each checkout has a process of its own, which runs the items of the benchmark by its own `anctmm`.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Any

from rich.console import Console

from studies.benchmark import scenes
from studies.benchmark.study import Sample, measured, show

ROOT = Path(__file__).parents[2]


def worker_of(checkout: Path, quick: bool) -> Callable[[str], Sample]:
    """A function that runs an item in a process of its own, which imports one checkout."""
    command = [sys.executable, "-P", scenes.__file__, str(checkout), *["--quick"] * quick]
    environment = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
    process = Popen(command, env=environment, text=True, stdin=PIPE, stdout=PIPE)

    def run(name: str) -> Sample:
        print(name, file=process.stdin, flush=True)
        answer = process.stdout.readline()  # type: ignore[union-attr]  # it is a pipe
        if not answer:
            raise SystemExit(f"the process of {checkout} ended at {name!r}")
        return dict(json.loads(answer))

    return run


def main() -> None:
    """Print a table of both checkouts; ratios are to this one."""
    parser = argparse.ArgumentParser(prog="python -m studies.benchmark", description=__doc__)
    parser.add_argument("other", type=Path, help="directory of the other checkout")
    parser.add_argument("--only", default="", help="items whose name contains this text")
    parser.add_argument("--repeats", type=int, default=7, help="measured rounds")
    parser.add_argument("--quick", action="store_true", help="fewer items, shorter runs")
    given = parser.parse_args()
    every = [item for item in scenes.items(given.quick) if given.only in item.name]
    if not every:
        parser.error(f"--only {given.only!r} fits no item, such as {next(scenes.items()).name!r}")
    if not (given.other / "anctmm").is_dir() or given.repeats < 1:
        parser.error("a checkout that has a folder anctmm, and a repeat or more, are needed")
    checkouts = {"here": ROOT, "other": given.other.resolve()}
    workers = {name: worker_of(path, given.quick) for name, path in checkouts.items()}

    def calls_of(item: scenes.Item) -> dict[str, Any]:
        return {name: partial(run, item.name) for name, run in workers.items()}

    table, _ = measured(every, calls_of, given.repeats, lambda name: print(name, file=sys.stderr))
    show(table, "Times of a step in both checkouts", Console())


if __name__ == "__main__":
    main()
