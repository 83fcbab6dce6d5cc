"""Status of a run in which the law of a connector returned no number."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from anctmm.discretise.chain import Chain
from anctmm.errors import PropertyError, reason
from anctmm.forces.connectors import Connectors
from anctmm.integrators.jumping_law import asked_of_law
from anctmm.model.connectors import Connector, Spring, law_value, name_of
from anctmm.results.status import Status

#: What a status says before the error that a law raises.
RAISES = ", where it raises "
#: Part of the run after the time of the last state that there was, at which a law is asked, too.
NEAR = 1e-6


def broken_law(
    chain: Chain, connectors: Connectors | None, t: float, step: int | None = None
) -> Status | None:
    """What is known of a step to t, s, in which a law gave no number; None where all did."""
    if connectors is None:
        return None
    broken = (connectors.laws != 0) & ~np.isfinite(connectors.now[:, 0]) & np.isfinite(connectors.now[:, 1])
    if not broken.any():
        return None
    k = int(broken.argmax())
    connector, (force, place) = chain.scene.connectors[k], connectors.now[k, :2]
    at = f"a length of {place:.6g} m" if isinstance(connector, Spring) else f"an angle of {place:.6g} rad"
    when = f"t = {t:.6g} s" if step is None else f"t = {t:.6g} s (step {step})"
    raised = _raised(connector, *asked_of_law(connector, connectors, k, t), (t, t + NEAR * chain.run.t_end))
    return Status(
        "diverged",
        f"the law of the {name_of(connector)} gives {force} near {when}, at {at}{raised}; a law must give a finite "
        f"number for every elongation, rate and time",
        time=t,
        step=step,
    )


def _raised(connector: Connector, elongation: float, rate: float, times: Iterable[float]) -> str:
    """What the function itself raises there, which its compiled form cannot tell; empty if it raises nothing."""
    law: Any = getattr(connector.law, "py_func", connector.law)
    for t in times:
        try:
            law_value(name_of(connector), law, elongation, rate, t)
        except PropertyError as error:
            if error.__cause__ is not None:
                return f"{RAISES}{reason(error.__cause__)}"
    return ""


def law_raised(status: Status) -> bool:
    """Whether a run ended since a law raised an error: no other mesh and no other step helps."""
    return status.code == "diverged" and RAISES in status.message
