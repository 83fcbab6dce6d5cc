"""The directory of kernels and finished runs, and alternatives if it is not writable.

Nothing is read from a directory that another user could have written to: in the temporary directory of a machine, where
names can be guessed, a directory is used only if it belongs to the user, is closed to all others, and is no link.
"""

import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

#: Permissions of a directory among the temporary files: for its owner only.
PRIVATE = 0o700


def kept_in(name: str) -> Path | None:
    """A directory that can be written, for things of one kind.

    It lies below ANCTMM_CACHE or the user's cache directory, or, where that cannot be written, in a directory of the
    user's own among the machine's temporary files; standard error then says so, once.

    Parameters
    ----------
    name : str
        Of the directory.

    Returns
    -------
    Path or None
        None where not even temporary files can be written, or where their directory may be another user's: then
        nothing is kept.
    """
    reasons: list[str] = []
    for place, shared in _places():
        reason = (shared and why_not_own(place)) or why_not_writable(place / name)
        if not reason:
            if reasons:
                _once(f"{reasons[0]}; {place} is used instead (ANCTMM_CACHE may name another directory)")
            return place / name
        reasons.append(f"{place} cannot be {'trusted' if shared else 'written'} ({reason})")
    _once(
        f"{'; '.join(reasons)}: compiled kernels are not stored (ANCTMM_CACHE may name a directory that can be written)"
    )
    return None


def why_not_writable(directory: Path) -> str | None:
    """Make a directory and try to write in it; the reason if that fails."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as error:
        return error.strerror or str(error)
    return None


def why_not_own(directory: Path) -> str | None:
    """Make a directory that nobody else can enter; the reason if it is another's, open to others, or a link."""
    try:
        with suppress(FileExistsError):
            directory.mkdir(mode=PRIVATE, parents=True)
        found = os.lstat(directory)
    except OSError as error:
        return error.strerror or str(error)
    if stat.S_ISLNK(found.st_mode):
        return "it is a link"
    if not stat.S_ISDIR(found.st_mode):
        return "it is no directory"
    if not hasattr(os, "getuid"):  # where temporary files are the user's own
        return None
    if found.st_uid != os.getuid():
        return "it belongs to another user"
    if found.st_mode & 0o077:
        return f"it is open to other users, with mode {stat.S_IMODE(found.st_mode):o} and not {PRIVATE:o}"
    return None


def note(text: str) -> None:
    """Tell the user on standard error what is no failure but should be known."""
    sys.stderr.write(f"anctmm: {text}\n")


@lru_cache
def _once(text: str) -> None:
    note(text)


def _places() -> Iterator[tuple[Path, bool]]:
    """Directories in the order of preference, and whether other users may write where each one lies."""
    base = os.environ.get("ANCTMM_CACHE") or os.environ.get("XDG_CACHE_HOME")
    if base:
        yield Path(base) / "anctmm", False
    else:
        with suppress(RuntimeError):  # of a user without a home
            yield Path.home() / ".cache" / "anctmm", False
    with suppress(FileNotFoundError):  # where there are no temporary files either
        yield Path(tempfile.gettempdir()) / f"anctmm-{os.getuid() if hasattr(os, 'getuid') else 'user'}", True
