"""Loads and connectors as tables: forces, stiffness, energy and work of all of them.

Each acts on vectors that are linear in the coordinates, `Forms`: a force on a position, a torque on a direction, a
spring on the difference of two positions, a rotational spring on two directions. A connector has a measure m, of a
spring its length, of a rotational spring the angle of the second direction against the first, whole turns included.
Its force N = k (m − l) + c (ṁ − l̇) + preload, or a law, acts against m.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import UnsupportedError, shown
from anctmm.kernels.by_address import by_address
from anctmm.kernels.intrinsics import call_number, matrix, vector
from anctmm.kernels.options import inlined, part
from anctmm.model.connectors import Connector, RotationalSpring, Spring, ends_of, name_of
from anctmm.model.expressions import Vector
from anctmm.model.loads import Force, LineLoad, Load, Torque, varies
from anctmm.model.places import Place
from anctmm.system.body_meshes import BeamMesh
from anctmm.system.laws import compiled_law
from anctmm.system.matrix import add
from anctmm.system.mesh import GroundPlace, JointPlace, Mesh
from anctmm.system.numbering import Numbering

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

DEAD, TORQUE, FOLLOWER = 0, 1, 2
SPRING, TURN = 0, 1
#: Relative change of a law's arguments by which it is differentiated: a central difference.
DIFFERENCE = 1e-6


@by_address
class Forms(NamedTuple):
    """Vectors Σ A x + b, for kernels.

    Parameters
    ----------
    start : ndarray of int, shape (forms + 1,)
        Where the terms of each begin.
    node, component : ndarray of int, shape (terms,)
        Node of x, and its first component.
    A : ndarray, shape (terms, dim, dim)
    b : ndarray, shape (forms, dim)
    """

    start: Ints
    node: Ints
    component: Ints
    A: Array
    b: Array


@by_address
class Acting(NamedTuple):
    """Loads that vary and connectors, for kernels.

    Parameters
    ----------
    forms : Forms
    load_kind : ndarray of int, shape (loads,)
        DEAD, TORQUE or FOLLOWER.
    load_form, load_turns : ndarray of int, shape (loads,)
        Form that it acts on, and of a follower the direction that it turns with, or −1.
    rest : ndarray, shape (loads, dim)
        That direction in the reference, of length 1.
    kind : ndarray of int, shape (connectors,)
        SPRING or TURN.
    one, two : ndarray of int, shape (connectors,)
        Form of a spring, or both directions; −1 is the ground.
    numbers : ndarray, shape (connectors, 3)
        Stiffness, damping, preload.
    law : ndarray of int, shape (connectors,)
        Addresses of compiled laws, or 0.
    unit : ndarray, shape (connectors,)
        Size of a measure, m or rad.
    code_start : ndarray of int, shape (loads + connectors + 1,)
        Where the codes of each begin.
    codes : ndarray of int
        Of its terms p and q ≤ p in the matrix, those of the second form behind those of the first.
    part : ndarray, shape (1,)
        Part of preloads and of free measures that acts: 1 but in statics.
    placed : ndarray, shape (connectors,)
        Measure in the reference; angles are 0 there.
    load_memory : ndarray, shape (2, loads, dim)
        Forces and places at the last call of `work_done`.
    now, memory : ndarray, shape (connectors, 5)
        Force, measure, stored energy, resisting force and elongation: at the last evaluation, and at the last call of
        `work_done`.
    """

    forms: Forms
    load_kind: Ints
    load_form: Ints
    load_turns: Ints
    rest: Array
    kind: Ints
    one: Ints
    two: Ints
    numbers: Array
    law: Ints
    unit: Array
    code_start: Ints
    codes: Ints
    part: Array
    placed: Array
    load_memory: Array
    now: Array
    memory: Array


class Writer:
    """Collects what acts on a scene.

    Parameters
    ----------
    mesh : Mesh
    loads : sequence of Load
        Those that vary, see `varies`.
    connectors : sequence of Connector
    """

    def __init__(self, mesh: Mesh, loads: Sequence[Load], connectors: Sequence[Connector]) -> None:
        self.mesh, self.connectors = mesh, connectors
        self.vectors = list[Vector]()
        self.loads = [self._load(load) for load in loads]
        self.ends = [self._connector(connector) for connector in connectors]
        self.laws = [
            None if c.law is None else compiled_law(name_of(c), c.law, self._unit(n))
            for n, c in enumerate(connectors)
        ]

    def _add(self, vector: Vector) -> int:
        self.vectors.append(vector)
        return len(self.vectors) - 1

    def _load(self, load: Load) -> tuple[int, int, int]:
        """Kind of a load, form that it acts on, and direction that it turns with."""
        if isinstance(load, LineLoad):
            return DEAD, self._add(sum_along(self.mesh, load.body)), -1
        place = JointPlace(self.mesh, self.mesh.scene.place(load.end))
        match load:
            case Torque():
                if self.mesh.dim == 3:
                    raise UnsupportedError(f"{shown(load)} is in space; a Force is allowed there")
                return TORQUE, self._add(place.direction), -1
            case Force(follower=True):
                if self.mesh.dim == 3:
                    raise UnsupportedError(
                        f"{shown(load)} follows its place in space; a dead Force is allowed there"
                    )
                return FOLLOWER, self._add(place.position), self._add(place.direction)
            case _:
                return DEAD, self._add(place.position), -1

    def _connector(self, connector: Connector) -> tuple[int, int, int]:
        """Kind of a connector, and its forms."""
        first, second = ends_of(self.mesh.scene, connector)
        a = JointPlace(self.mesh, first)
        match connector:
            case Spring():
                b: Any = (
                    JointPlace(self.mesh, second)
                    if isinstance(second, Place)
                    else GroundPlace(self.mesh, second or ())
                )
                return SPRING, self._add(b.position - a.position), -1
            case RotationalSpring():
                if self.mesh.dim == 3:
                    raise UnsupportedError(f"{name_of(connector)} is in space; a Spring is allowed there")
                one = self._add(a.direction)
                if second is None:
                    return TURN, -1, one
                assert isinstance(second, Place)  # a rotational spring has no point of the ground
                return TURN, one, self._add(JointPlace(self.mesh, second).direction)

    @property
    def coupled(self) -> list[list[int]]:
        """Numbers of the vectors that each load or connector couples."""
        return [sorted({x for x, _ in self._terms(item)}) for item in (*self.loads, *self.ends)]

    def _terms(self, item: tuple[int, int, int]) -> list[tuple[int, Array]]:
        return [(x, A) for form in item[1:] if form >= 0 for (x, _), A in self.vectors[form].terms.items()]

    def _placed(self, n: int) -> float:
        """Length of a spring in the reference, m, or the angle between its directions, rad."""
        kind, one, two = self.ends[n]
        if kind == SPRING:
            return float(np.sqrt((self.vectors[one].start ** 2).sum()))
        (a, b), (x, y) = (1.0, 0.0) if one < 0 else self.vectors[one].start, self.vectors[two].start
        return float(np.arctan2(a * y - b * x, a * x + b * y))

    def _unit(self, n: int) -> float:
        return self._placed(n) if self.ends[n][0] == SPRING else 1.0

    def tables(self, numbering: Numbering) -> Acting:
        """Tables for kernels."""
        dim, codes, start = self.mesh.dim, list[Ints](), [0]
        for item in (*self.loads, *self.ends):
            x = np.array([x for x, _ in self._terms(item)], dtype=np.int64)
            p, q = np.tril_indices(len(x))
            codes.append(np.where(p == q, _own(numbering.codes(x[p], x[q])), numbering.codes(x[p], x[q])))
            start.append(start[-1] + len(p))
        rest = np.zeros((len(self.loads), dim))
        for n, (kind, _, turns) in enumerate(self.loads):
            if kind == FOLLOWER:
                rest[n] = self.vectors[turns].start / np.sqrt((self.vectors[turns].start ** 2).sum())
        loads: Any = np.array(self.loads, dtype=np.int64).reshape(-1, 3)
        ends: Any = np.array(self.ends, dtype=np.int64).reshape(-1, 3)
        count, springs = len(loads), len(ends)
        numbers = [(c.stiffness, c.damping, c.preload) for c in self.connectors]
        addresses = [0 if law is None else law.address for law in self.laws]
        return Acting(  # type: ignore[call-arg]
            forms_of(self.mesh, self.vectors), *loads.T.copy(), rest, *ends.T.copy(),
            np.array(numbers, dtype=float).reshape(-1, 3), np.array(addresses, dtype=np.int64),
            np.array([self._unit(n) for n in range(springs)], dtype=float), np.array(start, dtype=np.int64),
            np.concatenate([np.empty(0, np.int64), *codes]), np.ones(1),
            np.array([self._placed(n) for n in range(springs)], dtype=float),
            np.zeros((2, count, dim)), np.zeros((springs, 5)), np.zeros((springs, 5)),
        )  # fmt: skip


def _own(codes: Ints) -> Ints:
    """Codes of vectors with themselves: their matrix is added once."""
    return np.where(codes >= 0, codes & ~np.int64(3), codes)


def forms_of(mesh: Mesh, vectors: Iterable[Vector]) -> Forms:
    """Vectors as kernels want them."""
    start, places, A, b = [0], list[int](), list[Array](), list[Array]()
    for one in vectors:
        places += [x for x, _ in one.terms]
        A += list(one.terms.values())
        b.append(one.constants.get(None, np.zeros(mesh.dim)))
        start.append(len(places))
    x = np.array(places, dtype=np.int64)
    return Forms(
        np.array(start, dtype=np.int64), x // mesh.slots, x % mesh.slots * mesh.dim,
        np.array(A, dtype=float).reshape(-1, mesh.dim, mesh.dim), np.array(b, dtype=float).reshape(-1, mesh.dim),
    )  # fmt: skip


def sum_along(mesh: Mesh, name: str) -> Vector:
    """∫ r dx along a beam, x its undeformed length: what a force per length acts on."""
    body, eye = mesh.bodies[name], np.eye(mesh.dim)
    if not isinstance(body, BeamMesh):
        return mesh.expression(name, body.position(0.5)) * body.body.length  # type: ignore[union-attr]
    weights = body.spread(body.element.load).ravel()
    return mesh.expression(name, {k: float(w) * eye for k, w in enumerate(weights) if w != 0.0})


def dead_forces(mesh: Mesh, loads: Iterable[Load]) -> Array:
    """Forces of gravity and of loads that never change, (rows, nodes), N."""
    found = mesh.vectors_of(mesh.weight).copy()
    for load in loads:
        if varies(load):
            continue
        along = isinstance(load, LineLoad)
        form = (
            sum_along(mesh, load.body)  # type: ignore[union-attr]
            if along
            else JointPlace(mesh, mesh.scene.place(load.end)).position  # type: ignore[union-attr]
        )
        for (x, _), A in form.terms.items():
            found[x] += A.T @ np.asarray(load.value)
    return mesh.flat_of(found)


@inlined
def form_at(forms, n, q, out):  # type: ignore[no-untyped-def]
    """Vector n at coordinates q."""
    for k in range(len(out)):
        out[k] = forms.b[n, k]
    add_rate(forms, n, q, out)


@inlined
def form_rate(forms, n, v, out):  # type: ignore[no-untyped-def]
    """Rate of vector n at velocities v."""
    for k in range(len(out)):
        out[k] = 0.0
    add_rate(forms, n, v, out)


@inlined
def add_rate(forms, n, v, out):  # type: ignore[no-untyped-def]
    """Add Σ A v to a vector."""
    for t in range(forms.start[n], forms.start[n + 1]):
        i, a = forms.node[t], forms.component[t]
        for k in range(len(out)):
            for m in range(len(out)):
                out[k] += forms.A[t, k, m] * v[a + m, i]


@inlined
def push(forms, n, force, factor, f):  # type: ignore[no-untyped-def]
    """Add the generalized force of a force on vector n, times a factor, to f."""
    for t in range(forms.start[n], forms.start[n + 1]):
        i, a = forms.node[t], forms.component[t]
        for m in range(len(force)):
            s = 0.0
            for k in range(len(force)):
                s += forms.A[t, k, m] * force[k]
            f[a + m, i] += factor * s


@part
def load_at(space: tuple[int, ...], acting: Acting, n: int, q: Array, value: Array, force: Array) -> None:
    """Force of load n on its form, of its value: a force, or a moment as the first number.

    δθ = (g × δg)/|g|², so a moment M on the direction g gives M g⊥/|g|².
    """
    for k in range(len(space)):
        force[k] = value[k]
    g = vector(space)
    if acting.load_kind[n] == TORQUE:
        form_at(acting.forms, acting.load_form[n], q, g)
        m = value[0] / (g[0] * g[0] + g[1] * g[1])
        force[0], force[1] = -m * g[1], m * g[0]
    elif acting.load_kind[n] == FOLLOWER:
        form_at(acting.forms, acting.load_turns[n], q, g)
        size, x, y = np.sqrt(g[0] * g[0] + g[1] * g[1]), acting.rest[n, 0], acting.rest[n, 1]
        c, s = (g[0] * x + g[1] * y) / size, (g[1] * x - g[0] * y) / size
        force[0], force[1] = c * value[0] - s * value[1], s * value[0] + c * value[1]


def add_loads(space: tuple[int, ...], acting: Acting, q: Array, values: Array, f: Array) -> None:
    """Add the forces of loads to f, (rows, nodes); values, (loads, dim)."""
    force = vector(space)
    for n in range(len(acting.load_kind)):
        load_at(space, acting, n, q, values[n], force)
        push(acting.forms, acting.load_form[n], force, 1.0, f)


@inlined
def angle_between(a, b):  # type: ignore[no-untyped-def]
    """Angle from a to b, rad, in (−π, π]."""
    return np.arctan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])


@part
def measure(space, acting, n, q, a, b):  # type: ignore[no-untyped-def]
    """Measure of connector n at q, with its gradients by both forms in a and b.

    An angle is that of `now` within half a turn.
    """
    if acting.kind[n] == SPRING:
        form_at(acting.forms, acting.one[n], q, a)
        s = 0.0
        for k in range(len(space)):
            s += a[k] * a[k]
        length = np.sqrt(s)
        for k in range(len(space)):
            a[k] /= max(length, 1e-300)
            b[k] = 0.0
        return length
    a[0], a[1] = 1.0, 0.0
    if acting.one[n] >= 0:
        form_at(acting.forms, acting.one[n], q, a)
    form_at(acting.forms, acting.two[n], q, b)
    angle, known = angle_between(a, b) - acting.placed[n], acting.now[n, 1]
    angle += 2.0 * np.pi * np.round((known - angle) / (2.0 * np.pi))
    s, t = 1.0 / (a[0] * a[0] + a[1] * a[1]), 1.0 / (b[0] * b[0] + b[1] * b[1])
    a[0], a[1] = a[1] * s, -a[0] * s
    b[0], b[1] = -b[1] * t, b[0] * t
    return angle


@part
def measure_rate(space, acting, n, v, a, b):  # type: ignore[no-untyped-def]
    """Rate of the measure at velocities v, from its gradients."""
    d, rate = vector(space), 0.0
    if acting.one[n] >= 0:
        form_rate(acting.forms, acting.one[n], v, d)
        for k in range(len(space)):
            rate += a[k] * d[k]
    if acting.two[n] >= 0:
        form_rate(acting.forms, acting.two[n], v, d)
        for k in range(len(space)):
            rate += b[k] * d[k]
    return rate


@inlined
def free_measure(acting, n, free):  # type: ignore[no-untyped-def]
    """Free measure and its rate, of which in statics only a part acts."""
    part, placed = acting.part[0], acting.placed[n] if acting.kind[n] == SPRING else 0.0
    return placed + part * (free[n, 0] - placed), part * free[n, 1]


@inlined
def force_of(acting, n, x, rate, t):  # type: ignore[no-untyped-def]
    """Force of connector n at an elongation x and its rate."""
    if acting.law[n] != 0:
        preload = 0.0 if acting.part[0] == 1.0 else call_number(acting.law[n], 0.0, 0.0, t)
        return call_number(acting.law[n], x, rate, t) - (1.0 - acting.part[0]) * preload
    return acting.numbers[n, 0] * x + acting.numbers[n, 1] * rate + acting.part[0] * acting.numbers[n, 2]


@part
def slopes(acting, n, x, rate, t):  # type: ignore[no-untyped-def]
    """Derivatives of the force by the elongation and by its rate."""
    if acting.law[n] == 0:
        return acting.numbers[n, 0], acting.numbers[n, 1]
    h, g = DIFFERENCE * max(abs(x), acting.unit[n]), DIFFERENCE * max(abs(rate), acting.unit[n])
    law = acting.law[n]
    by_x = (call_number(law, x + h, rate, t) - call_number(law, x - h, rate, t)) / (2.0 * h)
    by_rate = (call_number(law, x, rate + g, t) - call_number(law, x, rate - g, t)) / (2.0 * g)
    return by_x, by_rate


def add_connectors(
    space: tuple[int, ...], acting: Acting, q: Array, v: Array, free: Array, t: float, f: Array
) -> None:
    """Add the forces of connectors at q and v to f; free: free measures and their rates, (connectors, 2)."""
    a, b = vector(space), vector(space)
    for n in range(len(acting.kind)):
        m = measure(space, acting, n, q, a, b)
        rate = measure_rate(space, acting, n, v, a, b)
        rest, rest_rate = free_measure(acting, n, free)
        x, change = m - rest, rate - rest_rate
        force = force_of(acting, n, x, change, t)
        if acting.one[n] >= 0:
            push(acting.forms, acting.one[n], a, -force, f)
        if acting.two[n] >= 0:
            push(acting.forms, acting.two[n], b, -force, f)
        acting.now[n, 0], acting.now[n, 1] = force, m
        stored = 0.0
        if acting.law[n] == 0:
            stored = (0.5 * acting.numbers[n, 0] * x + acting.part[0] * acting.numbers[n, 2]) * x
        acting.now[n, 2] = stored
        acting.now[n, 3], acting.now[n, 4] = 0.5 * (force - force_of(acting, n, x, -change, t)), x


def add_acting_tangents(
    size: tuple[int, ...],
    space: tuple[int, ...],
    acting: Acting,
    q: Array,
    v: Array,
    inputs: Any,
    time: int,
    stiffness: float,
    damping: float,
    flat: Array,
) -> None:
    """Add stiffness · K + damping · D of loads and connectors to the matrix; of followers the symmetric part."""
    own, mixed, other = matrix(space, space), matrix(space, space), matrix(space, space)
    free, t = inputs.free[time], inputs.t[time]
    loads = len(acting.load_kind)
    for n in range(loads):
        if acting.load_kind[n] != DEAD:
            _load_stiffness(space, acting, n, q, inputs.loads[time, n], stiffness, own, mixed, other)
            add_forms(
                acting, n, acting.load_form[n], acting.load_turns[n], own, mixed, other, flat, len(size)
            )
    for n in range(len(acting.kind)):
        _connector_stiffness(space, acting, n, q, v, free, t, stiffness, damping, own, mixed, other)
        add_forms(acting, loads + n, acting.one[n], acting.two[n], own, mixed, other, flat, len(size))


@part
def add_forms(acting, actor, one, two, own, mixed, other, flat, size):  # type: ignore[no-untyped-def]
    """Add the matrix of a load or connector by its two forms to the matrix of the unknowns."""
    forms, code = acting.forms, acting.code_start[actor]
    first = forms.start[one + 1] - forms.start[one] if one >= 0 else 0
    second = forms.start[two + 1] - forms.start[two] if two >= 0 else 0
    for p in range(first + second):
        x = forms.start[one] + p if p < first else forms.start[two] + p - first
        for r in range(p + 1):
            y = forms.start[one] + r if r < first else forms.start[two] + r - first
            for k in range(own.shape[0]):
                for m in range(own.shape[0]):
                    s = 0.0
                    for i in range(own.shape[0]):
                        for j in range(own.shape[0]):
                            if p < first:
                                h = own[i, j]
                            elif r < first:
                                h = mixed[j, i]
                            else:
                                h = other[i, j]
                            s += forms.A[x, i, k] * h * forms.A[y, j, m]
                    add(flat, size, acting.codes[code], k, m, s)
            code += 1


@inlined
def angle_curvature(x, y, factor, out):  # type: ignore[no-untyped-def]
    """Second derivatives of the angle of (x, y), times a factor."""
    s = x * x + y * y
    xx, xy = 2.0 * x * y / (s * s), (y * y - x * x) / (s * s)
    out[0, 0], out[0, 1], out[1, 0], out[1, 1] = factor * xx, factor * xy, factor * xy, -factor * xx


@part
def _load_stiffness(space, acting, n, q, value, factor, own, mixed, other):  # type: ignore[no-untyped-def]
    """Minus the derivative of a torque or follower force by its forms, symmetrised."""
    g = vector(space)
    _clear(own, mixed, other)
    if acting.load_kind[n] == TORQUE:
        form_at(acting.forms, acting.load_form[n], q, g)
        angle_curvature(g[0], g[1], -factor * value[0], own)
        return
    force = vector(space)
    load_at(space, acting, n, q, value, force)
    form_at(acting.forms, acting.load_turns[n], q, g)
    s = g[0] * g[0] + g[1] * g[1]
    by_x, by_y = -g[1] / s, g[0] / s
    mixed[0, 0], mixed[0, 1] = 0.5 * factor * force[1] * by_x, 0.5 * factor * force[1] * by_y
    mixed[1, 0], mixed[1, 1] = -0.5 * factor * force[0] * by_x, -0.5 * factor * force[0] * by_y


@part
def _clear(own, mixed, other):  # type: ignore[no-untyped-def]
    for i in range(own.shape[0]):
        for j in range(own.shape[0]):
            own[i, j] = mixed[i, j] = other[i, j] = 0.0


@part
def _connector_stiffness(space, acting, n, q, v, free, t, stiffness, damping, own, mixed, other):  # type: ignore[no-untyped-def]
    """Derivative of the force of a connector by its forms; that of a damper's direction is left out."""
    a, b = vector(space), vector(space)
    m = measure(space, acting, n, q, a, b)
    rest, rest_rate = free_measure(acting, n, free)
    x, change = m - rest, measure_rate(space, acting, n, v, a, b) - rest_rate
    by_x, by_rate = slopes(acting, n, x, change, t)
    k, force = stiffness * by_x + damping * by_rate, stiffness * force_of(acting, n, x, change, t)
    _clear(own, mixed, other)
    if acting.kind[n] == SPRING:
        across = force / max(m, 1e-300)
        for i in range(len(space)):
            for j in range(len(space)):
                own[i, j] = (k - across) * a[i] * a[j] + (across if i == j else 0.0)
        return
    g = vector(space)
    if acting.one[n] >= 0:
        form_at(acting.forms, acting.one[n], q, g)
        angle_curvature(g[0], g[1], -force, own)
    form_at(acting.forms, acting.two[n], q, g)
    angle_curvature(g[0], g[1], force, other)
    for i in range(len(space)):
        for j in range(len(space)):
            own[i, j] += k * a[i] * a[j]
            mixed[i, j] = k * a[i] * b[j]
            other[i, j] += k * b[i] * b[j]


