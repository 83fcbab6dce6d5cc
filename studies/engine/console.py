"""Text and tables on a terminal of any width: lines are broken between words only."""

import os
import textwrap

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text


def say(console: Console, text: str, style: str = "", end: str = "\n") -> None:
    """Print a sentence: broken at the terminal's width, in a pipe or a file a line as it is.

    Parameters
    ----------
    console : Console
    text : str
        As it is: brackets mean nothing.
    style : str
    end : str
    """
    for line in text.split("\n"):
        shown = broken(line, console.width) if breaks(console) else line
        console.print(Text(shown, style), highlight=False, soft_wrap=True, end=end)


def breaks(console: Console) -> bool:
    """Whether lines have a width: on a terminal, or where the environment states one."""
    return console.is_terminal or "COLUMNS" in os.environ


def broken(text: str, width: int) -> str:
    """A line as lines that fit a width, broken at blanks; the blanks it begins with begin each."""
    indent = " " * (len(text) - len(text.lstrip(" ")))
    return textwrap.fill(
        text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def show_table(console: Console, table: Table) -> None:
    """Print a table; where its words do not fit beside each other, a row becomes lines of its own.

    Parameters
    ----------
    console : Console
    table : Table
        Of cells that are texts, with columns that have heads.
    """
    widths = fitted(table, console.width)
    if widths:
        for column, width in zip(table.columns, widths, strict=True):
            column.width = width  # rich would make columns narrower than their words
        console.print(table)
        return
    if table.title:
        console.print(Text.from_markup(str(table.title), style="bold"), highlight=False)
    heads = [plain(column.header) for column in table.columns]
    for cells in zip(*(column.cells for column in table.columns), strict=True):
        first, *others = map(plain, cells)
        say(console, first or "-", "bold")
        for head, cell in zip(heads[1:], others, strict=True):
            if cell:
                line = f"  {head}: {cell}" if head else f"  {cell}"
                console.print(Text(broken(line, console.width)), highlight=False, soft_wrap=True)


def fitted(table: Table, width: int) -> list[int]:
    """Widths of columns that break no word; nothing where a terminal is too narrow for them.

    What is left beyond the longest words goes first to the columns that need the least more.
    """
    lines = [
        [line for c in (column.header, *column.cells) for line in plain(c).splitlines()]
        for column in table.columns
    ]
    wanted = [max(map(cell_len, those), default=1) for those in lines]
    found = [
        want
        if column.no_wrap
        else max((cell_len(word) for line in those for word in line.split()), default=1)
        for column, those, want in zip(table.columns, lines, wanted, strict=True)
    ]
    room = width - sum(found) - sum(table.padding[1::2]) * len(found)
    if room < 0:
        return []
    order = sorted(range(len(found)), key=lambda k: wanted[k] - found[k])
    for place, k in enumerate(order):
        more = min(wanted[k] - found[k], room // (len(order) - place))
        found[k], room = found[k] + more, room - more
    return found


def plain(cell: object) -> str:
    """A cell's text without its marks."""
    return cell.plain if isinstance(cell, Text) else Text.from_markup(str(cell)).plain
