"""The compiled solver: beams and point masses with pins, welds, clamps and guides of the ground, without connectors.

All that stays the same is prepared by the plain description of the scene: constraints J q = b(t) with a constant J,
mass, dead forces. Explicit steps solve with one factorization, Newton's matrix is assembled into a fixed pattern and
factored in place when its corrections fall slowly.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.discretise.methods import GeneralizedAlpha
from anctmm.errors import PropertyError
from anctmm.model.drives import tabulate
from anctmm.model.topology import turning_bodies
from anctmm.results.ended_early import HistoryError, Interrupted, broken_off, interruption
from anctmm.results.solution import Cost, Solution
from anctmm.results.status import Status
from reference.global_dae.beams import Matrix
from reference.global_dae.constraints import Constraints, Drive
from reference.global_dae.elements import elements_of
from reference.global_dae.loads import LoadForce, Moment, PointForce
from reference.global_dae.lu import Pattern, choose, factorise, no_factors
from reference.global_dae.marching import Failure, answer, failed_step, turning_coordinates
from reference.global_dae.saddle import Nearest, Saddle, independent_rows
from reference.global_dae.steps import (
    ITERATIONS,
    Equations,
    Loads,
    Motion,
    NewtonMatrix,
    Outputs,
    Rows,
    Scheme,
    Tables,
    assemble,
    explicit_steps,
    implicit_steps,
)
from reference.global_dae.system import System
from reference.global_dae.vectors import QUARTER

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

NO_PATTERN = Pattern(*np.zeros((3, 0), dtype=np.uint32))
#: Seconds between two chances to interrupt a run, and steps tabulated at once at most.
PAUSE, MOST = 0.1, 4_096


def has(system: System) -> bool:
    """Whether it has all features of a scene, and the integrator."""
    layout, c = system.layout, system.constraints
    return (
        layout.run.integrator != "esdirk"
        and bool(layout.meshes)
        and not system.connectors
        and c.constant
        and len(independent_rows(c.jacobian(layout.reference, c.parameters(0.0)), layout.unit)) == c.count
        and all(_simple(load) for load in system.loads)
    )


def _simple(load: LoadForce) -> bool:
    """Whether a load is a force on a linear place that does not turn, or a moment on one vector of a node."""
    return isinstance(load, PointForce) or (isinstance(load, Moment) and len(load.at) == 2)


def marched(system: System, solver: str, dense: bool, projected: bool) -> Solution:
    """Motion of a scene; `dense`: whether matrices are dense, and factored at each step."""
    return Rival(system, dense, projected).march(solver)


@dataclass
class Reached:
    """Step that a batch has come to, outputs stored, and why it ended there; empty if it is the batch's end."""

    step: int
    outputs: int
    why: str = ""


