"""Statics: Newton's iteration with multipliers over load steps, and, where it fails, pseudo-transient continuation.

Under a part f of the load gravity and loads are f times theirs, and connectors pull by what they do there less 1 − f of
what they do in the reference: that is an equilibrium at f = 0.
"""

from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from anctmm.results.ended_early import Interrupted, interruption_of_load
from anctmm.results.solution import Cost, Solution
from anctmm.results.status import Status
from reference.global_dae.elements import Matrix
from reference.global_dae.forces import Follower, PointForce
from reference.global_dae.implicit import EPSILON, ROUNDINGS
from reference.global_dae.marching import Failure, Record
from reference.global_dae.saddle import Saddle
from reference.global_dae.stability import stability
from reference.global_dae.system import Account, System

Array = NDArray[np.float64]

#: Newton iterations of a load step; correction out of Newton's reach; smallest load step.
ITERATIONS, REACH, SMALLEST = 25, 1.0, 1e-6
#: Steps of the continuation at most, the longest, and those after which Newton's iteration is tried.
RELAXATIONS, SHORT, NEAR = 1_000, 0.1, 1e-3
#: Corrections of this size are the rounding of coordinates; digits of displacements that are enough.
COORDINATES, DIGITS = 1e-13, 4.0


@dataclass
class Equilibrium:
    """Load factor, coordinates and multipliers."""

    factor: float
    q: Array
    mu: Array

    def towards(self, before: "Equilibrium", factor: float) -> "Equilibrium":
        """On the secant through an earlier one."""
        s = (factor - self.factor) / (self.factor - before.factor) if self.factor > before.factor else 0.0
        return Equilibrium(factor, self.q + s * (self.q - before.q), self.mu + s * (self.mu - before.mu))

    def moved(self, change: Array, multiplier: Array) -> "Equilibrium":
        """The same after a correction."""
        return Equilibrium(self.factor, self.q + change, self.mu + multiplier)


class Search:
    """Equilibria of one system."""

    def __init__(self, system: System) -> None:
        self.system, self.run, self.unit = system, system.layout.run, system.layout.unit
        self.p = system.constraints.parameters(0.0)
        self.iterations, self.change = 0, system.still
        self.floor, self.digits = 0.0, np.inf
        system.restart()

    def reach(self, start: Equilibrium, target: float) -> Equilibrium:
        """Go to a load factor; the last equilibrium on the way if it cannot be reached."""
        now, before, step = start, start, target - start.factor
        while now.factor < target:
            near = target - now.factor <= step * (1.0 + 1e-9)
            found = self.newton(now.towards(before, target if near else now.factor + step))
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
            step = self._step(e, 0.0)
            if step is None or not step.size < REACH:
                return None
            self.change, e = step.change, e.moved(step.change, step.multiplier)
            near = step.size <= self.run.newton_tolerance
            if near or (step.size > 0.5 * before and step.rounded):
                self.system.accept(e.q)
                if not near:
                    moved = float((np.abs(e.q - self.system.layout.reference) / self.unit).max())
                    self.floor = max(self.floor, step.size)
                    self.digits = min(self.digits, max(0.0, float(np.log10(moved / step.size))))
                return e
            before = step.size
        return None

    def relaxed(self, start: Equilibrium, factor: float) -> Equilibrium | None:
        """A stable equilibrium downhill: M/τ² is added to the tangent, large enough for short steps downhill."""
        e = Equilibrium(factor, start.q, start.mu)
        stiff, mass = (float(np.abs(A.diagonal()).max()) for A in (self.tangent(e), self.system.mass))
        added = least = 1e-6 * (stiff or 1.0) / mass
        for _ in range(RELAXATIONS):
            step = None if self._negative(e, added) else self._step(e, added)
            if step is None or step.size > SHORT:
                if added > 1e18 * least:
                    return None
                added *= 8.0
                continue
            e, added = e.moved(step.change, step.multiplier), max(least, 0.25 * added)
            self.system.accept(e.q)
            found = self.newton(e) if step.size < NEAR else None
            if found is not None and not self._negative(found, 0.0):
                return found
        return None

    def _negative(self, e: Equilibrium, added: float) -> int:
        A = Matrix(self.tangent(e) + added * self.system.mass)
        return stability(self.system, A, e.q, self.p).negative

    def _step(self, e: Equilibrium, added: float) -> "Step | None":
        """A correction, with a stiffness `added` times the mass; None without one."""
        system, c, still = self.system, self.system.constraints, self.system.still
        J, A = c.jacobian(e.q, self.p), self.tangent(e)
        r = system.force(e.q, still, 0.0, e.factor) - J.T @ e.mu
        try:
            saddle = Saddle(Matrix(A + added * system.mass), J)
            change, multiplier = saddle.solve(r, -c.value(e.q, self.p))
        except Failure:
            return None
        self.iterations += 1
        size = float((np.abs(change) / self.unit).max())
        terms = system.sizes(e.q, still, 0.0, e.factor) + abs(A) @ np.abs(e.q) + abs(J).T @ np.abs(e.mu)
        rounded = bool(np.abs(r).max() <= ROUNDINGS * EPSILON * terms.max())
        return Step(change, multiplier, size, rounded) if np.isfinite(size) else None

    def tangent(self, e: Equilibrium) -> Matrix:
        """Tangent stiffness with the curvature of the constraints."""
        K = self.system.tangents(e.q, self.system.still, 0.0, e.factor)
        return Matrix(K + self.system.constraints.hessian(e.q, self.p, e.mu))

    def precision(self) -> Status:
        """Whether rounding leaves digits: a small residual is no small error where the tangent is ill-conditioned."""
        if self.floor < COORDINATES or self.digits >= DIGITS:
            return Status()
        digits = f"{self.digits:.0f}" if self.digits >= 1.0 else "no"
        why = (
            f"corrections end at {self.floor:.1e}: the residual is as small as rounding allows, and {digits} digits of "
            f"the displacements can be trusted; a coarser mesh is needed"
        )
        return Status("imprecise", why)

    def stability(self, e: Equilibrium, before: float) -> Status:
        """What is wrong with an equilibrium that is not stable; `before`: the last load factor of a stable one."""
        found = stability(self.system, self.tangent(e), e.q, self.p)
        if not found.negative and not found.singular:
            return Status()
        body, element = self.system.layout.owner(found.place) if found.place >= 0 else (None, None)
        where = f" (body {body!r} moves most)" if body else ""
        count = f"{found.negative} negative eigenvalue{'s' * (found.negative > 1)}"
        code, why = "unstable", (
            f"the equilibrium at load factor {e.factor:.6g} is unstable{where}: the tangent stiffness has {count}; "
            f"at {before:.6g} it was stable"
        )  # fmt: skip
        if found.singular:
            code, why = "singular", (
                f"the tangent stiffness at load factor {e.factor:.6g} is singular{where}: the scene is free to move, "
                f"or at the limit of stability; hold the scene, or change the load a little"
            )  # fmt: skip
        return Status(code, why, time=e.factor, body=body, element=element)

    def beyond(self, factor: float) -> Status:
        """Of a search that has ended at a load factor."""
        body, element = self.system.layout.owner(int(np.abs(self.change / self.unit).argmax()))
        why = (
            f"no equilibrium found beyond {factor:.6g} of the load, body {body!r}: the scene may be free to move or "
            f"buckle there; hold it, take more load_steps or a finer mesh"
        )
        return Status("diverged", why, factor, None, body, element)


