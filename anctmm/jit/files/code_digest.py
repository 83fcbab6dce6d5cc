"""A hash of everything that the machine code of a kernel depends on.

The code of a kernel is its own function, every function it calls, and the constants that these use from their modules.
All of it is followed here, function by function, so that a kernel is compiled again when something it uses has changed,
and only then: docstrings, comments and functions that it does not call make no difference.
"""

import ast
import hashlib
import inspect
import sys
from collections.abc import Iterator
from dis import opmap
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core import types
from numba.core.dispatcher import Dispatcher
from numba.extending import _Intrinsic

from anctmm.jit.deferred import Deferred, Function, implementations, tell_compiler

#: Values that are written as they are.
_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), np.generic, np.dtype, range)

#: Operations of code that take a global, its number doubled, and that begin the number of the next one.
_LOAD_GLOBAL, _EXTENDED_ARG = opmap["LOAD_GLOBAL"], opmap["EXTENDED_ARG"]

#: Flag of code whose first constant is a docstring, from Python 3.14 on.
_DOCSTRING = 0x4000000


def code_digest(function: Function) -> str:
    """Hash of a function and of everything its machine code is made of.

    Parameters
    ----------
    function : callable
        Not compiled.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    found: dict[int, str] = {}
    waiting = [function]
    while waiting:
        one = waiting.pop()
        if id(one) not in found:
            found[id(one)], calls = _own(one)
            waiting.extend(calls)
    return _hash("\n".join([_own(function)[0], *sorted(found.values())]))


def signature_text(arguments: tuple[Any, ...]) -> str:
    """The types of a kernel's arguments, distinguished as the compiler does.

    Parameters
    ----------
    arguments : tuple of numba types
    """
    return ", ".join(map(_type, arguments))


def _type(kind: Any) -> str:
    if isinstance(kind, types.BaseTuple):
        inside: Any = kind
        name = _class(inside.instance_class) if isinstance(kind, types.BaseNamedTuple) else ""
        own = type(kind).__module__
        way = "" if own == types.BaseTuple.__module__ else _source(own)  # of ours: how it is handed over
        return f"{way}{name}({', '.join(map(_type, inside.types))})"
    if isinstance(kind, types.Dispatcher):
        return f"{kind.dispatcher.py_func.__qualname__}#{code_digest(kind.dispatcher.py_func)}"
    return f"{type(kind).__name__} {kind}"


@cache
def _own(function: Function) -> tuple[str, tuple[Function, ...]]:
    """A text that identifies a function, without the functions it calls; and these."""
    calls: list[Function] = []
    code = function.__code__
    names = {name for part in _codes(code) for name in part.co_names}
    taken = {name for part in _codes(code) for name in _globals(part)}
    lines = [f"{function.__module__}.{function.__qualname__}", _code(code)]
    lines += [_value((function.__defaults__, function.__kwdefaults__), names, calls)]
    for name in sorted(taken & function.__globals__.keys()):
        lines.append(f"{name} = {_value(function.__globals__[name], names, calls)}")
    for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
        lines.append(f"{name} = {_value(_contents(cell), names, calls)}")
    calls += implementations.get(function, [])
    return _hash("\n".join(lines)), tuple(calls)


def _contents(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # a function inside another that refers to itself before it is made
        return None


def _codes(code: CodeType) -> Iterator[CodeType]:
    """A code object and those of the functions written inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _globals(code: CodeType) -> Iterator[str]:
    """Names that code takes from its module; an attribute of the same name is something else."""
    high = 0
    for operation, low in zip(code.co_code[::2], code.co_code[1::2], strict=True):
        number = high << 8 | low
        if operation == _LOAD_GLOBAL:
            yield code.co_names[number >> 1]
        high = number if operation == _EXTENDED_ARG else 0


def _code(code: CodeType) -> str:
    """Instructions and constants, without docstrings and without places in the file."""
    constants = [_code(c) if isinstance(c, CodeType) else _value(c, set(), []) for c in code.co_consts]
    if _has_docstring(code):
        constants[0] = _value(None, set(), [])
    layout = (code.co_argcount, code.co_kwonlyargcount, code.co_flags & ~_DOCSTRING, code.co_varnames)
    names = (code.co_names, code.co_freevars, code.co_cellvars)
    return f"{layout} {names} {code.co_code.hex()} {code.co_exceptiontable.hex()} {constants}"


