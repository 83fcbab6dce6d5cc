"""Implicit ANC-TMM: generalized-α with Newton, its linear solves by the Riccati recursion.

Chung & Hulbert (1993) in the form of Arnold & Brüls (2007): M w_{n+1} = F(q_{n+1}) holds at the end of the step, and

    (1 − αm) a_{n+1} + αm a_n = (1 − αf) w_{n+1} + αf w_n,
    q_{n+1} = q_n + h v_n + h² ((½ − β) a_n + β a_{n+1}),    v_{n+1} = v_n + h ((1 − γ) a_n + γ a_{n+1}).

A Newton correction solves (c_w M + K_T) Δq = F − M w with c_w = (1 − αm)/(βh²(1 − αf)): block tridiagonal, so the same
recursion as for the mass. Known coordinates are known as positions; their velocities and accelerations follow from the
formulas above, as they do in an index-3 solution of the equations with multipliers.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anctmm.accelerations import accelerations_block
from anctmm.actuation import Actuation, hub_motion, hub_reactions, set_hubs, set_loads, work_done
from anctmm.assembly import elastic_forces, kinetic_energy, mass_product, strain_energy
from anctmm.chain import Chain
from anctmm.compiling import inlined, kernel
from anctmm.recording import STRETCH_LIMIT, Record, run_batches, too_large, worst_element
from anctmm.riccati import Block, factorize, sweep, tables
from anctmm.solution import Solution, Status

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Newton corrections in a step before it is given up.
ITERATIONS = 25
#: Newton stops when the error left is this part of the tolerance (κ of Hairer & Wanner, IV.8): errors of steps add up.
KAPPA = 0.01
#: Contraction above which the iteration matrix is renewed.
SLOW = 0.5
#: Corrections in a step above which the matrix is renewed before the next one.
MANY = 5


@dataclass(frozen=True)
class GeneralizedAlpha:
    """Coefficients of the method.

    Parameters
    ----------
    spectral_radius : float
        ρ∞ in [0, 1]: 1 keeps the energy of high frequencies, 0 annihilates them in one step.
    """

    spectral_radius: float

    @property
    def alpha_m(self) -> float:
        """Weight of the old acceleration a."""
        return (2.0 * self.spectral_radius - 1.0) / (self.spectral_radius + 1.0)

    @property
    def alpha_f(self) -> float:
        """Weight of the old w."""
        return self.spectral_radius / (self.spectral_radius + 1.0)

    @property
    def gamma(self) -> float:
        """Newmark's γ, for second order."""
        return 0.5 + self.alpha_f - self.alpha_m

    @property
    def beta(self) -> float:
        """Newmark's β, for the most dissipation of high frequencies at the least of low ones."""
        return 0.25 * (self.gamma + 0.5) ** 2

    def of_step(self, h: float) -> tuple[float, ...]:
        """h, αm, αf, β, γ and the factors of a correction of q in a, v and w."""
        am, af, b, g = self.alpha_m, self.alpha_f, self.beta, self.gamma
        return h, am, af, b, g, 1 / (b * h * h), g / (b * h), (1 - am) / (b * h * h * (1 - af))


def integrate(chain: Chain) -> Solution:
    """Run a scene with the implicit integrator.

    Returns
    -------
    Solution
        With a status that names step, time and element if Newton's iteration failed.
    """
    run, bodies = chain.run, chain.bodies
    actuation = Actuation(chain.scene, bodies)
    record, block = Record(chain), Block.of(chain)
    q, v, hubs = bodies.reference(), bodies.initial_velocity(), actuation.hub_of_bodies()
    f = chain.dead_load.copy()
    counts, monitor = np.zeros(3, dtype=np.int64), np.zeros((bodies.nodes, 2))
    coefficients = GeneralizedAlpha(run.spectral_radius).of_step(run.dt)
    fixed = (
        (run.steps, run.stride, chain.length, _tolerance(chain)),
        coefficients,
        (q, v, np.zeros_like(q), np.zeros_like(q), f, chain.dead_load),
        (*tables(chain), bodies.elements, bodies.buffer()),
        (block.unit, block.L, block.G, *block.scratch),
        tuple(np.zeros((3, *q.shape))),
        (actuation.hub_nodes, hubs, actuation.hub_reference()),
        (actuation.load_nodes, actuation.load_rows),
        actuation.memory(),
        (np.zeros(2), counts, monitor),
        (record.q, record.energy),
    )

    def one(begin: int, end: int) -> int:
        t = run.times(np.arange(begin, end + 1))
        return int(advance(begin, end, *fixed, actuation.hub_table(t), actuation.load_table(t)))

    advance(0, 0, *fixed, actuation.hub_table(np.zeros(1)), actuation.load_table(np.zeros(1)))  # compiles
    record.start()
    failed = run_batches(chain, one)
    done = run.steps if failed < 0 else failed
    status = Status() if failed < 0 else _stalled(chain, failed, monitor)
    kept = len(run.output_steps) if failed < 0 else 1 + (failed - 1) // run.stride
    return record.solution(kept, status, done, int(counts[0]), int(counts[1]))


