"""What all solvers beside ANC-TMM share: an adapter to another code, nodes of beams."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from importlib.metadata import PackageNotFoundError, version
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import INTEGRATORS, Discretisation, discretise, parts_of_load
from anctmm.discretise.memory import check_memory
from anctmm.elements.kinds import check_kinds
from anctmm.errors import UnsupportedError, unknown_option
from anctmm.model.needs import refuse
from anctmm.model.scene import Beam, Scene, checked_scene
from anctmm.results.checks.divergence import checked
from anctmm.results.ended_early import nothing
from anctmm.results.fields import Field
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from anctmm.solvers.capabilities import Offer

Array = NDArray[np.float64]

#: Bytes that are kept of each coordinate at an output: itself, its velocity and its acceleration.
KEPT = 24.0


@dataclass
class Answer:
    """What another code has left: times (s) or load factors, (n,), fields, and, where explicit steps need it, energies.

    The cost is that of the steps: clocks run from the first step to the last, without building the model and reading
    results.
    """

    t: Array
    fields: Mapping[str, Field]
    cost: Cost
    status: Status
    dofs: int
    energy: Energy | None = None


@dataclass
class Adapter:
    """A scene as another code has it; an adapter says `check`, `build`, `march` and the class variables.

    `static`: whether equilibria are asked for, under loads and drives as they are at t = 0.
    """

    scene: Scene
    run: Discretisation
    static: bool = False
    load_steps: int = 1

    name: ClassVar[str]
    """As registered."""
    title: ClassVar[str]
    """In messages."""
    packages: ClassVar[tuple[str, ...]]
    """Of which one is needed."""
    offer: ClassVar[Offer]
    elements: ClassVar[tuple[str, ...]] = ("cable", "shear")
    """Kinds of element that a discretisation may name; the code uses its own instead."""
    memory: ClassVar[tuple[float, float]] = (1_000.0, KEPT)
    """Bytes of a model, and of an output, for each coordinate."""

    @classmethod
    def of(
        cls, scene: Scene, run: Discretisation | None, options: dict[str, Any], load_steps: int | None = None
    ) -> Self:
        """From the arguments of `solve`, or with load steps of `solve_static`; options may be fields of the class."""
        added = {f.name for f in fields(cls) if f.init} - {f.name for f in fields(Adapter)}
        own = {name: value for name, value in options.items() if name in added}
        run = discretise(run, {name: value for name, value in options.items() if name not in added})
        static = load_steps is not None
        return cls(scene, run, static, parts_of_load(load_steps) if static else 1, **own)

    def check(self) -> None:
        """Refuse, by UnsupportedError, what features do not tell."""

    def build(self) -> Any:
        """The model."""
        raise NotImplementedError

    def march(self, model: Any) -> Answer:
        """Do the steps."""
        raise NotImplementedError

    @classmethod
    def version(cls) -> str:
        """Version of the code; empty where it is not installed."""
        for package in cls.packages:
            with suppress(PackageNotFoundError):
                return version(package)
        return ""

    @property
    def mode(self) -> str:
        """What is asked for: statics, or an integrator."""
        return "statics" if self.static else self.run.integrator

    def solution(self) -> Solution:
        """The answer of the code; where it lacks something its status is "unsupported"."""
        scene, run = checked_scene(self.scene), self.run
        each, kept = self.memory
        check_memory(scene, run, each, self.load_steps + 1 if self.static else None, kept)
        try:
            self._refuse()
            model = self.build()
        except UnsupportedError as why:
            return nothing(self.name, scene, run, Status("unsupported", str(why)))
        found = self.march(model)
        energy = found.energy or Energy.unknown(len(found.t))
        solved = Solution(
            self.name, scene, run, found.t, found.fields, energy, found.cost, found.status, found.dofs,
            static=self.static,
        )  # fmt: skip
        return checked(solved, static=self.static, energies=found.energy is not None)

    def _refuse(self) -> None:
        if not self.static and self.mode not in INTEGRATORS:
            raise unknown_option("integrator", self.mode, INTEGRATORS)
        if not self.static and self.mode not in (known := self.offer.integrators):
            raise UnsupportedError(f"integrator is {self.mode!r}; {self.title} has {', '.join(known)} alone")
        refuse(self.scene, self.offer.lacks, self.title, self.mode)
        check_kinds(self.run.of(self.scene), self.elements, self.title, UnsupportedError)
        if not self.version():
            raise not_installed(self.packages)
        self.check()


def not_installed(packages: tuple[str, ...], why: object = "not found") -> UnsupportedError:
    """What to raise where another code is missing."""
    return UnsupportedError(f"{packages[0]} is not installed; pip install 'anctmm[peers]' ({why})")


def undamped(scene: Scene, why: str) -> None:
    """Refuse damped materials."""
    for body in scene.beams:
        if body.material.damping > 0.0:
            raise UnsupportedError(
                f"damping is {body.material.damping!r} s for body {body.name!r}; {why}: 0 is needed"
            )


def nodes_of(body: Beam, intervals: int) -> tuple[Array, Array]:
    """Places of equally spaced nodes of a beam, (nodes, 2), m, and their velocities at t = 0, m/s."""
    fractions = np.linspace(0.0, 1.0, intervals + 1)
    s = fractions[:, None]
    places = (1.0 - s) * np.array(body.start) + s * np.array(body.end)
    return places, np.array([body.velocity_at(x) for x in fractions.tolist()])


def slopes_of(body: Beam, intervals: int) -> Array:
    """Derivatives by x of the velocities at t = 0 at equally spaced nodes, (nodes, 2), 1/s."""
    fractions = np.linspace(0.0, 1.0, intervals + 1).tolist()
    return np.array([body.velocity_slope_at(x) for x in fractions]) / body.length
