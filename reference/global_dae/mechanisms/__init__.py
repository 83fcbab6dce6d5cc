"""Scenes with rigid bodies, guides, connectors or other loads: general equations, in plain NumPy.

M q̈ + Jᵀμ = f(q, q̇, t), Φ(q, t) = 0. Nothing here is shared with ANC-TMM except the elastic forces of beams. Matrices
are dense for both settings of linear algebra: the code is written for verification, not for speed.
"""

from anctmm.discretise.discretisation import INTEGRATORS, Discretisation
from anctmm.discretise.memory import check_memory
from anctmm.elements.kinds import kind_of
from anctmm.errors import UnsupportedError, unknown_option
from anctmm.model.needs import needs
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from reference.global_dae.mechanisms.explicit import Zhai
from reference.global_dae.mechanisms.implicit import GeneralizedAlpha
from reference.global_dae.mechanisms.layout import Layout
from reference.global_dae.mechanisms.stability import check_step
from reference.global_dae.mechanisms.static import equilibria
from reference.global_dae.mechanisms.system import System

#: Bytes that dense matrices take for each pair of coordinates, as measured.
DENSE = 80.0


def is_mechanism(scene: Scene, run: Discretisation) -> bool:
    """Whether a scene has more than beams that bend, with pins, welds, clamps and loads on their ends.

    Steps of high order have coordinates of their own for clamps that leave the stretch free.
    """
    rigid = any(kind_of(kind).rigid for _, kind in run.of(scene).values())
    known = {"free-stretch"} if run.integrator == "esdirk" else set()
    return rigid or any(feature not in known for feature, _ in needs(scene))


def motion(scene: Scene, run: Discretisation, solver: str) -> Solution:
    """Motion of a scene; errors as of `reference.global_dae.solve`."""
    check_memory(scene, run, 0.0, DENSE)
    system = System(Layout(scene, run))
    match run.integrator:
        case "zhai":
            if run.check_stability:
                check_step(system)
            return Zhai(system).march(solver)
        case "generalized-alpha":
            return GeneralizedAlpha(system).march(solver)
        case "esdirk":
            raise UnsupportedError(
                f"integrator is 'esdirk' for scene {scene.name!r}, which has rigid bodies, guides, connectors or other "
                f"loads; the global solver's steps of high order have none of them: 'generalized-alpha' is needed"
            )
        case _:
            raise unknown_option("integrator", run.integrator, INTEGRATORS)


def rest(scene: Scene, run: Discretisation, load_steps: int, solver: str) -> Solution:
    """Equilibria of a scene; errors as of `reference.global_dae.solve_static`."""
    check_memory(scene, run, 0.0, DENSE, outputs=load_steps + 1)
    return equilibria(System(Layout(scene, run)), load_steps, solver)
