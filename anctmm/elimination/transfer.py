"""The paper's recursion along a chain of beams, dense and readable: transfer matrices, plain product, Riccati form.

The state of a node is z = [δ̈; P] (Rong 2014, eq. 14), P the generalized forces counted as transmitted through the node
from inboard to outboard. An element takes it on by z_O = U z_I + T (eqs. 17-18), and a joint by what it lets pass. The
plain product of all U is the paper's first form; the Riccati recursion za = S zb + e (eqs. 28-35) keeps its digits.

`factor` does the same in blocks, for trees and loops: with za = P and zb = δ̈, S is the condensed mass of all that lies
inboard of a node, which is added to the diagonal block of the node and inverted there, and e is the right-hand side
swept so far. Where branches meet, their S and e add up; a loop fills blocks beside the diagonal. This module is the
form to read and to test against.

Vectors of the plane are complex numbers here, x + iy: a mass m ⊗ I₂ is then the real matrix m, and a turn by φ the
factor exp(iφ). A node of the shear element has k = 3 components (r, r_x, r_y), one of the cable 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[Any]
Real = NDArray[np.float64]
Partition = NDArray[np.bool_]

#: At the start or end of a chain, which of r and the gradients are known (else their forces vanish).
FREE, PINNED, CLAMPED = "free", "pinned", "clamped"


def element_transfer(mass: Real, load_I: Complex, load_O: Complex) -> tuple[Complex, Complex]:
    """U and T of an element, z_O = U z_I + T (Rong 2014, eqs. 17-18, T₂ corrected).

    Parameters
    ----------
    mass : ndarray, shape (2k, 2k)
        Scalar mass matrix.
    load_I, load_O : ndarray, shape (k,)
        F − Kδ at both nodes: external less elastic forces.

    Returns
    -------
    U : ndarray, shape (2k, 2k)
    T : ndarray, shape (2k,)
    """
    k = len(load_I)
    M11, M12, M21, M22 = mass[:k, :k], mass[:k, k:], mass[k:, :k], mass[k:, k:]
    inverse = np.linalg.inv(M12)
    U = np.block([[-inverse @ M11, -inverse], [M21 - M22 @ inverse @ M11, -M22 @ inverse]])
    T = np.concatenate([inverse @ load_I, M22 @ inverse @ load_I - load_O])
    return U.astype(complex), T


def weld_transfer(k: int, turn: complex = 1.0) -> tuple[Complex, Complex]:
    """U and T of a weld: r and its force pass on, gradients and their forces turn with the frame, by exp(iφ)."""
    W = np.array([1.0, *[turn] * (k - 1)], dtype=complex)
    return np.diag(np.concatenate([W, W])), np.zeros(2 * k, dtype=complex)


@dataclass(frozen=True)
class Passage:
    """One step along a chain.

    U and T are the transfer of an element or a weld, None of a pin, whose other side the state does not determine.
    """

    U: Complex | None
    T: Complex | None


@dataclass(frozen=True)
class Row:
    """One chain for the methods of this module.

    Parameters
    ----------
    k : int
        Components of a node.
    passages : list of Passage
        One from each node to the next.
    start, end : str
        FREE, PINNED or CLAMPED.
    known : (ndarray, ndarray)
        Known accelerations at start and end, (k,) each; only what the support holds is used.
    """

    k: int
    passages: list[Passage]
    start: str
    end: str
    known: tuple[Complex, Complex]


@dataclass(frozen=True)
class Body:
    """A beam as a chain passes it.

    Parameters
    ----------
    mass : ndarray, shape (2k, 2k)
        Scalar mass matrix of each of its equal elements.
    loads : ndarray, shape (elements, 2k)
        F − Kδ of each element at its nodes, N and N m: external less elastic forces, each external one once.
    backward : bool
        Whether the chain passes it from its end to its start.
    """

    mass: Real
    loads: Complex
    backward: bool = False

    def passages(self) -> list[Passage]:
        """Through its elements, in the order in which the chain passes them."""
        k = len(self.mass) // 2
        if not self.backward:
            return [Passage(*element_transfer(self.mass, load[:k], load[k:])) for load in self.loads]
        mass = np.roll(self.mass, (k, k), axis=(0, 1))
        return [Passage(*element_transfer(mass, load[k:], load[:k])) for load in self.loads[::-1]]


def row_of(
    bodies: Sequence[Body],
    turns: Sequence[complex | None],
    supports: tuple[str, str],
    known: tuple[Complex, Complex],
) -> Row:
    """Passages through bodies of one kind of element and through the joints between them.

    Parameters
    ----------
    bodies : sequence of Body
    turns : sequence of complex or None
        One of each two neighbours: None of a pin, of a weld exp(iφ), by which the frame of the second body is turned
        against that of the first.
    supports : (str, str)
        FREE, PINNED or CLAMPED, at the start and at the end.
    known : (ndarray, ndarray)
        Accelerations there, as of `Row`.
    """
    k = len(bodies[0].mass) // 2
    passages = bodies[0].passages()
    for turn, body in zip(turns, bodies[1:], strict=True):
        through = (None, None) if turn is None else weld_transfer(k, turn)
        passages += [Passage(*through), *body.passages()]
    return Row(k, passages, *supports, known)


def accelerations_plain(row: Row) -> Complex:
    """Accelerations of all nodes in their order along the chain, (k, nodes), by the plain product.

    All states are affine in the unknowns u of the start: z = B u + c; a pin replaces u by what its vanishing forces
    leave of it and the new gradients. An element's U has an eigenvalue of 68, so all digits are lost within
    about nine elements.
    """
    k = row.k
    held = _held(row.start, k)
    B = np.eye(2 * k, dtype=complex)[:, np.concatenate([~held, held])]
    c = np.concatenate([np.where(held, row.known[0], 0.0), np.zeros(k)])
    states, changes = [(B, c)], []
    for number, passage in enumerate(row.passages):
        if passage.U is not None:
            B, c = passage.U @ B, passage.U @ c + passage.T
        else:
            B, c, change = _through_pin(B, c, k)
            changes.append((number, *change))
        states.append((B, c))
    u = np.linalg.solve(*_end_conditions(row, B, c))
    out = np.empty((k, len(states)), dtype=complex)
    for i in range(len(states) - 1, -1, -1):
        B, c = states[i]
        out[:, i] = (B @ u + c)[:k]
        if changes and changes[-1][0] == i - 1:
            _, particular, null = changes.pop()
            u = particular + null @ u[:1]
    return out


def _through_pin(B: Complex, c: Complex, k: int) -> tuple[Complex, Complex, tuple[Complex, Complex]]:
    """Outboard state of a pin: unknowns are what is left of u, and the outboard gradients."""
    moments = B[k + 1 :]
    particular = np.linalg.lstsq(moments, -c[k + 1 :], rcond=None)[0]
    null = np.linalg.svd(moments)[2][-1:].conj().T
    out, rest = np.zeros((2 * k, k), dtype=complex), np.zeros(2 * k, dtype=complex)
    for i in (0, k):
        out[i, 0], rest[i] = (B[i] @ null)[0], B[i] @ particular + c[i]
    out[1:k, 1:] = np.eye(k - 1)
    return out, rest, (particular, null)


def _held(support: str, k: int) -> Partition:
    """Which components a support holds."""
    return np.array([support != FREE, *[support == CLAMPED] * (k - 1)])


def _end_conditions(row: Row, B: Complex, c: Complex) -> tuple[Complex, Complex]:
    """Matrix and right-hand side of what the end's support demands of z = B u + c."""
    k, held = row.k, _held(row.end, row.k)
    pick = np.concatenate([np.flatnonzero(held), k + np.flatnonzero(~held)])
    wanted = np.concatenate([row.known[1][held], np.zeros(int((~held).sum()))])
    return B[pick], wanted - c[pick]


