"""Softest motions K x = λ M x of a configuration, from products with S M alone: S is the solve with K.

S M has the eigenvalues 1/λ, so that the softest motions are found first. Of few unknowns its matrix is made, and all
motions are found. Of more, a Krylov space has them. Which ones depends on where it starts: forces without a potential
may make one body flutter, above whose frequencies another one has hundreds of its own. So one space starts from the
places of such forces, where only what these move takes part, and another one from everywhere.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Unknowns up to which all motions are found; of more, the vectors of each Krylov space.
DENSE, VECTORS = 300, 150
#: Softness, relative to the largest, below which no motion is looked at: it is rounding, as of held directions.
STIFF = 1e-9
#: What a motion misses of its equation, relative, below which it is found.
FOUND = 1e-6
#: Part that is left of a vector, of its size, below which it lies in the space.
INSIDE = 1e-12


def softest(
    product: Callable[[Array], Array], mass: Callable[[Array], Array], starts: Sequence[Array]
) -> tuple[Complex, Complex]:
    """Eigenvalues 1/λ of S M, the largest first, and motions x.

    Parameters
    ----------
    product, mass : callable
        S M x and M x, (n,).
    starts : sequence of ndarray, shape (n,)
        From which Krylov spaces start, where there are many unknowns.

    Returns
    -------
    (ndarray, ndarray)
        (k,) and (n, k), complex. A motion that two spaces have is there twice.
    """
    n = len(starts[0])
    if n <= DENSE:
        values, shapes = _without_stiff(*np.linalg.eig(np.stack([product(e) for e in np.eye(n)], axis=1)))
    else:
        found = [_of_space(product, mass, start) for start in starts]
        values, shapes = (np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True))
    order = np.argsort(-np.abs(values))
    return values[order], shapes[:, order]


def of_complex(product: Callable[[Array], Array], vectors: Complex) -> Complex:
    """A real product of complex vectors, as columns."""
    return np.stack([product(x.real) + 1j * product(x.imag) for x in vectors.T], axis=1)


def sizes(vectors: Complex, heavy: Complex) -> Array:
    """Sizes of vectors x by the mass, from M x, as columns: a change of units multiplies all by one factor."""
    return np.sqrt(np.maximum((vectors.conj() * heavy).sum(axis=0).real, 0.0))


def _without_stiff(values: Complex | Array, shapes: Complex | Array) -> tuple[Complex, Complex]:
    """Those that are no rounding beside the softest one."""
    kept = np.abs(values) > STIFF * np.abs(values).max(initial=0.0)
    return values[kept].astype(complex), shapes[:, kept].astype(complex)


def _of_space(
    product: Callable[[Array], Array], mass: Callable[[Array], Array], start: Array
) -> tuple[Complex, Complex]:
    """The motions that a Krylov space has found, by Arnoldi's process with the inner product of the mass."""
    space = np.zeros((VECTORS + 1, len(start)))
    weighted, H = np.zeros_like(space), np.zeros((VECTORS + 1, VECTORS))
    size, count = VECTORS, 0
    x = product(start)
    for k in range(VECTORS + 1):
        before = _length(x, mass(x))
        for _ in range(2):  # once more, as rounding leaves some
            parts = weighted[:k] @ x
            x = x - parts @ space[:k]
            if k:
                H[:k, k - 1] += parts
        left = _length(x, mass(x))
        if k:
            H[k, k - 1] = left
        if left <= INSIDE * before:
            size = k
            break
        count = k + 1
        space[k] = x / left
        weighted[k] = mass(space[k])
        if count <= VECTORS:
            x = product(space[k])
    if size == 0:
        return np.zeros(0, complex), np.zeros((len(start), 0), complex)
    values, turn = np.linalg.eig(H[:size, :size])
    missed = (H[size, size - 1] if size < count else 0.0) * np.abs(turn[-1])
    kept = missed <= FOUND * np.abs(values)
    return _without_stiff(values[kept], space[:size].T @ turn[:, kept])


def _length(x: Array, weighted: Array) -> float:
    """Of a vector, in the inner product of the mass."""
    return max(float(x @ weighted), 0.0) ** 0.5
