"""Statics by ANC-TMM: equilibria under a growing load, and the stability of each."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import islice
from typing import Any, assert_never

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation, discretise, parts_of_load
from anctmm.discretise.lacking import LACKING
from anctmm.discretise.memory import check_memory, couplings_of
from anctmm.elements.kinds import check_kinds, with_statics
from anctmm.errors import DiscretisationError
from anctmm.integrators.output import Record, worst_element
from anctmm.integrators.statics.arc_length import ArcPath, Point
from anctmm.integrators.statics.equilibrium_stability import Stability, lowest_mode, stability_of
from anctmm.integrators.statics.load_path import MANY, LoadPath
from anctmm.integrators.statics.stable_branch import downhill, settled, stable_path
from anctmm.model.needs import refuse
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.accounting import accounted
from anctmm.results.checks.divergence import inside_out
from anctmm.results.checks.finding import part
from anctmm.results.checks.stability import singular, unlike_bodies, unstable
from anctmm.results.checks.unbalanced import never_balanced
from anctmm.results.ended_early import Interrupted, interruption_of_load
from anctmm.results.load_work import with_load_work
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.validation import one_of

Array = NDArray[np.float64]
#: Takes a search on to a load factor; a status if it cannot be reached.
Advance = Callable[[float], Status | None]

BRANCHES = ("path", "stable")
PATHS = ("load", "arclength")
#: First load factor of a path by its arc length, and points of it at most.
FIRST, POINTS = 1.0 / 32.0, 20_000
#: Elements of a body in the coarse mesh that tests, instead of one of MANY nodes, whether the scene is a mechanism.
COARSE = 8
#: Advice where forces have no potential, and so no branch is one of least energy.
LESS = "smaller loads, or a stiffer scene, may help"
ADVICE = "branch='stable' finds a stable one"
#: Bytes that are taken for each coordinate, as measured.
MEMORY = 280.0


@accounted
def solve_static(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    load_steps: int | None = None,
    branch: str = "path",
    path: str = "load",
    **options: Any,
) -> Solution:
    """Equilibrium of a scene under gravity and the loads of t = 0.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its fields as keywords; only mesh, element, quadrature and newton_tolerance matter.
    load_steps : int, optional
        Number of equal load increments; their equilibria are the outputs. Default 1. An increment that Newton's
        iteration does not reach is halved as often as needed. With path="arclength" it sets the first step (default
        32).
    branch : str
        "path"
            The equilibrium that Newton's iteration reaches from the one before, stable or not; it may depend on
            `load_steps`. If none is reached, as from a mechanism, a slack cable, or beyond a limit of stability, a
            stabilised path leads to a stable equilibrium, and the status says so.
        "stable"
            A minimum of the potential energy: the one to which slow loading with strong damping leads, beyond buckling
            and jumps. It does not depend on `load_steps`. Of two that are equally near, as for a perfect column, the
            one towards positive y (or x) is chosen.
    path : str
        "load"
            The load grows from 0 to 1.
        "arclength"
            The path of equilibria is followed by its arc length, through limit points, where the load factor decreases
            and increases again, until the factor first reaches 1. Limit points are outputs, exact to round-off.

    Returns
    -------
    Solution
        `t` has the load factors from 0 to 1; the last output is the equilibrium under the full load. `stable` says for
        each whether it is stable. `energy.potential` and `energy.work` are those of the whole loads, whatever part of
        them acts; `work` is NaN where forces turn with their place or connectors have laws.

    Notes
    -----
    Status of the solution, whose message says where, and what to try:

    - "ok": all equilibria but that of factor 0, the undeformed scene, are stable; with path="arclength" the last one
      is, and the message names the limit points.
    - "unstable": from some load factor on the potential energy has no minimum.
    - "singular": some motion needs no force there (a mechanism, a free body, the limit of stability).
    - "diverged": no equilibrium was found; at once where a body is free to move for ever and the loads pull it there.
    - "imprecise": rounding leaves fewer than four digits, as on very fine meshes.

    Raises
    ------
    DiscretisationError
        If the options are wrong or do not fit the scene, or if more memory is needed than is free.
    Interrupted
        A KeyboardInterrupt with the equilibria found until then, if Ctrl-C is pressed.
    """
    steps = None if load_steps is None else parts_of_load(load_steps)
    one_of("branch", branch, BRANCHES)
    if one_of("path", path, PATHS) == "arclength" and branch == "stable":
        raise DiscretisationError(
            "path is 'arclength' beside branch 'stable'; one of them is allowed: the path passes stable and unstable "
            "equilibria"
        )
    refuse(checked_scene(scene), LACKING, "ANC-TMM", "statics")
    run = discretise(run, options)
    check_memory(scene, run, MEMORY, outputs=(steps or 1) + 1, coupled=couplings_of(scene, run))
    chain = Chain(scene, run)
    check_kinds(chain.run.of(chain.scene), with_statics(), "statics")
    search = LoadPath(chain)
    if branch == "stable" and not search.system.conservative:
        raise DiscretisationError(
            f"branch is 'stable' with a force that turns with its place in scene {scene.name!r}; 'path' is needed: "
            f"such a force has no potential energy"
        )
    search.newton(0.0)  # compiles
    stability_of(search.system, search.q, 0.0)
    search.reset()
    if (never := never_balanced(scene)) is not None:
        return _solution(search, lambda _: never, np.array([0.0, 1.0]))
    if path == "arclength":
        return _along_path(search, FIRST if steps is None else 1.0 / steps)
    advance = _stabilised(search) if branch == "path" else _relaxation(search)
    return _solution(search, advance, np.arange((steps or 1) + 1) / (steps or 1))


def _solution(search: LoadPath, advance: Advance, factors: Array) -> Solution:
    """Equilibria at load factors, as far as they are found, and what is wrong with them."""
    record = Record(search.chain, outputs=len(factors))
    record.start()
    doubt: Status | None = None
    status: Status | None = None
    kept = 1
    _store(search, record, 0)
    stable = [_kind(search) == "stable"]
    for k in range(1, len(factors)):
        try:
            status = advance(float(factors[k]))
            if status is not None:
                break
            _store(search, record, k)
            against = _doubt(search, float(factors[k - 1]))
        except KeyboardInterrupt:
            status = interruption_of_load(float(factors[k - 1]))
            break
        stable.append(against is None)
        doubt = doubt or against
        kept = k + 1
    free = (
        doubt is not None and doubt.code == "singular"
    )  # its displacements are those of one equilibrium of many
    status = _with_notes(status or (Status() if free else search.precision()), search.notes)
    if doubt is not None:
        status = doubt if status.ok else replace(status, message=f"{status.message}; {doubt.message}")
    found = record.solution(kept, status, kept - 1, search.iterations, search.iterations, t=factors[:kept])
    found = with_load_work(found)
    return _whole(replace(found, stable=np.array(stable)[: len(found.t)]))


def _whole(found: Solution) -> Solution:
    """A solution whose search was not interrupted.

    Raises
    ------
    Interrupted
        With the one that was stopped.
    """
    if found.status.code == "interrupted":
        raise Interrupted(found)
    return found


def _with_notes(status: Status, notes: list[str]) -> Status:
    """A status whose message also says what else is to be known."""
    return replace(status, message="; ".join([status.message] * bool(status.message) + notes))


def _stabilised(search: LoadPath) -> Advance:
    """By Newton's iteration along the load; where that finds nothing, along a path that is stabilised."""

    def advance(target: float) -> Status | None:
        status = search.reach(target)
        if status is None or status.code != "diverged":
            return status
        begin, q = search.factor, _led(search, target)
        if q is None or not _possible(search.chain, q) or search.adopt(target, q) is not None:
            search.system.accept_again(search.turns)
            return status
        search.notes.append(
            f"Newton's iteration finds no equilibrium beyond {begin:.6g} of the load: a stabilised path leads from "
            f"there to the one at {target:.6g}"
        )
        return None

    return advance


