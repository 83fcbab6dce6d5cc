"""How a run ended."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Status:
    """How a run ended.

    Parameters
    ----------
    code : str
        "ok"
            No check found anything wrong with the answer.
        "diverged", "failed", "interrupted"
            The run ended early; the solution has the history until then.
        "inaccurate"
            The history is complete, but more than a tenth of its energy was created by numerical error, or numerical
            dissipation removed too much of it, or fixed steps miss more than a tenth of a load or a drive that states
            its breaks, or the rate or acceleration of a drive is not the derivative of its value.
        "imprecise"
            The history is complete, but rounding leaves too few digits; the message says how many.
        "unstable", "singular"
            Of equilibria: not stable, or at the limit of stability.
        "unsupported"
            The solver lacks a feature that the scene needs; nothing was computed.
    message : str
        Why, and what to try.
    time : float, optional
        Of the first step that failed, s; of equilibria the load factor.
    step : int, optional
    body : str, optional
    element : int, optional
        Counted from 0 at the body's start.
    residuals : tuple of float
        Of Newton's iteration that failed: norm of the residual before each correction, N.
    """

    code: str = "ok"
    message: str = ""
    time: float | None = None
    step: int | None = None
    body: str | None = None
    element: int | None = None
    residuals: tuple[float, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the code is "ok"."""
        return self.code == "ok"

    def __str__(self) -> str:
        return f"{self.code}: {self.message}" if self.message else self.code

    def __eq__(self, other: object) -> bool:
        if isinstance(other, str):
            return self.code == other
        return isinstance(other, Status) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash(self.code)


def in_short(history: Iterable[float]) -> str:
    """Sizes met in an iteration as text: all, or the first and the last few."""
    sizes = [f"{x:.1e}" for x in history if x > 0.0]
    return ", ".join(sizes if len(sizes) <= 8 else [*sizes[:4], "…", *sizes[-3:]]) or "none"
