"""Files of results: names, whole files, and whether a directory can be written."""

import os
import re
import tempfile
from pathlib import Path

from anctmm.errors import OutputError

#: Bytes of a file name at most: file systems allow 255, and endings follow.
LONGEST = 150


def atomic_write(path: Path, content: str | bytes) -> None:
    """Write a file so that a reader sees the old one or the whole new one; OutputError if it cannot be written."""
    data = content.encode(errors="backslashreplace") if isinstance(content, str) else content
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(data)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        why = f"{error.strerror or error}; room for {len(data)} bytes is needed"
        raise OutputError(f"file {str(path)!r} cannot be written ({why})") from error


def file_name(text: str) -> str:
    """A text as the name of a file: letters, digits and _ . + - of it, the others as -; at most LONGEST."""
    name = re.sub(r"[^\w.+-]+", "-", text).encode()[:LONGEST].decode(errors="ignore")
    return name.strip(".-") or "unnamed"


def check_writable(directory: Path, option: str = "--out") -> None:
    """Make a directory for results; OutputError, before any work, if it cannot be written."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as error:
        why = f"{error.strerror or error}; another directory is needed"
        raise OutputError(f"{option} is {str(directory)!r}, which cannot be written ({why})") from error


def store_directory() -> Path | None:
    """Directory of finished runs, below ANCTMM_CACHE or the user's cache; None where it cannot be written."""
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "anctmm"
    runs = Path(os.environ.get("ANCTMM_CACHE") or user) / "runs"
    try:
        check_writable(runs)
    except OutputError:
        return None
    return runs
