"""The compiled solver: beams and point masses with pins, welds, clamps and guides of the ground, without connectors.

All that stays the same is prepared by the plain description of the scene: constraints J q = b(t) with a constant J,
mass, dead forces. Explicit steps solve with one factorization, Newton's matrix is assembled into a fixed pattern and
factored in place when its corrections fall slowly. Compiled steps store every state of a batch; work, whole turns and
outputs are found from these.
"""

from time import perf_counter, process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from anctmm.discretise.methods import GeneralizedAlpha
from anctmm.errors import PropertyError
from anctmm.model.drives import tabulate
from anctmm.results.ended_early import HistoryError, Interrupted, broken_off, interruption
from anctmm.results.solution import Cost, Solution
from anctmm.results.status import Status
from reference.global_dae import explicit, implicit, saddle, steps
from reference.global_dae.constraints import Constraints, Drive
from reference.global_dae.elements import Matrix
from reference.global_dae.forces import LoadForce, Moment, PointForce
from reference.global_dae.lu import factorise
from reference.global_dae.marching import Failure, Turns, answer, failed_step
from reference.global_dae.steps import History, Loads, Rows, Tables
from reference.global_dae.system import System
from reference.global_dae.vectors import QUARTER

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Part of the largest pivot of J Jᵀ below which rows depend on each other.
DEPENDENT = 1e-12
#: Seconds between two chances to interrupt a run; steps of a batch, and numbers that they store, at most.
PAUSE, MOST, ROOM = 0.1, 4_096, 4_000_000


def has(system: System) -> bool:
    """Whether it has all features of a scene, and the integrator."""
    layout, c = system.layout, system.constraints
    return (
        layout.run.integrator != "esdirk"
        and bool(layout.meshes)
        and not system.connectors
        and c.constant
        and all(map(_simple, system.loads))
        and _independent(c.jacobian(layout.reference, c.parameters(0.0)))
    )


def _simple(load: LoadForce) -> bool:
    """Whether a load is a force on a linear place that does not turn, or a moment on one vector of a node."""
    return isinstance(load, PointForce) or (isinstance(load, Moment) and len(load.vectors[0].at) == 2)


def _independent(J: sparse.csr_array) -> bool:
    if not J.shape[0]:
        return True
    try:
        pivots = np.abs(splu(Matrix(J @ J.T)).U.diagonal())
    except RuntimeError:  # exactly singular
        return False
    return bool(pivots.min() > DEPENDENT * pivots.max())


