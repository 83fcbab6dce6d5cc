"""Linear systems with multipliers, [A Jᵀ; J 0], by SciPy's sparse LU."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from reference.global_dae.elements import Matrix

Array = NDArray[np.float64]

#: Compliance of the rows in the factors, of A's mean diagonal: rows may then depend on each other, as in mechanisms.
COMPLIANCE = 1e-12


class Failure(Exception):
    """A step that failed: the reason, and the correction or acceleration that shows where."""

    def __init__(self, why: str, change: Array | None = None) -> None:
        super().__init__(why)
        self.change = change


class Saddle:
    """Factors of [A sJᵀ; sJ −δs], s the mean size of A's diagonal (Bottasso et al. 2008); δ is refined away.

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
        blocks: Any = [[A, self.scale * J.T], [self.scale * J, None]] if J.shape[0] else [[A]]
        self.matrix = Matrix(sparse.block_array(blocks, format="csc"))
        softened = np.repeat([0.0, COMPLIANCE * self.scale], [self.size, J.shape[0]])
        try:
            self.factors = splu(Matrix(self.matrix - sparse.diags_array(softened)))
        except RuntimeError:
            raise Failure("the tangent is singular") from None

    def solve(self, right: Array, gap: Array) -> tuple[Array, Array]:
        """x and λ of A x + Jᵀλ = right, J x = gap, refined once."""
        b = np.concatenate([right, self.scale * gap])
        x = self.factors.solve(b)
        x += self.factors.solve(b - self.matrix @ x)
        return x[: self.size], self.scale * x[self.size :]

    def closest(self, gap: Array) -> Array:
        """The x with J x = gap that is least in the metric of A, (size,)."""
        return self.solve(np.zeros(self.size), gap)[0]


class Nearest(Saddle):
    """The least x with J x = gap."""

    def __init__(self, J: sparse.csr_array) -> None:
        super().__init__(Matrix(sparse.eye_array(J.shape[1])), J)

    def __call__(self, gap: Array) -> Array:
        """The x of a gap, (size,)."""
        return self.closest(gap)
