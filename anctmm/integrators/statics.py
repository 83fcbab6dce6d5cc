"""Statics by ANC-TMM: equilibria under a growing load, each of which says whether it is stable."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, assert_never

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation, discretise, parts_of_load
from anctmm.elements.kinds import check_kinds, with_statics
from anctmm.integrators.equilibrium_stability import Stability, lowest_mode, stability_of
from anctmm.integrators.load_path import MANY, LoadPath
from anctmm.integrators.output import Record, worst_element
from anctmm.integrators.stable_branch import downhill, stable_path
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.accounting import accounted
from anctmm.results.solution import Solution, Status
from anctmm.results.stability_status import singular, unstable
from anctmm.validation import one_of

Array = NDArray[np.float64]
#: Takes a search on to a load factor; a status if it cannot be reached.
Advance = Callable[[float], Status | None]

BRANCHES = ("path", "stable")
#: Elements of a body with which a mesh of MANY nodes is asked whether the scene is a mechanism.
COARSE = 8
ADVICE = "branch='stable' finds a stable one"


@accounted
def solve_static(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    load_steps: int = 1,
    branch: str = "path",
    **options: Any,
) -> Solution:
    """Equilibrium of a scene under gravity and the loads of t = 0.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its fields as keywords; only mesh, element, quadrature and newton_tolerance matter.
    load_steps : int
        Equal parts of the load whose equilibria are kept. A part that Newton's iteration does not reach is halved as
        often as needed.
    branch : str
        "path": what Newton's iteration reaches from the equilibrium before, be it stable or not; which one that is may
        depend on `load_steps`. "stable": a minimum of the potential energy, that to which slow loading with much
        damping leads, past buckling and jumps; it does not depend on `load_steps`. Of two that are equally near, as of
        a perfect column, the one towards positive y (or x) is taken.

    Returns
    -------
    Solution
        `t` holds the load factors from 0 to 1; the last output is the equilibrium under the whole load. The status is
        "ok" if all equilibria but that of factor 0, the undeformed scene, are stable. It is "unstable" from the first
        load factor on at which the potential energy has no minimum; "singular" if a motion needs no force there (a
        mechanism, a body that is free to move, the limit of stability); "diverged" where no equilibrium is found;
        "imprecise" where rounding leaves fewer than four digits, as on very fine meshes. The message says where, and
        what to try.

    Raises
    ------
    DiscretisationError
        If the options are wrong or do not fit the scene.
    """
    load_steps = parts_of_load(load_steps)
    one_of("branch", branch, BRANCHES)
    chain = Chain(checked_scene(scene), discretise(run, options))
    check_kinds(chain.run.of(chain.scene), with_statics(), "statics")
    search = LoadPath(chain)
    search.newton(0.0)  # compiles
    stability_of(search.system, search.q, 0.0)
    search.reset()
    advance = search.reach if branch == "path" else _relaxation(search)
    return _solution(search, advance, np.arange(load_steps + 1) / load_steps)


def _solution(search: LoadPath, advance: Advance, factors: Array) -> Solution:
    """Equilibria at load factors, as far as they are found, and what is wrong with them."""
    record = Record(search.chain, outputs=len(factors))
    record.start()
    doubt: Status | None = None
    status: Status | None = None
    kept = 1
    _store(search, record, 0)
    for k in range(1, len(factors)):
        status = advance(float(factors[k]))
        if status is not None:
            break
        _store(search, record, k)
        doubt = doubt or _doubt(search, float(factors[k - 1]))
        kept = k + 1
    status = status or search.precision()
    if doubt is not None:
        status = doubt if status.ok else replace(status, message=f"{status.message}; {doubt.message}")
    return record.solution(kept, status, kept - 1, search.iterations, search.iterations, t=factors[:kept])


def _relaxation(search: LoadPath) -> Advance:
    """Along the stable branch; its own steps do not depend on the load factors asked for."""
    path = stable_path(search.system)
    here, ahead = next(path), next(path, None)

    def advance(target: float) -> Status | None:
        nonlocal here, ahead
        while ahead is not None and ahead[0] <= target:
            here, ahead = ahead, next(path, None)
        q = here[1] if here[0] == target else downhill(search.system, here[1], target)
        return search.stuck(here[0]) if q is None else search.adopt(target, q)

    return advance


def _doubt(search: LoadPath, before: float) -> Status | None:
    """What is wrong with the equilibrium reached, if it is not stable; the one before was at a load factor."""
    system, factor = search.system, search.factor
    found = stability_of(system, search.q, factor)
    if found.kind == "singular" and not _is_singular_on_any_mesh(search, factor):
        found = Stability("unstable" if found.negative else "stable", found.negative, found.motion)
    match found.kind:
        case "stable":
            return None
        case "singular":
            return singular(factor, *worst_element(search.chain, system.sizes(found.motion)))
        case "unstable":
            mode = lowest_mode(system, search.q, factor)[1]
            worst = worst_element(search.chain, system.sizes(mode))
            return unstable(factor, found.negative, *worst, before, ADVICE)
        case _:
            assert_never(found.kind)


def _is_singular_on_any_mesh(search: LoadPath, factor: float) -> bool:
    """Whether a singular tangent is one of the scene and not the rounding of a very fine mesh."""
    chain = search.chain
    if chain.bodies.nodes < MANY:
        return True
    mesh = {name: min(elements, COARSE) for name, (elements, _) in chain.run.of(chain.scene).items()}
    coarse = LoadPath(Chain(chain.scene, replace(chain.run, mesh=mesh)))
    if coarse.reach(factor) is not None:
        return False
    return stability_of(coarse.system, coarse.q, factor).kind == "singular"


def _store(search: LoadPath, record: Record, place: int) -> None:
    """Keep the equilibrium reached."""
    record.q[place] = search.q
    record.energy[place, 1] = search.system.strain_energy(search.q)
