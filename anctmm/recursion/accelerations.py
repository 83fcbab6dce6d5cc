"""Accelerations of a scene: elastic forces, a forward and a backward Riccati sweep with the mass factored once.

`by_scalars` is the fast form, for trees without angled welds, loops of pinned beams and few kept unknowns; `by_blocks`
serves any scene.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables, elastic_forces
from anctmm.elements.dispatch import element_forces
from anctmm.elements.force_blocks import BLOCK
from anctmm.forces.actuation import DrivenClamps, clamp_reactions
from anctmm.jit.compiling import inlined, separate
from anctmm.recursion.kept.motions import add_kept, find_kept
from anctmm.recursion.kept.places import (
    clear_places,
    enter_body,
    find_places,
    leave_body,
    pass_start,
    take_start,
)
from anctmm.recursion.lines import add_guide_forces, keep_on_lines
from anctmm.recursion.riccati import BlockFactors, sweep

Array = NDArray[np.float64]


@inlined
def by_scalars(tables, clamps, factors, q, f, a):  # type: ignore[no-untyped-def]
    """Accelerations of a chain of scalar blocks (`Chain.split`), and the reactions of its driven clamps.

    Parameters
    ----------
    tables : Tables
    clamps : DrivenClamps
        Their reactions are written.
    factors : SplitFactors
    q, f : ndarray, shape (rows, nodes)
        Coordinates and the external forces on them.
    a : ndarray, shape (rows, nodes)
        Written.
    """
    lines, kept = factors.lines, factors.kept
    _forward(tables, clamps, factors, q, f, a)
    find_kept(kept, a)
    find_places(factors.places)
    add_guide_forces(lines, clamps.of, clamps.motion, a)
    _backward(tables, clamps, factors, a)
    add_kept(kept, clamps.of, clamps.reaction, a)
    keep_on_lines(lines, a)


@inlined
def _forward(tables, clamps, factors, q, f, a):  # type: ignore[no-untyped-def]
    """Elastic forces and forward sweep, block by block: a ← loads that have arrived at each node.

    A carry c comes from inboard; b = t + c arrives, −L b goes on. L t is found before c is known, so that only one
    product stands between a node and the next.
    """
    first, formulations, kinds, constants, masses, buffer = tables
    of, motion, L, kept = clamps.of, clamps.motion, factors.L, factors.places
    director = q.shape[0] == 6
    at, to, take, _, waiting, _ = factors.branches
    place = 0
    rx = ry = gx = gy = dx = dy = sx = sy = 0.0
    clear_places(kept)
    for b in range(len(kinds)):
        orx = ory = ogx = ogy = odx = ody = 0.0  # of the element before on its node O
        last = first[b + 1] - 1
        if at[place] == first[b]:
            if to[place] >= 0:
                c = waiting[to[place]]
                c[0], c[1], c[2], c[3] = c[0] + rx, c[1] + ry, c[2] + gx, c[3] + gy
                rx = ry = gx = gy = 0.0
                if director:
                    c[4], c[5] = c[4] + dx, c[5] + dy
                    dx = dy = 0.0
            place += 1
            if take[place - 1] >= 0:
                rx, ry, gx, gy, dx, dy = _taken(director, waiting[take[place - 1]], rx, ry, gx, gy, dx, dy)
        for start in range(first[b], last, BLOCK):
            count = min(BLOCK, last - start)
            element_forces(formulations, kinds[b], q, start, count, constants[b], buffer)
            if start == first[b] and of[0, b] >= 0:
                _push(masses, b, motion, of[0, b], buffer)
            for j in range(count):
                i = start + j
                trx, try_ = f[0, i] - (buffer[j] + orx), f[1, i] - (buffer[BLOCK + j] + ory)
                tgx, tgy = f[2, i] - (buffer[2 * BLOCK + j] + ogx), f[3, i] - (buffer[3 * BLOCK + j] + ogy)
                rr, rg, gr, gg = L[0, i], L[1, i], L[2, i], L[3, i]
                a[0, i], a[1, i], a[2, i], a[3, i] = trx + rx, try_ + ry, tgx + gx, tgy + gy
                sx, sy = pass_start(kept, i, a, sx, sy)
                rx, gx = (
                    -(rr * trx + rg * tgx) - rr * rx - rg * gx,
                    -(gr * trx + gg * tgx) - gr * rx - gg * gx,
                )
                ry, gy = (
                    -(rr * try_ + rg * tgy) - rr * ry - rg * gy,
                    -(gr * try_ + gg * tgy) - gr * ry - gg * gy,
                )
                orx, ory = buffer[6 * BLOCK + j], buffer[7 * BLOCK + j]
                ogx, ogy = buffer[8 * BLOCK + j], buffer[9 * BLOCK + j]
                if director:
                    tdx, tdy = (
                        f[4, i] - (buffer[4 * BLOCK + j] + odx),
                        f[5, i] - (buffer[5 * BLOCK + j] + ody),
                    )
                    a[4, i], a[5, i] = tdx + dx, tdy + dy
                    dx, dy = -L[4, i] * tdx - L[4, i] * dx, -L[4, i] * tdy - L[4, i] * dy
                    odx, ody = buffer[10 * BLOCK + j], buffer[11 * BLOCK + j]
        if at[place] == last and last > first[b]:
            rx, ry, gx, gy, dx, dy = _taken(director, waiting[take[place]], rx, ry, gx, gy, dx, dy)
            place += 1
        rx, ry = rx + f[0, last] - orx, ry + f[1, last] - ory
        gx, gy = gx + f[2, last] - ogx, gy + f[3, last] - ogy
        a[0, last], a[1, last], a[2, last], a[3, last] = rx, ry, gx, gy
        sx, sy = pass_start(kept, last, a, sx, sy)
        rr, rg, gr, gg = L[0, last], L[1, last], L[2, last], L[3, last]
        rx, gx = -(rr * rx + rg * gx), -(gr * rx + gg * gx)
        ry, gy = -(rr * ry + rg * gy), -(gr * ry + gg * gy)
        rx, ry, sx, sy = leave_body(kept, b, rx, ry, sx, sy)
        if director:
            dx, dy = dx + f[4, last] - odx, dy + f[5, last] - ody
            a[4, last], a[5, last] = dx, dy
            dx, dy = -L[4, last] * dx, -L[4, last] * dy


@inlined
def _taken(director, c, rx, ry, gx, gy, dx, dy):  # type: ignore[no-untyped-def]
    """Sum of the arriving load and the load stored at the branch, c; c is reset to 0."""
    rx, ry, gx, gy = rx + c[0], ry + c[1], gx + c[2], gy + c[3]
    c[0] = c[1] = c[2] = c[3] = 0.0
    if director:
        dx, dy = dx + c[4], dy + c[5]
        c[4] = c[5] = 0.0
    return rx, ry, gx, gy, dx, dy


@inlined
def _push(masses, b, motion, clamp, buffer):  # type: ignore[no-untyped-def]
    """Add to the first element's force on its node O the inertia that the driven clamp's motion of node I brings."""
    for k in range(motion.shape[2]):
        for n in range(k % 2, motion.shape[2], 2):
            buffer[(6 + k) * BLOCK] += masses[b, 3 + k // 2, n // 2] * motion[2, clamp, n]


@inlined
def _backward(tables, clamps, factors, a):  # type: ignore[no-untyped-def]
    """Backward sweep: the loads in a become accelerations."""
    first, _, kinds, _, masses, _ = tables
    of, motion, reaction = clamps.of, clamps.motion, clamps.reaction
    L, G, D, kept = factors.L, factors.G, factors.D, factors.places
    director = a.shape[0] == 6
    at, _, _, node, _, _ = factors.branches
    place = len(at) - 1
    rx = ry = gx = gy = dx = dy = sx = sy = 0.0
    for b in range(len(kinds) - 1, -1, -1):
        last = first[b + 1] - 1
        if at[place] == last + 1:
            if node[place] >= 0:
                n = node[place]
                rx, ry, gx, gy = a[0, n], a[1, n], a[2, n], a[3, n]
                if director:
                    dx, dy = a[4, n], a[5, n]
            place -= 1
        if at[place] == last and last > first[b]:
            place -= 1
        rx, ry, sx, sy = enter_body(kept, b, rx, ry, sx, sy)
        for i in range(last, first[b] - 1, -1):
            if i == last and of[1, b] >= 0:
                _hold_last(i, motion, reaction, of[1, b], D, a)
                rx, ry, gx, gy = a[0, i], a[1, i], a[2, i], a[3, i]
                if director:
                    dx, dy = a[4, i], a[5, i]
                continue
            if i == first[b] and of[0, b] >= 0:
                _hold_first(i, motion, reaction, of[0, b], masses, b, a)
                rx, ry, gx, gy = a[0, i], a[1, i], a[2, i], a[3, i]
                if director:
                    dx, dy = a[4, i], a[5, i]
                continue
            px, py, qx, qy = a[0, i], a[1, i], a[2, i], a[3, i]
            rr, rg, gr, gg = L[0, i], L[1, i], L[2, i], L[3, i]
            A, B, C = G[0, i], G[1, i], G[2, i]
            px, py, qx, qy = A * px + B * qx, A * py + B * qy, B * px + C * qx, B * py + C * qy
            px, py, qx, qy = take_start(kept, i, sx, sy, px, py, qx, qy)
            rx, gx = px - gr * gx - rr * rx, qx - gg * gx - rg * rx
            ry, gy = py - gr * gy - rr * ry, qy - gg * gy - rg * ry
            a[0, i], a[1, i], a[2, i], a[3, i] = rx, ry, gx, gy
            if director:
                dx = G[3, i] * a[4, i] - L[4, i] * dx
                dy = G[3, i] * a[5, i] - L[4, i] * dy
                a[4, i], a[5, i] = dx, dy


@inlined
def _hold_first(i, motion, reaction, clamp, masses, b, a):  # type: ignore[no-untyped-def]
    """At a chain's start: reaction M_II a_I + M_IO a_O − b, then the known acceleration for the loads b in a."""
    for k in range(a.shape[0]):
        force = -a[k, i]
        for n in range(k % 2, a.shape[0], 2):
            force += (
                masses[b, k // 2, n // 2] * motion[2, clamp, n] + masses[b, k // 2, 3 + n // 2] * a[n, i + 1]
            )
        reaction[clamp, k] = force
    for k in range(a.shape[0]):
        a[k, i] = motion[2, clamp, k]


@inlined
def _hold_last(i, motion, reaction, clamp, D, a):  # type: ignore[no-untyped-def]
    """At a chain's end: reaction D a − b with the condensed mass D, then the known acceleration for b in a."""
    for c in range(2):
        r, g = motion[2, clamp, c], motion[2, clamp, 2 + c]
        reaction[clamp, c] = D[0, i] * r + D[1, i] * g - a[c, i]
        reaction[clamp, 2 + c] = D[1, i] * r + D[2, i] * g - a[2 + c, i]
        if a.shape[0] == 6:
            reaction[clamp, 4 + c] = D[3, i] * motion[2, clamp, 4 + c] - a[4 + c, i]
    for k in range(a.shape[0]):
        a[k, i] = motion[2, clamp, k]


@separate
def by_blocks(
    q: Array, f: Array, tables: Tables, clamps: DrivenClamps, factors: BlockFactors, load: Array, a: Array
) -> None:
    """Accelerations of any scene by full blocks, and reactions of driven clamps; `load`, (rows, nodes), is scratch."""
    first, masses, rows = tables.first, tables.masses, q.shape[0]
    elastic_forces(tables.formulations, q, first, tables.kinds, tables.constants, tables.buffer, load)
    for k in range(rows):
        for i in range(q.shape[1]):
            load[k, i] = f[k, i] - load[k, i]
    for b in range(len(tables.kinds)):
        for side in range(2):
            clamp = clamps.of[side, b]
            if clamp >= 0:  # inertia that the driven clamp's motion puts on the element's nodes
                one = first[b] if side == 0 else first[b + 1] - 1
                other = first[b] + 1 if side == 0 else first[b + 1] - 2
                for k in range(rows):
                    for n in range(k % 2, rows, 2):
                        m = masses[b, 3 * (1 - side) + k // 2, 3 * side + n // 2]
                        load[k, other] -= m * clamps.motion[2, clamp, n]
                for k in range(clamps.held[clamp], rows):
                    for n in range(k % 2, rows, 2):
                        load[k, one] -= (
                            masses[b, 3 * side + k // 2, 3 * side + n // 2] * clamps.motion[2, clamp, n]
                        )
    sweep(factors, load, a)
    for h in range(len(clamps.nodes)):
        for k in range(clamps.held[h]):
            a[k, clamps.nodes[h]] = clamps.motion[2, h, k]
    clamp_reactions(q, a, f, tables, clamps)
