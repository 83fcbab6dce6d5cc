"""Pictures of a study; `studies.report.plots` draws them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Picture:
    """A drawing with its name (of the file) and its caption."""

    name: str
    caption: str
    svg: str
