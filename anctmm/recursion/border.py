"""Rigid bodies: elements without stiffness, held in shape by multipliers found with the recursion's sweeps.

A rigid body has the coordinates r_I, t_I, r_O, t_O of a cable element and five constraints, which leave it three of
freedom:

    (r_O − r_I)/l − t_I = 0,    t_O − t_I = 0,    |t_I|² = 1.

To the recursion it is an element like any other, so that joints of every kind stay as they are, and the mass is
factored once; with three coordinates of its own, a bar's position and angle, the mass would turn with it and all
factors would have to be found anew at each step. With vectors of the plane as complex numbers, x + iy, the first two
constraints are a constant real matrix J, and a sweep under loads Jᵀz answers Y z, Y = M⁻¹Jᵀ found once. A load λ t_c on
t_c of body c is answered by y_c t_c λ, less the part that J forbids. So z and λ of

    J a = 0,    Re(t̄_b a_b) = −|ṫ_b|²

follow from small systems: z from the constant S = J Y, λ from A_bc = Re(t̄_b C_bc t_c), where C are the answers y_c
at t_b. They cost as many operations as rigid bodies times nodes: meant for a few of them. Positions and velocities
are projected in the same way after each step, so that nothing drifts.

Constraints may be void, as on a clamped body, or depend on each other, as of two welded ones: S is inverted in the
generalized sense, and pivots of A that vanish are passed over. What they would have changed stays as it is then: right
where nothing had to change, and wrong where a linkage locks. So shapes are looked at again after the projection, at
each step.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.jit.compiling import inlined, kernel
from anctmm.recursion.riccati import mass_factors, solve

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Ints = NDArray[np.int64]

#: Parts of the unconstrained answer below which a constraint is void or follows from others.
VOID = 1e-9
#: Newton's corrections of |t|² = 1 after a step, at most: from an error of h³ the second reaches rounding; a body that
#: turns by half a radian in a step needs five.
CORRECTIONS = 10
#: Correction of |t|² = 1 below which its square, the error left, is rounding.
ENOUGH = 1e-8
#: Error of shape below which it is rounding: only drives and the start bring more, since J q, like q, is summed up.
OFF = 1e-14
#: Strain of a rigid body above which its shape is not kept: Newton's iteration ends at 1e-16, or does not converge.
KEPT = 1e-6


class Rigid(NamedTuple):
    """What kernels need of the rigid bodies, m of them.

    Parameters
    ----------
    nodes : ndarray of int, shape (m,)
        First node of each; the second follows.
    length : ndarray, shape (m,)
        m.
    shape : ndarray of complex, shape (2m, vectors, nodes)
        Y: answers to unit loads on both shape constraints of each body.
    turn : ndarray of complex, shape (m, vectors, nodes)
        y: answers to a unit load on t_I of each, less what J forbids.
    inverse : ndarray of complex, shape (2m, 2m)
        S⁺.
    coupling : ndarray of complex, shape (2m, m)
        z that takes what J forbids of them.
    direct : ndarray of complex, shape (m, m)
        C.
    size : ndarray, shape (m,)
        Diagonal of the answers y at t_I, before J forbids anything.
    z, residual : ndarray of complex, shape (2m,)
        Multipliers, and J u.
    load : ndarray of complex, shape (m,)
        t_c λ_c.
    unknown : ndarray, shape (m,)
        λ.
    matrix : ndarray, shape (m, m)
        Scratch for A.
    """

    nodes: Ints
    length: Array
    shape: Complex
    turn: Complex
    inverse: Complex
    coupling: Complex
    direct: Complex
    size: Array
    z: Complex
    residual: Complex
    load: Complex
    unknown: Array
    matrix: Array


def rigid_bodies(chain: Chain) -> list[int]:
    """Places of the rigid bodies in a chain."""
    return [b for b, mesh in enumerate(chain.bodies.meshes) if mesh.kind.rigid]


def shape_residual(nodes: Ints, length: Array, u: Complex) -> Complex:
    """J u of fields (vectors, nodes), (2m,): readable twin of `_residual`."""
    one, two = u[:, nodes], u[:, nodes + 1]
    return np.stack([(two[0] - one[0]) / length - one[1], two[1] - one[1]], axis=1).ravel()


def rigid_system(chain: Chain) -> Rigid | None:
    """Constants of a chain's rigid bodies; None where there is none: then nothing of this module is compiled."""
    bodies, places = chain.bodies, rigid_bodies(chain)
    if not places:
        return None
    m, factors = len(places), mass_factors(chain)
    nodes = bodies.first[places]
    length = np.array([bodies.meshes[b].element.l for b in places])

    def answer(loads: list[tuple[int, int, float]]) -> Complex:
        f = np.zeros((bodies.rows, bodies.nodes))
        for vector, node, value in loads:
            f[2 * vector, node] = value
        a = solve(factors, f)
        return np.asarray(a[::2] + 1j * a[1::2])

    shape = []
    for i, l in zip(nodes, length, strict=True):  # noqa: E741
        shape.append(answer([(0, i + 1, 1.0 / l), (0, i, -1.0 / l), (1, i, -1.0)]))
        shape.append(answer([(1, i + 1, 1.0), (1, i, -1.0)]))
    free = np.stack([answer([(1, i, 1.0)]) for i in nodes])
    S = np.stack([shape_residual(nodes, length, y) for y in shape], axis=1)
    inverse = _generalized_inverse(S)
    coupling = -inverse @ np.stack([shape_residual(nodes, length, y) for y in free], axis=1)
    turn = free + np.tensordot(coupling.T, np.stack(shape), 1)
    return Rigid(
        nodes,
        length,
        np.stack(shape),
        turn,
        inverse,
        coupling,
        np.ascontiguousarray(turn[:, 1, nodes].T),
        np.ascontiguousarray(free[np.arange(m), 1, nodes].real),
        np.zeros(2 * m, complex),
        np.zeros(2 * m, complex),
        np.zeros(m, complex),
        np.zeros(m),
        np.zeros((m, m)),
    )


