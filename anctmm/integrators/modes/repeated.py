"""Copies of repeated eigenvalues, which a single Krylov space does not contain.

Of an eigenspace a Krylov space contains the component of its start vector alone; other copies come from rounding, or
not at all. So eigenvectors are searched for again from other start vectors, with those found before deflated.

Of a symmetric problem it is known when all are found: K − σ M has as many negative pivots as there are eigenvalues
below σ (Sylvester's law of inertia). Of others the search ends where it finds nothing new among the eigenvalues wanted.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.integrators.modes.small_motions import SmallMotions

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Distance below the largest square found, of its size, at which eigenvalues are counted.
BELOW = 1e-6
#: Eigenvalues of a search that follows the first one.
MORE = 4
#: Part of a vector, of its size, that lies outside a space it repeats; searches at most; restarts of each.
INSIDE, SEARCHES, RESTARTS = 1e-6, 200, 30
#: What an eigenvector may miss of its equation, relative.
MISSED = 1e-7


class Operator(NamedTuple):
    """A real matrix whose eigenvalues of the largest size are wanted, and an inner product.

    Parameters
    ----------
    product, weight : callable
        A x and W x, (n,); the inner product is xᵀ W y.
    """

    product: Callable[[Array], Array]
    weight: Callable[[Array], Array]


def missing(problem: SmallMotions, squares: Array, noise: float = 0.0) -> tuple[int, float]:
    """How many eigenvalues below the largest of ascending squares are not among them, and where they were counted.

    The matrix is factored there. Eigenvalues of a difference up to `noise`, 1/s², count as the same.
    """
    margin = max(BELOW * abs(float(squares[-1])), noise)
    at = float(squares[-1]) - 2.0 * margin
    return problem.factorize(-at) - int(np.count_nonzero(squares < at + margin)), at


def uncertain(problem: SmallMotions, squares: Array) -> bool:
    """Whether rounding may be why more eigenvalues are counted than there are among ascending squares.

    Below the shift that makes the stiffness of a free body definite it may.
    """
    left, at = missing(problem, squares, problem.rounding)
    return left <= 0 or abs(at) < problem.first_shift


def deflated(product: Callable[[Array], Array], basis: Array, heavy: Array) -> Callable[[Array], Array]:
    """Product without its components along a basis, (n, k), that is orthonormal by the mass; `heavy`: its mass."""

    def apart(x: Array) -> Array:
        y = product(x)
        return np.asarray(y - basis @ (heavy.T @ y))

    return apart


def with_copies(
    operator: Operator,
    values: Complex,
    vectors: Complex,
    wanted: Callable[[Complex], NDArray[np.bool_]],
) -> tuple[Complex, Complex]:
    """Eigenvalues and vectors of a matrix, those that a first search has not found included.

    The vectors found span an invariant space. Beside it, the matrix has the other eigenvalues, other copies of those
    found included (Saad 2011, 10.1137/1.9781611970739, section 4.2).

    Parameters
    ----------
    operator : Operator
    values : ndarray, shape (k,)
    vectors : ndarray, shape (n, k)
        Found first.
    wanted : callable
        Which of some eigenvalues belong to those wanted.

    Returns
    -------
    (ndarray, ndarray)
        The given ones if there are no others.
    """
    if not len(values):
        return values, vectors
    draw, found = np.random.default_rng(5), 0
    basis, heavy = _orthonormal(operator, np.hstack([vectors.real, vectors.imag]))
    for _ in range(SEARCHES):
        more, shapes = _searched(operator, basis, heavy, draw)
        new = np.flatnonzero(wanted(more))
        if not len(new):
            break
        found += len(new)
        parts, size = shapes[:, new], basis.shape[1]
        basis, heavy = _orthonormal(operator, np.hstack([basis, parts.real, parts.imag]), size)
        if basis.shape[1] == size:  # the second vector of a free motion, which is none of its own
            break
    return _of_space(operator, basis, heavy) if found else (values, vectors)


def _searched(
    operator: Operator, basis: Array, heavy: Array, draw: np.random.Generator
) -> tuple[Complex, Complex]:
    """Some eigenvalues of the largest size beside an invariant space."""
    n, k = basis.shape
    count = min(MORE, n - k - 2)
    if count < 1:
        return np.zeros(0, complex), np.zeros((n, 0), complex)
    apart = deflated(operator.product, basis, heavy)
    start = apart(np.asarray(draw.standard_normal(n)))
    matrix = scipy.sparse.linalg.LinearOperator((n, n), matvec=apart, dtype=float)
    try:
        values, vectors = scipy.sparse.linalg.eigs(matrix, count, v0=start, maxiter=RESTARTS)
    except scipy.sparse.linalg.ArpackNoConvergence as error:
        return error.eigenvalues.astype(complex), error.eigenvectors.astype(complex)
    return values, vectors


def _of_space(operator: Operator, basis: Array, heavy: Array) -> tuple[Complex, Complex]:
    """Eigenvalues and vectors of an invariant space; those that miss their equation are left out."""
    images = np.stack([operator.product(x) for x in basis.T], axis=1)
    values, turn = np.linalg.eig(heavy.T @ images)
    left = images @ turn - (basis @ turn) * values
    size = np.linalg.norm(basis @ turn, axis=0)
    fits = np.linalg.norm(left, axis=0) <= MISSED * np.abs(values) * size
    return values[fits].astype(complex), (basis @ turn[:, fits]).astype(complex)


def _orthonormal(operator: Operator, vectors: Array, kept: int = 0) -> tuple[Array, Array]:
    """An orthonormal basis of the space of vectors, of which the first `kept` are orthonormal, and its weights."""
    basis, heavy = list(vectors.T[:kept]), [operator.weight(x) for x in vectors.T[:kept]]
    for x in vectors.T[kept:]:
        size = _size(operator, x)
        y = x
        for _ in range(2):  # once more, as rounding leaves some
            for one, weighed in zip(basis, heavy, strict=True):
                y = y - one * (weighed @ y)
        left = _size(operator, y)
        if left > INSIDE * size > 0.0:
            basis.append(y / left)
            heavy.append(operator.weight(y / left))
    return np.stack(basis, axis=1), np.stack(heavy, axis=1)


def _size(operator: Operator, x: Array) -> float:
    return max(float(x @ operator.weight(x)), 0.0) ** 0.5
