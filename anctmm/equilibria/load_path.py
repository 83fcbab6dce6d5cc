"""Newton's iteration along a growing load: an equilibrium near the one before, stable or not."""

import numpy as np
from numpy.typing import NDArray

from anctmm.equilibria.balance import Balance, Configuration, Tangent
from anctmm.equilibria.stability import stability_of
from anctmm.results.checks.finding import part
from anctmm.results.status import Status

Array = NDArray[np.float64]

#: Corrections of one load step before it is halved, and a correction that is out of Newton's reach.
ITERATIONS, REACH = 20, 0.7
#: Largest turn of a rotational spring in a load step, rad: its turns are counted.
HALF = 1.5
#: Smallest load step, of the whole load.
SMALLEST = 1e-6
#: Corrections below which those that no longer fall are rounding; values of rows, of the length, that count as none.
ROUNDING, KEPT = 1e-6, 1e-9
#: Shift, of the square of the highest frequency, that outweighs all stiffness.
HEAVY = 1e6
#: Digits of the displacements below which an equilibrium is imprecise; errors that are the rounding of coordinates.
DIGITS, COORDINATES = 4.0, 1e-13


class LoadPath:
    """State of the search for equilibria.

    Parameters
    ----------
    balance : Balance

    Attributes
    ----------
    at, factor : Configuration and float
        The equilibrium reached.
    before : (float, Configuration) or None
        The one before, for a secant.
    iterations : int
        Newton corrections so far.
    error : float
        The largest rounding error of an equilibrium, relative to its displacements.
    size : ndarray, shape (nodes,)
        The correction tried last.
    notes : list of str
        What the user should know of how equilibria were found.
    """

    def __init__(self, balance: Balance) -> None:
        self.balance, self.at, self.factor = balance, balance.start, 0.0
        self.before: tuple[float, Configuration] | None = None
        self.iterations, self.error, self.floor = 0, 0.0, 0.0
        self.size = np.zeros(balance.mesh.nodes)
        self.notes: list[str] = []

    def reach(self, target: float) -> Status | None:
        """Go to a load factor, in as many steps as needed; a status if it cannot be reached."""
        step = target - self.factor
        while target - self.factor > 1e-12:
            step = min(step, target - self.factor)
            new = self.newton(self._predicted(step), self.factor + step)
            if new is not None and self.balance.turned(self.at, new) < HALF:
                self.before = (self.factor, self.at)
                self.at, self.factor = new, self.factor + step
                step *= 2.0
                continue
            self.before = None
            step *= 0.5
            if step < SMALLEST or self._free:
                return self.stuck(self.factor + step)
        return None

    @property
    def _free(self) -> bool:
        """Whether a motion needs no force where the search is: Newton's corrections along it are rounding."""
        return stability_of(self.balance, self.at, self.factor).kind == "singular"

    def _predicted(self, step: float) -> Configuration:
        """The configuration a load step ahead, by the secant."""
        if self.before is None:
            return self.at
        factor, at = self.before
        part = step / (self.factor - factor)
        more = part * (self.at.multipliers - at.multipliers)
        return self.balance.moved(self.at, self.balance.unknowns(part * (self.at.q - at.q)), more)

    def newton(self, at: Configuration, factor: float) -> Configuration | None:
        """The equilibrium that Newton's iteration finds from a configuration; None if it finds none."""
        balance, last, stalled, supported = self.balance, np.inf, 0, not len(at.multipliers)
        for _ in range(ITERATIONS):
            x, more = Tangent(balance, at, factor).correction()
            self.iterations += 1
            self.size = balance.sizes(x)
            size = float(self.size.max(initial=0.0))
            if not size < REACH:  # or not a number
                if supported:
                    return self._balanced(at, factor)
                at, supported = self._supported(at, factor), True
                continue
            at = balance.moved(at, x, more)
            if not balance.missed(at) <= KEPT * balance.system.scene.length:
                last = size
                continue
            if size <= balance.system.run.newton_tolerance:
                return at
            stalled = stalled + 1 if size > 0.5 * last and size < ROUNDING else 0
            if stalled == 2:
                self._doubt(at, size)
                return at
            last = size
        return None

    def _supported(self, at: Configuration, factor: float) -> Configuration:
        """The same with the multipliers that balance forces best: the stiffness of what hangs comes of them alone."""
        balance = self.balance
        heavy = Tangent(balance, at, factor, HEAVY * balance.largest_square)
        more = heavy.solve(balance.residual(at, factor)[0])[1]
        return at._replace(multipliers=at.multipliers + more)

    def _balanced(self, at: Configuration, factor: float) -> Configuration | None:
        """The configuration, if forces vanish there though the tangent cannot be solved with; else None."""
        x, more = Tangent(self.balance, at, factor, self.balance.least_shift).correction()
        small = self.balance.sizes(x).max(initial=0.0) <= self.balance.system.run.newton_tolerance
        return self.balance.moved(at, x, more) if small else None

    def _doubt(self, at: Configuration, left: float) -> None:
        """Note the rounding that is left of an equilibrium."""
        moved = float(np.abs((at.q - self.balance.start.q) * self.balance.weight).max())
        self.floor = max(self.floor, left)
        if left > COORDINATES and moved > 0.0:
            self.error = max(self.error, left / moved)

    def adopt(self, target: float, at: Configuration) -> Status | None:
        """Take over an equilibrium found otherwise, as exact as Newton's iteration makes it; a status if it is none."""
        found = self.newton(at, target)
        if found is None and stability_of(self.balance, at, target).kind != "singular":
            return self.stuck(self.factor)
        self.at, self.factor, self.before = found or at, target, None
        return None

    def precision(self) -> Status:
        """Status of a search that came to its end: what rounding has left."""
        if self.error > 10.0**-DIGITS:
            digits = max(int(-np.log10(self.error)), 0)
            return Status(
                "imprecise",
                f"about {digits} digits of the displacements can be trusted: the mesh is very fine, the scene is far "
                f"from the origin, or its parts are too unlike in stiffness; a coarser mesh, a place closer to "
                f"the origin, or a rigid body in the place of the stiffest part may help",
            )
        if self.floor > self.balance.system.run.newton_tolerance:
            return Status(
                "ok", f"corrections do not decrease below {self.floor:.1e}, the round-off level of this scene"
            )
        return Status()

    def stuck(self, factor: float, stable: bool = False) -> Status:
        """Status of a search that finds no equilibrium, or no stable one, beyond a load factor."""
        balance = self.balance
        found = stability_of(balance, self.at, self.factor)
        if found.kind == "singular":
            body, element = worst(balance, balance.sizes(found.motion))
            why = "the tangent stiffness is singular there, the scene is free to move: hold it"
        else:
            body, element = worst(balance, self.size)
            mesh = " or a finer mesh" if balance.system.scene.beams else ""
            why = f"the scene may be free to move, or buckle there: other supports, more load_steps{mesh} may help"
        kind, other = ("stable ", "") if stable else ("", "; branch='stable' may find another one")
        return Status(
            "diverged",
            f"no {kind}equilibrium found beyond {factor:.6g} of the load, worst in {part(body, element)}; {why}{other}",
            time=factor,
            body=body,
            element=element,
        )


def worst(balance: Balance, sizes: Array) -> tuple[str, int | None]:
    """Body and element next to the node of the largest (or first not finite) of sizes, (nodes,)."""
    bad = np.flatnonzero(~np.isfinite(sizes))
    return balance.mesh.body_at(int(bad[0]) if bad.size else int(np.argmax(sizes)))
