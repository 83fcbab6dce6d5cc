"""Faults planted one at a time into the sources: what does `anctmm check` say of each?

    python tests/helpers/planting/planted.py [--compiled] [--kind KIND] [--first] [--sample N --seed S]
                                             [--out TABLE.csv]

Each fault of `planted_faults.toml` changes one place of one file, and the small scenes are checked with that change
until one comparison fails. They are interpreted, not compiled: each fault gets a fork of one process that has all
libraries loaded, so that most take a second or two, where compiling changed kernels takes a minute or two. With
`--compiled` the command `anctmm check` itself runs on a copy of the sources and of the kernels that are kept, so that
what the fault changes is compiled anew, and nothing else.
A fault is seen where a comparison fails, the check ends in an exception, or it takes longer than PATIENCE, interpreted
ROOM times what the sources as they are take.
"""

import argparse
import csv
import importlib
import importlib.abc
import importlib.machinery
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import traceback
import warnings
from dataclasses import dataclass
from math import ceil
from pathlib import Path

ROOT = Path(__file__).parents[3]
TABLE = Path(__file__).with_name("planted_faults.toml")
PACKAGES = ("anctmm", "reference", "studies")
#: Longest time of one check, s: of the processor interpreted, of the clock compiled.
PATIENCE = 900
#: The same interpreted, in times of the sources as they are: scenes become more, and machines differ.
ROOM = 2


@dataclass(frozen=True)
class Fault:
    """One change of one file.

    Parameters
    ----------
    file : str
        Path from the root.
    kind : str
        What it breaks.
    old, new : str
        What stands there, once, and what comes in its place.
    """

    file: str
    kind: str
    old: str
    new: str

    @property
    def name(self) -> str:
        """One line."""
        return f"{self.file}: {' '.join(self.old.split())}  ->  {' '.join(self.new.split()) or 'nothing'}"


def faults() -> list[Fault]:
    """The table."""
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    return [Fault(file, **entry) for file, entries in table.items() for entry in entries["faults"]]


class Planted(importlib.abc.MetaPathFinder, importlib.abc.SourceLoader):
    """Import one module from another source text."""

    def __init__(self, path, source):
        self.path, self.source = str(path), source
        self.name = ".".join(path.relative_to(ROOT).with_suffix("").parts)

    def find_spec(self, fullname, path, target=None):
        if fullname != self.name:
            return None
        return importlib.machinery.ModuleSpec(fullname, self, origin=self.path, is_package=False)

    def get_filename(self, fullname):
        return self.path

    def get_data(self, path):
        return self.source.encode()


def changed(fault):
    """The source of a fault's file with the fault."""
    source = (ROOT / fault.file).read_text(encoding="utf-8")
    if source.count(fault.old) != 1:
        raise SystemExit(
            f"{fault.file} has {source.count(fault.old)} times what is to be changed: {fault.old}"
        )
    return source.replace(fault.old, fault.new)


def prepare():
    """Load all libraries, and forget the packages: they are imported anew with each fault."""
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    importlib.import_module("studies.regression.check")
    importlib.import_module("studies.regression.small_watches")
    for name in [n for n in sys.modules if n.partition(".")[0] in PACKAGES]:
        del sys.modules[name]


def first_seen():
    """The first comparison of the small scenes that fails; nothing if all hold."""
    warnings.simplefilter("ignore")
    checking = importlib.import_module("studies.regression.check")
    watches = importlib.import_module("studies.regression.small_watches")
    scenes = importlib.import_module("studies.regression.scenes")
    tasks = sorted(scenes.tasks_of(watches.small_watches()), key=_slowness)
    for found in checking.check(tasks, checking.BASELINES):
        for finding in found:
            if not finding.good:
                return f"{finding.name}: {finding.verdict}"
    return ""


def _slowness(task):
    """Interpreted, explicit steps are the quickest, Newton's iterations and long bodies the slowest.

    Equilibria come last: where there is none, also for a fault, statics tries thousands of corrections.
    """
    at_rest = not isinstance(task.run, importlib.import_module("anctmm").Discretisation)
    implicit = "implicit" in task.run_name or "adaptive" in task.run_name
    return (at_rest, "-long-" in task.scene.name, implicit)


