"""Where kernels and finished runs are kept, and what becomes of them where nothing can be written."""

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path


def kept_in(name: str) -> Path | None:
    """A directory that can be written, for things of one kind.

    It lies below ANCTMM_CACHE or the user's cache directory, or, where that cannot be written, among the machine's
    temporary files; standard error then says so, once.

    Parameters
    ----------
    name : str
        Of the directory.

    Returns
    -------
    Path or None
        None where not even temporary files can be written: then nothing is kept.
    """
    reasons: list[str] = []
    for place in _places():
        reason = why_not_writable(place / name)
        if reason is None:
            if reasons:
                _once(f"{reasons[0]}; {place} is used instead (ANCTMM_CACHE may name another directory)")
            return place / name
        reasons.append(f"{place} cannot be written ({reason})")
    _once(f"{'; '.join(reasons)}: nothing is kept (ANCTMM_CACHE may name a directory that can be written)")
    return None


def why_not_writable(directory: Path) -> str | None:
    """Make a directory and try to write in it; the reason if that fails."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as error:
        return error.strerror or str(error)
    return None


def note(text: str) -> None:
    """Tell the user on standard error what is no failure but should be known."""
    sys.stderr.write(f"anctmm: {text}\n")


@lru_cache
def _once(text: str) -> None:
    note(text)


def _places() -> Iterator[Path]:
    base = os.environ.get("ANCTMM_CACHE") or os.environ.get("XDG_CACHE_HOME")
    if base:
        yield Path(base) / "anctmm"
    else:
        with suppress(RuntimeError):  # of a user without a home
            yield Path.home() / ".cache" / "anctmm"
    with suppress(FileNotFoundError):  # where there are no temporary files either
        yield Path(tempfile.gettempdir()) / f"anctmm-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
