"""End of a command: each kind has one exit code, and none is an uncaught exception."""

import os
import shutil
import sys
import textwrap
import traceback
from contextlib import suppress
from enum import IntEnum
from typing import Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup

from studies.command_line.streams import NARROWEST, discard, prepare

#: Set, and a fault of the program is shown with the place where it happened.
TRACEBACK = "ANCTMM_TRACEBACK"


class Code(IntEnum):
    """Exit codes."""

    DONE = 0
    DIFFERS = 1
    BAD_INPUT = 2
    FAULT = 3
    NOT_RUN = 4
    INTERRUPTED = 130
    CLOSED = 141


#: For the end of `anctmm --help`.
CODES = (
    "Exit codes: 0 success; 1 a history differs, a rule is violated, a target error is not reached, or a single "
    "run fails; 2 an option, a file or a directory cannot be used; 3 an internal error of anctmm "
    "(ANCTMM_TRACEBACK=1 shows where); "
    "4 nothing was compared, or not with each solver of `run`, because a solver is not installed; 130 interrupted; "
    "141 the output was closed early."
)


class BadOption(Exception):
    """An option's value cannot be used."""


class Command(TyperCommand):
    """A command whatever of which fails is one line, and an exit code; each option is given once."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments; of an option that is given twice, the first value would be lost in silence."""
        _, _, order = self.make_parser(ctx).parse_args(list(args))
        for option in order:
            if order.count(option) > 1 and option.param_type_name == "option":
                ctx.fail(f"{option.opts[0]} is given {order.count(option)} times; once is allowed")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run it."""
        try:
            return super().invoke(ctx)
        except typer.Exit:
            raise
        except (KeyboardInterrupt, SystemExit, Exception) as error:
            end_with(error)


class Commands(TyperGroup):
    """All commands. What is printed before one begins, such as its help, may fail as well."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Run a command; ends with an exit code."""
        prepare()
        try:
            super().main(*args, **options)
        except SystemExit as end:
            if closed(end):
                _end(Code.CLOSED)
            _flush(end.code)
            raise
        except Exception as error:
            end_with(error, done=True)


def end_with(error: BaseException, done: bool = False) -> NoReturn:
    """Say on standard error in one line what ended a command, and end it with its code.

    Parameters
    ----------
    error : exception
    done : bool
        Whether the command itself is over: then this ends the program.
    """
    code = code_of(error)
    if code is Code.CLOSED:
        _end(code)
    told = " ".join(str(error).split())
    match code:
        case Code.FAULT:
            traceback.print_exception(error) if os.environ.get(TRACEBACK) else None
            hint = f"{TRACEBACK}=1 shows where; please report it"
            told = f"internal error of anctmm: {type(error).__name__}: {told} ({hint})"
        case Code.INTERRUPTED:
            told = "interrupted"
        case _ if isinstance(error, SystemExit):
            told = f"code of a plug-in or of a scene called sys.exit({error.code!r}): nothing was done"
        case _:
            pass
    with suppress(OSError):
        typer.echo(on_terminal(f"anctmm: {told}"), err=True)
    if done:
        _end(code)
    raise typer.Exit(code)


def on_terminal(text: str) -> str:
    """A line as a terminal shows it: broken between words; elsewhere as it is, for programs that read it."""
    if sys.stderr is None or sys.stderr.closed or not sys.stderr.isatty():
        return text
    width = shutil.get_terminal_size().columns
    return textwrap.fill(text, max(width, NARROWEST), break_long_words=False, break_on_hyphens=False)


def code_of(error: BaseException) -> Code:
    """The exit code of what ended a command."""
    from anctmm.errors import AnctmmError

    if closed(error):
        return Code.CLOSED
    if isinstance(error, KeyboardInterrupt):
        return Code.INTERRUPTED
    if isinstance(error, AnctmmError | BadOption | OSError | SystemExit):
        return Code.BAD_INPUT
    return Code.FAULT


def closed(error: BaseException | None) -> bool:
    """Whether whoever read the output closed it; libraries end the program for that, with codes of their own."""
    while isinstance(error, SystemExit | typer.Exit):
        error = error.__context__
    return isinstance(error, BrokenPipeError)


def _end(code: Code) -> NoReturn:
    """End the program; what is still held back goes nowhere."""
    discard()
    sys.exit(code)


def _flush(code: Any) -> None:
    """Write what is still held back: what fails now would fail unseen, and with a code of its own, when Python ends."""
    try:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and not stream.closed:
                stream.flush()
    except OSError as error:
        if code and not closed(error):  # it was reported already
            _end(code)
        end_with(error, done=True)
