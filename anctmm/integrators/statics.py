"""Statics by ANC-TMM: Newton's iteration on K_T, solved by the Riccati recursion, with load steps."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import elastic_forces, strain_energy
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation, discretise
from anctmm.errors import DiscretisationError
from anctmm.forces.actuation import Actuation, set_loads
from anctmm.integrators.output import Record, worst_element
from anctmm.integrators.stability import DIFFERENCE
from anctmm.model.scene import Scene
from anctmm.recursion.border import refuse_rigid
from anctmm.recursion.riccati import block_factors, factorize, links, solve
from anctmm.results.solution import Solution, Status

Array = NDArray[np.float64]

#: Corrections of one load step before it is halved.
ITERATIONS = 20
#: A gradient corrected by more than this is out of Newton's reach: the load step is halved at once.
REACH = 0.7
#: Smallest load step, of the whole load.
SMALLEST = 1e-6
#: Corrections that no longer fall count as rounding below this size.
ROUNDING = 1e-6
#: Digits of the displacements below which a rest position is imprecise.
DIGITS = 4.0
#: Nodes from which on the error of a solve is looked at: it grows with the fourth power of their number.
MANY = 1_000
#: Errors of this size are the rounding of coordinates: no digit is lost to them.
COORDINATES = 1e-13
COARSER = "rounding grows with the fourth power of the number of elements; a coarser mesh is needed"
#: Relative error of a solve from which on Newton's iteration may not mend it, and from which on it does not.
DOUBTFUL, HOPELESS = 0.1, 0.9


def solve_static(
    scene: Scene, run: Discretisation | None = None, *, load_steps: int = 1, **options: Any
) -> Solution:
    """Equilibrium of a scene under gravity and the loads of t = 0.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its fields as keywords; only mesh, element, quadrature and newton_tolerance matter.
    load_steps : int
        Equal parts of the load whose equilibria are kept. A part that Newton's iteration does not reach is halved as
        often as needed.

    Returns
    -------
    Solution
        `t` holds the load factors from 0 to 1; the last output is the equilibrium under the whole load. Where rounding
        leaves fewer than four digits of it, as on very fine meshes, the status is "imprecise" and says how many.

    Raises
    ------
    DiscretisationError
        If the options are wrong or do not fit the scene.
    """
    if isinstance(load_steps, bool) or not isinstance(load_steps, int) or load_steps < 1:
        raise DiscretisationError(f"load_steps is {load_steps!r}; a whole number from 1 on is needed")
    chain = Chain(scene, discretise(run, options))
    refuse_rigid(chain, "statics")
    search = _Search(chain)
    search.newton(0.0)
    search.reset()
    factors = np.arange(load_steps + 1) / load_steps
    record = Record(chain, outputs=load_steps + 1)
    record.start()
    status, kept = Status(), 1
    search.store(record, 0)
    for k in range(1, load_steps + 1):
        failure = search.reach(float(factors[k]))
        if failure is not None:
            status = failure
            break
        search.store(record, k)
        kept = k + 1
    if status.ok:
        status = search.precision()
    return record.solution(kept, status, kept - 1, search.iterations, search.iterations, t=factors[:kept])


@dataclass
class _Search:
    """State of the search for an equilibrium: q at the load factor reached, and the one before for a secant."""

    chain: Chain

    def __post_init__(self) -> None:
        bodies = self.chain.bodies
        actuation = Actuation(self.chain.scene, bodies)
        self.values = actuation.load_table(np.zeros(1))[0]
        self.loads = actuation.loads()
        self.factors, self.tables = block_factors(bodies.nodes, bodies.rows), bodies.tables()
        self.load = np.empty((bodies.rows, bodies.nodes))
        self.reset()

    def reset(self) -> None:
        """Back to the undeformed scene."""
        self.q = self.chain.bodies.reference()
        self.before: tuple[float, Array] | None = None
        self.factor, self.iterations, self.floor, self.digits = 0.0, 0, 0.0, np.inf
        self.size = np.zeros(self.chain.bodies.nodes)

    def reach(self, target: float) -> Status | None:
        """Go to a load factor, in as many steps as needed; a status if it cannot be reached."""
        step = target - self.factor
        if self.blur >= HOPELESS:
            return self._blurred(self.factor)
        while target - self.factor > 1e-12:
            step = min(step, target - self.factor)
            kept = self.q.copy()
            if self.before is not None:
                self.q += (self.q - self.before[1]) * (step / (self.factor - self.before[0]))
            if self.newton(self.factor + step):
                self.before = (self.factor, kept)
                self.factor += step
                step *= 2.0
                continue
            self.q, self.before = kept, None
            if self.blur >= DOUBTFUL:
                return self._blurred(self.factor)
            step *= 0.5
            if step < SMALLEST:
                return self._stuck(self.factor + step)
        return None

    def newton(self, factor: float) -> bool:
        """Newton's iteration at a load factor, starting from q."""
        last, stalled = np.inf, 0
        dead = factor * self.chain.dead_load
        total = dead.copy()
        for _ in range(ITERATIONS):
            values = factor * self.values
            set_loads(self.q, total, dead, self.loads, values)
            self._elastic()
            factorize(self.q, self.tables, links(self.chain), 0.0, 1.0, self.loads, values, self.factors)
            x = solve(self.factors, total - self.load)
            self.size = self._sizes(x)
            size = float(self.size.max())
            self.iterations += 1
            if not size < REACH:
                return False
            self.q += x
            if size <= self.chain.run.newton_tolerance:
                self._trust(size * min(self.blur / (1.0 - self.blur), 1.0) if self.blur < 1.0 else size)
                return True
            stalled = stalled + 1 if size > 0.5 * last and size < ROUNDING else 0
            if stalled == 2:
                self.floor = max(self.floor, size)
                self._trust(size)
                return True
            last = size
        return False

    def _trust(self, left: float) -> None:
        """Count the digits of the displacements that an error of this size leaves."""
        moved = float(self._sizes(self.q - self.chain.bodies.reference()).max())
        if left > COORDINATES:
            self.digits = min(self.digits, max(0.0, float(np.log10(moved / left))))

    def _sizes(self, x: Array) -> Array:
        """Largest component at each node, (nodes,): positions relative to the scene's length, gradients as they are."""
        return np.maximum(np.abs(x[:2]).max(axis=0) / self.chain.length, np.abs(x[2:]).max(axis=0))

    @cached_property
    def blur(self) -> float:
        """Relative error of a solve with K_T of the undeformed scene, from one step of iterative refinement.

        0 for meshes too coarse to have one, and for a scene that cannot stand on any mesh.
        """
        chain = self.chain
        if chain.bodies.nodes < MANY:
            return 0.0
        coarse = {name: min(elements, 2) for name, (elements, _) in chain.run.of(chain.scene).items()}
        stands = _Search(Chain(chain.scene, replace(chain.run, mesh=coarse)))._solve_error() < DOUBTFUL
        return self._solve_error() if stands else 0.0

    def _solve_error(self) -> float:
        t, q, load = self.tables, self.chain.bodies.reference(), self.chain.dead_load.copy()
        set_loads(q, load, self.chain.dead_load, self.loads, self.values)
        if not load.any():
            return 0.0
        factorize(q, t, links(self.chain), 0.0, 1.0, self.loads, 0.0 * self.values, self.factors)
        with np.errstate(all="ignore"):
            x = solve(self.factors, load)
            h = DIFFERENCE / float(self._sizes(x).max())
            ends = np.empty((2, *q.shape))
            for end, place in zip(ends, (q + h * x, q - h * x), strict=True):
                elastic_forces(t.blend, place, t.first, t.kinds, t.constants, t.buffer, end)
            error = solve(self.factors, load - (ends[0] - ends[1]) / (2.0 * h))
            found = float(self._sizes(error).max() / self._sizes(x).max())
        return found if np.isfinite(found) else np.inf

    def precision(self) -> Status:
        """Status of a search that came to its end: what rounding has left."""
        if self.digits < DIGITS:
            return Status(
                "imprecise", f"{_digits(self.digits)} of the displacements can be trusted: {COARSER}"
            )
        if self.floor > self.chain.run.newton_tolerance:
            return Status("ok", f"corrections stop falling at {self.floor:.1e}, the rounding of this scene")
        return Status()

    def _blurred(self, factor: float) -> Status:
        """Status of a search that ends because solves have lost their digits."""
        return Status(
            "imprecise",
            f"{_digits(-float(np.log10(self.blur)))} of a solve with {self.chain.bodies.nodes} nodes can be trusted, "
            f"and so no equilibrium beyond {factor:.6g} of the load: {COARSER}",
            time=factor,
        )

    def _elastic(self) -> None:
        t = self.tables
        elastic_forces(t.blend, self.q, t.first, t.kinds, t.constants, t.buffer, self.load)

    def store(self, record: Record, place: int) -> None:
        """Keep the equilibrium reached."""
        bodies = self.chain.bodies
        record.q[place] = self.q
        record.energy[place, 1] = strain_energy(
            bodies.blend, self.q, bodies.first, bodies.kinds, bodies.constants
        )

    def _stuck(self, factor: float) -> Status:
        body, element = worst_element(self.chain, self.size)
        return Status(
            "diverged",
            f"no equilibrium found beyond {factor:.6g} of the load, worst in element {element} of body {body!r}; "
            f"the scene may be free to move, or buckle there: hold it, add load_steps or refine the mesh",
            time=factor,
            body=body,
            element=element,
        )


def _digits(count: float) -> str:
    """A number of digits in words."""
    whole = int(max(count, 0.0))
    return "no digit" if whole == 0 else f"about {whole} digit{'s' if whole > 1 else ''}"
