"""What every solver answers with: times, fields over the bodies, energies, cost and status."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.scene import Probe, Scene

Array = NDArray[np.float64]


class Field(Protocol):
    """Motion of a body's axis, from its start to its end."""

    def position(self, fraction: float) -> Array:
        """Positions at a fraction of the undeformed length, (n, 2), m."""
        ...


@dataclass(frozen=True)
class HermiteField:
    """Axis of an ANCF body.

    Parameters
    ----------
    coordinates : ndarray, shape (n, nodes, 2 or 3, 2)
        r (m), r_x and, for the shear element, r_y of each node at each time.
    length : float
        Undeformed length of the body, m.
    """

    coordinates: Array
    length: float

    def position(self, fraction: float) -> Array:
        """Positions at a fraction of the undeformed length, (n, 2), m."""
        elements = self.coordinates.shape[1] - 1
        i = min(int(fraction * elements), elements - 1)
        x = fraction * elements - i
        l = self.length / elements  # noqa: E741
        q = self.coordinates
        return (
            (1.0 - 3.0 * x**2 + 2.0 * x**3) * q[:, i, 0]
            + l * (x - 2.0 * x**2 + x**3) * q[:, i, 1]
            + (3.0 * x**2 - 2.0 * x**3) * q[:, i + 1, 0]
            + l * (x**3 - x**2) * q[:, i + 1, 1]
        )

    def until(self, outputs: int) -> "HermiteField":
        """The first outputs."""
        return replace(self, coordinates=self.coordinates[:outputs])


@dataclass(frozen=True)
class LagrangeField:
    """Axis interpolated from equally spaced nodes: elements of `order` + 1 nodes each.

    Parameters
    ----------
    positions : ndarray, shape (n, elements * order + 1, 2)
        m.
    order : int
        1 or 2.
    """

    positions: Array
    order: int = 1

    def position(self, fraction: float) -> Array:
        """Positions at a fraction of the undeformed length, (n, 2), m."""
        elements = (self.positions.shape[1] - 1) // self.order
        i = min(int(fraction * elements), elements - 1)
        x = fraction * elements - i
        weights = (
            (1.0 - x, x) if self.order == 1 else ((1 - x) * (1 - 2 * x), 4 * x * (1 - x), x * (2 * x - 1))
        )
        first = i * self.order
        return sum(w * self.positions[:, first + k] for k, w in enumerate(weights))  # type: ignore[return-value]

    def until(self, outputs: int) -> "LagrangeField":
        """The first outputs."""
        return replace(self, positions=self.positions[:outputs])


@dataclass(frozen=True)
class Energy:
    """Energies at the output times, J, each (n,); NaN where a solver does not give one.

    kinetic + strain + potential − work is constant in the exact motion. `potential` is that of gravity and of
    constant forces, zero at t = 0; `work` is what drives, torques and forces that vary in time have done, less what
    damping took.
    """

    kinetic: Array
    strain: Array
    potential: Array
    work: Array

    @classmethod
    def unknown(cls, n: int) -> "Energy":
        """All NaN."""
        return cls(*(np.full(n, np.nan) for _ in range(4)))

    @property
    def balance(self) -> Array:
        """Energy that appeared from nowhere since t = 0, J, (n,): zero in the exact motion."""
        total = self.kinetic + self.strain + self.potential - self.work
        return total - total[:1]


@dataclass(frozen=True)
class Cost:
    """What a run cost.

    Parameters
    ----------
    cpu_s, wall_s : float
        Processor and wall time of the steps, s.
    steps, newton_iterations, factorizations : int
    build_s : float
        Processor time of all else that the call did, s: building the system before the steps, the answer after them.
    compile_s : float
        Processor time that the compiler took, s; it is in none of the others.
    """

    cpu_s: float = float("nan")
    wall_s: float = float("nan")
    steps: int = 0
    newton_iterations: int = 0
    factorizations: int = 0
    build_s: float = float("nan")
    compile_s: float = float("nan")


