"""Statics of the global system: Newton's iteration on [K_T, sΦᵀ; sΦ, 0], with load steps that halve where needed."""

from dataclasses import dataclass, replace
from itertools import pairwise
from time import perf_counter, process_time
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import elastic_forces, strain_energy
from anctmm.elements.tangent_blocks import TANGENT_BUFFER
from anctmm.results.checks.stability import singular, unstable
from anctmm.results.ended_early import Interrupted, interruption_of_load
from anctmm.results.solution import Cost, Solution
from anctmm.results.status import Status
from reference.global_dae.assemble import assemble, matrix_of, system_of
from reference.global_dae.equilibrium_stability import verdict
from reference.global_dae.history import solution
from reference.global_dae.loads import add_loads, load_table
from reference.global_dae.lu import solved
from reference.global_dae.model import Matrix, Model, typical
from reference.global_dae.stability import stiffness

Array = NDArray[np.float64]

#: Newton iterations of a load step; correction of a gradient that is out of Newton's reach; smallest load step.
ITERATIONS, REACH, SMALLEST = 25, 1.0, 1e-6
#: Digits of the displacements below which an equilibrium is imprecise.
DIGITS = 4.0
#: Corrections of this size are the rounding of coordinates.
COORDINATES = 1e-13
#: Residuals below this many roundings of their largest terms are zero within double precision.
ROUNDINGS = 8.0


@dataclass
class Equilibrium:
    """An equilibrium: load factor, coordinates (rows, nodes) and multipliers divided by their scale."""

    factor: float
    q: Array
    multiplier: Array

    def towards(self, before: "Equilibrium", factor: float) -> "Equilibrium":
        """On the secant through an earlier one."""
        s = (factor - self.factor) / (self.factor - before.factor) if self.factor > before.factor else 0.0
        multiplier = self.multiplier + s * (self.multiplier - before.multiplier)
        return Equilibrium(factor, self.q + s * (self.q - before.q), multiplier)


class Search:
    """Newton's iteration and load stepping for one model."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.scale = typical(stiffness(model))
        self.system = system_of(model, self.scale)
        self.rows = model.rows(self.scale)
        self.loads = load_table(model.scene, np.zeros(1))[0]
        self.places = model.places(1).reshape(-1)
        self.phi = self.scale * model.constraints
        self.data = np.zeros(len(self.system.row) + 1)
        self.scratch = np.zeros(TANGENT_BUFFER), np.zeros((2 * model.bodies.rows, 2 * model.bodies.rows))
        self.buffer, self.force = model.bodies.buffer(), model.bodies.reference()
        self.iterations, self.floor, self.digits, self.node = 0, 0.0, np.inf, 0

    def start(self) -> Equilibrium:
        """The undeformed scene without loads."""
        self.floor, self.digits, self.iterations = 0.0, np.inf, 0
        return Equilibrium(0.0, self.model.bodies.reference(), np.zeros(2 * len(self.model.joints)))

    def reach(self, start: Equilibrium, target: float) -> Equilibrium:
        """Go to a load factor; the last equilibrium on the way if it cannot be reached."""
        now, before, step = start, start, target - start.factor
        while now.factor < target:
            near = target - now.factor <= step * (1.0 + 1e-9)
            found = self.newton(now.towards(before, target if near else now.factor + step))
            if found is not None:
                before, now = now, found
                step *= 2.0
            elif step < SMALLEST:
                break
            else:
                before, step = now, 0.5 * min(step, target - now.factor)
        return now

    def newton(self, guess: Equilibrium) -> Equilibrium | None:
        """The equilibrium near a guess; None if the iteration leaves its reach or is too slow."""
        q, multiplier, last = guess.q.copy(), guess.multiplier.copy(), np.inf
        dofs, tolerance = self.model.dofs, self.model.run.newton_tolerance
        value = guess.factor * self.loads
        for _ in range(ITERATIONS):
            right = self._residual(guess.factor, q, multiplier)
            A = self._matrix(value, q)
            x = solved(A, right)
            if x is None:  # of a mechanism that is in equilibrium as it stands, every place near is one
                return Equilibrium(guess.factor, q, multiplier) if self._rounded(A, q, right) else None
            self.iterations += 1
            change = np.zeros_like(q)
            change.reshape(-1)[self.places[:dofs]] = x[:dofs]
            sizes = self._sizes(change)
            size, self.node = float(sizes.max()), int(sizes.argmax())
            if not size < REACH:
                return None
            q += change
            multiplier += x[dofs:]
            if size <= tolerance:
                return Equilibrium(guess.factor, q, multiplier)
            if size > 0.5 * last and self._rounded(A, q, right):
                moved = float(self._sizes(q - self.model.bodies.reference()).max())
                self.floor = max(self.floor, size)
                self.digits = min(self.digits, max(0.0, float(np.log10(moved / size))))
                return Equilibrium(guess.factor, q, multiplier)
            last = size
        return None

    def _sizes(self, x: Array) -> Array:
        """Largest component at each node, (nodes,): positions relative to the scene's length, gradients as they are."""
        return np.maximum(np.abs(x[:2]).max(axis=0) / self.model.length, np.abs(x[2:]).max(axis=0))

    def _residual(self, factor: float, q: Array, multiplier: Array) -> Array:
        model, parts, dofs = self.model, self.model.parts, self.model.dofs
        elastic_forces(
            parts.formulations, q, parts.first, parts.kinds, parts.constants, self.buffer, self.force
        )
        f = factor * parts.dead - self.force.reshape(-1)
        add_loads(model.loads, factor * self.loads[None], 0, q.reshape(-1), f)
        x = q.reshape(-1)[self.places[:dofs]]
        gap = self.scale * self.rows.reference.reshape(-1) - self.phi @ x
        return np.concatenate([f[self.places[:dofs]] - self.phi.T @ multiplier, gap])

    def _matrix(self, value: Array, q: Array) -> Matrix:
        assemble(self.system, 0.0, self.model.parts, self.model.loads, value, q, *self.scratch, self.data)
        return matrix_of(self.system, self.data)

    def _rounded(self, A: Matrix, q: Array, right: Array) -> bool:
        """Whether the residual is as small as rounding of its terms, |K| |q|, lets it be."""
        dofs = self.model.dofs
        terms = abs(A)[:dofs, :dofs] @ np.abs(q.reshape(-1)[self.places[:dofs]])
        return bool(np.abs(right[:dofs]).max() <= ROUNDINGS * np.finfo(float).eps * terms.max())


