"""Linear systems with multipliers, [A Jᵀ; J 0], by SciPy's sparse LU, and rows of J that are independent."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import qr
from scipy.sparse.linalg import splu

from reference.global_dae.beams import Matrix
from reference.global_dae.marching import Failure

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Part of the largest pivot below which a row follows from those chosen before.
DEPENDENT = 1e-9


class Saddle:
    """Factors of [A sJᵀ; sJ 0], s the mean size of A's diagonal (Bottasso et al. 2008).

    Raises
    ------
    Failure
        If the matrix is singular, or not finite.
    """

    def __init__(self, A: Matrix, J: sparse.csr_array) -> None:
        if not np.isfinite(A.data).all():
            raise Failure("the tangent is not finite")
        self.size = A.shape[0]
        self.scale = float(np.abs(A.diagonal()).mean()) or 1.0
        scaled = self.scale * J
        blocks: Any = [[A, scaled.T], [scaled, None]] if J.shape[0] else [[A]]
        self.matrix = Matrix(sparse.block_array(blocks, format="csc"))
        try:
            self.factors = splu(self.matrix)
        except RuntimeError:
            raise Failure("the tangent is singular") from None

    def solve(self, right: Array, gap: Array) -> tuple[Array, Array]:
        """x and λ of A x + Jᵀλ = right, J x = gap, refined once."""
        b = np.concatenate([right, self.scale * gap])
        x = self.factors.solve(b)
        x += self.factors.solve(b - self.matrix @ x)
        return x[: self.size], self.scale * x[self.size :]


def independent_rows(J: sparse.csr_array, unit: Array) -> Ints:
    """Numbers of rows that are independent and span all, ascending: mechanisms may have redundant ones.

    Parameters
    ----------
    J : sparse array, shape (m, n)
    unit : ndarray, shape (n,)
        Size of each coordinate, by which columns are made comparable.
    """
    if not J.shape[0]:
        return np.zeros(0, dtype=np.int64)
    scaled = J.toarray() * unit
    sizes = np.linalg.norm(scaled, axis=1)
    scaled = scaled / np.where(sizes > 0.0, sizes, 1.0)[:, None]
    R, order = qr(scaled.T, mode="r", pivoting=True)
    pivots = np.abs(np.diagonal(R))
    return np.sort(order[: int((pivots > DEPENDENT * pivots[0]).sum())]).astype(np.int64)


class Nearest:
    """The least x with J x = misfit of a J that may have dependent rows."""

    def __init__(self, J: sparse.csr_array) -> None:
        self.rows = independent_rows(J, np.ones(J.shape[1]))
        self.J = J[self.rows]
        self.factors = splu(Matrix(self.J @ self.J.T)) if len(self.rows) else None

    def __call__(self, misfit: Array) -> Array:
        """The x of a misfit, (size,)."""
        if self.factors is None:
            return np.zeros(self.J.shape[1])
        return np.asarray(self.J.T @ self.factors.solve(misfit[self.rows]))
