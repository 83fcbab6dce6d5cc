"""Natural modes of a scene about its start, an equilibrium, a motion that has come to rest, or a steady spin."""

from collections.abc import Mapping
from typing import Any
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation, discretise
from anctmm.errors import DiscretisationError, EquilibriumWarning
from anctmm.integrators.output import field_of
from anctmm.integrators.starting import coordinates_of, set_angles
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution
from anctmm.small_motions.configurations import checked, steady_state
from anctmm.small_motions.eigenvalues import lowest
from anctmm.small_motions.frames import GROUND, frame_at, spun
from anctmm.small_motions.linearised import SmallMotions
from anctmm.small_motions.modal import Modes
from anctmm.system.body_meshes import MassMesh
from anctmm.system.mesh import Mesh
from anctmm.system.system import System
from anctmm.validation import number, whole

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Modes at most.
MOST = 10_000
#: Distance from an equilibrium that counts as none, of the scene's length.
AWAY = 1e-3


def modes(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    count: int | None = None,
    about: Solution | None = None,
    spin: float = 0.0,
    **options: Any,
) -> Modes:
    """Lowest natural modes of a scene, including mechanisms with rigid bodies, guides, springs and dampers.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its fields as keywords; only mesh, element and quadrature matter.
    count : int, optional
        Number of modes; default ten, or all if there are fewer. With damping there are up to two for each free motion.
    about : Solution, optional
        The equations are linearised about its last output, with the loads and drives of that time. It is an equilibrium
        of `solve_static` or a motion, of the same scene and mesh. Default: the initial configuration, without loads and
        preloads.
    spin : float
        Rate of a steady rotation of the whole scene with its only clamp, rad/s, such as a blade on a hub; the steady
        state is computed first. Not together with `about`, gravity or loads.

    Returns
    -------
    Modes

    Raises
    ------
    DiscretisationError
        If the options are wrong, or do not fit the scene or each other, or the drives of a motion allow no modes.
    SolverError
        If no steady state, or not all modes, are found.
    EquilibriumWarning
        If the last output of a motion is no equilibrium.

    Notes
    -----
    About a motion, drives that stand still are held. Modes are those of a steady rotation, in its frame, if a clamp
    with a constant rate alone holds the scene. About motions with other moving drives there are none.
    """
    run = discretise(run, options)
    system = System(checked_scene(scene), run)
    count = None if count is None else whole("count", count, MOST, DiscretisationError)
    spin = number("spin (rad/s)", spin, DiscretisationError)
    problem = _problem(system, about, spin)
    rates, vectors = lowest(problem, count)
    flat = np.array([problem.spread(x) for x in vectors.T])
    shapes, size = _normalised(_of_bodies(system.mesh, flat))
    if about is not None and not about.static:
        _check_balance(problem, rates, vectors * size)
    frequencies = np.abs(rates.imag) / (2.0 * np.pi)
    damping = np.divide(0.0 - rates.real, np.abs(rates), out=np.zeros(len(rates)), where=rates != 0.0)
    equilibrium = {name: q[0] for name, q in _of_bodies(system.mesh, problem.q[None]).items()}
    return Modes(scene, run, frequencies, damping, rates.real + 0.0, shapes, equilibrium)


def _problem(system: System, about: Any, spin: float) -> SmallMotions:
    """Small motions about what is asked for."""
    scene, start = system.scene, system.start()[0]
    if about is None:
        if not spin:
            return SmallMotions(system, start, 0.0, 0.0)
        return steady_state(SmallMotions(system, start, 0.0, 1.0, spun(scene, spin)))
    if spin:
        raise DiscretisationError("spin is given beside about; one of them is allowed")
    about = checked(system, about)
    time = 0.0 if about.static else float(about.t[-1])
    frame = GROUND if about.static else frame_at(scene, time, system.signals)
    set_angles(system, about)
    problem = SmallMotions(system, coordinates_of(system, about, -1), time, 1.0, frame)
    problem.set_multipliers()
    return problem


def _of_bodies(mesh: Mesh, flat: Any) -> dict[str, Any]:
    """Coordinates (n, rows, nodes), real or complex, as `Modes` has them of every body, (n, nodes, vectors, dim)."""
    if np.iscomplexobj(flat):
        both = _of_bodies(mesh, np.concatenate([flat.real, flat.imag]))
        return {name: q[: len(flat)] + 1j * q[len(flat) :] for name, q in both.items()}
    found = {}
    for name, q in mesh.by_body(flat).items():
        body = mesh.bodies[name]
        if isinstance(body, MassMesh):
            found[name] = q
            continue
        field = field_of(body, q[None], None)
        found[name] = field.coordinates if isinstance(field, HermiteField) else field.coordinates[:, None]
    return found


def _normalised(shapes: Mapping[str, Complex]) -> tuple[dict[str, Complex], Complex]:
    """Shapes whose longest displacement in a period is 1 m, at its beginning, and what they are multiplied by.

    Of a displacement Re(u exp(iφ)) the square is ½ (|u|² + Re(u·u exp(2iφ))), which does not depend on directions.
    """
    places = np.concatenate([u[:, :, 0] for u in shapes.values()], axis=1)
    every = np.concatenate([u.reshape(len(u), -1, u.shape[-1]) for u in shapes.values()], axis=1)
    factors = []
    for u, others in zip(places, every, strict=True):
        turns_only = np.abs(u).max() < 1e-9 * np.abs(others).max()  # a body about its centre
        moved = others if turns_only else u
        product = (moved * moved).sum(axis=1)
        square = 0.5 * ((np.abs(moved) ** 2).sum(axis=1) + np.abs(product))
        k = int(square.argmax())
        factor = np.exp(-0.5j * np.angle(product[k])) / np.sqrt(square[k])
        turned = (moved[k] * factor).real
        factors.append(factor * np.sign(turned[np.abs(turned).argmax()]))
    found = np.array(factors)
    return {name: u * found[:, None, None, None] for name, u in shapes.items()}, found


def _check_balance(problem: SmallMotions, rates: Complex, vectors: Complex) -> None:
    """Warn if modes are about no equilibrium, by how far their stiffness would move the scene to one."""
    scene, squares = problem.system.scene, np.abs(rates) ** 2
    forces = np.abs(vectors.conj().T @ problem.residual())
    masses = (vectors.conj() * (problem.M @ vectors)).sum(axis=0).real
    known = squares > 1e-12 * squares.max(initial=0.0)  # what moves without stiffness has no equilibrium
    away = float((forces[known] / (masses[known] * squares[known])).max(initial=0.0))
    if away > AWAY * scene.length:
        warn(
            f"the last output that modes of scene {scene.name!r} are about is no equilibrium: its residual forces "
            f"would move it by about {away:.2g} m. Modes are those of the stiffness in this state; let the motion "
            f"come to rest first, or give about=at.solve_static(...)",
            EquilibriumWarning,
            stacklevel=3,
        )
