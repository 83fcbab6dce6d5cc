"""Stiffness of loads and connectors: blocks within elements, and couplings of distant nodes.

The derivative of a moment, or of a connector within one element, is added to the matrix of that element when the
recursion eliminates it: `Local`. A connector between distant nodes has the matrix [C −C; −C C] for its two vectors,
where C has one or two directions. With

    [C −C; −C C] = 2 [C 0; 0 C] − [C; C] [C C]

its local part acts on both ends, so that the matrix of a mechanism which only connectors hold is not singular. The
rest is a sum of c u uᵀ, one for each direction: `Border`, solved by the formula of Sherman, Morrison and Woodbury. A
follower force has the unsymmetric matrix c u vᵀ. Newton's matrix therefore contains all forces, except the change of a
damper's direction.

Where connectors are many, their nodes are kept (`anctmm.discretise.junctions.couplings`), and −C is added to the matrix
of the kept unknowns (`anctmm.recursion.kept.coupled`); the local part is then C.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.maps import Map, rate_at, vector_at
from anctmm.forces.connectors import (
    SPRING,
    force_of,
    free_measure,
    measure,
    slopes,
    time_of,
    vectors_of,
)
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined
from anctmm.jit.copies import writes
from anctmm.model.connectors import Spring
from anctmm.model.scene import Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Terms c u vᵀ up to which all A⁻¹ u are kept: with more, another sweep takes less than the sum of them.
FEW = 16


@writes("blocks")
@by_address
class Local(NamedTuple):
    """Matrices within elements, for kernels.

    Parameters
    ----------
    nodes : ndarray of int, shape (sites,)
        The first node of each element, ascending.
    blocks : ndarray, shape (sites, 2 rows, 2 rows)
        Of that node and the next one.
    of_load : ndarray of int, shape (loads,)
        Site of each moment, or −1.
    of_connector : ndarray of int, shape (2, connectors)
        Sites of both vectors of each connector, or −1 of the ground.
    doubled : ndarray of bool, shape (connectors,)
        Whether the rest of its matrix is in `Border`.
    """

    nodes: Ints
    blocks: Array
    of_load: Ints
    of_connector: Ints
    doubled: NDArray[np.bool_]


@writes("left", "right", "c", "Y", "product", "S", "order", "z", "load")
@by_address
class Border(NamedTuple):
    """Σ c u vᵀ, for kernels.

    Parameters
    ----------
    start : ndarray of int, shape (m + 1,)
        Where the terms of each u and v begin.
    node, row : ndarray of int, shape (terms,)
        Components `row`, `row` + 1 of a node.
    a, b : ndarray, shape (terms,)
        Of the maps that they come from.
    left, right : ndarray, shape (terms, 2)
        u and v there.
    c : ndarray, shape (m,)
    of_load, of_connector, direction : ndarray of int, shape (m,)
        What each belongs to, or −1; 0 along a spring or of an angle, 1 across.
    split : ndarray of int, shape (m,)
        First of the terms that belong to the second vector.
    Y : ndarray, shape (m, rows, nodes)
        A⁻¹ u; of more than `FEW` room for one solution alone.
    product : ndarray, shape (m, m)
        vᵀ A⁻¹ u.
    S : ndarray, shape (m, m)
        1 + c vᵀ A⁻¹ u, factored.
    order : ndarray of int, shape (m,)
        Its exchanges of rows.
    z : ndarray, shape (m,)
        Scratch, as is load.
    load : ndarray, shape (rows, nodes)
    """

    start: Ints
    node: Ints
    row: Ints
    a: Array
    b: Array
    left: Array
    right: Array
    c: Array
    of_load: Ints
    of_connector: Ints
    direction: Ints
    split: Ints
    Y: Array
    product: Array
    S: Array
    order: Ints
    z: Array
    load: Array


@by_address
class Column(NamedTuple):
    """What one c u vᵀ belongs to: a load or a connector, or −1, a direction, and both vectors."""

    load: int
    connector: int
    direction: int
    first: Map
    second: Map


def stiffness_of(
    scene: Scene,
    bodies: Bodies,
    turning: Sequence[tuple[int, bool, Map, Map]],
    loads: int,
    coupled: Collection[int],
) -> tuple[Local, Border | None]:
    """Room for the stiffness of what acts.

    Parameters
    ----------
    scene : Scene
    bodies : Bodies
    turning : sequence of (int, bool, Map, Map)
        Loads whose force depends on coordinates: number, whether it follows its place, vectors that it acts on and
        turns with.
    loads : int
        Number of all loads.
    coupled : collection of int
        Connectors between kept nodes.
    """
    ends = [vectors_of(scene, bodies, connector) for connector in scene.connectors]
    moments = {n: target for n, follows, target, _ in turning if not follows}
    vectors = [*moments.values(), *(vector for pair in ends for vector in pair)]
    nodes = sorted({vector.site for vector in vectors if vector.terms})
    sites = {node: s for s, node in enumerate(nodes)}
    of_load = np.full(loads, -1, dtype=np.int64)
    for n, target in moments.items():
        of_load[n] = sites[target.site]
    of_connector = np.array([[sites.get(v.site, -1) for v in pair] for pair in ends], dtype=np.int64).reshape(
        -1, 2
    )
    blocks = np.zeros((len(nodes), 2 * bodies.rows, 2 * bodies.rows))
    doubled = [
        n not in coupled and bool(a.terms and b.terms) and a.site != b.site for n, (a, b) in enumerate(ends)
    ]
    local = Local(
        np.array(nodes, dtype=np.int64), blocks, of_load, of_connector.T.copy(), np.array(doubled, dtype=bool)
    )
    columns = [Column(n, -1, 0, target, direction) for n, follows, target, direction in turning if follows]
    for n, (connector, (a, b)) in enumerate(zip(scene.connectors, ends, strict=True)):
        if doubled[n]:
            columns += [Column(-1, n, k, a, b) for k in range(2 if isinstance(connector, Spring) else 1)]
    return local, _border(columns, bodies)


def _border(columns: Sequence[Column], bodies: Bodies) -> Border | None:
    if not columns:
        return None
    m = len(columns)
    terms = [term for column in columns for term in (*column.first.terms, *column.second.terms)]
    counts = [len(column.first.terms) + len(column.second.terms) for column in columns]
    start = np.cumsum([0, *counts]).astype(np.int64)
    of_load, of_connector, direction = np.array([column[:3] for column in columns], dtype=np.int64).T.copy()
    return Border(
        start,
        np.array([term.node for term in terms], dtype=np.int64),
        np.array([term.row for term in terms], dtype=np.int64),
        np.array([term.a for term in terms]),
        np.array([term.b for term in terms]),
        np.zeros((len(terms), 2)),
        np.zeros((len(terms), 2)),
        np.zeros(m),
        of_load,
        of_connector,
        direction,
        start[:-1] + np.array([len(column.first.terms) for column in columns], dtype=np.int64),
        np.zeros((m if m <= FEW else 1, bodies.rows, bodies.nodes)),
        np.zeros((m, m)),
        np.zeros((m, m)),
        np.zeros(m, dtype=np.int64),
        np.zeros(m),
        np.zeros((bodies.rows, bodies.nodes)),
    )


@embedded
def add_block(block, node, one, n, two, m, xx, xy, yx, yy):  # type: ignore[no-untyped-def]
    """Add to the matrix of a node and the next one that of vectors n of `one` and m of `two`, coupled by a 2 × 2."""
    rows = block.shape[0] // 2
    for j in range(one.start[n], one.start[n + 1]):
        k = (one.node[j] - node) * rows + one.row[j]
        a, b = one.a[j], one.b[j]
        px, py, rx, ry = a * xx + b * yx, a * xy + b * yy, a * yx - b * xx, a * yy - b * xy
        for i in range(two.start[m], two.start[m + 1]):
            at = (two.node[i] - node) * rows + two.row[i]
            c, d = two.a[i], two.b[i]
            block[k, at] += px * c + py * d
            block[k, at + 1] += py * c - px * d
            block[k + 1, at] += rx * c + ry * d
            block[k + 1, at + 1] += ry * c - rx * d


@embedded
def turned(x, y):  # type: ignore[no-untyped-def]
    """Second derivatives xx and xy of the angle of (x, y); yy is −xx."""
    s = x * x + y * y
    return 2.0 * x * y / (s * s), (y * y - x * x) / (s * s)


@embedded
def fill_local(q, stiffness, loads, values):  # type: ignore[no-untyped-def]
    """Matrices within elements at coordinates q, times `stiffness`."""
    local = loads.local
    if len(local.nodes) > 0:
        local.blocks[:] = 0.0
        for n in range(len(loads.kinds)):
            s = local.of_load[n]
            if s >= 0:
                x, y = vector_at(loads.targets, n, q)
                xx, xy = turned(x, y)
                m = -stiffness * values[n, 0]
                add_block(
                    local.blocks[s],
                    local.nodes[s],
                    loads.targets,
                    n,
                    loads.targets,
                    n,
                    m * xx,
                    m * xy,
                    m * xy,
                    -m * xx,
                )
        _fill_connectors(loads.connectors, q, stiffness, local, values)


@embedded
def _fill_connectors(connectors, q, stiffness, local, values):  # type: ignore[no-untyped-def]
    if connectors is not None:
        one, two = connectors.first, connectors.second
        for n in range(len(connectors.kinds)):
            first, second = local.of_connector[0, n], local.of_connector[1, n]
            ax, ay, bx, by, force, k, across = tangent_of(connectors, n, q, stiffness, values)
            if local.doubled[n]:  # of what is positive, twice at either end
                k, across = 2.0 * max(k, 0.0), 2.0 * max(across, 0.0)
            hxx, hxy, hyy, gxx, gxy, gyy = _second(connectors, n, q, bx, by, force, across)
            if first >= 0:
                add_block(
                    local.blocks[first], local.nodes[first], one, n, one, n,
                    k * ax * ax + hxx, k * ax * ay + hxy, k * ax * ay + hxy, k * ay * ay + hyy,
                )  # fmt: skip
            if second >= 0:
                add_block(
                    local.blocks[second], local.nodes[second], two, n, two, n,
                    k * bx * bx + gxx, k * bx * by + gxy, k * bx * by + gxy, k * by * by + gyy,
                )  # fmt: skip
            if first >= 0 and first == second:
                B, i = local.blocks[first], local.nodes[first]
                cxx, cxy, cyx, cyy = _mixed(connectors, n, ax, ay, bx, by, k, across)
                add_block(B, i, one, n, two, n, cxx, cxy, cyx, cyy)
                add_block(B, i, two, n, one, n, cxx, cyx, cxy, cyy)


@inlined
def _mixed(connectors, n, ax, ay, bx, by, k, across):  # type: ignore[no-untyped-def]
    """Second derivatives of the energy by a and b, xx, xy, yx and yy: of two angles the measure's have no such part."""
    xx, xy, yx, yy = k * ax * bx, k * ax * by, k * ay * bx, k * ay * by
    if connectors.kinds[n] == SPRING:
        xx, xy, yx, yy = (
            xx - across * by * by,
            xy + across * bx * by,
            yx + across * bx * by,
            yy - across * bx * bx,
        )
    return xx, xy, yx, yy


