"""PyElastica: Cosserat rods with shear, stepped by the explicit Verlet scheme of positions.

Whatever element a discretisation names, this solver uses its own: a staggered grid of second order, which converges to
Reissner's rod except for the constitutive law under stretch (forces are Sσ/e, moments Bκ/e³ at the stretch e). It has
no implicit steps and no statics: equilibria are found by dynamic relaxation with fictitious masses. Its cost is that
of the steps alone, each of them called from Python, in three dimensions. PyElastica is optional, the extra `peers`.
"""

from dataclasses import dataclass
from importlib import import_module
from math import ceil, pi, sqrt
from time import perf_counter, process_time
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import INTEGRATORS, Discretisation, discretise, parts_of_load
from anctmm.discretise.memory import check_memory
from anctmm.elements.kinds import check_kinds, optional_beside
from anctmm.errors import DiscretisationError, StabilityError, UnsupportedError, unknown_kind, unknown_option
from anctmm.model.bodies import beam_of
from anctmm.model.joints import unknown_joint
from anctmm.model.loads import LOADS
from anctmm.model.needs import MECHANISMS, not_offered, refuse
from anctmm.model.scene import (
    Clamp,
    Force,
    LineLoad,
    Pin,
    Prismatic,
    Scene,
    Slider,
    Torque,
    Weld,
    checked_scene,
)
from anctmm.results.checks.divergence import STRETCH_LIMIT, checked
from anctmm.results.checks.energy import all_energy, from_nowhere
from anctmm.results.ended_early import nothing
from anctmm.results.fields import LagrangeField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from anctmm.solvers.capabilities import Offer
from anctmm.validation import one_of, positive

Array = NDArray[np.float64]

NAME = "pyelastica"
#: Kinds of element that a discretisation may name; rods use their own instead.
ELEMENTS = ("cable", "shear")
OFFER = Offer(
    lacks=optional_beside(ELEMENTS)
    | {
        "generalized-alpha",
        "esdirk",
        "joints",
        "drives",
        "varying-loads",
        "damping",
        "stability",
        *MECHANISMS,
    },
    element="reissner",
    limits={"shear": "reissner"},
)
#: Bytes that a model takes for each coordinate, and the history for each at an output, as measured.
MEMORY, KEPT = 300.0, 24.0
#: Lowest frequency of a beam by how its ends are held, of √(EI/(m' L⁴)): the damping of relaxation.
LOWEST = {
    ("clamp", "free"): 3.516,
    ("clamp", "pin"): 15.418,
    ("clamp", "clamp"): 22.373,
    ("pin", "pin"): 9.870,
}
#: Of the stable step, taken while relaxing: a stretched rod is stiffer than a straight one.
SAFETY = 0.8
#: Periods of the lowest frequency after which relaxation is given up. Each should gain a factor of 500.
PERIODS = 40


def solve(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    clamp: str = "half-element",
    shear_factor: float = 1.0,
    **options: Any,
) -> Solution:
    """Motion of a scene by PyElastica.

    Parameters
    ----------
    scene : Scene
        Beams without joints between them, each clamped, pinned or free at its ends; constant loads.
    run : Discretisation, optional
        "zhai" with ψ = φ = ½, which for rods without rotation has the positions of PyElastica's PositionVerlet;
        two elements or more a body. `element` and `quadrature` are not used.
    clamp : str
        "half-element": the curvature between the clamp and the first director is that of the rod (second order).
        "director": PyElastica's own, which holds the first director, half an element away (first order).
    shear_factor : float
        k of the shear stiffness kGA.
    **options
        The fields of the discretisation, in its place.

    Returns
    -------
    Solution
        With status "unsupported" where PyElastica is missing or cannot do the scene.

    Raises
    ------
    StabilityError
        If the step lies above the stability limit of the straight grid, and `check_stability` is set.
    """
    run = discretise(run, options)
    checked_scene(scene)
    _check(clamp, shear_factor)
    check_memory(scene, run, MEMORY, kept_each=KEPT)
    try:
        _check_run(run)
        model = _model(scene, run)
    except UnsupportedError as why:
        return nothing(NAME, scene, run, Status("unsupported", str(why)))
    system = System(model, scene, run, clamp, shear_factor)
    limit = 2.0 / system.largest_frequency
    if run.check_stability and run.dt > limit:
        raise StabilityError(
            f"dt (s) is {run.dt!r}; at most {limit:.6g} is stable for PyElastica's rods in scene {scene.name!r}: "
            f"their sections' inertia bounds it, whatever the mesh"
        )
    return system.motion()


