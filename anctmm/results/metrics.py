"""Measures of the difference of two histories."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import SolverError, shown
from anctmm.model.bodies import distance
from anctmm.model.scene import Beam, Probe, Scene
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.validation import EPS, several

Array = NDArray[np.float64]

#: Roundings of positions, m, below which a probe rests: a support moves by a few of them, a free body by more.
ROUNDINGS = 1e3
#: Part of the steps in the finer run that measures the error of time stepping.
FINER = 0.5


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`.

    Parameters
    ----------
    error : float
        Largest over the probes of RMS in time of |u − u_ref| over max in time of |u_ref|; of a probe at which the
        reference rests, the largest |u − u_ref| itself, m. NaN where nothing can be compared: displacements are those
        from the first output, so that a run with no common output after it has no error; and where a probe has
        numbers that are not finite.
    largest : float
        Largest |u − u_ref| over probes and times, relative to the largest |u_ref| of all probes.
    by_probe : dict of probe to float
        The error of each probe.
    cost_ratio : float
        CPU time of the first over that of the second.
    statuses : (Status, Status)
    common : int
        Number of output times both have.
    """

    error: float
    largest: float
    by_probe: dict[Probe, float]
    cost_ratio: float
    statuses: tuple[Status, Status]
    common: int

    @property
    def complete(self) -> bool:
        """Whether both runs are whole."""
        return all(s.ok for s in self.statuses)


def history_error(u: Array, reference: Array, rounding: float = 0.0) -> float:
    """RMS in time of |u − u_ref| over the maximum in time of |u_ref|; both (n, 2).

    Where the reference moves no more than `rounding` (m) it rests, and the error is the largest difference itself, m.
    """
    difference = np.linalg.norm(u - reference, axis=-1)
    scale = np.linalg.norm(reference, axis=-1).max()
    return float(np.sqrt(np.mean(difference**2)) / scale) if scale > rounding else float(difference.max())


def worst(errors: Iterable[float]) -> float:
    """The largest of errors; NaN if one is NaN, wherever it stands: Python's own `max` may pass over it."""
    return float(np.max(np.fromiter(errors, float)))


def rounding_at(solution: Solution, probe: Probe) -> float:
    """Displacement below which a probe of a solution rests, m."""
    return ROUNDINGS * EPS * max(solution.scene.length, float(np.abs(solution.position(probe)).max()))


def compare(solution: Solution, reference: Solution, probes: Sequence[Probe]) -> Comparison:
    """Compare two solutions of one scene at probes, which must stand in the same places where nothing has moved yet.

    Each may have its own mesh, elements, loads and solver, and bodies of other kinds.

    Parameters
    ----------
    solution, reference : Solution
        Compared at the output times both have; a run cut short is compared up to its end.
    probes : sequence
        "body.end" or ("body", fraction).

    Returns
    -------
    Comparison

    Raises
    ------
    SolverError
        If both have histories but no common output times, one holds equilibria and the other a motion, no probe is
        given, or a probe has two places in the two scenes.
    UnknownNameError
        If a probe is not of both scenes.
    """
    needed = "a list of at least one probe is needed, such as ['body.end', ('body', 0.5)]"
    probes = several("probes is", probes, needed, SolverError)
    if not probes:
        raise SolverError(f"probes is []; {needed}")
    for name, value in (("solution", solution), ("reference", reference)):
        if not isinstance(value, Solution):
            raise SolverError(f"{name} is {shown(value)}; a Solution is needed")
    mine, theirs = _common(solution, reference)
    keys = [_check_place(solution, reference, probe) for probe in probes]
    errors, largest, scale, rounding = dict.fromkeys(keys, np.nan), np.nan, np.nan, 0.0
    if (mine > 0).any() and (theirs > 0).any():
        u, v = (
            np.array([one.displacement(key)[at] for key in keys])
            for one, at in ((solution, mine), (reference, theirs))
        )
        rests = [rounding_at(reference, key) for key in keys]
        errors = dict(zip(keys, map(history_error, u, v, rests), strict=True))
        largest, scale = (float(np.linalg.norm(x, axis=-1).max()) for x in (u - v, v))
        rounding = max(rests)
    return Comparison(
        error=worst(errors.values()),
        largest=largest / scale if scale > rounding else float("nan"),
        by_probe=errors,
        cost_ratio=solution.cost.cpu_s / reference.cost.cpu_s if reference.cost.cpu_s > 0 else float("nan"),
        statuses=(solution.status, reference.status),
        common=int(mine.size),
    )


