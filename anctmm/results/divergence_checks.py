"""What no run of a scene may show, found in a finished history: its status says what, where and when.

Signs that a run has diverged though its numbers are finite: a gradient beyond all bounds, an element turned inside out
(no energy of these elements forbids that), nearly all energy from nowhere. Signs that it has failed: joints or rigid
bodies that are not kept. There the history is cut. One that stays whole may be inaccurate (too much energy came
from nowhere, or a load or a drive acted between the steps) or imprecise (rounding has taken its digits). All are
looked for after the run, at the outputs: a step costs nothing.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anctmm.results.break_check import break_findings
from anctmm.results.constraint_check import constraint_findings
from anctmm.results.energy_check import energy_findings
from anctmm.results.fields import HermiteField, LagrangeField
from anctmm.results.finding import FATAL, Finding
from anctmm.results.precision_check import precision_findings
from anctmm.results.solution import Solution, Status

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: A gradient longer than this is taken as divergence: no elastic beam stretches a thousandfold.
STRETCH_LIMIT = 1e3
#: Elements times outputs that are looked at together: a bound of the memory this takes.
BATCH = 100_000


def inside_out(q: Array, length: float) -> Mask:
    """Whether elements are turned inside out.

    An element with an r_y is so where r_x × r_y ≤ 0 at a node or in its middle. An axis alone has no sides: it is so
    where it turns by more than half a circle within the element, so that it runs against its gradients at both ends.

    Parameters
    ----------
    q : ndarray, shape (n, nodes, 2 or 3, 2)
        r, r_x and r_y of each node.
    length : float
        Of an undeformed element, m.

    Returns
    -------
    ndarray of bool, shape (n, nodes − 1)
    """
    chord = np.diff(q[:, :, 0], axis=1)
    a, b = q[:, :-1, 1], q[:, 1:, 1]
    found = (_dot(a, chord) < 0.0) & (_dot(b, chord) < 0.0)
    if q.shape[2] == 3:
        sides = _cross(q[:, :, 1], q[:, :, 2])
        middle = _cross(1.5 * chord / length - 0.25 * (a + b), 0.5 * (q[:, :-1, 2] + q[:, 1:, 2]))
        found |= (sides[:, :-1] <= 0.0) | (sides[:, 1:] <= 0.0) | (middle <= 0.0)
    return found  # type: ignore[no-any-return]


def out_of_bounds(q: Array) -> Mask:
    """Whether a gradient at either node of an element, (n, nodes − 1), is too long or not a number."""
    with np.errstate(invalid="ignore"):
        bad = ~(np.abs(q[:, :, 1:]).max(axis=(2, 3)) <= STRETCH_LIMIT)
    return bad[:, :-1] | bad[:, 1:]  # type: ignore[no-any-return]


def checked(solution: Solution, *, static: bool = False, energies: bool = True) -> Solution:
    """The solution as far as nothing speaks against it, its status saying what does.

    Parameters
    ----------
    solution : Solution
        Of any solver.
    static : bool
        Whether its times are load factors.
    energies : bool
        Whether energies are exact enough to tell whether a run has made some.

    Returns
    -------
    Solution
        The same; or a shorter one, cut before the first output that no run of the scene could have, with the status
        "diverged" or "failed"; or a whole one with the status "inaccurate" or "imprecise".
    """
    explicit = not static and solution.run is not None and solution.run.explicit
    if explicit and not solution.status.ok:  # an unstable step shows in all checks; its solver knows it best
        return solution
    with np.errstate(all="ignore"):  # of a run that has diverged, numbers may be too large for any formula
        found = [*_shape_findings(solution), *constraint_findings(solution, static=static)]
        if not static and solution.status.ok and solution.t.size:
            found += break_findings(solution)
        if energies and not static and solution.status.ok:  # else the solver knows better what has failed
            found += energy_findings(solution)
        if not static and solution.status.ok and not found:
            found += precision_findings(solution)
    fatal = [finding for finding in found if finding.code in FATAL]
    if not found:
        return solution
    first = min(fatal or found, key=lambda finding: finding.output)
    status = _status(solution, first, static)
    return solution.until(first.output, status) if fatal else replace(solution, status=status)


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
    for name, field in solution.fields.items():
        match field:
            case HermiteField():
                yield from _shapes_of_hermite(name, field)
            case LagrangeField():
                yield from _shapes_of_lagrange(name, field, solution.scene.beam(name).length)


def _shapes_of_hermite(name: str, field: HermiteField) -> Iterator[Finding]:
    q, size = field.coordinates, max(1, BATCH // field.coordinates.shape[1])
    for first in range(0, len(q), size):
        part = q[first : first + size]
        wild = out_of_bounds(part)
        with np.errstate(invalid="ignore", over="ignore"):
            bad = wild | inside_out(part, field.length / (q.shape[1] - 1))
        if bad.any():
            k = int(bad.any(axis=1).argmax())
            stretched = bool(wild[k].any())
            element = int((wild if stretched else bad)[k].argmax())
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
            f"gradients grew beyond {STRETCH_LIMIT:g} by {{when}} in element {element} of body {body!r}; "
            f"a smaller dt or smaller loads may do"
        )
    return (
        f"element {element} of body {body!r} is turned inside out at {{when}}; "
        f"a finer mesh, a smaller dt or smaller loads may do"
    )


def _dot(a: Array, b: Array) -> Array:
    return (a * b).sum(axis=-1)  # type: ignore[no-any-return]


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]  # type: ignore[no-any-return]