def solve_static(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    load_steps: int = 1,
    rest: float = 1e-8,
    clamp: str = "half-element",
    shear_factor: float = 1.0,
    **options: Any,
) -> Solution:
    """Equilibrium of a scene by relaxation with PyElastica; `t` of the solution are load factors.

    Parameters
    ----------
    scene : Scene
        As for `solve`, and every body held.
    run : Discretisation, optional
        Its mesh is used.
    load_steps : int
        Equal parts of the load, each relaxed.
    rest : float
        Motion left at the end, of the body's length: much less than the elements' own error.
    clamp, shear_factor
        As for `solve`.
    **options
        The fields of the discretisation, in its place.
    """
    run = discretise(run, options)
    _check(clamp, shear_factor)
    positive("rest", rest, DiscretisationError)
    load_steps = parts_of_load(load_steps)
    check_memory(checked_scene(scene), run, MEMORY, outputs=load_steps + 1, kept_each=KEPT)
    try:
        system = System(_model(scene, run), scene, run, clamp, shear_factor, relaxed=True)
        return system.equilibria(load_steps, rest)
    except UnsupportedError as why:
        return nothing(NAME, scene, run, Status("unsupported", str(why)))


@dataclass
class System:
    """Rods in PyElastica's simulator, and the history kept of them.

    Parameters
    ----------
    model : module
        `reference.pyelastica.model`, which needs PyElastica.
    scene : Scene
    run : Discretisation
    clamp : str
    shear_factor : float
    relaxed : bool
        Whether masses are fictitious.
    """

    model: ModuleType
    scene: Scene
    run: Discretisation
    clamp: str
    shear_factor: float
    relaxed: bool = False

    def __post_init__(self) -> None:
        self.rods = {
            name: self.model.Rod(
                self.scene, self.scene.beam(name), count, self.shear_factor, self.clamp, self.relaxed
            )
            for name, (count, _) in self.run.of(self.scene).items()
        }
        self.simulator, self.stepper = self.model.Simulator(), self.model.ea.PositionVerlet()
        self.positions: dict[str, list[Array]] = {name: [] for name in self.rods}
        self.velocities: dict[str, list[Array]] = {name: [] for name in self.rods}
        self.energies: list[tuple[float, ...]] = []
        self.present = 0.0
        for rod in self.rods.values():
            rod.add_to(self.simulator)

    @property
    def largest_frequency(self) -> float:
        """Of all straight rods, rad/s."""
        return max(rod.largest_frequency for rod in self.rods.values())

    def motion(self) -> Solution:
        """Step to the end, or until the motion has diverged."""
        run, kept, status = self.run, 0, Status()
        self.simulator.finalize()
        cpu, wall, step, dt = process_time(), perf_counter(), 0, run.exact_dt
        for k in run.output_steps:
            elapsed = (k - step) * dt
            while step < k:
                self.stepper.step(self.simulator, step * dt, dt)
                step += 1
            self._keep(elapsed)
            if self._diverged():
                time = float(run.times(np.array([step]))[0])
                why = f"the motion diverged before t = {time:.6g} s (step {step}); a dt below {run.dt:g} s may help"
                status = Status("diverged", why, time, step, self._worst())
                break
            kept += 1
        cost = Cost(process_time() - cpu, perf_counter() - wall, step)
        return self._solution(run.times(run.output_steps[:kept]), cost, status)

    def equilibria(self, load_steps: int, rest: float) -> Solution:
        """Relax under growing parts of the load, until no more than `rest` moves."""
        dt = SAFETY * 2.0 / self.largest_frequency
        slowest = min(self._lowest_frequency(rod) for rod in self.rods.values())
        for rod in self.rods.values():
            self.simulator.dampen(rod.rod).using(
                self.model.ea.AnalyticalLinearDamper, uniform_damping_constant=2.0 * slowest, time_step=dt
            )
        self.simulator.finalize()
        factors = np.arange(load_steps + 1) / load_steps
        cpu, wall, steps, status = process_time(), perf_counter(), 0, Status()
        self._keep()
        for k in range(1, load_steps + 1):
            for rod in self.rods.values():
                rod.factor = float(factors[k])
            taken, left = self._relax(dt, slowest, rest)
            steps += taken
            if not left <= rest:
                why = (
                    f"relaxation left a motion of {left:.2g} of the length at {factors[k]:.6g} of the load; "
                    f"more load_steps may help, or a `rest` above {rest:g}"
                )
                status = Status("diverged", why, float(factors[k]), body=self._worst())
                break
            self._keep()
        cost = Cost(process_time() - cpu, perf_counter() - wall, steps)
        return self._solution(factors[: len(self.energies)], cost, status)

    def _relax(self, dt: float, slowest: float, rest: float) -> tuple[int, float]:
        """Steps taken, and what still moves, of the length: places over a period, and speeds over the frequency."""
        period, left = ceil(2.0 * pi / (slowest * dt)), np.inf
        steps = 0
        for _ in range(PERIODS):
            before = {name: rod.rod.position_collection.copy() for name, rod in self.rods.items()}
            for _ in range(period):
                self.stepper.step(self.simulator, 0.0, dt)
            steps += period
            left = max(
                max(
                    float(np.abs(rod.rod.position_collection - before[name]).max()),
                    float(np.abs(rod.rod.velocity_collection).max()) / slowest,
                )
                / rod.body.length
                for name, rod in self.rods.items()
            )
            if not rest < left < STRETCH_LIMIT:
                break
        return steps, left

    def _lowest_frequency(self, rod: Any) -> float:
        held = tuple(sorted(rod.held.get(end, "free") for end in (0, -1)))
        held = held if held in LOWEST else held[::-1]
        if held not in LOWEST:
            raise UnsupportedError(
                f"body {rod.body.name!r} is {held[0]} at one end and {held[1]} at the other; "
                f"relaxation needs a clamp, or two pins"
            )
        per_length = rod.mass / rod.stiffness.l
        return LOWEST[held] * sqrt(rod.stiffness.EI / per_length) / rod.body.length**2

    def _keep(self, elapsed: float = 0.0) -> None:
        """Keep positions and energies, `elapsed` (s) after those before."""
        kinetic = strain = potential = work = 0.0
        for name, rod in self.rods.items():
            kept = self.positions[name]
            kept.append(rod.rod.position_collection[:2].T.copy())
            self.velocities[name].append(rod.rod.velocity_collection[:2].T.copy())
            with np.errstate(all="ignore"):
                T, U = rod.energies()
                potential -= float(np.sum(rod.forces.T * (kept[-1] - kept[0])))
                turns = rod.turns(elapsed)
                work += sum(moment * turns[end] for end, (moment, _) in rod.moments.items())
            kinetic, strain = kinetic + T, strain + U
        self.energies.append((kinetic, strain, potential, work))

    def _diverged(self) -> bool:
        """Whether something is not finite, stretched beyond any material, or has energy from nowhere."""
        if not np.isfinite(self.energies[-1]).all() or not max(self._stretches().values()) <= STRETCH_LIMIT:
            return True
        ends = Energy(*np.array([self.energies[0], self.energies[-1]]).T)
        self.present = max(self.present, *all_energy(ends))
        return bool(from_nowhere(ends, least=self.present)[-1])

    def _stretches(self) -> dict[str, float]:
        with np.errstate(all="ignore"):
            return {
                name: float(np.hypot(*np.diff(self.positions[name][-1], axis=0).T).max() / rod.stiffness.l)
                for name, rod in self.rods.items()
            }

    def _worst(self) -> str:
        """Body that is stretched most, or not finite."""
        sizes = {n: s if np.isfinite(s) else np.inf for n, s in self._stretches().items()}
        return max(sizes, key=sizes.__getitem__)

    def _solution(self, t: Array, cost: Cost, status: Status) -> Solution:
        n = len(t)
        fields = {
            name: LagrangeField(
                np.array(kept[:n]), velocities=None if self.relaxed else np.array(self.velocities[name][:n])
            )
            for name, kept in self.positions.items()
        }
        energy = Energy(*np.array(self.energies[:n]).reshape(n, 4).T)
        dofs = sum(6 * rod.elements + 3 for rod in self.rods.values())
        found = Solution(
            NAME, self.scene, self.run, t, fields, energy, cost, status, dofs, static=self.relaxed
        )
        return checked(found, static=self.relaxed)


