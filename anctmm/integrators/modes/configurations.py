"""Configurations about which motions are linearised: the last output of a solution, or that of a steady spin."""

from warnings import warn

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.elements.kinds import kind_of
from anctmm.errors import DiscretisationError, EquilibriumWarning, SolverError, shown
from anctmm.forces.connectors import count_turns
from anctmm.integrators.modes.frames import Frame
from anctmm.integrators.static_start import coordinates_of, turned_at_end
from anctmm.integrators.statics.equilibrium_stability import largest_square
from anctmm.integrators.statics.static_system import StaticSystem
from anctmm.recursion.constrained import ask_equilibrium, take_equilibrium
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Parts of the square of the spin by which the steady state is approached, and Newton's corrections in each.
PARTS, ITERATIONS = 4, 25
#: Size of the last correction of a steady state.
CONVERGED = 1e-11
#: Part of Ω² whose matrix is taken where that of Ω² itself is singular by parts.
BESIDE = 1.0 + 1e-6
#: What two scenes must share to be the same.
PARTS_OF_SCENES = ("bodies", "joints", "loads", "gravity", "connectors")
#: Statuses of motions whose last output is no state of the scene.
LOST = ("diverged", "failed")
#: Distance from an equilibrium that counts as none, of the scene's length; and part of the square of the largest
#: frequency found, that is a motion without stiffness.
AWAY, SLOW = 1e-3, 1e-12
#: Solutions that find the forces of constraints of an equilibrium.
MULTIPLIERS = 2


def steady_state(system: StaticSystem, frame: Frame) -> Array:
    """Coordinates of a steady spin in the frame that turns: f(q) = Ω² M (q − centre), by Newton's iteration.

    It is approached by parts of Ω². Where one is the square of a frequency, its matrix is singular: that is left out.

    Raises
    ------
    SolverError
        If no steady state is found.
    """
    q, found = system.reference.copy(), 0.0
    for part in np.arange(1, PARTS + 1) / PARTS:
        square = part * frame.spin**2
        if (steady := _steady(system, q, frame, square)) is not None:
            q, found = steady, square
            system.accept(q, 1.0)
    if found < frame.spin**2:
        raise SolverError(
            f"no steady state of scene {system.chain.scene.name!r} at a spin of {frame.spin!r} rad/s was found beyond "
            f"{np.sqrt(found):.6g} rad/s; a finer mesh or another spin may help"
        )
    return q


def _steady(system: StaticSystem, q: Array, frame: Frame, square: float) -> Array | None:
    """The steady state near coordinates q at a square of the spin; None if Newton's iteration does not end."""
    for beside in (1.0, BESIDE):
        if (found := _iterated(system, q, frame, square, beside * square)) is not None:
            return found
    return None


def _iterated(system: StaticSystem, q: Array, frame: Frame, square: float, near: float) -> Array | None:
    """The same by Newton's iteration with the matrix of a square near that of the spin."""
    for _ in range(ITERATIONS):
        system.factorize(q, 1.0, -near)
        step = _correction(system, q, _centrifugal(system, q, frame, square) + system.residual(q, 1.0))
        q = q + step
        if not np.isfinite(step).all():
            return None
        if system.size(step) < CONVERGED:
            return q
    return None


def checked(chain: Chain, about: object) -> Solution:
    """What was given as a solution to be linearised.

    Raises
    ------
    DiscretisationError
        If it is no solution of the scene, its mesh and elements.
    """
    if not isinstance(about, Solution) or not len(about.t):
        raise DiscretisationError(
            f"about is {shown(about)}; a solution of scene {chain.scene.name!r} with an output is needed"
        )
    if others := [
        part for part in PARTS_OF_SCENES if getattr(about.scene, part) != getattr(chain.scene, part)
    ]:
        raise DiscretisationError(
            f"about is a solution of a scene {about.scene.name!r} with other {' and '.join(others)} than scene "
            f"{chain.scene.name!r}; one of the same scene is needed (functions are the same where they are one object)"
        )
    _check_cut(chain, about)
    if about.status.code in LOST and not about.static:
        raise DiscretisationError(
            f"about is a run that ended with {about.status.code!r} ({about.status.message}); a complete run is "
            f"needed: its last output is no state of scene {chain.scene.name!r}"
        )
    if about.static and not about.status.ok and about.t[-1] < 1.0:
        raise DiscretisationError(
            f"about ended at {about.t[-1]:.3g} of the load of scene {chain.scene.name!r} ({about.status}); an "
            f"equilibrium is needed"
        )
    return about


