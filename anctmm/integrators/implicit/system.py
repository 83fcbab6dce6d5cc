"""Start of implicit runs: state, damping, Newton's iteration, and the system that their kernels receive."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies, Tables
from anctmm.discretise.chain import Chain
from anctmm.discretise.fitting import fitting_velocity
from anctmm.discretise.kept_chains import once
from anctmm.discretise.methods import Coefficients
from anctmm.forces.actuation import DrivenClamps, actuation_of
from anctmm.forces.loads import Loads
from anctmm.integrators.implicit.renewal import new_wear
from anctmm.integrators.stability import element_bound
from anctmm.jit.by_address import by_address
from anctmm.jit.copies import writes
from anctmm.jit.prefetching import LONG
from anctmm.recursion.riccati import BlockFactors, Links, block_factors, links

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

EPS = float(np.finfo(float).eps)
#: Newton corrections in a step before it is given up.
ITERATIONS = 25
#: Newton stops when the error left is this part of the tolerance (κ of Hairer & Wanner, IV.8): errors of steps add up.
KAPPA = 0.01
#: What rounding the factors may leave of the error at each correction, at most; measured, 0.7 makes no difference yet.
ROUNDED = 0.1
#: Cost of a renewal of the matrix, in corrections, for each coordinate of a node: measured, 4 to 7 with cables, 8 with
#: shear elements.
PRICE_OF_ROW = 1.4


@writes("q", "v", "a", "w", "q_before", "w_before", "f", "loads", "flat")
@by_address
class State(NamedTuple):
    """q, v, a and w, q and w at the start of the step, external force and dead load: each (rows, nodes).

    loads: those that arrive at each node in a solution, and then the unknowns, (nodes, rows). flat: the first six
    again, as vectors.
    """

    q: Array
    v: Array
    a: Array
    w: Array
    q_before: Array
    w_before: Array
    f: Array
    dead: Array
    loads: Array
    flat: tuple[Array, ...]


@by_address
class Damping(NamedTuple):
    """Kelvin-Voigt damping of each body, s, and velocities at the end of the step, (rows, nodes).

    force: damping forces at the last evaluation and at the end of the step before, (2, rows, nodes). stiff: tables
    whose stiffness is that of the iteration matrix. flat: the velocities again, as a vector.
    """

    of: Array
    v: Array
    force: Array
    stiff: Tables
    flat: Array


@writes("counts", "history", "expected", "wear", "weight")
@by_address
class Newton(NamedTuple):
    """Newton's iteration: scale of positions (m), bound of the error left, and what it reports.

    counts: corrections, factorizations, whether the matrix must be renewed. history: of the sizes of the corrections
    of the last step, (ITERATIONS,). wear: of the matrix, see `renewal`. weight: what a component of a gradient counts
    in these sizes, times; 1 with fixed steps, (1,). expected: contraction to expect of a first correction, so that one
    may do, with a matrix that is kept, and with a new one over its size, and the largest size for which that is known,
    (3,); None with fixed steps. shows: part of the bound up to which a further correction does no more than show what
    the one before has left: that is no wear of the matrix.
    """

    scale: float
    tolerance: float
    counts: Ints
    history: Array
    wear: Array
    weight: Array
    expected: Array | None = None
    shows: float = 0.0


@by_address
class System(NamedTuple):
    """What the kernels of implicit runs take, the output apart.

    `damping` is None unless a material has some. Only the branches that a scene needs are compiled: functions that are
    `embedded` take what may be absent as an argument of its own.
    """

    state: State
    tables: Tables
    links: Links
    factors: BlockFactors
    clamps: DrivenClamps
    loads: Loads
    newton: Newton
    damping: Damping | None


def new_system(chain: Chain) -> System:
    """What the steps of a run start from; factors in single precision where those will do."""
    actuation = once(chain, actuation_of)
    return System(
        new_state(chain),
        chain.bodies.tables(),
        links(chain),
        block_factors(chain, single_will_do(chain)),
        actuation.clamps(),
        actuation.loads(),
        new_newton(chain),
        new_damping(chain),
    )


def new_state(chain: Chain) -> State:
    """State of a scene at t = 0, accelerations apart."""
    q, v, dead = chain.start_coordinates(), fitting_velocity(chain), chain.dead_load
    a, w, q_before, w_before = (np.zeros_like(q) for _ in range(4))
    flat = tuple(x.ravel() for x in (q, v, a, w, q_before, w_before))
    return State(q, v, a, w, q_before, w_before, dead.copy(), dead, np.zeros(q.shape[::-1]), flat)


def new_damping(chain: Chain) -> Damping | None:
    """Damping of a scene that has some, for steps of the discretisation's length."""
    bodies = chain.bodies
    if bodies.damping is None:
        return None
    c = chain.run.coefficients
    v = bodies.initial_velocity()
    return Damping(
        bodies.damping, v, np.zeros((2, *v.shape)), stiffened_bodies(bodies, c).tables(), v.ravel()
    )


def stiffened_bodies(bodies: Bodies, c: Coefficients) -> Bodies:
    """The bodies with the stiffness that the iteration matrix has of them.

    Damping resists rates of strain as a larger stiffness resists strains. It does not add to stresses: where it was
    thought to, a heavy rope with a damping of 10 ms took 20 times the steps, or diverged, when it had turned.
    """
    if bodies.damping is None:
        return bodies
    factors = [1.0 + c.gamma / (c.beta * c.h) * tau for tau in bodies.damping]
    return bodies.stiffened(factors, stresses=False)


def new_newton(chain: Chain) -> Newton:
    """Newton's iteration for a scene; what may be left of its tolerance is no less than rounding allows."""
    left = max(KAPPA * chain.run.newton_tolerance, least_left(chain))
    wear = new_wear(PRICE_OF_ROW * chain.bodies.rows)
    return Newton(chain.length, left, np.zeros(3, np.int64), np.zeros(ITERATIONS), wear, np.ones(1))


def least_left(chain: Chain) -> float:
    """What rounding leaves of a step's error in Newton's iteration, relative to the scene's length."""
    furthest = float(np.abs(chain.bodies.undeformed[:2]).max())
    return 32.0 * EPS * (1.0 + furthest / chain.length)


def single_will_do(chain: Chain) -> bool:
    """Whether the iteration matrix's factors may be kept in single precision, which moves half as much memory.

    It pays where the factors do not stay in the cache, and is not asked for steps of varying length. Residuals are in
    double precision and so is what Newton's iteration tends to; a correction is wrong by ε (c_w + ω²)/c_w of itself or
    less, the condition of c_w M + K_T times the rounding, with ω the highest frequency of a free element. (Kelley 2022,
    Newton's method in mixed precision.)
    """
    if (
        chain.bodies.nodes <= LONG
        or chain.plan.kept
        or chain.scene.connectors
        or chain.run.tolerance is not None
    ):
        return False
    c = chain.run.coefficients
    condition = 1.0 + element_bound(chain, stiffened_bodies(chain.bodies, c)) ** 2 / c.to_w
    return float(np.finfo(np.float32).eps) * condition <= ROUNDED
