"""Statics: equilibria of a scene under growing loads, and the stability of each."""

import time
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation, discretise, parts_of_load
from anctmm.discretise.memory import check_memory
from anctmm.elements.kinds import check_kinds, with_statics
from anctmm.equilibria.arc_length import ArcPath
from anctmm.equilibria.balance import Balance, Configuration
from anctmm.equilibria.descent import downhill, settled, stable_path
from anctmm.equilibria.load_path import LoadPath, worst
from anctmm.equilibria.stability import stability_of
from anctmm.errors import DiscretisationError
from anctmm.integrators.output import field_of
from anctmm.kernels.announcing import compiling
from anctmm.model.scene import Scene, checked_scene
from anctmm.results.accounting import accounted
from anctmm.results.checks.divergence import checked, inside_out
from anctmm.results.checks.finding import part
from anctmm.results.checks.stability import singular, unlike_bodies, unstable
from anctmm.results.checks.unbalanced import never_balanced
from anctmm.results.ended_early import Interrupted, interruption_of_load
from anctmm.results.load_work import with_load_work
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from anctmm.system.body_meshes import BeamMesh
from anctmm.system.system import System
from anctmm.validation import one_of

Array = NDArray[np.float64]
#: Takes a search on to a load factor; a status if it cannot be reached.
Advance = Callable[[float], Status | None]

BRANCHES = ("path", "stable")
PATHS = ("load", "arclength")
#: First load factor of a path by its arc length, and points of it at most.
FIRST, POINTS = 1.0 / 32.0, 20_000
#: Bytes that a search takes for each coordinate: the tangent, its factors and a few vectors.
BYTES = 2000.0
#: Advice where forces have no potential, and so no branch is one of least energy, and where they have.
LESS = "smaller loads, or a stiffer scene, may help"
ADVICE = "branch='stable' finds a stable one"


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
        If the options are wrong or do not fit the scene.
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
    checked_scene(scene, space=True)
    run = discretise(run, options)
    check_kinds(run.of(scene), ("cable",) if scene.dim == 3 else with_statics(), "statics")
    check_memory(scene, run, BYTES, (steps or 1) + 1, 8.0)
    system = System(scene, run)
    balance = Balance(system)
    if branch == "stable" and not balance.conservative:
        raise DiscretisationError(
            f"branch is 'stable' with a force that turns with its place in scene {scene.name!r}; 'path' is needed: "
            f"such a force has no potential energy"
        )
    search, outputs = LoadPath(balance), Outputs(balance)
    never = never_balanced(scene) if scene.dim == 2 else None
    if never is not None:
        return _solution(search, outputs, lambda _: never, np.array([0.0, 1.0]))
    if path == "arclength":
        return _along_path(search, outputs, FIRST if steps is None else 1.0 / steps)
    advance = _stabilised(search) if branch == "path" else _relaxation(search)
    return _solution(search, outputs, advance, np.arange((steps or 1) + 1) / (steps or 1))


class Outputs:
    """Equilibria found so far.

    Parameters
    ----------
    balance : Balance
    """

    def __init__(self, balance: Balance) -> None:
        self.balance, self.started = balance, _clocks()
        self.factors, self.stable, self.strain = list[float](), list[bool](), list[float]()
        self.found = list[Configuration]()

    def add(self, at: Configuration, factor: float, stable: bool) -> None:
        """Keep an equilibrium."""
        self.found.append(at)
        self.factors.append(factor)
        self.stable.append(stable)
        self.strain.append(self.balance.strain_energy(at, factor))

    def solution(self, status: Status, iterations: int) -> Solution:
        """The solution, checked.

        Raises
        ------
        Interrupted
            With it, if its status is that.
        """
        system = self.balance.system
        cpu, wall = (now - then for now, then in zip(_clocks(), self.started, strict=True))
        q, angles = (np.array([getattr(at, name) for at in self.found]) for name in ("q", "angles"))
        potential = np.array([((system.mesh.reference - one) * system.tables.dead).sum() for one in q])
        zero = np.zeros(len(q))
        found = Solution(
            solver="anctmm",
            scene=system.scene,
            run=system.run,
            t=np.array(self.factors),
            fields=self._fields(q, angles),
            energy=Energy(zero, np.array(self.strain), potential, zero, zero),
            cost=Cost(cpu, wall, len(q) - 1, iterations, iterations),
            status=status,
            dofs=system.numbering.unknowns,
            static=True,
        )
        found = with_load_work(checked(found, static=True))
        found = replace(found, stable=np.array(self.stable)[: len(found.t)])
        if found.status.code == "interrupted":
            raise Interrupted(found)
        return found

    def _fields(self, q: Array, angles: Array) -> dict[str, Any]:
        mesh, found = self.balance.mesh, {}
        for name, series in mesh.by_body(q).items():
            body, first = mesh.bodies[name], mesh.first[name]
            turned = angles[:, first : first + body.nodes] if mesh.dim == 2 else None
            if turned is not None and not body.elements and hasattr(body.body, "section"):
                turned = np.repeat(turned, 2, axis=1)  # a rigid bar has the field of a beam of one element
            found[name] = field_of(body, series[None], None, turned)
        return found


def _clocks() -> tuple[float, float]:
    """Processor and wall time, s, which stand still while a kernel is compiled."""
    return time.process_time() - compiling.cpu_seconds, time.perf_counter() - compiling.seconds


