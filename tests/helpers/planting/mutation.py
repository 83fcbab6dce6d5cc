"""How many planted faults the tests see: a mutation test, run by hand.

    pip install cosmic-ray
    python tests/helpers/planting/mutation.py [--sample N] [--seed S] MODULE ...

Cosmic Ray's operators change one sign, operator, comparison, number or branch of a module at a time; the tests that
concern the module then run on the changed source until one of them fails. Each fault gets a fork of one process that
has all libraries loaded, and kernels are not compiled, so a fault takes a few seconds. No file is changed.

Survivors that are known stand in mutation_survivors.toml with the reason, mostly that no result changes; the share is
printed with and without those. What is listed but seen by the tests, or gone from the source, is named.
"""

import argparse
import os
import random
import re
import shlex
import signal
import sys
import time
import tomllib
from math import sqrt
from pathlib import Path

for _name in ("NUMBA_DISABLE_JIT", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[_name] = "1"

import hypothesis.strategies  # noqa: E402, F401
import numpy.testing  # noqa: E402, F401
import pytest  # noqa: E402
from cosmic_ray.ast import Visitor, get_ast  # noqa: E402
from cosmic_ray.mutating import MutationVisitor  # noqa: E402
from cosmic_ray.plugins import get_operator, operator_names  # noqa: E402
from planted import Planted  # noqa: E402

import anctmm  # noqa: E402, F401

for _name in [n for n in sys.modules if n.partition(".")[0] == "anctmm"]:
    del sys.modules[_name]  # the libraries it needs stay loaded, it is imported anew with the fault

ROOT = Path(__file__).parents[3]
SURVIVORS = Path(__file__).with_name("mutation_survivors.toml")
#: What the tests need not load, and a warning about what is loaded already.
PYTEST = shlex.split(
    "-x -p no:cacheprovider -p no:randomly -p no:xdist -p no:regressions -p no:datadir "
    "-W ignore::pytest.PytestAssertRewriteWarning"
)
#: Operators whose faults a program of numbers can survive: `a << b` or `a is b` fails at once and proves nothing.
OPERATORS = re.compile(
    r"core/(ReplaceBinaryOperator_(Add|Sub|Mul|Div)_(Add|Sub|Mul|Div)"
    r"|ReplaceComparisonOperator_(Eq|NotEq|Lt|LtE|Gt|GtE)_(Eq|NotEq|Lt|LtE|Gt|GtE)"
    r"|ReplaceUnaryOperator_USub_UAdd|ReplaceUnaryOperator_Delete_(Not|Invert)|ReplaceTrueWithFalse"
    r"|ReplaceFalseWithTrue|ReplaceAndWithOr|ReplaceOrWithAnd|ReplaceBreakWithContinue|ReplaceContinueWithBreak"
    r"|NumberReplacer|ZeroIterationForLoop|AddNot)"
)
#: Arguments of pytest for the faults of a module, the quickest to see them first.
TESTS = {
    "anctmm/elements/": "tests/elements/test_elements.py tests/integrators/test_damping.py "
    "-k 'not (global or exudyn or implicit or axial "
    "or absent or limit)'",
    "anctmm/recursion/constrained.py": "tests/recursion/test_rigid.py "
    "-k 'readable or held or would_stretch or first_steps or cannot_be'",
    "anctmm/recursion/transfer.py": "tests/recursion/test_transfer.py -k 'not thousand'",
    "anctmm/recursion/riccati.py": "tests/recursion/test_transfer.py -k 'not thousand'",
    "anctmm/recursion/node_blocks.py": "tests/recursion/test_transfer.py -k 'not thousand'",
    "anctmm/recursion/split.py": "tests/recursion/test_transfer.py -k 'not thousand'",
    "anctmm/results/metrics.py": "tests/results/test_metrics.py",
    "anctmm/integrators/zhai.py": "tests/integrators/test_explicit.py "
    "tests/integrators/test_motion.py tests/integrators/test_damping.py tests/recursion/test_rigid.py "
    "-k 'stoermer or limits_by or diverging or last_output or outputs_hold or batches or first_steps "
    "or would_stretch or would_bend or not_finite or free_bar_is_exact or (clamp_at_either and zhai and cable)'",
    "anctmm/integrators/generalized_alpha.py": "tests/integrators/implicit/test_implicit.py "
    "tests/integrators/test_motion.py tests/integrators/test_damping.py -k 'coefficients "
    "or members or factors or small_vibration or driven_clamp_is or counts or misses or annihilates or outputs_hold "
    "or batches or first_steps or residuals_told or measured_in or longer_than or gradients_beyond "
    "or bound_is or worst_correction'",
}
#: Longest time of a fault's tests, s: a loop that does not end is seen, too.
PATIENCE = 120


class Positions(Visitor):
    """Count the places at which an operator applies."""

    def __init__(self, operator):
        self.operator, self.count = operator, 0

    def visit(self, node):
        self.count += sum(1 for _ in self.operator.mutation_positions(node))
        return node


def places(source):
    """All (operator, occurrence) of a source."""
    tree, found = get_ast(source), []
    for name in sorted(filter(OPERATORS.fullmatch, operator_names())):
        positions = Positions(get_operator(name)())
        positions.walk(tree)
        found += [(name, n) for n in range(positions.count)]
    return found


def known_survivors(name, source):
    """Survivors listed for a module or all of its directory, by line and change, None for any change of the line.

    What is listed and no longer in the source is named.
    """
    lines, found = {line.strip() for line in source.splitlines()}, {}
    for prefix, entries in tomllib.loads(SURVIVORS.read_text(encoding="utf-8")).items():
        for entry in entries if name.startswith(prefix) else ():
            if entry["line"] in lines:
                changes = entry.get("change")
                found |= {
                    (entry["line"], c): entry for c in (changes if isinstance(changes, list) else [changes])
                }
            elif prefix == name:
                print(f"  listed, but gone: {name}: {entry['line']}", flush=True)
    return found


def planted(source, name, occurrence):
    """Changed source, its first changed line, what stood there and what does; None where nothing changes."""
    changed = MutationVisitor.mutate_code(source, get_operator(name)(), occurrence)
    for i, (before, after) in enumerate(zip(source.splitlines(), changed.splitlines(), strict=False), 1):
        if before != after:
            return changed, i, before.strip(), after.strip()
    return None


def survives(path, source, arguments):
    """Whether all tests pass on a changed source."""
    child = os.fork()
    if child == 0:
        signal.alarm(PATIENCE)
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        sys.meta_path.insert(0, Planted(path, source))
        code = 1
        try:
            code = int(pytest.main([*PYTEST, *arguments]))
        finally:
            os._exit(code)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status == pytest.ExitCode.NO_TESTS_COLLECTED:
        raise SystemExit(f"no tests collected by {arguments}")
    return status == 0


def wilson(part, whole, z=1.96):
    """Interval of 95 % confidence of a share."""
    middle = (part + z * z / 2) / (whole + z * z)
    half = z / (whole + z * z) * sqrt(part * (whole - part) / whole + z * z / 4)
    return middle - half, middle + half


def share(killed, tried):
    """A share of faults seen, with its interval."""
    low, high = wilson(killed, tried)
    return f"{killed} of {tried} ({killed / tried:.1%}, 95 % between {low:.1%} and {high:.1%})"


def examine(path, sample, seed):
    """Plant a sample of a module's faults, print what survives and a line of the table.

    Returns
    -------
    (int, int, int)
        Faults seen, faults tried, and survivors that are listed as changing no result.
    """
    source = path.read_text(encoding="utf-8")
    name = path.relative_to(ROOT).as_posix()
    arguments = shlex.split(next(tests for prefix, tests in TESTS.items() if name.startswith(prefix)))
    if not survives(path, source, arguments):
        raise SystemExit(f"{name}: the tests fail without a fault: {arguments}")
    found, known = places(source), known_survivors(name, source)
    chosen = random.Random(seed).sample(found, min(sample or len(found), len(found)))
    begin, tried, killed, alike = time.monotonic(), 0, 0, 0
    for operator, occurrence in sorted(chosen):
        fault = planted(source, operator, occurrence)
        if fault is None:
            continue
        changed, number, before, after = fault
        listed, tried = known.get((before, after)), tried + 1
        entry = listed or known.get((before, None))
        seen = not survives(path, changed, arguments)
        same = not seen and entry is not None and not entry.get("changes_result", False)
        killed, alike = killed + seen, alike + same
        if listed is not None or not seen:
            what = "listed, but seen" if seen else "changes no result" if same else "survives"
            reason = f"  ({entry['reason']})" if entry else ""
            print(f"  {what}: {name}:{number}: {before}  ->  {after}{reason}", flush=True)
    print(f"{name}: {figures(killed, tried, alike)}; {len(found)} in all, {time.monotonic() - begin:.0f} s")
    sys.stdout.flush()
    return killed, tried, alike


def figures(killed, tried, alike):
    """Both shares of faults seen."""
    return f"seen {share(killed, tried - alike)} of the faults that change a result, {share(killed, tried)} of all"


def main():
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("modules", nargs="+", type=lambda p: Path(p).resolve())
    parser.add_argument("--sample", type=int, help="faults of each module, drawn at random; all without it")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    os.chdir(ROOT)
    rows = [examine(path, options.sample, options.seed) for path in options.modules]
    print(f"all: {figures(*map(sum, zip(*rows, strict=True)))}")


if __name__ == "__main__":
    main()
