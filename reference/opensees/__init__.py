"""OpenSees: plane frames of beams that follow their chords (corotational), stepped implicitly.

Whatever element a discretisation names, this solver uses OpenSees' own beams without shear, which tend to the
extensible elastica. A model runs in a process of its own: OpenSees keeps one model a process, prints, and may end the
process that uses it. The cost is the processor time of its steps, measured inside that process; all else, the
start of the process included, is `build_s`. OpenSees counts the Newton corrections of the last step only, so that
`newton_iterations` stays 0. OpenSees is optional, the extra `peers`.

What was measured: steps begin with accelerations of zero unless these are given, which makes all schemes of first
order; `GeneralizedAlpha` converges linearly within a step, `HHTGeneralized`, the same scheme, quadratically; beams with
a consistent mass keep it in their first direction, an error of second order in the elements' length.
"""

from collections.abc import Iterator, Mapping
from time import process_time
from typing import Any

import numpy as np

from anctmm.discretise.discretisation import INTEGRATORS, Discretisation, discretise, parts_of_load
from anctmm.discretise.memory import check_memory
from anctmm.elements.kinds import check_kinds, optional_beside
from anctmm.errors import UnsupportedError, shown, unknown_option
from anctmm.model.bodies import beam_of
from anctmm.model.drives import tabulate
from anctmm.model.needs import MECHANISMS, refuse
from anctmm.model.scene import Clamp, Scene, checked_scene
from anctmm.results.ended_early import nothing
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers.capabilities import Offer
from anctmm.validation import one_of
from reference.opensees.answer import solution
from reference.opensees.frame import BEAMS, Frame
from reference.opensees.process import analyse

NAME = "opensees"
#: Solvers of linear equations: those that were found to work; SparseSYM was seen to give wrong corrections.
SYSTEMS = ("ProfileSPD", "BandGeneral", "BandSPD", "UmfPack", "SuperLU")
ALGORITHMS = ("Newton", "ModifiedNewton", "KrylovNewton", "BFGS", "NewtonLineSearch")
#: What was the cheapest somewhere, over mesh, step and tolerance, on the falling cantilever: the nonlinear beam, BFGS
#: and KrylovNewton never were.
CHOICES: tuple[Mapping[str, Any], ...] = (
    {"newton_tolerance": 1e-3},
    {"newton_tolerance": 1e-5},
    {"newton_tolerance": 1e-5, "algorithm": "ModifiedNewton"},
    {"newton_tolerance": 1e-3, "beam": "elastic-lumped"},
)
#: Kinds of element that a discretisation may name; frames use their own instead.
ELEMENTS = ("cable", "shear")
OFFER = Offer(
    lacks=optional_beside(ELEMENTS) | {"zhai", "esdirk", "damping", "stability", *MECHANISMS},
    element="frame",
    limits={"cable": "elastica"},
    choices=CHOICES,
)
#: Bytes that a model takes for each coordinate, and the history for each at an output, as measured.
MEMORY, KEPT = 1_500.0, 150.0
#: Angles at most beyond half a turn that rounding leaves, rad.
ROUNDING = 1e-9


def solve(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    beam: str = "elastic",
    algorithm: str = "Newton",
    system: str = "ProfileSPD",
    **options: Any,
) -> Solution:
    """Motion of a scene by OpenSees.

    Parameters
    ----------
    scene : Scene
        Beams joined in any way by pins and welds: chains, trees, loops; clamps turn by half a turn at most.
    run : Discretisation, optional
        "generalized-alpha" is OpenSees' HHTGeneralized. `newton_tolerance` bounds the norm of a correction, of
        displacements and rotations. `element` and `quadrature` are not used.
    beam : str
        "elastic": elasticBeamColumn with a consistent mass; "elastic-lumped": with masses at its nodes; "nonlinear":
        dispBeamColumnNL, whose rotations stretch its axis, with masses at its nodes.
    algorithm : str
        Newton's iteration, one of `ALGORITHMS`.
    system : str
        OpenSees' solver of linear equations, one of `SYSTEMS`.
    **options
        The fields of the discretisation, in its place.

    Returns
    -------
    Solution
        With status "unsupported" where OpenSees is missing or cannot do the scene, "failed" where it gives up, or its
        process ends.
    """
    began = process_time()
    run = discretise(run, options)
    checked_scene(scene)
    _check(beam, algorithm, system)
    check_memory(scene, run, MEMORY, kept_each=KEPT)
    try:
        _check_scene(scene, run, run.integrator)
        _check_turns(scene, run)
        frame = Frame(scene, run, beam)
        analysis = analyse(frame.job(system, algorithm, run.steps))
    except UnsupportedError as why:
        return nothing(NAME, scene, run, Status("unsupported", str(why)))
    return solution(NAME, frame, analysis, process_time() - began)