def last_of(system: StaticSystem, about: Solution, frame: Frame) -> tuple[Array, float]:
    """Last coordinates of a solution, (rows, nodes), and the part of the loads there; constraints' forces are found."""
    chain = system.chain
    factor = float(about.t[-1]) if about.static else 1.0
    q = coordinates_of(chain, about, -1)
    count_turns(system.loads.connectors, q, turned_at_end(chain, about))
    system.accept(q, factor)
    if system.loops is not None:
        for _ in range(MULTIPLIERS):  # any shift will do where the residual is theirs alone
            system.factorize(q, factor, largest_square(system))
            _correction(system, q, _centrifugal(system, q, frame, frame.spin**2) + system.residual(q, factor))
    return q, factor


def check_balance(
    system: StaticSystem, q: Array, factor: float, frame: Frame, values: Complex, fields: Complex
) -> None:
    """Tell that modes are about no equilibrium, by how far their stiffness would move the scene to one.

    Parameters
    ----------
    system : StaticSystem
    q : ndarray, shape (rows, nodes)
        The configuration.
    factor : float
        Part of the loads.
    frame : Frame
    values : ndarray, shape (modes,)
        Eigenvalues λ, 1/s.
    fields : ndarray, shape (modes, rows, nodes)
        Modes φ, whose largest displacements are 1 m.
    """
    length, squares = system.chain.scene.length, np.abs(values) ** 2
    left = _centrifugal(system, q, frame, frame.spin**2) + system.residual(q, factor)
    forces = np.abs([np.vdot(u, left) for u in fields])  # φᵀ Jᵀ μ = 0: constraints do not count
    masses = np.array([np.vdot(u, system.inertia(u.real) + 1j * system.inertia(u.imag)).real for u in fields])
    known = squares > SLOW * squares.max(initial=0.0)  # what moves without stiffness has no equilibrium
    away = float((forces[known] / (masses[known] * squares[known])).max(initial=0.0))
    if away > AWAY * length:
        warn(
            f"the last output that modes of scene {system.chain.scene.name!r} are about is no equilibrium: its "
            f"residual forces would move it by about {away:.2g} m. Modes are those of the stiffness in this state; let "
            f"the motion come to rest first, or give about=at.solve_static(...)",
            EquilibriumWarning,
            stacklevel=3,
        )


def _centrifugal(system: StaticSystem, q: Array, frame: Frame, square: float) -> Array:
    """Ω² M (q − centre), Ω² the `square`: gradients turn about nothing but themselves."""
    away = np.zeros_like(q)
    away[:2] = frame.centre[:, None]
    return square * system.inertia(q - away)


def _correction(system: StaticSystem, q: Array, residual: Array) -> Array:
    """Newton's correction with the matrix factored last; multipliers of constraints are taken."""
    if system.loops is None:
        return system.solve(residual)
    ask_equilibrium(system.loops, q)
    step = system.solve(residual)
    take_equilibrium(system.loops, bool(not np.isfinite(step).all()))
    return step


def _check_cut(chain: Chain, about: Solution) -> None:
    for name, (elements, kind) in chain.run.of(chain.scene).items():
        found = about.fields[name]
        shape = (elements + 1, len(kind_of(kind).vectors), 2)
        if not isinstance(found, HermiteField) or found.coordinates.shape[1:] != shape:
            raise DiscretisationError(
                f"about has another mesh or element of body {name!r}; {elements} of kind {kind!r} are needed"
            )
