"""Explicit ANC-TMM: Zhai's integrator (Rong 2014, eq. 38) on the Riccati recursion with the mass factored once.

    q_{n+1} = q_n + v_n Δt + (½ + ψ) a_n Δt² − ψ a_{n−1} Δt²
    v_{n+1} = v_n + (1 + φ) a_n Δt − φ a_{n−1} Δt,     a_{−1} = a_0.

Prescribed coordinates are prescribed at all three levels, so nothing drifts. Damping forces are those of the velocities
v_n: with ψ = φ = ½ both formulas remain of second order (the second is the Adams–Bashforth method).
"""

from contextlib import ExitStack, nullcontext
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables, damping_forces
from anctmm.discretise.chain import Chain
from anctmm.discretise.fitting import fitting_velocity
from anctmm.discretise.kept_chains import has_own, once, once_alike, own
from anctmm.elements.dispatch import KERNELS
from anctmm.forces.actuation import (
    DrivenClamps,
    actuation_of,
    place_clamps,
    turn_clamps,
    work_done,
)
from anctmm.forces.connectors import add_connectors
from anctmm.forces.driving import drive_table, drive_width, tables_of
from anctmm.forces.loads import Loads, set_loads
from anctmm.integrators.locking import locked, rows_in
from anctmm.integrators.output import (
    Output,
    Record,
    add_work,
    gradient_size,
    keep,
    run_batches,
    too_large,
    worst_element,
)
from anctmm.integrators.stability import check_step, largest_step
from anctmm.integrators.turn_count import count_turns
from anctmm.jit.by_address import by_address
from anctmm.jit.compiler.second_process import Parts, Task, side_by_side
from anctmm.jit.compiling import embedded, kernel
from anctmm.jit.copies import writes
from anctmm.jit.direct import Direct
from anctmm.recursion.accelerations import by_blocks, by_scalars
from anctmm.recursion.constrained import (
    ask_accelerations,
    constrain_motion,
    take_accelerations,
)
from anctmm.recursion.kept.motions import constrain_few
from anctmm.recursion.kept.rows import Rows, row_work
from anctmm.recursion.riccati import (
    BlockFactors,
    block_factors,
    factorize,
    mass_arguments,
    mass_factors,
    sweep,
)
from anctmm.recursion.split import SplitFactors, no_split_factors, split_factors
from anctmm.results.checks.divergence import STRETCH_LIMIT
from anctmm.results.checks.finding import part
from anctmm.results.solution import Solution
from anctmm.results.status import Status

Array = NDArray[np.float64]

#: Nodes up to which a run that diverged is examined for its largest stable step: a Lanczos iteration.
EXAMINED = 5_000


@writes()
@by_address
class Numbers(NamedTuple):
    """Last step, steps between outputs, Δt (s), ψ and φ."""

    steps: int
    stride: int
    dt: float
    psi: float
    phi: float


@by_address
class Damping(NamedTuple):
    """Kelvin-Voigt damping of each body, s, and the power lost at the step before, (1,), W."""

    of: Array
    power: Array


@writes("q", "v", "even", "odd", "f", "scratch", "flat")
@by_address
class State(NamedTuple):
    """Coordinates and velocities, accelerations now and before, forces, dead load, scratch: each (rows, nodes).

    flat: the first four again, as vectors.
    """

    q: Array
    v: Array
    even: Array
    odd: Array
    f: Array
    dead: Array
    scratch: Array
    flat: tuple[Array, Array, Array, Array]