@embedded
def mixed_at(connectors, n, q, stiffness, values):  # type: ignore[no-untyped-def]
    """The same at coordinates q, times `stiffness`, with damping as in `tangent_of`."""
    ax, ay, bx, by, _, k, across = tangent_of(connectors, n, q, stiffness, values)
    return _mixed(connectors, n, ax, ay, bx, by, k, across)


@embedded
def tangent_of(connectors, n, q, stiffness, values):  # type: ignore[no-untyped-def]
    """Gradients of the measure by a and b, force, stiffness along it, and that across a spring: force over length."""
    m, ax, ay, bx, by = measure(connectors, n, q)
    ux, uy = rate_at(connectors.first, n, connectors.v)
    wx, wy = rate_at(connectors.second, n, connectors.v)
    free, free_rate = free_measure(connectors, n, values)
    x, rate, t = m - free, ax * ux + ay * uy + bx * wx + by * wy - free_rate, time_of(values)
    k, d = slopes(connectors, n, x, rate, t)
    force = stiffness * force_of(connectors, n, x, rate, t)
    across = force / max(m, 1e-300) if connectors.kinds[n] == SPRING else 0.0
    connectors.tangent[n] = stiffness * (k + connectors.part[1] * d)
    return ax, ay, bx, by, force, connectors.tangent[n], across


