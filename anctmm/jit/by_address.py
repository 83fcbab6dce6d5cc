"""Named tuples that kernels are handed by their address.

numba hands a tuple over as its numbers, some seven for each array: a scene is 900 of them. At every call, and for every
name that the tuple gets, the compiler would copy them all. Here kernels read what they need where the call from Python
has put it. Kernels never write there, and say so: that two arrays may overlap is no reason to read it again.
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
