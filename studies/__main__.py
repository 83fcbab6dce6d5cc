"""Entry point of the commands: `anctmm`, or `python -m studies`."""

import sys


def main() -> None:
    """Run a command, or say how to install what commands need."""
    try:
        from studies.cli import app
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in ("", "anctmm", "reference", "studies"):
            raise
        sys.exit(f"anctmm: the commands need {package}: pip install 'anctmm[studies]'")
    app()


if __name__ == "__main__":
    main()
