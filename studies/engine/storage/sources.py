"""The source code that a computation depends on: its module and all that this imports, as a hash.

A stored result belongs to the code that computed it. The imports of a module are read from its text, without importing
it, and followed through our own packages, the package of the module, and everything outside the directories of
installed packages; for installed packages the version represents the source.
"""

import ast
import hashlib
import sys
import sysconfig
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

OURS = frozenset({"anctmm", "reference", "studies"})
#: Directories of packages that pip installs.
INSTALLED = tuple(Path(sysconfig.get_path(name)).resolve() for name in ("purelib", "platlib"))


@dataclass(frozen=True)
class File:
    """A module's file: its hash, and the names it imports."""

    digest: str
    imports: tuple[str, ...]


@dataclass
class Sources:
    """Hashes of source, each file read once: edits made while a program runs are not the code that runs.

    Our own files are read once for all, those of others once for each object of this class.
    """

    _files: dict[str, File | None] = field(default_factory=dict)
    _digests: dict[tuple[str, ...], str | None] = field(default_factory=dict)

    def of(self, compute: Callable[..., Any]) -> str | None:
        """Hash of the source a function is made of; None if it has none that can be found."""
        return self.digest(module_of(compute))

    def digest(self, *modules: str) -> str | None:
        """Hash of modules and of all that they import.

        Parameters
        ----------
        *modules : str
            Full names.

        Returns
        -------
        str or None
            64 hexadecimal digits; None if the source of one of the modules cannot be found.
        """
        asked = tuple(sorted(set(modules)))
        if asked not in self._digests:
            self._digests[asked] = self._digest(asked)
        return self._digests[asked]

    def modules(self, *modules: str) -> dict[str, str]:
        """Names of the modules that are followed, with their files' hashes; of others their version."""
        roots = {name.partition(".")[0] for name in modules}
        found: dict[str, str] = {}
        waiting = list(modules)
        while waiting:
            name = waiting.pop()
            top = name.partition(".")[0]
            if name in found or top in sys.stdlib_module_names:
                continue
            if top not in OURS | roots and _installed(top):
                found[top] = _version(top)
            elif (file := self._file(name)) is not None:
                found[name] = file.digest
                waiting += file.imports
        return found

    def _digest(self, asked: tuple[str, ...]) -> str | None:
        if any(self._file(name) is None for name in asked):
            return None
        found = self.modules(*asked)
        lines = [f"{name} {digest}" for name, digest in sorted(found.items())]
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()

    def _file(self, name: str) -> File | None:
        if name.partition(".")[0] in OURS:
            return _own(name)
        if name not in self._files:
            self._files[name] = _read(name)
        return self._files[name]


def module_of(compute: Callable[..., Any]) -> str:
    """Full name of the module in which a function, a method, or the class of a callable stands."""
    while isinstance(compute, partial):
        compute = compute.func
    return getattr(compute, "__module__", None) or type(compute).__module__


def _path(name: str) -> Path | None:
    """File of a module, found without importing it."""
    top, *rest = name.split(".")
    try:
        spec = find_spec(top)
    except ValueError:  # a module that was made by hand, such as __main__
        spec = None
    if spec is None:
        file = getattr(sys.modules.get(name), "__file__", None)
        return Path(file) if file and Path(file).is_file() else None
    if not rest:
        return Path(spec.origin) if spec.origin and Path(spec.origin).is_file() else None
    bases = [Path(root, *rest) for root in spec.submodule_search_locations or ()]
    files = (f for b in bases for f in (b.with_name(f"{b.name}.py"), b / "__init__.py"))
    return next((f for f in files if f.is_file()), None)


@cache
def _own(name: str) -> File | None:
    return _read(name)


def _read(name: str) -> File | None:
    """A module's file; None if there is none, or it cannot be read."""
    path = _path(name)
    try:
        content = b"" if path is None else path.read_bytes()
    except OSError:
        path = None
    if path is None:
        return None
    names: tuple[str, ...] = ()
    if path.suffix == ".py":
        package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        try:
            names = tuple(dict.fromkeys(_imports(ast.parse(content).body, package)))
        except (SyntaxError, ValueError):  # it cannot be imported either: what is kept is its failure
            names = ()
    return File(hashlib.sha256(content).hexdigest(), names)


def _imports(body: Sequence[ast.AST], package: str) -> Iterator[str]:
    """Modules that statements import, wherever they stand, by name; not what only a type checker reads."""
    for node in body:
        match node:
            case ast.If(test=ast.Name(id="TYPE_CHECKING") | ast.Attribute(attr="TYPE_CHECKING")):
                yield from _imports(node.orelse, package)
            case ast.Import():
                for alias in node.names:
                    parts = alias.name.split(".")
                    first = len(parts) if alias.asname else 1
                    yield from (".".join(parts[:k]) for k in range(first, len(parts) + 1))
            case ast.Call(
                func=ast.Name(id="import_module") | ast.Attribute(attr="import_module"),
                args=[ast.Constant(value=str(name)), *_],
            ):
                yield name
            case ast.ImportFrom():
                origin = _absolute(node, package)
                for alias in node.names:
                    yield _imported(origin, alias.name)
            case _:
                yield from _imports(list(ast.iter_child_nodes(node)), package)


def _absolute(node: ast.ImportFrom, package: str) -> str:
    """The module that `from` names."""
    if not node.level:
        return node.module or ""
    parts = package.split(".")
    return ".".join([*parts[: len(parts) - node.level + 1], *([node.module] if node.module else [])])


def _imported(origin: str, name: str) -> str:
    """The module that `from origin import name` takes: the package, if it has that name, else its module."""
    if origin.partition(".")[0] in sys.stdlib_module_names:
        return origin
    path = _path(origin)
    own = path is not None and (path.name != "__init__.py" or name in _bound(path))
    return origin if own or name == "*" or _path(f"{origin}.{name}") is None else f"{origin}.{name}"


@cache
def _bound(path: Path) -> frozenset[str]:
    """Names that a package's own file gives a meaning to."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        match node:
            case ast.Import() | ast.ImportFrom():
                names |= {(alias.asname or alias.name).partition(".")[0] for alias in node.names}
            case ast.FunctionDef() | ast.ClassDef() | ast.AsyncFunctionDef():
                names.add(node.name)
            case ast.Name(ctx=ast.Store()):
                names.add(node.id)
            case _:
                pass
    return frozenset(names)


@cache
def _installed(top: str) -> bool:
    """Whether a package lies where pip installs, or cannot be found at all."""
    path = _path(top)
    if path is None:
        return True
    return any(path.resolve().is_relative_to(place) for place in INSTALLED)


@cache
def _version(top: str) -> str:
    for name in (top, *_distributions().get(top, ())):
        try:
            return version(name)
        except PackageNotFoundError:
            continue
    return "missing"


@cache
def _distributions() -> Any:
    return packages_distributions()
