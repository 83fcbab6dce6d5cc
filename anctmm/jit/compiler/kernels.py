"""Kernels that other kernels call: optimised for linking, and compiled fully only when Python calls them.

By default the compiler makes machine code of every function, and an entry for Python, although the caller's machine
code contains it already. Here a function gets both at its first call from Python, which saves half of the compilation
time.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, ClassVar

import llvmlite.binding as llvm
from numba.core import event, sigutils, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder, Flags
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import AnalysisPass, PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering, NopythonRewrites

from anctmm.jit.announcing import announce
from anctmm.jit.compiler.addresses import called_in, find
from anctmm.jit.compiler.shortcuts import shortcuts
from anctmm.jit.deferred import tell_compiler

#: Whether this thread compiles for a caller that is compiled.
_calls = threading.local()


class KernelLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of a function and of all that is linked into it, optimised as a whole."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _finalize_final_module(self) -> None:
        find(called_in(self._final_module))
        super()._finalize_final_module()


class CalleeLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code of a function to be linked into its callers: simplified, but no machine code.

    What it calls is only linked: it is inlined and optimised once, in the machine code of the last caller.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def serialize_using_object_code(self) -> Any:
        """What is kept on disk: LLVM's own form, since there is no machine code."""
        return self.serialize_using_bitcode()

    def read(self, bitcode: bytes) -> None:
        """Take what was kept on disk."""
        self._final_module = llvm.parse_bitcode(bitcode)
        self._finalize_final_module()


class OptimizedLibrary(CalleeLibrary):
    """The same, optimised before it is linked: numba's vectorisation of a loop comes before it is inlined."""

    def _optimize_final_module(self) -> None:
        JITCodeLibrary._optimize_final_module(self)


@register_pass(mutates_CFG=False, analysis_only=True)
class _Callable(AnalysisPass):  # type: ignore[misc]
    """Tell the compiler how callers find a function that has no entry."""

    _name = "anctmm_callee"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        lowered = state["cr"]
        state["cr"] = lowered._replace(cfunc=_known(state.targetctx, lowered.fndesc, state.library))
        return False


class KernelFlags(Flags):  # type: ignore[misc]
    """Options of the compiler, which looks them up at every call that it compiles: equal copies are one object.

    Functions of numba's that kernels call take over the options in the copy. Without that to be inlined, which these
    small functions are anyway, they are compiled once for all kernels.
    """

    _known: ClassVar[list["KernelFlags"]] = []
    _hash: ClassVar[int] = hash(Flags())  # numba's is the same for all

    def copy(self) -> "KernelFlags":
        """Options for what is called."""
        one = KernelFlags(self)
        one.discard("forceinline")
        if one not in self._known:
            self._known.append(one)
        return self._known[self._known.index(one)]

    def __eq__(self, other: object) -> bool:
        return self is other or bool(super().__eq__(other))

    def __hash__(self) -> int:
        return self._hash


class KernelCompiler(CompilerBase):  # type: ignore[misc]
    """numba's compiler, which stops before machine code where a caller is compiled."""

    callee: type[CalleeLibrary] = CalleeLibrary

    def _compile_core(self) -> Any:
        self.state.flags = KernelFlags(self.state.flags)
        with shortcuts():
            return super()._compile_core()

    def define_pipelines(self) -> list[PassManager]:
        """The one pipeline."""
        state = self.state
        codegen, name = state.targetctx.codegen(), state.func_id.func_qualname
        if not for_caller():
            state.library = KernelLibrary(codegen, name)
            state.library.enable_object_caching()
            return [_passes(state)]
        state.flags.no_cpython_wrapper = state.flags.no_compile = True
        state.library = self.callee(codegen, name)
        passes = _passes(state)
        passes.add_pass_after(_Callable, NativeLowering)
        passes.finalize()
        return [passes]


class VectorizingCompiler(KernelCompiler):
    """The same, which optimises what it links."""

    callee = OptimizedLibrary


def _passes(state: Any) -> PassManager:
    """numba's passes, except for that which rewrites expressions that take memory, where none may be taken."""
    passes = DefaultPassBuilder.define_nopython_pipeline(state)
    if not state.flags.nrt:
        passes.passes = [one for one in passes.passes if one[0] is not NopythonRewrites]
        passes.finalize()
    return passes