def _tolerance(chain: Chain) -> float:
    """What may be left of the tolerance asked for, but no less than rounding of the coordinates allows."""
    furthest = float(np.abs(chain.bodies.reference()[:2]).max())
    return max(KAPPA * chain.run.newton_tolerance, 32.0 * float(np.finfo(float).eps) * (1.0 + furthest / chain.length))


def _stalled(chain: Chain, step: int, monitor: Array) -> Status:
    body, element = worst_element(chain, monitor[:, 0])
    t = float(chain.run.times(np.array([step]))[0])
    history = ", ".join(f"{x:.1e}" for x in monitor[: ITERATIONS, 1] if x > 0.0)
    return Status(
        "diverged",
        f"Newton's iteration failed at t = {t:.6g} s (step {step}), worst in element {element} of body {body!r}, "
        f"with corrections {history or 'none'}; a smaller dt than {chain.run.dt:g} s or a finer mesh may do",
        time=t,
        step=step,
        body=body,
        element=element,
    )


@kernel
def advance(
    begin, end, numbers, coefficients, state, tables, factors, scratch, hubs, loads, memory, monitors, out,
    hub_table, load_table,
):  # type: ignore[no-untyped-def]
    """From step `begin` to step `end`; returns the step whose Newton iteration failed, or −1.

    The arguments come in groups, see `integrate`; the two tables hold their values from step `begin` on.
    """
    steps, stride, scale, tolerance = numbers
    q, v, a, w, f, dead = state
    first, kinds, constants, masses = tables[0], tables[1], tables[2], tables[3]
    elements, buffer = tables[7], tables[8]
    hub_nodes, hub_of, hub_reference = hubs
    load_nodes, load_rows = loads
    motion, reaction, hub_memory, load_memory = memory
    sums, counts, _ = monitors
    out_q, out_energy = out
    driven = len(hub_nodes) + len(load_nodes) > 0
    for step in range(begin, end):
        if step == 0:
            set_hubs(q, v, hub_nodes, hub_reference, hub_table[0], motion)
            set_loads(q, f, dead, load_nodes, load_rows, load_table[0])
            _start(q, f, w, load_nodes, load_rows, load_table[0], tables, factors, scratch, hub_nodes, hub_of, motion)
            a[:] = w
            counts[1] += 1
            counts[2] = 1
        if driven:
            hub_reactions(q, w, f, first, kinds, constants, masses, buffer, hub_of, reaction)
            sums[0] += work_done(
                step > 0, q, hub_nodes, reaction, hub_memory, load_nodes, load_rows, load_table[step - begin],
                load_memory,
            )
        if step % stride == 0 or step == steps:
            if too_large(q, STRETCH_LIMIT):
                return step
            place = step // stride if step % stride == 0 else len(out_q) - 1
            out_q[place] = q
            out_energy[place, 0] = kinetic_energy(v, first, elements, masses)
            out_energy[place, 1] = strain_energy(q, first, elements, kinds, constants)
            out_energy[place, 2] = sums[0]
        if step == steps:
            break
        _predict(q, v, a, w, coefficients)
        if driven:
            _place_hubs(q, v, a, w, hub_nodes, hub_reference, hub_table[step + 1 - begin], motion, coefficients)
        if not _newton(
            q, v, a, w, f, dead, scale, tolerance, coefficients, tables, factors, scratch, load_nodes, load_rows,
            load_table[step + 1 - begin], monitors,
        ):
            return step + 1
    return -1