@by_address
class System(NamedTuple):
    """What `advance` takes, the output apart.

    `block` is None where x and y do not mix in the mass (`Chain.split`), `damping` unless a material has some, `rows`
    unless there are constraints: only the branches that a scene needs are compiled.
    """

    numbers: Numbers
    state: State
    tables: Tables
    split: SplitFactors
    block: BlockFactors | None
    clamps: DrivenClamps
    loads: Loads
    damping: Damping | None
    rows: Rows | None


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
        If the step is above the stability limit, unless the discretisation disables the check.
    """
    record = Record(chain)
    out = record.arrays()
    with ExitStack() as during:
        with nullcontext() if has_own(chain, _system) else side_by_side(lambda: _parts(chain, out)):
            if chain.run.check_stability:
                once(chain, check_step)
            system = during.enter_context(own(chain, _system))
            kinds = tuple(part is None for part in (system.block, system.damping, system.rows))
            steps = once_alike(chain, lambda: _compiled(chain, system, out), advance, kinds)
        return _take_steps(chain, system, record, out, steps)


def _compiled(chain: Chain, system: System, out: Output) -> Direct:
    """The kernel of the steps, compiled."""
    advance(*_call(chain, system, out, 0, 0))
    return Direct(advance)


def _take_steps(chain: Chain, system: System, record: Record, out: Output, steps: Direct) -> Solution:
    """The run, once kernels are there."""
    run, q = chain.run, system.state.q

    def one(begin: int, end: int) -> int:
        return int(steps(*_call(chain, system, out, begin, end)))

    record.start()
    failed = run_batches(chain, drive_width(chain, once(chain, actuation_of)), one, record.solution)
    if failed < 0:
        return record.solution(len(record.q), Status(), run.steps)
    kept = 1 + (failed - 1) // run.stride
    before = record.q[kept - 1] if kept else chain.start_coordinates()
    t = float(run.times(np.array([failed]))[0])
    stuck = locked(chain, q, system.rows, t, failed)
    limit = largest_step(chain, before) if chain.bodies.nodes <= EXAMINED else np.inf
    status = stuck if stuck and run.dt <= limit else _diverged(chain, failed, q, limit, stuck)
    return record.solution(kept, status, failed)


def _call(chain: Chain, system: System, out: Output, begin: int, end: int) -> tuple[Any, ...]:
    """Arguments of `advance`."""
    tables = tables_of(
        chain, once(chain, actuation_of), lambda: chain.run.times(np.arange(begin, end)), end - begin
    )
    return begin, end, system, out, *tables


def _parts(chain: Chain, out: Output) -> Parts:
    """Kernels of a run, for `side_by_side`: the second process begins with what stands last."""
    actuation, q = once(chain, actuation_of), chain.bodies.reference()
    clamps, loads, tables = actuation.clamps(), actuation.loads(), chain.bodies.tables()
    drives, values = drive_table(chain, actuation, np.zeros(1))[0], actuation.load_table(np.zeros(1))[0]
    acting = [
        Task(turn_clamps, (clamps, drives)),
        Task(place_clamps, (q, q, clamps)),
        Task(set_loads, (q, q, q, loads, values)),
    ]
    outputs = [
        Task(work_done, (True, q, clamps, loads, values)),
        Task(keep, (0, 1, q, q, q, tables, loads.connectors, out), by_python=True),
    ]
    factors = block_factors(chain)
    mass = _mass_parts(chain, factors)

    def steps() -> list[Task]:
        if not mass:
            return []
        system = _with_factors(chain, None if chain.split else factors)
        return [Task(advance, _call(chain, system, out, 0, 1), by_python=True)]

    if chain.split:
        return Parts([*acting, *_few_parts(chain, drives), *outputs, *mass, *_elastic_parts(chain)], steps)
    if rows_in(factors.loops) is not None:
        acting += [Task(constrain_motion, (factors, factors.loops, 0, drives, q, q, q))]
    accelerations = Task(by_blocks, (q, q, tables, clamps, factors, q, q), by_python=True)
    return Parts(
        [*acting, *outputs, *mass, accelerations], steps
    )  # the longest is begun first: steps wait for it


def _mass_parts(chain: Chain, factors: BlockFactors) -> list[Task]:
    """What factors the mass in full blocks, for the steps or to check them, where these are compiled before it."""
    q, checked = chain.bodies.reference(), chain.run.check_stability and bool(chain.parts.connectors)
    factored = [Task(factorize, mass_arguments(chain, q, factors), by_python=True)]
    solved = [Task(sweep, (factors, q, q), by_python=True)]
    return [*solved, *factored] if checked else [] if chain.split else factored


def _few_parts(chain: Chain, drives: Array) -> list[Task]:
    """What keeps constraints between few kept unknowns."""
    few = bool(chain.plan.kept) and not chain.kept.pinned
    kept, q = split_factors(chain).kept if few else None, chain.bodies.reference()
    return (
        [] if kept is None or kept.rows is None else [Task(constrain_few, (kept, kept.rows, 0, drives, q, q))]
    )


def _elastic_parts(chain: Chain) -> list[Task]:
    """Elastic forces of each kind of element."""
    q, tables = chain.bodies.reference(), chain.bodies.tables()
    kinds = set(tables.kinds.tolist())
    return [Task(KERNELS[kind].forces, (q, 0, 1, tables.constants[0], tables.buffer)) for kind in kinds]


def _system(chain: Chain) -> System:
    """What the steps of a run start from."""
    return _with_factors(chain, None if chain.split else mass_factors(chain))


def _with_factors(chain: Chain, block: BlockFactors | None) -> System:
    """The same with the mass factored in full blocks, where that is needed.

    Linear constraints between few kept unknowns are kept by their motions: velocities fit them from the start.
    """
    run, bodies, actuation = chain.run, chain.bodies, once(chain, actuation_of)
    few = chain.split and bool(chain.plan.kept)
    q, v = chain.start_coordinates(), fitting_velocity(chain) if few else chain.initial_velocity()
    even, odd, dead = np.zeros_like(q), np.zeros_like(q), chain.dead_load
    scratch = np.zeros((1, 1)) if chain.split else np.zeros_like(q)
    flat = (q.ravel(), v.ravel(), even.ravel(), odd.ravel())
    split = split_factors(chain) if chain.split else no_split_factors(chain)
    return System(
        Numbers(run.steps, run.stride, run.exact_dt, run.psi, run.phi),
        State(q, v, even, odd, dead.copy(), dead, scratch, flat),
        bodies.tables(),
        split,
        block,
        actuation.clamps(),
        actuation.loads(),
        None if bodies.damping is None else Damping(bodies.damping, np.zeros(1)),
        rows_in(block.loops) if block is not None else split.kept.rows if split.kept is not None else None,
    )


def _diverged(chain: Chain, step: int, q: Array, limit: float, stuck: Status | None) -> Status:
    """What is known of a run that diverged at a step.

    Parameters
    ----------
    chain : Chain
    step : int
    q : ndarray, shape (rows, nodes)
    limit : float
        Largest stable step at the output before, s.
    stuck : Status or None
        What is known of constraints that were not kept then: large steps of bodies break them.
    """
    if stuck is not None and stuck.body is not None:
        body, element = stuck.body, stuck.element
    else:
        body, element = worst_element(chain, gradient_size(q))
    t = float(chain.run.times(np.array([step]))[0])
    now = f"{limit:.3g} s at the output before" if limit < chain.run.dt else ""
    if any(mesh.elements for mesh in chain.bodies.meshes):
        why = f": deformation lowers the largest stable step{f', to {now}' if now else ''}"
    else:
        why = f": the largest stable step is {now}" if now else ""
    return Status(
        "diverged",
        f"the motion diverged at t = {t:.6g} s (step {step}) in {part(body, element)}; "
        f"a smaller dt than {chain.run.dt:g} s may help{why}",
        time=t,
        step=step,
        body=body,
        element=element,
    )


@kernel
def advance(begin: int, end: int, system: System, out: Output, clamp_table: Array, load_table: Array) -> int:
    """Steps `begin` … `end` − 1; the step at which the motion diverged or left its constraints, or −1.

    The two tables hold the values of drives, (steps, drives, 3), and of loads, (steps, loads, 2), from step `begin` on.
    """
    numbers, state, tables, split, block, clamps, loads, damping, rows = system
    q, v = state.q, state.v
    flat_q, flat_v, flat_even, flat_odd = state.flat
    acted = len(clamps.nodes) + len(loads.touched) > 0
    one = min(1, q.shape[1] - 1)
    for step in range(begin, end):
        now = state.even if step % 2 == 0 else state.odd
        drives, values = clamp_table[step - begin], load_table[step - begin]
        if acted:
            turn_clamps(clamps, drives)
            place_clamps(q, v, clamps)
        if not _constrain(rows, block, split.kept, len(clamps.nodes), drives, state):
            return step
        if damping is not None:
            _forget_damping(state)
        if acted:
            set_loads(q, state.f, state.dead, loads, values)
            add_connectors(loads.connectors, q, v, values, state.f)
        lost = _resist(damping, state, tables, step > 0, numbers.dt)
        add_work(out, (lost, lost))
        _accelerate(block, rows, state, tables, clamps, split, now)
        out.work[0] += _work_of_drives(rows, step > 0)
        # a value that is not finite anywhere makes this sum not finite
        check = now[0, one] + now[1, one] + now[2, one] + now[3, one]
        if check - check != 0.0:
            return step
        if acted:
            add_work(out, work_done(step > 0, q, clamps, loads, values))
        count_turns(q, out.turns)
        if step % numbers.stride == 0 or step == numbers.steps:
            if too_large(q, STRETCH_LIMIT):
                return step
            keep(step, numbers.stride, q, v, now, tables, loads.connectors, out)
        if step == 0:
            update(flat_q, flat_v, flat_even, flat_even, numbers)
        elif step < numbers.steps:
            if step % 2 == 0:
                update(flat_q, flat_v, flat_even, flat_odd, numbers)
            else:
                update(flat_q, flat_v, flat_odd, flat_even, numbers)
    return -1


@embedded
def _constrain(rows, block, kept, first, drives, state):  # type: ignore[no-untyped-def]
    """Take from positions and velocities what they have beside the constraints; whether these are kept then."""
    if rows is None:
        return True
    return _in_blocks(block, first, drives, state) and _one_by_one(kept, rows, first, drives, state)


@embedded
def _in_blocks(block, first, drives, state):  # type: ignore[no-untyped-def]
    if block is None:
        return True
    return constrain_motion(block, block.loops, first, drives, state.q, state.v, state.scratch)


@embedded
def _one_by_one(kept, rows, first, drives, state):  # type: ignore[no-untyped-def]
    if kept is None:
        return True
    return constrain_few(kept, rows, first, drives, state.q, state.v)


@embedded
def _accelerate(block, rows, state, tables, clamps, split, now):  # type: ignore[no-untyped-def]
    """Accelerations, `now`, and reactions of driven clamps."""
    if block is None:
        by_scalars(tables, clamps, split, state.q, state.f, now)
    else:
        _ask(rows, block.loops)
        by_blocks(state.q, state.f, tables, clamps, block, state.scratch, now)
        _take(rows, block.loops)


@embedded
def _ask(rows, loops):  # type: ignore[no-untyped-def]
    if rows is not None:
        ask_accelerations(loops)


@embedded
def _take(rows, loops):  # type: ignore[no-untyped-def]
    if rows is not None:
        take_accelerations(loops)


@embedded
def _work_of_drives(rows, moving):  # type: ignore[no-untyped-def]
    """Work of the constraints' drives since the step before, J."""
    return row_work(rows, moving) if rows is not None else 0.0


