"""Selection of the global solver's integrator for a scene and a discretisation."""

from anctmm.discretise.discretisation import INTEGRATORS, Discretisation
from anctmm.errors import unknown_option
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from reference.global_dae.explicit import Zhai
from reference.global_dae.implicit import Esdirk, GeneralizedAlpha
from reference.global_dae.layout import Layout
from reference.global_dae.marching import Marcher
from reference.global_dae.stability import check_step
from reference.global_dae.statics import equilibria
from reference.global_dae.system import System


def motion(
    scene: Scene,
    run: Discretisation,
    solver: str,
    *,
    dense: bool = False,
    projected: bool = True,
    plain: bool = False,
) -> Solution:
    """Motion of a scene; errors as of `reference.global_dae.solve`.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    solver : str
        Its name, for the answer.
    dense : bool
        Whether the compiled solver's matrices are dense, and factored at each step.
    projected : bool
        Whether explicit steps are projected onto the constraints.
    plain : bool
        Whether the plain solver is taken, whatever the scene.
    """
    system = System(Layout(scene, run))
    if run.explicit and run.check_stability:
        check_step(system)
    if not plain:
        from reference.global_dae.rival import has, marched

        if has(system):
            return marched(system, solver, dense, projected)
    return _marcher(system, projected).march(solver)


def rest(scene: Scene, run: Discretisation, load_steps: int, solver: str) -> Solution:
    """Equilibria of a scene; errors as of `reference.global_dae.solve_static`."""
    return equilibria(System(Layout(scene, run)), load_steps, solver)


def _marcher(system: System, projected: bool) -> Marcher:
    match system.layout.run.integrator:
        case "zhai":
            return Zhai(system, projected)
        case "generalized-alpha":
            return GeneralizedAlpha(system)
        case "esdirk":
            return Esdirk(system)
        case other:
            raise unknown_option("integrator", other, INTEGRATORS)
