"""End of a command: each kind has one exit code, and none is an uncaught exception."""

import os
import sys
import traceback
from enum import IntEnum
from typing import Any, NoReturn

import typer
from typer.core import TyperCommand

from anctmm.errors import AnctmmError

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
    "Exit codes: 0 success; 1 a history differs, a rule is violated, a target error is not reached, a single run "
    "fails, or all runs of a study are refused or fail; 2 an option, a file or a directory cannot be used; 3 an "
    "internal error of anctmm (ANCTMM_TRACEBACK=1 shows where); 4 nothing was compared, or not with each solver of "
    "`run`, because a solver is not installed; 130 interrupted; 141 the output was closed early."
)


class BadOption(Exception):
    """An option cannot be used beside another one."""


class Command(TyperCommand):
    """A command whose failures are one line and an exit code; each option is given once."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments; of an option that is given twice, the first value would be lost in silence."""
        _, _, order = self.make_parser(ctx).parse_args(list(args))
        for option in order:
            if order.count(option) > 1 and option.param_type_name == "option":
                ctx.fail(f"{option.opts[0]} is given {order.count(option)} times; once is allowed")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> None:
        """Run it, and end with the code that it returns."""
        try:
            code = super().invoke(ctx)
            sys.stdout.flush()
        except typer.Exit:
            raise
        except (KeyboardInterrupt, SystemExit, Exception) as error:
            end_with(error)
        raise typer.Exit(code or Code.DONE)


def end_with(error: BaseException) -> NoReturn:
    """Print on standard error in one line why a command ends, and end it with its code."""
    code, text = code_of(error), " ".join(str(error).split())
    if code is Code.CLOSED:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # else Python fails once more when it flushes
        raise typer.Exit(code)
    if code is Code.FAULT:
        if os.environ.get(TRACEBACK):
            traceback.print_exception(error)
        text = f"internal error of anctmm: {type(error).__name__}: {text} ({TRACEBACK}=1 shows where)"
    elif isinstance(error, SystemExit):
        text = f"code of a plug-in or of a scene called sys.exit({error.code!r}): nothing was done"
    typer.echo(f"anctmm: {text or 'interrupted'}", err=True)
    raise typer.Exit(code)


def code_of(error: BaseException) -> Code:
    """The exit code of an exception that ends a command."""
    # rich exits where its output is closed
    closed = error.__context__ if isinstance(error, SystemExit) else error
    if isinstance(closed, BrokenPipeError):
        return Code.CLOSED
    if isinstance(error, KeyboardInterrupt):
        return Code.INTERRUPTED
    bad = isinstance(error, AnctmmError | BadOption | OSError | SystemExit)
    return Code.BAD_INPUT if bad else Code.FAULT
