"""An ordinary multibody solver (Rong 2014, eq. 14): every body has its own coordinates, joints are constraints.

M q̈ + Jᵀμ = f, Φ = 0 is marched in two ways: by a plain solver in NumPy and SciPy (the judge), which has all features,
and, of beams with pins, welds and clamps, by a compiled one with a sparse factorization that is kept (the rival, whose
times are compared). See README.md for what they share with ANC-TMM.
"""

from typing import Any

from anctmm.discretise.discretisation import INTEGRATORS, Discretisation, discretise, parts_of_load
from anctmm.discretise.memory import check_memory
from anctmm.errors import unknown_option
from anctmm.model.needs import MECHANISMS, refuse
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.accounting import accounted
from anctmm.results.solution import Solution
from anctmm.solvers.capabilities import Offer
from anctmm.validation import one_of

__all__ = ["solve", "solve_dense", "solve_plain", "solve_static"]

OFFER = Offer(
    lacks=frozenset({"own-joints"}),
    extras=frozenset({"esdirk"}),
    slow_with=frozenset({*MECHANISMS, "esdirk"}),
)
#: Bytes for each coordinate, and of a dense matrix for each pair.
SPARSE, DENSE = 5_000.0, 24.0
NAMES = {"sparse-factored-once": "global-dae", "dense-refactor": "global-dae-dense"}


@accounted
def solve(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    linear_algebra: str = "sparse-factored-once",
    **options: Any,
) -> Solution:
    """Motion of a scene; its Solution's `dofs` count the coordinates of all bodies, not the multipliers.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its parameters as keywords.
    linear_algebra : str
        Of scenes that the compiled solver has. "sparse-factored-once": the constant matrix of explicit steps is
        factored once, that of Newton's iteration only when it converges slowly. "dense-refactor": a dense matrix is
        solved by LAPACK at each step and each Newton iteration, as the paper's ordinary ANCF does.

    Raises
    ------
    DiscretisationError
        Or one of its kinds: options that do not fit each other or the scene, a weld between element kinds.
    StabilityError
        If the step of an explicit run is above the stability limit and `check_stability` is set.
    UnsupportedError
        If a joint is of a user's own kind.
    """
    run = discretise(run, options)
    one_of("linear_algebra", linear_algebra, NAMES)
    dense = linear_algebra == "dense-refactor"
    check_memory(_offered(scene), run, SPARSE, pair=DENSE if dense else 0.0)
    return _motion(scene, run, NAMES[linear_algebra], dense)


def solve_dense(scene: Scene, run: Discretisation | None = None, **options: Any) -> Solution:
    """Motion of a scene with `linear_algebra="dense-refactor"`, see `solve`."""
    return solve(scene, run, linear_algebra="dense-refactor", **options)


@accounted
def solve_plain(scene: Scene, run: Discretisation | None = None, **options: Any) -> Solution:
    """Motion of any scene by the plain solver, which is slow; parameters and errors as of `solve`."""
    run = discretise(run, options)
    check_memory(_offered(scene), run, SPARSE)
    return _motion(scene, run, NAMES["sparse-factored-once"], plain=True)


@accounted
def solve_static(
    scene: Scene, run: Discretisation | None = None, *, load_steps: int = 1, **options: Any
) -> Solution:
    """Equilibrium of a scene under gravity and the loads of t = 0; parameters and errors as of `solve`.

    `load_steps` equal parts of the load are kept; those that Newton does not reach are halved as needed. `t` holds the
    load factors. Equilibria that are not stable make the status "unstable" or "singular", as in `anctmm.solve_static`.
    """
    run, load_steps = discretise(run, options), parts_of_load(load_steps)
    check_memory(_offered(scene), run, SPARSE, outputs=load_steps + 1)
    from reference.global_dae.layout import Layout
    from reference.global_dae.statics import equilibria
    from reference.global_dae.system import System

    return equilibria(System(Layout(scene, run)), load_steps, "global-dae")


def _offered(scene: Scene) -> Scene:
    """The scene, which has nothing that is not offered."""
    refuse(checked_scene(scene), OFFER.lacks, "the global solver")
    return scene


def _motion(
    scene: Scene, run: Discretisation, solver: str, dense: bool = False, plain: bool = False
) -> Solution:
    # here, and not above: to see what is offered takes no SciPy
    from reference.global_dae.integrators import Esdirk, GeneralizedAlpha, Zhai
    from reference.global_dae.layout import Layout
    from reference.global_dae.rival import Rival, has
    from reference.global_dae.stability import check_step
    from reference.global_dae.system import System

    marchers = {"zhai": Zhai, "generalized-alpha": GeneralizedAlpha, "esdirk": Esdirk}
    if run.integrator not in marchers:
        raise unknown_option("integrator", run.integrator, INTEGRATORS)
    system = System(Layout(scene, run))
    if run.explicit and run.check_stability:
        check_step(system)
    if not plain and has(system):
        return Rival(system, dense).march(solver)
    return marchers[run.integrator](system).march(solver)