def equilibria(model: Model, load_steps: int, solver: str) -> Solution:
    """Equilibria at the load factors 0, 1/load_steps, … 1, as far as they can be reached."""
    search = Search(model)
    search.newton(search.start())  # compiles
    start = process_time(), perf_counter()
    now, status = search.start(), Status()
    factors = np.arange(load_steps + 1) / load_steps
    kept, energies, doubt = [now.q], [_energies(model, now)], Status()
    for before, factor in pairwise(factors):
        try:
            now = search.reach(now, float(factor))
            if now.factor != factor:
                status = _stuck(model, search, now.factor)
                break
            against = _doubt(model, now, float(before))
        except KeyboardInterrupt:
            status = interruption_of_load(float(before))
            break
        kept.append(now.q)
        energies.append(_energies(model, now))
        doubt = doubt if doubt.message else against
    if status.ok and search.floor > 0.0:
        status = _rounded_off(search)
    if status.ok and not doubt.ok:
        status = doubt
    elif doubt.message:
        status = replace(status, message="; ".join(filter(None, (status.message, doubt.message))))
    cost = Cost(
        process_time() - start[0],
        perf_counter() - start[1],
        len(kept) - 1,
        search.iterations,
        search.iterations,
    )
    found = solution(solver, model, factors[: len(kept)], np.array(kept), np.array(energies), cost, status)
    if status.code == "interrupted":
        raise Interrupted(found)
    return found


def _energies(model: Model, e: Equilibrium) -> Array:
    """Kinetic, strain, potential; the work of loads is found where all equilibria are known."""
    parts = model.parts
    strain = strain_energy(parts.formulations, e.q, parts.first, parts.kinds, parts.constants)
    return np.array([0.0, strain, -parts.dead @ (e.q.reshape(-1) - parts.reference), 0.0, 0.0])


def _doubt(model: Model, now: Equilibrium, before: float) -> Status:
    """What is wrong with an equilibrium that is not stable; the one before was at a load factor."""
    found = verdict(model, now.q, now.factor)
    body, element = (None, None) if found.node < 0 else model.bodies.element_at(found.node)
    match found.kind:
        case "stable":
            return Status()
        case "unstable":
            return unstable(now.factor, found.negative, body, element, before)
        case "singular":
            return singular(now.factor, body, element)
        case "unknown":
            return Status("ok", f"stability not known at load factor {now.factor:.6g}: no symmetric pivots")
        case _:
            assert_never(found.kind)


def _stuck(model: Model, search: Search, factor: float) -> Status:
    body, element = model.bodies.element_at(search.node)
    message = (
        f"no equilibrium found beyond {factor:.6g} of the load, body {body!r}, element {element}: the scene may be "
        f"free to move or buckle there; hold it, take more load_steps or a finer mesh"
    )
    return Status("diverged", message, factor, None, body, element)


def _rounded_off(search: Search) -> Status:
    """Status of equilibria found to rounding: a small residual is no small error where K is ill-conditioned."""
    said = f"corrections end at {search.floor:.1e}: the residual is as small as rounding allows"
    if search.floor < COORDINATES or search.digits >= DIGITS:
        return Status("ok", said)
    digits = f"{search.digits:.0f}" if search.digits >= 1.0 else "no"
    return Status(
        "imprecise",
        f"{said}, and {digits} digits of the displacements can be trusted; a coarser mesh is needed",
    )