@dataclass
class Step:
    """A correction, its largest part in units of the coordinates, and whether the residual was rounding."""

    change: Array
    multiplier: Array
    size: float
    rounded: bool


def equilibria(system: System, load_steps: int, solver: str) -> Solution:
    """Equilibria at the load factors 0, 1/load_steps, … 1, as far as they can be reached."""
    start = process_time(), perf_counter()
    search, record, still = Search(system), Record(system.layout), system.still
    now = Equilibrium(0.0, system.layout.reference, np.zeros(system.constraints.count))
    factors = np.arange(load_steps + 1) / load_steps
    status, doubt = Status(), Status()
    record.keep(now.q, still, still, energies(system, now))
    try:
        for before, factor in pairwise(map(float, factors)):
            now = search.reach(now, factor)
            if now.factor != factor:
                status = search.beyond(now.factor)
                break
            record.keep(now.q, still, still, energies(system, now))
            doubt = search.stability(now, before) if doubt.ok else doubt
    except KeyboardInterrupt:
        status = interruption_of_load(now.factor)
    status = search.precision() if status.ok else status
    count, spent = len(record.states), (process_time() - start[0], perf_counter() - start[1])
    cost = Cost(*spent, count - 1, search.iterations, search.iterations)
    found = record.solution(solver, factors[:count], cost, doubt if status.ok else status, static=True)
    if status.code == "interrupted":
        raise Interrupted(found)
    return found


def energies(system: System, e: Equilibrium) -> Array:
    """Energies of an equilibrium; the work is that of the whole loads that vary or turn, NaN by followers and laws."""
    found = system.energies(e.q, system.still, 0.0, Account(system), e.factor)
    if e.factor == 0.0:
        return found
    lawless = all(c.connector.law is None for c in system.connectors)
    conservative = lawless and not any(isinstance(load, Follower) for load in system.loads)
    found[3] = _work(system, e.q) if conservative else np.nan
    return found


def _work(system: System, q: Array) -> float:
    """Work of moments and of forces of time at an equilibrium, J."""
    total = 0.0
    ends, starts = (system.states(x, system.still) for x in (q, system.layout.reference))
    for (load, x, y), (_, x0, _) in zip(ends, starts, strict=True):
        if load in system.loads:
            effort = load.effort(x, y, 0.0)
            moved = effort.values - (x0[0] if isinstance(load, PointForce) else 0.0)
            total += float(effort.forces @ moved)
    return total
