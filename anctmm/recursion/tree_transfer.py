"""Accelerations of trees by transfer matrices, readable: where branches meet, their condensed matrices add up.

The partition at a junction is za = P, zb = δ̈: then S = Σ S_child, e = Σ e_child over all ends that arrive (Rui et al.
2020, 10.1007/s11044-019-09711-2). Along a body it is the one that its inboard end suits, as for a chain (Rong 2014,
eqs. 28-35). Vectors of the plane are complex numbers, as in `transfer`.

This is the form to read and to test against. For speed, and for loops, there is `riccati`.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.plan import PIN, TANGENT, WELD
from anctmm.elements.kinds import check_kinds, flexible
from anctmm.errors import SolverError
from anctmm.recursion.transfer import (
    Passage,
    body_passages,
    complex_of,
    pass_pin,
    riccati_step,
    state_of,
    step_back,
    swapped,
)

Complex = NDArray[Any]
Real = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Vectors that pass a joint which leaves the others free: r and r_x.
TANGENT_VECTORS = 2


@dataclass
class _Passed:
    """A body that has been passed: its passages, za = S zb + e at each node, and S, e of all at its last node."""

    passages: list[Passage]
    memory: list[tuple[Mask, Complex, Complex]] = field(default_factory=list)
    S: Complex = field(default_factory=lambda: np.empty(0))
    e: Complex = field(default_factory=lambda: np.empty(0))


def accelerations_tree(chain: Chain, q: Real, f: Real, clamp: Real | None = None) -> Complex:
    """Accelerations of a scene without loops, (k, nodes), as complex numbers.

    Parameters
    ----------
    chain : Chain
        Of one kind of element.
    q, f : ndarray, shape (rows, nodes)
        Coordinates and external forces.
    clamp : ndarray, shape (rows, nodes), optional
        Known accelerations of driven clamps; 0 without it.

    Raises
    ------
    SolverError
        If the scene closes loops or mixes kinds of elements.
    """
    nodes = [mesh.body.name for mesh in chain.bodies.meshes if not mesh.elements]
    if nodes or chain.guided or chain.kept.constraints.names:
        raise SolverError(
            f"scene {chain.scene.name!r} has guides, or bodies of one node {nodes}; the readable form takes beams, "
            f"pins, welds and clamps alone"
        )
    if chain.plan.kept:
        raise SolverError(f"scene {chain.scene.name!r} closes loops; a tree is needed here")
    if len(set(chain.bodies.kinds)) > 1:
        raise SolverError(
            f"scene {chain.scene.name!r} mixes {' and '.join(sorted({m.kind.name for m in chain.bodies.meshes}))} "
            f"elements; one kind is needed here"
        )
    check_kinds(chain.run.of(chain.scene), flexible(), "the readable form")
    first, held = chain.bodies.first, chain.prescribed[::2]
    given = held * (0.0j if clamp is None else complex_of(clamp))
    waiting: dict[int, tuple[Complex, Complex]] = {}
    passed = []
    for b in range(len(first) - 1):
        start, last = int(first[b]), int(first[b + 1]) - 1
        body = _Passed(body_passages(chain, b, q, complex_of(f)))
        S, e = _taken(waiting, start, held[:, start], given[:, start])
        _pass_body(body, ~held[:, start], S, np.where(held[:, start], given[:, start], e))
        S, e = _taken(waiting, last, held[:, last], given[:, last])
        body.S, body.e = body.memory[-1][1] + S, body.memory[-1][2] + e
        if chain.onward[b] >= 0:
            S, e = _without_known(body.S, body.e, held[:, last], given[:, last])
            _send(waiting, int(chain.onward[b]), *_linked(chain, b, S, e))
        passed.append(body)
    out = np.zeros((chain.bodies.rows // 2, chain.bodies.nodes), dtype=complex)
    for b in range(len(first) - 2, -1, -1):
        last = int(first[b + 1]) - 1
        out[:, last] = _at_end(chain, b, passed[b], out, held[:, last], given[:, last])
        z = state_of(*passed[b].memory[-1], out[:, last])
        for i, passage in zip(
            range(last - 1, int(first[b]) - 1, -1), reversed(passed[b].passages), strict=True
        ):
            z = step_back(passage, passed[b].memory[i - int(first[b])], z)
            out[:, i] = z[: len(out)]
    return out


def _taken(
    waiting: dict[int, tuple[Complex, Complex]], node: int, held: Mask, given: Complex
) -> tuple[Complex, Complex]:
    """S and e of what waits at a node, of the components that are not held there."""
    k = len(held)
    S, e = waiting.pop(node, (np.zeros((k, k), dtype=complex), np.zeros(k, dtype=complex)))
    return _without_known(S, e, held, given)


def _without_known(S: Complex, e: Complex, held: Mask, given: Complex) -> tuple[Complex, Complex]:
    """S and e of the components that are not held; accelerations given of the others are part of e."""
    free = ~held
    return S * np.outer(free, free), (e + S @ given) * free


def _send(waiting: dict[int, tuple[Complex, Complex]], node: int, S: Complex, e: Complex) -> None:
    """Add condensed matrices of a branch to those that wait at a node: S = Σ S_child, e = Σ e_child."""
    others = waiting.get(node, (0.0, 0.0))
    waiting[node] = (others[0] + S, others[1] + e)


def _pass_body(body: _Passed, by_force: Mask, S: Complex, e: Complex) -> None:
    """Pass S and e through a body; at its last node all of za are forces."""
    body.memory = [(by_force, S, e)]
    for passage in body.passages:
        assert passage.U is not None
        assert passage.T is not None
        S, e = riccati_step(S, e, passage.U, passage.T, by_force)
        body.memory.append((by_force, S, e))
    body.memory[-1] = swapped(by_force, S, e, np.arange(len(e)))


def _linked(chain: Chain, b: int, S: Complex, e: Complex) -> tuple[Complex, Complex]:
    """S and e in the frame of the end that a body passes on to."""
    if chain.link[b] == WELD:
        W = _turn(chain, b)
        return W[:, None] * S * np.conj(W), W * e
    if chain.link[b] == TANGENT:
        W, (S, e) = _turn(chain, b), pass_pin(S, e, TANGENT_VECTORS)
        return W[:, None] * S * np.conj(W), W * e
    if chain.link[b] == PIN:
        return pass_pin(S, e)
    return 0.0 * S, 0.0 * e


def _turn(chain: Chain, b: int) -> Complex:
    """Factors by which place and gradients turn at a weld."""
    W = np.full(chain.bodies.rows // 2, complex(*chain.turn[b]))
    W[0] = 1.0
    return W


def _at_end(
    chain: Chain, b: int, body: _Passed, found: Complex, held: Mask, accelerations: Complex
) -> Complex:
    """Accelerations of a body's last node from those of the node that it passed on to: what that leaves free bears no
    force.
    """
    k = len(held)
    a, given = accelerations.copy(), held.copy()
    if chain.onward[b] >= 0 and chain.link[b] == WELD:
        a, given = np.conj(_turn(chain, b)) * found[:, chain.onward[b]], np.ones(k, dtype=bool)
    elif chain.onward[b] >= 0 and chain.link[b] == TANGENT:
        n = TANGENT_VECTORS
        a[:n], given[:n] = (np.conj(_turn(chain, b)) * found[:, chain.onward[b]])[:n], True
    elif chain.onward[b] >= 0 and chain.link[b] == PIN:
        a[0], given[0] = found[0, chain.onward[b]], True
    free = ~given
    a[free] = np.linalg.solve(
        body.S[np.ix_(free, free)], -(body.S[np.ix_(free, given)] @ a[given] + body.e[free])
    )
    return a
