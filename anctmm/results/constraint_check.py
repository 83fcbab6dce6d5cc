"""Joints and lengths that are not kept: parted ends, supports that have moved, rigid bodies that are strained.

Solvers keep them by construction or to the tolerance of Newton's iteration; this is what sees that one did not.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import kind_of
from anctmm.model.drives import tabulate
from anctmm.model.places import End
from anctmm.model.topology import Junction, junctions_of
from anctmm.results.acting import length_of
from anctmm.results.fields import HermiteField
from anctmm.results.finding import Finding
from anctmm.results.solution import Solution

Array = NDArray[np.float64]

EPS = float(np.finfo(float).eps)
#: Distance of joined ends, of the length of all bodies, above which a joint is not kept; of angles, rad. The global DAE
#: without stabilisation drifts by 1e-12 in a million steps.
PARTED = 1e-4
#: Strain of a rigid body above which its length is not kept.
STRAINED = 1e-6
#: Roundings of the coordinates that count as no distance.
ROUNDINGS = 1e3
ADVICE = "a smaller dt or a smaller newton_tolerance may do"


def constraint_findings(solution: Solution, *, static: bool = False) -> Iterator[Finding]:
    """What speaks against a run of any solver; its times are load factors if `static`."""
    scene = solution.scene
    if solution.t.size == 0 or set(solution.fields) != {body.name for body in scene.beams}:
        return
    paths = {
        (body.name, side): solution.position(body.name, float(side))
        for body in scene.beams
        for side in (0, 1)
    }
    reach = max(float(np.abs(path[0]).max()) for path in paths.values())
    length = length_of(scene)
    rounding = ROUNDINGS * EPS * reach
    for junction in junctions_of(scene):
        yield from _parted(solution, junction, paths, PARTED * length + rounding)
        yield from _turned(solution, junction, PARTED + rounding / length, static)
    yield from _strained(solution, paths, rounding)


def _parted(
    solution: Solution, junction: Junction, paths: dict[End, Array], allowed: float
) -> Iterator[Finding]:
    """Ends that are not where their junction is."""
    one, *others = junction.ends
    if junction.grounded:
        body = solution.scene.beam(one[0])
        away = _distance(paths[one], np.array([(body.start, body.end)[one[1]]]))
        yield from _beyond(away, allowed, f"{_text(one)}, which is held, has left its place by", "m", one)
    for other in others:
        apart = _distance(paths[other], paths[one])
        what = f"{_text(one)} and {_text(other)}, which are joined, have parted by"
        yield from _beyond(apart, allowed, what, "m", one)


def _turned(solution: Solution, junction: Junction, allowed: float, static: bool) -> Iterator[Finding]:
    """Ends whose direction is not that of their group, or of its clamp."""
    for group, clamp in zip(junction.groups, junction.clamps, strict=True):
        turns = {end: turn for end in group if (turn := _turn(solution, end)) is not None}
        if len(turns) < len(group):
            continue
        one = group[0]
        if clamp is not None:
            angle = np.zeros(solution.t.size)
            if clamp.angle is not None:
                t = np.zeros(1) if static else solution.t
                angle = tabulate(f"clamp {clamp.end!r} angle", clamp.angle, t, 3)[:, 0]
            off = np.abs(turns[one] - np.exp(1j * angle))
            yield from _beyond(
                off, allowed, f"{_text(one)}, which is clamped, has left its direction by", "rad", one
            )
        for other in group[1:]:
            off = np.abs(turns[other] - turns[one])
            what = f"{_text(one)} and {_text(other)}, which are welded, have turned from each other by"
            yield from _beyond(off, allowed, what, "rad", one)


def _strained(solution: Solution, paths: dict[End, Array], rounding: float) -> Iterator[Finding]:
    """Rigid bodies whose length is not kept."""
    kinds = {} if solution.run is None else solution.run.of(solution.scene)
    for name, (_, kind) in kinds.items():
        if kind_of(kind).rigid:
            length = solution.scene.beam(name).length
            strain = np.abs(_distance(paths[name, 1], paths[name, 0]) / length - 1.0)
            what = f"rigid body {name!r} has changed its length by"
            yield from _beyond(strain, STRAINED + rounding / length, what, "of itself", (name, 0))


def _distance(a: Array, b: Array) -> Array:
    with np.errstate(all="ignore"):
        return np.asarray(np.hypot(*(a - b).T))


def _turn(solution: Solution, end: End) -> NDArray[np.complex128] | None:
    """Turn of an end's axis since the reference, of size 1, (n,); None where the field does not tell."""
    field, body = solution.fields[end[0]], solution.scene.beam(end[0])
    if not isinstance(field, HermiteField):
        return None
    with np.errstate(all="ignore"):
        gradient = field.coordinates[:, -1 if end[1] else 0, 1] @ np.array([1.0, 1.0j])
        return np.asarray(gradient / np.abs(gradient) * np.exp(-1j * body.angle))


def _beyond(sizes: Array, allowed: float, what: str, unit: str, end: End) -> Iterator[Finding]:
    """The first size above what is allowed; what is no number is left to the check of divergence."""
    with np.errstate(invalid="ignore"):
        bad = sizes > allowed
    if bad.any():
        k = int(bad.argmax())
        yield Finding(k, "failed", f"{what} {sizes[k]:.2g} {unit} at {{when}}; {ADVICE}", end[0])


def _text(end: End) -> str:
    return f"'{end[0]}.{('start', 'end')[end[1]]}'"
