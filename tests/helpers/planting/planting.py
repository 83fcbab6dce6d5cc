"""Faults planted by syntax: does `anctmm check` see them?

    python tests/helpers/planting/planting.py [--only TEXT] [--check PATTERN]

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

Change = Callable[[ast.AST], ast.AST]


class NotFound(LookupError):
    """There is no place in the source at which a fault can be planted."""


@dataclass(frozen=True)
class Fault:
    """One fault.

    Parameters
    ----------
    kind : str
        The feature that it breaks.
    module : str
        "anctmm.elements.cable".
    function : str
        Name within the module, "CableElement.mass" of a class; "" for the whole module.
    change : callable
        Syntax tree of the function → changed tree; raises NotFound.
    interpreted : bool
        Whether it is in a kernel: then Python runs all kernels, so that none is compiled and cached with the fault.
    """

    kind: str
    module: str
    function: str
    change: Change
    interpreted: bool = False

    @property
    def name(self) -> str:
        """Place and change, in words."""
        return f"{self.module}:{self.function or '*'} {self.change.__name__}"

    @property
    def path(self) -> Path:
        """File of the module."""
        return ROOT / f"{self.module.replace('.', '/')}.py"

    def planted(self) -> ast.Module:
        """The module's syntax tree with the fault.

        Raises
        ------
        NotFound
            If the function or the place in it is gone.
        """
        tree = ast.parse(self.path.read_text(encoding="utf-8"))
        before = ast.dump(tree)
        self.change(_named(tree, self.function))
        if ast.dump(tree) == before:
            raise NotFound(f"{self.name} changes nothing")
        return ast.fix_missing_locations(tree)


def _named(tree: ast.AST, function: str) -> ast.AST:
    for name in filter(None, function.split(".")):
        inside = [
            n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef) and n.name == name
        ]
        if not inside:
            raise NotFound(f"there is no {function!r}")
        tree = inside[0]
    return tree


# --- changes -------------------------------------------------------------------------------------------------


def flip(number: int = 0) -> Change:
    """Swap the sign of one + or −, counted in the order of the source."""

    def change(tree: ast.AST) -> ast.AST:
        signs = [n for n in _in_order(tree) if isinstance(getattr(n, "op", None), _SIGNS)]
        signs = [n for n in signs if not isinstance(n, ast.UnaryOp) or isinstance(n.op, ast.USub | ast.UAdd)]
        node = _pick(signs, number, "sign")
        node.op = _OTHER[type(node.op)]()
        return tree

    return _called(change, f"flip({number})")


def replace(old: str, new: str, number: int = 0) -> Change:
    """Put one expression in the place of another one."""
    wanted = ast.unparse(ast.parse(old, mode="eval").body)

    def change(tree: ast.AST) -> ast.AST:
        places = [
            (parent, field, index)
            for parent in _in_order(tree)
            for field, value in ast.iter_fields(parent)
            for index, item in enumerate(value if isinstance(value, list) else [value])
            if isinstance(item, ast.expr)
            and not isinstance(getattr(item, "ctx", None), ast.Store)
            and ast.unparse(item) == wanted
        ]
        parent, field, index = _pick(places, number, old)
        other, value = ast.parse(new, mode="eval").body, getattr(parent, field)
        if isinstance(value, list):
            value[index] = other
        else:
            setattr(parent, field, other)
        return tree

    return _called(change, f"{old} → {new}")


def scale(expression: str, factor: float, number: int = 0) -> Change:
    """Multiply an expression."""
    return replace(expression, f"{factor!r} * ({expression})", number)


def swap_arguments(call: str, number: int = 0) -> Change:
    """Swap the first two arguments of a call of a function or method."""

    def change(tree: ast.AST) -> ast.AST:
        node = _pick([n for n in _in_order(tree) if _calls(n, call) and len(n.args) >= 2], number, call)
        node.args[:2] = node.args[1::-1]
        return tree

    return _called(change, f"swap arguments of {call}")


def drop(call: str) -> Change:
    """Leave out all statements that are calls of a function or method."""

    def change(tree: ast.AST) -> ast.AST:
        found = 0
        for parent in ast.walk(tree):
            for statement in (
                list(getattr(parent, "body", ()) or ()) if not isinstance(parent, ast.expr) else ()
            ):
                if isinstance(statement, ast.Expr) and _calls(statement.value, call):
                    parent.body[parent.body.index(statement)] = ast.Pass()
                    found += 1
        if not found:
            raise NotFound(f"there is no statement {call}(…)")
        return tree

    return _called(change, f"drop {call}")


_SIGNS = (ast.Add, ast.Sub, ast.UAdd, ast.USub)
_OTHER = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.UAdd: ast.USub, ast.USub: ast.UAdd}


def _in_order(tree: ast.AST) -> list:
    """Nodes in the order of the source."""
    return [tree, *(node for child in ast.iter_child_nodes(tree) for node in _in_order(child))]


def _calls(node: ast.AST, name: str) -> bool:
    if not isinstance(node, ast.Call):
        return False
    return (node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")) == name


def _pick(places: list, number: int, what: str):
    if number >= len(places):
        raise NotFound(f"there are {len(places)} places of {what}; number {number} is needed")
    return places[number]


def _called(change: Change, name: str) -> Change:
    change.__name__ = name
    return change


# --- planting ------------------------------------------------------------------------------------------------


class _Planted(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports one module with its fault."""

    def __init__(self, fault: Fault) -> None:
        self.fault, self.code = fault, compile(fault.planted(), str(fault.path), "exec")

    def find_spec(self, name, path, target=None):
        """The module of the fault alone."""
        if name != self.fault.module:
            return None
        return importlib.util.spec_from_loader(name, self, origin=str(self.fault.path))

    def exec_module(self, module) -> None:
        """Run the changed code."""
        module.__file__ = str(self.fault.path)
        exec(self.code, vars(module))