def accelerations_riccati(row: Row) -> Complex:
    """The same by the Riccati recursion (Rong 2014, eqs. 28-35).

    The partition is the one that the start suits: za is what is known there, za = S zb + e with S = 0. At a pinned
    start this is the paper's za = [δ̈₁, δ̈₂, P₃ … P₆], at a free one za = P with S the condensed mass.
    """
    k = row.k
    by_force = ~_held(row.start, k)  # za_i is P_i there, else δ̈_i
    S = np.zeros((k, k), dtype=complex)
    e = np.where(by_force, 0.0, row.known[0]).astype(complex)
    memory = [(by_force, S, e)]
    for passage in row.passages:
        if passage.U is None or passage.T is None:
            by_force, S, e = swapped(by_force, S, e)
            memory[-1] = (by_force, S, e)
            S, e = pass_pin(S, e)
        else:
            S, e = riccati_step(S, e, passage.U, passage.T, by_force)
        memory.append((by_force, S, e))
    z = state_of(*memory[-1], _last(row, *memory[-1]))
    out = [z[:k]]
    for passage, inboard in zip(reversed(row.passages), reversed(memory[:-1]), strict=True):
        z = step_back(passage, inboard, z)
        out.append(z[:k])
    return np.stack(out[::-1], axis=1)


