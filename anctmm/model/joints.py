"""Joints: what holds ends of bodies together, or to the ground."""

from dataclasses import dataclass
from typing import final

from anctmm.errors import PropertyError, UnknownNameError, shown
from anctmm.model.drives import Angle, breaks_of, value_at
from anctmm.validation import flag

#: Sides of a body, as the names of its ends have them.
SIDES = ("start", "end")
END_NEEDED = "allowed is 'name.start' or 'name.end'"


def end_name(end: object) -> str:
    """Return the name of a body's end as a plain string.

    Raises
    ------
    UnknownNameError
        If it is no string.
    """
    if not isinstance(end, str):
        raise UnknownNameError(f"end {shown(end)} is not a body's end; {END_NEEDED}")
    return str.__str__(end)


@final
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
        object.__setattr__(self, "ends", tuple(map(end_name, ends)))
        object.__setattr__(self, "grounded", flag("pin grounded", grounded) or len(ends) == 1)


@final
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
        object.__setattr__(self, "ends", tuple(map(end_name, ends)))
        object.__setattr__(self, "grounded", flag("weld grounded", grounded))


@final
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

    def __post_init__(self) -> None:
        object.__setattr__(self, "end", end_name(self.end))
        if self.angle is not None and not callable(self.angle):
            raise PropertyError(
                f"clamp {shown(self.end)} angle is {shown(self.angle)}; "
                f"None or a callable t -> (θ, θ', θ'') is allowed"
            )

    @property
    def ends(self) -> tuple[str, ...]:
        """The one end it holds."""
        return (self.end,)

    @property
    def grounded(self) -> bool:
        """Always."""
        return True


Joint = Pin | Weld | Clamp
#: All kinds. None may be a subclass of another: solvers tell them apart by their class.
JOINTS = (Pin, Weld, Clamp)

#: Angle of a driven clamp at t = 0 that counts as none, rad.
NO_TURN = 1e-12


def check_angle(clamp: Clamp) -> None:
    """Refuse a clamp whose angle gives nothing, or is not zero, at t = 0.

    Raises
    ------
    PropertyError
    """
    if clamp.angle is None:
        return
    breaks_of(f"clamp {shown(clamp.end)} angle", clamp.angle)
    start = float(value_at(f"clamp {shown(clamp.end)} angle", clamp.angle, 0.0, 3)[0])
    if abs(start) > NO_TURN:
        raise PropertyError(
            f"clamp {shown(clamp.end)} angle is {start!r} rad at t = 0; 0 is needed: it turns from the reference"
        )
