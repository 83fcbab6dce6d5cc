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
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import optional_beside
from anctmm.errors import DiscretisationError, StabilityError, UnsupportedError
from anctmm.model.needs import MECHANISMS
from anctmm.model.scene import Clamp, Scene, Weld
from anctmm.results.accounting import accounted
from anctmm.results.fields import LagrangeField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from anctmm.solvers.capabilities import Offer
from anctmm.validation import positive
from reference.adapters import Adapter, Answer, not_installed, undamped

Array = NDArray[np.float64]

#: Kinds of element that a discretisation may name; rods use their own instead.
ELEMENTS = ("cable", "shear")
OFFER = Offer(
    lacks=optional_beside(ELEMENTS)
    | {"generalized-alpha", "esdirk", "joints", "drives", "varying-loads", "damping", "stability", "energy"}
    | set(MECHANISMS),
    element="reissner",
    limits={"shear": "reissner"},
)
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
#: Motion left at the end of relaxation, of the body's length: much less than the elements' own error.
REST = 1e-8
#: Stretch of an element beyond which a run has diverged.
STRETCH_LIMIT = 1e3


@accounted
def solve(scene: Scene, run: Discretisation | None = None, **options: Any) -> Solution:
    """Motion of a scene by PyElastica, with status "unsupported" where it cannot do the scene.

    Parameters
    ----------
    scene : Scene
        Beams without joints between them, each clamped, pinned or free at its ends; constant loads.
    run : Discretisation
        "zhai" with ψ = φ = ½, which for rods without rotation has the positions of PyElastica's PositionVerlet;
        two elements or more a body. `element` and `quadrature` are not used. Or its fields as keywords.
    shear_factor : float
        k of the shear stiffness kGA, 1 by default.

    Raises
    ------
    StabilityError
        If the step lies above the stability limit of the straight grid, and `check_stability` is set.
    """
    return Rods.of(scene, run, options).solution()


@accounted
def solve_static(
    scene: Scene, run: Discretisation | None = None, *, load_steps: int = 1, **options: Any
) -> Solution:
    """Equilibrium of a scene by relaxation with PyElastica, every body held; `t` are load factors.

    Each of the `load_steps` equal parts of the load is relaxed.
    """
    return Rods.of(scene, run, options, load_steps).solution()


