"""Files that appear whole or not at all."""

import os
import tempfile
from pathlib import Path

from anctmm.errors import OutputError
from anctmm.jit.cache_dir import why_not_writable


def atomic_write(path: Path, content: str | bytes) -> None:
    """Write a file so that a reader sees the old one or the whole new one, whenever this process dies.

    Raises
    ------
    OutputError
        Naming the file and the reason, if it cannot be written; the old one is then still there.
    """
    data = content.encode() if isinstance(content, str) else content
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