class Rival:
    """One scene, prepared."""

    def __init__(self, system: System, dense: bool, projected: bool) -> None:
        self.system, self.layout, self.run = system, system.layout, system.layout.run
        c = system.constraints
        self.J = c.jacobian(self.layout.reference, c.parameters(0.0))
        self.drives = list(dict.fromkeys(row.drive for row in c.rows if row.drive is not None))
        self.n, self.m, self.dense = system.size, c.count, dense
        self.full = np.zeros((self.n + self.m,) * 2) if dense else None
        run, h = self.run, self.run.exact_dt
        alpha = GeneralizedAlpha(run.spectral_radius).of_step(h)
        self.scheme = Scheme(
            h, run.psi, run.phi, projected, dense, alpha.alpha_m, alpha.alpha_f, alpha.beta, alpha.gamma, alpha.to_w,
            alpha.gamma / (alpha.beta * h), run.newton_tolerance,
        )  # fmt: skip
        self.elements = elements_of(
            list(self.layout.meshes.values()), 0.0 if run.explicit else self.scheme.by_v
        )
        self.loads = loads_of(system.loads)
        self.scale = float(system.mass.diagonal().mean())
        if run.explicit:
            self._prepare_explicit()
        else:
            self._prepare_implicit()
        self.begin()

    def begin(self) -> None:
        """Set the state to t = 0."""
        layout, c = self.layout, self.system.constraints
        q, p = layout.reference.copy(), c.parameters(0.0)
        v = layout.velocity - Nearest(self.J)(self.J @ layout.velocity + c.rate(q, p))
        places = turning_coordinates(layout, turning_bodies(layout.scene))
        n, m = self.n, self.m
        self.motion = Motion(  # type: ignore[call-arg]
            q, v, np.zeros(n), np.zeros(n), np.zeros(m), *np.zeros((3, n)), *np.zeros((4, n + m)),
            *np.zeros((3, n)), *np.zeros((3, m)), np.zeros((len(self.loads.torque) + len(self.drives), 4)),
            np.zeros(2), places, q[places], np.zeros(len(places)), np.zeros(6, dtype=np.int64), layout.unit,
            np.zeros(ITERATIONS),
        )  # fmt: skip
        if not self.run.explicit:
            force = self.system.force(q, v, 0.0) + self.system.beams.damping(q, v)
            a, mu = Saddle(self.system.mass, self.J).solve(force, c.right(q, v, p))
            self.motion.a[:], self.motion.auxiliary[:], self.motion.mu[:] = a, a, mu / self.scale
            self.motion.damping[:] = self.system.beams.damping(q, v)

    def march(self, solver: str) -> Solution:
        """To the end, or as far as it goes."""
        run, wanted = self.run, np.append(self.run.output_steps, -1)
        turning = turning_bodies(self.layout.scene)
        out = Outputs(
            wanted, np.zeros((len(wanted) - 1, 3, self.n)), np.zeros((len(wanted) - 1, 2)),
            np.zeros((len(wanted) - 1, len(turning))),
        )  # fmt: skip
        self._batch(0, 0, self._tables(0, 0), out)  # compiles
        start = process_time(), perf_counter()
        step = count = 0
        status = Status()

        def so_far(status: Status) -> Solution:
            counts = self.motion.counts
            factorizations = 1 if run.explicit and not self.dense else int(counts[1])
            spent = process_time() - start[0], perf_counter() - start[1]
            cost = Cost(*spent, max(min(step, run.steps + 1) - 1, 0), int(counts[0]), factorizations)
            return self._answer(solver, out, count, cost, status, turning)

        try:
            batch = 16
            while step <= run.steps and status.ok:
                last = min(step + batch, run.steps + 1)
                began = perf_counter()
                tables, error = self._known_tables(step, last)
                reached = self._batch(step, step + len(tables.loads), tables, out.after(count))
                step, count = reached.step, count + reached.outputs
                if reached.why:
                    status = self._diverged(reached)
                elif error is not None:
                    raise error
                batch = min(MOST, 2 * batch) if perf_counter() - began < PAUSE else batch
        except KeyboardInterrupt:
            raise Interrupted(so_far(interruption(self._time(max(step - 1, 0))))) from None
        except PropertyError as error:  # of a load or a drive
            raise HistoryError(so_far(broken_off(error, self._time(max(step - 1, 0))))) from error
        return so_far(status)

    # --- preparation ---------------------------------------------------------------------------------------

    def _prepare_explicit(self) -> None:
        """Factors of [M sJᵀ; sJ 0]: of vectors where no row mixes x and y, else of components."""
        full = Saddle(self.system.mass, self.J).matrix
        scalar = separated(self.system.mass, self.J)
        places = np.arange(self.n + self.m)[:, None]
        self.constant = full.indptr.astype(np.uint32), full.indices.astype(np.uint32), full.data
        if self.dense:
            self.factors = no_factors(places)
        elif scalar is not None:
            self.factors = factorise(Saddle(*scalar).matrix, places.reshape(-1, 2))
            self.scale = float(scalar[0].diagonal().mean())
        else:
            self.factors = factorise(full, places)
        self.rows = rows_of(self.system.constraints, self.J, self.drives, self.scale)
        self.matrix, self.pattern = newton_matrix(self.system, self.J, self.scale), NO_PATTERN

    def _prepare_implicit(self) -> None:
        """Pattern of Newton's matrix, with the order and the pivots of the undeformed scene."""
        system, s = self.system, self.scheme
        K = system.tangents(self.layout.reference, system.still, 0.0, by_velocity=s.by_v)
        self.scale = float(np.abs((s.by_a * system.mass + K).diagonal()).mean())
        self.rows = rows_of(system.constraints, self.J, self.drives, self.scale)
        self.matrix = newton_matrix(system, self.J, self.scale)
        self._choose_pivots(self.layout.reference, np.zeros((len(self.loads.torque), 2)))

    def _choose_pivots(self, q: Array, loads: Array) -> None:
        places, matrix = np.arange(self.n + self.m)[:, None], self.matrix
        assemble(matrix, self.scheme.by_a, self.elements, self.loads, loads, q)
        self.constant = matrix.column, matrix.row, matrix.data
        if self.dense:
            self.pattern, self.factors = NO_PATTERN, no_factors(places)
        else:
            data = matrix.data[: len(matrix.row)].copy()
            where = matrix.row.astype(np.int64), matrix.column.astype(np.int64)
            A = Matrix((data, *where), shape=(self.n + self.m,) * 2)
            self.pattern, self.factors = choose(A, places)

    # --- batches -------------------------------------------------------------------------------------------

    def _batch(self, first: int, last: int, tables: Tables, out: Outputs) -> Reached:
        """Do steps first … last − 1 (step 0 is the start)."""
        counts = self.motion.counts
        equations = Equations(
            self.scheme, self.elements, self.rows, self.loads, self.system.dead, self.factors, self.constant,
            self.matrix, self.pattern, self.motion,
        )  # fmt: skip
        if self.run.explicit:
            span = first, last, self.run.steps
            step, outputs = explicit_steps(equations, tables, out, span, self.full)
            return Reached(step, outputs, "" if step == last else "accelerations are not finite")
        start, outputs, repivoted = first, 0, -1
        while True:
            rest = Tables(*(table[start - first :] for table in tables))
            equations = equations._replace(factors=self.factors, pattern=self.pattern)
            code = implicit_steps(equations, rest, out.after(outputs), (start, last), self.full)
            start, outputs = int(counts[4]), outputs + int(counts[5])
            if code == 0:
                return Reached(start, outputs)
            if code == 1 or start == repivoted:
                return Reached(
                    start,
                    outputs,
                    "Newton's iteration does not converge" if code == 1 else "the tangent is singular",
                )
            repivoted = start
            self._choose_pivots(self.motion.q, tables.loads[start - first])

    def _known_tables(self, first: int, last: int) -> tuple[Tables, PropertyError | None]:
        """Tables of steps first … last − 1, or of those before the one at which a history fails, and its error."""
        try:
            return self._tables(first, last), None
        except PropertyError as error:
            for n in range(first, last):
                try:
                    self._tables(n, n + 1)
                except PropertyError as own:
                    return self._tables(first, n), own
            return self._tables(first, first), error

    def _tables(self, first: int, last: int) -> Tables:
        """Values of loads and drives at steps; one more for the drives of explicit steps, which look ahead."""
        t = self.run.times(np.arange(first, last))
        ahead = self.run.times(np.minimum(np.arange(first, last + 1), self.run.steps))
        return Tables(load_table(self.system.loads, t), drive_table(self.drives, ahead))

    def _time(self, step: int) -> float:
        return float(self.run.times(np.array([step]))[0])

    def _diverged(self, reached: Reached) -> Status:
        m = self.motion
        residuals = m.residuals[m.residuals > 0.0].tolist() if not self.run.explicit else ()
        change = np.zeros(self.n)
        change[int(m.counts[2])] = 1.0
        failure = Failure(reached.why, m.force if self.run.explicit else change, residuals)
        advice = (
            "take a smaller dt, or a coarser mesh, or an implicit integrator"
            if self.run.explicit
            else "take a smaller dt, a coarser mesh, more damping (spectral_radius) or a larger newton_tolerance"
        )
        return failed_step(self.layout, failure, reached.step, self._time(reached.step), advice)

    def _answer(
        self, solver: str, out: Outputs, count: int, cost: Cost, status: Status, turning: list[str]
    ) -> Solution:
        q, v, a = out.states[:count].transpose(1, 0, 2)
        system, energies = self.system, np.zeros((count, 5))
        with np.errstate(all="ignore"):  # of a run that has diverged, numbers may be too large
            energies[:, 1] = system.beams.energy(q)
        energies[:, 0] = 0.5 * np.einsum("ni,ni->n", v, (system.mass @ v.T).T)
        energies[:, 2] = -(q - self.layout.reference) @ system.dead
        energies[:, 3], energies[:, 4] = out.work[:count, 0], 0.0 - out.work[:count, 1]
        t = self.run.times(out.wanted[:count])
        return answer(
            self.layout, solver, t, (q, v, a), energies, cost, status, (turning, out.angles[:count])
        )