def _has_docstring(code: CodeType) -> bool:
    """Whether the first constant of a function is its docstring."""
    if sys.version_info >= (3, 14):
        return bool(code.co_flags & _DOCSTRING)
    return code.co_name != "<lambda>" and bool(code.co_consts) and isinstance(code.co_consts[0], str)


def _value(value: Any, names: set[str], calls: list[Function]) -> str:
    """A text that identifies a value that code uses; functions are added to the calls.

    Parameters
    ----------
    value : object
    names : set of str
        Names that the code uses, attributes among them: of a module those are looked at.
    calls : list of functions
        Appended to.
    """
    if isinstance(value, Deferred | Dispatcher):
        options = sorted((k, _value(v, names, calls)) for k, v in value.targetoptions.items())
        calls.append(value.py_func)
        return f"kernel {value.py_func.__qualname__} {options}"
    if isinstance(value, _Intrinsic):
        calls.append(value._defn)
        return f"intrinsic {value._defn.__qualname__}"
    if isinstance(value, FunctionType):
        return _function(value, calls)
    if isinstance(value, _PLAIN):
        return f"{type(value).__name__} {value!r}"
    if isinstance(value, tuple | list):
        head = _class(type(value)) if hasattr(value, "_fields") else type(value).__name__
        return f"{head}[{', '.join(_value(v, names, calls) for v in value)}]"
    if isinstance(value, set | frozenset):
        return f"set {sorted(_value(v, names, calls) for v in value)}"
    if isinstance(value, dict):
        return f"dict {[(_value(k, names, calls), _value(v, names, calls)) for k, v in value.items()]}"
    if isinstance(value, np.ndarray):
        return f"array {value.dtype} {value.shape} {_hash(value.tobytes())}"
    if isinstance(value, ModuleType):
        return _module(value, names, calls)
    if isinstance(value, type):
        return _class(value)
    if isinstance(value, types.Type):
        return _type(value)
    if isinstance(value, np.ufunc | BuiltinFunctionType):
        return f"{getattr(value, '__module__', '')}.{value.__name__}"
    return f"{_class(type(value))} {_source(type(value).__module__)}"


def _function(function: FunctionType, calls: list[Function]) -> str:
    """A function of Python: its code; where the compiler has implementations we do not know, its whole module."""
    package = function.__module__.partition(".")[0]
    if package in _foreign():
        return f"{function.__module__}.{function.__qualname__} {_version(package)}"
    calls.append(function)
    known = "" if function in implementations else _source(function.__module__)
    return f"function {function.__qualname__} {known}"


def _module(module: ModuleType, names: set[str], calls: list[Function]) -> str:
    """A module: its name and version, or, if it is none of a library, what the code may use of it."""
    package = module.__name__.partition(".")[0]
    if package in _foreign():
        return f"module {module.__name__} {_version(package)}"
    used = sorted(names & vars(module).keys())
    return f"module {module.__name__} {[(n, _value(vars(module)[n], names - {n}, calls)) for n in used]}"


def _class(kind: type) -> str:
    """A class: where it stands, and its fields."""
    return f"{kind.__module__}.{kind.__qualname__}{getattr(kind, '_fields', '')}"


@cache
def _source(module: str) -> str:
    """Hash of a module's code without docstrings and comments; of its name, if there is no source."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (KeyError, OSError, TypeError, SyntaxError):
        return module
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        first = body[0] if isinstance(body, list) and body else None
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
            first.value.value = ""  # a docstring
    return _hash(ast.dump(tree))


@cache
def _foreign() -> frozenset[str]:
    """Packages whose version stands for their code."""
    return frozenset(sys.stdlib_module_names) | {"numba", "llvmlite", "numpy", "scipy", "builtins"}


@cache
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # of the standard library: Python's version is part of every key
        return ""


def _hash(text: str | bytes) -> str:
    return hashlib.sha256(text if isinstance(text, bytes) else text.encode()).hexdigest()


tell_compiler()  # implementations are among what waits