@dataclass(frozen=True)
class Status:
    """How a run ended.

    Parameters
    ----------
    code : str
        "ok": nothing known speaks against the answer. "diverged", "failed" or "interrupted": what was computed until
        then is kept.
        "inaccurate": the run is whole, but more than a tenth of its energy came from nowhere, or its fixed steps miss
        more than a tenth of a load or a drive that states its breaks. "imprecise": it is whole,
        but rounding leaves fewer digits than it should; the message says how many. "unsupported": nothing was done.
    message : str
        Why, and what to try.
    time : float, optional
        s, of the first step that failed.
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
        """Whether the run is whole."""
        return self.code == "ok"

    def __str__(self) -> str:
        return f"{self.code}: {self.message}" if self.message else self.code

    def __eq__(self, other: object) -> bool:
        return (
            self.code == other
            if isinstance(other, str)
            else self is other or (isinstance(other, Status) and vars(self) == vars(other))
        )

    def __hash__(self) -> int:
        return hash(self.code)


@dataclass(frozen=True)
class Solution:
    """A solver's answer.

    Parameters
    ----------
    solver : str
    scene : Scene
    run : Discretisation or None
    t : ndarray, shape (n,)
        0, output_dt, … t_end, s; cut short where the run did not end well. For statics the load factors.
    fields : mapping of body name to Field
    energy : Energy
    cost : Cost
    status : Status
    dofs : int
        Unknown coordinates of the discretised scene, as the solver counts them.
    stable : ndarray of bool, shape (n,), optional
        Of statics: whether each equilibrium is stable. None where that is not known, and of motions.
    """

    solver: str
    scene: Scene
    run: Discretisation | None
    t: Array
    fields: Mapping[str, Field]
    energy: Energy
    cost: Cost = field(default_factory=Cost)
    status: Status = field(default_factory=Status)
    dofs: int = 0
    stable: NDArray[np.bool_] | None = None

    def position(self, body: str, fraction: float) -> Array:
        """Positions of a material point of a body's axis, (n, 2), m.

        Parameters
        ----------
        body : str
        fraction : float
            Of the undeformed length from the body's start, in [0, 1].
        """
        name, fraction = self.scene.probe((body, fraction))
        if not self.fields:
            return np.empty((0, 2))
        return self.fields[name].position(fraction)

    def displacement(self, probe: Probe) -> Array:
        """Displacements of a probe from its place at the first output, (n, 2), m."""
        path = self.position(*self.scene.probe(probe))
        return path - path[:1]

    def until(self, outputs: int, status: Status) -> "Solution":
        """The first outputs, with the status that says why the others are left out."""
        fields = {
            name: field.until(outputs) if isinstance(field, HermiteField | LagrangeField) else field
            for name, field in self.fields.items()
        }
        energy = Energy(*(series[:outputs] for series in vars(self.energy).values()))
        stable = None if self.stable is None else self.stable[:outputs]
        return replace(self, t=self.t[:outputs], fields=fields, energy=energy, status=status, stable=stable)

    def with_cost(self, cost: Cost) -> "Solution":
        """The same solution with another cost."""
        return replace(self, cost=cost)


class Interrupted(KeyboardInterrupt):
    """A run that was stopped by Ctrl-C.

    Parameters
    ----------
    solution : Solution
        The history until then, with the status "interrupted".
    """

    def __init__(self, solution: Solution) -> None:
        super().__init__(solution.status.message)
        self.solution = solution


def interruption(when: float) -> Status:
    """The status of a run that Ctrl-C stopped at a time, s."""
    return Status("interrupted", f"the run was interrupted at t = {when:.6g} s", time=when)


def nothing(solver: str, scene: Scene, run: Discretisation | None, status: Status) -> Solution:
    """The answer of a solver that cannot do a scene: no history, and a status that says why."""
    return Solution(solver, scene, run, np.empty(0), {}, Energy.unknown(0), Cost(), status)


def in_short(history: Iterable[float]) -> str:
    """Sizes met in an iteration as text: all, or the first and the last few."""
    sizes = [f"{x:.1e}" for x in history if x > 0.0]
    return ", ".join(sizes if len(sizes) <= 8 else [*sizes[:4], "…", *sizes[-3:]]) or "none"
