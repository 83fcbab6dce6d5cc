"""An ordinary ANCF solver (Rong 2014, eq. 14): every body has its own coordinates, joints are constraints.

[M Φᵀ; Φ 0] [q̈; μ] = [F; b̈] is solved for the accelerations of the bodies' coordinates and the joints' multipliers, or,
implicit, for the coordinates themselves. It shares the element kernels with ANC-TMM, and nothing of its way to solve.
"""

from typing import Any

from anctmm.discretise.discretisation import Discretisation, discretise, parts_of_load
from anctmm.discretise.memory import check_memory
from anctmm.model.needs import MECHANISMS, refuse
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.accounting import accounted
from anctmm.results.solution import Solution
from anctmm.solvers.capabilities import Offer
from anctmm.validation import one_of

__all__ = ["solve", "solve_dense", "solve_static"]

#: Steps of high order are those of beams with joints that are linear, or clamps, without damping.
OFFER = Offer(
    lacks=frozenset(
        f"esdirk + {feature}" for feature in (*MECHANISMS, "damping", "rigid") if feature != "free-stretch"
    ),
    extras=frozenset({"esdirk"}),
    slow_with=frozenset(MECHANISMS),  # see `reference.global_dae.mechanisms`
)
#: Bytes that an explicit and an implicit run take for each coordinate, as measured (factors are tried in several
#: orders), and a dense matrix for each pair.
EXPLICIT, IMPLICIT, DENSE = 1_100.0, 5_000.0, 24.0
LINEAR_ALGEBRA = ("sparse-factored-once", "dense-refactor")
STABILIZATION = ("projection", "none")
NAMES = dict(zip(LINEAR_ALGEBRA, ("global-dae", "global-dae-dense"), strict=True))


@accounted
def solve(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    linear_algebra: str = "sparse-factored-once",
    stabilization: str = "projection",
    **options: Any,
) -> Solution:
    """Motion of a scene.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its parameters as keywords.
    linear_algebra : str
        "sparse-factored-once": the constant matrix of the explicit steps is factored once, that of Newton's iteration
        only when it converges slowly, by sparse LU, all compiled. "dense-refactor": a dense matrix is assembled and
        solved by LAPACK at each explicit step and each Newton iteration, as the paper's ordinary ANCF does.
    stabilization : str
        Of explicit runs: "projection" of positions and velocities onto the constraints after each step, or "none",
        which lets rounding and truncation drift. Implicit runs fulfil Φ q = b at each step anyhow.

    Integrator "esdirk" stands for implicit steps of high order. Here these are collocation at Gauss's points, of order
    6, on independent coordinates, by NumPy and SciPy: another method than ANC-TMM's, so that references are found by
    two roads. It is slower, and no contestant of the trade.

    Returns
    -------
    Solution
        `dofs` counts the coordinates of all bodies (6 a node, 4 of a cable), not the multipliers.

    Raises
    ------
    DiscretisationError
        Or one of its kinds: options that do not fit each other or the scene, a weld between element kinds.
    StabilityError
        If the step of an explicit run is above the stability limit and `check_stability` is set.
    """
    run = discretise(run, options)
    one_of("linear_algebra", linear_algebra, LINEAR_ALGEBRA)
    one_of("stabilization", stabilization, STABILIZATION)
    dense = linear_algebra == "dense-refactor"
    check_memory(checked_scene(scene), run, EXPLICIT if run.explicit else IMPLICIT, DENSE if dense else 0.0)
    refuse(scene, OFFER.lacks, "the global solver", run.integrator)
    # here, and not above: to see what is offered takes no SciPy
    from reference.global_dae.runs import motion

    projected = stabilization == "projection"
    return motion(scene, run, dense=dense, projected=projected, solver=NAMES[linear_algebra])


def solve_dense(scene: Scene, run: Discretisation | None = None, **options: Any) -> Solution:
    """Motion of a scene with `linear_algebra="dense-refactor"`, see `solve`."""
    return solve(scene, run, linear_algebra="dense-refactor", **options)


@accounted
def solve_static(
    scene: Scene, run: Discretisation | None = None, *, load_steps: int = 1, **options: Any
) -> Solution:
    """Equilibrium of a scene under gravity and the loads of t = 0, by Newton's iteration with multipliers.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its parameters as keywords; mesh, element, quadrature and newton_tolerance matter.
    load_steps : int
        Equal parts of the load whose equilibria are kept; parts that Newton does not reach are halved as needed.

    Returns
    -------
    Solution
        `t` holds the load factors; `energy.potential` is that of the whole dead load. Equilibria that are not stable
        make the status "unstable" or "singular", as in `anctmm.solve_static`.

    Raises
    ------
    DiscretisationError
        Or one of its kinds, as in `solve`.
    """
    run, load_steps = discretise(run, options), parts_of_load(load_steps)
    check_memory(checked_scene(scene), run, IMPLICIT, outputs=load_steps + 1)
    from reference.global_dae.runs import rest

    return rest(scene, run, load_steps, "global-dae")