def seen(fault, limit=PATIENCE):
    """What a check of the small scenes says of a fault (None: of the sources as they are), nothing if it sees none."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        said = "it ends in an exception"
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
            if fault is not None:
                sys.meta_path.insert(0, Planted(ROOT / fault.file, changed(fault)))
            said = first_seen()
        except BaseException:
            said = f"it ends with {traceback.format_exc().strip().splitlines()[-1]}"
        finally:
            os.write(writing, (said or "nothing").encode())
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        said = pipe.read()
    os.waitpid(child, 0)
    return {"nothing": "", "": f"it takes longer than {limit} s"}.get(said, said)


def seen_compiled(fault, limit=PATIENCE):
    """What the command says of a fault in a copy of the sources, and of the kernels that are kept."""
    kept = importlib.import_module("anctmm.jit.compiler.kernel_files").directory()
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        for package in PACKAGES:
            shutil.copytree(ROOT / package, tree / package, ignore=shutil.ignore_patterns("__pycache__"))
        if fault is not None:
            (tree / fault.file).write_text(changed(fault), encoding="utf-8")
        if kept is not None and fault is not None:  # without a fault they are compiled and kept
            shutil.copytree(
                kept, tree / "cache" / "anctmm" / "kernels", ignore=shutil.ignore_patterns("*.part")
            )
        environment = {**os.environ, "PYTHONPATH": folder}
        environment |= {"ANCTMM_CACHE": str(tree / "cache")} if fault is not None else {}
        command = [sys.executable, "-m", "studies", "check", "--out", str(tree / "out")]
        try:
            done = subprocess.run(
                command, env=environment, cwd=folder, capture_output=True, text=True, check=False,
                timeout=limit,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return f"it takes longer than {limit} s"
        table = tree / "out" / "check" / "check.csv"
        if not table.exists():
            return f"it ends with {done.stderr.strip().splitlines()[-1:]}"
        rows = csv.DictReader(table.read_text(encoding="utf-8").splitlines())
        bad = [r for r in rows if r["verdict"] not in ("same", "not run")]
        told = "; ".join(f"{r['scene']}/{r['run']}/{r['solver']}: {r['verdict']}" for r in bad[:3])
        return f"{len(bad)} comparisons: {told}" if bad else ""


def processor_time():
    """Seconds that children of this process, and theirs, have computed until now."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Command line: a table of all faults, and which were not seen."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--compiled", action="store_true", help="run the command itself on compiled kernels")
    parser.add_argument("--kind", help="only faults of this kind")
    parser.add_argument("--first", action="store_true", help="the first of each kind")
    parser.add_argument("--sample", type=int, help="so many faults, drawn at random; all without it")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="a CSV table")
    options = parser.parse_args()
    chosen = [f for f in faults() if options.kind in (None, f.kind)]
    if options.first:
        chosen = list({f.kind: f for f in reversed(chosen)}.values())
    if options.sample:
        chosen = random.Random(options.seed).sample(chosen, min(options.sample, len(chosen)))
    look = seen_compiled if options.compiled else seen
    sys.path.insert(0, str(ROOT))
    if not options.compiled:
        prepare()
    if wrong := look(None):
        raise SystemExit(f"without a fault the check says: {wrong}")
    limit = PATIENCE if options.compiled else ceil(ROOM * processor_time())
    rows = []
    for fault in chosen:
        begun, before = time.monotonic(), processor_time()
        said = look(fault, limit) or "NOT SEEN"
        took = round(time.monotonic() - begun), round(processor_time() - before)
        rows.append([fault.kind, fault.name, said, *took])
        print(*rows[-1], sep=" | ", flush=True)
    missed = [row[2] for row in rows].count("NOT SEEN")
    print(f"seen {len(rows) - missed} of {len(rows)}")
    if options.out:
        with options.out.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([["kind", "fault", "seen by", "s", "processor s"], *rows])
    raise SystemExit(1 if missed else 0)


if __name__ == "__main__":
    main()