# --- tables of the kernels ------------------------------------------------------------------------------------


def rows_of(c: Constraints, J: sparse.csr_array, drives: list[Drive], scale: float) -> Rows:
    """Constraints J q = b(t), b = base + cos p along + sin p across + p shift, p of the row's drive."""
    base, along, across = c.targets.copy(), *np.zeros((2, c.count))
    for j, row in enumerate(c.rows):
        for term in row.terms:
            one, two = term.one.constant, term.two.constant
            if term.turned:
                along[j] -= one @ term.Q @ two
                across[j] -= one @ QUARTER @ term.Q @ two
            else:
                base[j] -= one @ term.Q @ two
    number = [-1 if row.drive is None else drives.index(row.drive) for row in c.rows]
    gram = Matrix(J @ J.T)
    return Rows(  # type: ignore[call-arg]
        J.indptr.astype(np.uint32), J.indices.astype(np.uint32), J.data.copy(), np.array(number, dtype=np.int64),
        base, along, across, c.along.copy(), factorise(gram, np.arange(c.count)[:, None]),
        *np.zeros((3, c.count)), scale,
    )  # fmt: skip


def loads_of(loads: list[LoadForce]) -> Loads:
    """Loads that vary or turn, each on a sum of vectors."""
    parts: list[tuple[Ints, Array]] = []
    for load in loads:
        if isinstance(load, PointForce):
            parts.append((load.place.at[::2], load.place.A[0, ::2]))
        else:
            parts.append((load.at[:1], np.ones(1)))
    first = np.cumsum([0, *(len(at) for at, _ in parts)])
    at = np.concatenate([np.zeros(0, dtype=np.int64), *(at for at, _ in parts)])
    weight = np.concatenate([np.zeros(0), *(weights for _, weights in parts)])
    return Loads(np.array([isinstance(load, Moment) for load in loads], dtype=bool), first, at, weight)


