"""Coordinates of all bodies in one array, stored by component, and compiled sums over their elements.

This module knows bodies and elements, but not joints: the transfer-matrix solver and the global one both use it, so
that a comparison of their times compares the methods.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.mesh import KEPT, BodyMesh
from anctmm.elements.dispatch import (
    ALL,
    KERNELS,
    components,
    element_damping,
    element_energy,
    element_forces,
    element_tangents,
    formulations_of,
)
from anctmm.elements.force_blocks import BLOCK, LANES
from anctmm.elements.tangent_blocks import lower
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined, kernel
from anctmm.jit.copies import writes
from anctmm.model.places import Key

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Where a scalar mass stands among rows r, r_x and third vector of I and O, by its size: of a node of one vector or two
#: and of an element whose nodes have two or three.
_PLACES = {len(at): np.ix_(at, at) for at in ([0], [0, 1], [0, 1, 3, 4], [0, 1, 2, 3, 4, 5])}
#: Where sweeps begin: no literal 0, for which numba would compile what takes it once more.
FIRST_BODY = np.int64(0)


@writes("buffer")
@by_address
class Tables(NamedTuple):
    """What kernels need of `Bodies`, under the names it has there."""

    first: Ints
    formulations: tuple[int, ...]
    kinds: Ints
    constants: Array
    masses: Array
    buffer: Array


class Layout(NamedTuple):
    """What `Bodies` has under these names, which follows from numbers and kinds of elements alone."""

    rows: int
    first: Ints
    nodes: int
    kinds: Ints
    formulations: tuple[int, ...]


def _layout(shapes: tuple[tuple[int | None, int, int], ...]) -> Layout:
    """Of bodies whose kernels, vectors and nodes are given: nobody writes into it."""
    kernels, vectors, nodes = zip(*shapes, strict=True)
    first = np.array([0, *accumulate(nodes)], dtype=np.int64)
    any_one = next((kind for kind in kernels if kind is not None), min(KERNELS))
    kinds = [any_one if kind is None else kind for kind in kernels]
    return Layout(
        2 * max(2, *vectors), first, int(first[-1]), np.array(kinds, dtype=np.int64), formulations_of(kinds)
    )


_kept_layout = lru_cache(maxsize=64)(_layout)


@dataclass(frozen=True)
class Bodies:
    """Bodies laid one after another.

    Component k of node i is q[k, i]: 0, 1 position, 2, 3 r_x and, where a kind has a third vector, 4, 5: r_y or l r_xx.
    In a scene that has such a kind and cables the nodes of cables have two components that nothing uses.

    Parameters
    ----------
    meshes : sequence of BodyMesh and NodeMesh
    """

    meshes: Sequence[Any]

    @cached_property
    def _layout(self) -> Layout:
        shapes = tuple((m.kernels, m.vectors, m.nodes) for m in self.meshes)
        return (_kept_layout if len(shapes) <= KEPT else _layout)(shapes)

    @property
    def rows(self) -> int:
        """Components of a node: 4, or 6 where a kind of element has three vectors."""
        return self._layout.rows

    @property
    def first(self) -> Ints:
        """First node of each body, and after them the number of all nodes."""
        return self._layout.first

    @property
    def nodes(self) -> int:
        """Number of all nodes."""
        return self._layout.nodes

    @cached_property
    def elements(self) -> Ints:
        """Number of elements of each body."""
        return np.array([m.elements for m in self.meshes], dtype=np.int64)

    @property
    def kinds(self) -> Ints:
        """Kernels of each body, by number; of one without elements those of any other, to compile nothing more."""
        return self._layout.kinds

    @property
    def formulations(self) -> tuple[int, ...]:
        """A tuple whose type tells the compiler which kinds of element there are."""
        return self._layout.formulations

    @cached_property
    def constants(self) -> Array:
        """Constants of the element kernels, a row a body."""
        rows = [
            KERNELS[m.kernels].constants(m.element) if isinstance(m, BodyMesh) else () for m in self.meshes
        ]
        table = np.zeros((len(rows), max(1, *map(len, rows))))
        for line, row in zip(table, rows, strict=True):
            line[: len(row)] = row
        return table

    @cached_property
    def damping(self) -> Array | None:
        """Kelvin-Voigt damping of each body, s; None where no body has any: then nothing of it is compiled."""
        table = [m.damping for m in self.meshes]
        return np.array(table) if any(table) else None

    def stiffened(self, factors: Iterable[float], stresses: bool = True) -> "Bodies":
        """The bodies with so many times their stiffness each, and, as far as tangents go, their stresses."""
        pairs = zip(self.meshes, factors, strict=True)
        return Bodies([mesh.stiffened(f, stresses) for mesh, f in pairs])

    @cached_property
    def masses(self) -> Array:
        """Scalar mass matrices of one element of each body, (bodies, 6, 6), in rows r, r_x, third vector of I and O.

        That of a body of one node stands in the rows of I.
        """
        table = np.zeros((len(self.meshes), 6, 6))
        for line, mesh in zip(table, self.meshes, strict=True):
            mass = mesh.scalar_mass
            line[_PLACES[len(mass)]] = mass
        return table

    @cached_property
    def coupled(self) -> bool:
        """Whether the third vector of some nodes has mass in common with the others, as that of a quintic cable."""
        return bool(self.masses[:, [[2], [5]], [0, 1, 3, 4]].any())

    def flat(self, fields: Sequence[Array]) -> Array:
        """(nodes, vectors, 2) of every body → one array, (rows, nodes)."""
        out = np.zeros((self.rows, self.nodes))
        for i, (mesh, values) in enumerate(zip(self.meshes, fields, strict=True)):
            out[: 2 * mesh.vectors, self.first[i] : self.first[i + 1]] = values.reshape(mesh.nodes, -1).T
        return out

    def by_body(self, flat: Array) -> dict[str, Array]:
        """(…, rows, nodes) → (…, nodes, vectors, 2) of every body, in the body's own direction."""
        out = {}
        for i, mesh in enumerate(self.meshes):
            part = flat[..., : 2 * mesh.vectors, self.first[i] : self.first[i + 1]]
            part = part.swapaxes(-1, -2).reshape(*flat.shape[:-2], mesh.nodes, mesh.vectors, 2)
            out[mesh.body.name] = mesh.unflipped(part)
        return out

    def reference(self) -> Array:
        """Coordinates of the undeformed scene, (rows, nodes); the caller's own."""
        return self.undeformed.copy()

    @cached_property
    def undeformed(self) -> Array:
        """The same for all who read."""
        return self.flat([m.reference for m in self.meshes])

    def initial_velocity(self) -> Array:
        """Velocities at t = 0, (rows, nodes)."""
        if not any(m.body.moving for m in self.meshes):
            return np.zeros((self.rows, self.nodes))
        return self.flat([m.initial_velocity for m in self.meshes])

    def weight(self) -> Array:
        """Forces of gravity, (rows, nodes), N."""
        return self.flat([m.weight for m in self.meshes])

    def node(self, name: str, key: Key) -> int:
        """Node of a place of a body: at its start (0) or end (1), or the only one of a body of one node."""
        i = self._places[name]
        return int(self.first[i]) + self.meshes[i].node(key)

    def first_node(self, name: str) -> int:
        """First node of a body."""
        return int(self.first[self._places[name]])

    def mesh(self, name: str) -> Any:
        """Mesh of a body, `BodyMesh` or `NodeMesh`."""
        return self.meshes[self._places[name]]

    def turning_row(self, name: str) -> int:
        """First row of the vector that a torque on the body turns: r_x of a cable, r_y of a shear element."""
        return self.mesh(name).turning_row

    @cached_property
    def _places(self) -> dict[str, int]:
        """Where each body stands: a search would make the cost of many joints quadratic."""
        return {mesh.body.name: i for i, mesh in enumerate(self.meshes)}

    def element_at(self, node: int) -> tuple[str, int]:
        """Body and element, counted from the body's start, next to a node."""
        i = int(np.searchsorted(self.first, node, side="right")) - 1
        mesh = self.meshes[i]
        element = max(min(node - int(self.first[i]), mesh.elements - 1), 0)
        return mesh.body.name, mesh.elements - 1 - element if mesh.flipped else element

    def tables(self) -> Tables:
        """Arrays for kernels, with a buffer of their own."""
        return Tables(self.first, self.formulations, self.kinds, self.constants, self.masses, self.buffer())

    def buffer(self) -> Array:
        """Scratch of the force kernels: forces of a window, and behind them those that it hands to the next."""
        return np.zeros(12 * BLOCK + 6)


