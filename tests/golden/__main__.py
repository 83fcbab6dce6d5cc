"""`python -m tests.golden [--update] [--only PATTERN]`: compare all answers with the stored ones, or store them."""

import argparse
import sys

from tests.golden.all_groups import GROUPS
from tests.golden.answers import compared, measured, read, selected, write


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
        _update(names)
        return 0
    rows = [row for name in names for row in compared(name, read())]
    bad = [row for row in rows if not row.good]
    for row in bad if given.failed else rows:
        found = "none" if row.difference is None else f"{row.difference:.2g}"
        print(f"{row.group}: {row.name}: {found} of {row.allowed:.2g} {'' if row.good else 'DIFFERS'}")
    print(f"{len(rows)} answers of {len(names)} groups, {len(bad)} differ")
    return int(bool(bad))


def _update(names: list[str]) -> None:
    """Store the answers of groups anew; those of groups that are no more go."""
    for name in names:
        write({key: row for key, row in read().items() if key in GROUPS} | {name: measured(name)})
        print(name, flush=True)


if __name__ == "__main__":
    sys.exit(main())
