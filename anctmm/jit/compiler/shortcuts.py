"""Shortcuts through numba's compiler while it compiles kernels: the same code comes out with a third less work.

- A function that is inlined at several places is translated once. To inline it numba copies it twice, and with each
  block the names of all variables: one copy does, of what is changed in it, and none of what was made for one call.
- After each pass numba finds where each variable lives. That is asked for after two passes; it is found when asked for.
- A variable that is set more than once gets a name for each value. numba goes through the whole function for each such
  variable; here it goes through the blocks that name it.
- Of what type a sum, an item, … is, and how long a number is, numba finds anew at each place. It is the same for the
  same types. So are the lists of what a target can do, once they are loaded.
- To load or store a number of an array, numba puts the array's own numbers into a frame and reads them from there one
  by one, and LLVM takes all of that away again: twenty instructions, of which seven are needed.
- How often a loop over a range is run, numba finds for any step, with a branch for each sign and an error for none. The
  step is 1 nearly always.
- Of each call of LLVM, numba tells all who ask how long compiling takes. Only who counts kernels is told here.
"""

import operator
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import reduce
from typing import Any

from numba.core import analysis, cgutils, event, ir, ssa, transforms, types
from numba.core.base import BaseContext
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.inline_closurecall import InlineWorker
from numba.core.lowering import Lower
from numba.core.postproc import PostProcessor, VariableLifetime
from numba.core.typing import Context
from numba.np.arrayobj import fix_integer_index, load_item, store_item

#: Ways that are taken instead of numba's, by where these stand and their names.
_ways: dict[tuple[Any, str], Any] = {}
#: Numba's own, that shortcuts come back to.
_translate, _inline = InlineWorker.run_untyped_passes, InlineWorker.inline_ir
_find_lives, _name_values, _rewrite = PostProcessor.run, ssa._run_ssa, ssa._run_block_rewrite
_call_type, _size, _tell = types.Function.get_call_type, BaseContext.get_abi_sizeof, event.broadcast
_expression, _get_item, _set_item = Lower.lower_expr, Lower.lower_getitem, Lower.lower_setitem
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


@_instead_of(Lower, "lower_getitem")
def _load_number(lower: Any, kind: Any, expression: Any, array: Any, index: Any, signature: Any) -> Any:
    """`Lower.lower_getitem`; of a number at whole numbers, without more of the array than that takes."""
    of, at = signature.args
    if not _one_number(lower, of, array, at):
        return _get_item(lower, kind, expression, array, index, signature)
    number = load_item(lower.context, lower.builder, of, _address(lower, of, array, at, index))
    return lower.context.cast(lower.builder, number, signature.return_type, kind)


@_instead_of(Lower, "lower_setitem")
def _store_number(lower: Any, array: Any, index: Any, value: Any, signature: Any) -> Any:
    """`Lower.lower_setitem` likewise."""
    of, at, given = signature.args
    if not _one_number(lower, of, array, at) or not isinstance(given, types.Number | types.Boolean):
        return _set_item(lower, array, index, value, signature)
    context, builder = lower.context, lower.builder
    number = context.cast(builder, lower.loadvar(value.name), lower.typeof(value.name), given)
    place = _address(lower, of, array, at, index)
    store_item(context, builder, of, context.cast(builder, number, given, of.dtype), place)
    return None


def _one_number(lower: Any, of: Any, array: Any, at: Any) -> bool:
    """Whether an index of whole numbers tells one number of an array whose rows lie one after the other."""
    indices: Any = getattr(at, "types", (at,))
    return (
        isinstance(of, types.Array)
        and of.layout == "C"
        and len(indices) == of.ndim
        and isinstance(of.dtype, types.Number | types.Boolean)
        and all(isinstance(one, types.Integer) for one in indices)
        and lower.typeof(array.name) == of
        and not lower.context.enable_boundscheck
    )


