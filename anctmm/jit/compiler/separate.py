"""Kernels compiled separately from those that call them.

Code linked into a caller is optimised there once more and becomes machine code in each caller, which is the last step
that a first run waits for. A separate kernel is compiled once for all callers, at the same time as they are: they need
only its signature, given by its annotations, and its address when they are loaded (`addresses`). Nothing is inlined
through such a call, so it is meant for large parts only.
"""

import inspect
from collections.abc import Callable
from typing import Any

from numba.core import sigutils, types
from numba.core.funcdesc import FunctionDescriptor
from numba.core.typing import make_concrete_template, signature

from anctmm.jit.compiler.addresses import name_of
from anctmm.jit.compiler.kernels import Kernel, for_python

#: What separate kernels may return, by their annotations.
RESULTS: dict[Any, Any] = {None: types.none, bool: types.boolean, int: types.int64, float: types.float64}


class SeparateKernel(Kernel):
    """A kernel with machine code of its own, also for kernels that call it.

    Parameters
    ----------
    py_func : callable
    locals, targetoptions : dict, optional
        Of numba's `Dispatcher`.

    Raises
    ------
    TypeError
        If it does not stand in a module, or its annotations do not say what it returns; by `compile`, if it returns
        something else.
    """

    _compiler: Any

    def __init__(self, py_func: Callable[..., Any], locals: Any = None, targetoptions: Any = None) -> None:
        super().__init__(py_func, locals, targetoptions)
        if "<locals>" in py_func.__qualname__:
            raise TypeError(
                f"kernel {py_func.__qualname__}: other processes find separate kernels in modules alone"
            )
        told = inspect.get_annotations(py_func).get("return", "nothing")
        if told not in RESULTS:
            raise TypeError(f"kernel {py_func.__qualname__} is to return {told}; allowed: {list(RESULTS)}")
        self._result, self._told = RESULTS[told], set[str]()

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What a caller that is compiled needs to know: nothing is compiled here."""
        parameters, folded = self._compiler.fold_argument_types(args, kws)
        folded = tuple(map(types.unliteral, folded))
        name = self.py_func.__name__
        signatures = [signature(self._result, *folded)]
        return (
            make_concrete_template(f"CallTemplate({name})", key=name, signatures=signatures),
            parameters,
            folded,
            {},
        )

    def get_overload(self, sig: Any) -> Any:
        """By what the compiler finds how callers call it."""
        arguments = tuple(sigutils.normalize_signature(sig)[0])
        name = name_of(self, arguments)
        if name not in self._told:
            self.targetctx.insert_user_function(name, self._elsewhere(name, arguments), [])
            self._told.add(name)
        return name

    def compile(self, sig: Any) -> Any:
        """Compile for a signature, unless that is done; the entry."""
        with for_python():
            entry = super().compile(sig)
        compiled: Any = self.overloads[tuple(sigutils.normalize_signature(sig)[0])]
        found = compiled.signature.return_type
        if found != self._result:
            raise TypeError(
                f"kernel {self.py_func.__qualname__} returns {found}, and is to return {self._result}"
            )
        return entry

    def _elsewhere(self, name: str, arguments: tuple[Any, ...]) -> Any:
        """A function that is not in the library of its callers."""
        return FunctionDescriptor(
            native=True,
            modname=None,
            qualname=name,
            unique_name=name,
            doc="",
            typemap=None,
            restype=self._result,
            calltypes=None,
            args=list(inspect.signature(self.py_func).parameters),
            kws=(),
            mangler=lambda *_, **__: name,
            argtypes=arguments,
        )
