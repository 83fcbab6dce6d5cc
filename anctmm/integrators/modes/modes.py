"""Natural modes of a scene about its start, an equilibrium or a steady spin.

The lowest modes come from ARPACK by shift and invert. The inverse is the Riccati recursion with its sweeps, so nothing
global is assembled.
"""

from typing import Any

import numpy as np

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation, discretise
from anctmm.discretise.lacking import LACKING
from anctmm.errors import DiscretisationError
from anctmm.integrators.modes.configurations import check_balance, checked, last_of, steady_state
from anctmm.integrators.modes.eigenvalues import Array, Complex, lowest
from anctmm.integrators.modes.frames import GROUND, Frame, frame_at, spun
from anctmm.integrators.modes.shapes import Modes
from anctmm.integrators.modes.small_motions import SmallMotions
from anctmm.integrators.statics.static_system import StaticSystem
from anctmm.model.needs import refuse
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.solution import Solution
from anctmm.validation import number, whole

#: Modes at most.
MOST = 10_000


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

    Warns
    -----
    EquilibriumWarning
        If the last output of a motion is no equilibrium.

    Notes
    -----
    About a motion, drives that stand still are held. If a clamp with a constant rate alone holds the scene, the modes
    are those of a steady rotation; if guides in the ground move at one constant velocity, of a steady translation.
    Velocities relative to that moving frame are neglected. About motions with other moving drives there are no modes,
    because the coefficients of the linearised equations change with time.
    """
    refuse(checked_scene(scene), LACKING, "a search for modes")
    run = discretise(run, options)
    chain = Chain(scene, run)
    count = None if count is None else whole("count", count, MOST, DiscretisationError)
    spin = number("spin (rad/s)", spin, DiscretisationError)
    if spin and about is not None:
        raise DiscretisationError(
            "spin is given beside about; one of them is allowed: the steady state is found"
        )
    system, q, factor, frame = _state(chain, about, spin)
    problem = SmallMotions(system, q, factor, frame.spin, about is None)
    values, vectors = lowest(problem, count)
    rates = np.abs(values)
    fields = np.stack([_normalised(problem.spread(x)) for x in vectors.T])
    if about is not None and not about.static:
        check_balance(system, q, factor, frame, values, fields)
    real, imaginary = chain.by_body(fields.real), chain.by_body(fields.imag)
    return Modes(
        scene,
        run,
        np.abs(values.imag) / (2.0 * np.pi),
        np.divide(0.0 - values.real, rates, out=np.zeros(len(values)), where=rates > 0.0),
        values.real + 0.0,
        {name: real[name] + 1j * imaginary[name] for name in real},
        chain.by_body(q),
    )


def _state(chain: Chain, about: object, spin: float) -> tuple[StaticSystem, Array, float, Frame]:
    """What small motions are about: equations and coordinates, the part of the loads, the frame that is steady."""
    if about is None:
        system = StaticSystem(chain)
        if not spin:
            return system, system.reference.copy(), 0.0, GROUND
        frame = spun(chain.scene, spin)
        return system, steady_state(system, frame), 1.0, frame
    about = checked(chain, about)
    time = 0.0 if about.static else float(about.t[-1])
    frame = GROUND if about.static else frame_at(chain.scene, time)
    system = StaticSystem(chain, time)
    return system, *last_of(system, about, frame), frame


def _normalised(u: Complex | Array) -> Complex:
    """A mode, (rows, nodes), whose largest displacement is 1 and real."""
    places = u[:2].astype(complex)
    k = np.unravel_index(int(np.abs(places).argmax()), places.shape)
    if abs(places[k]) < 1e-9 * float(np.abs(u).max()):  # a body that turns about its centre
        k = np.unravel_index(int(np.abs(u).argmax()), u.shape)
        return np.asarray(u / u[k])
    return np.asarray(u / places[k])