@dataclass
class Rods(Adapter):
    """A scene in PyElastica; parameters as of `solve` and `solve_static`."""

    shear_factor: float = 1.0

    name: ClassVar[str] = "pyelastica"
    title: ClassVar[str] = "a model in PyElastica"
    packages: ClassVar[tuple[str, ...]] = ("pyelastica",)
    offer: ClassVar[Offer] = OFFER
    memory: ClassVar[tuple[float, float]] = (300.0, 24.0)

    def __post_init__(self) -> None:
        positive("shear_factor", self.shear_factor, DiscretisationError)
        self.energies: list[tuple[float, ...]] = []

    def check(self) -> None:
        """Refuse joints between bodies, what varies, damping and single elements."""
        run, scene = self.run, self.scene
        if not self.static and (run.psi, run.phi) != (0.5, 0.5):
            raise UnsupportedError(
                f"psi, phi are {run.psi!r}, {run.phi!r}; PyElastica has only the Verlet scheme, ½, ½"
            )
        for joint in scene.joints:
            if isinstance(joint, Weld) or len(joint.ends) > 1:
                raise UnsupportedError(
                    f"{joint!r} joins ends of bodies; PyElastica's joints are penalty springs, another model: "
                    f"bodies held by the ground or free are allowed"
                )
            if isinstance(joint, Clamp) and joint.angle is not None:
                raise UnsupportedError(f"{joint!r} turns; a fixed clamp is needed")
        for load in scene.loads:
            if callable(load.value):
                raise UnsupportedError(f"{load!r} varies in time; a constant load is needed")
        undamped(scene, "PyElastica damps otherwise")
        for name, (count, _) in run.of(scene).items():
            if count < 2:
                raise UnsupportedError(f"body {name!r} has {count} element; PyElastica needs 2 or more")

    def build(self) -> Any:
        """Rods in PyElastica's simulator; refuses a step above the stability limit."""
        try:
            module = import_module("reference.pyelastica.model")
        except ImportError as error:
            raise not_installed(self.packages, error) from error
        self.rods = {
            name: module.Rod(self.scene, self.scene.beam(name), count, self.shear_factor, self.static)
            for name, (count, _) in self.run.of(self.scene).items()
        }
        limit = 2.0 / self.frequency
        if not self.static and self.run.check_stability and self.run.dt > limit:
            raise StabilityError(
                f"dt (s) is {self.run.dt!r}; at most {limit:.6g} is stable for PyElastica's rods in scene "
                f"{self.scene.name!r}: their sections' inertia bounds it, whatever the mesh"
            )
        self.simulator, self.stepper = module.Simulator(), module.ea.PositionVerlet()
        self.positions: dict[str, list[Array]] = {name: [] for name in self.rods}
        self.velocities: dict[str, list[Array]] = {name: [] for name in self.rods}
        for rod in self.rods.values():
            rod.add_to(self.simulator)
        if self.static:
            self.slowest = min(map(self._lowest_frequency, self.rods.values()))
            self.dt = SAFETY * limit
            for rod in self.rods.values():
                damper = self.simulator.dampen(rod.rod)
                damper.using(
                    module.ea.AnalyticalLinearDamper,
                    uniform_damping_constant=2.0 * self.slowest,
                    time_step=self.dt,
                )
        self.simulator.finalize()
        return self.simulator

    @property
    def frequency(self) -> float:
        """Largest of all straight rods, rad/s."""
        return max(rod.largest_frequency for rod in self.rods.values())

    def march(self, model: Any) -> Answer:
        """Motion, or equilibria."""
        cpu, wall = process_time(), perf_counter()
        t, steps, status = self._equilibria() if self.static else self._motion()
        cost = Cost(process_time() - cpu, perf_counter() - wall, steps)
        n = len(t)
        fields = {
            name: LagrangeField(
                np.array(kept[:n]), velocities=None if self.static else np.array(self.velocities[name][:n])
            )
            for name, kept in self.positions.items()
        }
        dofs = sum(6 * rod.elements + 3 for rod in self.rods.values())
        T, U, V = np.array(self.energies[:n]).reshape(n, 3).T
        moments = any(any(rod.moments.values()) for rod in self.rods.values())
        energy = None if self.static or moments else Energy(T, U, V - V[:1], np.zeros(n))
        return Answer(t, fields, cost, status, dofs, energy)

    def _motion(self) -> tuple[Array, int, Status]:
        """Times, steps and status of steps to the end, or until the motion has diverged."""
        run, kept, step, dt, status = self.run, 0, 0, self.run.exact_dt, Status()
        for k in run.output_steps:
            while step < k:
                self.stepper.step(self.simulator, step * dt, dt)
                step += 1
            self._keep()
            if not self._stretch() <= STRETCH_LIMIT:
                time = float(run.times(np.array([step]))[0])
                why = f"the motion diverged before t = {time:.6g} s (step {step}); a dt below {run.dt:g} s may help"
                status = Status("diverged", why, time, step)
                break
            kept += 1
        return run.times(run.output_steps[:kept]), step, status

    def _equilibria(self) -> tuple[Array, int, Status]:
        """Relax under growing parts of the load, until no more than `rest` moves."""
        factors, steps, status = np.arange(self.load_steps + 1) / self.load_steps, 0, Status()
        self._keep()
        count = 1
        for factor in map(float, factors[1:]):
            for rod in self.rods.values():
                rod.factor = factor
            taken, left = self._relax()
            steps += taken
            if not left <= REST:
                why = (
                    f"relaxation left a motion of {left:.2g} of the length at {factor:.6g} of the load; more "
                    f"load_steps may help"
                )
                status = Status("diverged", why, factor)
                break
            self._keep()
            count += 1
        return factors[:count], steps, status

    def _relax(self) -> tuple[int, float]:
        """Steps taken, and what still moves, of the length: places over a period, and speeds over the frequency."""
        period, left, steps = ceil(2.0 * pi / (self.slowest * self.dt)), np.inf, 0
        for _ in range(PERIODS):
            before = {name: rod.rod.position_collection.copy() for name, rod in self.rods.items()}
            for _ in range(period):
                self.stepper.step(self.simulator, 0.0, self.dt)
            steps += period
            left = max(
                max(
                    float(np.abs(rod.rod.position_collection - before[name]).max()),
                    float(np.abs(rod.rod.velocity_collection).max()) / self.slowest,
                )
                / rod.body.length
                for name, rod in self.rods.items()
            )
            if not REST < left < STRETCH_LIMIT:
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
        return LOWEST[held] * sqrt(rod.EI * rod.l / rod.mass) / rod.body.length**2

    def _keep(self) -> None:
        for name, rod in self.rods.items():
            self.positions[name].append(rod.rod.position_collection[:2].T.copy())
            self.velocities[name].append(rod.rod.velocity_collection[:2].T.copy())
        with np.errstate(all="ignore"):
            self.energies.append(tuple(np.sum([rod.energies() for rod in self.rods.values()], axis=0)))

    def _stretch(self) -> float:
        """Largest length of an element, of its undeformed one; NaN where a place is not finite."""
        with np.errstate(all="ignore"):
            lengths = [
                np.hypot(*np.diff(self.positions[name][-1], axis=0).T).max() / rod.l
                for name, rod in self.rods.items()
            ]
        return float(np.max(lengths))
