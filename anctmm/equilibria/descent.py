"""The stable branch of equilibria: minimisation of the potential energy while the load grows.

From each equilibrium the load is increased a little, and the energy is minimised by Newton's method with K + μ M,
where μ is so large that the matrix is positive definite and the step not too long (Levenberg and Marquardt, with the
mass matrix as the metric: implicit Euler steps of an overdamped motion). Where the forces vanish but the energy has no
minimum, the scene is moved along the mode of the lowest, negative eigenvalue. The result is the one of slow loading
with strong damping, jumps included.

The fall of the energy in a step is the work of the residual f − Jᵀλ along the chord, by Simpson's rule: of products of
vectors, which rows are, that is exact, and the rows' own part vanishes. So no energy is needed of what has none.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.equilibria.balance import Balance, Configuration, Tangent
from anctmm.equilibria.stability import stability_of
from anctmm.validation import EPS

Array = NDArray[np.float64]

#: Parts of the load: largest step; smallest one, in which a scene may move as far as it likes.
STEP, SMALLEST = 1.0 / 8.0, 1.0 / 512.0
#: Displacements, relative: above which a larger step of the load is halved, and above which a scene moves for ever.
MOTION, FAR = 0.25, 1e3
#: Longest correction; corrections tried in a minimisation.
REACH, TRIED = 0.3, 1_500
#: Largest correction of an overdamped motion; its steps at most.
SLOW, SETTLING = 0.1, 2_000
#: Parts of the fall of energy that the tangent predicts: asked for, and such that μ may become smaller.
ENOUGH, GOOD = 0.1, 0.75
#: Corrections below which Newton's iteration needs no look at the energy, and below which forces count as none.
NEAR, BALANCED = 1e-4, 1e-7
#: Displacements, tried in turn, by which an unstable equilibrium is left.
PUSHES = (1e-2, 1e-3, 1e-4, 1e-5)
#: A side is taken for that of the mode unless the energy falls by this part more on the other.
TIE = 1e-3
#: Shift, of the square of the highest frequency, that outweighs all stiffness.
HEAVY = 1e12


class Stable(NamedTuple):
    """A stable equilibrium and its load factor."""

    factor: float
    at: Configuration


def stable_path(
    balance: Balance, start: Configuration, factor: float = 0.0, target: float = 1.0
) -> Iterator[Stable]:
    """Stable equilibria under growing loads, up to a target or as far as found.

    Parameters
    ----------
    balance : Balance
    start : Configuration
    factor, target : float
        Load factors at the start and at the end.
    """
    here, step = Stable(factor, start), STEP
    yield here
    while here.factor < target:
        ahead = target if step > 0.999 * (target - here.factor) else here.factor + step
        new = downhill(balance, here.at, ahead, MOTION if step > SMALLEST else FAR)
        if new is not None:
            here = Stable(ahead, new)
            yield here
            step = min(2.0 * step, STEP)
        elif step > SMALLEST:
            step *= 0.5
        else:
            return


def downhill(
    balance: Balance, start: Configuration, factor: float, motion: float = np.inf
) -> Configuration | None:
    """The minimum of the potential energy that lies downhill of a start; None where none is found.

    Where a motion needs no force the minimum is not strict: any of its places will do.

    Parameters
    ----------
    balance : Balance
    start : Configuration
    factor : float
        Part of the load.
    motion : float
        Displacement from the start, relative, beyond which the search is given up.
    """
    at, shift, least, most = start, 0.0, balance.least_shift, HEAVY * balance.largest_square
    for _ in range(TRIED):
        tangent, shift = _definite(balance, at, factor, shift, least, most)
        if tangent is None:
            return None
        x, more = tangent.correction()
        size = _size(balance, x)
        if size <= BALANCED:
            at = balance.moved(at, x, more)
            if shift == 0.0:
                return at
            found = stability_of(balance, at, factor)
            if found.kind != "unstable":
                return at
            left = _left(tangent, found.motion)
            if left is None:
                return None
            at, shift = left, 0.0
            continue
        gain, new = _step(tangent, x, more, shift) if size <= REACH else (0.0, at)
        if not gain >= ENOUGH:
            shift = max(4.0 * shift, least)
            continue
        at = new
        if not _apart(balance, at, start) <= motion:
            return None
        if gain > GOOD:
            shift = 0.25 * shift if shift > 4.0 * least else 0.0
    return None


def settled(balance: Balance, start: Configuration, factor: float) -> Configuration | None:
    """The equilibrium in which an overdamped motion from a start ends: for forces without a potential.

    Implicit Euler steps of M q' = residual, 1/shift long, which grow where the motion is slow (pseudo-transient
    continuation, Kelley & Keyes 1998, DOI 10.1137/S0036142996304796). None where the motion does not end.
    """
    at, least, pushes = start, balance.least_shift, iter(PUSHES)
    shift, most = least, HEAVY * balance.largest_square
    for _ in range(SETTLING):
        tangent, shift = _definite(balance, at, factor, shift, least, most)
        if tangent is None:
            return None
        x, more = tangent.correction()
        size = _size(balance, x)
        if size <= BALANCED and shift == 0.0:
            return balance.moved(at, x, more)
        new = tangent.projected(balance.moved(at, x, more)) if size <= SLOW else None
        if new is None:
            shift = max(4.0 * shift, least)
            continue
        at = new
        if not _apart(balance, at, start) <= FAR:
            return None
        if size <= BALANCED and (found := stability_of(balance, at, factor)).kind != "stable":
            push = next(pushes, None) if found.kind == "unstable" else None
            if push is None:
                return at
            at = tangent.projected(balance.moved(at, push * found.motion)) or at
        if size <= 0.5 * SLOW:
            shift = 0.25 * shift if shift > 4.0 * least else 0.0
    return None


def _definite(
    balance: Balance, at: Configuration, factor: float, shift: float, least: float, most: float
) -> tuple[Tangent | None, float]:
    """K + μ M that is positive definite, and its μ, at least `shift`; None if that takes more than the most."""
    while shift <= most:
        tangent = Tangent(balance, at, factor, shift)
        if not tangent.negative:
            return tangent, shift
        shift = max(4.0 * shift, least)
    return None, shift


def _size(balance: Balance, x: Array) -> float:
    return float(balance.sizes(x).max(initial=0.0))


def _apart(balance: Balance, one: Configuration, two: Configuration) -> float:
    return float(np.abs((one.q - two.q) * balance.weight).max())


def _step(tangent: Tangent, x: Array, more: Array, shift: float) -> tuple[float, Configuration]:
    """Fall of the energy in a step of that which the tangent predicts, and the configuration behind the step.

    Rounding is no fall: a step that predicts no more is a free motion, which a larger μ ends.
    """
    balance, at = tangent.balance, tangent.at
    new = tangent.projected(balance.moved(at, x, more))
    if new is None:
        return 0.0, at
    if shift == 0.0 and _size(balance, x) <= NEAR:
        return 1.0, new
    force = balance.residual(at._replace(multipliers=new.multipliers), tangent.factor)[0]
    predicted = 0.5 * float(force @ x + shift * (x @ (balance.mass @ x)))
    noise = EPS * float(np.abs(x) @ (abs(tangent.K) @ np.abs(balance.unknowns(at.q))))
    if shift > 0.0 and predicted <= noise:
        return 0.0, at
    return (noise + _fall(tangent, new)) / (noise + predicted), new


def _fall(tangent: Tangent, new: Configuration) -> float:
    """Fall of the energy from the configuration of a tangent to another one, J."""
    balance, at = tangent.balance, tangent.at
    way = balance.unknowns(new.q - at.q)
    middle = balance.moved(at, 0.5 * way)
    places = (at, 1.0), (middle, 4.0), (new, 1.0)
    forces = [
        weight * balance.residual(place._replace(multipliers=new.multipliers), tangent.factor)[0]
        for place, weight in places
    ]
    return float(sum(forces) @ way) / 6.0


def _left(tangent: Tangent, mode: Array) -> Configuration | None:
    """An unstable equilibrium left along its lowest mode, to where the energy falls more; None if it does not."""
    balance, at = tangent.balance, tangent.at
    for push in PUSHES:
        one, other = (tangent.projected(balance.moved(at, side * mode)) for side in (push, -push))
        if one is None or other is None:
            continue
        falls = _fall(tangent, one), _fall(tangent, other)
        if max(falls) > 0.0:
            return other if falls[1] > falls[0] * (1.0 + TIE) else one
    return None