@embedded
def _second(connectors, n, q, bx, by, force, across):  # type: ignore[no-untyped-def]
    """Second derivatives of the measure times the force, by a and by b: xx, xy and yy of each."""
    if connectors.kinds[n] == SPRING:
        xx, xy, yy = across * by * by, -across * bx * by, across * bx * bx
        return xx, xy, yy, xx, xy, yy
    x, y = vector_at(connectors.first, n, q)
    axx, axy = turned(x, y)
    x, y = vector_at(connectors.second, n, q)
    bxx, bxy = turned(x, y)
    return -force * axx, -force * axy, force * axx, force * bxx, force * bxy, -force * bxx


@embedded
def fill_border(border, q, stiffness, loads, values):  # type: ignore[no-untyped-def]
    """c, u and v at coordinates q, times `stiffness`."""
    for j in range(len(border.c)):
        if border.of_load[j] >= 0:
            _fill_follower(border, j, q, stiffness, loads, values)
        else:
            _fill_coupling(border, j, q, stiffness, loads.connectors, values)


@embedded
def _fill_follower(border, j, q, stiffness, loads, values):  # type: ignore[no-untyped-def]
    """The force turns by 90° for each radian: minus its derivative is −F⊥ ⊗ ∂θ."""
    n = border.of_load[j]
    fx, fy = follower_at(loads, n, q, values[n, 0], values[n, 1])
    x, y = vector_at(loads.directions, n, q)
    s = x * x + y * y
    border.c[j] = -stiffness
    _spread(border, j, -fy, fx, 0.0, 0.0, border.left)
    _spread(border, j, 0.0, 0.0, -y / s, x / s, border.right)


