"""Pictures and animations of a study; `studies.report` draws them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Picture:
    """A drawing with its name (of the file) and its caption."""

    name: str
    caption: str
    svg: str


@dataclass(frozen=True)
class Film:
    """A motion to be played.

    Parameters
    ----------
    name : str
        Of the scene.
    title, caption : str
    labels : tuple of str
        Of the layers: the motion itself, and others drawn behind it.
    t_end : float
        s.
    box : (int, int, int, int)
        Left, top, width and height in whole numbers, y downwards.
    supports : tuple of (str, int, int)
        "pin" or "clamp", and where.
    data : str
        JSON: for each layer and shape the numbers of all frames, see `encoded`.
    shapes : tuple of (str, str)
        Kind of each shape of all layers, such as "beam" or "spring", and its name; empty of what is no body.
    """

    name: str
    title: str
    caption: str
    labels: tuple[str, ...]
    t_end: float
    box: tuple[int, int, int, int]
    supports: tuple[tuple[str, int, int], ...]
    data: str
    shapes: tuple[tuple[str, str], ...] = ()
