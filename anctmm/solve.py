"""The ANC-TMM solver: (scene, discretisation) → solution."""

from functools import wraps
from typing import Any, assert_never

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation, discretise
from anctmm.discretise.kept_chains import chain_of, once
from anctmm.discretise.lacking import LACKING
from anctmm.discretise.memory import NONE, check_memory, couplings_of
from anctmm.discretise.methods import Esdirk, GeneralizedAlpha, Method, Zhai
from anctmm.elements.kinds import check_kinds, kind_of, moved_by
from anctmm.integrators import esdirk, generalized_alpha, statics, zhai
from anctmm.integrators import modes as modes_of_chains
from anctmm.integrators.adaptive import alpha_control, stage_control
from anctmm.integrators.static_start import started
from anctmm.model.bodies import beam_of
from anctmm.model.checks.start import check_rigid_start
from anctmm.model.needs import refuse
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.accounting import accounted
from anctmm.results.solution import Solution
from anctmm.results.verification import verified
from anctmm.solvers.capabilities import Offer, uncombined
from anctmm.validation import flag

__all__ = ["modes", "solve", "solve_static"]

#: Bytes that a run takes for each coordinate, by integrator: as measured, and 8 more for each of 8 vectors of stages.
BYTES = {Zhai.name: 150.0, GeneralizedAlpha.name: 240.0, Esdirk.name: 304.0}
OFFER = Offer(lacks=uncombined() | LACKING, extras=frozenset({Esdirk.name}))


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
    if checked_scene(scene).own_joints:
        from anctmm.march.integrate import integrate  # it loads the compiler
        from anctmm.system.system import System

        return integrate(System(scene, run), start)
    chain = chain_of(scene, run, _checked_chain)
    if start is not None:
        chain = started(chain, start)
    method = once(chain, _method)
    match method:
        case Zhai():
            return zhai.integrate(chain)
        case GeneralizedAlpha():
            implicit = generalized_alpha if chain.run.tolerance is None else alpha_control
            return implicit.integrate(chain)
        case Esdirk():
            high = esdirk if chain.run.tolerance is None else stage_control
            return high.integrate(chain)
    assert_never(method)


@wraps(statics.solve_static)
def solve_static(scene: Scene, *arguments: Any, **options: Any) -> Solution:
    """Equilibria of a scene: see `anctmm.integrators.statics.solve_static`."""
    if checked_scene(scene).own_joints:
        from anctmm.equilibria import solve_static as by_rows

        return by_rows(scene, *arguments, **options)
    return statics.solve_static(scene, *arguments, **options)


@wraps(modes_of_chains.modes)
def modes(scene: Scene, *arguments: Any, **options: Any) -> Any:
    """Natural modes of a scene: see `anctmm.integrators.modes.modes`."""
    if checked_scene(scene).own_joints:
        from anctmm.small_motions import modes as by_rows

        return by_rows(scene, *arguments, **options)
    return modes_of_chains.modes(scene, *arguments, **options)


def _method(chain: Chain) -> Method:
    return chain.run.method


def _checked_chain(scene: Scene, run: Discretisation) -> Chain:
    """A scene cut into elements, if ANC-TMM has what it needs, and the machine the memory."""
    refuse(checked_scene(scene), LACKING, "ANC-TMM", run.integrator)
    check_memory(
        scene, run, BYTES[run.method.name], coupled=NONE if run.explicit else couplings_of(scene, run)
    )
    check_kinds(run.of(scene), moved_by(run.integrator), f"integrator {run.integrator!r}")
    for name, (_, kind) in run.of(scene).items():
        if kind_of(kind).rigid:
            check_rigid_start(beam_of(scene.body(name)), stacklevel=6)
    return Chain(scene, run)
