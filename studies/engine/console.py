"""Text and tables on a terminal, by rich."""

from rich.console import Console
from rich.table import Table
from rich.text import Text


def say(console: Console, text: str, style: str = "", end: str = "\n") -> None:
    """Print a sentence as it is: brackets mean nothing; in a pipe or a file it is one line."""
    console.print(Text(text, style), highlight=False, soft_wrap=not console.is_terminal, end=end)


def show_table(console: Console, table: Table) -> None:
    """Print a table; in a pipe or a file with all of its columns, however wide."""
    if not console.is_terminal:
        console.width = max(console.width, 200)
    console.print(table)