def _check(clamp: str, shear_factor: float) -> None:
    one_of("clamp", clamp, ("half-element", "director"))
    positive("shear_factor", shear_factor, DiscretisationError)


def _check_run(run: Discretisation) -> None:
    match run.integrator:
        case "zhai":
            pass
        case "generalized-alpha" | "esdirk":
            raise UnsupportedError(
                f"integrator is {run.integrator!r}; PyElastica's steps are explicit: 'zhai' with ψ = φ = ½ is needed"
            )
        case _:
            raise unknown_option("integrator", run.integrator, INTEGRATORS)
    if (run.psi, run.phi) != (0.5, 0.5):
        raise UnsupportedError(
            f"psi, phi are {run.psi!r}, {run.phi!r}; PyElastica has only the Verlet scheme, ½, ½"
        )


def _model(scene: Scene, run: Discretisation) -> ModuleType:
    """The module that needs PyElastica, once it is known that PyElastica can do the scene."""
    refuse(checked_scene(scene), OFFER.lacks, "PyElastica")
    for joint in scene.joints:
        match joint:
            case Clamp(angle=None) | Pin(ends=(_,)):
                pass
            case Clamp():
                raise UnsupportedError(f"{joint!r} turns; a fixed clamp is needed")
            case Pin() | Weld():
                raise UnsupportedError(
                    f"{joint!r} joins ends of bodies; PyElastica's joints are penalty springs, another model: "
                    f"bodies held by the ground or free are allowed"
                )
            case Slider() | Prismatic():
                raise not_offered(joint)
            case _:
                raise unknown_joint(joint)
    for load in scene.loads:
        match load:
            case Force() | Torque():
                if callable(load.value):
                    raise UnsupportedError(f"{load!r} varies in time; a constant load is needed")
            case LineLoad():
                raise not_offered(load)
            case _:
                raise unknown_kind("load", load, LOADS)
    for body in map(beam_of, scene.beams):
        if body.material.damping > 0.0:
            raise UnsupportedError(
                f"damping is {body.material.damping!r} s for body {body.name!r}; 0 is needed here"
            )
    cut = run.of(scene)
    check_kinds(cut, ELEMENTS, "a model in PyElastica", UnsupportedError)
    for name, (count, _) in cut.items():
        if count < 2:
            raise UnsupportedError(f"body {name!r} has {count} element; PyElastica needs 2 or more")
    try:
        return import_module("reference.pyelastica.model")
    except ImportError as error:
        raise UnsupportedError(
            f"PyElastica is not installed; pip install 'anctmm[peers]' ({error})"
        ) from error
