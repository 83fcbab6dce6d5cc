"""Old place."""

from studies.engine.fronts import robust as robust_errors

__all__ = ["NOTE", "robust_errors"]

NOTE = (
    "robust_error: no smaller than the error of the same mesh and step with the tightest bound of Newton's iteration "
    "that its solver tried."
)
