"""Laws of connectors, (elongation, rate, t) → force: compiled as C functions and called by their address.

Kernels therefore need not be compiled for each law. A law is compiled once a process and compared with the Python
function at some values: a law that numba cannot compile, or whose values differ, is refused by name.
"""

from functools import lru_cache
from typing import Any

import numba
import numpy as np
from numba import NumbaError

from anctmm.errors import PropertyError, shown
from anctmm.model.connectors import Law, law_value

#: Elongations and rates, of a unit that the connector gives, and times (s) at which a compiled law is tried.
TRIED = ((0.0, 0.0, 0.0), (0.3, -0.7, 0.0), (-0.2, 0.4, 0.1))
#: Relative difference of a compiled law from that of Python that is no rounding.
SAME = 1e-9
NEEDED = "a plain function (elongation, rate, t) -> float of numbers is needed, of what numba compiles"


def compiled_law(name: str, law: Law, unit: float) -> Any:
    """A law as a C function, which has an `address`.

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
    try:
        compiled = _compiled(law)
    except (NumbaError, NotImplementedError, KeyError, ValueError, TypeError) as error:
        line = next((line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__)
        raise PropertyError(f"{name} law cannot be compiled: {shown(line)}; {NEEDED}") from error
    for elongation, rate, t in TRIED:
        at = elongation * unit, rate * unit, t
        expected = law_value(name, getattr(law, "py_func", law), *at)
        found = float(compiled.ctypes(*at))
        if not abs(found - expected) <= SAME * max(abs(expected), abs(found)):
            raise PropertyError(
                f"{name} law gives {expected!r} at elongation {at[0]!r}, rate {at[1]!r}, t = {t!r} s, and compiled "
                f"{found!r}; {NEEDED}, whose other values do not change after it is defined"
            )
    return compiled


@lru_cache(maxsize=256)
def _compiled(law: Law) -> Any:
    """A law as a C function; what it raises there becomes NaN."""
    inner = law if hasattr(law, "py_func") else numba.njit(law, error_model="numpy")

    def guarded(elongation, rate, t):  # type: ignore[no-untyped-def]
        try:
            return float(inner(elongation, rate, t))
        except Exception:
            return np.nan

    number = numba.float64
    return numba.cfunc(number(number, number, number), error_model="numpy")(guarded)
