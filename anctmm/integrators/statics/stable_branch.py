"""The stable branch of equilibria: minimisation of the potential energy while the load grows.

From each equilibrium the load is increased a little, and the energy is minimised by Newton's method with K_T + μ M,
where μ is so large that the matrix is positive definite and the step not too long (Levenberg and Marquardt, with the
mass matrix as the metric: implicit Euler steps of an overdamped motion). Where the forces vanish but the energy has no
minimum, the scene is moved along the mode of the lowest, negative eigenvalue. The result is the one of slow loading
with strong damping, jumps included.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.integrators.statics.equilibrium_stability import (
    HEAVY,
    largest_square,
    least_shift,
    lowest_mode,
    stability_of,
)
from anctmm.integrators.statics.static_system import StaticSystem, Turns

Array = NDArray[np.float64]

#: Parts of the load: largest step; smallest one, in which a scene may move as far as it likes.
STEP, SMALLEST = 1.0 / 8.0, 1.0 / 512.0
#: Displacements, relative: above which a larger step of the load is halved, and above which a scene moves for ever.
MOTION, FAR = 0.25, 1e3
#: Longest correction; corrections tried in a minimisation.
REACH, TRIED = 0.3, 5_000
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
#: Relative rounding of an energy.
ROUNDING = 1e-13


class Stable(NamedTuple):
    """A stable equilibrium: its load factor, coordinates, (rows, nodes), and turns."""

    factor: float
    q: Array
    turns: Turns


def stable_path(
    system: StaticSystem, start: Array | None = None, factor: float = 0.0, target: float = 1.0
) -> Iterator[Stable]:
    """Stable equilibria under growing loads, up to a target or as far as found; the system is left with their turns.

    Parameters
    ----------
    system : StaticSystem
    start : ndarray, shape (rows, nodes), optional
        Coordinates to start from; those of the undeformed scene without it.
    factor, target : float
        Load factors at the start and at the end.
    """
    here, step = Stable(factor, (system.reference if start is None else start).copy(), system.turns()), STEP
    yield here
    while here.factor < target:
        ahead = target if step > 0.999 * (target - here.factor) else here.factor + step
        system.accept_again(here.turns)
        new = downhill(system, here.q, ahead, MOTION if step > SMALLEST else FAR)
        if new is not None:
            here = Stable(ahead, new, system.turns())
            yield here
            step = min(2.0 * step, STEP)
        elif step > SMALLEST:
            step *= 0.5
        else:
            return


def downhill(system: StaticSystem, start: Array, factor: float, motion: float = np.inf) -> Array | None:
    """The minimum of the potential energy that lies downhill of a start; turns are counted on the way if it is found.

    Parameters
    ----------
    system : StaticSystem
    start : ndarray, shape (rows, nodes)
    factor : float
        Part of the load.
    motion : float
        Displacement from the start, relative, beyond which the search is given up.

    Returns
    -------
    ndarray, shape (rows, nodes), or None
        None where none is found. Where a motion needs no force the minimum is not strict: any of its places will do.
    """
    q, shift, least, turns = start.copy(), 0.0, least_shift(system), system.turns()
    most = HEAVY * largest_square(system)
    for _ in range(TRIED):
        force = system.residual(q, factor)
        while system.factorize(q, factor, shift) > 0 and shift <= most:
            shift = max(4.0 * shift, least)
        if shift > most:
            break
        x = system.correction(q, factor)
        size = system.size(x)
        if size <= BALANCED:
            if shift == 0.0:
                return q + x
            if stability_of(system, q, factor).kind == "singular":
                return q
            q, shift = _left(system, q, factor), 0.0
            continue
        if _is_rounding(system, q, x, force, factor, shift):
            shift = max(4.0 * shift, least)
            continue
        new = system.projected(q + x, factor, shift) if size <= REACH else None
        sure = shift == 0.0 and size <= NEAR
        gain = 1.0 if new is None or sure else _gain(system, q, new, x, force, factor, shift)
        if new is None or not gain >= ENOUGH:
            shift = max(4.0 * shift, least)
            continue
        q = new
        system.accept(q, factor)
        if not system.size(q - start) <= motion:
            system.accept_again(turns)
            return None
        if gain > GOOD:
            shift = 0.25 * shift if shift > 4.0 * least else 0.0
    system.accept_again(turns)
    return None


def settled(system: StaticSystem, start: Array, factor: float) -> Array | None:
    """The equilibrium in which an overdamped motion from a start ends: for forces without a potential.

    Turns are counted on the way if it is found.

    Implicit Euler steps of M q' = residual, 1/shift long, which grow where the motion is slow (pseudo-transient
    continuation, Kelley & Keyes 1998, DOI 10.1137/S0036142996304796).

    Parameters
    ----------
    system : StaticSystem
    start : ndarray, shape (rows, nodes)
    factor : float
        Part of the load.

    Returns
    -------
    ndarray, shape (rows, nodes), or None
        None where the motion does not end.
    """
    q, least, turns, pushes = start.copy(), least_shift(system), system.turns(), iter(PUSHES)
    shift, most = least, HEAVY * largest_square(system)
    for _ in range(SETTLING):
        while system.factorize(q, factor, shift) > 0 and shift <= most:
            shift = max(2.0 * shift, least)
        if shift > most:
            break
        x = system.correction(q, factor)
        size = system.size(x)
        if size <= BALANCED and shift == 0.0:
            return q + x
        new = system.projected(q + x, factor, shift) if size <= SLOW else None
        if new is None:
            shift = max(4.0 * shift, least)
            continue
        q = new
        system.accept(q, factor)
        if not system.size(q - start) <= FAR:
            break
        if size <= BALANCED and (found := stability_of(system, q, factor)).kind != "stable":
            push = next(pushes, None) if found.kind == "unstable" else None
            if push is None:
                return q
            left = system.projected(q + push / system.size(found.motion) * found.motion, factor, shift)
            q = q if left is None else left
        if size <= 0.5 * SLOW:
            shift = 0.25 * shift if shift > 4.0 * least else 0.0
    system.accept_again(turns)
    return None


def _gain(
    system: StaticSystem, q: Array, new: Array, x: Array, force: Array, factor: float, shift: float
) -> float:
    """Fall of the energy in a step x, which led from q to `new`, of that which the tangent predicts.

    Roundings of the energy are no fall.
    """
    predicted, noise = _predicted(system, x, force, shift), _noise(system, q, factor)
    return (noise - system.potential_change(q, new, factor)) / (predicted + noise)


def _is_rounding(system: StaticSystem, q: Array, x: Array, force: Array, factor: float, shift: float) -> bool:
    """Whether a step x from q is a free motion that comes of the rounding of forces: the energy does not fall."""
    if abs(_predicted(system, x, force, shift)) > _noise(system, q, factor):
        return False
    return stability_of(system, q, factor).kind == "singular"


def _predicted(system: StaticSystem, x: Array, force: Array, shift: float) -> float:
    """Fall of the energy in a step x that the tangent predicts, J."""
    return 0.5 * (float((force * x).sum()) + shift * float((x * system.inertia(x)).sum()))


def _noise(system: StaticSystem, q: Array, factor: float) -> float:
    """Rounding of the energy at q, J."""
    return ROUNDING * system.strain_energy(q, factor) + float(np.finfo(float).tiny)


def _left(system: StaticSystem, q: Array, factor: float) -> Array:
    """An unstable equilibrium left along its lowest mode, to the side where the energy falls more."""
    _, mode = lowest_mode(system, q, factor)
    for push in PUSHES:
        one, other = (system.projected(q + side * mode, factor, 0.0) for side in (push, -push))
        if one is None or other is None:
            continue
        falls = [-system.potential_change(q, side, factor) for side in (one, other)]
        if max(falls) > 0.0:
            return other if falls[1] > falls[0] * (1.0 + TIE) else one
    last = q + PUSHES[-1] * mode
    kept = system.projected(last, factor, 0.0)
    return last if kept is None else kept
