"""Shortcuts through numba's compiler while it compiles kernels: the same code comes out with a quarter less work.

- To inline a function numba copies it twice, and with each block the names of all variables. One copy does, and none
  of what was made for this call alone.
- After each pass numba finds where each variable lives. That is asked for after two passes; it is found when asked for.
- Of what type a sum, an item, … is, numba finds anew at each place. It is the same for the same types.
"""

import copy
import operator
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import analysis, ir, transforms, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.inline_closurecall import InlineWorker
from numba.core.postproc import PostProcessor, VariableLifetime

#: Where numba takes its way, and that way.
_PLACES: tuple[tuple[Any, str], ...] = (
    (InlineWorker, "inline_ir"),
    (PostProcessor, "run"),
    (types.Function, "get_call_type"),
)
_inline_ir, _run, _call_type = (getattr(*place) for place in _PLACES)
#: Signatures by operator and types of the operands; the operators are kept, so that none takes their place.
_operators: dict[tuple[int, Any], tuple[Any, Any]] = {}


class _Fresh(ir.Block):  # type: ignore[misc]
    """A block that nobody else holds: it may be changed in place of its copy."""

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Fresh":
        return self


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


@contextmanager
def shortcuts() -> Iterator[None]:
    """In the context numba compiles with less work; other threads compile before or after it."""
    with global_compiler_lock:
        before = [getattr(*place) for place in _PLACES]
        _put([_inline_once, _find_when_asked, _known_call_type])
        try:
            yield
        finally:  # as it was found: a kernel may be compiled while another one is
            _put(before)


def _put(ways: list[Any]) -> None:
    """Let numba go these ways."""
    for (where, name), way in zip(_PLACES, ways, strict=True):
        setattr(where, name, way)


def _inline_once(worker: Any, caller: Any, block: Any, at: int, callee: Any, *rest: Any, **more: Any) -> Any:
    """`InlineWorker.inline_ir` of one copy of the function to be inlined."""
    memo: dict[int, Any] = {}  # of all blocks: what they share, their copies share
    own = callee.copy()
    own.blocks = {label: copy.deepcopy(one, memo) for label, one in callee.blocks.items()}
    _become(_Fresh, own.blocks.values())
    try:
        return _inline_ir(worker, caller, block, at, own, *rest, **more)
    finally:
        _become(ir.Block, [one for one in caller.blocks.values() if isinstance(one, _Fresh)])


def _become(kind: Any, blocks: Iterable[Any]) -> None:
    for block in blocks:
        block.__class__ = kind


def _find_when_asked(processor: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """`PostProcessor.run` that finds no lifetimes in advance."""
    function = processor.func_ir
    if function.is_generator:
        _run(processor, emit_dels, extend_lifetimes)
        return
    function.blocks = transforms.canonicalize_cfg(function.blocks)
    function.variable_lifetime = VariableLifetime(function.blocks)
    function.block_entry_vars = _EntryVariables(function.variable_lifetime, function.blocks)
    function.generator_info = None
    if emit_dels:
        processor._insert_var_dels(extend_lifetimes=extend_lifetimes)


def _known_call_type(function: Any, context: Any, arguments: Any, named: Any) -> Any:
    """`Function.get_call_type`, found once for an operator and types."""
    if named or getattr(function.typing_key, "__module__", None) != operator.add.__module__:
        return _call_type(function, context, arguments, named)
    key = id(function), arguments
    if key not in _operators:
        _operators[key] = _call_type(function, context, arguments, named), function
    return _operators[key][0]