def _address(lower: Any, of: Any, array: Any, at: Any, index: Any) -> Any:
    """Where a number of an array lies; indices below 0 count from the end, as with numba."""
    context, builder = lower.context, lower.builder
    numbers, model = lower.loadvar(array.name), context.data_model_manager[of]
    shape = model.get_field_position("shape")
    place = context.cast(builder, lower.loadvar(index.name), lower.typeof(index.name), at)
    kinds: Any = getattr(at, "types", None)
    indices = (
        [(at, place)]
        if kinds is None
        else [(kind, builder.extract_value(place, k)) for k, kind in enumerate(kinds)]
    )
    sizes = [builder.extract_value(numbers, [shape, k]) for k in range(of.ndim)]
    inside = [
        fix_integer_index(context, builder, kind, one, size)
        for (kind, one), size in zip(indices, sizes, strict=True)
    ]
    steps = [reduce(builder.mul, sizes[k:]) for k in range(1, of.ndim)]
    parts = [*(builder.mul(one, step) for one, step in zip(inside, steps, strict=False)), inside[-1]]
    data = builder.extract_value(numbers, model.get_field_position("data"))
    return builder.gep(data, [reduce(builder.add, parts)])


@_instead_of(Lower, "lower_expr")
def _begin_range(lower: Any, kind: Any, expression: Any) -> Any:
    """`Lower.lower_expr`; what begins a loop over a range whose step is 1 tells how often it is run by a difference."""
    if expression.op != "getiter" or not _steps_by_one(lower, expression.value.name):
        return _expression(lower, kind, expression)
    context, builder = lower.context, lower.builder
    begin, end, step = cgutils.unpack_tuple(builder, lower.loadvar(expression.value.name), 3)
    length = builder.sub(end, begin)
    zero = length.type(0)
    at, left = (cgutils.alloca_once(builder, length.type) for _ in range(2))
    builder.store(begin, at)
    with builder.if_else(builder.icmp_signed("<=", length, zero)) as (empty, some):
        with empty:
            builder.store(zero, left)
        with some:
            builder.store(length, left)
    model = context.data_model_manager[kind]
    found = model.get_value_type()(None)
    for name, part in (("iter", at), ("stop", end), ("step", step), ("count", left)):
        found = builder.insert_value(found, part, model.get_field_position(name))
    return found


def _steps_by_one(lower: Any, name: str) -> bool:
    """Whether a variable is a range that was made of one number or two."""
    if lower.typeof(name) != types.range_state64_type:
        return False
    values = vars(lower).get("_values")
    if values is None:
        values = lower._values = _set_once(lower.blocks)
    made = values.get(name)
    while isinstance(made, ir.Var):
        made = values.get(made.name)
    if not (isinstance(made, ir.Expr) and made.op == "call" and not made.kws and not made.vararg):
        return False
    called = lower.typeof(made.func.name)
    return len(made.args) < 3 and isinstance(called, types.Function) and called.typing_key is range


def _set_once(blocks: dict[int, Any]) -> dict[str, Any]:
    """Values of the variables that are set in one place."""
    values: dict[str, Any] = {}
    for block in blocks.values():
        for one in block.find_insts(ir.Assign):
            values[one.target.name] = None if one.target.name in values else one.value
    return values


#: What contexts of numba's know of their lists, once these are loaded, by its address; copies of a context share it.
_loaded: dict[int, Any] = {}


@_instead_of(CPUContext, "load_additional_registries")
@_instead_of(Context, "load_additional_registries")
def _load_once(context: Any) -> None:
    """`load_additional_registries`, once; then only what was added to the lists, where numba puts new intrinsics."""
    lists = context._registries
    if id(lists) not in _loaded:
        _load[type(context)](context)
        _loaded[id(lists)] = lists
    for one in list(lists):
        context.install_registry(one)


@_instead_of(event, "broadcast")
def _tell_of_kernels(told: Any) -> None:
    if told.kind == "numba:compile":
        _tell(told)
