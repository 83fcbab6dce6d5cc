"""Files of results: names, whole files, and whether a directory can be written."""

import hashlib
import os
import re
import tempfile
from collections.abc import Iterable
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
    path = path.resolve() if path.is_symlink() else path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            os.chmod(temporary, 0o644)  # mkstemp makes it private
            os.replace(temporary, path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OSError as error:
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


def file_names(scenes: Iterable[str]) -> list[str]:
    """Names of files of several scenes.

    Raises
    ------
    OutputError
        If two have one: one's files would be written over those of the other.
    """
    found: dict[str, str] = {}
    for scene in scenes:
        other = found.setdefault(file_name(scene), scene)
        if other != scene:
            raise OutputError(
                f"files of scenes {other!r} and {scene!r} would both be named {file_name(scene)!r}; names that differ "
                f"in letters, digits or _ . + - are needed"
            )
    return list(found)


def why_not_writable(directory: Path) -> str | None:
    """Make a directory and try to write in it; the reason if that fails."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as error:
        return error.strerror or str(error)
    return None


def check_writable(directory: Path, option: str = "--out") -> None:
    """Refuse a directory for results before any work.

    Raises
    ------
    OutputError
        If it cannot be made or written.
    """
    if reason := why_not_writable(directory):
        raise OutputError(
            f"{option} is {str(directory)!r}, which cannot be written ({reason}); "
            f"a directory that can be written is needed"
        )


def store_directory() -> Path | None:
    """Directory of finished runs, below ANCTMM_CACHE or the user's cache; None where it cannot be written."""
    given = os.environ.get("ANCTMM_CACHE")
    base = (
        Path(given) if given else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "anctmm"
    )
    return None if why_not_writable(base / "runs") else base / "runs"
