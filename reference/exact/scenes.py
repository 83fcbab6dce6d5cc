"""Exact statics of scenes: one beam, clamped at its start, under constant loads at its end and gravity."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import SceneError
from anctmm.model.bodies import beam_of
from anctmm.model.scene import Beam, Clamp, Force, Scene, Torque, checked_scene
from anctmm.results.solution import Energy, Solution
from anctmm.validation import one_of
from reference.exact.cantilever import Cantilever
from reference.exact.director import DirectorShape, solve_director
from reference.exact.rods import Rigidity, RodShape, solve_rod

Array = NDArray[np.float64]

#: elastica: the cable's continuum; reissner: shear factor 1; director: the paper's shear element's continuum.
MODELS = ("director", "elastica", "reissner")
Shape = RodShape | DirectorShape


def cantilever_problem(scene: Scene) -> tuple[Beam, Cantilever]:
    """The cantilever a scene is: one beam clamped at its start, constant forces and torques at its end, gravity.

    Loads on the clamped end go into the ground and change nothing. The initial velocity does not matter.

    Raises
    ------
    SceneError
        If it is none, naming what is in the way.
    """

    def refused(what: str) -> SceneError:
        return SceneError(
            f"scene {scene.name!r} has {what}; a cantilever under constant loads has an exact static"
        )

    if len(checked_scene(scene).bodies) != 1:
        names = ", ".join(repr(b.name) for b in scene.bodies)
        raise refused(f"{len(scene.bodies)} bodies ({names})")
    if scene.connectors:
        raise refused(repr(scene.connectors[0]))
    beam = beam_of(scene.bodies[0])
    if scene.joints != (Clamp(f"{beam.name}.start"),):
        raise refused(f"the joints {scene.joints!r}, not ({Clamp(f'{beam.name}.start')!r},)")
    force, moment = np.zeros(2), 0.0
    for load in scene.loads:
        if callable(load.value):
            raise refused(f"the load {load!r}, which varies in time")
        if not isinstance(load, Force | Torque) or (isinstance(load, Force) and load.follower):
            raise refused(repr(load))
        place = scene.place(load.end)
        if place.interior:
            raise refused(f"{load!r} between the ends")
        if place.key == 0:
            continue  # it goes into the ground
        if isinstance(load, Force):
            force += load.value
        else:
            moment += load.value
    weight = beam.material.density * beam.section.area * np.asarray(scene.gravity)
    return beam, Cantilever(
        beam.length, (force[0], force[1]), moment, (weight[0], weight[1]), beam.start, beam.angle
    )


def cantilever_static(scene: Scene, model: str = "elastica") -> Shape:
    """Exact equilibrium of a cantilever's scene.

    Parameters
    ----------
    scene : Scene
        See `cantilever_problem`.
    model : str
        "elastica" (extensible, Euler-Bernoulli), "reissner" (with shear, factor 1) or "director" (the
        continuum of the paper's shear-deformable element).

    Raises
    ------
    SceneError
        If there is no exact solution for such a scene.
    SolverError
        If the loads lead past a limit point.
    """
    one_of("model", model, MODELS)
    beam, problem = cantilever_problem(scene)
    if model == "director":
        return solve_director(problem, beam.section, beam.material)
    rigidity = Rigidity.euler_bernoulli if model == "elastica" else Rigidity.timoshenko
    return solve_rod(problem, rigidity(beam.section, beam.material))


def solve_static(scene: Scene, model: str = "elastica") -> Solution:
    """The same as a `Solution` at the load factors 0 and 1; parameters and errors of `cantilever_static`."""
    shape = cantilever_static(scene, model)
    zero = np.zeros(2)
    energy = Energy(
        zero,
        np.array([0.0, shape.strain_energy]),
        np.array([0.0, shape.load_potential]),
        np.array([0.0, shape.moment_work]),
    )
    fields = {scene.bodies[0].name: StaticField(shape)}
    return Solution(f"exact-{model}", scene, None, np.array([0.0, 1.0]), fields, energy, static=True)


@dataclass(frozen=True)
class StaticField:
    """Axis of a cantilever without and with its loads."""

    shape: Shape

    def position(self, fraction: float) -> Array:
        """Positions at a fraction of the undeformed length, (2, 2), m."""
        return np.stack([self.shape.problem.undeformed(fraction), self.shape.position(fraction)])