@embedded
def _fill_coupling(border, j, q, stiffness, connectors, values):  # type: ignore[no-untyped-def]
    if connectors is not None:
        ax, ay, bx, by, _, c, across = tangent_of(connectors, border.of_connector[j], q, stiffness, values)
        if border.direction[j] == 1:
            c, ax, ay, bx, by = across, by, -bx, -by, bx
        sign = -1.0 if c > 0.0 else 1.0
        border.c[j] = sign * c
        _spread(border, j, ax, ay, sign * bx, sign * by, border.left)
        _spread(border, j, ax, ay, sign * bx, sign * by, border.right)


@embedded
def _spread(border, j, ax, ay, bx, by, out):  # type: ignore[no-untyped-def]
    """Generalized forces of (ax, ay) on the first vector and of (bx, by) on the second."""
    for k in range(border.start[j], border.start[j + 1]):
        x, y = (ax, ay) if k < border.split[j] else (bx, by)
        out[k, 0] = border.a[k] * x + border.b[k] * y
        out[k, 1] = border.a[k] * y - border.b[k] * x


@embedded
def follower_at(loads, n, q, x, y):  # type: ignore[no-untyped-def]
    """A force (x, y) of the reference, turned as its direction has."""
    gx, gy = vector_at(loads.directions, n, q)
    r = np.sqrt(gx * gx + gy * gy)
    c = (gx * loads.rest[n, 0] + gy * loads.rest[n, 1]) / r
    s = (gy * loads.rest[n, 0] - gx * loads.rest[n, 1]) / r
    return c * x - s * y, s * x + c * y
