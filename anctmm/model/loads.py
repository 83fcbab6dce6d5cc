"""Loads: forces and moments on places of bodies, and along beams."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import UnknownKindError, shown
from anctmm.model.accepted import LoadKind, Point
from anctmm.model.drives import breaks_of, tabulate
from anctmm.model.places import Graph, Written, written
from anctmm.validation import flag, number, text, vector


@final
@dataclass(frozen=True)
class Force(LoadKind):
    """Force on a place: constant (Fx, Fy) or t → (Fx, Fy), N; three components in space.

    Parameters
    ----------
    end : place
    value : (float, float) or callable
    follower : bool
        Whether the force rotates with the place; its components are then those in the reference configuration.
        Default: a dead force.
    """

    end: Written
    value: Point | Callable[[Any], Point]
    follower: bool = False

    @property
    def features(self) -> dict[str, bool]:
        return {"follower-forces": self.follower}

    @property
    def places(self) -> tuple[Written, ...]:
        """The place it acts on."""
        return (self.end,)

    def misfit(self, scene: Any) -> str:
        turns = scene.dim == 3 and self.follower
        return "is a follower; forces of fixed direction are allowed in space" if turns else ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "end", written(self.end))
        object.__setattr__(self, "follower", flag(f"{load_text(self)} follower", self.follower))
        if not callable(self.value):
            object.__setattr__(self, "value", vector(f"{load_text(self)} (N)", self.value, dims=(2, 3)))
        breaks_of(load_text(self), self.value)


@final
@dataclass(frozen=True)
class Torque(LoadKind):
    """Moment on a place, positive counter-clockwise: constant or t → moment, N m.

    It acts on the direction of the section: on r_x of a cable (whose section stays normal to its axis), on
    r_y of a shear-deformable element.
    """

    end: Written
    value: float | Callable[[Any], float]

    @property
    def places(self) -> tuple[Written, ...]:
        """The place it acts on."""
        return (self.end,)

    def __post_init__(self) -> None:
        object.__setattr__(self, "end", written(self.end))
        if not callable(self.value):
            object.__setattr__(self, "value", number(f"{load_text(self)} (N m)", self.value))
        breaks_of(load_text(self), self.value)


@final
@dataclass(frozen=True)
class LineLoad(LoadKind):
    """Dead force along a whole beam, per undeformed length: constant (qx, qy) or t → (qx, qy), N/m."""

    body: str
    value: Point | Callable[[Any], Point]

    in_space = True
    features: ClassVar[dict[str, bool]] = {"line-loads": True}

    def __post_init__(self) -> None:
        object.__setattr__(self, "body", text("line load body", self.body))
        if not callable(self.value):
            object.__setattr__(self, "value", vector(f"{load_text(self)} (N/m)", self.value, dims=(2, 3)))
        breaks_of(load_text(self), self.value)


Load = Force | Torque | LineLoad
#: All kinds. None may be a subclass of another: solvers distinguish them by class.
LOADS = (Force, Torque, LineLoad)


def load_text(load: Load) -> str:
    """A load as messages name it."""
    kind = {Force: "force", Torque: "torque", LineLoad: "line load"}[type(load)]
    return f"{kind} on {shown(load.body if isinstance(load, LineLoad) else load.end)}"


def tabulated(loads: Sequence[Load], t: NDArray[np.float64], dim: int = 2) -> NDArray[np.float64]:
    """Values of loads at times (s): force (x, y), N or N/m, or moment and 0, N m; (times, loads, dim)."""
    table = np.zeros((len(t), len(loads), dim))
    for i, load in enumerate(loads):
        width = width_of(load, dim)
        if callable(load.value):
            table[:, i, :width] = tabulate(load_text(load), load.value, t, width)
        else:
            table[:, i, :width] = load.value
    return table


def width_of(load: Load, dim: int = 2) -> int:
    """Numbers that the value of a load has, in the plane or in space of `dim` components."""
    return 1 if isinstance(load, Torque) else dim


def varies(load: Load) -> bool:
    """Whether the generalized force of a load changes."""
    return isinstance(load, Torque) or callable(load.value) or (isinstance(load, Force) and load.follower)


def check_load(scene: Graph, load: Load) -> None:
    """Refuse a load that does not fit the scene, or whose history gives nothing at t = 0."""
    if isinstance(load, LineLoad):
        scene.beam(load.body)
    else:
        place = scene.place(load.end)
        if not place.turns and (isinstance(load, Torque) or load.follower):
            raise UnknownKindError(
                f"{load!r} acts on the point mass {place.body.name!r}, which does not turn; "
                f"a dead Force is allowed there"
            )
    if callable(load.value):
        tabulate(load_text(load), load.value, np.zeros(1), width_of(load, scene.dim))
