"""Types of options. An option that cannot be parsed is named with its value and what is allowed."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import typer

#: Units of a duration, s.
UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0}
MESHES = "whole numbers from 1 on for each beam, or for all, such as 2/8/2 or 8"
NUMBERS = "positive numbers such as 1e-3"


def parser(read: Callable[[str], Any], allowed: str) -> Callable[[str], Any]:
    """A parser of one value; `read` raises ValueError where it cannot."""

    def parse(text: str) -> Any:
        try:
            return read(text.strip())
        except ValueError:
            raise typer.BadParameter(f"{text!r}; allowed are {allowed}") from None

    return parse


def listed(read: Callable[[str], Any], allowed: str) -> Callable[[str], Any]:
    """A parser of several values between commas, each once."""
    return parser(
        lambda text: tuple(dict.fromkeys(read(item.strip()) for item in text.split(","))),
        f"{allowed}, or several of these with commas between them",
    )


def named(names: Callable[[], Iterable[str]], several: bool = False) -> Callable[[str], Any]:
    """A parser of a name, which looks the names up when it is used, or of several."""

    def parse(text: str) -> Any:
        allowed = sorted(names())

        def read(item: str) -> str:
            if item not in allowed:
                raise ValueError
            return item

        return (listed if several else parser)(read, ", ".join(allowed))(text)

    return parse


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
    """A text that is not empty."""
    if not text:
        raise ValueError
    return text


def path(given: str | Path) -> Path:
    """A path as typed, or a default; an empty one, as where a variable of the shell is not set, is refused."""
    text = str(given)
    if not text.strip() or "\0" in text:
        raise typer.BadParameter(f"{text!r} is an empty path, or one with a null character; a path is needed")
    return Path(text)


def solvers() -> list[str]:
    """Names of solvers."""
    from anctmm.solvers import registry

    return registry.names()


def element_names() -> list[str]:
    """Names of elements."""
    from anctmm.elements.kinds import KINDS

    return list(KINDS)


def integrator_names() -> list[str]:
    """Names of integrators."""
    from anctmm.discretise.discretisation import INTEGRATORS

    return list(INTEGRATORS)