@embedded
def _forget_damping(state):  # type: ignore[no-untyped-def]
    """Damping forces act on all nodes: all forces start from the dead load."""
    for k in range(state.f.shape[0]):
        for i in range(state.f.shape[1]):
            state.f[k, i] = state.dead[k, i]


@embedded
def _resist(damping, state, tables, moving, dt):  # type: ignore[no-untyped-def]
    """Subtract damping forces; their work since the step before, J."""
    if damping is None:
        return 0.0
    first, formulations, kinds, constants, _, buffer = tables
    before = damping.power[0]
    lost = damping_forces(
        formulations, state.q, state.v, first, kinds, constants, damping.of, buffer, state.f
    )
    damping.power[0] = lost
    return -0.5 * dt * (before + lost) if moving else 0.0


@kernel
def update(q: Array, v: Array, a: Array, before: Array, numbers: Numbers) -> None:
    """Zhai's step of all components; `before` is the acceleration one step earlier."""
    h = numbers.dt
    hh, mm = (0.5 + numbers.psi) * h * h, numbers.psi * h * h
    hv, mv = (1.0 + numbers.phi) * h, numbers.phi * h
    for i in range(len(q)):
        q[i] += h * v[i] + (hh * a[i] - mm * before[i])
        v[i] += hv * a[i] - mv * before[i]
