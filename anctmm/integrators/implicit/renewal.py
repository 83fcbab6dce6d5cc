"""When the matrix of Newton's iteration is renewed before a solution: where the last ones show that it is cheaper.

A matrix gets older, solutions take more corrections with it, and some renew it on their way. Costs are counted in
corrections. The mean cost of the solutions with a matrix, that of the renewal included, falls as long as the next one
costs less than this mean, and grows from then on: there it is renewed. Single solutions vary, so that a mean of the
last ones counts.

How many solutions a matrix lasted is remembered. The next ones are renewed after as many, before another dear solution,
as long as that is cheaper than solutions are on the average: in large steps a new matrix for each is the cheapest. Now
and then one is kept longer, as the motion may have become calmer: the more rarely, the more often that was in vain.

With a renewal only where corrections fall slowly, some 230 runs of 20 scenes with fixed steps, with three bounds of
Newton's iteration and steps from coarse to fine, cost 1.11 times as much with generalized-α (0.8 to 2.1), and 1.07
times with esdirk (0.9 to 2.4). Without the memory coarse steps cost up to 2.4 times as much as with it. Steps with a
tolerance cost as much as with a rule of their own, by the mean cost alone.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.jit.compiling import inlined

Array = NDArray[np.float64]

#: Places in what is known of the wear of a matrix: its age in solutions; their cost, that of the renewal included; the
#: mean cost of the last ones; after how many it is renewed, 0 if that is not known, and how many the last one lasted;
#: matrices since one was kept longer, and those until the next one is. Costs of solutions: of a renewal, of the last
#: one with a new matrix, and on the average.
AGE, SPENT, LATELY, LASTS, LASTED, MATRICES, PATIENCE, PRICE, NEW, AVERAGE = PLACES = range(10)
#: Weights of a solution in the mean of the last ones with a matrix, and in the average.
LAST, SLOWLY = 0.25, 0.05
#: Times the average cost that a renewal after as many solutions as the last matrix lasted may have.
ABOUT = 1.05
#: Corrections of a solution with a new matrix above which the next one has a new matrix, too: its motion is far from
#: the predicted one.
MANY = 6.0
#: Matrices until one is kept longer, at least and at most.
OFTEN, RARELY = 4.0, 64.0


def new_wear(price: float) -> Array:
    """What is known of the wear of the first matrix; a renewal costs as much as so many corrections."""
    wear = np.zeros(len(PLACES))
    wear[PATIENCE], wear[PRICE] = OFTEN, price
    return wear


@inlined
def worn(new, corrections, renewals, wear):  # type: ignore[no-untyped-def]
    """Whether the matrix is to be renewed before the next solution, after one with so many corrections and renewals.

    new: whether the solution began with a new matrix.
    """
    cost = corrections + wear[PRICE] * renewals
    wear[AVERAGE] = cost if wear[AVERAGE] == 0.0 else wear[AVERAGE] + SLOWLY * (cost - wear[AVERAGE])
    dear = False
    if new:
        wear[AGE], wear[SPENT], wear[NEW] = 0.0, cost, cost
        dear = cost > MANY + wear[PRICE]
    elif renewals > 0:
        wear[AGE] += 1.0
        _remember(wear)
        wear[AGE], wear[SPENT] = 0.0, wear[NEW]  # the matrix is new since then
    else:
        wear[AGE] += 1.0
        wear[LATELY] = cost if wear[AGE] == 1.0 else wear[LATELY] + LAST * (cost - wear[LATELY])
        dear = wear[LATELY] > wear[SPENT] / wear[AGE]
        wear[SPENT] += cost
        if dear:
            _remember(wear)
    return dear or _lasts_no_longer(wear)


@inlined
def _remember(wear):  # type: ignore[no-untyped-def]
    """Remember how long a matrix lasted."""
    in_vain = wear[AGE] <= wear[LASTED]
    wear[PATIENCE] = min(2.0 * wear[PATIENCE], RARELY) if in_vain else OFTEN
    wear[LASTS], wear[LASTED], wear[MATRICES] = wear[AGE], wear[AGE], 0.0


@inlined
def _lasts_no_longer(wear):  # type: ignore[no-untyped-def]
    """Whether the next solution would be dear, as the matrix before has shown; some matrices are kept even so."""
    found = False
    solutions = wear[AGE] + 1.0
    cheap = wear[SPENT] < ABOUT * wear[AVERAGE] * solutions
    if wear[LASTS] > 0.0 and solutions >= wear[LASTS] and cheap:
        wear[MATRICES] += 1.0
        found = wear[MATRICES] < wear[PATIENCE]
        if not found:
            wear[LASTS], wear[MATRICES] = 0.0, 0.0
    return found