def _led(search: LoadPath, target: float) -> Array | None:
    """Coordinates to which a stabilised path leads from the equilibrium reached last, None if it does not."""
    if not search.system.conservative:
        return settled(search.system, search.q, target)
    last = None
    for last in stable_path(search.system, search.q, search.factor, target):  # noqa: B007
        pass
    return None if last is None or last.factor < target else last.q


def _possible(chain: Chain, q: Array) -> bool:
    """Whether no element is turned inside out: the energy of some has minima there, too."""
    return not any(
        inside_out(coordinates[None], mesh.element_length).any()
        for mesh in chain.bodies.meshes
        if mesh.elements
        for coordinates in [chain.bodies.by_body(q)[mesh.body.name]]
    )


def _along_path(search: LoadPath, first: float) -> Solution:
    """Equilibria along the path by its arc length."""
    arc = ArcPath(search.system, search.chain.run.newton_tolerance, first)
    record = Record(search.chain, outputs=1)
    record.start()
    stands = _kind(search) != "singular"
    points, stopped = _until_stopped(islice(arc.points(), POINTS)) if stands else ([], False)
    record.resize(max(len(points), 1))
    stable = np.zeros(max(len(points), 1), dtype=bool)
    doubt: Status | None = None
    if not points:
        points = [Point(search.q, 0.0, search.q, 1.0, turns=search.turns)]
    for k, point in enumerate(points):
        assert point.turns is not None  # the path goes through it
        search.q, search.factor, search.turns = point.q, point.factor, point.turns
        _store(search, record, k)
        doubt = _doubt(search, 0.0)
        stable[k] = doubt is None
    t = np.array([point.factor for point in points])
    status = doubt or search.precision()
    if stopped:
        status = interruption_of_load(float(t[-1]))
    elif t[-1] < 1.0:
        status = _lost(search, len(points))
    limits = [f"{point.factor:.6g}" for point in points if point.limit]
    notes = [f"limit points at load factors {', '.join(limits)}"] if limits else []
    if not stable[1:].all():
        notes.append(f"{int((~stable[1:]).sum())} of {len(t)} equilibria are unstable, see `stable`")
    found = record.solution(
        len(t), _with_notes(status, notes), len(t) - 1, arc.iterations, arc.iterations, t=t
    )
    found = with_load_work(found)
    return _whole(replace(found, stable=stable[: len(found.t)]))


