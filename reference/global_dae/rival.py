"""The compiled solver: beams and point masses with pins, welds, clamps and guides of the ground, without connectors.

All that stays the same is prepared by the plain description of the scene: constraints J q = b(t) with a constant J,
mass, dead forces. Explicit steps solve with one factorization, Newton's matrix is assembled into a fixed pattern and
factored in place when its corrections fall slowly. Compiled steps store every state of a batch; work, whole turns and
outputs are found from these.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.errors import PropertyError
from anctmm.model.drives import tabulate
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from reference.global_dae import integrators, steps
from reference.global_dae.constraints import Constraints
from reference.global_dae.elements import Matrix
from reference.global_dae.factors import factorise, index
from reference.global_dae.forces import LoadForce
from reference.global_dae.marching import Record, ended_early, failed_step
from reference.global_dae.saddle import Failure
from reference.global_dae.steps import Loads, Rows, Tables
from reference.global_dae.system import System

Array = NDArray[np.float64]

#: Numbers that the steps of a batch store of each series, and steps of a batch at most.
ROOM, MOST = 200_000, 4_096


def has(system: System) -> bool:
    """Whether it has all features of a scene, and the integrator."""
    c = system.constraints
    J = c.jacobian(system.layout.reference, c.parameters(0.0)) if c.constant else None
    return (
        system.run.integrator != "esdirk"
        and bool(system.layout.meshes)
        and not system.connectors
        and all(map(_simple, system.loads))
        and J is not None
        and _gram(J)[1]
    )


def _simple(load: LoadForce) -> bool:
    """Whether a load is a force on a linear place that does not turn, or a moment on one vector of a node."""
    return not load.follower and (not load.torque or len(load.vectors[0].at) == 2)


def _gram(J: sparse.csr_array) -> Any:
    """Factors of J Jᵀ, and whether its rows are independent."""
    return factorise(Matrix(J @ J.T), J.shape[0], np.arange(J.shape[0])[:, None])


class Rival:
    """One scene, prepared; `dense`: whether matrices are dense, and factored at each step."""

    def __init__(self, system: System, dense: bool) -> None:
        self.system, self.run = system, system.run
        self.n, self.m = system.size, system.constraints.count
        judge = integrators.GeneralizedAlpha(system)
        start, run, by_v = judge.begin(), system.run, 0.0 if system.run.explicit else judge.slopes.by_v
        A = system.mass if run.explicit else judge.matrix(start, 0.0, judge.slopes)
        self.scale = float(np.abs(A.diagonal()).mean())
        J = system.constraints.jacobian(start.q, start.p)
        size, matrix = self.n + self.m, saddle_of(system, J, self.scale)
        room = steps.Room(  # type: ignore[call-arg]
            *np.zeros((3, self.n)), *np.zeros((2, size)), np.zeros((size if dense else 0,) * 2),
            system.layout.unit, np.array([0, int(run.explicit), 0]),
        )  # fmt: skip
        self.equations = steps.Equations(
            steps.Scheme(
                judge.h, run.psi, run.phi, judge.c, by_v, run.newton_tolerance, dense, self.scale
            ),
            system.beams.elements,
            Rows(index(J.indptr), index(J.indices), J.data.copy(), _gram(J)[0], *np.zeros((2, self.m))),
            loads_of(system.loads), system.dead, factorise(Matrix((0, 0)), 0, np.zeros((0, 1), dtype=np.int64))[0],
            matrix, room,
        )  # fmt: skip
        if run.explicit:
            matrix.data[:] = matrix.mass + matrix.joints
        else:
            steps.assemble(self.equations, np.zeros((len(system.loads), 2)), start.q)
        if not dense:
            self.equations = self.equations._replace(factors=self._factors(matrix))
        rows = system.constraints.rows
        self.turned = [j for j, row in enumerate(rows) if row.drive is not None]
        self.driven = Constraints([rows[j] for j in self.turned], self.n)
        self.base = -system.constraints.value(system.still, start.p)
        self.work = np.zeros((1, 2))
        power = system.beams.damping(start.q, start.v) @ start.v
        self.start = start.q, start.v, start.a, start.a, start.mu / self.scale, power

    def _factors(self, matrix: steps.Saddle) -> Any:
        """Factors in the reference: one matrix serves x and y where explicit steps do not mix them."""
        size = self.n + self.m
        pattern = matrix.row.astype(np.int64), matrix.column.astype(np.int64)
        whole = Matrix((matrix.data.copy(), *pattern), shape=(size, size))
        if self.run.explicit and size % 2 == 0:
            half = Matrix(whole[::2, ::2])
            if abs(sparse.kron(half, np.eye(2)) - whole).max() == 0.0:
                return factorise(half, self.n // 2, np.arange(size).reshape(-1, 2))[0]
        return factorise(whole, self.n, np.arange(size)[:, None])[0]

    # --- marching ------------------------------------------------------------------------------------------

    def march(self, solver: str) -> Solution:
        """To the end, or as far as it goes."""
        run, step = self.run, 0
        march: Any = steps.explicit_steps if run.explicit else steps.implicit_steps
        tables, states = self._tables(0, 0), self._states(1, self.start)
        march(self.equations, tables, states)  # compiles
        batch = max(1, min(MOST, ROOM // (self.n + self.m)))
        record, status = Record(self.system.layout, solver), Status()
        self._keep(record, 0, states, self.work)

        def so_far(status: Status) -> Solution:
            corrections, factorizations, _ = self.equations.room.counts.tolist()
            return record.solution(status, step, corrections, factorizations)

        with ended_early(so_far, lambda: self._time(step)):
            while step < run.steps and status.ok:
                last = min(step + batch, run.steps)
                try:
                    tables = self._tables(step, last)
                except PropertyError:  # of a load or a drive: go on to the step at which it fails
                    if last == step + 1:
                        raise
                    batch = 1
                    continue
                states = self._states(last - step + 1, [part[-1] for part in states])
                done = march(self.equations, tables, states)
                states = steps.States(*(part[:done] for part in states))
                if done > 1:
                    self.work = self._work(states, tables)
                    self._keep(record, step + 1, steps.States(*(part[1:] for part in states)), self.work)
                step += done - 1
                if step < last:
                    status = self._diverged(step + 1)
        return so_far(status)

    def _states(self, count: int, first: Any) -> steps.States:
        """Room for so many steps, the first of which is known."""
        widths = (self.n,) * 4 + (self.m,)
        states = steps.States(*(np.empty((count, width)) for width in widths), np.empty(count))  # type: ignore[call-arg]
        for part, known in zip(states, first, strict=True):
            part[0] = known
        return states

    def _tables(self, first: int, last: int) -> Tables:
        """Loads and right-hand sides at the steps first … last."""
        t, zero = self.run.times(np.arange(first, last + 1)), self.system.still
        loads = np.zeros((len(t), len(self.system.loads), 2))
        for k, load in enumerate(self.system.loads):
            value: Any = load.load.value
            loads[:, k, : load.width] = (
                tabulate(load.name, value, t, load.width) if callable(value) else value
            )
        b, rate, acceleration = np.zeros((3, len(t), self.m))
        b[:] = self.base
        self.p = p = self.driven.parameters(t)
        b[:, self.turned] = -self.driven.value(zero, p)
        rate[:, self.turned] = -self.driven.rate(zero, p)
        acceleration[:, self.turned] = self.driven.right(zero, zero, p)
        return Tables(loads, b, rate, acceleration)

    def _work(self, z: steps.States, tables: Tables) -> Array:
        """All work, and that of damping, until each step of a batch but its first, by the trapezoidal rule, (n, 2)."""
        forces, values = self._efforts(z.q, self.scale * z.mu, tables.loads)
        lost = 0.5 * self.run.exact_dt * (z.power[1:] + z.power[:-1])
        work = (0.5 * (forces[1:] + forces[:-1]) * np.diff(values, axis=0)).sum(axis=1) + lost
        return np.asarray(self.work[-1] + np.cumsum(np.stack([work, lost], axis=1), axis=0))

    def _keep(self, record: Record, first: int, z: steps.States, work: Array) -> None:
        """Keep the outputs among the steps from a number on, with the work until then."""
        number, angles = first + np.arange(len(z.q)), record.turns.count(z.q)
        kept = np.isin(number, self.run.output_steps)
        q, v, a, work = z.q[kept], z.v[kept], z.a[kept], work[kept]
        energies = np.zeros((len(q), 5))
        with np.errstate(all="ignore"):  # of a run that has diverged, numbers may be too large
            energies[:, 0] = 0.5 * np.einsum("ni,ni->n", v, (self.system.mass @ v.T).T)
            energies[:, 1] = self.system.beams.energy(q)
        energies[:, 2] = -(q - self.system.layout.reference) @ self.system.dead
        energies[:, 3], energies[:, 4] = work[:, 0], 0.0 - work[:, 1]
        record.keep(self.run.times(number[kept]), (q, v, a), energies, angles[kept])

    def _efforts(self, q: Array, mu: Array, loads: Array) -> tuple[Array, Array]:
        """Forces of drives and loads at several states, and the values that they work along, (n, …)."""
        p = self.p[: len(q)]
        pulls = mu[:, self.turned] * self.driven.by_parameter(self.system.still, p)
        forces, values = [pulls], [p[..., 0]]
        for k, load in enumerate(self.system.loads):
            x, F = q[:, load.vectors[0].at] @ load.vectors[0].A.T, loads[: len(q), k]
            if load.torque:
                F = F[:, :1] * np.stack([-x[:, 1], x[:, 0]], axis=1) / (x * x).sum(axis=1, keepdims=True)
            forces.append(F)
            values.append(x)
        return np.concatenate(forces, axis=1), np.concatenate(values, axis=1)

    def _time(self, step: int) -> float:
        return float(self.run.times(np.array([step]))[0])

    def _diverged(self, step: int) -> Status:
        why, advice = "Newton's iteration does not converge", integrators.GeneralizedAlpha.advice
        if self.run.explicit:
            why, advice = "accelerations are not finite", integrators.Zhai.advice
        failure = Failure(why, self.equations.room.change)
        return failed_step(self.system.layout, failure, step, self._time(step), advice)


# --- tables of the kernels ------------------------------------------------------------------------------------


def loads_of(loads: list[LoadForce]) -> Loads:
    """Loads that vary or turn, each on a sum of vectors."""
    vectors = [load.vectors[0] for load in loads]
    first = np.cumsum([0, *(len(v.at) // 2 for v in vectors)])
    at, weight = np.zeros(first[-1], dtype=np.int64), np.zeros(first[-1])
    for k, v in enumerate(vectors):
        at[first[k] : first[k + 1]], weight[first[k] : first[k + 1]] = v.at[::2], v.A[0, ::2]
    return Loads(np.array([load.torque for load in loads], dtype=bool), first, at, weight)


def saddle_of(system: System, J: sparse.csr_array, scale: float) -> steps.Saddle:
    """Pattern and constant numbers of [c M + K, sJᵀ; sJ, 0]."""
    n, size = system.size, system.size + J.shape[0]
    moments = [load.vectors[0].at for load in system.loads if load.torque]
    none = np.zeros(0, dtype=np.int64)
    turned = [np.concatenate([none, *(at[pick] for at in moments)]) for pick in ([0, 0, 1, 1], [0, 1, 0, 1])]
    M, S = sparse.coo_array(system.mass), sparse.coo_array(scale * J)
    parts = [
        (M.row, M.col),
        (S.row + n, S.col),
        (S.col, S.row + n),
        system.beams.pattern,
        turned,
        [np.arange(size)] * 2,
    ]
    keys = [np.asarray(column, dtype=np.int64) * size + row for row, column in parts]
    entries, places = np.unique(np.concatenate(keys), return_inverse=True)
    in_M, below, right, elements, of_moments, _ = np.split(places, np.cumsum([len(k) for k in keys])[:-1])
    mass, joints, data = np.zeros((3, len(entries)))
    mass[in_M] = M.data
    joints[below] = joints[right] = S.data
    first = np.searchsorted(entries, size * np.arange(size + 1))
    return steps.Saddle(index(first), index(entries % size), mass, joints, elements, of_moments, data)