def _generalized_inverse(S: Complex) -> Complex:
    """Inverse of a Hermitian matrix on what is not void, by its diagonal made dimensionless."""
    diagonal = np.diagonal(S).real
    scale = np.zeros(len(S))
    sound = diagonal > VOID * diagonal.max()
    scale[sound] = 1.0 / np.sqrt(diagonal[sound])
    D = np.outer(scale, scale)
    return np.asarray(D * np.linalg.pinv(D * S, rcond=VOID, hermitian=True))


def project(rigid: Rigid, q: Array, a: Array) -> Array:
    """The part of accelerations a, (rows, nodes), that the constraints of q linearised allow; readable, for any a."""
    u, t = a[::2] + 1j * a[1::2], (q[::2] + 1j * q[1::2])[1, rigid.nodes]
    u = u - np.tensordot(rigid.inverse @ shape_residual(rigid.nodes, rigid.length, u), rigid.shape, 1)
    direct = (np.conj(t)[:, None] * rigid.direct * t[None, :]).real
    unknown = np.linalg.lstsq(direct, -(np.conj(t) * u[1, rigid.nodes]).real, rcond=VOID)[0]
    u = u + np.tensordot(t * unknown, rigid.turn, 1)
    return np.stack([u.real, u.imag], axis=1).reshape(a.shape)


@kernel
def constrain_accelerations(rigid: Rigid, q: Array, v: Array, f: Array, a: Array) -> None:
    """Make accelerations those of rigid bodies; the forces that do it are added to f."""
    m = len(rigid.nodes)
    _residual(rigid, a)
    _keep_shape(rigid, a)
    for b in range(m):
        i = rigid.nodes[b]
        rigid.unknown[b] = -(v[2, i] ** 2 + v[3, i] ** 2) - (q[2, i] * a[2, i] + q[3, i] * a[3, i])
    _turn(rigid, q, a)
    for b in range(m):
        i, one, two = rigid.nodes[b], rigid.z[2 * b], rigid.z[2 * b + 1]
        for c in range(m):
            one += rigid.coupling[2 * b, c] * rigid.load[c]
            two += rigid.coupling[2 * b + 1, c] * rigid.load[c]
        x, y = one.real / rigid.length[b], one.imag / rigid.length[b]
        f[0, i] -= x
        f[1, i] -= y
        f[0, i + 1] += x
        f[1, i + 1] += y
        f[2, i] += rigid.load[b].real - one.real - two.real
        f[3, i] += rigid.load[b].imag - one.imag - two.imag
        f[2, i + 1] += two.real
        f[3, i + 1] += two.imag