@part
def connector_energy(acting: Acting) -> float:
    """Energy of all connectors at the last evaluation, J."""
    total = 0.0
    for n in range(len(acting.kind)):
        total += acting.now[n, 2]
    return total


@part
def remember(acting: Acting) -> None:
    """Take the state of the last evaluation as that from which `work_done` counts."""
    for n in range(len(acting.kind)):
        for k in range(5):
            acting.memory[n, k] = acting.now[n, k]


def work_done(
    space: tuple[int, ...], acting: Acting, moving: bool, q: Array, inputs: Any, time: int, out: Array
) -> None:
    """Add to out the work of loads and connectors beside their energies, and that of damping, J; if `moving`.

    Since the last call, by the trapezoidal rule.
    """
    for n in range(len(acting.kind)):
        now, memory = acting.now[n], acting.memory[n]
        if moving:
            out[0] += now[2] - memory[2] - 0.5 * (now[0] + memory[0]) * (now[1] - memory[1])
            out[1] -= 0.5 * (now[3] + memory[3]) * (now[4] - memory[4])
    remember(acting)
    force, place = vector(space), vector(space)
    for n in range(len(acting.load_kind)):
        load_at(space, acting, n, q, inputs.loads[time, n], force)
        form_at(acting.forms, acting.load_form[n], q, place)
        for k in range(len(space)):
            if moving:
                way = place[k] - acting.load_memory[1, n, k]
                out[0] += 0.5 * (force[k] + acting.load_memory[0, n, k]) * way
            acting.load_memory[0, n, k], acting.load_memory[1, n, k] = force[k], place[k]


