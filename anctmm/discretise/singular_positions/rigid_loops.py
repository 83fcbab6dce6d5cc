"""Loops of rigid bodies in a singular position: taut between supports, or folded.

Equations of joints between rigid bodies, J u = 0 for motions u, may be dependent: λᵀJ = 0 with a state of self-stress
λ. If joints are redundant in every position (a third crank of a parallelogram, a welded frame), this does no harm. If
a motion that J allows separates the joints in second order, λ · J'(u, u) ≠ 0, the motion is impossible: the position
is singular, and accelerations computed there are wrong (second-order test of Connelly and Whiteley 1996, DOI
10.1137/S0895480192229236).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.singular_positions.dependence import PARTING, stress_of
from anctmm.errors import DiscretisationError, listed
from anctmm.model.bodies import Beam
from anctmm.model.places import End
from anctmm.model.scene import Scene
from anctmm.model.topology import Junction, Sets, junctions_of

Array = NDArray[np.float64]
#: Entries of a row of a matrix: (column, value).
Entries = list[tuple[int, float]]

#: The ground, among bodies (name, 0) and junctions ("", number).
GROUND = ("", -1)


class Row(NamedTuple):
    """Equations of a joint: one or two ends at a place, given by their arms (m), or bodies that turn alike (None).

    One is held, two are equal.
    """

    bodies: tuple[str, ...]
    arms: tuple[Array | None, ...]


def check_rigid_loops(scene: Scene, loops: Sequence[set[str]], names: Iterable[str]) -> None:
    """Refuse rigid bodies in a singular position.

    Parameters
    ----------
    scene : Scene
    loops : sequence of set of str
        Those of `rigid_loops`.
    names : iterable of str
        Of the rigid bodies.

    Raises
    ------
    DiscretisationError
        Naming the bodies.
    """
    if not loops:
        return
    rigid = set(names)
    rows = [row for junction in junctions_of(scene) for row in _rows(scene, junction, rigid)]
    for bodies in loops:
        _check(scene, bodies, [row for row in rows if row.bodies[0] in bodies])


def _rows(scene: Scene, junction: Junction, rigid: set[str]) -> Iterator[Row]:
    """Equations of the rigid ends of a junction; bodies that bend follow them."""
    ends = [end for end in junction.ends if end[0] in rigid]
    yield from _together(ends, [_arm(scene, end) for end in ends], junction.grounded)
    for group, clamp in zip(junction.groups, junction.clamps, strict=True):
        welded = [end for end in group if end[0] in rigid]
        yield from _together(welded, [None] * len(welded), clamp is not None)


def _together(ends: list[End], arms: list[Array | None], held: bool) -> Iterator[Row]:
    names = [name for name, _ in ends]
    if held:
        yield from (Row((name,), (arm,)) for name, arm in zip(names, arms, strict=True))
    else:
        for k in range(len(ends) - 1):
            yield Row(tuple(names[k : k + 2]), tuple(arms[k : k + 2]))


def _arm(scene: Scene, end: End) -> Array:
    """From the first place of a body to one of its places, m."""
    body = scene.body(end[0])
    first = body.start if isinstance(body, Beam) else body.position_at("center")
    return np.subtract(body.position_at(end[1]), first)  # type: ignore[arg-type]


def rigid_loops(junctions: Sequence[Junction], names: Iterable[str]) -> list[set[str]]:
    """Rigid bodies that hang together where they, maybe with the ground, close a loop.

    None where guides or driven hinges act: lines have equations of their own.
    """
    rigid = set(names)
    if not rigid or any(junction.guides or junction.hinges for junction in junctions):
        return []
    with_ground, alone = Sets[tuple[str, int]](), Sets[tuple[str, int]]()
    closing = []
    for j, junction in enumerate(junctions):
        names = [name for name, _ in junction.ends if name in rigid]
        for name in names:
            alone.unite(("", j), (name, 0))
            if not with_ground.unite(("", j), (name, 0)):
                closing.append(name)
        if names and junction.grounded and not with_ground.unite(("", j), GROUND):
            closing.append(names[0])
    marked = {alone.of((name, 0)) for name in closing}
    groups = alone.among((name, 0) for name in sorted(rigid))
    return [{name for name, _ in group} for group in groups if alone.of(group[0]) in marked]


def _check(scene: Scene, bodies: set[str], rows: list[Row]) -> None:
    """The second-order test of one loop, or of loops that are connected."""
    first = {body.name: 3 * k for k, body in enumerate(b for b in scene.bodies if b.name in bodies)}
    scale = max(scene.body(name).extent for name in bodies) or 1.0
    equations = [
        _equation(row, axis, first, scale)
        for row in rows
        for axis in (range(2) if row.arms[0] is not None else [2])
    ]
    sparse, curved = zip(*equations, strict=True)
    J, curvature = _matrix(sparse, 3 * len(first)), _matrix(curved, len(first))
    stress = stress_of(J, lambda motions: curvature @ motions[2::3] ** 2)
    if stress is None:
        return
    strained = (np.abs(stress) @ abs(J)).reshape(-1, 3).max(axis=1) > PARTING
    names = listed([name for name, hit in zip(first, strained, strict=True) if hit] or list(first))
    raise DiscretisationError(
        f"bodies {names} are rigid, and taut or folded between their joints: a motion that is free to first "
        f"order is blocked beyond it; start from another position, or make one of them flexible "
        f"('cable' or 'shear')"
    )


def _equation(row: Row, axis: int, first: Mapping[str, int], scale: float) -> tuple[Entries, Entries]:
    """Row of J for (x/scale, y/scale, φ) of every body, and its second derivatives by each φ."""
    linear: Entries = []
    curved: Entries = []
    for name, arm, sign in zip(row.bodies, row.arms, (1.0, -1.0), strict=False):
        at = first[name]
        if arm is None:
            linear.append((at + 2, sign))
        else:
            linear += [(at + axis, sign), (at + 2, sign * (-arm[1], arm[0])[axis] / scale)]
            curved.append((at // 3, -sign * arm[axis] / scale))
    return linear, curved


def _matrix(rows: Sequence[Entries], columns: int) -> "scipy.sparse.csr_array":
    """Rows of (column, value), those of one column summed up."""
    counts = [len(row) for row in rows]
    places, values = np.array([entry for row in rows for entry in row]).reshape(-1, 2).T
    at = (np.repeat(np.arange(len(rows)), counts), places.astype(int))
    return scipy.sparse.csr_array((values, at), shape=(len(rows), columns))
