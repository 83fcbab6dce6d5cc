"""Runs with a tolerance: steps chosen by an estimate of the local error.

A step of h is accepted where its error is at most the part h / t_end of the tolerance, times the largest displacement
so far: errors of all steps add up to the tolerance, as far as a motion neither amplifies nor forgets them. The next h
follows from the errors of two steps by a proportional-integral controller (Söderlind 2003, ACM Trans. Math. Softw. 29),
and changes only by a fifth or more, as the matrix depends on it. Steps end at all outputs, where loads, drives and free
lengths break, and where an elongation crosses a kink of its law; accelerations are then computed anew.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from anctmm.discretise.methods import GeneralizedAlpha, error_weights
from anctmm.errors import PropertyError
from anctmm.integrators.alpha import means_of
from anctmm.integrators.controlled import attempt_alpha, attempt_esdirk, take
from anctmm.integrators.diagnosis import failed_step
from anctmm.integrators.esdirk import scheme_of
from anctmm.integrators.fixed import settle
from anctmm.integrators.output import Record
from anctmm.integrators.starting import started
from anctmm.integrators.state import State
from anctmm.kernels.announcing import compiling
from anctmm.model.drives import breaks_of
from anctmm.results.ended_early import HistoryError, Interrupted, broken_off, interruption
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.system.system import Inputs, System

Array = NDArray[np.float64]

#: Part of the scene's length that counts as the least displacement.
DISPLACED = 1e-3
#: Exponents of the error and of the one before, times the order; a safety factor; least and largest change of a step.
PRESENT, BEFORE, SAFETY, SHRINK, GROWTH = 0.6, 0.2, 0.9, 0.2, 5.0
#: Relative change of the step below which it stays as it is, and the matrix, too.
SAME = 0.2
#: First and least step, and difference of times that is none, parts of the run.
FIRST, LEAST, CLOSE = 1e-3, 1e-10, 1e-12
#: Part of the error of a step that Newton's iteration may leave, and what rounding leaves, of the scene's length.
LEFT, ROUNDING = 0.1, 1e-13
#: Times over the run at which loads and drives are sampled.
SAMPLES = 400
#: Steps of a run at most, by those tried until now, and the number of these from which on that is known.
MOST, KNOWN = 1_000_000, 5_000


class Trial(NamedTuple):
    """Steps of a method: order of the estimated error over h, and parts of h at which inputs are needed, from 0 on.

    attempt (restart, h, inputs) gives the error, m, or infinity, accept (output or −1, h, inputs) whether it is finite.
    """

    order: int
    nodes: Array
    attempt: Callable[[bool, float, Inputs], float]
    accept: Callable[[int, float, Inputs], bool]
    reject: Callable[[], None]


class Stop(NamedTuple):
    """A time at which a step ends, s; the number of its output, or −1; and whether something breaks there."""

    t: float
    place: int
    breaks: bool


class NoStepError(Exception):
    """No step from here on can be taken."""


class TooManyStepsError(Exception):
    """The run would take more steps than anybody waits for."""


def integrate(system: System, start: Solution | None = None) -> Solution:
    """Run a scene with a tolerance; answer and errors as of `anctmm.integrators.fixed.integrate`."""
    compiling.first_call(started, (system.size, system.space), system)
    march, status = March(system, started(system, start), start), Status()

    def solution(status: Status) -> Solution:
        return march.record.solution(march.outputs, status, march.state, march.steps)

    try:
        march.go()
    except KeyboardInterrupt:
        raise Interrupted(solution(interruption(march.t))) from None
    except PropertyError as error:
        raise HistoryError(solution(broken_off(error, march.t))) from error
    except NoStepError:
        status = failed_step(system, march.state, march.steps, march.t)
    except TooManyStepsError:
        status = too_slow(march)
    march.record.stop()
    if isinstance(system.run.method, GeneralizedAlpha):
        settle(system, march.record, march.state, march.outputs)
    return solution(status)


def too_slow(march: "March") -> Status:
    """Status of a run that would take too many steps."""
    return Status(
        "failed",
        f"the tolerance needs steps of {march.wanted:.2g} s at t = {march.t:.6g} s, more than {MOST} for the run; a "
        f"larger tolerance, a fixed dt, or histories with one smooth value at each time and stated breaks may help",
        time=march.t,
        step=march.steps,
    )


def trial_of(system: System, state: State, record: Record) -> Trial:
    """Steps of the integrator of the run."""
    shapes, tables, out = (system.size, system.space), system.tables, record.out
    if isinstance(system.run.method, GeneralizedAlpha):
        means, before = means_of(system.run.method, 0.0, 0, 0), [np.inf]

        def step(restart: bool, h: float, inputs: Inputs) -> float:
            state.a[:] = state.w + h / before[0] * (state.a - state.w)  # means of times that depend on h
            return float(attempt_alpha(*shapes, restart, means._replace(h=h), tables, state, inputs, out))

        def keep(place: int, h: float, inputs: Inputs) -> bool:
            before[0] = h or np.inf
            return bool(take(system.space, place, h, tables, state, inputs, 1, out))

        return Trial(2, np.array([0.0, 1.0]), step, keep, lambda: None)
    scheme, less = scheme_of(system, 0.0), error_weights()
    method, room, last = scheme.method, scheme.room, len(scheme.method.c) - 1

    def attempt(restart: bool, h: float, inputs: Inputs) -> float:
        return float(attempt_esdirk(*shapes, restart, scheme._replace(h=h), less, tables, state, inputs))

    def accept(place: int, h: float, inputs: Inputs) -> bool:
        out.work[:] += h * method.A[last] @ room.power
        return bool(take(system.space, place, 0.0, tables, state, inputs, last, out))

    def reject() -> None:
        room.power[last] = room.power[0]

    return Trial(3, method.c, attempt, accept, reject)


class March:
    """A run, step by step, from the state at t = 0."""

    def __init__(self, system: System, state: State, start: Solution | None = None) -> None:
        self.system, self.state, self.run = system, state, system.run
        self.record = Record(system, self.run.times(self.run.output_steps), start)
        self.trial = trial_of(system, state, self.record)
        self.inputs = system.inputs(np.zeros(len(self.trial.nodes)))
        key = system.size, system.space, self.trial.order
        compiling.first_call(self.trial.attempt, key, False, 0.0, self.inputs)
        laws = [connector.law for connector in system.scene.connectors]
        self.kinks = [(n, float(kink)) for n, law in enumerate(laws) for kink in getattr(law, "kinks", ())]
        self.elongations = system.tables.acting.now[:, 4]
        self.t, self.steps, self.outputs, self.restart, self.rejected = 0.0, 0, 0, True, False
        self.tried = 0
        self.wanted = self.last = self.of_matrix = FIRST * self.run.t_end
        self.error, self.moved, self.limit, self.tolerance = 1.0, 0.0, 0.0, float(self.run.tolerance or 0.0)
        self.changing = state.q, state.v, state.w, state.a, system.tables.rows.multiplier
        self.largest = np.zeros(1)
        state.counts[2] = 1

    def go(self) -> None:
        """Take all steps, or raise what ends them."""
        self.record.restart()
        if not self.trial.accept(0, 0.0, self.inputs):
            raise NoStepError
        self.outputs = 1
        for stop in stops_of(self.system, self.record.t):
            while self.t < stop.t:
                self.step_to(stop)
            self.restart |= stop.breaks

    def step_to(self, stop: Stop) -> None:
        """Try one step towards a stop, and accept it or go back."""
        stop = Stop(self.limit, -1, False) if self.t < self.limit < stop.t else stop
        same = not self.rejected and abs(self.wanted - self.last) <= SAME * self.last
        base = self.last if same else self.wanted
        count = max(1, int(np.ceil((stop.t - self.t) / base - 1e-6)))
        h = (stop.t - self.t) / count
        end = stop if count == 1 else Stop(self.t + h, -1, False)
        self.saved = [x.copy() for x in self.changing]
        before, error = self.elongations.copy(), self.attempt(h, end)
        crossed = self.crossing(before) if error <= 1.0 else None
        if crossed is not None:
            error, h, end = self.end_at_kink(*crossed, before, error, h, end)
        if error <= 1.0:
            self.accept(error, h, end, crossed is not None)
        else:
            self.go_back()
            if not self.t < self.limit < end.t:
                factor = SAFETY * error ** (-1.0 / self.trial.order) if error < np.inf else 0.5
                self.wanted, self.rejected = h * max(factor, SHRINK), True
            if self.wanted < LEAST * self.run.t_end:
                raise NoStepError

    def attempt(self, h: float, end: Stop) -> float:
        """A step of h: its error over what is allowed, or infinity."""
        run, state, left = self.run, self.state, LEFT * self.allowed(h) / self.system.scene.length
        self.tried += 1
        if self.tried > KNOWN and self.t * MOST < self.tried * run.t_end:
            raise TooManyStepsError
        state.scale[1] = min(left, run.newton_tolerance) if run.newton_given else left
        if abs(h - self.of_matrix) > SAME * self.of_matrix:
            self.state.counts[2] = 1  # the matrix depends on h
        factorizations = state.counts[1]
        try:
            self.inputs = self.inputs_of(h, end)
        except PropertyError:  # a shorter step may end before the time at which a history fails
            if h < run.t_end / SAMPLES:
                raise
            return np.inf
        error = np.inf if self.t < self.limit < end.t else self.trial.attempt(self.restart, h, self.inputs)
        self.of_matrix = h if state.counts[1] > factorizations else self.of_matrix
        return error / self.allowed(h) if error < np.inf else np.inf

    def accept(self, error: float, h: float, end: Stop, restart: bool) -> None:
        """Go on from the end of a step."""
        if not self.trial.accept(end.place, h, self.inputs):
            raise NoStepError
        self.t, self.steps, self.outputs = end.t, self.steps + 1, max(self.outputs, end.place + 1)
        self.moved = self.displacement()
        order, error = self.trial.order, max(error, CLOSE) * (self.wanted / h) ** self.trial.order
        factor = SAFETY * error ** (-PRESENT / order) * self.error ** (BEFORE / order)
        cut = h < 0.5 * self.wanted  # by a stop, which says nothing about longer steps
        most = self.wanted if cut or self.rejected else GROWTH * h
        self.wanted = min(self.wanted * max(factor, SHRINK), most)
        self.last, self.error, self.rejected, self.restart = h, error, False, restart

    def go_back(self) -> None:
        """To the start of the step."""
        for kept, x in zip(self.saved, self.changing, strict=True):
            x[:] = kept
        self.trial.reject()

    def displacement(self) -> float:
        """The largest displacement of a node until now, m."""
        dim = self.system.mesh.dim
        way = (self.state.q - self.record.out.series[0, 0])[:dim] * self.system.mesh.lengths[:dim]
        return max(self.moved, float(np.sqrt((way**2).sum(axis=0).max())))

    def allowed(self, h: float) -> float:
        """Error that a step may have, m."""
        length, share = self.system.scene.length, self.tolerance * h / self.run.t_end
        return max(share * max(self.displacement(), DISPLACED * length), ROUNDING / LEFT * length)

    def inputs_of(self, h: float, end: Stop) -> Inputs:
        """Inputs of a step; beside a break limits from the side of the step.

        If samples within it differ from the polynomial through what it sees by more than the tolerance, relative to the
        largest value until then, it must end at the sample before the first of them.
        """
        t, T, nodes = self.t, self.run.t_end, self.trial.nodes
        times, count = t + h * nodes, len(nodes)
        times[0] += 2.0 * CLOSE * T if self.restart else 0.0
        times[-1] = end.t - (2.0 * CLOSE * T if end.breaks else 0.0)
        grid = np.arange(1, SAMPLES) * (T / SAMPLES)
        samples = grid[(grid > t + CLOSE * T) & (grid < end.t - CLOSE * T)]
        given = self.system.inputs(np.concatenate([times, samples]))
        x = np.hstack([a.reshape(len(a), -1) for a in (given.signals[:, 1:, 0], given.loads, given.free)])
        if not (x.size and samples.size):
            return given
        self.largest = np.maximum(self.largest, np.abs(x).max(axis=0))
        seen = np.vander((samples - t) / h, count) @ np.linalg.solve(np.vander(nodes), x[:count])
        odd = (np.abs(x[count:] - seen) > self.tolerance * self.largest).any(axis=1)
        if odd.any():
            self.limit = float(samples[max(0, int(odd.argmax()) - 1)])
        return given

    def crossing(self, before: Array) -> tuple[int, float] | None:
        """The connector, and the kink, that an elongation has crossed in the step; of several the first."""
        now = self.elongations
        found = [(n, x) for n, x in self.kinks if (before[n] - x) * (now[n] - x) < 0.0]
        return min(found, key=lambda x: (x[1] - before[x[0]]) / (now[x[0]] - before[x[0]]), default=None)

    def end_at_kink(
        self, n: int, kink: float, before: Array, error: float, h: float, end: Stop
    ) -> tuple[float, float, Stop]:
        """A step that ends beyond a kink by no more than Newton's iteration may leave: its error, length and end."""
        bound = LEFT * self.allowed(h)
        side, taken = np.sign(kink - before[n]), (error, h, end)

        def beyond(length: float) -> float:
            nonlocal taken
            if length == 0.0:
                return float(side * (before[n] - kink) - bound)
            if length != taken[1]:
                self.go_back()
                stop = end if length == h else Stop(self.t + length, -1, False)
                taken = self.attempt(length, stop), length, stop
            over = float(side * (self.elongations[n] - kink))
            return 0.0 if 0.0 < over <= bound else over - 0.5 * bound

        if beyond(h) > 0.0:
            brentq(beyond, 0.0, h, xtol=LEAST * self.run.t_end, rtol=CLOSE)
        return taken


def stops_of(system: System, outputs: Array) -> list[Stop]:
    """Times at which steps end: outputs, and where histories break."""
    free = [getattr(c, "length", None) or getattr(c, "angle", None) for c in system.scene.connectors]
    histories = [*(w.history for w in system.signals), *(load.value for load in system.loads), *free]
    close = CLOSE * system.run.t_end
    stops = {round(t / close): Stop(t, k, False) for k, t in enumerate(outputs.tolist())}
    for t in {
        t for history in histories for t in breaks_of("history", history) or () if 0.0 < t < outputs[-1]
    }:
        stops[round(t / close)] = stops.get(round(t / close), Stop(t, -1, True))._replace(breaks=True)
    return sorted(stops.values())
