"""Runs whose steps an estimate of their error drives: what all methods share.

How far the nodes will move is first guessed by a few long steps of one Newton correction each, and where these find a
scene at rest, or next to nothing of what acts, by steps over the whole run and what acts beside them. Where a run finds
that they move much less than was assumed, it is made again; so it is where bodies are found to turn freely
(`free_turns`) or impacts to matter (`law_kinks`).

Steps end where loads or drives break; where a load or the acceleration of a drive jumps, accelerations start anew. What
happens between the ends of a step is no part of an estimate from these. So what a load does beside what the step sees
of it is added: its impulse ∫|f − f_seen| dt, times h as if it came at the start; and what a drive does beside the
polynomial of its angles and rates, times the length of the scene. Both vanish faster than the rest as steps fall.

How long steps are stands in `step_control`, the steps themselves in `alpha_control` and `stage_control`.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import mass_product
from anctmm.discretise.chain import Chain
from anctmm.discretise.fitting import fitting_velocity
from anctmm.discretise.junctions.as_written import as_written
from anctmm.discretise.junctions.constraints import Drive
from anctmm.discretise.kept_chains import once_alike
from anctmm.discretise.mesh import varying_loads
from anctmm.discretise.methods import NO_STEP
from anctmm.forces.actuation import actuation_of, work_done
from anctmm.forces.connectors import count_turns, driven_connectors, has_clock
from anctmm.forces.driving import drives_of
from anctmm.forces.timeline import Timeline, timeline
from anctmm.integrators.adaptive.free_turns import ANEW, begin_turns, know_turns, new_turns
from anctmm.integrators.adaptive.law_kinks import begin_kinks, know_kinks, new_kinks
from anctmm.integrators.adaptive.returning import (
    afloat,
    begin_returning,
    held,
    know_returning,
    new_returning,
    restrained,
)
from anctmm.integrators.adaptive.step_control import (
    CAP,
    DONE,
    KEPT,
    POSITIONS,
    PROGRESS,
    SPENT,
    STARTS,
    TIME,
    TOLD_APART,
    TURNED,
    UNFINISHED,
    WANTED,
    Control,
)
from anctmm.integrators.adaptive.step_error import TINY
from anctmm.integrators.broken_law import broken_law
from anctmm.integrators.implicit.balanced import settle
from anctmm.integrators.implicit.newton_failure import correction_size
from anctmm.integrators.implicit.run import balance, parts_of
from anctmm.integrators.implicit.system import Newton, System, least_left, new_system
from anctmm.integrators.locking import locked, rows_in
from anctmm.integrators.output import (
    STEP,
    Output,
    Record,
    gradient_size,
    worst_element,
)
from anctmm.integrators.singular_positions import advice_at
from anctmm.integrators.turn_count import begin_count
from anctmm.jit.compiler.second_process import Parts, Task, side_by_side
from anctmm.jit.direct import Direct
from anctmm.kernels.pacing import paced
from anctmm.recursion.accelerations import by_blocks
from anctmm.recursion.riccati import sweep
from anctmm.results.checks.divergence import STRETCH_LIMIT
from anctmm.results.checks.finding import part
from anctmm.results.ended_early import Interrupted, interruption
from anctmm.results.solution import Solution
from anctmm.results.status import Status, in_short

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: First step, of the interval of output, at a tolerance of LOOSE and at smaller ones in proportion to the root of the
#: method's order.
FIRST, LOOSE = 0.5, 1e-2
#: Angle by which a section turns in the first step at most, rad, at its rate at the start: of a bar that spins freely
#: and turns by some radians in a step the estimate sees nothing, as stiff steps carry it along a chord.
TURNED_FIRST = 0.3
#: Part of the tolerance that the first step may make of the error of an elastic body that spins, and the angle, rad,
#: that it may always turn. At the start nothing is stretched: a first step of θ goes along the tangent, and what then
#: pulls back takes θ²/2 of the speed.
START_PART, NO_TURN = 0.2, 1e-4
#: Share of the tolerance that the sum of the errors of the steps may take. With it the largest error of 583 runs of 250
#: scenes drawn at random was 2.2 times the one asked for at any time, by either method; 1 and 1.2 gave 8.
SHARE = 0.7
#: More steps than a run can have.
UNLIMITED = 1 << 60
#: Steps, as parts of the run, that guess how far nodes move, and about the shortest; what they find counts up to FAR of
#: the scene's length.
GUESS, SHORTEST, FAR = (0.5, 0.125), 1e-6, 0.5
#: Times what a guess finds, that it may miss of what acts: beyond, it has seen none of it.
BLIND = 1e3
#: Displacement assumed at least of a scene that is found at rest, of its length; and that below which nothing moves, of
#: its length or of its distance from the origin, to which positions are rounded.
AT_REST = 1e-6
STILL = 1e-11
#: Part of the largest displacement to which errors of nodes that move less are relative.
SMALL = 0.25
#: Largest value of the shape function of a gradient, of the element's length.
BULGE = 4.0 / 27.0
#: Times the error allowed that may be found at the end, relative to what has moved: SHARE of it is within three times
#: the tolerance. With 2 a falling beam whose errors grow was computed twice. Rounds of a run, at most.
FOUND, ROUNDS = 3.0, 4


class Scheme(NamedTuple):
    """A method whose steps an error drives.

    advance: kernel of the steps, which gives how it ended. adds: what it needs beside the rest. order: of the error of
    a run in its steps. places: at which a step sees what acts. constrained, goes_on: the `SHARE` of scenes with
    constraints between rigid bodies or guides, and where these are known to turn freely or to go to and fro. shows: of
    `Newton`. look: (chain, system, time of failure) sees whether constraints can be kept then, where steps do not keep
    positions.
    """

    advance: Any
    adds: tuple[Any, ...]
    order: int
    places: int
    constrained: float
    goes_on: float
    shows: float = 0.0
    look: Callable[[Chain, System, float], None] | None = None

    def take(self, most: int, outputs: int, system: System, control: Control, out: Output) -> int:
        """Take steps, `most` of them at most; how it ended."""
        return int(self.advance(most, outputs, system, control, self.adds, out))


class March(NamedTuple):
    """One run: outputs kept, time reached (s), whether that is the end, or the user stopped it.

    moved: largest displacement of each node, m, (nodes,). error: sum of the local errors, relative. turned: whether it
    ended because a body was found to turn freely.
    """

    kept: int
    t: float
    whole: bool
    stopped: bool
    moved: Array
    error: float
    turned: bool


def run_controlled(chain: Chain, scheme: Scheme) -> Solution:
    """Run a scene with the steps of a scheme.

    Returns
    -------
    Solution
        With a status that names time and element if no step was small enough.

    Raises
    ------
    PropertyError
        If a load or a drive cannot be followed, see `anctmm.forces.histories`.
    """
    run, record = chain.run, Record(chain)
    system, control, out = _system(chain, scheme), _control(chain, scheme), record.arrays()
    outputs, ends = run.times(np.arange(run.steps + 1)), np.array([0.0, run.t_end])
    still, counts = np.zeros(chain.bodies.nodes), control.counts

    def so_far(kept: int, status: Status) -> Solution:
        corrections, factorizations, _ = system.newton.counts
        return record.solution(kept, status, int(counts[0]), int(corrections), int(factorizations))

    def march(times: Array, assumed: Array, scale: float = 0.0, guess: int = 0, anew: int = 0) -> March:
        found = _march(chain, scheme, system, control, out, times, assumed, scale, guess, anew > 0)
        if found.stopped:
            raise Interrupted(so_far(min(found.kept, 1) if guess else found.kept, interruption(found.t)))
        if found.turned:
            if not (know_kinks(control.kinks) or know_returning(control.returning)):
                know_turns(control.turns, found.t, run.t_end)
            return march(times, assumed, scale, guess, anew - 1)
        return found

    def compiled() -> Direct:
        with side_by_side(lambda: _parts(chain, system, control, out)):
            march(np.zeros(1), still)
        return Direct(scheme.advance)

    kinds = system.damping is None, system.factors.L.dtype, control.kinks is None
    scheme = scheme._replace(advance=once_alike(chain, compiled, scheme.advance, kinds))
    record.start()
    counts[:] = 0.0
    system.newton.counts[:] = 0
    guesses = _guesses(lambda part: march(part * ends, still, chain.length, guess=1))
    assumed, scale = _assumed(chain, [guess.moved for guess in guesses])
    if scale < max(AT_REST * chain.length, *(_missed(chain, guess) / BLIND for guess in guesses)):
        scale = _acted(chain, march(ends, still, chain.length, guess=len(control.actions.stops)))
    least = STILL * max(chain.length, float(np.abs(chain.start_coordinates()[:2]).max()))
    for _ in range(ROUNDS):
        done = march(outputs, assumed, scale, anew=ANEW)
        moved, missed = float(done.moved.max()), done.error * scale
        if not done.whole or max(moved, missed) < least:
            break
        used = np.maximum(np.maximum(assumed, done.moved), SMALL * max(scale, moved))
        most = (used / np.maximum(done.moved, max(SMALL * moved, TINY))).max()
        if done.error * most <= FOUND * _allowed(chain, scheme, system, control):
            break
        # what acts for a moment may be seen by errors alone, if far too much was assumed
        assumed, scale = done.moved, moved if moved > least else missed
    record.stop()
    status = Status() if done.whole else _stuck(chain, scheme, system, control, done.t)
    # after the look at where it failed: it writes the state
    settle(chain, system, record, done.kept, partial(_from_outputs, chain, scheme, control), out)
    return so_far(done.kept, status)


def _parts(chain: Chain, system: System, control: Control, out: Output) -> Parts:
    """Kernels that all methods call, for compilation in a second process."""
    state, drives, values = system.state, control.angles[0], control.values[0]
    tables, factors, load = system.tables, system.factors, control.load
    parts = [
        Task(mass_product, (control.x, tables.first, tables.masses, tables.buffer, load)),
        Task(work_done, (True, state.q, system.clamps, system.loads, values)),
        Task(balance, (system, drives, values)),
        Task(sweep, (factors, load, control.x)),
        Task(
            by_blocks,
            (state.q, state.f, tables, system.clamps, factors, state.w_before, state.w),
            by_python=True,
        ),
    ]
    return parts_of(system, NO_STEP, out, parts)


def _guesses(step: Callable[[float], March]) -> list[March]:
    """What single steps over parts of the run find; where none of them can be taken, a shorter one.

    By its mean speed nodes move on: without any guess errors are relative to what hardly moves yet, and a frame that is
    let go under its load took 7,618 steps instead of 1,576.
    """
    guesses, part = [step(part) for part in GUESS], GUESS[-1]
    while not any(guess.t for guess in guesses) and part > SHORTEST:
        part *= 0.25
        guess = step(part)
        guesses.append(guess._replace(moved=guess.moved * (GUESS[0] / part)))
    return guesses


def _assumed(chain: Chain, guesses: list[Array]) -> tuple[Array, float]:
    """Displacements assumed of each node, m, (nodes,), and of the scene: those of a guess, none of them far.

    A guess is that of equations made linear at the start: right for small motions, and too large for large ones.
    """
    moved = np.nan_to_num(np.max(guesses, axis=0), posinf=0.0)
    scale = min(float(moved.max()), FAR * chain.length)
    return moved * (scale / max(float(moved.max()), TINY)), scale


def _missed(chain: Chain, guess: March) -> float:
    """Displacement that the steps of a guess miss, m."""
    return float(np.nan_to_num(SMALL * chain.length * guess.error))


def _acted(chain: Chain, guess: March) -> float:
    """Displacement of a scene that is at rest until something acts, or that acts too fast for long steps, m.

    The guess is by a step between all breaks of what acts. It counts what these steps find, and what they miss. Without
    it errors would be relative to what rounding has moved until then, or a drive that has just begun where the first
    guesses end. Less than AT_REST is found in a second round.
    """
    found = max(_missed(chain, guess), float(np.nan_to_num(guess.moved.max())))
    return min(max(found, AT_REST * chain.length), FAR * chain.length)


def _allowed(chain: Chain, scheme: Scheme, system: System, control: Control) -> float:
    """Sum of local errors that is allowed."""
    share = SHARE
    if rows_in(system.factors.loops) is not None:
        goes_on = control.turns.found[0] or control.returning.known[0]
        share = scheme.goes_on if goes_on else scheme.constrained
    return share * float(chain.run.tolerance or 0.0)


def _system(chain: Chain, scheme: Scheme) -> System:
    """What the steps take: without a tolerance of the user's, Newton's is a part of the error of a step alone."""
    system = new_system(chain)
    newton = system.newton._replace(expected=np.array([1.0, 0.0, 0.0]), shows=scheme.shows)
    return system._replace(newton=newton if chain.run.newton_given else newton._replace(tolerance=np.inf))


def _actions(chain: Chain, drives: Sequence[Drive]) -> Timeline:
    """What acts on a scene in time."""
    parts, run = chain.parts, chain.run
    loads = [as_written(parts, load) for load in varying_loads(parts)]
    connectors = [as_written(parts, connector) for connector in driven_connectors(parts)]
    return timeline(drives, loads, connectors, run.t_end, run.times(np.arange(run.steps + 1)))


def _control(chain: Chain, scheme: Scheme) -> Control:
    """Step control before the first march."""
    bodies, places = chain.bodies, scheme.places
    driven, start = drives_of(chain, actuation_of(chain)), chain.start_coordinates()
    turns, actions = [drive.turns for drive in driven], _actions(chain, driven)
    drives, histories, bulge = len(turns), len(actions.pieces.steady), _bulge(chain)
    return Control(
        allowed=np.inf,
        tolerance=float(chain.run.tolerance or 0.0),
        t_end=chain.run.t_end,
        reach=np.where(turns, chain.length, 1.0),
        small=SMALL,
        rounding=least_left(chain),
        times=np.zeros(1),
        counts=np.zeros(2),
        scale=np.zeros(1),
        fastest=np.zeros(1),
        load=np.zeros_like(start),
        x=np.zeros_like(start),
        angles=np.zeros((places, drives, 3)),
        values=np.zeros((places, histories - drives + has_clock(chain.parts), 2)),
        missed=np.zeros(2),
        reference=start,
        bulge=bulge,
        by_gradient=_by_gradient(chain, bulge),
        moved=np.zeros((2, bodies.nodes)),
        elastic=_elastic(chain),
        damping=0.0 if bodies.damping is None else float(max(bodies.damping)),
        restrained=restrained(chain),
        held=held(chain),
        afloat=afloat(chain),
        progress=np.zeros(len(PROGRESS)),
        actions=actions,
        turns=new_turns(chain),
        returning=new_returning(chain),
        kinks=new_kinks(chain.parts, places),
    )


def _bulge(chain: Chain) -> Array:
    """Displacement beside each node that a unit of its gradient makes, m, (nodes,)."""
    return np.concatenate(
        [np.full(m.nodes, BULGE * m.element_length or m.reach) for m in chain.bodies.meshes]
    )


def _by_gradient(chain: Chain, bulge: Array) -> float:
    """The largest displacement that a unit of a gradient makes, relative to Newton's scale; 1 with a user's bound."""
    return 1.0 if chain.run.newton_given else min(1.0, float(bulge.max()) / chain.length)


def _elastic(chain: Chain) -> Array:
    """Constants of the elements, and what a factor τ of each body adds: they are linear in the stiffness."""
    bodies = chain.bodies
    if bodies.damping is None:
        return np.zeros((2, 0, 0))
    plain = bodies.tables().constants
    damped = bodies.stiffened([1.0 + tau for tau in bodies.damping], stresses=False)
    return np.array([plain, damped.tables().constants - plain])


def _march(
    chain: Chain,
    scheme: Scheme,
    system: System,
    control: Control,
    out: Output,
    times: Array,
    assumed: Array,
    scale: float,
    guess: int,
    look: bool,
) -> March:
    """Run from the start over `times`, with displacements that are assumed, or a `guess` of them by so many steps.

    look: whether it ends when a body is found to turn freely.
    """
    run, state, newton = chain.run, system.state, system.newton
    _forget_failure(system)
    state.q[:], state.v[:] = control.reference, fitting_velocity(chain)
    control.moved[0], control.moved[1] = 0.0, assumed
    begin_turns(control.turns, look, run.t_end)
    begin_returning(control.returning, state.q)
    begin_kinks(control.kinks)
    control.scale[0], control.fastest[0] = scale, 0.0
    out.work[:] = 0.0
    begin_count(state.q, out.turns)
    turned = np.zeros_like(state.q[0]) if chain.start is None else chain.start.turned
    count_turns(system.loads.connectors, state.q, turned)  # those at the end of the last run stand there
    first = times[-1] if guess else _first_step(chain, scheme, state.q, state.v, control.turns.elastic)
    control.progress[:] = 0.0
    control.progress[WANTED], control.progress[STARTS] = first, 1.0
    control.progress[CAP] = np.inf
    control = control._replace(
        allowed=np.inf if guess else _allowed(chain, scheme, system, control), times=times
    )
    system = system._replace(newton=newton._replace(tolerance=np.inf)) if guess else system
    if newton.expected is not None:
        newton.expected[:] = 1.0, 0.0, 0.0
    code, stopped = UNFINISHED, False
    for begin, end in paced(UNLIMITED, STEP * chain.bodies.nodes):
        try:
            code = int(scheme.take(guess or end - begin, len(times) - 1, system, control, out))
        except KeyboardInterrupt:
            stopped = True
        if code != UNFINISHED or stopped or guess:
            break
    progress = control.progress
    return March(
        int(progress[KEPT]), float(progress[TIME]), code == DONE, stopped, control.moved[0].copy(),
        float(progress[SPENT]), code == TURNED,
    )  # fmt: skip


def _forget_failure(system: System) -> None:
    """Put 0 where the march before has left no number, as a guess does beyond what a law has numbers for."""
    connectors, rows = system.loads.connectors, rows_in(system.factors.loops)
    left: list[Array] = [*system.state[:8], system.state.loads]
    if connectors is not None:
        left += [connectors.now, connectors.memory, connectors.v]
    if rows is not None:
        left += [rows.x, rows.multipliers, rows.trusted, rows.memory]
    for array in left:
        array[~np.isfinite(array)] = 0.0


def _first_step(chain: Chain, scheme: Scheme, q: Array, v: Array, elastic: bool) -> float:
    """Length of the first step, s."""
    run, tolerance = chain.run, float(chain.run.tolerance or 0.0)
    h = FIRST * min(1.0, (tolerance / LOOSE) ** (1.0 / scheme.order)) * run.exact_dt
    spin, angle = max(_largest_spin(q, v), TINY), TURNED_FIRST
    if elastic:
        # lost speed is that part of the displacement, or of the turn of a bar that moves by twice its length
        grows = max(1.0, 0.5 * spin * run.t_end)
        angle = min(angle, max(NO_TURN, float(np.sqrt(2.0 * START_PART * tolerance / grows))))
    return float(min(h, angle / spin))


def _largest_spin(q: Array, v: Array) -> float:
    """Largest rate at which a gradient turns, rad/s."""
    x, y = q[2::2], q[3::2]
    squares = x * x + y * y
    there = squares > 0.0
    return float(np.max(np.abs(x * v[3::2] - y * v[2::2])[there] / squares[there], initial=0.0))


def _from_outputs(
    chain: Chain, scheme: Scheme, control: Control, outputs: Ints, system: System, out: Output
) -> Callable[[int, Newton], int]:
    """What starts a motion anew in the present state at the k-th of some outputs: for its accelerations alone."""
    times, progress = chain.run.times(outputs), control.progress
    rooms = {name: np.empty_like(getattr(out, name)[:1]) for name in ("q", "v", "a", "energy", "angles")}
    aside = out._replace(**rooms, work=np.empty_like(out.work))

    def start(k: int, newton: Newton) -> int:
        progress[:] = 0.0
        progress[TIME], progress[STARTS] = times[k], 1.0
        here = control._replace(times=times[k : k + 1])
        return int(scheme.take(0, 0, system._replace(newton=newton), here, aside))

    return start


def _stuck(chain: Chain, scheme: Scheme, system: System, control: Control, t: float) -> Status:
    """What is known of a run that ended early."""
    state, history = system.state, system.newton.history
    if scheme.look is not None:
        scheme.look(chain, system, t)
    rounded = _rounded(chain, scheme, system, control)
    if not rounded and (found := locked(chain, state.q, rows_in(system.factors.loops), t)) is not None:
        return found
    if (found := broken_law(chain, system.loads.connectors, t)) is not None:
        return found
    if history.any():
        body, element = worst_element(chain, correction_size(chain, state))
        what = (
            f"no step was small enough at t = {t:.6g} s, with corrections {in_short(history)} in the last one "
            f"tried{'' if rounded else '; the motion may be unbounded there'}"
        )
    else:
        body, element = worst_element(chain, gradient_size(state.q))
        what = f"gradients grew beyond {STRETCH_LIMIT:g} by t = {t:.6g} s"
    return Status(
        "diverged",
        f"{what}, worst in {part(body, element)}: {rounded or _advice(chain, state.q, t)}",
        time=t,
        body=body,
        element=element,
    )


def _rounded(chain: Chain, scheme: Scheme, system: System, control: Control) -> str:
    """Advice where the tolerance is too close to rounding for errors of steps to be told from it; empty elsewhere."""
    scale = float(control.scale[0])
    known = POSITIONS * control.rounding * system.newton.scale
    if _allowed(chain, scheme, system, control) * scale >= TOLD_APART * known:
        return ""
    asked = float(chain.run.tolerance or 0.0) * scale
    return (
        f"tolerance {chain.run.tolerance:g} of a motion of {scale:.2g} m is {asked:.2g} m, and each step rounds "
        f"positions to {known:.2g} m: a larger tolerance is needed"
    )


def _advice(chain: Chain, q: Array, t: float) -> str:
    """What to try where no step is small enough."""
    if (singular := advice_at(chain, q, t)) is not None:
        return singular
    bends = any(beam.name not in chain.rigid for beam in chain.parts.beams)
    return "a load that does not jump may help" + (", or a finer mesh" if bends else "")