def solve_static(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    load_steps: int = 10,
    beam: str = "nonlinear",
    algorithm: str = "Newton",
    system: str = "BandGeneral",
    **options: Any,
) -> Solution:
    """Equilibrium of a scene by OpenSees; `t` of the solution are load factors.

    Parameters
    ----------
    scene : Scene
        Loads and drives as they are at t = 0.
    run : Discretisation, optional
        Its mesh is used.
    load_steps : int
        Equal steps of the load; those that fail are halved.
    beam, algorithm, system
        As for `solve`. The nonlinear beam has the smaller error by two powers of ten on a mesh of eight elements.
    **options
        The fields of the discretisation, in its place.
    """
    began = process_time()
    run = discretise(run, options)
    checked_scene(scene)
    _check(beam, algorithm, system)
    load_steps = parts_of_load(load_steps)
    check_memory(scene, run, MEMORY, outputs=load_steps + 1, kept_each=KEPT)
    try:
        _check_scene(scene, run, "statics")
        frame = Frame(scene, run, beam, static=True)
        analysis = analyse(frame.job(system, algorithm, load_steps))
    except UnsupportedError as why:
        return nothing(NAME, scene, run, Status("unsupported", str(why)))
    return solution(NAME, frame, analysis, process_time() - began)


def _check(beam: str, algorithm: str, system: str) -> None:
    one_of("beam", beam, BEAMS)
    one_of("algorithm", algorithm, ALGORITHMS)
    one_of("system", system, SYSTEMS)


def _check_scene(scene: Scene, run: Discretisation, mode: str) -> None:
    match mode:
        case "statics" | "generalized-alpha":
            pass
        case "zhai":
            raise UnsupportedError(
                f"integrator is {mode!r}; OpenSees' explicit steps need a mass for every coordinate, and its beams "
                f"give rotations none that is diagonal: 'generalized-alpha' is needed"
            )
        case "esdirk":
            raise UnsupportedError(
                f"integrator is {mode!r}; OpenSees' implicit steps are of second order: 'generalized-alpha' is needed"
            )
        case _:
            raise unknown_option("integrator", mode, INTEGRATORS)
    refuse(scene, OFFER.lacks, "a model in OpenSees", mode)
    for body in map(beam_of, scene.beams):
        if body.material.damping > 0.0:
            raise UnsupportedError(
                f"damping is {body.material.damping!r} s for body {body.name!r}; OpenSees damps whole models by "
                f"stiffness matrices that turn nothing, another model: 0 is needed here"
            )
    check_kinds(run.of(scene), ELEMENTS, "a model in OpenSees", UnsupportedError)


def _check_turns(scene: Scene, run: Discretisation) -> None:
    """Refuse clamps that turn too far: a chord's angle is taken in (−π, π], where its elements break."""
    for clamp, angles in _driven(scene, run):
        far = np.flatnonzero(np.abs(angles) > np.pi + ROUNDING)
        if far.size:
            time = float(run.times(far[:1])[0])
            raise UnsupportedError(
                f"{shown(clamp)} has turned by more than half a turn at t = {time:.6g} s; OpenSees' frames turn with "
                f"their chords, whose angles jump from π to −π; there Newton's iteration fails on every "
                f"mesh: at most half a turn is needed"
            )


def _driven(scene: Scene, run: Discretisation) -> Iterator[tuple[Clamp, Any]]:
    """Driven clamps with their angles at the steps, rad."""
    for joint in scene.joints:
        if isinstance(joint, Clamp) and joint.angle is not None:
            t = run.times(np.arange(run.steps + 1))
            yield joint, tabulate(f"clamp {joint.end!r} angle", joint.angle, t, 3)[:, 0]