def load_table(loads: list[LoadForce], t: Array) -> Array:
    """Values of loads at times, (n, loads, 2): force, or moment and 0."""
    table = np.zeros((len(t), len(loads), 2))
    for k, load in enumerate(loads):
        value: Any = load.load.value
        table[:, k, : load.width] = tabulate(load.name, value, t, load.width) if callable(value) else value
    return table


def drive_table(drives: list[Drive], t: Array) -> Array:
    """cos p, sin p, p, p' and p'' of drives at times, (n, drives, 5)."""
    table = np.zeros((len(t), len(drives), 5))
    for k, drive in enumerate(drives):
        p = tabulate(drive.name, drive.history, t, 3)
        table[:, k, 0], table[:, k, 1], table[:, k, 2:] = np.cos(p[:, 0]), np.sin(p[:, 0]), p
    return table


def separated(M: Matrix, J: sparse.csr_array) -> tuple[Matrix, sparse.csr_array] | None:
    """m and j with M = m ⊗ I₂ and J = j ⊗ I₂: one matrix then serves x and y; None where J mixes them."""
    if J.shape[0] % 2:
        return None
    m, j = Matrix(M[::2, ::2]), sparse.csr_array(J[::2, ::2])
    same = abs(sparse.kron(j, np.eye(2)) - J).max() if J.shape[0] else 0.0
    return (m, j) if same == 0.0 else None


def newton_matrix(system: System, J: sparse.csr_array, scale: float) -> NewtonMatrix:
    """Pattern and constant numbers of [c M + K, sJᵀ; sJ, 0]."""
    n, m = system.size, J.shape[0]
    meshes = system.layout.meshes.values()
    blocks = [start + np.arange(4 * mesh.vectors) for mesh in meshes for start in mesh.starts]
    rows = np.concatenate([np.repeat(at, len(at)) for at in blocks])
    columns = np.concatenate([np.tile(at, len(at)) for at in blocks])
    moments = [load.at for load in system.loads if isinstance(load, Moment)]
    pairs = [(at[[0, 0, 1, 1]], at[[0, 1, 0, 1]]) for at in moments]
    where = (
        tuple(np.concatenate([np.zeros(0, dtype=np.int64), *part]) for part in zip(*pairs, strict=True))
        if pairs
        else None
    )
    ones = (
        Matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)) + sparse.eye_array(n) + abs(system.mass)
    )
    none = sparse.csr_array((m, m))
    full = Matrix(sparse.block_array([[ones, abs(J).T], [abs(J), none]], format="csc")) if m else Matrix(ones)
    full.sort_indices()
    place = _finder(full)

    def numbers(A: Any) -> Array:
        entries, data = sparse.coo_array(A), np.zeros(full.nnz)
        data[place(entries.row, entries.col)] = entries.data
        return data

    zero = Matrix((n, n))
    mass_blocks: list[list[Any]] = [[system.mass, None], [None, none]]
    joint_blocks: list[list[Any]] = [[zero, scale * J.T], [scale * J, none]]
    mass = numbers(sparse.block_array(mass_blocks) if m else system.mass)
    joints = numbers(sparse.block_array(joint_blocks) if m else zero)
    return NewtonMatrix(
        full.indptr.astype(np.uint32), full.indices.astype(np.uint32), mass, joints, place(rows, columns),
        np.zeros(0, dtype=np.int64) if where is None else place(*where), np.zeros(full.nnz),
    )  # fmt: skip


def _finder(A: Matrix) -> Callable[[Any, Any], Ints]:
    """Places of entries in the numbers of a sorted matrix."""
    keys = np.repeat(np.arange(A.shape[1]), np.diff(A.indptr)) * A.shape[0] + A.indices
    return lambda row, column: np.searchsorted(keys, np.asarray(column, dtype=np.int64) * A.shape[0] + row)
