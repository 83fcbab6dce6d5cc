"""Compiled kernels on disk: a file for each kernel, signature and version of its code, with a checksum.

A file is written atomically, and replaced only by one that contains more: machine code in addition to the code that
callers link. Processes that run at the same time therefore read it without a lock. Kernels that have not been used for
long, and all but the last few versions of a kernel, are removed when new kernels are stored.
"""

import hashlib
import os
import pickle
import platform
import re
import shutil
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import config, sigutils
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.registry import cpu_target
from numba.core.serialize import dumps

from anctmm.jit.compiler.addresses import find, names_of, needed_in
from anctmm.jit.compiler.kernels import restored_callee
from anctmm.jit.compiler.second_process import about_to_compile, waited
from anctmm.jit.files.cache_dir import kept_in, note
from anctmm.jit.files.code_digest import code_digest, signature_text
from anctmm.jit.files.one_compiler import LOCK, alone

#: Of all layouts of these files, and of this one.
KIND, MAGIC = b"anctmm kernel ", b"anctmm kernel 3\n"
#: Directories of an earlier layout, one for each version of all sources, beside that of the files.
EARLIER = re.compile(r"kernels(-[0-9a-f]+)+")
#: Of a file, and of one that is being written.
ENDING, UNFINISHED = ".kernel", ".part"
#: Versions of a kernel's code that are kept for each signature: those of several branches of work.
VERSIONS = 4
#: Days after which a kernel that was not used is removed, and bytes that all may take.
DAYS, ROOM = 60.0, 1 << 30
_DAY = 86_400.0


class KernelFiles(_Cache):  # type: ignore[misc]
    """The files of one kernel, in the form that numba's dispatcher asks for; nothing that fails here ends a run.

    Parameters
    ----------
    function : callable
        Not compiled.
    options : mapping
        Of its compilation.
    """

    def __init__(self, function: Callable[..., Any], options: Mapping[str, Any]) -> None:
        self._function = function
        self._options = str(sorted((name, str(value)) for name, value in options.items()))
        self._name = f"{function.__module__}.{function.__qualname__}".replace("<", "").replace(">", "")
        self._enabled = True

    @property
    def cache_path(self) -> str | None:
        """Where the files lie; None where nothing is kept."""
        place = directory()
        return None if place is None else str(place)

    def enable(self) -> None:
        """Read and write files."""
        self._enabled = True

    def disable(self) -> None:
        """Neither read nor write files."""
        self._enabled = False

    def flush(self) -> None:
        """Remove all files of this kernel."""
        place = directory()
        for path in () if place is None else place.glob(f"{self._name}-*{ENDING}"):
            with suppress(OSError):
                path.unlink()

    @contextmanager
    def alone(self, types: tuple[Any, ...]) -> Iterator[None]:
        """In the context no other process compiles this kernel for these types."""
        path = self.file_of(types)
        if path is None or not path.exists():
            about_to_compile()  # before the file is locked: another kernel may come first
        with alone(path, waited):
            yield

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Machine code of a signature, or None: not there, or not readable."""
        path = self._path(signature, target_context.codegen())
        if path is None:
            return None
        try:
            target_context.refresh()
            content = path.read_bytes()
            of_another_layout = content.startswith(KIND) and not content.startswith(MAGIC)
            if of_another_layout:  # it is replaced
                return None
            payload = _payload(content)
            needed, *parts = pickle.loads(payload)
            restore = CompileResult._rebuild if parts[0][1] == "object" else restored_callee
            names = names_of(needed)
            if restore is not restored_callee:
                find(names)
            found = restore(target_context, *parts)
        except FileNotFoundError:
            return None
        except Exception as error:  # whatever a file of another make may raise
            note(f"the stored kernel {self._name} is not readable ({error!r}); it is compiled again")
            with suppress(OSError):
                path.unlink()
            return None
        _used(path)
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep machine code, if the disk has room."""
        path = self._path(signature, data.codegen)
        if (
            path is None
            or any(not part.can_cache for part in data.lifted)
            or data.library.has_dynamic_globals
        ):
            return
        payload = dumps((needed_in(data.library._final_module), *data._reduce()))
        try:
            write_whole(path, MAGIC + hashlib.sha256(payload).digest() + payload)
            remove_unused(path.parent)
            remove_earlier(path.parent.parent)
        except OSError as error:
            _not_kept(error.strerror or str(error), str(path.parent))

    def file_of(self, types: tuple[Any, ...]) -> Path | None:
        """The file of a signature's types for this machine; None where nothing is kept."""
        return self._path(types, cpu_target.target_context.codegen())

    def _path(self, signature: Any, codegen: Any) -> Path | None:
        """The file of a signature for this machine."""
        place = directory() if self._enabled else None
        if place is None:
            return None
        arguments, _ = sigutils.normalize_signature(signature)
        kind = _hash(f"{signature_text(arguments)}\n{codegen.magic_tuple()}\n{_environment()}")
        code = _hash(f"{code_digest(self._function)}\n{self._options}")
        return place / f"{self._name}-{kind[:16]}-{code[:32]}{ENDING}"


