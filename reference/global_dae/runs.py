"""Selection of the global solver's integrator or statics for a scene and a discretisation."""

from anctmm.discretise.discretisation import INTEGRATORS, Discretisation
from anctmm.errors import UnsupportedError, unknown_option
from anctmm.model.scene import Scene
from anctmm.results.load_work import with_load_work
from anctmm.results.solution import Solution
from reference.global_dae import mechanisms
from reference.global_dae.explicit import Zhai
from reference.global_dae.gauss import Gauss
from reference.global_dae.history import Marcher
from reference.global_dae.implicit import GeneralizedAlpha
from reference.global_dae.model import Model
from reference.global_dae.stability import check_step
from reference.global_dae.static import equilibria


def motion(scene: Scene, run: Discretisation, *, dense: bool, projected: bool, solver: str) -> Solution:
    """Motion of a scene; errors as of `reference.global_dae.solve`.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    dense : bool
        Whether matrices are dense, and factored at each step.
    projected : bool
        Whether explicit steps are projected onto the constraints.
    solver : str
        Its name, for the answer.
    """
    if mechanisms.is_mechanism(scene, run):
        if not projected:
            raise UnsupportedError(
                f"stabilization is 'none' for scene {scene.name!r}, which has rigid bodies, guides, "
                f"connectors or other loads; 'projection' is needed there"
            )
        return mechanisms.motion(scene, run, solver)
    return _marcher(Model.of(scene, run), dense, projected).run(solver)


def rest(scene: Scene, run: Discretisation, load_steps: int, solver: str) -> Solution:
    """Equilibria of a scene; errors as of `reference.global_dae.solve_static`."""
    if mechanisms.is_mechanism(scene, run):
        return with_load_work(mechanisms.rest(scene, run, load_steps, solver))
    return with_load_work(equilibria(Model.of(scene, run), load_steps, solver))


def _marcher(model: Model, dense: bool, projected: bool) -> Marcher:
    """The integrator of a discretisation."""
    run = model.run
    match run.integrator:
        case "zhai":
            if run.check_stability:
                check_step(model)
            return Zhai(model, dense, projected)
        case "generalized-alpha":
            return GeneralizedAlpha(model, dense)
        case "esdirk":
            if model.bodies.damping is not None:
                raise UnsupportedError(
                    f"integrator is 'esdirk' for scene {model.scene.name!r}, which has damping; the global solver's "
                    f"steps of high order know forces of coordinates and time only: 'generalized-alpha' is needed"
                )
            return Gauss(model, dense)
        case _:
            raise unknown_option("integrator", run.integrator, INTEGRATORS)
