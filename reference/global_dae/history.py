"""Time marching: state shared by both integrators, batches of steps, output, cost and status."""

from dataclasses import dataclass, replace
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import kinetic_energy, strain_energy
from anctmm.errors import PropertyError
from anctmm.jit.compiling import kernel
from anctmm.kernels.pacing import paced, part_by_part
from anctmm.model.topology import turning_bodies
from anctmm.results.checks.divergence import checked
from anctmm.results.ended_early import HistoryError, Interrupted, broken_off, interruption
from anctmm.results.fields import beam_field
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status, in_short
from reference.global_dae.loads import drive_table, load_table
from reference.global_dae.model import Model, Parts
from reference.global_dae.turning import Turned, at_starts, not_turned, with_angles

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Seconds that a step takes for each node, about; a dense solve takes DENSE for each entry of its matrix.
STEP, DENSE = 5e-6, 1e-8
#: Values above this have left the range in which energies can be formed.
HUGE = 1e60


class Motion(NamedTuple):
    """Coordinates and velocities, (rows, nodes) and flat in the same memory, and what goes with them.

    b, rate, acceleration (m, 2) are b, ḃ, b̈ of the constraints; trail the account of work done; work, (2,), all
    of it and that of damping; turned tells the angles of bodies.
    """

    q: Array
    v: Array
    flat_q: Array
    flat_v: Array
    b: Array
    rate: Array
    acceleration: Array
    trail: Array
    work: Array
    turned: Turned
    buffer: Array


def motion_of(model: Model, reference: Array) -> Motion:
    """The motion at t = 0; `reference` (m, 2) is the value of the constraints there."""
    q, v = model.bodies.reference(), model.bodies.initial_velocity()
    entries = len(model.loads.place) + sum(row.drive >= 0 for row in model.joints)
    zeros = np.zeros_like(reference)
    trail = np.zeros((entries, 4))
    flat, places = q.reshape(-1), at_starts(model.bodies, turning_bodies(model.scene))
    return Motion(
        q, v, flat, v.reshape(-1), reference.copy(), zeros, zeros.copy(), trail, np.zeros(2),
        not_turned(places, flat), model.bodies.buffer(),
    )  # fmt: skip


@kernel
def keep(parts: Parts, m: Motion, a: Array, k: int, kept: Array, energies: Array, angles: Array) -> None:
    """Store coordinates, velocities and accelerations a (flat), kept[k, 0 … 2], energies and angles as output k."""
    nodes = m.q.shape[1]
    for n in range(m.q.shape[0]):
        for i in range(m.q.shape[1]):
            kept[k, 0, n, i], kept[k, 1, n, i], kept[k, 2, n, i] = m.q[n, i], m.v[n, i], a[n * nodes + i]
    energies[k, 0] = kinetic_energy(m.v, parts.first, parts.masses)
    energies[k, 1] = strain_energy(parts.formulations, m.q, parts.first, parts.kinds, parts.constants)
    potential = 0.0
    for i in range(m.flat_q.size):
        potential -= parts.dead[i] * (m.flat_q[i] - parts.reference[i])
    energies[k, 2] = potential
    energies[k, 3], energies[k, 4] = m.work[0], 0.0 - m.work[1]
    for n in range(angles.shape[1]):
        angles[k, n] = m.turned.angles[n]


@dataclass
class Reached:
    """How far a batch came.

    Parameters
    ----------
    step : int
        The batch's end, or the step that failed.
    outputs : int
        Outputs stored.
    node : int
        Where it failed; −1 if it did not.
    why : str
        What failed.
    residuals : tuple of float
        Of Newton's iteration that failed, N.
    """

    step: int
    outputs: int
    node: int = -1
    why: str = ""
    residuals: tuple[float, ...] = ()


class Acting(NamedTuple):
    """Loads, (steps, loads, 2), and drives, (steps, drives, 3), at the times of steps, from the first of a batch on."""

    loads: Array
    drives: Array


class Outputs(NamedTuple):
    """What a batch keeps: the steps wanted, ascending, from the first one not yet kept, and −1 at their end.

    states: coordinates, velocities and accelerations, (outputs, 3, rows, nodes); energies, (outputs, 5); angles of the
    bodies whose turns are counted, (outputs, bodies).
    """

    wanted: Ints
    states: Array
    energies: Array
    angles: Array

    def after(self, count: int) -> "Outputs":
        """Those behind the first ones."""
        return Outputs(self.wanted[count:], *(room[count:] for room in self[1:]))


