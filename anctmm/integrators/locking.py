"""Status of a run in which joints and drives leave bodies no admissible position."""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import TIGHT
from anctmm.discretise.junctions.as_written import body_as_written
from anctmm.discretise.junctions.constraints import shape_of
from anctmm.recursion.kept.loops import Loops
from anctmm.recursion.kept.rows import KEPT, Rows
from anctmm.results.status import Status

Array = NDArray[np.float64]

#: Of newton_tolerance: the largest error of a constraint that it may be the cause of.
MOST = 100.0


def rows_in(loops: Loops | None) -> Rows | None:
    """Constraints of a scene; None where it has none."""
    return loops.rows if loops is not None and len(loops.rows.number) > 0 else None


def loosely_closed(chain: Chain, error: float = 0.0) -> str:
    """What a message adds where joints are closed to a loose tolerance that may be why a run ends; empty elsewhere.

    Where constraints repeat each other, as those of a parallelogram of three cranks, no correction closes joints that
    earlier steps have left apart, each by another error.

    Parameters
    ----------
    chain : Chain
    error : float
        By which a constraint is missed.
    """
    run, loose = chain.run, chain.run.newton_tolerance
    if run.explicit or run.tolerance is not None or loose <= TIGHT or error > MOST * loose:
        return ""
    return (
        f"; joints are closed only to newton_tolerance {loose:g}, and the linkage may pass with a smaller one (default "
        f"{float(TIGHT):g})"
    )


def locked(chain: Chain, q: Array, rows: Rows | None, t: float, step: int | None = None) -> Status | None:
    """What is known of a run whose constraints were not kept at a time, s; None where they were.

    `rows` hold what the last evaluation found.
    """
    if rows is None or not np.isfinite(q).all():
        return None
    worst = int(np.abs(rows.value).argmax())
    error = float(abs(rows.value[worst]))
    if error <= KEPT:
        return None
    what, part = chain.kept.constraints.names[rows.constraint[worst]]
    body = body_as_written(chain.parts, part)
    kind = "rigid body" if body in chain.rigid else "body"
    when = f"at t = {t:.6g} s" if step is None else f"at t = {t:.6g} s (step {step})"
    if what == shape_of(body):
        parts, why = (
            f"change its shape by {error:.1e}",
            "it turns too far in a step, or joints",
        )
    else:
        parts, why = f"part from {what} by {error:.1e}, of a length or of the scene's,", "joints"
    return Status(
        "failed",
        f"{kind} {body!r} would {parts} {when}: {why} and "
        f"drives leave the bodies no admissible position, as where a linkage locks; a flexible body, other lengths or "
        f"another drive may help, or smaller steps if the linkage can move{loosely_closed(chain, error)}",
        time=t,
        step=step,
        body=body,
    )
