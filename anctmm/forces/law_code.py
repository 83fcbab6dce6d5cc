"""Implementations that kernels call in place of functions of `laws`."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from anctmm.forces.laws import call_law
from anctmm.jit.compiling import chosen_by_types


@intrinsic  # type: ignore[untyped-decorator]
def _call(context: Any, address: Any, elongation: Any, rate: Any, t: Any) -> tuple[Any, Callable[..., Any]]:
    """Call through the address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = ir.DoubleType()
        function = ir.FunctionType(number, [number, number, number])
        return builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])

    return types.float64(types.int64, types.float64, types.float64, types.float64), generate


@chosen_by_types(call_law)
def _call_compiled(address, elongation, rate, t):  # type: ignore[no-untyped-def]
    def through(address, elongation, rate, t):  # type: ignore[no-untyped-def]
        return _call(address, elongation, rate, t)  # type: ignore[call-arg]

    return through
