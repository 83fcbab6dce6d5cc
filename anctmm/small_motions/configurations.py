"""Configurations about which motions are linearised: the last output of a solution, or that of a steady spin."""

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError, SolverError, shown
from anctmm.results.fields import HermiteField, RigidField
from anctmm.results.solution import Solution
from anctmm.small_motions.linearised import SmallMotions
from anctmm.system.system import System

Array = NDArray[np.float64]

#: Size of Newton's last correction, of the scene's length.
CONVERGED = 1e-11
#: Statuses of motions whose last output is no state of the scene.
LOST = ("diverged", "failed")


def steady_state(problem: SmallMotions) -> SmallMotions:
    """Small motions about the steady spin f(q) = Ω² M (q − centre), by Newton's iteration by parts of Ω².

    A part where it does not converge, near the square of a frequency, is left out, or, the last one, a SolverError.
    """
    spin, found = problem.spin, 0.0
    for part in (0.25, 0.5, 0.75, 1.0):
        if (steady := _steady(problem, np.sqrt(part) * spin)) is not None:
            problem, found = steady, part
    if found < 1.0:
        raise SolverError(
            f"no steady state of scene {problem.system.scene.name!r} at a spin of {spin!r} rad/s was found beyond "
            f"{np.sqrt(found) * spin:.6g} rad/s; a finer mesh or another spin may help"
        )
    return problem


def _steady(problem: SmallMotions, spin: float) -> SmallMotions | None:
    """The steady state at a spin near that of another; None if Newton's iteration does not end."""
    system = problem.system
    multiplier = system.tables.rows.multiplier
    before, problem = multiplier.copy(), problem.at(problem.q, spin)
    for _ in range(25):
        step, forces = problem.correction()
        if not np.isfinite(step).all():
            break
        problem = problem.at(problem.q + problem.spread(step), spin)
        multiplier += forces
        if np.abs(step).max() < CONVERGED * max(system.scene.length, 1.0):
            return problem
    multiplier[:] = before
    return None


def checked(system: System, about: object) -> Solution:
    """What was given as a solution; DiscretisationError unless it is a complete one of the scene, mesh and elements."""
    scene = system.scene
    if not isinstance(about, Solution) or not len(about.t):
        raise DiscretisationError(
            f"about is {shown(about)}; a solution of scene {scene.name!r} with an output is needed"
        )
    parts = ("bodies", "joints", "loads", "gravity", "connectors")
    if others := [part for part in parts if getattr(about.scene, part) != getattr(scene, part)]:
        raise DiscretisationError(
            f"about is a solution of a scene {about.scene.name!r} with other {' and '.join(others)} than scene "
            f"{scene.name!r}; one of the same scene is needed (functions are the same where they are one object)"
        )
    cut = system.run.of(scene)
    known = all(isinstance(about.fields[body.name], HermiteField | RigidField) for body in scene.bodies)
    if not known or about.run is None or about.run.of(about.scene) != cut:
        raise DiscretisationError(
            f"about has another mesh or element than scene {scene.name!r}; {cut} is needed"
        )
    part_of_load = about.static and not about.status.ok and about.t[-1] < 1.0
    if part_of_load or (about.status.code in LOST and not about.static):
        raise DiscretisationError(
            f"about ended with {about.status.code!r} ({about.status.message}); an equilibrium or a complete run is "
            f"needed: its last output is no state of scene {scene.name!r}"
        )
    return about
