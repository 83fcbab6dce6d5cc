"""Direct sparse solves of a scene's independent unknowns, to hold the recursion against."""

from math import sqrt

import numpy as np
from samples import SQUARE
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import spsolve

from anctmm.discretise.assembly import elastic_forces
from anctmm.discretise.fitting import constraint_rates, mass_matrix
from anctmm.discretise.joined import Joined
from anctmm.forces.actuation import Actuation
from anctmm.model.scene import Torque
from anctmm.recursion.accelerations import by_scalars
from anctmm.recursion.split import split_factors

HEIGHT = sqrt(12.0 * SQUARE.second_moment / SQUARE.area)


def scales(chain):
    """Size of what moves a point by one unit, per component: gradients count times their lever arm."""
    s = np.ones((chain.bodies.rows, chain.bodies.nodes))
    s[2:4] = np.concatenate([np.full(m.nodes, m.element.l) for m in chain.bodies.meshes])
    s[4:] = HEIGHT / 2
    return s


def elastic(chain, q):
    b, f = chain.bodies, np.empty_like(q)
    elastic_forces(b.formulations, q, b.first, b.kinds, b.constants, b.buffer(), f)
    return f


def assembled(chain, blocks):
    """Sparse matrix of all nodes, joints apart, from a matrix (2k, 2, 2k, 2) of each element."""
    index = np.arange(chain.bodies.rows * chain.bodies.nodes).reshape(chain.bodies.rows, -1)
    rows, columns, values = [], [], []
    for i, block in blocks:
        k = block.shape[0] // 2
        at = np.concatenate([index[: 2 * k, i], index[: 2 * k, i + 1]])
        rows.append(np.repeat(at, 4 * k))
        columns.append(np.tile(at, 4 * k))
        values.append(block.ravel())
    places = (np.concatenate(rows), np.concatenate(columns))
    return csc_array((np.concatenate(values), places), shape=(index.size, index.size))


def elements_of(chain):
    """Mesh and first node of each element."""
    for b, mesh in enumerate(chain.bodies.meshes):
        for i in range(chain.bodies.first[b], chain.bodies.first[b + 1] - 1):
            yield mesh, i


def mass_of(chain):
    return assembled(
        chain, [(i, np.einsum("ij,cd->icjd", m.element.mass, np.eye(2))) for m, i in elements_of(chain)]
    )


def stiffness_of(chain, q):
    def tangent(mesh, i):
        return mesh.element.tangent(q[: 2 * mesh.vectors, i : i + 2].T.reshape(-1, 2))

    return assembled(chain, [(i, tangent(m, i)) for m, i in elements_of(chain)])


def direct(chain, matrix, load):
    """Unknowns of all nodes by a sparse solve of the joined system, equilibrated."""
    T = Joined(chain).matrix
    A = (T.T @ matrix @ T).tocsc()
    s = 1.0 / np.sqrt(np.abs(A.diagonal()))
    x = s * spsolve((diags_array(s) @ A @ diags_array(s)).tocsc(), s * (T.T @ load.ravel()))
    return (T @ np.atleast_1d(x)).reshape(load.shape)


def by_split(chain, q, f, clamps=None):
    a = np.empty_like(q)
    clamps = clamps or Actuation(chain.scene, chain.bodies).clamps()
    by_scalars(chain.bodies.tables(), clamps, split_factors(chain), q, f, a)
    return a


def error(chain, a, exact):
    s = scales(chain)
    return np.abs((a - exact) * s).max() / np.abs(exact * s).max()


def torque_stiffness(chain, q, t=0.0):
    """Derivative of −M (−g_y, g_x)/|g|² by g for each torque at a time t, by a complex step."""
    entries = []
    for torque in (load for load in chain.scene.loads if isinstance(load, Torque)):
        body, side = chain.scene.body_end(torque.end)
        row, node = chain.bodies.turning_row(body.name), chain.bodies.node(body.name, side)
        moment = torque.value(t) if callable(torque.value) else torque.value
        at = np.array([row, row + 1]) * chain.bodies.nodes + node
        for i, step in enumerate(1e-30j * np.eye(2)):
            x, y = q[row : row + 2, node] + step
            values = -(moment * np.array([-y, x]) / (x * x + y * y)).imag / 1e-30
            entries += [(value, a, at[i]) for value, a in zip(values, at, strict=True)]
    values, rows, columns = np.array(entries).reshape(-1, 3).T
    return csc_array((values, (rows.astype(int), columns.astype(int))), shape=(q.size, q.size))


def compatible(chain, amount=1e-2, seed=0):
    """Coordinates of a random bent state that the joints allow."""
    T = Joined(chain).matrix
    x = amount * np.random.default_rng(seed).standard_normal(T.shape[1])
    return chain.bodies.reference() + (T @ x).reshape(chain.bodies.rows, -1) / scales(chain)


def dense(chain, f):
    """Accelerations under forces on all nodes by the dense matrix of the independent unknowns and the constraints."""
    T = Joined(chain).matrix
    A = (T.T @ mass_matrix(chain.bodies) @ T).toarray()
    J = (constraint_rates(chain, np.zeros_like(f))[0] @ T).toarray()
    free = np.linalg.svd(J)[2][np.linalg.matrix_rank(J) :].T  # motions that the constraints allow
    if not free.shape[1]:
        return None
    x = free @ np.linalg.solve(free.T @ A @ free, free.T @ (T.T @ f.ravel()))
    return (T @ x).reshape(f.shape)


def assert_as_dense(chain, f, found):
    """Accelerations under forces on all nodes are those of the dense matrix; none, where nothing can move."""
    exact = dense(chain, f)
    if exact is None:
        assert np.abs(found).max() < 1e-6
    else:
        assert np.abs(found - exact).max() < 1e-9 * np.abs(exact).max()
