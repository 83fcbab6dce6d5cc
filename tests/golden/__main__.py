"""`python -m tests.golden [--update] [--only PATTERN]`: compare all answers with the stored ones, or store them."""

import argparse
import sys
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.golden.all_groups import GROUPS
from tests.golden.answers import Row, compared, measured, read, selected, write


def main() -> int:
    """Exit code: 0, or 1 if an answer differs from the stored one."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("--update", action="store_true", help="store the answers and what they may differ by")
    parser.add_argument(
        "--only", default="", metavar="PATTERN", help="groups whose name has this text or fits it"
    )
    parser.add_argument("--failed", action="store_true", help="print only the answers that differ")
    given = parser.parse_args()
    names = selected(given.only)
    if not names:
        parser.error(f"--only {given.only!r} fits no group; groups are {', '.join(GROUPS)}")
    if given.update:
        _update(names, whole=not given.only)
        return 0
    rows = [row for name in names for row in compared(name, read())]
    Console().print(_table([row for row in rows if not (given.failed and row.good)]))
    bad = sum(not row.good for row in rows)
    print(f"{len(rows)} answers of {len(names)} groups, {bad} differ")
    return int(bad > 0)


def _update(names: list[str], whole: bool) -> None:
    stored = {} if whole else read()
    for name in names:
        begin = perf_counter()
        stored[name] = measured(name)
        print(f"{name}: {len(stored[name])} answers, {perf_counter() - begin:.1f} s", flush=True)
        write({**({} if whole else read()), **stored})


def _table(rows: list[Row]) -> Table:
    table = Table("answer", "value", "allowed", "difference", "")
    for row in rows:
        found = "none" if row.difference is None else f"{row.difference:.2g}"
        verdict = "" if row.good else "DIFFERS"
        table.add_row(f"{row.group}: {row.name}", _short(row.value), f"{row.allowed:.2g}", found, verdict)
    return table


def _short(value: object) -> str:
    """A text; of many numbers the one that is largest."""
    if isinstance(value, str):
        return value
    numbers = np.asarray(value, dtype=float).ravel()
    largest = numbers[np.nanargmax(np.abs(numbers))] if np.isfinite(numbers).any() else np.nan
    return f"{largest:.10g}" + (f" (of {numbers.size})" if numbers.size > 1 else "")


if __name__ == "__main__":
    sys.exit(main())
