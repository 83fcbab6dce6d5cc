"""Lines of Python by package and room against the limits of `[tool.line_budget]` in pyproject.toml.

Prints every room with its lines, and ends with 1 where a package is above its limit.
"""

import sys
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]


def lines_of(package: str) -> Counter[str]:
    """Lines of all Python files of a package, by its rooms (folders and modules directly inside)."""
    found: Counter[str] = Counter()
    for path in sorted((ROOT / package).rglob("*.py")):
        room = path.relative_to(ROOT / package).parts[0]
        found[room] += len(path.read_text(encoding="utf-8").splitlines())
    return found


def main() -> int:
    """Print the table; the exit code."""
    limits = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["line_budget"]
    above = []
    for package, limit in limits.items():
        rooms = lines_of(package)
        total = sum(rooms.values())
        print(f"{package:12} {total:7,} of {limit:,}")
        for room, count in rooms.most_common():
            print(f"  {room:24} {count:7,}")
        if total > limit:
            above.append(f"{package} has {total:,} lines, its limit is {limit:,}")
    for sentence in above:
        print(f"line budget: {sentence}", file=sys.stderr)
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())
