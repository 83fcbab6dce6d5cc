"""Joints: what holds ends of bodies together, or to the ground."""

from dataclasses import dataclass

from anctmm.model.drives import Angle


@dataclass(frozen=True, init=False)
class Pin:
    """Hinge of any number of ends, or of one end with the ground.

    Parameters
    ----------
    *ends : str
        One or more. An end may be in several joints, as long as none repeats what others hold already.
    grounded : bool
        Whether a hinge of several ends is held in place, as by a support.
    """

    ends: tuple[str, ...]
    grounded: bool

    def __init__(self, *ends: str, grounded: bool = False) -> None:
        object.__setattr__(self, "ends", ends)
        object.__setattr__(self, "grounded", bool(grounded) or len(ends) == 1)


@dataclass(frozen=True, init=False)
class Weld:
    """Rigid connection of ends: positions and all gradients, at the angles they have in the reference.

    Parameters
    ----------
    *ends : str
        Two or more. An end may be in several joints, as long as none repeats what others hold already.
    grounded : bool
        Whether its place is pinned to the ground, as where a continuous beam passes over a support.
    """

    ends: tuple[str, ...]
    grounded: bool

    def __init__(self, *ends: str, grounded: bool = False) -> None:
        object.__setattr__(self, "ends", ends)
        object.__setattr__(self, "grounded", bool(grounded))


@dataclass(frozen=True)
class Clamp:
    """An end fixed to the ground, or to a support there that turns: a driven clamp.

    Parameters
    ----------
    end : str
    angle : callable, optional
        t (s) → (θ, θ', θ'') in rad, rad/s, rad/s², from the reference direction, θ(0) = 0; fixed without it.
    """

    end: str
    angle: Angle | None = None

    @property
    def ends(self) -> tuple[str, ...]:
        """The one end it holds."""
        return (self.end,)

    @property
    def grounded(self) -> bool:
        """Always."""
        return True


Joint = Pin | Weld | Clamp
