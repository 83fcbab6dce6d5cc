"""Named tuples that kernels receive by their address.

numba passes a tuple as its numbers, about seven for each array: a scene has 900 of them. At every call, and for every
name that the tuple gets, the compiler would copy them all. Here kernels read what they need from the memory where the
call from Python has stored it. Kernels never write there, and declare so: otherwise the compiler would have to read it
again after each store to an array, which might overlap.
"""

from typing import TypeVar

from anctmm.jit.deferred import when_loaded

T = TypeVar("T", bound=type)


def by_address(kind: T) -> T:
    """Make a class of named tuples one of which kernels are handed the address; no kernel makes any."""

    def tell() -> None:
        from anctmm.jit.compiler.address_types import told

        told(kind)

    when_loaded(tell)
    return kind
