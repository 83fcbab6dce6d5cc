"""Signs that elements have diverged although their numbers are finite: gradients beyond all bounds, inverted elements.

The energy of these elements does not prevent that they turn inside out.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.shapes import hermite
from anctmm.results.checks.finding import Finding, part
from anctmm.results.fields import HermiteField, LagrangeField, cross
from anctmm.results.solution import Solution

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: A gradient longer than this is taken as divergence: no elastic beam stretches a thousandfold.
STRETCH_LIMIT = 1e3
#: Length of a gradient, which is 1 without strain, at which an axis has a cusp.
CUSP = 0.05


def inside_out(q: Array, length: float) -> Mask:
    """Whether elements of a length, m, are turned inside out, (…, nodes − 1), from q, (…, nodes, 2 or 3, dim).

    An element with an r_y is so where r_x × r_y ≤ 0 at a node or in its middle. An axis alone has no sides: it is so
    where it turns by more than half a circle within the element, so that it runs against its gradients at both ends, or
    where it has a cusp: a bar under an axial load that folds back on itself balances that, too.
    """
    chord, a, b = q[..., 1:, 0, :] - q[..., :-1, 0, :], q[..., :-1, 1, :], q[..., 1:, 1, :]
    along = np.array([(chord * a).sum(axis=-1), (chord * b).sum(axis=-1)])
    found: Mask = np.asarray((along < 0.0).all(axis=0))
    short = along.min(axis=0) < length / 3.0  # only such a chord leaves room for a cusp
    found[short] |= _has_cusp(chord[short] / length, a[short], b[short])
    if q.shape[-2] == 3:
        axis, across = 1.5 * chord / length - 0.25 * (a + b), 0.5 * (q[..., :-1, 2, :] + q[..., 1:, 2, :])
        sides, middle = cross(q[..., 1, :], q[..., 2, :]), cross(axis, across)
        found |= (sides[..., :-1] <= 0.0) | (sides[..., 1:] <= 0.0) | (middle <= 0.0)
    return found


def _has_cusp(chord: Array, a: Array, b: Array) -> Mask:
    """Whether the axis between gradients a and b, with a chord over its undeformed length, shrinks to a point."""
    weights = hermite(np.linspace(0.0, 1.0, 129), 1.0, 1)[:, 1:]
    slopes = np.einsum("pk,k...->p...", weights, np.array([a, chord, b]))
    return np.asarray(np.linalg.norm(slopes, axis=-1).min(axis=0) < CUSP)


def shape_findings(solution: Solution) -> Iterator[Finding]:
    """The first output of each body that is stretched beyond all bounds or turned inside out."""
    for name, field in solution.fields.items():
        if not isinstance(field, HermiteField | LagrangeField):
            continue
        wild, bad = _faults(field, solution.scene.beam(name).length)
        if bad.any():
            k = int(bad.any(axis=1).argmax())
            stretched = bool(wild[k].any())
            element = int((wild if stretched else bad)[k].argmax())
            element //= field.order if isinstance(field, LagrangeField) else 1
            where = part(name, element)
            message = f"{where} is turned inside out at {{when}}; a finer mesh, a smaller dt or smaller loads may help"
            if stretched:
                message = (
                    f"gradients grew beyond {STRETCH_LIMIT:g} by {{when}} in {where}; a smaller dt may help"
                )
            yield Finding(k, "diverged", message, name, element)


def _faults(field: HermiteField | LagrangeField, length: float) -> tuple[Mask, Mask]:
    """Elements, or spans between nodes, that are stretched, and those that are that or inside out, (outputs, spans)."""
    if isinstance(field, LagrangeField):
        spans = np.linalg.norm(np.diff(field.positions, axis=1), axis=2) * (field.positions.shape[1] - 1)
        wild = ~(spans / length <= STRETCH_LIMIT)  # or not a number
        return wild, wild
    q = field.coordinates
    nodes = ~np.asarray((np.abs(q[:, :, 1:]) <= STRETCH_LIMIT).all(axis=(2, 3)))
    wild = nodes[:, 1:] | nodes[:, :-1]
    vectors = 3 if field.sections else 2
    return wild, wild | inside_out(q[:, :, :vectors], field.length / (q.shape[1] - 1))