def _solution(search: LoadPath, outputs: Outputs, advance: Advance, factors: Array) -> Solution:
    """Equilibria at load factors, as far as they are found, and what is wrong with them."""
    doubt: Status | None = None
    status: Status | None = None
    outputs.add(search.at, 0.0, stability_of(search.balance, search.at, 0.0).kind == "stable")
    for before, factor in zip(factors.tolist(), factors.tolist()[1:], strict=False):
        try:
            status = advance(factor)
            if status is not None:
                break
            against = doubt_of(search, before)
        except KeyboardInterrupt:
            status = interruption_of_load(before)
            break
        outputs.add(search.at, factor, against is None)
        doubt = doubt or against
    # displacements of a free scene are those of one equilibrium of many
    free = doubt is not None and doubt.code == "singular"
    status = with_notes(status or (Status() if free else search.precision()), search.notes)
    if doubt is not None:
        status = doubt if status.ok else replace(status, message=f"{status.message}; {doubt.message}")
    return outputs.solution(status, search.iterations)


def _stabilised(search: LoadPath) -> Advance:
    """By Newton's iteration along the load; where that finds nothing, along a path that is stabilised."""

    def advance(target: float) -> Status | None:
        status = search.reach(target)
        if status is None or status.code != "diverged":
            return status
        begin, at = search.factor, _led(search, target)
        if at is None or inverted(search.balance, at) or search.adopt(target, at) is not None:
            return status
        search.notes.append(
            f"Newton's iteration finds no equilibrium beyond {begin:.6g} of the load: a stabilised path leads from "
            f"there to the one at {target:.6g}"
        )
        return None

    return advance


def _led(search: LoadPath, target: float) -> Configuration | None:
    """Where a stabilised path leads from the equilibrium reached last, None if it does not."""
    if not search.balance.conservative:
        return settled(search.balance, search.at, target)
    *_, last = stable_path(search.balance, search.at, search.factor, target)
    return None if last.factor < target else last.at


def inverted(balance: Balance, at: Configuration) -> bool:
    """Whether an element is turned inside out: the energy of some has minima there, too."""
    mesh = balance.mesh
    return mesh.dim == 2 and any(
        inside_out(q[None], body.element.l).any()
        for name, q in mesh.by_body(at.q).items()
        if isinstance(body := mesh.bodies[name], BeamMesh)
    )


def _relaxation(search: LoadPath) -> Advance:
    """Along the stable branch; its own steps do not depend on the requested load factors."""
    balance = search.balance
    path = stable_path(balance, balance.start)
    here, ahead = next(path), next(path, None)

    def advance(target: float) -> Status | None:
        nonlocal here, ahead
        while ahead is not None and ahead.factor <= target:
            here, ahead = ahead, next(path, None)
        at = here.at if here.factor == target else downhill(balance, here.at, target)
        return search.stuck(here.factor, stable=True) if at is None else search.adopt(target, at)

    return advance


def _along_path(search: LoadPath, outputs: Outputs, first: float) -> Solution:
    """Equilibria along the path by its arc length."""
    balance, arc = search.balance, ArcPath(search.balance, first)
    stands = stability_of(balance, balance.start, 0.0).kind != "singular"
    limits, doubt, stopped = list[str](), None, False
    try:
        for point in islice(arc.points(), POINTS if stands else 0):
            search.at, search.factor = point.at, point.factor
            doubt = doubt_of(search, 0.0)
            outputs.add(point.at, point.factor, doubt is None)
            limits += [f"{point.factor:.6g}"] if point.limit else []
    except KeyboardInterrupt:
        stopped = True
    if not outputs.found:
        outputs.add(balance.start, 0.0, False)
    status = doubt or search.precision()
    if stopped:
        status = interruption_of_load(outputs.factors[-1])
    elif outputs.factors[-1] < 1.0:
        status = _lost(search, len(outputs.found))
    notes = [f"limit points at load factors {', '.join(limits)}"] if limits else []
    if not all(outputs.stable[1:]):
        unstable_ones = outputs.stable[1:].count(False)
        notes.append(f"{unstable_ones} of {len(outputs.found)} equilibria are unstable, see `stable`")
    return outputs.solution(with_notes(status, notes), arc.iterations)


def _lost(search: LoadPath, points: int) -> Status:
    """Status of a path that ends before the whole load."""
    balance = search.balance
    body, element = worst(balance, balance.sizes(stability_of(balance, search.at, search.factor).motion))
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


def with_notes(status: Status, notes: list[str]) -> Status:
    """A status whose message also says what else is to be known."""
    return replace(status, message="; ".join([status.message] * bool(status.message) + notes))


def doubt_of(search: LoadPath, before: float) -> Status | None:
    """What is wrong with the equilibrium reached, if it is not stable; the one before was at a load factor."""
    balance, factor = search.balance, search.factor
    found = stability_of(balance, search.at, factor)
    if found.kind == "stable":
        return None
    place = worst(balance, balance.sizes(found.motion))
    if found.kind == "singular":
        return singular(factor, *place, unlike_bodies(balance.system.scene, balance.system.run))
    advice = ADVICE if balance.conservative and not found.flutter else LESS
    return unstable(factor, found.negative, *place, before, advice, found.flutter)
