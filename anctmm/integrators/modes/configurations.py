"""What small motions are about: the start, the last output of a solution, or a steady spin."""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.elements.kinds import kind_of
from anctmm.errors import DiscretisationError, SolverError, shown
from anctmm.integrators.stability import element_bound
from anctmm.integrators.static_start import coordinates_of
from anctmm.integrators.statics.static_system import StaticSystem
from anctmm.model.joints import Clamp, Prismatic, Slider
from anctmm.model.scene import Scene
from anctmm.recursion.constrained import ask_equilibrium, take_equilibrium
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution

Array = NDArray[np.float64]

#: Parts of the square of the spin by which the steady state is approached, and Newton's corrections in each.
PARTS, ITERATIONS = 4, 25
#: Size of the last correction of a steady state.
CONVERGED = 1e-11
#: Factor of the penalty of constraints: one of 1 would cancel −Ω² M of rigid bodies.
PENALTY = 7.3
#: Solutions that find the forces of constraints of an equilibrium.
MULTIPLIERS = 2


def steady_state(system: StaticSystem, spin: float) -> Array:
    """Coordinates of a steady spin in the frame that turns: f(q) = Ω² M (q − centre), by Newton's iteration.

    Raises
    ------
    DiscretisationError
        If the scene cannot turn steadily.
    SolverError
        If no steady state is found.
    """
    scene = system.chain.scene
    centre = _centre(scene)
    if system.loops is not None:
        system.loops.rows.penalty[0] = PENALTY
    q = system.reference.copy()
    away = np.zeros_like(q)
    away[:2] = centre[:, None]
    for part in np.arange(1, PARTS + 1) / PARTS:
        square = part * spin**2
        for _ in range(ITERATIONS):
            system.factorize(q, 1.0, -square)
            step = _correction(system, q, square * system.inertia(q - away) + system.residual(q, 1.0))
            q += step
            if not np.isfinite(step).all() or system.size(step) < CONVERGED:
                break
        if not np.isfinite(q).all() or not system.size(step) < CONVERGED:
            raise SolverError(
                f"no steady state of scene {scene.name!r} at a spin of {spin!r} rad/s was found beyond "
                f"{np.sqrt(square):.6g} rad/s; a finer mesh or a slower spin may do"
            )
        system.accept(q, 1.0)
    return q


def last_of(system: StaticSystem, about: object) -> tuple[Array, float]:
    """Last coordinates of a solution, (rows, nodes), and the part of the loads there; constraints' forces are found.

    Raises
    ------
    DiscretisationError
        If it is no solution of the scene, its mesh and elements.
    """
    chain = system.chain
    if not isinstance(about, Solution) or about.scene != chain.scene or not len(about.t):
        raise DiscretisationError(
            f"about is {shown(about)}; a solution of scene {chain.scene.name!r} with an output is needed"
        )
    _check_cut(chain, about)
    if about.static and not about.status.ok and about.t[-1] < 1.0:
        raise DiscretisationError(
            f"about ended at {about.t[-1]:.3g} of the load of scene {chain.scene.name!r} ({about.status}); an "
            f"equilibrium is needed"
        )
    if not about.static and chain.kept.constraints.drives:
        raise DiscretisationError(
            f"about is a motion of scene {chain.scene.name!r}, whose constraints are driven; an equilibrium of "
            f"solve_static is needed"
        )
    factors = about.t if about.static else np.ones(1)
    for k, factor in enumerate(factors):  # springs' turns are counted on the way
        q = coordinates_of(chain, about, k if about.static else -1)
        system.accept(q, float(factor))
    factor = float(factors[-1])
    if system.loops is not None:
        for _ in range(MULTIPLIERS):  # any shift will do where the residual is theirs alone
            system.factorize(q, factor, max(element_bound(chain), 1.0) ** 2)
            _correction(system, q, system.residual(q, factor))
    return q, factor


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


def _centre(scene: Scene) -> Array:
    """Place that a scene spins about."""
    clamps = [joint for joint in scene.joints if isinstance(joint, Clamp)]
    held = [joint for joint in scene.joints if getattr(joint, "grounded", False)]
    if len(clamps) != 1 or len(held) != 1:
        raise DiscretisationError(
            f"spin is given, and scene {scene.name!r} is held by {len(held)} joints, {len(clamps)} of them clamps; "
            f"it turns with one clamp that nothing else holds back"
        )
    if any(scene.gravity) or scene.loads:
        raise DiscretisationError(
            f"spin is given, and scene {scene.name!r} has gravity or loads; no steady state turns with them"
        )
    still = [*_guides(scene), *(c for c in scene.connectors if len(c.places) < 2)]
    if still:
        raise DiscretisationError(
            f"spin is given, and {shown(still[0])} of scene {scene.name!r} stands still; all must turn with the clamp"
        )
    return np.array(scene.place(clamps[0].end).position)


def _guides(scene: Scene) -> list[object]:
    """Guides that are fixed in the ground."""
    return [joint for joint in scene.joints if isinstance(joint, Slider | Prismatic) and joint.body is None]