@lru_cache
def directory() -> Path | None:
    """Where compiled kernels are kept; None where nothing can be."""
    return kept_in("kernels")


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that other processes see whole or not at all."""
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=UNFINISHED)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(name, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(name)
        raise


def remove_unused(place: Path, now: float | None = None) -> None:
    """Remove kernels of old versions, those not used for long, and the longest unused while all take too much room.

    A process that reads a file meanwhile reads it to its end, or finds that it is gone and compiles.

    Parameters
    ----------
    place : Path
    now : float, optional
        Time, s, instead of the present one.
    """
    now = time.time() if now is None else now
    found = []
    for entry in os.scandir(place):
        with suppress(OSError):  # removed by another process
            state = entry.stat(follow_symlinks=False)
            if entry.name.endswith((UNFINISHED, LOCK)) and now - state.st_mtime > _DAY:
                os.unlink(entry.path)
            elif entry.name.endswith(ENDING):
                found.append((state.st_mtime, state.st_size, entry.path))
    seen: dict[str, int] = defaultdict(int)
    room = 0
    for last, size, path in sorted(found, reverse=True):
        kind = path.rpartition("-")[0]
        seen[kind] += 1
        if seen[kind] > VERSIONS or now - last > DAYS * _DAY or room + size > ROOM:
            with suppress(OSError):
                os.unlink(path)
        else:
            room += size


@lru_cache
def remove_earlier(place: Path) -> None:
    """Remove directories of an earlier layout that nobody has written into for a day; looked for once.

    Parameters
    ----------
    place : Path
        Where they lie, beside that of the kernels.
    """
    for entry in os.scandir(place):
        if EARLIER.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False):
            with suppress(OSError):  # removed by another process
                if time.time() - entry.stat(follow_symlinks=False).st_mtime > _DAY:
                    shutil.rmtree(entry.path, ignore_errors=True)


def _payload(content: bytes) -> bytes:
    """What a file holds, if its checksum is right."""
    begin = len(MAGIC) + hashlib.sha256().digest_size
    if (
        not content.startswith(MAGIC)
        or hashlib.sha256(content[begin:]).digest() != content[len(MAGIC) : begin]
    ):
        raise ValueError("its checksum is wrong")
    return content[begin:]


def _used(path: Path) -> None:
    """Mark a file as used, once a day."""
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > _DAY:
            os.utime(path)


@lru_cache
def _not_kept(reason: str, path: str) -> None:
    """Say once why kernels are not kept."""
    note(f"compiled kernels cannot be stored in {path} ({reason}); the next run compiles them again")


@lru_cache
def _environment() -> str:
    """What machine code depends on beside its source: versions and the compiler's settings."""
    versions = (platform.python_implementation(), platform.python_version(), numba.__version__)
    settings: Any = config
    chosen = (settings.OPT, settings.LOOP_VECTORIZE, settings.SLP_VECTORIZE, settings.BOUNDSCHECK)
    return f"{versions} {llvmlite.__version__} {np.__version__} {chosen}"


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
