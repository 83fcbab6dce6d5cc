"""Laws of connectors, (elongation, rate, t) → force: compiled as C functions and called by their address.

Kernels therefore need not be compiled for each law, and can be stored on disk. A law is compiled once and compared with
the Python function at some values: a law that numba cannot compile, or whose values differ, is refused by name.
"""

import ctypes
from functools import cache
from typing import Any

import numpy as np

from anctmm.errors import PropertyError, reason, shown
from anctmm.jit.deferred import compiled_in
from anctmm.model.connectors import Law, law_value

#: Elongations and rates, of a unit that the connector gives, and times (s) at which a compiled law is tried.
TRIED = ((0.0, 0.0, 0.0), (0.3, -0.7, 0.0), (-0.2, 0.4, 0.1))
#: Difference of a compiled law from that of Python that is no rounding.
SAME = 1e-9
NEEDED = "a plain function (elongation, rate, t) -> float of numbers is needed, of what numba compiles"
CHANGED = (
    "a value that it refers to has changed since it was compiled: for each value define the function anew"
)

#: Compiled laws that cannot be found again.
_kept: list[Any] = []
_C = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_double, ctypes.c_double)


def address_of(name: str, law: Law, unit: float) -> int:
    """Address of a law, compiled.

    Parameters
    ----------
    name : str
        Of the connector, for messages.
    law : callable
    unit : float
        Size of an elongation at which it is tried, m or rad.

    Raises
    ------
    PropertyError
        If numba cannot compile it, or it gives something else then.
    """
    from numba.core.errors import NumbaError

    try:
        compiled = _compiled(law)
    except TypeError:  # that cannot be hashed
        compiled = _compiled.__wrapped__(law)
        _kept.append(compiled)
    except (NumbaError, NotImplementedError, KeyError, ValueError) as error:
        raise PropertyError(f"{name} law cannot be compiled: {_why(error)}; {NEEDED}") from error
    for elongation, rate, t in TRIED:
        at = elongation * unit, rate * unit, t
        expected = law_value(name, getattr(law, "py_func", law), *at)
        found = float(compiled.ctypes(*at))
        if not _same(expected, found):
            anew = float(_compiled.__wrapped__(law).ctypes(*at))
            raise PropertyError(
                f"{name} law gives {expected!r} at elongation {at[0]!r}, rate {at[1]!r}, t = {t!r} s, and compiled "
                f"{found!r}; {CHANGED if _same(expected, anew) else NEEDED}"
            )
    return int(compiled.address)


def _same(expected: float, found: float) -> bool:
    return abs(found - expected) <= SAME * max(abs(expected), abs(found))


def _why(error: Exception) -> str:
    """The first line of numba's message that says what is wrong."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    said = [line for line in lines if not line.startswith(("Failed in", "During:"))]
    return shown((said or [reason(error)])[0])


@cache  # for good: kernels know no more than an address
def _compiled(law: Law) -> Any:
    """A law as a function of C; what it raises there becomes NaN."""
    import numba
    from numba.core.registry import CPUDispatcher

    options: Any = {"nopython": True, "error_model": "numpy"}
    inner: Any = law if isinstance(law, CPUDispatcher) else CPUDispatcher(law, targetoptions=options)

    def guarded(elongation, rate, t):  # type: ignore[no-untyped-def]
        try:
            return float(inner(elongation, rate, t))
        except Exception:
            return np.nan

    number = numba.float64
    return numba.cfunc(number(number, number, number), error_model="numpy")(guarded)


def call_law(address: int, elongation: float, rate: float, t: float) -> float:
    """Value of a compiled law."""
    return float(_C(int(address))(elongation, rate, t))


compiled_in("anctmm.forces.law_code")