class Rival:
    """One scene, prepared.

    Parameters
    ----------
    system : System
    dense : bool
        Whether matrices are dense, and factored at each step.
    """

    def __init__(self, system: System, dense: bool) -> None:
        self.system, self.layout, self.run, self.dense = system, system.layout, system.layout.run, dense
        c = system.constraints
        self.n, self.m = system.size, c.count
        self.J = c.jacobian(self.layout.reference, c.parameters(0.0))
        self.rows = _RightSide(c)
        h = self.run.exact_dt
        alpha = GeneralizedAlpha(self.run.spectral_radius).of_step(h)
        by_a, by_v = (0.0, 0.0) if self.run.explicit else (alpha.to_w, alpha.gamma / (alpha.beta * h))
        self.separate = separated(system.mass, self.J) if self.run.explicit and not dense else None
        scale = np.abs(self._matrix(by_a, by_v).diagonal()).mean()
        J, none = self.J, np.zeros(0)
        gram = factorise(Matrix(J @ J.T), np.arange(self.m)[:, None])
        self.equations = steps.Equations(
            steps.Scheme(
                h, self.run.psi, self.run.phi, alpha.alpha_m, alpha.alpha_f, alpha.beta, alpha.gamma, by_a, by_v,
                self.run.newton_tolerance, dense, float(scale),
            ),
            system.beams.elements(by_v),
            Rows(_index(J.indptr), _index(J.indices), J.data.copy(), gram, *np.zeros((2, self.m))),
            loads_of(system.loads), system.dead, factorise(Matrix((0, 0)), np.zeros((0, 1), dtype=np.int64)),
            saddle_of(system, J, float(scale)), np.zeros((self.n + self.m if dense else 0,) * 2),
            self._start(float(scale)),
        )  # fmt: skip
        self._factor(self.layout.reference, np.zeros((len(system.loads), 2)))
        self.turns, self.last, self.work = Turns(self.layout), [none] * 0, np.zeros(2)

    def _matrix(self, by_a: float, by_v: float) -> Matrix:
        """Matrix of the coordinates in the reference; that of components that do not mix if these are separate."""
        if self.run.explicit:
            return self.system.mass if self.separate is None else self.separate[0]
        K = self.system.tangents(self.layout.reference, self.system.still, 0.0, by_velocity=by_v)
        return Matrix(by_a * self.system.mass + K)

    def _start(self, scale: float) -> steps.Motion:
        """The state at t = 0."""
        system, layout, c, n, m = self.system, self.layout, self.system.constraints, self.n, self.m
        q, p = layout.reference.copy(), c.parameters(0.0)
        v = layout.velocity - saddle.Nearest(self.J)(self.J @ layout.velocity + c.rate(q, p))
        damping = system.beams.damping(q, v)
        a, mu = saddle.Saddle(system.mass, self.J).solve(system.force(q, v, 0.0) + damping, c.right(q, v, p))
        return steps.Motion(  # type: ignore[call-arg]
            q, v, a, a.copy(), damping, mu / scale, *np.zeros((5, n)), *np.zeros((2, n + m)), layout.unit, np.zeros(n),
            np.zeros(steps.ITERATIONS), np.zeros(4, dtype=np.int64), np.zeros(1),
        )  # fmt: skip

    def _factor(self, q: Array, loads: Array) -> None:
        """Order and pivots, at a state."""
        e = self.equations
        matrix, size = e.saddle, self.n + self.m
        if self.run.explicit:
            matrix.data[:] = matrix.mass + matrix.joints
        else:
            steps.assemble(e, loads, q)
        if self.dense:
            return
        if self.separate is not None:
            small, places = saddle.Saddle(*self.separate).matrix, np.arange(size).reshape(-1, 2)
        else:
            where = matrix.row.astype(np.int64), matrix.column.astype(np.int64)
            small, places = Matrix((matrix.data.copy(), *where), shape=(size, size)), np.arange(size)[:, None]
        self.equations = e._replace(lu=factorise(small, places))

    # --- marching ------------------------------------------------------------------------------------------

    def march(self, solver: str) -> Solution:
        """To the end, or as far as it goes."""
        run, step, batch, outputs = self.run, 0, 16, list[tuple[Any, ...]]()
        march: Any = steps.explicit_steps if run.explicit else steps.implicit_steps
        march(self.equations, 0, self._tables(0, 0), self._room(0))  # compiles
        start, status = (process_time(), perf_counter()), Status()

        def so_far(status: Status) -> Solution:
            spent = process_time() - start[0], perf_counter() - start[1]
            return self._solution(solver, outputs, max(min(step, run.steps + 1) - 1, 0), spent, status)

        most = max(1, min(MOST, ROOM // (3 * self.n + 5 * self.m)))
        repivoted = -1
        try:
            while step <= run.steps and status.ok:
                last, began = min(step + min(batch, most), run.steps + 1), perf_counter()
                try:
                    tables = self._tables(step, last)
                except PropertyError:  # of a load or a drive: go on to the step at which it fails
                    if last == step + 1:
                        raise
                    most = 1
                    continue
                history = self._room(last - step)
                done = march(self.equations, step, tables, history)
                outputs.append(self._outputs(step, done, tables, history))
                step += done
                if step < last and self._singular and step != repivoted:
                    repivoted = step
                    self._factor(self.equations.motion.q, tables.loads[done])
                elif step < last:
                    status = self._diverged(step)
                batch = 2 * batch if perf_counter() - began < PAUSE else batch
        except KeyboardInterrupt:
            raise Interrupted(so_far(interruption(self._time(max(step - 1, 0))))) from None
        except PropertyError as error:
            raise HistoryError(so_far(broken_off(error, self._time(max(step - 1, 0))))) from error
        return so_far(status)

    @property
    def _singular(self) -> bool:
        return bool(self.equations.motion.counts[steps.ENDED] == steps.SINGULAR)

    def _room(self, count: int) -> History:
        states = (np.empty((count, self.n)) for _ in range(3))
        return History(*states, np.empty((count, self.m)), np.empty(count))  # type: ignore[call-arg]

    def _tables(self, first: int, last: int) -> Tables:
        """Values of loads and right-hand sides at the steps first … last − 1."""
        t = self.run.times(np.arange(first, last))
        loads = np.zeros((len(t), len(self.system.loads), 2))
        for k, load in enumerate(self.system.loads):
            value: Any = load.load.value
            loads[:, k, : load.width] = (
                tabulate(load.name, value, t, load.width) if callable(value) else value
            )
        self.p = self.rows.parameters(t)
        return Tables(loads, *self.rows(self.p))

    def _outputs(self, first: int, done: int, tables: Tables, history: History) -> tuple[Any, ...]:
        """Steps of a batch that are wanted: their numbers, q, v, a, work, and angles."""
        q, v, a, mu, lost = (part[:done] for part in history)
        number = first + np.arange(done)
        if not done:
            return number, q, v, a, np.zeros((0, 2)), np.zeros((0, len(self.turns.names)))
        angles = self.turns.count(q)
        work = np.stack([self._work(q, mu, tables.loads[:done]) + lost, lost], axis=1)
        summed = self.work + np.cumsum(work, axis=0)
        self.work = summed[-1]
        kept = np.isin(number, self.run.output_steps)
        return number[kept], q[kept], v[kept], a[kept], summed[kept], angles[kept]

    def _work(self, q: Array, mu: Array, loads: Array) -> Array:
        """Work of loads and drives in each of several steps, (n,), by the trapezoidal rule.

        Of a force ½ (F_n + F_{n+1}) · Δr, of a moment its mean times the change of the angle, of a drive μᵀ ∂Φ/∂p.
        """
        now = [q, loads, -mu * self.rows.slope(self.p[: len(q)]), self.p[: len(q), :, 0]]
        q, loads, pulls, p = (
            np.concatenate(pair) for pair in zip(self.last or [x[:1] for x in now], now, strict=True)
        )
        self.last = [x[-1:] for x in (q, loads, pulls, p)]
        work = 0.5 * ((pulls[1:] + pulls[:-1]) * np.diff(p, axis=0)).sum(axis=1)
        for k, load in enumerate(self.system.loads):
            at, A = load.vectors[0].at, load.vectors[0].A
            x, F = q[:, at] @ A.T, loads[:, k]
            if isinstance(load, Moment):
                x = np.unwrap(np.arctan2(x[:, 1], x[:, 0]))[:, None]
            work += 0.5 * ((F[1:] + F[:-1])[:, : x.shape[1]] * np.diff(x, axis=0)).sum(axis=1)
        return np.asarray(work)

    def _time(self, step: int) -> float:
        return float(self.run.times(np.array([step]))[0])

    def _diverged(self, step: int) -> Status:
        m = self.equations.motion
        if self.run.explicit:
            failure = Failure("accelerations are not finite", m.change)
        else:
            why = "the tangent is singular" if self._singular else "Newton's iteration does not converge"
            failure = Failure(why, m.change, m.residuals[m.residuals > 0.0].tolist())
        advice = (explicit.Zhai if self.run.explicit else implicit.GeneralizedAlpha).advice
        return failed_step(self.layout, failure, step, self._time(step), advice)

    def _solution(
        self, solver: str, outputs: list[tuple[Any, ...]], count: int, spent: tuple[float, float], status: Status
    ) -> Solution:  # fmt: skip
        counts, system = self.equations.motion.counts, self.system
        factorizations = 1 if self.run.explicit and not self.dense else int(counts[steps.FACTORIZATIONS])
        cost = Cost(*spent, count, int(counts[steps.CORRECTIONS]), factorizations)
        empty = self._outputs(0, 0, self._tables(0, 0), self._room(0))
        number, q, v, a, work, angles = map(np.concatenate, zip(empty, *outputs, strict=True))
        energies = np.zeros((len(q), 5))
        with np.errstate(all="ignore"):  # of a run that has diverged, numbers may be too large
            energies[:, 0] = 0.5 * np.einsum("ni,ni->n", v, (system.mass @ v.T).T)
            energies[:, 1] = system.beams.energy(q)
        energies[:, 2] = -(q - self.layout.reference) @ system.dead
        energies[:, 3], energies[:, 4] = work[:, 0], 0.0 - work[:, 1]
        turned = dict(zip(self.turns.names, angles.T, strict=True))
        return answer(self.layout, solver, self.run.times(number), (q, v, a), energies, cost, status, turned)


class _RightSide:
    """b of J q = b(t): b = base + cos p along + sin p across + p shift, p of the drive of each row."""

    def __init__(self, c: Constraints) -> None:
        self.base, self.along, self.across = c.targets.copy(), *np.zeros((2, c.count))
        self.shift, self.drives = c.along, dict[Drive, list[int]]()
        for j, row in enumerate(c.rows):
            for term in row.terms:
                one, two = term.one.constant, term.two.constant
                if term.turned:
                    self.along[j] -= one @ term.Q @ two
                    self.across[j] -= one @ QUARTER @ term.Q @ two
                else:
                    self.base[j] -= one @ term.Q @ two
            if row.drive is not None:
                self.drives.setdefault(row.drive, []).append(j)

    def parameters(self, t: Array) -> Array:
        """p, p', p'' of each row at times, (n, m, 3)."""
        p = np.zeros((len(t), len(self.base), 3))
        for drive, rows in self.drives.items():
            p[:, rows] = tabulate(drive.name, drive.history, t, 3)[:, None]
        return p

    def slope(self, p: Array) -> Array:
        """∂b/∂p, (n, m)."""
        return np.cos(p[..., 0]) * self.across - np.sin(p[..., 0]) * self.along + self.shift

    def __call__(self, p: Array) -> tuple[Array, Array, Array]:
        """b and its derivatives by time, (n, m)."""
        turned = np.cos(p[..., 0]) * self.along + np.sin(p[..., 0]) * self.across
        slope = self.slope(p)
        b = self.base + turned + p[..., 0] * self.shift
        return b, p[..., 1] * slope, p[..., 2] * slope - p[..., 1] ** 2 * turned


# --- tables of the kernels ------------------------------------------------------------------------------------


def loads_of(loads: list[LoadForce]) -> Loads:
    """Loads that vary or turn, each on a sum of vectors."""
    vectors = [load.vectors[0] for load in loads]
    none = np.zeros(0)
    at = np.concatenate([none.astype(np.int64), *(v.at[::2] for v in vectors)])
    first = np.cumsum([0, *(len(v.at) // 2 for v in vectors)])
    weight = np.concatenate([none, *(v.A[0, ::2] for v in vectors)])
    return Loads(np.array([isinstance(load, Moment) for load in loads], dtype=bool), first, at, weight)


def separated(M: Matrix, J: sparse.csr_array) -> tuple[Matrix, sparse.csr_array] | None:
    """m and j with M = m ⊗ I₂ and J = j ⊗ I₂: one matrix then serves x and y; None where J mixes them."""
    if J.shape[0] % 2:
        return None
    m, j = Matrix(M[::2, ::2]), sparse.csr_array(J[::2, ::2])
    same = abs(sparse.kron(j, np.eye(2)) - J).max() if J.shape[0] else 0.0
    return (m, j) if same == 0.0 else None


def saddle_of(system: System, J: sparse.csr_array, scale: float) -> steps.Saddle:
    """Pattern and constant numbers of [c M + K, sJᵀ; sJ, 0]."""
    n, size = system.size, system.size + J.shape[0]
    moments = [load.vectors[0].at for load in system.loads if isinstance(load, Moment)]
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
    return steps.Saddle(_index(first), _index(entries % size), mass, joints, elements, of_moments, data)


def _index(numbers: Any) -> NDArray[np.uint32]:
    return np.asarray(numbers).astype(np.uint32)
