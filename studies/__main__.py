"""Entry point of the commands: `anctmm`, or `python -m studies`."""

import atexit
import gc
import sys

#: New objects after which Python looks for garbage. Its usual 700 is met all the time while modules are loaded, and of
#: them nothing is garbage: that took a tenth of a second of each command.
YOUNG = 100_000


def main() -> None:
    """Run a command, or say how to install what commands need."""
    gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
    atexit.register(gc.freeze)  # what is there at the end goes with the process: another look took two tenths
    try:
        from studies.cli import main as commands
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in ("", "anctmm", "reference", "studies"):
            raise
        sys.exit(f"anctmm: the commands need {package}: pip install 'anctmm[studies]'")
    commands()


if __name__ == "__main__":
    main()
