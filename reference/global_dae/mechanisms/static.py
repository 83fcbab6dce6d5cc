"""Statics: Newton's iteration with multipliers over load steps, and, where it fails, pseudo-transient continuation.

Under a part f of the load gravity and loads are f times theirs, and connectors pull by what they do there less 1 − f of
what they do in the reference: that is an equilibrium at f = 0.
"""

from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from anctmm.results.checks.stability import singular, unstable
from anctmm.results.solution import Cost, Solution
from anctmm.results.status import Status
from reference.global_dae.mechanisms.implicit import at_rounding, solved
from reference.global_dae.mechanisms.independent import independent_rows
from reference.global_dae.mechanisms.march import Failure, Record
from reference.global_dae.mechanisms.stability import signs
from reference.global_dae.mechanisms.system import Account, System

Array = NDArray[np.float64]

#: Newton iterations of a load step; correction out of Newton's reach; smallest load step.
ITERATIONS, REACH, SMALLEST = 25, 1.0, 1e-6
#: Steps of the continuation at most, the longest, and those after which Newton's iteration is tried.
RELAXATIONS, SHORT, NEAR = 1_000, 0.1, 1e-3


@dataclass
class Equilibrium:
    """Load factor, coordinates and multipliers."""

    factor: float
    q: Array
    mu: Array


@dataclass
class Step:
    """A correction, its largest part in units of the coordinates, and whether the residual was rounding."""

    change: Array
    multiplier: Array
    size: float
    rounded: bool


class Search:
    """Equilibria of one system."""

    def __init__(self, system: System) -> None:
        self.system, self.run = system, system.layout.run
        self.p = system.constraints.parameters(0.0)
        self.iterations, self.change = 0, system.still
        self.mass = system.elastic.mass.toarray()

    def start(self) -> Equilibrium:
        """The undeformed scene without loads."""
        self.system.restart()
        return Equilibrium(0.0, self.system.layout.reference.copy(), np.zeros(self.system.constraints.count))

    def reach(self, start: Equilibrium, target: float) -> Equilibrium:
        """Go to a load factor; the last equilibrium on the way if it cannot be reached."""
        now, before, step = start, start, target - start.factor
        while now.factor < target:
            near = target - now.factor <= step * (1.0 + 1e-9)
            found = self.newton(self._towards(now, before, target if near else now.factor + step))
            if found is not None:
                before, now, step = now, found, 2.0 * step
            elif step < SMALLEST:
                return self.relaxed(now, target) or now
            else:
                before, step = now, 0.25 * min(step, target - now.factor)
        return now

    def newton(self, guess: Equilibrium) -> Equilibrium | None:
        """The equilibrium near a guess; None if the iteration leaves its reach or is too slow."""
        system = self.system
        e, before = Equilibrium(guess.factor, guess.q.copy(), guess.mu.copy()), np.inf
        for _ in range(ITERATIONS):
            step = self._step(e, 0.0)
            if step is None:
                return None
            self.change, size = step.change, step.size
            if not size < REACH:
                return None
            e.q, e.mu = e.q + step.change, e.mu + step.multiplier
            if size <= self.run.newton_tolerance or (size > 0.5 * before and step.rounded):
                system.keep(e.q)
                return e
            before = size
        return None

    def relaxed(self, start: Equilibrium, factor: float) -> Equilibrium | None:
        """A stable equilibrium downhill: M/τ² is added to the tangent, large enough for short steps downhill."""
        e = Equilibrium(factor, start.q.copy(), start.mu.copy())
        stiff, mass = (float(np.abs(np.diagonal(A)).max()) for A in (self._tangent(e, factor), self.mass))
        added = least = 1e-6 * (stiff or 1.0) / mass
        for _ in range(RELAXATIONS):
            step = self._downhill(e, added)
            if step is not None and step.size <= SHORT:
                e.q, e.mu, added = e.q + step.change, e.mu + step.multiplier, max(least, 0.25 * added)
                self.system.keep(e.q)
                if step.size < NEAR and (found := self.newton(e)) is not None and not self._signs(found)[0]:
                    return found
            elif added > 1e18 * least:
                return None
            else:
                added *= 8.0
        return None

    def _downhill(self, e: Equilibrium, added: float) -> "Step | None":
        """A step with a stiffness added; None if the sum is not positive."""
        A = self._tangent(e, e.factor) + added * self.mass
        return None if signs(self.system, A, e.q, self.p)[0] else self._step(e, added)

    def _step(self, e: Equilibrium, added: float) -> "Step | None":
        system, c = self.system, self.system.constraints
        J = c.jacobian(e.q, self.p)
        rows = independent_rows(J, system.layout.unit)
        r = system.force(e.q, system.still, 0.0, e.factor) - J.T @ e.mu
        A = self._tangent(e, e.factor)
        try:
            x = solved(A + added * self.mass, J[rows], r, -c.value(e.q, self.p)[rows])
        except Failure:
            return None
        self.iterations += 1
        multiplier = np.zeros(c.count)
        multiplier[rows] = x[system.size :]
        change = x[: system.size]
        size = float((np.abs(change) / system.layout.unit).max())
        rounded = at_rounding(A, J[rows], e.q, e.mu[rows], r)
        return Step(change, multiplier, size, rounded) if np.isfinite(size) else None

    def _signs(self, e: Equilibrium) -> tuple[int, bool, int]:
        return signs(self.system, self._tangent(e, e.factor), e.q, self.p)

    def _tangent(self, e: Equilibrium, factor: float) -> Array:
        K, _ = self.system.tangents(e.q, self.system.still, 0.0, factor)
        return np.asarray(K + self.system.constraints.hessian(e.q, self.p, e.mu))

    def _towards(self, now: Equilibrium, before: Equilibrium, factor: float) -> Equilibrium:
        s = (factor - now.factor) / (now.factor - before.factor) if now.factor > before.factor else 0.0
        return Equilibrium(factor, now.q + s * (now.q - before.q), now.mu + s * (now.mu - before.mu))

    def doubt(self, e: Equilibrium, before: float) -> Status:
        """What is wrong with an equilibrium that is not stable."""
        negative, none, where = self._signs(e)
        if not negative and not none:
            return Status()
        body, element = self.system.layout.owner(where)
        if none:
            return singular(e.factor, body, element)
        return unstable(e.factor, negative, body, element, before)


