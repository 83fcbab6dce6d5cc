"""The matrix of the quadratic eigenvalue problem for a small shift of the rate, factored.

With λ = ν + s it is K + s C + s² M, whose inverse the problem needs (`eigenvalues`): K alone is singular for a scene
that is free to move. In a frame that rotates with Ω it is K − Ω² M, and s = 0.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import SolverError
from anctmm.integrators.modes.small_motions import SmallMotions

Array = NDArray[np.float64]

#: Parts of Ω² that are tried where one is singular; asymmetry of the inverse that counts as none, and its error where
#: it is not symmetric (some 1e-8 of bars of a slenderness of 5,000).
BESIDE, TRUSTED, USABLE = (1.0 + 1e-8, 1.0 - 1e-7, 1.0 + 1e-6), 1e-8, 1e-5
#: Solutions at most that add C, their change at which they end, and the largest that rounding may leave; steps of
#: inverse iteration.
ADDED, EXACT, LEFT, INVERSE = 60, 1e-14, 1e-6, 4


class ShiftedStiffness:
    """K + s C + s² M.

    C is τ times the stiffness of unstressed elements, and what dampers add to the tangent of connectors. Of stressed
    elements it is no tangent: s = 0 there, or, where K is singular, `solve` adds s C.

    Parameters
    ----------
    problem : SmallMotions

    Raises
    ------
    SolverError
        If the matrix is singular.
    """

    def __init__(self, problem: SmallMotions) -> None:
        self.problem = problem
        #: Whether C is not in the matrix that is factored.
        self.lacks_damping = False
        #: 1/s.
        self.s = self._factored()

    def solve(self, force: Array) -> Array:
        """Displacements under forces.

        Raises
        ------
        SolverError
            If s C, where it is added, is too large beside K + s² M.
        """
        x, change = self.problem.solve(force), np.inf
        if not self.lacks_damping:
            return x
        for _ in range(ADDED):
            before, x = x, self.problem.solve(force - self.s * self.problem.damping_forces(x))
            last, change = change, float(np.linalg.norm(x - before))
            if not EXACT * np.linalg.norm(x) < change < 0.5 * last:  # converged, or as far as rounding allows
                break
        if not change <= LEFT * np.linalg.norm(x):
            raise self._refused()
        return x

    def of_stiffness(self, x: Array, forces: Array) -> Array:
        """K x, (size, k), of displacements x and the forces that the matrix factored last gives them."""
        problem, own = self.problem, 0.0 if self.lacks_damping else self.s
        return forces - np.stack(
            [own * problem.damping_forces(one) + self.s * self.s * problem.mass(one) for one in x.T], axis=1
        )

    def _factored(self) -> float:
        """Factor the matrix; s."""
        problem = self.problem
        if problem.spin:
            self._factor_spinning()
            return 0.0
        if problem.damping.material is None or problem.unstressed:
            return self._factor_with_damping()
        problem.factorize(0.0)
        if not self._singular():
            self._factor_spinning()
            return 0.0
        self.lacks_damping = True
        problem.factorize(problem.first_shift)
        return float(np.sqrt(problem.first_shift))

    def _factor_with_damping(self) -> float:
        problem, connectors = self.problem, self.problem.system.loads.connectors
        s, tables = float(np.sqrt(problem.definite())), None
        if problem.damping.material is not None:
            tables = problem.system.chain.bodies.stiffened(
                1.0 + s * np.asarray(problem.damping.material)
            ).tables()
        if connectors is not None:
            connectors.part[1] = s
        problem.factorize(s * s, tables)
        if connectors is not None:
            connectors.part[1] = 0.0
        return s

    def _factor_spinning(self) -> None:
        """Factor K − Ω² M; where a part of it happens to be singular, with an Ω² beside that."""
        for part in (1.0, *BESIDE):
            shift = -part * self.problem.spin**2
            self.problem.factorize(shift)
            if self._asymmetry() < TRUSTED if self.problem.symmetric else self._lost_digits(shift) < USABLE:
                return
        raise self._refused()

    def _singular(self) -> bool:
        """Whether the matrix factored last is singular up to rounding, by inverse iteration."""
        problem = self.problem
        force = problem.mass(np.random.default_rng(2).standard_normal(problem.size))
        for _ in range(INVERSE):
            x = problem.solve(force)
            before, force = force, problem.mass(x)
            square = float(x @ before) / float(x @ force)
            force = force / np.linalg.norm(force)
        return not abs(square) > problem.rounding  # nor where it is NaN

    def _lost_digits(self, shift: float) -> float:
        """How far the inverse S of the matrix factored last is from S' + (σ' − σ) S M S' of another shift σ'.

        The matrix is factored again.
        """
        problem, other = self.problem, shift + self.problem.first_shift
        one = problem.mass(np.random.default_rng(1).standard_normal(problem.size))
        here = problem.solve(one)
        problem.factorize(other)
        there = problem.solve(one)
        problem.factorize(shift)
        apart = here - there - (other - shift) * problem.solve(problem.mass(there))
        return _part(float(np.linalg.norm(apart)), float(np.linalg.norm(here)))

    def _asymmetry(self) -> float:
        """How far the inverse of the matrix factored last is from symmetric, as a part of it."""
        problem, draw = self.problem, np.random.default_rng(1)
        one, two = (problem.mass(draw.standard_normal(problem.size)) for _ in range(2))
        there, back = problem.solve(one), problem.solve(two)
        return _part(abs(float(two @ there - one @ back)), float(np.linalg.norm(there) * np.linalg.norm(two)))

    def _refused(self) -> SolverError:
        problem = self.problem
        where = (
            f"at a spin of {problem.spin!r} rad/s; another spin or mesh is needed"
            if problem.spin
            else "there: some motion needs no force, as of a body that nothing holds, or at a critical load, and "
            "materials damp much; less damping, another load, or joints or springs that hold it are needed"
        )
        return SolverError(
            f"the equations of small motions of scene {problem.system.chain.scene.name!r} are singular {where}"
        )


def _part(error: float, size: float) -> float:
    """An error as a part of a size; infinite where that is no number or 0."""
    return error / size if np.isfinite(size) and size > 0.0 else np.inf