def first_seen(only: str = "") -> str:
    """The first comparison of the check that fails in this process; empty if all hold."""
    from studies.regression.check import BASELINES, check, select
    from studies.regression.scenes import tasks_of
    from studies.regression.watches import all_watches

    tasks = select(tasks_of(all_watches()), [only] if only else (), ("anctmm",))
    for found in check(sorted(tasks, key=_slowness), BASELINES):
        for finding in found:
            if not finding.good:
                return f"{finding.name}: {finding.verdict}"
    return ""


def _slowness(task) -> tuple[bool, bool]:
    """Small scenes with other readings first, long ones last."""
    return "small-" not in task.name or "-long-" in task.name, not hasattr(task.run, "run")


def seen(fault: Fault, only: str = "") -> str:
    """The comparison that a fault changes, found in a process of its own; empty if none."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(Path(__file__).parent)])}
    environment |= {"NUMBA_DISABLE_JIT": "1"} if fault.interpreted else {}
    code = f"import planting, faults; print(planting._in_process({fault.name!r}, {only!r}))"
    try:
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", code], env=environment, capture_output=True, text=True,
            check=False, timeout=PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"it takes longer than {PATIENCE} s"
    last = (done.stderr if done.returncode else done.stdout).strip().split("\n")[-1]
    return f"it ends with {last}" if done.returncode else last


def _in_process(name: str, only: str) -> str:
    from faults import FAULTS

    fault = next(f for f in FAULTS if f.name == name)
    sys.meta_path.insert(0, _Planted(fault))
    return first_seen(only)


def main() -> None:
    """Command line."""
    from faults import FAULTS

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="faults whose kind or name has this text")
    parser.add_argument("--check", default="", help="runs of the check: part or pattern of scene/run/solver")
    options = parser.parse_args()
    chosen = [f for f in FAULTS if options.only in f"{f.kind} {f.name}"]
    missed = 0
    for fault in chosen:
        said = seen(fault, options.check)
        missed += not said
        print(fault.kind, fault.name, said or "NOT SEEN", sep=" | ", flush=True)
    print(f"seen {len(chosen) - missed} of {len(chosen)}")
    raise SystemExit(1 if missed else 0)


if __name__ == "__main__":
    main()
