"""Element kernels as C functions, which other kernels call by their address.

An element that a scene does not have is not compiled, and none is compiled more than once, wherever it is called. A
call is for many elements.
"""

from functools import cache
from types import ModuleType

from numba import types

from anctmm.elements import cable_kernel, quintic_kernel, shear_kernel, spatial_cable_kernel
from anctmm.kernels.options import c_function

#: Modules of kernels by kind of element; each has `constants` and the functions of `SIGNATURES`.
MODULES: dict[str, ModuleType] = {
    "cable": cable_kernel,
    "shear": shear_kernel,
    "quintic": quintic_kernel,
    "spatial_cable": spatial_cable_kernel,
}

_NODES, _NUMBERS = types.Array(types.float64, 2, "C"), types.Array(types.float64, 1, "C")
_COUNT, _NUMBER = types.int64, types.float64
#: q and where damping is v, (rows, nodes); first node, elements, constants, numbers of its own, output.
SIGNATURES = {
    "forces": types.void(_NODES, _COUNT, _COUNT, _NUMBERS, _NUMBERS),
    "damping_forces": types.void(_NODES, _NODES, _COUNT, _COUNT, _NUMBERS, _NUMBER, _NUMBERS),
    "tangents": types.void(_NODES, _COUNT, _COUNT, _NUMBERS, _NUMBER, _NUMBER, _NUMBERS),
    "energy": types.float64(_NODES, _COUNT, _COUNT, _NUMBERS),
}


@cache
def address(kind: str, what: str) -> int:
    """Address of a kernel of a kind of element, by its name in `SIGNATURES`."""
    return int(c_function(SIGNATURES[what], getattr(MODULES[kind], what)).address)
