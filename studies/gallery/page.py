"""The gallery's page and pictures."""

from collections.abc import Iterator
from typing import Any

from studies.engine.storage.files import atomic_write
from studies.gallery.entry import FOLDER, PICTURES, Entry, Number, Script
from studies.gallery.equilibria import EQUILIBRIA
from studies.gallery.motions import MOTIONS
from studies.report.plots import picture, write_picture

ENTRIES: tuple[Entry, ...] = (*MOTIONS, *EQUILIBRIA)
#: Width of all pictures, inch.
WIDTH = 5.8
PAGE = FOLDER / "README.md"
HEAD = """# Gallery

A dozen scenes, each a file of at most 25 lines, with its result and a value that is known independently.
The tests run them all (`tests/of_studies/questions/test_gallery.py`). Each file is a case:
`anctmm run studies/gallery/scenes/bridge.py` runs it, and the [studies](../README.md#commands) accept it, too.

`python -m studies.gallery` writes this page and its pictures, with the settings in `motions.py` and `equilibria.py`.
A new scene needs a file in `scenes/` and an entry in one of these.
"""


def write(tell: Any = print) -> None:
    """Run all scenes; write the pictures and the page."""
    parts = [HEAD]
    for entry in ENTRIES:
        script = Script(entry.name)
        found = entry.solve(script)
        write_picture(drawn(entry, script, found), PICTURES)
        parts.append(section(entry, entry.number(script, found)))
        tell(entry.name)
    atomic_write(PAGE, "\n".join(parts))


def drawn(entry: Entry, script: Script, found: Any) -> Any:
    """The picture of a scene; it keeps the digest of its file."""
    return picture(
        entry.name, entry.title, lambda figure: entry.draw(figure, script, found), (WIDTH, entry.height),
        alone=True, source=script.digest,
    )  # fmt: skip


def section(entry: Entry, number: Number) -> str:
    """What the page says of a scene."""
    return "\n".join(_lines(entry, number))


def _lines(entry: Entry, number: Number) -> Iterator[str]:
    unit = f" {number.unit}" if number.unit else ""
    yield f"## {entry.title}"
    yield ""
    yield f"{entry.text} ([`{entry.name}.py`](scenes/{entry.name}.py))"
    yield ""
    yield f"![{entry.title}](pictures/{entry.name}.svg)"
    yield ""
    found, known = (f"{written(value, number)}{unit}" for value in (number.found, number.known))
    yield f"{number.what[0].upper()}{number.what[1:]}: {found}; known: {known} ({number.source})."
    yield ""


def written(value: float, number: Number) -> str:
    """With the digits that the tolerance leaves, and one more; a known zero as it is."""
    if number.known == 0.0:
        return f"{value:.0e}".replace("e-0", "e-") if value else "0"
    digits = max(0, -int(f"{number.tolerance:e}".partition("e")[2]) + 1)
    return f"{value:.{digits}f}".replace("-", "−")
