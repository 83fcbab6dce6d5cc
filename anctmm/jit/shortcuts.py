"""Shortcuts through numba's compiler while it compiles kernels: the same code comes out with a third less work.

- A function that is inlined at several places is translated once. To inline it numba copies it twice, and with each
  block the names of all variables: one copy does, of what is changed in it, and none of what was made for one call.
- After each pass numba finds where each variable lives. That is asked for after two passes; it is found when asked for.
- A variable that is set more than once gets a name for each value. numba goes through the whole function for each such
  variable; here it goes through the blocks that name it.
- Of what type a sum, an item, … is, and how long a number is, numba finds anew at each place. It is the same for the
  same types. So are the lists of what a target can do, once they are loaded.
- Of each call of LLVM, numba tells all who ask how long compiling takes. Only who counts kernels is told here.
"""

import operator
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import analysis, event, ir, ssa, transforms, types
from numba.core.base import BaseContext
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.inline_closurecall import InlineWorker
from numba.core.postproc import PostProcessor, VariableLifetime
from numba.core.typing import Context

#: Ways that are taken instead of numba's, by where these stand and their names.
_ways: dict[tuple[Any, str], Any] = {}
#: Numba's own, that shortcuts come back to.
_translate, _inline = InlineWorker.run_untyped_passes, InlineWorker.inline_ir
_find_lives, _name_values, _rewrite = PostProcessor.run, ssa._run_ssa, ssa._run_block_rewrite
_call_type, _size, _tell = types.Function.get_call_type, BaseContext.get_abi_sizeof, event.broadcast
_load = {kind: kind.load_additional_registries for kind in (Context, CPUContext)}


