"""Advice where Newton's iteration failed because the law of a connector jumps, as that of dry friction does at rest.

Within the jump a force acts that the law never has: an implicit step finds none, however short it is.
"""

from collections.abc import Callable

import numpy as np

from anctmm.discretise.chain import Chain
from anctmm.discretise.methods import Coefficients
from anctmm.forces.connectors import Connectors
from anctmm.forces.laws import call_law
from anctmm.model.connectors import Connector, Spring, free_of, name_of

#: Corrections to either side in which a jump is looked for, and halvings of that.
NEAR, HALVINGS = 10.0, 60
#: Part of a law's change over all of that which its last part must have; of the force, what is no rounding.
JUMPS, ROUNDED = 0.5, 1e-6
#: Part of the way looked at that counts as none.
NONE = 1e-12


def asked_of_law(connector: Connector, connectors: Connectors, k: int, t: float) -> tuple[float, float]:
    """Elongation and rate at which the law of connector k was last evaluated, for a step to t, s."""
    free, free_rate = free_of(connector, float(connectors.placed[k]), t)
    return float(connectors.now[k, 1]) - free, float(connectors.now[k, 5]) - free_rate


def advice_on_jump(
    chain: Chain, connectors: Connectors | None, correction: float, c: Coefficients, t: float
) -> str | None:
    """What to try where a law jumps near the last iterate of a step to t, s; None where none does.

    Parameters
    ----------
    chain : Chain
    connectors : Connectors or None
    correction : float
        The last one, positions relative to the scene's length.
    c : Coefficients
        Of the step.
    t : float
    """
    if connectors is None or not np.isfinite(correction):
        return None
    for k in np.flatnonzero(connectors.laws):
        connector, law = chain.scene.connectors[k], int(connectors.laws[k])
        x, rate = asked_of_law(connector, connectors, int(k), t)
        spring = isinstance(connector, Spring)
        reach = NEAR * correction * (chain.length if spring else 1.0)
        ways: tuple[tuple[str, float, float, Callable[[float], float]], ...] = (
            ("a rate", rate, reach * c.h * c.to_w, lambda v, law=law, x=x: call_law(law, x, v, t)),  # type: ignore[misc]
            ("an elongation", x, reach, lambda u, law=law, v=rate: call_law(law, u, v, t)),  # type: ignore[misc]
        )
        for what, middle, width, force in ways:
            if (found := _jump(force, middle - width, middle + width)) is not None:
                at, less, more = found
                unit = {True: ("m/s", "m"), False: ("rad/s", "rad")}[spring][what != "a rate"]
                force_unit = "N" if spring else "N m"
                return (
                    f"the law of the {name_of(connector)} jumps there from {less:.4g} to {more:.4g} {force_unit} at "
                    f"{what} of {at:.3g} {unit}, and an implicit step finds no force within a jump; a law that is "
                    f"steep there, such as tanh(rate / small) for sign(rate), or a tolerance in place of dt, may help"
                )
    return None


def _jump(force: Callable[[float], float], low: float, high: float) -> tuple[float, float, float] | None:
    """Where a function jumps between two places, and its values before and behind it; None where it does not."""
    less, more, width = force(low), force(high), high - low
    whole = abs(more - less)
    if not whole > ROUNDED * max(abs(less), abs(more)):
        return None
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        here = force(middle)
        if abs(here - less) >= abs(more - here):
            high, more = middle, here
        else:
            low, less = middle, here
    at = 0.5 * (low + high)
    return (at if abs(at) > NONE * width else 0.0, less, more) if abs(more - less) >= JUMPS * whole else None
