"""Status of a run in which the law of a connector returned no number."""

import numpy as np

from anctmm.discretise.chain import Chain
from anctmm.forces.connectors import Connectors
from anctmm.model.connectors import Spring, name_of
from anctmm.results.status import Status


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
    return Status(
        "diverged",
        f"the law of the {name_of(connector)} gives {force} near {when}, at {at}; a law must give a finite number for "
        f"every elongation, rate and time",
        time=t,
        step=step,
    )
