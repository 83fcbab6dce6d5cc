"""The ANC-TMM solver: (scene, discretisation) → solution."""

from typing import Any

from anctmm.discretise.discretisation import Discretisation, discretise
from anctmm.discretise.memory import check_memory
from anctmm.discretise.methods import Esdirk, GeneralizedAlpha, Zhai
from anctmm.elements.kinds import check_kinds, kind_of, moved_by
from anctmm.equilibria import solve_static
from anctmm.integrators.integrate import integrate
from anctmm.model.bodies import beam_of
from anctmm.model.checks.start import check_rigid_start
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.accounting import accounted
from anctmm.results.metrics import verified
from anctmm.results.solution import Solution
from anctmm.small_motions import modes
from anctmm.solvers.capabilities import Offer, uncombined
from anctmm.system.system import System
from anctmm.validation import flag

__all__ = ["modes", "solve", "solve_static"]

#: Bytes that a run takes for each coordinate, by integrator: as measured, and 8 more for each of 8 vectors of stages.
BYTES = {Zhai.name: 300.0, GeneralizedAlpha.name: 300.0, Esdirk.name: 400.0}
OFFER = Offer(lacks=uncombined(), extras=frozenset({Esdirk.name}))


@accounted
def solve(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    start: Solution | None = None,
    verify: bool = False,
    **options: Any,
) -> Solution:
    """Simulate a scene by ANC-TMM.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its fields as keywords.
    start : Solution, optional
        An equilibrium of `solve_static` of the same bodies and joints, mesh and elements: the motion starts there,
        preloaded. Loads, gravity and connectors may be others, as where a load is let go. The undeformed scene
        without it.
    verify : bool
        Whether to run again, with half the step or a tenth of the tolerance, and give the error of time stepping as
        `Solution.error_estimate`. The cost of the solution is without that run.

    Returns
    -------
    Solution
        A run that diverges or fails is no exception: its status says when, where and what to try, and the history
        up to then is kept.

    Raises
    ------
    DiscretisationError
        Or one of its kinds, before any work, if the options are wrong or do not fit the scene, or if the run takes
        more memory than is free.
    Interrupted
        A KeyboardInterrupt with the history until then, if Ctrl-C is pressed while steps are taken.
    """
    run = discretise(run, options, fixed_step=False)
    found = _solved(scene, run, start)
    if flag("verify", verify):
        return verified(lambda finer: _solved(scene, finer, start), found)
    return found


def _solved(scene: Scene, run: Discretisation, start: Solution | None) -> Solution:
    return integrate(system_of(scene, run), start)


def system_of(scene: Scene, run: Discretisation) -> System:
    """The equations of a scene, which is checked before."""
    cut = run.of(checked_scene(scene, space=True))
    check_memory(scene, run, BYTES[run.method.name])
    check_kinds(cut, moved_by(run.integrator), f"integrator {run.integrator!r}")
    if scene.dim == 3:
        check_kinds(cut, ("cable",), "space")
    for name, (_, kind) in cut.items():
        if kind_of(kind).rigid:
            check_rigid_start(beam_of(scene.body(name)), stacklevel=6)
    return System(scene, run)
