"""Explicit ANC-TMM: Zhai's integrator (Rong 2014, eq. 38) on the Riccati recursion with the mass factored once.

    q_{n+1} = q_n + v_n Δt + (½ + ψ) a_n Δt² − ψ a_{n−1} Δt²
    v_{n+1} = v_n + (1 + φ) a_n Δt − φ a_{n−1} Δt,     a_{−1} = a_0.

Coordinates that are known are known at all three levels, so nothing drifts.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.accelerations import accelerations_block, accelerations_split
from anctmm.actuation import Actuation, hub_reactions, set_hubs, set_loads, work_done
from anctmm.assembly import kinetic_energy, strain_energy
from anctmm.chain import Chain
from anctmm.compiling import inlined, kernel
from anctmm.recording import STRETCH_LIMIT, Record, gradient_size, run_batches, too_large, worst_element
from anctmm.riccati import Block, Split, factorize_mass
from anctmm.solution import Solution, Status
from anctmm.stability import check_step

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def integrate(chain: Chain) -> Solution:
    """Run a scene with the explicit integrator.

    Parameters
    ----------
    chain : Chain

    Returns
    -------
    Solution
        With a status that names step, time and element if the motion diverged.

    Raises
    ------
    StabilityError
        If the step lies above the stability limit and the discretisation asks for the check.
    """
    run, bodies = chain.run, chain.bodies
    if run.check_stability:
        check_step(chain)
    actuation = Actuation(chain.scene, bodies)
    record = Record(chain)
    q, v = bodies.reference(), bodies.initial_velocity()
    a, f = np.zeros((2, *q.shape)), chain.dead_load.copy()
    split, block = _factors(chain)
    fixed = (
        (run.steps, run.stride, run.dt, run.psi, run.phi, chain.split),
        (q, v, a, f, chain.dead_load, np.zeros_like(q) if not chain.split else np.zeros((1, 1))),
        (bodies.first, bodies.elements, bodies.kinds, bodies.constants, bodies.masses, bodies.buffer()),
        (split.L, split.G, block.unit, block.L, block.G),
        (actuation.hub_nodes, actuation.hub_of_bodies(), actuation.hub_reference()),
        (actuation.load_nodes, actuation.load_rows),
        actuation.memory(),
        np.zeros(1),
        (record.q, record.energy),
    )

    def one(begin: int, end: int) -> int:
        t = run.times(np.arange(begin, end + 1))
        return int(advance(begin, end, *fixed, actuation.hub_table(t), actuation.load_table(t)))

    advance(0, 0, *fixed, actuation.hub_table(np.zeros(1)), actuation.load_table(np.zeros(1)))  # compiles
    record.start()
    failed = run_batches(chain, one)
    if failed < 0:
        return record.solution(len(run.output_steps), Status(), run.steps)
    return record.solution(1 + (failed - 1) // run.stride, _diverged(chain, failed, q), failed)


def _factors(chain: Chain) -> tuple[Split, Block]:
    """The factored mass in the form the chain allows, the other one empty."""
    if chain.split:
        nothing = np.zeros((1, 1, 1))
        return factorize_mass(chain), Block(nothing, nothing, (0,) * chain.bodies.rows, (nothing[0],) * 3)
    block = Block.of(chain)
    none = (np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 2)))
    block.factorize(chain, chain.bodies.reference(), 1.0, 0.0, none)
    empty = np.zeros((5, 1))
    return Split(empty, empty, empty), block


def _diverged(chain: Chain, step: int, q: Array) -> Status:
    body, element = worst_element(chain, gradient_size(q))
    t = float(chain.run.times(np.array([step]))[0])
    return Status(
        "diverged",
        f"the motion diverged at t = {t:.6g} s (step {step}) in element {element} of body {body!r}; "
        f"a smaller dt than {chain.run.dt:g} s may do: deformation raises the highest frequency",
        time=t,
        step=step,
        body=body,
        element=element,
    )


@kernel
def advance(begin, end, numbers, state, tables, factors, hubs, loads, memory, work, out, hub_table, load_table):  # type: ignore[no-untyped-def]
    """Steps `begin` … `end` − 1; returns the step at which the motion diverged, or −1.

    The arguments come in groups, see `integrate`; the two tables hold their values from step `begin` on.
    """
    steps, stride, dt, psi, phi, split = numbers
    q, v, a, f, dead, scratch = state
    first, elements, kinds, constants, masses, buffer = tables
    L, G, unit, LB, GB = factors
    hub_nodes, hub_of, hub_reference = hubs
    load_nodes, load_rows = loads
    motion, reaction, hub_memory, load_memory = memory
    out_q, out_energy = out
    driven, rows = len(hub_nodes) + len(load_nodes) > 0, q.shape[0]
    for step in range(begin, end):
        now = a[step % 2]
        if driven:
            set_hubs(q, v, hub_nodes, hub_reference, hub_table[step - begin], motion)
            set_loads(q, f, dead, load_nodes, load_rows, load_table[step - begin])
        if split:
            accelerations_split(
                q, f, first, kinds, constants, masses, hub_of, motion[2], L, G, buffer, now
            )
        else:
            accelerations_block(
                unit, q, f, first, elements, kinds, constants, masses, hub_nodes, hub_of, motion[2],
                LB, GB, buffer, scratch, now,
            )
        check = now[0, 1] + now[1, 1] + now[2, 1] + now[3, 1]
        if not check - check == 0.0:
            return step
        if driven:
            hub_reactions(q, now, f, first, kinds, constants, masses, buffer, hub_of, reaction)
            work[0] += work_done(step > 0, q, hub_nodes, reaction, hub_memory, load_nodes, load_rows,
                                 load_table[step - begin], load_memory)
        if step % stride == 0 or step == steps:
            if too_large(q, STRETCH_LIMIT):
                return step
            place = step // stride if step % stride == 0 else len(out_q) - 1
            out_q[place] = q
            out_energy[place, 0] = kinetic_energy(v, first, elements, masses)
            out_energy[place, 1] = strain_energy(q, first, elements, kinds, constants)
            out_energy[place, 2] = work[0]
        if step == steps:
            break
        before = a[(step + 1) % 2] if step > 0 else now
        for k in range(rows):
            update(q[k], v[k], now[k], before[k], dt, psi, phi)
    return -1


@inlined
def update(q, v, a, before, dt, psi, phi):  # type: ignore[no-untyped-def]
    """Zhai's step of one component of all nodes."""
    for i in range(len(q)):
        q[i] += dt * v[i] + dt * dt * ((0.5 + psi) * a[i] - psi * before[i])
        v[i] += dt * ((1.0 + phi) * a[i] - phi * before[i])
