"""Statics: Newton's iteration with multipliers over load steps, and, where it fails, pseudo-transient continuation.

Under a part f of the load gravity and loads are f times theirs, and connectors pull by what they do there less 1 − f of
what they do in the reference: that is an equilibrium at f = 0.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anctmm.results.ended_early import Interrupted, interruption_of_load
from anctmm.results.load_work import with_load_work
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from reference.global_dae.elements import Matrix
from reference.global_dae.marching import Record
from reference.global_dae.saddle import Failure, Saddle
from reference.global_dae.stability import stability
from reference.global_dae.system import System

Array = NDArray[np.float64]

#: Newton iterations of a load step; correction out of Newton's reach; a correction that is rounding where it no longer
#: falls; smallest load step.
ITERATIONS, REACH, STALLED, SMALLEST = 25, 1.0, 1e-8, 1e-6
#: Steps of the continuation at most, the longest, and those after which Newton's iteration is tried.
RELAXATIONS, SHORT, NEAR = 1_000, 0.1, 1e-3


@dataclass
class Equilibrium:
    """Load factor, coordinates and multipliers."""

    factor: float
    q: Array
    mu: Array


class Search:
    """Equilibria of one system."""

    def __init__(self, system: System) -> None:
        self.system, self.unit = system, system.layout.unit
        self.p = system.constraints.parameters(0.0)
        self.iterations, self.change = 0, system.still

    def reach(self, start: Equilibrium, target: float) -> Equilibrium:
        """Go to a load factor; the last equilibrium on the way if it cannot be reached."""
        now, before, step = start, start, target - start.factor
        while now.factor < target:
            near = target - now.factor <= step * (1.0 + 1e-9)
            goal = target if near else now.factor + step
            s = (goal - now.factor) / (now.factor - before.factor) if now.factor > before.factor else 0.0
            guess = Equilibrium(goal, now.q + s * (now.q - before.q), now.mu + s * (now.mu - before.mu))
            found = self.newton(guess)  # on the secant
            if found is not None:
                before, now, step = now, found, 2.0 * step
            elif step < SMALLEST:
                return self.relaxed(now, target) or now
            else:
                before, step = now, 0.25 * min(step, target - now.factor)
        return now

    def newton(self, e: Equilibrium) -> Equilibrium | None:
        """The equilibrium near a guess; None if the iteration leaves its reach or is too slow."""
        before = np.inf
        for _ in range(ITERATIONS):
            e, size = self._corrected(e, 0.0)
            if not size < REACH:
                return None
            if size <= self.system.run.newton_tolerance or 0.5 * before < size <= STALLED:
                self.system.accept(e.q)
                return e
            before = size
        return None

    def relaxed(self, start: Equilibrium, factor: float) -> Equilibrium | None:
        """A stable equilibrium downhill: M/τ² is added to the tangent, large enough for short steps downhill."""
        e = Equilibrium(factor, start.q, start.mu)
        stiff, mass = (float(np.abs(A.diagonal()).max()) for A in (self.tangent(e), self.system.mass))
        added = least = 1e-6 * (stiff or 1.0) / mass
        for _ in range(RELAXATIONS):
            moved, size = e, np.inf
            if not self._negative(e, added):
                moved, size = self._corrected(e, added)
            if size > SHORT:
                if added > 1e18 * least:
                    return None
                added *= 8.0
                continue
            e, added = moved, max(least, 0.25 * added)
            self.system.accept(e.q)
            found = self.newton(e) if size < NEAR else None
            if found is not None and not self._negative(found, 0.0):
                return found
        return None

    def _negative(self, e: Equilibrium, added: float) -> int:
        A = Matrix(self.tangent(e) + added * self.system.mass)
        return stability(self.system, A, e.q, self.p).negative

    def _corrected(self, e: Equilibrium, added: float) -> tuple[Equilibrium, float]:
        """After a correction, with a stiffness `added` times the mass, and its size; infinite without one."""
        system, c = self.system, self.system.constraints
        J = c.jacobian(e.q, self.p)
        r = system.force(e.q, system.still, 0.0, e.factor) - J.T @ e.mu
        try:
            saddle = Saddle(Matrix(self.tangent(e) + added * system.mass), J)
        except Failure:
            return e, np.inf
        self.change, multiplier = saddle.solve(r, -c.value(e.q, self.p))
        self.iterations += 1
        size = float((np.abs(self.change) / self.unit).max())
        moved = Equilibrium(e.factor, e.q + self.change, e.mu + multiplier)
        return (moved, size) if np.isfinite(size) else (e, np.inf)

    def tangent(self, e: Equilibrium) -> Matrix:
        """Tangent stiffness with the curvature of the constraints."""
        K = self.system.tangents(e.q, self.system.still, 0.0, e.factor)
        return Matrix(K + self.system.constraints.hessian(e.q, self.p, e.mu))

    def stability(self, e: Equilibrium, before: float) -> Status:
        """What is wrong with an equilibrium that is not stable; `before`: the last load factor of a stable one."""
        found = stability(self.system, self.tangent(e), e.q, self.p)
        if not found.negative and not found.singular:
            return Status()
        where = f" (body {found.body!r} moves most)" if found.body else ""
        code, why = "unstable", f"has {found.negative} negative eigenvalue{'s' * (found.negative > 1)}"
        if found.singular:
            code, why = "singular", "is singular: the scene is free to move, or at the limit of stability"
        message = (
            f"the tangent stiffness at load factor {e.factor:.6g} {why}{where}; at {before:.6g} it was stable"
        )
        return Status(code, message, time=e.factor, body=found.body)

    def beyond(self, factor: float) -> Status:
        """Of a search that has ended at a load factor."""
        body, element = self.system.layout.owner(int(np.abs(self.change / self.unit).argmax()))
        why = (
            f"no equilibrium found beyond {factor:.6g} of the load, body {body!r}: the scene may be free to move or "
            f"buckle there; hold it, take more load_steps or a finer mesh"
        )
        return Status("diverged", why, factor, None, body, element)


def equilibria(system: System, load_steps: int, solver: str) -> Solution:
    """Equilibria at the load factors 0, 1/load_steps, … 1, as far as they can be reached."""
    search, record, still = Search(system), Record(system.layout, solver), system.still
    now = Equilibrium(0.0, system.layout.reference, np.zeros(system.constraints.count))
    status, doubt, none = Status(), Status(), np.zeros((1, len(record.turns.names)))

    def keep(e: Equilibrium) -> None:
        energies = system.energies(e.q, still, 0.0, np.zeros(2), e.factor)
        record.keep(np.array([e.factor]), (e.q, still, still), energies, none)

    keep(now)
    try:
        for before, factor in pairwise(map(float, np.arange(load_steps + 1) / load_steps)):
            now = search.reach(now, factor)
            if now.factor != factor:
                status = search.beyond(now.factor)
                break
            keep(now)
            doubt = search.stability(now, before) if doubt.ok else doubt
    except KeyboardInterrupt:
        status = interruption_of_load(now.factor)
    steps, done = len(record.times) - 1, doubt if status.ok else status
    found = with_load_work(record.solution(done, steps, search.iterations, search.iterations, static=True))
    if status.code == "interrupted":
        raise Interrupted(found)
    return found