@inlined
def _start(q, f, w, load_nodes, load_rows, load_values, tables, factors, scratch, hub_nodes, hub_of, motion):  # type: ignore[no-untyped-def]
    """True accelerations w at t = 0."""
    first, kinds, constants, masses, link, turn, prescribed, elements, buffer = tables
    unit, L, G, D, K, small = factors
    factorize(
        unit, q, first, kinds, constants, masses, link, turn, prescribed, 1.0, 0.0, load_nodes, load_rows,
        load_values, L, G, D, K, small,
    )
    accelerations_block(
        unit, q, f, first, elements, kinds, constants, masses, hub_nodes, hub_of, motion[2], L, G, buffer,
        scratch[0], w,
    )


@inlined
def _predict(q, v, a, w, coefficients):  # type: ignore[no-untyped-def]
    """State at the end of the step if w stayed as it is."""
    h, am, _, beta, gamma, _, _, _ = coefficients
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            new = (w[k, i] - am * a[k, i]) / (1.0 - am)
            q[k, i] += h * v[k, i] + h * h * ((0.5 - beta) * a[k, i] + beta * new)
            v[k, i] += h * ((1.0 - gamma) * a[k, i] + gamma * new)
            a[k, i] = new


@inlined
def _correct(q, v, a, w, k, i, x, coefficients):  # type: ignore[no-untyped-def]
    """Add a correction x of one coordinate, and what follows from it, to the state at the end of the step."""
    q[k, i] += x
    a[k, i] += coefficients[5] * x
    v[k, i] += coefficients[6] * x
    w[k, i] += coefficients[7] * x


@inlined
def _place_hubs(q, v, a, w, nodes, reference, drives, motion, coefficients):  # type: ignore[no-untyped-def]
    """Give the hubs' nodes their known positions; velocities and accelerations follow."""
    for h in range(len(nodes)):
        hub_motion(reference[h], drives[h], motion[:, h])
        for k in range(q.shape[0]):
            _correct(q, v, a, w, k, nodes[h], motion[0, h, k] - q[k, nodes[h]], coefficients)


@kernel
def _newton(
    q, v, a, w, f, dead, scale, tolerance, coefficients, tables, factors, scratch, load_nodes, load_rows,
    load_values, monitors,
):  # type: ignore[no-untyped-def]
    """Find the end of a step by modified Newton; False if it cannot be found.

    counts: corrections, factorizations, whether the matrix must be renewed. monitor: size of the last correction
    at each node, and of each correction of the step.
    """
    first, kinds, constants, masses, link, turn, prescribed, elements, buffer = tables
    unit, L, G, D, K, small = factors
    load, inertia, x = scratch[0], scratch[1], scratch[2]
    _, counts, monitor = monitors
    last = 0.0
    monitor[:, 1] = 0.0
    for iteration in range(ITERATIONS):
        set_loads(q, f, dead, load_nodes, load_rows, load_values)
        elastic_forces(q, first, elements, kinds, constants, buffer, load)
        mass_product(w, first, elements, masses, inertia)
        for k in range(q.shape[0]):
            for i in range(q.shape[1]):
                load[k, i] = f[k, i] - load[k, i] - inertia[k, i]
        if counts[2] != 0:
            factorize(
                unit, q, first, kinds, constants, masses, link, turn, prescribed, coefficients[7], 1.0, load_nodes,
                load_rows, load_values, L, G, D, K, small,
            )
            counts[1] += 1
            counts[2] = 0
        sweep(unit, L, G, load, x)
        size = 0.0
        for i in range(q.shape[1]):
            here = max(abs(x[0, i]), abs(x[1, i])) / scale
            for k in range(2, q.shape[0]):
                here = max(here, abs(x[k, i]))
            if not here - here == 0.0:
                here = np.inf
            monitor[i, 0] = here
            size = max(size, here)
        if iteration < len(monitor):
            monitor[iteration, 1] = size
        counts[0] += 1
        if size == np.inf:
            return False
        for k in range(q.shape[0]):
            for i in range(q.shape[1]):
                _correct(q, v, a, w, k, i, x[k, i], coefficients)
        # the corrections fall by `rate` each: what is left is at most their geometric series
        rate = size / last if iteration > 0 else 1.0
        if size <= tolerance or (rate < 1.0 and size * rate / (1.0 - rate) <= tolerance):
            if iteration >= MANY:
                counts[2] = 1
            return True
        if iteration > 0 and rate > SLOW:
            counts[2] = 1
        last = size
    return False