def _common(solution: Solution, reference: Solution) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Places of the common times, of solutions of one kind; at least two of whole ones."""
    if solution.static != reference.static and solution.t.size and reference.t.size:
        kinds = ("equilibria" if s.static else "a motion in time" for s in (solution, reference))
        raise SolverError("solution holds {} and reference {}; two of one kind are needed".format(*kinds))
    mine, theirs = common_times(solution.t, reference.t)
    whole = solution.status.ok and reference.status.ok
    if whole and mine.size < 2 <= min(solution.t.size, reference.t.size):
        raise SolverError(
            f"{solution.solver!r} and {reference.solver!r} have {mine.size} common output times; "
            f"at least 2 are needed: use one output_dt"
        )
    return mine, theirs


def error_between(solution: Solution, finer: Solution) -> float:
    """Error of a run beside a finer one of the same scene and mesh, in the measure of `compare`, of the whole motion.

    The largest RMS in time of |u − u_finer|, over all ends of beams, centres and points of bodies, over the largest
    |u_finer| of them all. NaN where less than two output times are common.
    """
    mine, theirs = common_times(solution.t, finer.t)
    if mine.size < 2:
        return float("nan")
    errors, largest = [0.0], 0.0
    for probe in places_of(solution.scene):
        u, v = solution.displacement(probe)[mine], finer.displacement(probe)[theirs]
        errors.append(float(np.sqrt(np.mean(np.square(u - v).sum(axis=-1)))))
        largest = worst([largest, float(np.linalg.norm(v, axis=-1).max())])
    return worst(errors) / largest if largest > 0.0 else worst(errors)


def verified(solve: Callable[[Discretisation], Solution], solution: Solution) -> Solution:
    """A solution with the error of time stepping: its difference to that of a finer run, which `solve` gives.

    With a tolerance that has more outputs, too, as steps end there. Of a fixed step by Richardson's extrapolation: at
    order p the finer run has 2⁻ᵖ of the error.
    """
    run, factor = solution.run, 1.0
    assert run is not None  # every run of ANC-TMM has one
    if run.tolerance is not None:
        finer = replace(run, tolerance=0.1 * run.tolerance, output_dt=FINER * run.exact_dt)
    else:
        finer = replace(run, dt=FINER * run.dt, output_dt=run.dt if run.output_dt is None else run.output_dt)
        factor = 1.0 / (1.0 - FINER**run.method.order)
    return replace(solution, error_estimate=factor * error_between(solution, solve(finer)))


def places_of(scene: Scene) -> list[Probe]:
    """Ends of all beams, and all points of other bodies."""
    keys = ((body.name, ("start", "end") if isinstance(body, Beam) else body.keys) for body in scene.bodies)
    return [f"{name}.{key}" for name, ends in keys for key in ends]


def _check_place(solution: Solution, reference: Solution, probe: Probe) -> Probe:
    """A probe, written as a pair or a text, that stands in one place of both undeformed scenes.

    An equilibrium, from which a motion may start, depends on mesh and loads.
    """
    scenes = solution.scene, reference.scene
    place = solution.scene.probe(probe)
    key: Any = probe if isinstance(probe, str) else place
    if scenes[0] is scenes[1]:
        return key  # type: ignore[no-any-return]
    one, other = (scene.place(probe).position for scene in scenes)
    if distance(one, other) > 1e-9 * max(scene.length for scene in scenes):  # as they may be rounded
        raise SolverError(
            f"probe {shown(probe)} is at {shown(one)} m in scene {scenes[0].name!r} of the solution and at "
            f"{shown(other)} m in scene {scenes[1].name!r} of the reference; two solutions of one scene are needed"
        )
    return key  # type: ignore[no-any-return]


def common_times(a: Array, b: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Places in both of the times that both have, to 1e-9 of the longer history."""
    if a.size == 0 or b.size == 0:
        return np.empty(0, np.intp), np.empty(0, np.intp)
    tolerance = 1e-9 * max(float(a[-1]), float(b[-1]))
    nearest = np.clip(np.searchsorted(b, a - tolerance), 0, b.size - 1)
    match = np.abs(b[nearest] - a) <= tolerance
    return np.flatnonzero(match), nearest[match]
