"""Linear systems with multipliers, [A Jᵀ; J 0], by SciPy's sparse LU."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from reference.global_dae.elements import Matrix
from reference.global_dae.marching import Failure

Array = NDArray[np.float64]

#: Compliance of the rows in the factors, of A's mean diagonal: rows may then depend on each other, as in mechanisms.
COMPLIANCE = 1e-12


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
        scaled = self.scale * J
        blocks: Any = [[A, scaled.T], [scaled, None]] if J.shape[0] else [[A]]
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


class Nearest(Saddle):
    """The least x with J x = misfit."""

    def __init__(self, J: sparse.csr_array) -> None:
        super().__init__(Matrix(sparse.eye_array(J.shape[1])), J)

    def __call__(self, misfit: Array) -> Array:
        """The x of a misfit, (size,)."""
        return self.solve(np.zeros(self.size), misfit)[0]