def _until_stopped(points: Iterable[Point]) -> tuple[list[Point], bool]:
    """Points of a path, and whether Ctrl-C stopped the search for more."""
    found: list[Point] = []
    try:
        for point in points:  # not `extend`, which may forget what came before an exception
            found.append(point)
    except KeyboardInterrupt:
        return found, True
    return found, False


def _lost(search: LoadPath, points: int) -> Status:
    """Status of a path that ends before the whole load."""
    motion = stability_of(search.system, search.q, search.factor).motion
    body, element = worst_element(search.chain, search.system.sizes(motion))
    why = (
        f"{points} points do not reach the full load"
        if points == POINTS
        else "no step is short enough: the scene may be a mechanism that is free to move, or the mesh too coarse"
    )
    return Status(
        "diverged",
        f"the path of equilibria ends at load factor {search.factor:.6g}, softest in {part(body, element)}; "
        f"{why}; a finer mesh, another load or path='load' may help",
        time=search.factor,
        body=body,
        element=element,
    )


def _relaxation(search: LoadPath) -> Advance:
    """Along the stable branch; its own steps do not depend on the requested load factors."""
    path = stable_path(search.system)
    here, ahead = next(path), next(path, None)

    def advance(target: float) -> Status | None:
        nonlocal here, ahead
        while ahead is not None and ahead.factor <= target:
            here, ahead = ahead, next(path, None)
        search.system.accept_again(here.turns)
        q = here.q if here.factor == target else downhill(search.system, here.q, target)
        return search.stuck(here.factor, stable=True) if q is None else search.adopt(target, q)

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
            unlike = unlike_bodies(search.chain.scene, search.chain.run)
            return singular(factor, *worst_element(search.chain, system.sizes(found.motion)), unlike)
        case "unstable":
            free = system.conservative and not found.flutter
            mode = lowest_mode(system, search.q, factor)[1] if free else found.motion
            worst = worst_element(search.chain, system.sizes(mode))
            return unstable(factor, found.negative, *worst, before, ADVICE if free else LESS, found.flutter)
        case _:
            assert_never(found.kind)


def _kind(search: LoadPath) -> str:
    return stability_of(search.system, search.q, search.factor).kind


def _is_singular_on_any_mesh(search: LoadPath, factor: float) -> bool:
    """Whether a singular tangent is one of the scene and not the rounding of a very fine mesh."""
    chain = search.chain
    if chain.bodies.nodes < MANY:
        return True
    coarse = LoadPath(chain.coarser(COARSE))
    if coarse.reach(factor) is not None:
        return False
    return stability_of(coarse.system, coarse.q, factor).kind == "singular"


def _store(search: LoadPath, record: Record, place: int) -> None:
    """Keep the equilibrium reached; its turns are those counted, too, where a path has gone on."""
    search.fewest = min(search.fewest, search.digits)
    search.system.accept_again(search.turns)
    record.q[place] = search.q
    if record.turned is None:
        record.turned = np.zeros((len(record.q), len(search.system.turning.angles)))
    record.turned[place] = search.system.turning.angles
    record.energy[place, 1] = search.system.strain_energy(search.q, search.factor)
