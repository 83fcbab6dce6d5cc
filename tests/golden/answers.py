"""Answers, groups of answers and their stored table."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.golden.vary import HALF_STEP, PLAIN, SMALL, Variation

TABLE = Path(__file__).parent / "table.json"
#: What an answer may differ by, over the largest change of it under a small variation.
SAFETY = 30.0
#: The least that it may differ by, over its scale: rounding of other, equally good, sums.
FLOOR = 1e-11
#: What an answer that is read of implicit steps in several ways may differ by, over its change with half the step, and
#: at least, over its scale.
COARSE, COARSE_FLOOR = 4.0, 1e-3


@dataclass(frozen=True, eq=False)
class Answer:
    """An answer of a group.

    Parameters
    ----------
    value : array or str
        Numbers of one quantity; or a text, which must be equal.
    scale : float, optional
        What its rounding is relative to. Default: the largest of the numbers, or 1 if all are 0.
    allowed : float, optional
        What it may differ by, where that follows from a tolerance of the run and not from its sensitivity.
    coarse : bool
        Whether it depends on how a method reads accelerations or sums works: equally good ways differ by a part of the
        error of the step.
    """

    value: Any
    scale: float | None = None
    allowed: float | None = None
    coarse: bool = False

    @property
    def array(self) -> NDArray[np.float64]:
        """Its numbers."""
        return np.asarray(self.value, dtype=float)

    def difference(self, other: "Answer") -> float:
        """Largest difference of two answers; infinite if they are of different shapes, or one number is none."""
        if isinstance(self.value, str) or isinstance(other.value, str):
            return 0.0 if self.value == other.value else np.inf
        if self.array.shape != other.array.shape:
            return np.inf
        nan = np.isnan(self.array)
        if not np.array_equal(nan, np.isnan(other.array)):
            return np.inf
        return float(np.abs(self.array - other.array)[~nan].max(initial=0.0))


#: Answers by name; what is no `Answer` becomes the value of one.
Answers = dict[str, Any]
GROUPS: dict[str, Callable[[Variation], Answers]] = {}


def group(function: Any = None, /, *, name: str = "", **arguments: Any) -> Any:
    """Register a function of a variation, called or as a decorator; with further arguments under another name."""
    if function is None:
        return partial(group, name=name, **arguments)
    GROUPS[name or function.__name__.replace("_", " ")] = partial(function, **arguments)
    return function


def answers_of(name: str, variation: Variation = PLAIN) -> dict[str, Answer]:
    """Answers of a group by name."""
    found = GROUPS[name](variation)
    return {key: a if isinstance(a, Answer) else Answer(a) for key, a in found.items()}


def selected(pattern: str = "") -> list[str]:
    """Names of groups that contain a text or fit a pattern."""
    return [name for name in GROUPS if pattern in name or fnmatch(name, pattern)]


@dataclass(frozen=True)
class Row:
    """A comparison: difference None if nothing is stored."""

    group: str
    name: str
    value: Any
    allowed: float
    difference: float | None

    @property
    def good(self) -> bool:
        """Whether the answer is the stored one."""
        return self.difference is not None and self.difference <= self.allowed


def compared(name: str, stored: dict[str, Any]) -> Iterator[Row]:
    """Compare the answers of a group with the stored ones; also those that only one of both has."""
    found, known = answers_of(name), stored.get(name, {})
    for key in dict.fromkeys([*known, *found]):
        if key not in known or key not in found:
            yield Row(name, key, "missing" if key in known else "not stored", 0.0, None)
            continue
        row = known[key]
        yield Row(name, key, found[key].value, row["allowed"], found[key].difference(Answer(row["value"])))


def measured(name: str) -> dict[str, Any]:
    """Answers of a group with what each may differ by, as they are stored."""
    plain = answers_of(name)
    varied = {cause: answers_of(name, variation) for cause, variation in SMALL.items()}
    halved = answers_of(name, HALF_STEP) if any(a.coarse for a in plain.values()) else {}
    stored: dict[str, Any] = {}
    for key, answer in plain.items():
        changes = {cause: answer.difference(other[key]) for cause, other in varied.items()}
        if isinstance(answer.value, str):
            if any(changes.values()):
                raise ValueError(
                    f"{name}: {key} is {answer.value!r} and changes with {changes}; texts must not"
                )
            stored[key] = {"value": answer.value, "allowed": 0.0, "because": "equal"}
            continue
        scale = answer.scale or float(np.nanmax(np.abs(answer.array), initial=0.0)) or 1.0
        limits = {cause: SAFETY * change for cause, change in changes.items()} | {"floor": FLOOR * scale}
        if answer.coarse:
            limits["half step"] = max(COARSE * answer.difference(halved[key]), COARSE_FLOOR * scale)
        if answer.allowed is not None:
            limits = {"tolerance": answer.allowed}
        because = max(limits, key=lambda cause: limits[cause])
        allowed = float(f"{limits[because]:.3g}")
        if not np.isfinite(allowed):
            raise ValueError(f"{name}: shape or finiteness of {key} changes with {because}; it must not")
        stored[key] = {"value": answer.array.tolist(), "scale": scale, "allowed": allowed, "because": because}
    return stored


def read(path: Path = TABLE) -> dict[str, Any]:
    """The stored table: group, answer, value and what it may differ by."""
    return dict(json.loads(path.read_text())) if path.exists() else {}


def write(stored: dict[str, Any], path: Path = TABLE) -> None:
    """Store the table, an answer a line."""
    groups = []
    for name in sorted(stored):
        lines = [f"  {json.dumps(key)}: {json.dumps(row)}" for key, row in stored[name].items()]
        groups.append(f" {json.dumps(name)}: {{\n" + ",\n".join(lines) + "\n }")
    path.write_text("{\n" + ",\n".join(groups) + "\n}\n")
