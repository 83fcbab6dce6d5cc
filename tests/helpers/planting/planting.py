"""Faults planted by syntax: does `anctmm check` see them?

    python tests/helpers/planting/planting.py [--only TEXT]

plants each fault of `faults.py`, one at a time, in a process of its own, and prints the first comparison of the check
that it changes. Exit code 1 if one is not seen. No file is changed: the process imports the changed module.

A fault names a module, a function in it and a change of the function's syntax tree. So it does not depend on how the
function is formatted, on its comments or on what else changes in it.
"""

import argparse
import ast
import importlib.abc
import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[3]
#: Longest time of a fault, s: a run that does not end is a fault that is seen.
PATIENCE = 600


class NotFound(LookupError):
    """There is no place in the source at which a fault can be planted."""


@dataclass(frozen=True)
class Fault:
    """One fault: the feature that it breaks, its module, a function in it ("CableElement.mass"), and a change."""

    kind: str
    module: str
    function: str
    change: Callable[[ast.AST], None]

    @property
    def name(self) -> str:
        """Place and change, in words."""
        return f"{self.module}:{self.function} {self.change.__name__}"

    @property
    def path(self) -> Path:
        """File of the module."""
        return ROOT / f"{self.module.replace('.', '/')}.py"

    def planted(self) -> ast.Module:
        """The module's syntax tree with the fault; NotFound if the function or the place in it is gone."""
        tree = place = ast.parse(self.path.read_text(encoding="utf-8"))
        for name in self.function.split("."):
            inside = (n for n in ast.walk(place) if isinstance(n, ast.FunctionDef | ast.ClassDef))
            place = next((n for n in inside if n.name == name), None)
            if place is None:
                raise NotFound(f"there is no {self.function!r}")
        before = ast.dump(tree)
        self.change(place)
        if ast.dump(tree) == before:
            raise NotFound(f"{self.name} changes nothing")
        return ast.fix_missing_locations(tree)


# --- changes -------------------------------------------------------------------------------------------------

OTHER = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.UAdd: ast.USub, ast.USub: ast.UAdd}


def flip(number=0):
    """Swap the sign of one + or −, counted in the order of the source."""

    def change(tree):
        signs = [n for n in _in_order(tree) if type(getattr(n, "op", None)) in OTHER]
        if number >= len(signs):
            raise NotFound(f"there are {len(signs)} signs; number {number} is needed")
        signs[number].op = OTHER[type(signs[number].op)]()

    change.__name__ = f"flip({number})"
    return change


def replace(old, new, number=0):
    """Put one expression in the place of another one."""
    wanted, other = (ast.parse(text, mode="eval").body for text in (old, new))

    class Replace(ast.NodeTransformer):
        left = number

        def visit(self, node):
            is_wanted = ast.unparse(node) == ast.unparse(wanted) if isinstance(node, ast.expr) else False
            if is_wanted and not isinstance(getattr(node, "ctx", None), ast.Store):
                self.left -= 1
                if self.left == -1:
                    return other
            return self.generic_visit(node)

    def change(tree):
        transformer = Replace()
        transformer.visit(tree)
        if transformer.left >= 0:
            raise NotFound(f"there are too few places of {old}; number {number} is needed")

    change.__name__ = f"{old} → {new}"
    return change


def scale(expression, factor, number=0):
    """Multiply an expression."""
    return replace(expression, f"{factor!r} * ({expression})", number)


def _in_order(tree):
    """Nodes in the order of the source."""
    return [tree, *(node for child in ast.iter_child_nodes(tree) for node in _in_order(child))]


# --- planting ------------------------------------------------------------------------------------------------


class _Planted(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports one module with its fault."""

    def __init__(self, fault):
        self.fault, self.code = fault, compile(fault.planted(), str(fault.path), "exec")

    def find_spec(self, name, path, target=None):
        """The module of the fault alone."""
        own = name == self.fault.module
        return importlib.util.spec_from_loader(name, self, origin=str(self.fault.path)) if own else None

    def exec_module(self, module):
        """Run the changed code."""
        module.__file__ = str(self.fault.path)
        exec(self.code, vars(module))


def first_seen(only=""):
    """The first comparison of the check that fails in this process; empty if all hold."""
    from studies.regression.check import BASELINES, check, select
    from studies.regression.scenes import tasks_of
    from studies.regression.watches import all_watches

    def slowness(task):
        """Small scenes with other readings first, long ones last."""
        return "small-" not in task.name, not hasattr(task.run, "what")

    tasks = select(tasks_of(all_watches()), [only] if only else (), ("anctmm",))
    found = (f for findings in check(sorted(tasks, key=slowness), BASELINES) for f in findings)
    return next((f"{f.name}: {f.verdict}" for f in found if not f.good), "")


def seen(fault, only=""):
    """The comparison that a fault changes, found in a process of its own; empty if none."""
    paths = os.pathsep.join([str(ROOT), str(Path(__file__).parent)])
    code = f"import planting, faults; print(planting.in_process({fault.name!r}, {only!r}))"
    command, environment = [sys.executable, "-W", "ignore", "-c", code], {**os.environ, "PYTHONPATH": paths}
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE
        )
    except subprocess.TimeoutExpired:
        return f"it takes longer than {PATIENCE} s"
    last = (done.stderr if done.returncode else done.stdout).strip().split("\n")[-1]
    return f"it ends with {last}" if done.returncode else last


def in_process(name, only):
    """What is seen of a fault that is planted here."""
    from faults import FAULTS

    sys.meta_path.insert(0, _Planted(next(f for f in FAULTS if f.name == name)))
    return first_seen(only)


def main():
    """Command line."""
    from faults import FAULTS

    parser = argparse.ArgumentParser(description="plants faults and prints which run of the check sees each")
    parser.add_argument("--only", default="", help="faults whose kind or name has this text")
    options = parser.parse_args()
    found = []
    for fault in (f for f in FAULTS if options.only in f"{f.kind} {f.name}"):
        found.append(seen(fault))
        print(fault.kind, fault.name, found[-1] or "NOT SEEN", sep=" | ", flush=True)
    print(f"seen {sum(map(bool, found))} of {len(found)}")
    raise SystemExit(0 if all(found) else 1)


if __name__ == "__main__":
    main()
