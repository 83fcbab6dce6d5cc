"""Accelerations of a chain: elastic forces, a forward and a backward Riccati sweep with the mass factored once.

`accelerations_split` is the fast form, for chains without angled welds; `accelerations_block` serves any chain.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.assembly import SHEAR, elastic_forces
from anctmm.compiling import kernel
from anctmm.elements import cable_kernel, shear_kernel
from anctmm.elements.shear_kernel import BLOCK
from anctmm.riccati import sweep

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel
def accelerations_split(
    q: Array,
    f: Array,
    first: Ints,
    kinds: Ints,
    constants: Array,
    masses: Array,
    hub_of: Ints,
    hub_acceleration: Array,
    L: Array,
    G: Array,
    buffer: Array,
    a: Array,
) -> None:
    """Accelerations of a chain without angled welds.

    Parameters
    ----------
    q, f : ndarray, shape (rows, nodes)
        Coordinates and the external forces on them.
    first, kinds, constants, masses
        Of `Bodies`.
    hub_of : ndarray of int, shape (2, bodies)
        Hub at each body's first and last node, or −1.
    hub_acceleration : ndarray, shape (hubs, rows)
    L, G : ndarray
        Of `Split`.
    buffer : ndarray
        Of `Bodies`.
    a : ndarray, shape (rows, nodes)
        Written; on the way it holds the loads that have arrived at each node.
    """
    _forward(q, f, first, kinds, constants, masses, hub_of, hub_acceleration, L, buffer, a)
    rx = ry = gx = gy = dx = dy = 0.0
    director = q.shape[0] == 6
    for b in range(len(kinds) - 1, -1, -1):
        for i in range(first[b + 1] - 1, first[b] - 1, -1):
            a0, a1, a2, a3 = a[0, i], a[1, i], a[2, i], a[3, i]
            rr, rg, gr, gg = L[0, i], L[1, i], L[2, i], L[3, i]
            nrx = G[0, i] * a0 + G[1, i] * a2 - (rr * rx + gr * gx)
            nry = G[0, i] * a1 + G[1, i] * a3 - (rr * ry + gr * gy)
            ngx = G[1, i] * a0 + G[2, i] * a2 - (rg * rx + gg * gx)
            ngy = G[1, i] * a1 + G[2, i] * a3 - (rg * ry + gg * gy)
            rx, ry, gx, gy = nrx, nry, ngx, ngy
            if director:
                dx = G[3, i] * a[4, i] - L[4, i] * dx
                dy = G[3, i] * a[5, i] - L[4, i] * dy
                a[4, i], a[5, i] = dx, dy
            a[0, i], a[1, i], a[2, i], a[3, i] = rx, ry, gx, gy
            hub = hub_of[1, b] if i == first[b + 1] - 1 else hub_of[0, b] if i == first[b] else -1
            if hub >= 0:
                for k in range(q.shape[0]):
                    a[k, i] = hub_acceleration[hub, k]
                rx, ry, gx, gy = a[0, i], a[1, i], a[2, i], a[3, i]
                if director:
                    dx, dy = a[4, i], a[5, i]


@kernel
def _forward(
    q: Array,
    f: Array,
    first: Ints,
    kinds: Ints,
    constants: Array,
    masses: Array,
    hub_of: Ints,
    hub_acceleration: Array,
    L: Array,
    buffer: Array,
    a: Array,
) -> None:
    """Elastic forces and forward sweep, block by block: a ← loads arrived at each node."""
    rx = ry = gx = gy = dx = dy = 0.0  # transmitted from inboard
    for b in range(len(kinds)):
        orx = ory = ogx = ogy = odx = ody = 0.0  # of the element before on its node O
        last = first[b + 1] - 1
        director = kinds[b] == SHEAR
        for start in range(first[b], last, BLOCK):
            count = min(BLOCK, last - start)
            if director:
                shear_kernel.forces(q, start, count, constants[b], buffer)
            else:
                cable_kernel.forces(q, start, count, constants[b], buffer)
            if start == first[b] and hub_of[0, b] >= 0:
                for k in range(q.shape[0]):
                    for n in range(k % 2, q.shape[0], 2):  # inertia that the hub's motion puts on node O
                        m = masses[b, 3 + k // 2, n // 2]
                        buffer[(6 + k) * BLOCK] += m * hub_acceleration[hub_of[0, b], n]
            for j in range(count):
                i = start + j
                rx += f[0, i] - (buffer[j] + orx)
                ry += f[1, i] - (buffer[BLOCK + j] + ory)
                gx += f[2, i] - (buffer[2 * BLOCK + j] + ogx)
                gy += f[3, i] - (buffer[3 * BLOCK + j] + ogy)
                a[0, i], a[1, i], a[2, i], a[3, i] = rx, ry, gx, gy
                rr, rg, gr, gg = L[0, i], L[1, i], L[2, i], L[3, i]
                rx, gx = -(rr * rx + rg * gx), -(gr * rx + gg * gx)
                ry, gy = -(rr * ry + rg * gy), -(gr * ry + gg * gy)
                orx, ory = buffer[6 * BLOCK + j], buffer[7 * BLOCK + j]
                ogx, ogy = buffer[8 * BLOCK + j], buffer[9 * BLOCK + j]
                if director:
                    dx += f[4, i] - (buffer[4 * BLOCK + j] + odx)
                    dy += f[5, i] - (buffer[5 * BLOCK + j] + ody)
                    a[4, i], a[5, i] = dx, dy
                    dx, dy = -L[4, i] * dx, -L[4, i] * dy
                    odx, ody = buffer[10 * BLOCK + j], buffer[11 * BLOCK + j]
        rx, ry = rx + f[0, last] - orx, ry + f[1, last] - ory
        gx, gy = gx + f[2, last] - ogx, gy + f[3, last] - ogy
        a[0, last], a[1, last], a[2, last], a[3, last] = rx, ry, gx, gy
        rr, rg, gr, gg = L[0, last], L[1, last], L[2, last], L[3, last]
        rx, gx = -(rr * rx + rg * gx), -(gr * rx + gg * gx)
        ry, gy = -(rr * ry + rg * gy), -(gr * ry + gg * gy)
        if director:
            dx, dy = dx + f[4, last] - odx, dy + f[5, last] - ody
            a[4, last], a[5, last] = dx, dy
            dx, dy = -L[4, last] * dx, -L[4, last] * dy
        elif q.shape[0] == 6:
            for k in range(4, 6):
                for i in range(first[b], last + 1):
                    a[k, i] = 0.0


@kernel
def accelerations_block(
    unit: tuple[int, ...],
    q: Array,
    f: Array,
    first: Ints,
    elements: Ints,
    kinds: Ints,
    constants: Array,
    masses: Array,
    hub_nodes: Ints,
    hub_of: Ints,
    hub_acceleration: Array,
    L: Array,
    G: Array,
    buffer: Array,
    load: Array,
    a: Array,
) -> None:
    """Accelerations of any chain by full blocks; `load`, (rows, nodes), is scratch."""
    elastic_forces(q, first, elements, kinds, constants, buffer, load)
    rows = q.shape[0]
    for k in range(rows):
        for i in range(q.shape[1]):
            load[k, i] = f[k, i] - load[k, i]
    for b in range(len(kinds)):
        for side in range(2):
            if hub_of[side, b] >= 0:  # inertia that the hub's motion puts on the element's other node
                other = first[b] + 1 if side == 0 else first[b + 1] - 2
                for k in range(rows):
                    for n in range(k % 2, rows, 2):
                        m = masses[b, 3 * (1 - side) + k // 2, 3 * side + n // 2]
                        load[k, other] -= m * hub_acceleration[hub_of[side, b], n]
    sweep(unit, L, G, load, a)
    for h in range(len(hub_nodes)):
        for k in range(rows):
            a[k, hub_nodes[h]] = hub_acceleration[h, k]