@embedded
def window_forces(formulations, q, start, end, body, first, kinds, constants, buffer):  # type: ignore[no-untyped-def]
    """Elastic forces of the elements behind nodes start … end − 1, at most BLOCK, of all bodies that lie there.

    Parameters
    ----------
    q : ndarray, shape (rows, nodes)
    start, end : int
        The last node of a body has no element behind it: its forces are zero.
    body : int
        Where node `start` lies.
    formulations, first, kinds, constants
        Of `Bodies`.
    buffer : ndarray, shape (12 * BLOCK + 6,)
        Written: component k of the force on node I of the element behind node i at k BLOCK + i − start, on node O at
        (6 + k) BLOCK + i − start.
    """
    node = start
    while node < end:
        last = first[body + 1] - 1
        count = min(last, end) - node
        if count > 0:
            kind = kinds[body]
            element_forces(formulations, kind, q, node, count, constants[body], buffer[node - start :])
            for k in range(components(formulations, kind), q.shape[0]):  # of a cable among shear elements
                for j in range(node - start, node - start + count):
                    buffer[k * BLOCK + j] = buffer[(6 + k) * BLOCK + j] = 0.0
            node += count
        if node == last and node < end:
            for k in range(q.shape[0]):
                buffer[k * BLOCK + node - start] = buffer[(6 + k) * BLOCK + node - start] = 0.0
            node += 1
            body += 1