def equilibria(system: System, load_steps: int, solver: str) -> Solution:
    """Equilibria at the load factors 0, 1/load_steps, … 1, as far as they can be reached."""
    search = Search(system)
    search.newton(search.start())  # compiles
    start = process_time(), perf_counter()
    now, status, doubt = search.start(), Status(), Status()
    search.iterations = 0
    factors = np.arange(load_steps + 1) / load_steps
    record = Record(system, len(factors))
    record.keep(now.q, system.still, system.still, _energies(system, now))
    for before, factor in pairwise(map(float, factors)):
        now = search.reach(now, factor)
        if now.factor != factor:
            body, element = system.layout.owner(int(np.abs(search.change / system.layout.unit).argmax()))
            status = Status(
                "diverged",
                f"no equilibrium found beyond {now.factor:.6g} of the load, body {body!r}: the scene may be free to "
                f"move or buckle there; hold it, take more load_steps or a finer mesh",
                now.factor, None, body, element,
            )  # fmt: skip
            break
        record.keep(now.q, system.still, system.still, _energies(system, now))
        doubt = search.doubt(now, before) if doubt.ok else doubt
    status = doubt if status.ok else status
    cost = Cost(
        process_time() - start[0], perf_counter() - start[1], record.count - 1,
        search.iterations, search.iterations,
    )  # fmt: skip
    return record.solution(solver, factors[: record.count], cost, status, static=True)


def _energies(system: System, e: Equilibrium) -> Array:
    """Kinetic, strain, potential; the work of loads is found where all equilibria are known."""
    return system.energies(e.q, system.still, 0.0, Account(system))
