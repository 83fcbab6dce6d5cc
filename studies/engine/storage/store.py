"""Finished runs on disk: one file each, written atomically by one process at a time."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from anctmm.errors import OutputError
from anctmm.jit.files import cache_dir as storage
from anctmm.results.export.plain_data import NotPlain, decode, encode
from studies.engine.storage.files import atomic_write

MAGIC = b"anctmm run 3\n"


class Unreadable(Exception):
    """A file is no whole entry."""


@dataclass
class Claim:
    """The right to compute an entry, which no other process has meanwhile; `close` gives it back.

    Parameters
    ----------
    path : Path or None
        Of the entry; None where nothing is kept.
    lock : ExitStack
    """

    path: Path | None
    lock: ExitStack

    def close(self) -> None:
        """Let others compute it, or find it."""
        self.lock.close()


@dataclass
class Store:
    """Results of computations by their keys.

    A process that is killed leaves whole entries only, and its lock dies with it. Two processes that want one
    result compute it once: the second waits for the first.

    Parameters
    ----------
    directory : Path or None
        Where entries lie; None: nothing is kept.
    note : callable
        Told what a user should know: an entry that is not readable, a disk that is full.
    """

    directory: Path | None
    note: Callable[[str], None] = storage.note
    _said: set[str] = field(default_factory=set)

    def remember(self, key: str, compute: Callable[[], Any], given: Sequence[Any] = ()) -> Any:
        """The result kept under a key, or else the computed one, which is then kept.

        Parameters
        ----------
        key : str
            Tells this computation from every other.
        compute : callable
            What it raises is passed on, and nothing is kept.
        given : sequence
            Parts of the result that the caller has anyway and that need not be kept, such as its scene.
        """
        path = self._path(key)
        if path is None:
            return compute()
        try:
            return self._read(path, given)
        except (OSError, Unreadable):
            pass  # reported below, under the lock: another process may be at it
        with self._locked(path):
            try:
                return self._read(path, given)
            except FileNotFoundError:
                pass
            except (OSError, Unreadable) as error:
                self.note(f"finished run {path} is not readable ({error}); it is computed again")
            result = compute()
            self._write(path, result, given)
            return result

    def has(self, key: str) -> bool:
        """Whether a result is kept, and whole."""
        path = self._path(key)
        try:
            return path is not None and bool(_content(path))
        except (OSError, Unreadable):
            return False

    def claim(self, key: str) -> Claim | None:
        """The right to compute a result that `has` has not found; None while another process has it.

        Whoever has it looks again whether there is a result by now: `has`.
        """
        path, lock = self._path(key), ExitStack()
        if path is not None:
            try:
                lock.enter_context(self._locked(path, wait=False))
            except Timeout:
                return None
        return Claim(path, lock)

    def keep(self, key: str, content: bytes) -> bool:
        """Keep a result that is encoded already, under a claim; whether it could be kept."""
        path = self._path(key)
        return path is not None and self._write_bytes(path, content)

    def _path(self, key: str) -> Path | None:
        """Where the result of a key lies; None where nothing is kept, and for an empty key."""
        if self.directory is None or not key:
            return None
        return self.directory / f"{hashlib.sha256(key.encode()).hexdigest()}.run"

    @staticmethod
    def _read(path: Path, given: Sequence[Any]) -> Any:
        try:
            return decode(_content(path), given)
        except NotPlain as error:  # whole, but of a class that is no more
            raise Unreadable(str(error)) from error

    def _write(self, path: Path, result: Any, given: Sequence[Any]) -> None:
        try:
            data = encode(result, given)
        except NotPlain as error:
            self._once("result", f"a result cannot be stored ({error}); it is computed each time")
            return
        self._write_bytes(path, data)

    def _write_bytes(self, path: Path, data: bytes) -> bool:
        try:
            atomic_write(path, MAGIC + hashlib.sha256(data).digest() + data)
        except OutputError as error:
            self._once("room", f"finished runs cannot be stored: {error}; the sweep continues without")
            return False
        return True

    @contextmanager
    def _locked(self, path: Path, wait: bool = True) -> Iterator[None]:
        """Hold a result's lock; where none can be had, two processes may compute it, each for itself.

        Without `wait` a lock that another process has is a Timeout.
        """
        lock = FileLock(path.with_suffix(".lock"))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                lock.acquire(timeout=0)
            except Timeout:
                if not wait:
                    raise
                self._once(
                    "wait", "another session is computing a run that is needed here; waiting for its result"
                )
                lock.acquire()
        except Timeout:
            raise
        except (OSError, NotImplementedError) as error:
            self._once(
                "lock",
                f"finished runs cannot be locked in {path.parent} ({error}); two sessions may repeat runs",
            )
            yield
            return
        try:
            for orphan in path.parent.glob(f".{path.name}.*"):  # of a process killed while it wrote
                orphan.unlink(missing_ok=True)
            yield
            if path.exists():
                # no lock is needed now: a session that waits for it looks for the result first
                with suppress(OSError):
                    path.with_suffix(".lock").unlink()
        finally:
            lock.release()

    def _once(self, about: str, text: str) -> None:
        """Note what is true of many runs, once."""
        if about not in self._said:
            self._said.add(about)
            self.note(text)


def _content(path: Path) -> bytes:
    """What a whole entry holds."""
    content = path.read_bytes()
    digest, data = content[len(MAGIC) : len(MAGIC) + 32], content[len(MAGIC) + 32 :]
    if not content.startswith(MAGIC) or hashlib.sha256(data).digest() != digest:
        raise Unreadable("truncated, or written by another version")
    return data
