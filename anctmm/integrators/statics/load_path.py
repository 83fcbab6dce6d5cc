"""Newton's iteration with K_T along a growing load: an equilibrium near the one before, stable or not."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.integrators.output import worst_element
from anctmm.integrators.stability import DIFFERENCE
from anctmm.integrators.statics.equilibrium_stability import least_shift, stability_of
from anctmm.integrators.statics.static_system import StaticSystem
from anctmm.results.checks.finding import part
from anctmm.results.status import Status

Array = NDArray[np.float64]

#: Corrections of one load step before it is halved.
ITERATIONS = 20
#: A gradient corrected by more than this is out of Newton's reach: the load step is halved at once.
REACH = 0.7
#: Largest turn of a rotational spring in a load step, rad: its turns are counted.
HALF = 1.5
#: Smallest load step, of the whole load.
SMALLEST = 1e-6
#: Corrections that no longer fall count as rounding below this size.
ROUNDING = 1e-6
#: Digits of the displacements below which an equilibrium is imprecise.
DIGITS = 4.0
#: Nodes from which on the error of a solve is looked at: it grows with the fourth power of their number.
MANY = 1_000
#: Errors of this size are the rounding of coordinates: no digit is lost to them.
COORDINATES = 1e-13
COARSER = "rounding grows with the fourth power of the number of elements; a coarser mesh is needed"
#: What may leave few digits on meshes of fewer nodes.
UNLIKE = (
    "the scene is far from the origin, or its parts are too unlike in stiffness; a place closer to the origin, or a "
    "rigid body in the place of the stiffest part, may help"
)
#: Relative error of a solve from which on Newton's iteration may not correct it, and from which on it does not.
DOUBTFUL, HOPELESS = 0.1, 0.9


class LoadPath:
    """State of the search for equilibria: q at the load factor reached, and the one before for a secant.

    Parameters
    ----------
    chain : Chain
    """

    def __init__(self, chain: Chain) -> None:
        self.chain, self.system = chain, StaticSystem(chain)
        self.reset()

    def reset(self) -> None:
        """Back to the undeformed scene."""
        self.q = self.system.reference.copy()
        self.system.restart()
        #: Those at the equilibrium reached.
        self.turns = self.system.turns()
        self.before: tuple[float, Array] | None = None
        self.factor, self.iterations, self.floor = 0.0, 0, 0.0
        #: Of the displacements, at the equilibrium reached and the fewest of those that are kept.
        self.digits = self.fewest = np.inf
        self.size = np.zeros(self.chain.bodies.nodes)
        #: What the user should know of how equilibria were found.
        self.notes: list[str] = []

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
                self.system.turning.follow(self.q)
            if self.newton(self.factor + step) and self.system.turned(self.q, self.factor + step) < HALF:
                self.before = (self.factor, kept)
                self._reached(self.factor + step)
                step *= 2.0
                continue
            self.q, self.before = kept, None
            self.system.accept_again(self.turns)
            if self.blur >= DOUBTFUL:
                return self._blurred(self.factor)
            step *= 0.5
            if step < SMALLEST:
                return self.stuck(self.factor + step)
        return None

    def newton(self, factor: float) -> bool:
        """Newton's iteration at a load factor, starting from q."""
        last, stalled = np.inf, 0
        for _ in range(ITERATIONS):
            self.system.factorize(self.q, factor)
            x = self.system.correction(self.q, factor)
            self.iterations += 1
            if not np.isfinite(x).all():
                return self._balanced(factor)
            self.size = self.system.sizes(x)
            size = float(self.size.max())
            if not size < REACH:
                return False
            self.q += x
            self.system.turning.follow(self.q)
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

    def _balanced(self, factor: float) -> bool:
        """Whether q, where the tangent cannot be solved with, is an equilibrium all the same."""
        self.system.factorize(self.q, factor, least_shift(self.system))
        self.size = self.system.sizes(self.system.correction(self.q, factor))
        return float(self.size.max()) <= self.chain.run.newton_tolerance

    def _trust(self, left: float) -> None:
        """Count the digits of the displacements that an error of this size leaves."""
        moved = self.system.size(self.q - self.system.reference)
        known = left > COORDINATES and moved > 0.0
        self.digits = max(0.0, float(np.log10(moved / left))) if known else np.inf

    @cached_property
    def blur(self) -> float:
        """Relative error of a solve with K_T of the undeformed scene, from one step of iterative refinement.

        0 for meshes too coarse to have one, and for a scene that cannot stand on any mesh.
        """
        chain = self.chain
        if chain.bodies.nodes < MANY:
            return 0.0
        stands = LoadPath(chain.coarser(2))._solve_error() < DOUBTFUL
        return self._solve_error() if stands else 0.0

    def _solve_error(self) -> float:
        system, q = self.system, self.system.reference
        load = system.applied(q, 1.0)
        if not load.any():
            return 0.0
        system.factorize(q, 0.0)
        x = system.solve(load)
        with np.errstate(all="ignore"):
            h = DIFFERENCE / system.size(x)
            difference = system.elastic_forces(q + h * x).copy() - system.elastic_forces(q - h * x)
            error = system.solve(load - difference / (2.0 * h))
            found = system.size(error) / system.size(x)
        return found if np.isfinite(found) else np.inf

    def precision(self) -> Status:
        """Status of a search that came to its end: what rounding has left."""
        if self.fewest < DIGITS:
            why = COARSER if self.chain.bodies.nodes >= MANY else UNLIKE
            return Status("imprecise", f"{_digits(self.fewest)} of the displacements can be trusted: {why}")
        if self.floor > self.chain.run.newton_tolerance:
            return Status(
                "ok", f"corrections do not decrease below {self.floor:.1e}, the round-off level of this scene"
            )
        return Status()

    def _blurred(self, factor: float) -> Status:
        """Status of a search that ends because solves have lost their digits."""
        return Status(
            "imprecise",
            f"{_digits(-float(np.log10(self.blur)))} of a solve with {self.chain.bodies.nodes} nodes can be trusted, "
            f"and so no equilibrium beyond {factor:.6g} of the load: {COARSER}",
            time=factor,
        )

    def adopt(self, target: float, q: Array) -> Status | None:
        """Take over an equilibrium found otherwise, as exact as Newton's iteration makes it; a status if it is none.

        The turns there are those that `system` has counted.
        """
        kept, turns, self.q = self.q, self.system.turns(), q.copy()
        if not self.newton(target):
            if stability_of(self.system, q, target).kind != "singular":
                self.q = kept
                return self.stuck(self.factor)
            self.q = q.copy()
            self.system.accept_again(turns)
        self.before = None
        self._reached(target)
        return None

    def _reached(self, factor: float) -> None:
        """Take q for the equilibrium at a load factor."""
        self.factor = factor
        self.system.accept(self.q, factor)
        self.turns = self.system.turns()

    def stuck(self, factor: float, stable: bool = False) -> Status:
        """Status of a search that finds no equilibrium, or no stable one, beyond a load factor."""
        self.system.accept_again(self.turns)
        found = stability_of(self.system, self.q, self.factor)
        if found.kind == "singular":
            body, element = worst_element(self.chain, self.system.sizes(found.motion))
            why = "the tangent stiffness is singular there, the scene is free to move: hold it"
        else:
            body, element = worst_element(self.chain, self.size)
            mesh = " or a finer mesh" if self.chain.scene.beams else ""
            why = f"the scene may be free to move, or buckle there: other supports, more load_steps{mesh} may help"
        kind, else_ = ("stable ", "") if stable else ("", "; branch='stable' may find another one")
        return Status(
            "diverged",
            f"no {kind}equilibrium found beyond {factor:.6g} of the load, worst in {part(body, element)}; {why}{else_}",
            time=factor,
            body=body,
            element=element,
        )


def _digits(count: float) -> str:
    """A number of digits in words."""
    whole = int(max(count, 0.0))
    return "no digit" if whole == 0 else f"about {whole} digit{'s' if whole > 1 else ''}"