class Marcher:
    """A model marched in time; integrators fill in `prepare`, `begin` and `batch`."""

    advice = ""
    #: Whether a dense matrix is solved at each step.
    dense = False

    def __init__(self, model: Model) -> None:
        self.model = model
        self.newton_iterations = 0
        self.factorizations = 0

    def prepare(self) -> None:
        """Set up what stays the same from run to run: patterns, order, constant factors; and the state at t = 0."""
        raise NotImplementedError

    def begin(self) -> None:
        """Set the state to t = 0 once more."""
        raise NotImplementedError

    def batch(self, first: int, last: int, acting: Acting, out: Outputs) -> Reached:
        """Do steps first … last − 1 (step 0 is the start); loads and drives are given from step `first` on."""
        raise NotImplementedError

    def run(self, solver: str) -> Solution:
        """March to the end, or as far as it goes."""
        run = self.model.run
        wanted = np.append(run.output_steps, -1).astype(np.int64)
        kept = np.zeros((len(wanted) - 1, 3, self.model.bodies.rows, self.model.bodies.nodes))
        energies = np.zeros((len(kept), 5))
        self.prepare()
        turning = turning_bodies(self.model.scene)
        out = Outputs(wanted, kept, energies, np.zeros((len(kept), len(turning))))
        self.batch(0, 0, self._tables(0, 0), out)  # compiles
        self.begin()
        start = process_time(), perf_counter()  # what is set up is no cost of steps, here as in ANC-TMM
        step, count = 0, 0
        ended: Status | None = None

        def so_far(status: Status) -> Solution:
            cost = Cost(
                process_time() - start[0],
                perf_counter() - start[1],
                min(step, run.steps),
                self.newton_iterations,
                self.factorizations,
            )
            t = run.times(wanted[:count])
            q, v, a = kept[:count, 0], kept[:count, 1], kept[:count, 2]
            found = solution(solver, self.model, t, q, energies[:count], cost, status, v, a)
            return replace(found, fields=with_angles(found.fields, turning, out.angles[:count]))

        def part(first: int, last: int) -> None:
            nonlocal step, count, ended
            if ended is not None:
                return
            reached = self.batch(first, last, self._tables(first, min(last, run.steps)), out.after(count))
            count += reached.outputs
            step = reached.step
            ended = None if reached.node < 0 else self._diverged(reached)

        for first, last in paced(run.steps + 1, self._estimate(), self._width()):
            try:
                part(first, last)
            except KeyboardInterrupt:
                raise Interrupted(so_far(interruption(self._time(first)))) from None
            except PropertyError as error:  # of a load or a drive
                begun, own = part_by_part(part, first, last, PropertyError)
                if ended is None:
                    raise HistoryError(so_far(broken_off(own or error, self._time(begun)))) from error
            if ended is not None:
                return so_far(ended)
        return so_far(Status())

    def _time(self, step: int) -> float:
        """Time of a step, s."""
        return float(self.model.run.times(np.array([step]))[0])

    def _estimate(self) -> float:
        """Seconds that a step takes, about."""
        nodes = self.model.bodies.nodes
        return STEP * nodes + (DENSE * self.model.dofs**2 if self.dense else 0.0)

    def _width(self) -> int:
        """Numbers tabulated for each step."""
        loads, drives = self._tables(0, 0)
        return int(loads[0].size + drives[0].size)

    def _tables(self, first: int, last: int) -> Acting:
        t = self.model.run.times(np.arange(first, last + 1))
        return Acting(load_table(self.model.scene, t), drive_table(self.model.scene, t))

    def _diverged(self, reached: Reached) -> Status:
        t = float(self.model.run.times(np.array([reached.step]))[0])
        body, element = self.model.bodies.element_at(reached.node)
        history = f", residuals {in_short(reached.residuals)} N" if reached.residuals else ""
        message = (
            f"{reached.why} at t = {t:.6g} s (step {reached.step}), body {body!r}, element {element}{history}: "
            f"{self.advice}"
        )
        return Status("diverged", message, t, reached.step, body, element, reached.residuals)


def solution(
    solver: str,
    model: Model,
    t: Array,
    kept: Array,
    energies: Array,
    cost: Cost,
    status: Status,
    *rates: Array,
) -> Solution:
    """The answer made of stored coordinates (n, rows, nodes) and energies (n, 5), as far as it is valid.

    `rates` are velocities and accelerations, like coordinates; without them it is a static one.
    """
    series = [model.bodies.by_body(x) for x in (kept, *rates)]
    fields = {
        name: beam_field(
            model.bodies.mesh(name).kind, model.scene.beam(name), q, *(x[name] for x in series[1:])
        )
        for name, q in series[0].items()
    }
    energy = Energy(*(column.copy() for column in energies.T))
    found = Solution(
        solver, model.scene, model.run, t, fields, energy, cost, status, model.dofs, static=not rates
    )
    return checked(found, static=not rates)