@kernel
def constrain_motion(rigid: Rigid, start: bool, q: Array, v: Array) -> bool:
    """Take from positions and velocities what truncation, rounding, drives and the start add to the bodies' shapes.

    Returns whether the shapes are kept: they are not where joints and drives leave the bodies no place.
    """
    if _residual(rigid, q) > OFF or start:
        _keep_shape(rigid, q)
        _residual(rigid, v)
        _keep_shape(rigid, v)
    for _ in range(CORRECTIONS):
        largest = 0.0
        for b in range(len(rigid.nodes)):
            i = rigid.nodes[b]
            rigid.unknown[b] = 0.5 * (1.0 - q[2, i] ** 2 - q[3, i] ** 2)
            largest = max(largest, abs(rigid.unknown[b]))
        _turn(rigid, q, q)
        if largest < ENOUGH:
            break
    for b in range(len(rigid.nodes)):
        i = rigid.nodes[b]
        rigid.unknown[b] = -(q[2, i] * v[2, i] + q[3, i] * v[3, i])
    _turn(rigid, q, v)
    worst = _residual(rigid, q)
    for b in range(len(rigid.nodes)):
        i = rigid.nodes[b]
        worst = max(worst, 0.5 * abs(1.0 - q[2, i] ** 2 - q[3, i] ** 2))
    return worst <= KEPT


def strains(rigid: Rigid, q: Array) -> Array:
    """How much longer each rigid body is than it should be, as a part of its length, (m,)."""
    one, two = q[:2, rigid.nodes], q[:2, rigid.nodes + 1]
    return np.asarray(np.hypot(*(two - one)) / rigid.length - 1.0)


@inlined
def _residual(rigid, u):  # type: ignore[no-untyped-def]
    """J u of components u, (rows, nodes), put in `residual`; its largest part."""
    largest = 0.0
    for b in range(len(rigid.nodes)):
        i, r = rigid.nodes[b], 1.0 / rigid.length[b]
        rigid.residual[2 * b] = complex(
            (u[0, i + 1] - u[0, i]) * r - u[2, i], (u[1, i + 1] - u[1, i]) * r - u[3, i]
        )
        rigid.residual[2 * b + 1] = complex(u[2, i + 1] - u[2, i], u[3, i + 1] - u[3, i])
        for j in range(2 * b, 2 * b + 2):
            largest = max(largest, abs(rigid.residual[j].real), abs(rigid.residual[j].imag))
    return largest


@inlined
def _keep_shape(rigid, u):  # type: ignore[no-untyped-def]
    """Change u so that J u, given in `residual`, vanishes; z is what does it."""
    for j in range(len(rigid.z)):
        rigid.z[j] = 0.0
        for k in range(len(rigid.z)):
            rigid.z[j] -= rigid.inverse[j, k] * rigid.residual[k]
    for j in range(len(rigid.z)):
        _add(rigid.shape, j, rigid.z[j], u)


@inlined
def _turn(rigid, q, u):  # type: ignore[no-untyped-def]
    """Change u, but not J u, so that Re(t̄_b u_b) changes by what is wanted, given in `unknown`; it is λ then."""
    m = len(rigid.nodes)
    for b in range(m):
        i = rigid.nodes[b]
        for c in range(m):
            k = rigid.nodes[c]
            answer = rigid.direct[b, c] * complex(q[2, k], q[3, k])
            rigid.matrix[b, c] = q[2, i] * answer.real + q[3, i] * answer.imag
    _solve(rigid.matrix, rigid.size, rigid.unknown)
    for c in range(m):  # t_c may be part of u: the loads are taken before u changes
        k = rigid.nodes[c]
        rigid.load[c] = complex(rigid.unknown[c] * q[2, k], rigid.unknown[c] * q[3, k])
    for c in range(m):
        _add(rigid.turn, c, rigid.load[c], u)


@inlined
def _add(fields, j, factor, u):  # type: ignore[no-untyped-def]
    """Add a factor times field j to components u."""
    x, y = factor.real, factor.imag
    for k in range(fields.shape[1]):
        for i in range(fields.shape[2]):
            value = fields[j, k, i]
            u[2 * k, i] += x * value.real - y * value.imag
            u[2 * k + 1, i] += x * value.imag + y * value.real


@inlined
def _solve(A, size, x):  # type: ignore[no-untyped-def]
    """Solve with a symmetric matrix that may be singular, by L D Lᵀ; x is what is wanted, then what does it."""
    m = len(x)
    for k in range(m):
        if A[k, k] <= VOID * size[k]:
            A[k, k] = 0.0
            continue
        for i in range(k + 1, m):
            factor = A[i, k] / A[k, k]
            for j in range(k + 1, i + 1):
                A[i, j] -= factor * A[j, k]
            x[i] -= factor * x[k]
    for k in range(m - 1, -1, -1):
        if A[k, k] == 0.0:
            x[k] = 0.0
            continue
        for i in range(k + 1, m):
            x[k] -= A[i, k] * x[i]
        x[k] /= A[k, k]
