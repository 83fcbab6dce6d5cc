"""Files of results: names, whole files, and whether a directory can be written."""

import hashlib
import os
import re
import tempfile
from pathlib import Path

from anctmm.errors import OutputError

#: Bytes of a text as a file's name at most: file systems take 255, and something stands before and behind it.
LONGEST = 150


def atomic_write(path: Path, content: str | bytes) -> None:
    """Write a file so that a reader sees the old one or the whole new one.

    Raises
    ------
    OutputError
        Naming the file and the reason, if it cannot be written; the old one is then still there.
    """
    data = content.encode(errors="backslashreplace") if isinstance(content, str) else content
    path = path.resolve()
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(data)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OutputError(
            f"file {str(path)!r} cannot be written ({error.strerror or error}); a directory that can be written "
            f"and has room for {len(data)} bytes is needed"
        ) from error


def file_name(text: str) -> str:
    """A text as the name of a file or directory: letters, digits and _ . + - of it, the others as -.

    Of one that is too long the beginning, with a few digits that differ from those of other texts.
    """
    name = re.sub(r"[^\w.+-]+", "-", text).strip(".-") or "unnamed"
    if len(name.encode()) <= LONGEST:
        return name
    digest = hashlib.sha256(text.encode(errors="backslashreplace")).hexdigest()[:8]
    return f"{name.encode()[: LONGEST - 9].decode(errors='ignore').rstrip('.-')}-{digest}"


def why_not_writable(directory: Path) -> str | None:
    """Make a directory and try to write in it; the reason if that fails."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as error:
        return error.strerror or str(error)
    return None


def check_writable(directory: Path) -> None:
    """Refuse a directory for results before any work.

    Raises
    ------
    OutputError
        If it cannot be made or written.
    """
    if reason := why_not_writable(directory):
        raise OutputError(
            f"--out is {str(directory)!r}, which cannot be written ({reason}); "
            f"a directory that can be written is needed"
        )


def store_directory() -> Path | None:
    """Directory of finished runs, below ANCTMM_CACHE or the user's cache; None where it cannot be written."""
    given = os.environ.get("ANCTMM_CACHE")
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "anctmm"
    runs = (Path(given) if given else user) / "runs"
    return None if why_not_writable(runs) else runs