def state_of(by_force: Partition, S: Complex, e: Complex, zb: Complex) -> Complex:
    """z of a node from its zb."""
    a, b = _split(by_force)
    z = np.empty(2 * len(e), dtype=complex)
    z[a], z[b] = S @ zb + e, zb
    return z


def riccati_step(
    S: Complex, e: Complex, U: Complex, T: Complex, by_force: Partition
) -> tuple[Complex, Complex]:
    """Pass (S, e) of za = S zb + e through z' = U z + T, the partition kept (Rong 2014, eqs. 30-31)."""
    a, b = _split(by_force)
    inverse = np.linalg.inv(U[np.ix_(b, a)] @ S + U[np.ix_(b, b)])
    S_next = (U[np.ix_(a, a)] @ S + U[np.ix_(a, b)]) @ inverse
    return S_next, U[np.ix_(a, a)] @ e + T[a] - S_next @ (U[np.ix_(b, a)] @ e + T[b])


def _split(by_force: Partition) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Places in z = [δ̈; P] of za and zb."""
    i, k = np.arange(len(by_force)), len(by_force)
    return np.where(by_force, k + i, i), np.where(by_force, i, k + i)


def swapped(by_force: Partition, S: Complex, e: Complex) -> tuple[Partition, Complex, Complex]:
    """Another partition, in which za_i is P_i for all gradients (principal pivots of S)."""
    by_force, S, e = by_force.copy(), S.copy(), e.copy()
    for i in range(1, len(e)):
        if by_force[i]:
            continue
        others = np.arange(len(e)) != i
        row, pivot, rest = S[i].copy(), S[i, i], e[i]
        S[i], e[i] = -row / pivot, -rest / pivot
        S[i, i] = 1.0 / pivot
        column = S[others, i].copy()
        S[others] += np.outer(column, S[i])
        S[others, i] = column / pivot
        e[others] += column * e[i]
        by_force[i] = True
    return by_force, S, e


def pass_pin(S: Complex, e: Complex) -> tuple[Complex, Complex]:
    """Pass a pin: P₃ … vanish on both sides, the outboard gradients are new and bear nothing yet."""
    gain = np.linalg.solve(S[1:, 1:].T, S[:1, 1:].T).T
    out, rest = np.zeros_like(S), np.zeros_like(e)
    out[:1, :1], rest[:1] = S[:1, :1] - gain @ S[1:, :1], e[:1] - gain @ e[1:]
    return out, rest


def _last(row: Row, by_force: Partition, S: Complex, e: Complex) -> Complex:
    """zb of the last node from the end's conditions."""
    a, b = _split(by_force)
    B, c = np.zeros((2 * row.k, row.k), dtype=complex), np.zeros(2 * row.k, dtype=complex)
    B[a], B[b], c[a] = S, np.eye(row.k), e
    return np.linalg.solve(*_end_conditions(row, B, c))


def step_back(passage: Passage, inboard: tuple[Partition, Complex, Complex], outboard: Complex) -> Complex:
    """z of the inboard node from that of the outboard one, which may have changed its partition since."""
    by_force, S, e = inboard
    a, b = _split(by_force)
    zb = outboard[b]
    if passage.U is None or passage.T is None:
        zb = np.concatenate([zb[:1], -np.linalg.solve(S[1:, 1:], S[1:, 0] * zb[0] + e[1:])])
    else:
        U, T = passage.U, passage.T
        matrix = U[np.ix_(b, a)] @ S + U[np.ix_(b, b)]
        zb = np.linalg.solve(matrix, zb - U[np.ix_(b, a)] @ e - T[b])
    return state_of(by_force, S, e, zb)
