"""Parts of an implicit step before and after Newton's iteration (predict, finish), and the damping forces in it.

The formulas are in `generalized_alpha`.
"""

from anctmm.discretise.assembly import damping_forces
from anctmm.forces.loads import set_loads
from anctmm.jit.compiling import embedded, inlined

#: Components that pass through the cache together between two steps.
PART = 1024


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
def shares(c):  # type: ignore[no-untyped-def]
    """Of w, the old w and the old a, the last taken off, in a at the end of the step."""
    r = 1.0 / (1.0 - c.alpha_m)
    return (1.0 - c.alpha_f) * r, c.alpha_f * r, c.alpha_m * r


@inlined
def finish(v, a, w, w_before, c):  # type: ignore[no-untyped-def]
    """v and a at the end of the step, from w there."""
    now, then, old = shares(c)
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
    now, then, old = shares(c)
    for i in range(len(v)):
        new = now * w[i] + then * w_before[i] - old * a[i]
        out[i] = v[i] + c.h * ((1.0 - c.gamma) * a[i] + c.gamma * new)


@embedded
def damp_at_end(damping, state, c, tables, loads, load_values):  # type: ignore[no-untyped-def]
    """Add the damping forces at the end of a step, if there are some."""
    if damping is not None:
        _, v, a, w, _, had = state.flat
        velocities_at_end(v, a, w, had, c, damping.flat)
        _add_damping_forces(damping, state, tables, loads, load_values)


@embedded
def damp_now(damping, state, tables, loads, load_values):  # type: ignore[no-untyped-def]
    """Add the damping forces of the present velocities, if there are some; the next step starts with them."""
    if damping is not None:
        _, v, _, _, _, _ = state.flat
        copy(v, damping.flat)
        _add_damping_forces(damping, state, tables, loads, load_values)
        dissipated(damping, state.q, state.q)


@inlined
def _add_damping_forces(damping, state, tables, loads, load_values):  # type: ignore[no-untyped-def]
    """External forces and damping forces at the velocities of `damping`."""
    first, formulations, kinds, constants, _, buffer = tables
    q, f, dead, force = state.q, state.f, state.dead, damping.force[0]
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            f[k, i] = dead[k, i]
            force[k, i] = 0.0
    set_loads(q, f, dead, loads, load_values)
    damping_forces(formulations, q, damping.v, first, kinds, constants, damping.of, buffer, force)
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            f[k, i] += force[k, i]


@embedded
def dissipated(damping, q, q_before):  # type: ignore[no-untyped-def]
    """Work of the damping forces over the step, J: their mean times the displacement, as the integrator has it.

    The power lost, integrated in time, would count a motion that dies out within a step many times over.
    """
    if damping is None:
        return 0.0
    work = 0.0
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            now = damping.force[0, k, i]
            work += 0.5 * (now + damping.force[1, k, i]) * (q[k, i] - q_before[k, i])
            damping.force[1, k, i] = now
    return work