def _instead_of(place: Any, name: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make the decorated function take the place of numba's."""

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        _ways[place, name] = function
        return function

    return decorate


@contextmanager
def shortcuts() -> Iterator[None]:
    """In the context numba compiles with less work; other threads compile before or after it."""
    with global_compiler_lock:
        before = {place: getattr(*place) for place in _ways}
        _put(_ways)
        try:
            yield
        finally:  # as it was found: a kernel may be compiled while another one is
            _put(before)


def _put(ways: dict[tuple[Any, str], Any]) -> None:
    """Let numba go these ways."""
    for (place, name), way in ways.items():
        setattr(place, name, way)


class _Fresh(ir.Block):  # type: ignore[misc]
    """A block that nobody else holds: it may be changed in place of its copy."""

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Fresh":
        return self


def _become(kind: Any, blocks: Iterable[Any]) -> None:
    for block in blocks:
        block.__class__ = kind


#: Functions to be inlined, translated.
_translated: dict[tuple[Any, bool], Any] = {}


@_instead_of(InlineWorker, "run_untyped_passes")
def _translate_once(worker: Any, function: Any, enable_ssa: bool = False) -> Any:
    key = function, enable_ssa
    if key not in _translated:
        _translated[key] = _translate(worker, function, enable_ssa)
    return _translated[key]


@_instead_of(InlineWorker, "inline_ir")
def _inline_once(worker: Any, caller: Any, block: Any, at: int, callee: Any, *rest: Any, **more: Any) -> Any:
    """`InlineWorker.inline_ir` of one copy of the function to be inlined."""
    own = callee.copy()
    scope = _copied_scope(next(iter(callee.blocks.values())).scope)  # a function has one
    own.blocks = {label: _copied_block(one, scope) for label, one in callee.blocks.items()}
    try:
        return _inline(worker, caller, block, at, own, *rest, **more)
    finally:
        _become(ir.Block, [one for one in caller.blocks.values() if isinstance(one, _Fresh)])


def _copied_scope(scope: Any) -> Any:
    """Names of a function, to which others may be added."""
    fresh = ir.Scope(scope.parent, scope.loc)
    fresh.localvars._con.update(scope.localvars._con)
    return fresh


def _copied_block(block: Any, scope: Any) -> _Fresh:
    """A block with statements of its own."""
    fresh = _Fresh(scope, block.loc)
    fresh.body = [_copied(statement) for statement in block.body]
    return fresh


def _copied(part: Any) -> Any:
    """A statement or a part of one, for names in it to be replaced: names themselves are not changed."""
    kind: Any = type(part)
    if kind in (list, tuple):
        return kind(map(_copied, part))
    if kind is dict:
        return {key: _copied(value) for key, value in part.items()}
    if not isinstance(part, ir.Inst):
        return part
    fresh = kind.__new__(kind)
    fresh.__dict__.update({name: _copied(value) for name, value in part.__dict__.items()})
    return fresh


@_instead_of(ir.Inst, "_rec_list_vars")
def _variables(instruction: Any, part: Any) -> list[Any]:
    """Variables named in a part of an instruction, most of which are names or parts that hold none."""
    found: list[Any] = []
    for one in part.values() if type(part) is dict else part if type(part) in (list, tuple) else (part,):
        kind = type(one)
        if kind is ir.Var:
            found.append(one)
        elif kind in (list, tuple, dict):
            found += _variables(instruction, one)
        elif isinstance(one, ir.Inst):
            found += one.list_vars()
    return found


class _EntryVariables(dict[Any, Any]):
    """Variables that live where a block begins, found when one is asked for."""

    def __init__(self, lifetime: Any, blocks: dict[int, Any]) -> None:
        super().__init__()
        self._lifetime, self._blocks = lifetime, blocks

    def __missing__(self, block: Any) -> Any:
        lifetime, blocks = self._lifetime, self._blocks
        found = analysis.compute_live_variables(
            lifetime.cfg, blocks, lifetime.usedefs.defmap, lifetime.deadmaps.combined
        )
        self.update({blocks[label]: found[label] for label in blocks})
        return self[block]


@_instead_of(PostProcessor, "run")
def _find_when_asked(processor: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """`PostProcessor.run` that finds no lifetimes in advance."""
    function = processor.func_ir
    if function.is_generator:
        _find_lives(processor, emit_dels, extend_lifetimes)
        return
    function.blocks = transforms.canonicalize_cfg(function.blocks)
    function.variable_lifetime = VariableLifetime(function.blocks)
    function.block_entry_vars = _EntryVariables(function.variable_lifetime, function.blocks)
    function.generator_info = None
    if emit_dels:
        processor._insert_var_dels(extend_lifetimes=extend_lifetimes)


#: Names of all variables in blocks while names are given to values, and how many statements a block has with these.
_named: dict[int, tuple[Any, int, set[str]]] = {}


@_instead_of(ssa, "_run_ssa")
def _name_values_anew(blocks: dict[int, Any]) -> Any:
    _named.clear()
    return _name_values(blocks)


@_instead_of(ssa, "_run_block_rewrite")
def _rewrite_where_named(blocks: dict[int, Any], states: dict[str, Any], handler: Any) -> Any:
    """`ssa._run_block_rewrite` of the blocks that name the variable: nothing is changed in others."""
    name = states["varname"]
    concerned = {label: block for label, block in blocks.items() if name in _names(block)}
    return blocks | _rewrite(concerned, states, handler)


def _names(block: Any) -> set[str]:
    """Names of all variables in a block; a value that comes from several blocks is put before its statements."""
    known, count, names = _named.get(id(block), (None, 0, set()))
    if known is not block or count != len(block.body):
        names = {variable.name for statement in block.body for variable in statement.list_vars()}
        _named[id(block)] = block, len(block.body), names
    return names


#: Signatures by operator and types of the operands; the operators are kept, so that none takes their place.
_operators: dict[tuple[int, Any], tuple[Any, Any]] = {}


@_instead_of(types.Function, "get_call_type")
def _known_call_type(function: Any, context: Any, arguments: Any, named: Any) -> Any:
    """`Function.get_call_type`, found once for an operator and types."""
    if named or getattr(function.typing_key, "__module__", None) != operator.add.__module__:
        return _call_type(function, context, arguments, named)
    key = id(function), arguments
    if key not in _operators:
        _operators[key] = _call_type(function, context, arguments, named), function
    return _operators[key][0]


#: Bytes of a type of LLVM's, by its text.
_sizes: dict[str, int] = {}


@_instead_of(BaseContext, "get_abi_sizeof")
def _known_size(context: Any, kind: Any) -> int:
    text = str(kind)
    if text not in _sizes:
        _sizes[text] = _size(context, kind)
    return _sizes[text]


#: Contexts of numba's whose lists are loaded.
_loaded: set[int] = set()


@_instead_of(CPUContext, "load_additional_registries")
@_instead_of(Context, "load_additional_registries")
def _load_once(context: Any) -> None:
    if id(context) not in _loaded:
        _load[type(context)](context)
        _loaded.add(id(context))


@_instead_of(event, "broadcast")
def _tell_of_kernels(told: Any) -> None:
    if told.kind == "numba:compile":
        _tell(told)
