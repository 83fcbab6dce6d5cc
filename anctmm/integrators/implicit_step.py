"""State of an implicit run, and what a step does before and after Newton's iteration: predict, finish.

The formulas stand in `generalized_alpha`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import (
    Bodies,
    Tables,
    damping_forces,
)
from anctmm.discretise.chain import Chain
from anctmm.discretise.fitting import fitting_velocity
from anctmm.discretise.methods import Coefficients
from anctmm.forces.loads import set_loads
from anctmm.jit.compiling import embedded, inlined
from anctmm.jit.copies import writes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Components that pass through the cache together between two steps.
PART = 1024


@writes("q", "v", "a", "w", "q_before", "w_before", "f", "loads", "flat")
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


def new_state(chain: Chain) -> State:
    """State of a scene at t = 0, accelerations apart."""
    q, v, dead = chain.start_coordinates(), fitting_velocity(chain), chain.dead_load
    a, w, q_before, w_before = (np.zeros_like(q) for _ in range(4))
    flat = tuple(x.ravel() for x in (q, v, a, w, q_before, w_before))
    return State(q, v, a, w, q_before, w_before, dead.copy(), dead, np.zeros(q.shape[::-1]), flat)


def new_damping(chain: Chain) -> Damping | None:
    """Damping of a scene that has some, for steps of the discretisation's length."""
    bodies, c = chain.bodies, chain.run.coefficients
    if bodies.damping is None:
        return None
    v = bodies.initial_velocity()
    return Damping(
        bodies.damping, v, np.zeros((2, *v.shape)), stiffened_bodies(bodies, c).tables(), v.ravel()
    )


def stiffened_bodies(bodies: Bodies, c: Coefficients) -> Bodies:
    """The bodies with the stiffness that the iteration matrix has of them."""
    if bodies.damping is None:
        return bodies
    return bodies.stiffened([1.0 + c.gamma / (c.beta * c.h) * tau for tau in bodies.damping])


@embedded
def begin_step(unfinished, flat, c):  # type: ignore[no-untyped-def]
    """Finish the step before if need be, keep q and w, and predict: part by part, as long as they are in the cache."""
    q, v, a, w, q_before, w_before = flat
    for start in range(0, len(q), PART):
        end = min(start + PART, len(q))
        was, had = q_before[start:end], w_before[start:end]
        if unfinished:
            finish(v[start:end], a[start:end], w[start:end], had, c)
        copy(q[start:end], was)
        copy(w[start:end], had)
        predict(q[start:end], v[start:end], a[start:end], w[start:end], was, had, c)


@inlined
def _shares(c):  # type: ignore[no-untyped-def]
    """Of w, the old w and the old a, the last taken off, in a at the end of the step."""
    r = 1.0 / (1.0 - c.alpha_m)
    return (1.0 - c.alpha_f) * r, c.alpha_f * r, c.alpha_m * r


@inlined
def finish(v, a, w, w_before, c):  # type: ignore[no-untyped-def]
    """v and a at the end of the step, from w there."""
    now, then, old = _shares(c)
    for i in range(len(v)):
        new = now * w[i] + then * w_before[i] - old * a[i]
        v[i] += c.h * ((1.0 - c.gamma) * a[i] + c.gamma * new)
        a[i] = new


@inlined
def copy(x, y):  # type: ignore[no-untyped-def]
    """Copy x to y."""
    for i in range(len(x)):
        y[i] = x[i]


@inlined
def predict(q, v, a, w, q_before, w_before, c):  # type: ignore[no-untyped-def]
    """q and w at the end of the step if w stayed as it was."""
    r = 1.0 / (1.0 - c.alpha_m)
    for i in range(len(q)):
        new = r * (w_before[i] - c.alpha_m * a[i])
        q[i] = q_before[i] + (c.h * v[i] + c.h * c.h * ((0.5 - c.beta) * a[i] + c.beta * new))
        w[i] = w_before[i]


@inlined
def velocities_at_end(v, a, w, w_before, c, out):  # type: ignore[no-untyped-def]
    """Velocities that `finish` would give."""
    now, then, old = _shares(c)
    for i in range(len(v)):
        new = now * w[i] + then * w_before[i] - old * a[i]
        out[i] = v[i] + c.h * ((1.0 - c.gamma) * a[i] + c.gamma * new)


@inlined
def add_damping_forces(q, f, dead, tables, loads, load_values, damping):  # type: ignore[no-untyped-def]
    """External forces and damping forces at the velocities of `damping`."""
    first, formulations, kinds, constants, _, buffer = tables
    force = damping.force[0]
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            f[k, i] = dead[k, i]
            force[k, i] = 0.0
    set_loads(q, f, dead, loads, load_values)
    damping_forces(formulations, q, damping.v, first, kinds, constants, damping.of, buffer, force)
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            f[k, i] += force[k, i]


@inlined
def dissipated(q, q_before, damping):  # type: ignore[no-untyped-def]
    """Work of the damping forces over the step, J: their mean times the displacement, as the integrator has it.

    The power lost, integrated in time, would count a motion that dies out within a step many times over.
    """
    work = 0.0
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            now = damping.force[0, k, i]
            work += 0.5 * (now + damping.force[1, k, i]) * (q[k, i] - q_before[k, i])
            damping.force[1, k, i] = now
    return work
