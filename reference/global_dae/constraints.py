"""Joints as constraints Φ q = b(t), linear in the coordinates with a constant Φ.

Vectors of the plane are written as complex numbers here, so that a rotation is a factor: the row of a weld between
gradients is g_B − e^{iΔ} g_A = 0. A joint of n ends has the rows of n − 1 pairs, each end with the next. Rows of one
joint, and of joints that share an end, have vectors in common: Φ Φᴴ is sparse, and diagonal where there are none.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.mesh import BodyMesh
from anctmm.errors import DiscretisationError
from anctmm.jit.compiling import inlined
from anctmm.model.joints import unknown_joint
from anctmm.model.needs import not_offered
from anctmm.model.scene import Clamp, Pin, Prismatic, Scene, Slider, Weld
from reference.global_dae.lu import Factors, Matrix, factorise, solve_factored

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Complex = NDArray[np.complex128]


class Term(NamedTuple):
    """A factor times vector k (0 r, 1 r_x, 2 r_y) of a node."""

    node: int
    vector: int
    factor: complex


class Row(NamedTuple):
    """Sum of terms = its value in the reference, turned by the angle of drive `drive` (−1: fixed)."""

    terms: tuple[Term, ...]
    drive: int = -1


class Rows(NamedTuple):
    """Constraint rows for the kernels.

    Row j has the terms first[j] … first[j + 1] with the factors real + i imag on the components at `place` (x) and
    place + nodes (y) of the flat coordinates; reference (m, 2) is the value of Φ q at t = 0; row driven[k] turns by
    drive drive[k]. `gram` are the factors of Φ Φᴴ; gap, shift and permuted are scratch, complex (m,). Multipliers and
    rows are scaled by `scale` in the linear system.
    """

    first: Ints
    place: Ints
    real: Array
    imag: Array
    reference: Array
    driven: Ints
    drive: Ints
    gram: Factors
    gap: Complex
    shift: Complex
    permuted: Complex
    nodes: int
    scale: float


def drives_of(scene: Scene) -> list[Clamp]:
    """Clamps that turn, in the order their drives are numbered."""
    return [j for j in scene.joints if isinstance(j, Clamp) and j.angle is not None]


def constraint_rows(scene: Scene, bodies: Bodies) -> list[Row]:
    """Rows of all joints.

    Raises
    ------
    DiscretisationError
        If a weld joins a cable to a shear-deformable body: their gradients do not correspond.
    """
    drives = drives_of(scene)
    reference = bodies.reference()
    meshes = {m.body.name: m for m in bodies.meshes}
    rows: list[Row] = []
    for joint in scene.joints:
        ends = [scene.body_end(end) for end in joint.ends]
        nodes = [bodies.node(body.name, side) for body, side in ends]
        vectors = meshes[ends[0][0].name].held // 2  # what lies behind these is free at the ends of beams
        match joint:
            case Clamp(stretch="free"):
                rows.append(_fixed(nodes[0], 0))  # see `directions_of`
            case Clamp():
                drive = _drive_number(joint, drives)
                rows.extend(_fixed(nodes[0], k, drive if k > 0 else -1) for k in range(vectors))
            case Pin():
                rows.extend(_together(nodes, joint.grounded))
            case Weld():
                _refuse_mixed(joint, [meshes[body.name] for body, _ in ends])
                rows.extend(_together(nodes, joint.grounded))
                rows.extend(_aligned(nodes, vectors, reference))
            case Slider() | Prismatic():
                raise not_offered(joint)
            case _:
                raise unknown_joint(joint)
    return rows


class Direction(NamedTuple):
    """A vector of a node that is along the unit vector `along`, turned by the angle of drive `drive` (−1: fixed)."""

    node: int
    vector: int
    along: complex
    drive: int = -1


def directions_of(scene: Scene, bodies: Bodies) -> list[Direction]:
    """Vectors of which clamps hold the direction alone: no constraints with a constant Φ."""
    drives, q = drives_of(scene), bodies.reference()
    found = []
    for joint in scene.joints:
        if isinstance(joint, Clamp) and joint.stretch == "free":
            body, side = scene.body_end(joint.end)
            node, row = bodies.node(body.name, side), bodies.turning_row(body.name)
            g = complex(*q[row : row + 2, node])
            found.append(Direction(node, row // 2, g / abs(g), _drive_number(joint, drives)))
    return found


def _drive_number(clamp: Clamp, drives: Sequence[Clamp]) -> int:
    """Number of the drive of a clamp; −1 without one."""
    return next((k for k, driven in enumerate(drives) if driven is clamp), -1)


def _refuse_mixed(joint: Weld, meshes: list[BodyMesh]) -> None:
    for mesh in meshes[1:]:
        if not mesh.kind.welds_to(meshes[0].kind):
            raise DiscretisationError(
                f"{joint!r} joins {meshes[0].body.name!r} of element {meshes[0].kind.name!r} to {mesh.body.name!r} of "
                f"element {mesh.kind.name!r}; one element kind is needed on all sides of a weld"
            )


def _fixed(node: int, vector: int, drive: int = -1) -> Row:
    """A vector that is known."""
    return Row((Term(node, vector, 1.0),), drive)


def _together(nodes: list[int], grounded: bool) -> Iterator[Row]:
    """Ends at one place; if it is held, each is held by itself."""
    if grounded:
        yield from (_fixed(node, 0) for node in nodes)
    else:
        yield from (Row((Term(a, 0, 1.0), Term(b, 0, -1.0))) for a, b in pairwise(nodes))


def _aligned(nodes: list[int], vectors: int, reference: Array) -> Iterator[Row]:
    """Gradients that keep the angles between them."""
    for a, b in pairwise(nodes):
        turn = _turn(reference, a, b)
        for k in range(1, vectors):
            yield Row((Term(a, k, -turn), Term(b, k, 1.0)))


def _turn(reference: Array, a: int, b: int) -> complex:
    """e^{iΔ} from the axis at node a to that at node b; bodies in line give 1 or −1, free of rounding."""
    turn = complex(*reference[2:4, b]) * complex(*reference[2:4, a]).conjugate()
    turn /= abs(turn)
    return complex(round(turn.real)) if abs(turn.imag) < 8 * np.finfo(float).eps else turn


def compiled_rows(rows: Sequence[Row], bodies: Bodies, scale: float) -> Rows:
    """Rows as arrays for the kernels; `scale` is that of rows and multipliers in the linear system."""
    terms = [term for row in rows for term in row.terms]
    factors = np.array([t.factor for t in terms], dtype=complex)
    first = np.cumsum([0, *(len(row.terms) for row in rows)]).astype(np.int64)
    q = bodies.reference()
    values = [
        sum(t.factor * complex(*q[2 * t.vector : 2 * t.vector + 2, t.node]) for t in r.terms) for r in rows
    ]
    driven = [j for j, row in enumerate(rows) if row.drive >= 0]
    scratch = np.zeros((3, len(rows)), dtype=complex)
    return Rows(
        first=first,
        place=np.array([2 * t.vector * bodies.nodes + t.node for t in terms], dtype=np.int64),
        real=factors.real.copy(),
        imag=factors.imag.copy(),
        reference=np.array([[complex(v).real, complex(v).imag] for v in values]).reshape(len(rows), 2),
        driven=np.array(driven, dtype=np.int64),
        drive=np.array([rows[j].drive for j in driven], dtype=np.int64),
        gram=_gram(rows),
        gap=scratch[0],
        shift=scratch[1],
        permuted=scratch[2],
        nodes=bodies.nodes,
        scale=scale,
    )


def _gram(rows: Sequence[Row]) -> Factors:
    """Factors of Φ Φᴴ, (m, m)."""
    number: dict[tuple[int, int], int] = {}
    j, i, factor = [], [], []
    for k, row in enumerate(rows):
        for term in row.terms:
            j.append(k)
            i.append(number.setdefault((term.node, term.vector), len(number)))
            factor.append(complex(term.factor))
    phi = sparse.csr_array((np.array(factor, dtype=complex), (j, i)), shape=(len(rows), len(number)))
    return factorise(Matrix(phi @ phi.conj().T), np.arange(len(rows))[:, None])


@inlined
def prescribe(rows: Rows, angles: Array, n: int, b: Array, rate: Array, acceleration: Array) -> None:
    """b, ḃ, b̈ of the driven rows, each (m, 2), from row n of cos θ, sin θ, θ', θ'' of the drives, (steps, drives, 4).

    With the reference value g: b = e^{iθ} g, ḃ = iθ' b, b̈ = (iθ'' − θ'²) b.
    """
    for k in range(len(rows.driven)):
        j, d = rows.driven[k], rows.drive[k]
        cos, sin, w, e = angles[n, d, 0], angles[n, d, 1], angles[n, d, 2], angles[n, d, 3]
        gx, gy = rows.reference[j, 0], rows.reference[j, 1]
        x, y = cos * gx - sin * gy, sin * gx + cos * gy
        b[j, 0], b[j, 1] = x, y
        rate[j, 0], rate[j, 1] = -w * y, w * x
        acceleration[j, 0], acceleration[j, 1] = -e * y - w * w * x, e * x - w * w * y


@inlined
def scale_driven(rows: Rows, acceleration: Array, right: Array, at: int) -> None:
    """Put s b̈ of the driven rows into a right-hand side, whose constraint rows begin at `at`; the others stay zero."""
    for k in range(len(rows.driven)):
        j = rows.driven[k]
        right[at + 2 * j] = rows.scale * acceleration[j, 0]
        right[at + 2 * j + 1] = rows.scale * acceleration[j, 1]


@inlined
def misfit(rows: Rows, j: int, q: Array, b: Array) -> tuple[float, float]:
    """(Φ q − b) of row j; q flat."""
    x, y = -b[j, 0], -b[j, 1]
    for t in range(rows.first[j], rows.first[j + 1]):
        i = rows.place[t]
        u, v = q[i], q[i + rows.nodes]
        x += rows.real[t] * u - rows.imag[t] * v
        y += rows.imag[t] * u + rows.real[t] * v
    return x, y


@inlined
def add_transposed(rows: Rows, j: int, x: float, y: float, f: Array) -> None:
    """Add Φ_jᵀ (x, y) to f, flat."""
    for t in range(rows.first[j], rows.first[j + 1]):
        i = rows.place[t]
        f[i] += rows.real[t] * x + rows.imag[t] * y
        f[i + rows.nodes] += rows.real[t] * y - rows.imag[t] * x


@inlined
def project(rows: Rows, q: Array, b: Array) -> None:
    """q ← q − Φᵀ (Φ Φᵀ)⁻¹ (Φ q − b)."""
    for j in range(len(rows.gap)):
        x, y = misfit(rows, j, q, b)
        rows.gap[j] = complex(x, y)
    solve_factored(rows.gram, rows.gap, rows.shift, rows.permuted)
    for j in range(len(rows.shift)):
        add_transposed(rows, j, -rows.shift[j].real, -rows.shift[j].imag, q)
