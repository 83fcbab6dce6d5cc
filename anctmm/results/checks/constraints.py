"""Violated joints and lengths: separated places, displaced supports, strained rigid bodies.

Solvers satisfy them by construction or to the tolerance of Newton's iteration; this check detects where one did not.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import kind_of
from anctmm.model.drives import table_of
from anctmm.model.joints import Clamp, built_in
from anctmm.model.kept import alike, kept
from anctmm.model.places import End, place_text
from anctmm.model.scene import Scene
from anctmm.model.topology import junctions_of
from anctmm.results.checks.acting import length_of, reach_of
from anctmm.results.checks.finding import Finding
from anctmm.results.checks.mechanisms import ADVICE, is_mechanism, mechanism_findings
from anctmm.results.checks.places import Places, joined_places, names_of
from anctmm.results.solution import Solution

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Ints = NDArray[np.int64]
Names = tuple[End, ...]

EPS = float(np.finfo(float).eps)
#: Distance of joined ends, of the length of all bodies, above which a joint is not kept; of angles, rad. The global DAE
#: without stabilisation drifts by 1e-12 in a million steps.
PARTED = 1e-4
#: Strain of a rigid body above which its length is not kept.
STRAINED = 1e-6
#: Roundings of the coordinates that count as no distance.
ROUNDINGS = 1e3


class Constraints(NamedTuple):
    """What the joints of a scene keep, of places numbered as in `Places`: of mechanisms positions alone.

    Parameters
    ----------
    held, places
        Places that are held, and where, as complex numbers, (held, 1).
    joined : ndarray of int, shape (2, k)
        Pairs that share a place.
    welded : ndarray of int, shape (2, k)
        Pairs of ends that turn alike.
    clamped : ndarray of int
        Ends whose direction is held, or driven, by `clamps`.
    clamps : tuple of Clamp
    undo : ndarray of complex, shape (ends of beams, 1)
        Turns each end's axis back to the x axis.
    """

    held: Ints
    places: Complex
    joined: Ints
    welded: Ints
    clamped: Ints
    clamps: tuple[Clamp, ...]
    undo: Complex


def constraint_findings(solution: Solution, places: Places, *, static: bool = False) -> Iterator[Finding]:
    """What speaks against a run of any solver.

    Parameters
    ----------
    solution : Solution
    places : Places
        Its own.
    static : bool
        Whether its times are load factors.
    """
    scene = solution.scene
    of, names, (place, gradient) = constraints_of(scene), names_of(scene), places
    length, rounding = length_of(scene), ROUNDINGS * EPS * reach_of(scene)
    parted, turned = PARTED * length + rounding, PARTED + rounding / length
    if of.held.size:
        away = np.abs(place[of.held] - of.places)
        yield from _beyond(away, parted, "m", _held(names, of.held, "held", "place"))
    if of.joined.size:
        apart = np.abs(place[of.joined[1]] - place[of.joined[0]])
        yield from _beyond(apart, parted, "m", _pair(names, of.joined, "joined", "parted"))
    if is_mechanism(scene):
        yield from mechanism_findings(solution, parted, turned, static=static)
        return
    if of.clamped.size or of.welded.size:
        turn = gradient / np.abs(gradient) * of.undo
    if of.clamped.size:
        off = np.abs(turn[of.clamped] - _driven(of.clamps, solution, static))
        yield from _beyond(off, turned, "rad", _held(names, of.clamped, "clamped", "direction"))
    if of.welded.size:
        off = np.abs(turn[of.welded[1]] - turn[of.welded[0]])
        yield from _beyond(off, turned, "rad", _pair(names, of.welded, "welded", "turned from each other"))
    yield from _strained(solution, place, rounding)


@kept
def constraints_of(scene: Scene) -> Constraints:
    """What the joints of a scene keep."""
    of, names = _numbered(scene), names_of(scene)
    points = [complex(*scene.body(name).position_at(key)) for name, key in map(names.__getitem__, of.held)]
    along = np.exp([-1j * body.angle for body in scene.beams])
    clamps = (
        ()
        if is_mechanism(scene)
        else tuple(
            clamp for junction in junctions_of(scene) for clamp in junction.clamps if clamp is not None
        )
    )
    places = np.array(points, dtype=np.complex128)[:, None]
    return of._replace(places=places, clamps=clamps, undo=np.repeat(along, 2)[:, None])


@alike
def _numbered(scene: Scene) -> Constraints:
    """The same without what has numbers of the scene: places, clamps and turns."""
    number = {end: i for i, end in enumerate(names_of(scene))}
    find = _of_joints if is_mechanism(scene) else _of_junctions
    held, joined, welded, clamped = ([number[end] for end in ends] for ends in find(scene))
    pairs, turned = (np.array(one, dtype=np.int64).reshape(-1, 2).T for one in (joined, welded))
    nothing = np.empty(0, dtype=np.complex128)
    return Constraints(_numbers(held), nothing, pairs, turned, _numbers(clamped), (), nothing)


def _numbers(found: list[int]) -> Ints:
    return np.array(found, dtype=np.int64)


#: Places held, those joined and welded, pair after pair, and those clamped.
Named = tuple[list[End], list[End], list[End], list[End]]


def _of_joints(scene: Scene) -> Named:
    """Positions that the joints of a mechanism keep, each by itself."""
    held, joined = list[End](), list[End]()
    for joint, (first, *others) in zip(built_in(scene.joints), joined_places(scene), strict=True):
        if joint.grounded:
            held.append(first.end)
        joined += [end for other in others for end in (first.end, other.end)]
    return held, joined, [], []


def _of_junctions(scene: Scene) -> Named:
    """What the joints between the ends of beams keep, together."""
    held, clamped = list[End](), list[End]()
    pairs: tuple[list[End], list[End]] = ([], [])
    for junction in junctions_of(scene):
        if junction.grounded:
            held.append(junction.ends[0])
        for together, groups in zip(pairs, ((junction.ends,), junction.groups), strict=True):
            together += [name for group in groups for end in group[1:] for name in (group[0], end)]
        for group, clamp in zip(junction.groups, junction.clamps, strict=True):
            if clamp is not None:
                clamped.append(group[0])
    return held, *pairs, clamped


def _driven(clamps: tuple[Clamp, ...], solution: Solution, static: bool) -> Complex:
    """Turns that the clamps make, (clamps, n), or (clamps, 1) where all are fixed."""
    if all(clamp.angle is None for clamp in clamps):
        return np.ones((len(clamps), 1), dtype=np.complex128)
    t = np.zeros(1) if static else solution.t
    angles = np.zeros((len(clamps), t.size))
    for row, clamp in zip(angles, clamps, strict=True):
        if clamp.angle is not None:
            row[:] = table_of(f"clamp {clamp.end!r} angle", clamp.angle, t, 3)[:, 0]
    return np.asarray(np.exp(1j * angles))


def _strained(solution: Solution, place: Complex, rounding: float) -> Iterator[Finding]:
    """Rigid bodies whose length is not kept."""
    run = solution.run
    kinds = {} if run is None or not _any_rigid(run.element) else run.of(solution.scene)
    for b, (name, (_, kind)) in enumerate(kinds.items()):
        if kind_of(kind).rigid:
            length = solution.scene.beam(name).length
            strain = np.abs(np.abs(place[2 * b + 1] - place[2 * b]) / length - 1.0)
            allowed = STRAINED + rounding / length
            yield from _beyond(strain[None], allowed, "of itself", partial(_longer, name))


def _longer(name: str, _: int) -> tuple[str, str]:
    """Tells of a rigid body."""
    return name, f"rigid body {name!r} has changed its length by"


def _any_rigid(element: str | Mapping[str, str]) -> bool:
    """Whether a kind of element, or one of those of several bodies, is rigid."""
    names = {element} if isinstance(element, str) else set(element.values())
    return any(kind_of(name).rigid for name in names)


def _beyond(
    sizes: Array, allowed: float, unit: str, told: Callable[[int], tuple[str, str]]
) -> Iterator[Finding]:
    """The first size of each row above what is allowed; what is no number is left to the check of divergence.

    Parameters
    ----------
    sizes : ndarray, shape (m, n)
    allowed : float
    unit : str
    told : callable
        Number of a row → body, and what has happened to it.
    """
    bad = sizes > allowed
    if np.count_nonzero(bad):  # quicker than any() where arrays are small
        for row in np.flatnonzero(bad.any(axis=1)):
            k = int(bad[row].argmax())
            body, what = told(int(row))
            yield Finding(k, "failed", f"{what} {sizes[row, k]:.2g} {unit} at {{when}}; {ADVICE}", body)


def _held(names: Names, places: Ints, how: str, what: str) -> Callable[[int], tuple[str, str]]:
    """Tells of a place that is not where it was, or has turned."""

    def told(row: int) -> tuple[str, str]:
        end = names[places[row]]
        return end[0], f"{place_text(end)}, which is {how}, has left its {what} by"

    return told


def _pair(names: Names, pairs: Ints, how: str, what: str) -> Callable[[int], tuple[str, str]]:
    """Tells of two places that are no longer together."""

    def told(row: int) -> tuple[str, str]:
        one, two = (names[place] for place in pairs[:, row])
        return two[0], f"{place_text(one)} and {place_text(two)}, which are {how}, have {what} by"

    return told
