"""Content of the gallery for a scene: how it is run, what is drawn, and a known number."""

import runpy
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from anctmm.model.case import Case

FOLDER = Path(__file__).parent
SCENES, PICTURES = FOLDER / "scenes", FOLDER / "pictures"


@dataclass(frozen=True)
class Script:
    """A file of the gallery.

    Parameters
    ----------
    name : str
        Of the file, without ".py".
    """

    name: str

    @property
    def path(self) -> Path:
        """The file."""
        return SCENES / f"{self.name}.py"

    @property
    def digest(self) -> str:
        """SHA-256 of what it holds: a picture keeps that of the file that it was made of."""
        return sha256(self.path.read_bytes()).hexdigest()

    @cached_property
    def names(self) -> Mapping[str, Any]:
        """Whatever it defines."""
        return runpy.run_path(str(self.path))

    @property
    def case(self) -> Case:
        """The one case of its CASES."""
        (case,) = self.names["CASES"]
        return case  # type: ignore[no-any-return]

    def __getitem__(self, name: str) -> Any:
        """What it gives a name to."""
        return self.names[name]


@dataclass(frozen=True)
class Number:
    """A number of a scene that is known.

    Parameters
    ----------
    what, unit : str
    found : float
    known : float
    tolerance : float
        By which they may differ, in the number's unit.
    source : str
        Where the known one is from.
    """

    what: str
    unit: str
    found: float
    known: float
    tolerance: float
    source: str

    @property
    def met(self) -> bool:
        """Whether they agree."""
        return abs(self.found - self.known) <= self.tolerance


@dataclass(frozen=True)
class Entry:
    """A scene of the gallery.

    Parameters
    ----------
    name : str
        Of its file.
    title, text : str
        What it is, and what is to be seen.
    solve : callable
        Script → what was found: a solution, or several.
    number : callable
        (script, what was found) → the number that is known.
    draw : callable
        (figure, script, what was found).
    height : float
        Of the picture, inch.
    """

    name: str
    title: str
    text: str
    solve: Callable[[Script], Any]
    number: Callable[[Script, Any], Number]
    draw: Callable[[Figure, Script, Any], None]
    height: float = 3.4

    @property
    def picture(self) -> Path:
        """Its file."""
        return PICTURES / f"{self.name}.svg"
