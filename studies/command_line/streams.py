"""Standard output and error: any encoding, any width, open or closed."""

import codecs
import os
import sys
from contextlib import suppress

#: What stands for characters that an encoding may lack, in numbers and units above all.
SUBSTITUTES = {
    "Δ": "D", "ψ": "psi", "φ": "phi", "ω": "omega", "Ω": "Omega", "ρ": "rho", "ν": "nu", "λ": "lambda", "τ": "tau",
    "π": "pi", "µ": "u", "μ": "u", "·": ".", "•": "*", "×": "x", "±": "+-", "−": "-", "–": "-", "—": "-", "…": "...",
    "→": "->", "≤": "<=", "≥": ">=", "≈": "~", "²": "^2", "³": "^3", "½": "1/2", "√": "sqrt",
    "“": '"', "”": '"', "’": "'",
}  # fmt: skip
#: Fewest and most columns that tables are fitted to: of fewer nothing could be read.
NARROWEST, WIDEST = 40, 1000
ERRORS = "anctmm.substitute"


def substitute(error: UnicodeError) -> tuple[str, int]:
    """What is written for characters that an encoding lacks: a likeness, or a question mark."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    missing = error.object[error.start : error.end]
    return "".join(SUBSTITUTES.get(c, "?") for c in missing), error.end


def prepare() -> None:
    """Make output possible whatever the environment: its encoding, its width, its choice of windows for pictures."""
    codecs.register_error(ERRORS, substitute)
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and hasattr(stream, "reconfigure"):
            with suppress(ValueError):  # one that is closed
                stream.reconfigure(errors=ERRORS)
    os.environ["MPLBACKEND"] = "agg"  # pictures are files
    for name in ("COLUMNS", "TERMINAL_WIDTH"):
        given = os.environ.get(name)
        if given is not None:
            width = int(given) if given.isdecimal() and len(given) < 10 else 80
            os.environ[name] = str(min(max(width, NARROWEST), WIDEST))


def discard() -> None:
    """Discard the remaining output: its reader has closed it."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):  # closed, or no file
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