class Kernel(CPUDispatcher):  # type: ignore[misc]
    """A compiled function that gets machine code of its own when Python calls it.

    Parameters
    ----------
    py_func : callable
    locals, targetoptions : dict, optional
        Of numba's `Dispatcher`.
    """

    _cache: Any
    pipeline: ClassVar[type[KernelCompiler]] = KernelCompiler

    def __init__(self, py_func: Callable[..., Any], locals: Any = None, targetoptions: Any = None) -> None:
        super().__init__(py_func, locals or {}, targetoptions, pipeline_class=self.pipeline)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What a caller that is compiled needs to know.

        One code serves all values of an argument: numba would compile another one for each number that a caller writes.
        """
        args = tuple(map(types.unliteral, args))
        kws = {name: types.unliteral(kind) for name, kind in dict(kws).items()}
        with _for_caller():
            return super().get_call_template(args, kws)

    def compile(self, sig: Any) -> Any:
        """Compile for a signature, unless that is done; the entry, or what stands for it."""
        arguments = tuple(sigutils.normalize_signature(sig)[0])
        with global_compiler_lock:
            known = arguments in self.overloads
            # inlined ones are not kept
            alone = nullcontext if known else getattr(self._cache, "alone", nullcontext)
            with alone(arguments):
                entry = super().compile(sig)
            found = self.overloads[arguments]
            if for_caller():
                return entry
            if is_callee(found):
                return self._give_entry(found)
            if not known:
                _set_environments(found)
            return entry

    def add_overload(self, cres: Any) -> None:
        """Register a compiled signature; in Python only those with an entry."""
        if is_callee(cres):
            self.overloads[tuple(cres.signature.args)] = cres
        else:
            super().add_overload(cres)

    def _give_entry(self, callee: Any) -> Any:
        """Give Python what callers had; its entry."""
        context, name = callee.target_context, callee.fndesc.qualname
        with event.trigger_event("numba:compile", data={"dispatcher": self, "args": callee.signature.args}):
            library = KernelLibrary(context.codegen(), name)
            library.enable_object_caching()
            library.add_linking_library(callee.library)
            context.create_cpython_wrapper(library, callee.fndesc, callee.environment, None)
            entry = context.get_executable(library, callee.fndesc, callee.environment)
            context.insert_user_function(entry, callee.fndesc, [callee.library])
            whole = callee._replace(entry_point=entry, library=library)
            _set_environments(whole)
            self.add_overload(whole)
        self._cache.save_overload(callee.signature, whole)
        return entry


class VectorizedKernel(Kernel):
    """The same, optimised before it is linked into its callers."""

    pipeline = VectorizingCompiler


def compile_for_callers(kernel: Kernel, types: tuple[Any, ...]) -> None:
    """Compile a kernel as a caller that is compiled would have it done."""
    with _for_caller():
        kernel.compile(types)


def is_callee(found: Any) -> bool:
    """Whether a compiled signature can only be linked into callers."""
    return isinstance(found.library, CalleeLibrary)


def for_caller() -> bool:
    """Whether this thread compiles for a caller that is compiled."""
    return bool(getattr(_calls, "depth", 0))


def restored_callee(
    target_context: Any, library: Any, fndesc: Any, env: Any, signature: Any, *rest: Any
) -> Any:
    """A signature compiled for callers, as read from disk.

    Parameters
    ----------
    target_context
        numba's.
    library, fndesc, env, signature, *rest
        What `CompileResult._reduce` gave.
    """
    name, _, bitcode = library
    restored = CalleeLibrary(target_context.codegen(), name)
    restored.read(bitcode)
    objectmode, lifted, annotation, reload_init, referenced = rest
    make: Any = CompileResult
    return make(
        target_context=target_context,
        typing_context=target_context.typing_context,
        library=restored,
        environment=env,
        entry_point=_known(target_context, fndesc, restored),
        fndesc=fndesc,
        type_annotation=annotation,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        typing_error=None,
        call_helper=None,
        metadata=None,
        reload_init=reload_init,
        referenced_envs=referenced,
    )


def _known(context: Any, fndesc: Any, library: Any) -> object:
    """What stands for the entry of a function that has none; callers find its code by it."""
    key = object()
    context.insert_user_function(key, fndesc, [library])
    return key


def _set_environments(whole: Any) -> None:
    """Give machine code the environments of all functions in it, which those without an entry have not been given."""
    for environment in whole._find_referenced_environments():
        whole.library.codegen.set_env(environment.env_name, environment)


@contextmanager
def for_python() -> Iterator[None]:
    """In the context this thread compiles as it does where Python calls."""
    with _at_depth(0):
        yield


def _for_caller() -> AbstractContextManager[None]:
    return _at_depth(1)


@contextmanager
def _at_depth(depth: int) -> Iterator[None]:
    before = getattr(_calls, "depth", 0)
    _calls.depth = depth
    try:
        yield
    finally:
        _calls.depth = before


announce()
tell_compiler()
