"""Files that are written atomically."""

import hashlib
import os
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path

from anctmm.errors import OutputError
from anctmm.jit.files.cache_dir import why_not_writable

#: File of the checksums of a directory's files.
CHECKSUMS = "SHA256SUMS"
#: Bytes of a text as a file's name at most: file systems take 255, and something stands before and behind it.
LONGEST = 150


def atomic_write(path: Path, content: str | bytes) -> None:
    """Write a file so that a reader sees the old one or the whole new one, whenever this process dies.

    Raises
    ------
    OutputError
        Naming the file and the reason, if it cannot be written; the old one is then still there.
    """
    # a path that is no UTF-8 may stand in a message
    data = content.encode(errors="backslashreplace") if isinstance(content, str) else content
    path = path.resolve() if path.is_symlink() else path  # what a link refers to is the file
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

    Of one that is too long the beginning, and a few digits that tell it from others that begin so.
    """
    name = re.sub(r"[^\w.+-]+", "-", text).strip(".-") or "unnamed"
    if len(name.encode()) <= LONGEST:
        return name
    told = hashlib.sha256(text.encode(errors="backslashreplace")).hexdigest()[:8]
    return f"{name.encode()[: LONGEST - 9].decode(errors='ignore').rstrip('.-')}-{told}"


def file_names(scenes: Iterable[str]) -> list[str]:
    """Names of files of several scenes.

    Raises
    ------
    OutputError
        If two have one: one's pictures would be written over those of the other.
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


def write_checksums(folder: Path, names: Iterable[str]) -> None:
    """Write the checksums of files of a directory beside them, in the form that `sha256sum --check` reads."""
    lines = [f"{_digest(folder / name)}  {name}\n" for name in names]
    atomic_write(folder / CHECKSUMS, "".join(lines))


def check_checksum(path: Path) -> str:
    """What is wrong with a file by the checksum that stands beside it; nothing if it is the one that was written."""
    try:
        lines = (path.parent / CHECKSUMS).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        return f"its checksum in {CHECKSUMS} cannot be read: {getattr(error, 'strerror', None) or error}"
    known = {name: digest for digest, _, name in (line.partition("  ") for line in lines)}
    if path.name not in known:
        return f"{CHECKSUMS} has no checksum of it"
    return (
        ""
        if known[path.name] == _digest(path)
        else f"it is not the file that {CHECKSUMS} names: cut or edited"
    )


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def check_writable(directory: Path, option: str = "--out") -> None:
    """Refuse a directory for results before an hour of work, not after.

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