@embedded
def window_inertia(w, factor, start, end, body, first, masses, buffer):  # type: ignore[no-untyped-def]
    """Add factor · M w of the same elements; parameters as in `window_forces`, w of shape (rows, nodes)."""
    node = start
    while node < end:
        last = first[body + 1] - 1
        count = min(last, end) - node
        if count > 0:
            _add_inertia(w, factor, masses[body], node, count, buffer[node - start :])
        node += count
        if node == last and node < end:
            if node == first[body]:  # a body of one node
                for c in range(w.shape[0]):
                    buffer[c * BLOCK + node - start] += factor * masses[body, c // 2, c // 2] * w[c, node]
            node += 1
            body += 1


@embedded
def _add_inertia(w, factor, m, node, count, out):  # type: ignore[no-untyped-def]
    """Add that of a row of elements of one body behind a node; unsigned indices for the reason of `four_rows`."""
    rr, rg, gg = factor * m[0, 0], factor * m[0, 1], factor * m[1, 1]
    ror, rog, gor, gog = factor * m[3, 0], factor * m[4, 0], factor * m[3, 1], factor * m[4, 1]
    oo, og, pp = factor * m[3, 3], factor * m[3, 4], factor * m[4, 4]
    for c in range(2):
        for j in range(count):
            i, o = np.uint64(node + j), np.uint64(node + j + 1)
            r, g, s, h = w[c, i], w[2 + c, i], w[c, o], w[2 + c, o]
            out[c * BLOCK + j] += rr * r + rg * g + ror * s + rog * h
            out[(2 + c) * BLOCK + j] += rg * r + gg * g + gor * s + gog * h
            out[(6 + c) * BLOCK + j] += ror * r + gor * g + oo * s + og * h
            out[(8 + c) * BLOCK + j] += rog * r + gog * g + og * s + pp * h
    if w.shape[0] == 6:
        dd, od, ee = factor * m[2, 2], factor * m[5, 2], factor * m[5, 5]
        for c in range(4, 6):
            for j in range(count):
                i, o = np.uint64(node + j), np.uint64(node + j + 1)
                out[c * BLOCK + j] += dd * w[c, i] + od * w[c, o]
                out[(6 + c) * BLOCK + j] += od * w[c, i] + ee * w[c, o]
        if m[0, 2] != 0.0:
            _add_coupled_inertia(w, factor, m, node, count, out)


@embedded
def _add_coupled_inertia(w, factor, m, node, count, out):  # type: ignore[no-untyped-def]
    """Add what the third vector of a node has in common with the others: that of a quintic cable, no r_y."""
    for k in range(6):
        for n in range(6):
            if (k % 3 == 2) != (n % 3 == 2):
                x = factor * m[k, n]
                for c in range(2):
                    to, of = (6 * (k // 3) + 2 * (k % 3) + c) * BLOCK, 2 * (n % 3) + c
                    for j in range(count):
                        out[to + j] += x * w[of, np.uint64(node + j + n // 3)]


@inlined
def body_after(end, body, first):  # type: ignore[no-untyped-def]
    """Where node `end` lies, if not before a body."""
    while first[body + 1] <= end and body + 2 < len(first):
        body += 1
    return body


@inlined
def window_end(start, nodes, body, first):  # type: ignore[no-untyped-def]
    """Where the window ends that begins at node `start`, which lies in `body`.

    Of a body that goes on beyond it, it takes elements in full vectors: a few beside them take a vector's time.
    """
    end = min(start + BLOCK, nodes)
    inside = first[body_after(end, body, first)]
    if end < nodes and inside < end:
        end -= (end - max(start, inside)) % LANES
    return end


@inlined
def _gather(start, end, buffer, f):  # type: ignore[no-untyped-def]
    """Forces on nodes start … end − 1 from those of a window's elements and the one before it."""
    n = end - start
    for k in range(f.shape[0]):
        f[k, start] = buffer[k * BLOCK] + buffer[12 * BLOCK + k]
        for j in range(1, n):
            f[k, np.uint64(start + j)] = buffer[k * BLOCK + j] + buffer[(6 + k) * BLOCK + j - 1]
        buffer[12 * BLOCK + k] = buffer[(6 + k) * BLOCK + n - 1]


@kernel
def elastic_forces(
    formulations: tuple[int, ...],
    q: Array,
    first: Ints,
    kinds: Ints,
    constants: Array,
    buffer: Array,
    f: Array,
) -> None:
    """Elastic forces on all nodes, the gradient of the strain energy.

    Parameters
    ----------
    formulations, first, kinds, constants
        Of `Bodies`.
    q : ndarray, shape (rows, nodes)
    buffer : ndarray, shape (12 * BLOCK + 6,)
        Scratch.
    f : ndarray, shape (rows, nodes)
        Written.
    """
    buffer[12 * BLOCK :] = 0.0
    body, nodes = FIRST_BODY, q.shape[1]
    start = 0
    while start < nodes:
        end = window_end(start, nodes, body, first)
        window_forces(formulations, q, start, end, body, first, kinds, constants, buffer)
        body = body_after(end, body, first)
        _gather(start, end, buffer, f)
        start = end


@kernel
def damping_forces(
    formulations: tuple[int, ...],
    q: Array,
    v: Array,
    first: Ints,
    kinds: Ints,
    constants: Array,
    damping: Array,
    buffer: Array,
    f: Array,
) -> float:
    """Subtract the damping forces of all bodies from f.

    Parameters
    ----------
    formulations, first, kinds, constants, damping
        Of `Bodies`.
    q, v, f : ndarray, shape (rows, nodes)
    buffer : ndarray, shape (12 * BLOCK + 6,)
        Scratch.

    Returns
    -------
    float
        Power that is lost, W.
    """
    power = 0.0
    for b in range(len(kinds)):
        last = first[b + 1] - 1
        for node in range(first[b], last if damping[b] > 0.0 else first[b], BLOCK):
            count = min(BLOCK, last - node)
            element_damping(formulations, kinds[b], q, v, node, count, constants[b], damping[b], buffer)
            for k in range(components(formulations, kinds[b])):
                for j in range(count):
                    one, two = buffer[k * BLOCK + j], buffer[(6 + k) * BLOCK + j]
                    power += one * v[k, node + j] + two * v[k, node + j + 1]
                    f[k, node + j] -= one
                    f[k, node + j + 1] -= two
    return power


@kernel
def strain_energy(
    formulations: tuple[int, ...], q: Array, first: Ints, kinds: Ints, constants: Array
) -> float:
    """Strain energy of all bodies, J."""
    total = 0.0
    for b in range(len(kinds)):
        count = first[b + 1] - 1 - first[b]
        if count > 0:
            total += element_energy(formulations, kinds[b], q, first[b], count, constants[b])
    return total


@kernel
def mass_product(v: Array, first: Ints, masses: Array, buffer: Array, p: Array) -> None:
    """Product of the mass matrix, joints apart, with v, (rows, nodes), written into p."""
    buffer[12 * BLOCK :] = 0.0
    body, nodes = FIRST_BODY, v.shape[1]
    start = 0
    while start < nodes:
        end = window_end(start, nodes, body, first)
        buffer[: 12 * BLOCK] = 0.0
        window_inertia(v, 1.0, start, end, body, first, masses, buffer)
        body = body_after(end, body, first)
        _gather(start, end, buffer, p)
        start = end


@kernel
def kinetic_energy(v: Array, first: Ints, masses: Array) -> float:
    """Kinetic energy of all bodies at velocities v, (rows, nodes), J."""
    total = 0.0
    vectors = v.shape[0] // 2
    for b in range(len(first) - 1):
        m = masses[b]
        if first[b + 1] - first[b] == 1:
            for k in range(v.shape[0]):
                total += 0.5 * m[k // 2, k // 2] * v[k, first[b]] ** 2
        for i in range(first[b], first[b + 1] - 1):
            for k in range(vectors):
                for n in range(vectors):
                    for c in range(2):
                        total += 0.5 * m[k, n] * v[2 * k + c, i] * v[2 * n + c, i]
                        total += m[k, 3 + n] * v[2 * k + c, i] * v[2 * n + c, i + 1]
                        total += 0.5 * m[3 + k, 3 + n] * v[2 * k + c, i + 1] * v[2 * n + c, i + 1]
    return total


@kernel
def block_tangents(
    formulations: tuple[int, ...], q: Array, node: int, count: int, kind: int, constants: Array, buffer: Array
) -> None:
    """Tangents of `count` ≤ TANGENT_BLOCK elements of one kind from a node on.

    Parameters
    ----------
    formulations : tuple of int
        Of `Bodies`.
    q : ndarray, shape (rows, nodes)
    node, count : int
    kind : int
        Number of the kernels, as in `dispatch.KERNELS`.
    constants : ndarray
        The body's row of `Bodies.constants`.
    buffer : ndarray, shape (TANGENT_BUFFER,)
        Output, in the layout of `tangent_blocks`.
    """
    element_tangents(formulations, kind, q, node, count, constants, buffer)


@kernel
def unpack_tangent(buffer: Array, j: int, kind: int, K: Array) -> None:
    """Tangent of element j of a block, (2 rows, 2 rows): the components of node I, then those of node O."""
    rows = K.shape[0] // 2
    own = components(ALL, kind)
    K[:] = 0.0  # a cable among shear elements
    for k in range(2 * own):
        for m in range(k + 1):
            row, column = k // own * rows + k % own, m // own * rows + m % own
            K[row, column] = K[column, row] = buffer[lower(k, m) + j]