def power(
    space: tuple[int, ...],
    acting: Acting,
    q: Array,
    v: Array,
    inputs: Any,
    time: int,
    out: Array,
) -> None:
    """Add to out the power of loads and connectors beside the rate of their energies, and that of damping, W.

    Of a connector: −N ṁ + dE/dt with dE/dt = (k x + preload) ẋ, and −½ [N(x, ẋ) − N(x, −ẋ)] ẋ.
    """
    a, b = vector(space), vector(space)
    free, t = inputs.free[time], inputs.t[time]
    for n in range(len(acting.kind)):
        m = measure(space, acting, n, q, a, b)
        rate = measure_rate(space, acting, n, v, a, b)
        rest, rest_rate = free_measure(acting, n, free)
        x, change = m - rest, rate - rest_rate
        force = force_of(acting, n, x, change, t)
        kept = acting.numbers[n, 0] * x + acting.part[0] * acting.numbers[n, 2]
        if acting.law[n] != 0:
            kept = 0.0
        out[0] += kept * change - force * rate
        out[1] -= 0.5 * (force - force_of(acting, n, x, -change, t)) * change
        acting.now[n, 1] = m
    for n in range(len(acting.load_kind)):
        load_at(space, acting, n, q, inputs.loads[time, n], a)
        form_rate(acting.forms, acting.load_form[n], v, b)
        for k in range(len(space)):
            out[0] += a[k] * b[k]
