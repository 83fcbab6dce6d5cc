"""Checks of a finished history that determine its status: what is wrong, where and when.

Signs that a run has diverged although its numbers are finite: a gradient beyond all bounds, an inverted element (the
energy of these elements does not prevent that), nearly all energy created by numerical error. Signs that it has failed:
violated joints or rigid bodies. The history then ends there. A complete history may be inaccurate (too much energy was
created, or a load or a drive changed between the steps) or imprecise (too few digits are left). All checks run after
the steps, at the outputs, so that steps cost nothing.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.results.checks.breaks import break_findings
from anctmm.results.checks.constraints import constraint_findings
from anctmm.results.checks.drives import drive_findings, with_drives
from anctmm.results.checks.energy import energy_findings
from anctmm.results.checks.finding import FATAL, Finding, part
from anctmm.results.checks.places import places_of
from anctmm.results.checks.precision import precision_findings
from anctmm.results.checks.space import space_findings
from anctmm.results.fields import HermiteField, LagrangeField
from anctmm.results.solution import Solution
from anctmm.results.status import Status

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]

#: A gradient longer than this is taken as divergence: no elastic beam stretches a thousandfold.
STRETCH_LIMIT = 1e3
#: Part of an element's length, along its gradient at an end, below which its chord makes one look along its axis; the
#: places looked at; and the length of a gradient there at which an axis has a cusp: it is a part of a right one's 1.
SHORTENED, PLACES, CUSP = 1.0 / 3.0, 129, 0.05
#: Elements times outputs that are looked at together: what this takes stays in the cache.
BATCH = 20_000


def inside_out(q: Array, length: float | Array) -> Mask:
    """Whether elements are turned inside out.

    An element with an r_y is so where r_x × r_y ≤ 0 at a node or in its middle. An axis alone has no sides: it is so
    where it turns by more than half a circle within the element, so that it runs against its gradients at both ends, or
    where it has a cusp: a bar under an axial load that folds back on itself balances that, too.

    Parameters
    ----------
    q : ndarray, shape (…, nodes, 2 or 3, 2)
        r, r_x and maybe r_y of each node.
    length : float or ndarray
        Of an undeformed element, m.

    Returns
    -------
    ndarray of bool, shape (…, nodes − 1)
    """
    z = np.ascontiguousarray(q).view(np.complex128)[..., 0]  # conj(a) b = a · b + i a × b
    chord, a, b = z[..., 1:, 0] - z[..., :-1, 0], z[..., :-1, 1], z[..., 1:, 1]
    back = np.conj(chord)
    found = (back * a).real < 0.0
    if np.count_nonzero(found):  # as nearly never; quicker than any() where arrays are small
        found &= (back * b).real < 0.0
    short = np.minimum((back * a).real, (back * b).real) < SHORTENED * length
    if np.count_nonzero(short):
        found |= short & _has_cusp(chord / length, a, b)
    if q.shape[-2] == 3:
        sides = (np.conj(z[..., 1]) * z[..., 2]).imag
        axis, across = 1.5 * chord / length - 0.25 * (a + b), 0.5 * (z[..., :-1, 2] + z[..., 1:, 2])
        middle = (np.conj(axis) * across).imag
        found |= (sides[..., :-1] <= 0.0) | (sides[..., 1:] <= 0.0) | (middle <= 0.0)
    return found  # type: ignore[no-any-return]


def _has_cusp(chord: Complex, a: Complex, b: Complex) -> Mask:
    """Whether the axis between gradients a and b, with a chord over its undeformed length, shrinks to a point."""
    least = np.full(chord.shape, np.inf)
    for x in np.linspace(0.0, 1.0, PLACES):
        slope = 6.0 * x * (1.0 - x) * chord + (1.0 - x) * (1.0 - 3.0 * x) * a + x * (3.0 * x - 2.0) * b
        least = np.minimum(least, np.abs(slope))
    return least < CUSP  # type: ignore[no-any-return]


def out_of_bounds(q: Array) -> Mask:
    """Whether a gradient at either node of an element, (…, nodes − 1), is too long or not a number."""
    bad = ~(np.abs(q[..., 1:, :]) <= STRETCH_LIMIT)
    nodes = np.asarray(bad.any(axis=(-2, -1)))
    return nodes[..., :-1] | nodes[..., 1:]  # type: ignore[no-any-return]


def checked(
    solution: Solution, *, static: bool = False, energies: bool = True, rests: bool = False
) -> Solution:
    """The solution as far as nothing speaks against it, its status saying what does.

    Parameters
    ----------
    solution : Solution
        Of any solver.
    static : bool
        Whether its times are load factors.
    energies : bool
        Whether energies are exact enough to tell whether a run has made some.
    rests : bool
        Whether the scene begins in a stable equilibrium and so does not move.

    Returns
    -------
    Solution
        The same; or a shorter one, cut before the first output that no run of the scene could have, with the status
        "diverged" or "failed"; or a whole one with the status "inaccurate" or "imprecise".
    """
    found = _checked(solution, static, energies, rests)
    return found if static else with_drives(found)


def _checked(solution: Solution, static: bool, energies: bool, rests: bool) -> Solution:
    explicit = not static and solution.run is not None and solution.run.explicit
    if explicit and not solution.status.ok:  # an unstable step shows in all checks; its solver knows it best
        return solution
    with np.errstate(all="ignore"):  # of a run that has diverged, numbers may be too large for any formula
        if solution.scene.dim == 3:
            found = list(space_findings(solution, static))
        else:
            found = _planar_findings(solution, static, energies, rests)
    fatal = [finding for finding in found if finding.code in FATAL]
    if not found:
        return solution
    first = min(fatal or found, key=lambda finding: finding.output)
    status = _status(solution, first, static)
    return solution.until(first.output, status) if fatal else replace(solution, status=status)


def _planar_findings(solution: Solution, static: bool, energies: bool, rests: bool) -> list[Finding]:
    """What speaks against a run in the plane."""
    places = places_of(solution)
    parted = () if places is None else constraint_findings(solution, places, static=static)
    found = [*_shape_findings(solution), *parted]
    if not static and solution.status.ok and solution.t.size:
        found += [*break_findings(solution), *drive_findings(solution)]
    if energies and not static and solution.status.ok:  # else the solver knows better what has failed
        found += energy_findings(solution)
    if not static and solution.status.ok and not found:
        found += precision_findings(solution, places, rests)
    return found


def _status(solution: Solution, finding: Finding, static: bool) -> Status:
    run, when = solution.run, float(solution.t[finding.output])
    step = (
        None if static or run is None or run.tolerance is not None else int(run.output_steps[finding.output])
    )
    said = f"load factor {when:.6g}" if static else f"t = {when:.6g} s"
    return Status(
        finding.code, finding.message.replace("{when}", said), when, step, finding.body, finding.element
    )


def _shape_findings(solution: Solution) -> Iterator[Finding]:
    """The first output of each body that is stretched beyond all bounds or turned inside out."""
    alike: dict[tuple[Any, ...], dict[str, HermiteField]] = {}
    for name, field in solution.fields.items():
        match field:
            case HermiteField():
                alike.setdefault((field.sections, *field.coordinates.shape), {})[name] = field
            case LagrangeField():
                yield from _shapes_of_lagrange(name, field, solution.scene.beam(name).length)
    for fields in alike.values():
        yield from _shapes_of_hermite(fields)


def _shapes_of_hermite(fields: Mapping[str, HermiteField]) -> Iterator[Finding]:
    """The same of bodies with as many nodes each, as far as the first outputs that show anything."""
    names, paths = list(fields), [field.coordinates for field in fields.values()]
    vectors = 3 if fields[names[0]].sections else 2
    outputs, nodes = paths[0].shape[:2]
    lengths = np.array([[[field.length / (nodes - 1)]] for field in fields.values()])
    size = max(1, BATCH // (nodes * len(names)))
    for first in range(0, outputs, size):
        q = np.array([path[first : first + size] for path in paths])
        bad = inside_out(q[..., :vectors, :], lengths)
        if np.count_nonzero(bad) or not np.abs(q[..., 1:, :]).max() <= STRETCH_LIMIT:  # or not a number
            wild = out_of_bounds(q)
            bad |= wild
            for body in np.flatnonzero(bad.any(axis=(1, 2))):
                k = int(bad[body].any(axis=1).argmax())
                stretched = bool(wild[body, k].any())
                element = int((wild if stretched else bad)[body, k].argmax())
                name = names[body]
                yield Finding(first + k, "diverged", _message(stretched, name, element), name, element)
            return


def _shapes_of_lagrange(name: str, field: LagrangeField, length: float) -> Iterator[Finding]:
    spans = field.positions.shape[1] - 1
    with np.errstate(all="ignore"):
        wild = ~(
            np.hypot(*np.moveaxis(np.diff(field.positions, axis=1), 2, 0)) * spans / length <= STRETCH_LIMIT
        )
    if wild.any():
        k = int(wild.any(axis=1).argmax())
        element = int(wild[k].argmax()) // field.order
        yield Finding(k, "diverged", _message(True, name, element), name, element)


def _message(wild: bool, body: str, element: int) -> str:
    if wild:
        return (
            f"gradients grew beyond {STRETCH_LIMIT:g} by {{when}} in {part(body, element)}; "
            f"a smaller dt or smaller loads may help"
        )
    return (
        f"{part(body, element)} is turned inside out at {{when}}; "
        f"a finer mesh, a smaller dt or smaller loads may help"
    )
