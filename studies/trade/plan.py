"""What the trade of error for time is measured over: elements, quadratures, integrators, meshes, steps, tolerances."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import ceil, isinf

from anctmm.elements.kinds import QUADRATURES
from anctmm.errors import AnctmmError
from anctmm.model.case import Case
from anctmm.solvers.capabilities import NEWTON_TOLERANCES
from studies.engine.accuracy.dynamics import Fine, Plan, Scheme
from studies.engine.choices import choices_of
from studies.engine.measuring.setting import stable_step
from studies.engine.running.outcomes import Reference
from studies.engine.running.trial import Mesh
from studies.scenes import STEPS, cantilever_fall, four_bar

#: Target errors of the built-in scenes; of a quick run.
TARGETS, QUICK_TARGETS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7), (1e-2, 1e-3, 1e-4, 1e-5)
#: Steps of a quick run, s.
QUICK_STEPS = (5e-3, 2e-3, 1e-3)
#: Newton's tolerances of single schemes: one that stops as soon as the step's error allows, and one near rounding.
LOOSE, TIGHT = NEWTON_TOLERANCES[-1], NEWTON_TOLERANCES[0]
#: Tolerances of the error-controlled steps; of a quick run.
TOLERANCES = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
QUICK_TOLERANCES = (1e-2, 3e-3, 1e-3, 1e-4)
#: An explicit run is tried where elements times steps do not exceed this: some 0.15 s of ANC-TMM, 2 s of a peer.
MOST_EXPLICIT = 2e6
IMPLICIT, EXPLICIT, HIGH = "generalized-alpha", "zhai", "esdirk"
#: Steps of fourth order, s: each costs that of five others. Only our own solver has them to compare: the implicit steps
#: of Exudyn and OpenSees are of second order, and those of the global DAE are a reference, not made to be fast.
HIGH_STEPS, QUICK_HIGH_STEPS = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4), (2e-3, 1e-3)
#: For the smallest target errors, s, on quintic cables whose clamps free the stretch: below 1e-6 what clamps hold rules
#: the error of any mesh. By order in time; only our solver has such elements and such clamps to compare.
FINEST_STEPS = {IMPLICIT: (5e-4, 2.5e-4, 1.25e-4, 6.25e-5, 3.125e-5), HIGH: (2e-3, 1e-3, 5e-4, 2.5e-4)}
#: Who makes implicit steps with each element.
CABLE_SOLVERS = "anctmm", "global-dae", "exudyn-cable"
QUINTIC_SOLVERS = "anctmm", "global-dae"
SHEAR_SOLVERS = "anctmm", "global-dae", "exudyn-reissner"
#: Who makes them with frames of its own, which tend to what cables tend to; they know no quadrature of ours.
FRAME_SOLVERS = ("opensees",)
#: No further sample of a run is taken in the sweep after that long, s: one tells what is near the front, and that runs
#: again.
SAMPLED = 0.0
#: Step of the run of fourth order on the same mesh that separates the errors of step and mesh, s; by whether the
#: run is quick.
FINE_STEP = {False: 1.25e-4, True: 1e-3}
#: Newton's tolerance of references: what it leaves is far below their error.
NEWTON = 1e-12


@dataclass(frozen=True)
class Ladder:
    """A case with the meshes to try, from coarse to fine, and its references.

    Parameters
    ----------
    base : Case
    cable, quintic, shear, dense : tuple of Mesh
        Meshes of cables, of quintic ones, of shear elements, and of the solver with a dense matrix.
    explicit_peers : tuple of str
        Solvers other than ours that can run it explicitly.
    references : dict of element to Fine or Reference
    fine_step, fine_integrator : float, str
        Of the run on the same mesh that tells the step's error from the mesh's, s.
    steps, quick_steps : tuple of float
        Time steps to try, s, from long to short; of a quick run.
    targets : tuple of float
        Target errors, from the largest to the smallest.
    frames : tuple of Mesh
        Meshes of frames: second order needs finer ones than cables. Empty where they cannot do the scene.
    finest : tuple of Mesh
        Meshes of quintic cables whose clamps free the stretch, for the smallest target errors.
    second : dict of element to Fine
        By which other road a reference is found once more; its coarser mesh and step do not matter.
    beside : tuple of str
        Elements that a quick run tries beside cables.
    """

    base: Case
    cable: tuple[Mesh, ...]
    quintic: tuple[Mesh, ...]
    shear: tuple[Mesh, ...]
    dense: tuple[Mesh, ...]
    explicit_peers: tuple[str, ...]
    references: Mapping[str, Fine | Reference]
    fine_step: float
    fine_integrator: str = IMPLICIT
    steps: tuple[float, ...] = STEPS
    quick_steps: tuple[float, ...] = QUICK_STEPS
    targets: tuple[float, ...] = TARGETS
    frames: tuple[Mesh, ...] = ()
    finest: tuple[Mesh, ...] = ()
    second: Mapping[str, Fine] = field(default_factory=dict)
    beside: tuple[str, ...] = ("quintic", "shear")

    def plan(self, quick: bool) -> Plan:
        """Schemes and references."""
        return Plan(self._few() if quick else self._all(), self.references, SAMPLED)

    def _all(self) -> tuple[Scheme, ...]:
        schemes: list[Scheme] = []
        for quadrature in QUADRATURES if self.base.scene.beams else QUADRATURES[:1]:
            schemes += self._implicit("cable", quadrature, self.cable, CABLE_SOLVERS, self.steps)
            schemes += self._high("cable", quadrature, self.cable, HIGH_STEPS)
            schemes += self._controlled("cable", quadrature, self.cable, TOLERANCES)
            schemes += self._explicit("cable", quadrature, self.cable, self.explicit_peers)
        schemes += self._implicit("cable", "full", self.frames, FRAME_SOLVERS, self.steps)
        schemes += self._implicit("quintic", "full", self.quintic, QUINTIC_SOLVERS, self.steps)
        schemes += self._high("quintic", "full", self.quintic, HIGH_STEPS)
        schemes += self._controlled("quintic", "full", self.quintic, TOLERANCES)
        schemes += self._finest()
        schemes += self._implicit("shear", "full", self.shear, SHEAR_SOLVERS, self.steps)
        schemes += self._controlled("shear", "full", self.shear, TOLERANCES)
        schemes += self._explicit("shear", "full", self.shear, ("global-dae",))
        dense = ("global-dae-dense",)
        schemes.append(_scheme("cable", "lobatto", IMPLICIT, dense, self.dense, (1e-2, 2e-3, 1e-3), TIGHT))
        return tuple(schemes)

    def _implicit(
        self, element: str, quadrature: str, meshes: tuple[Mesh, ...], solvers: tuple[str, ...],
        steps: tuple[float, ...],
    ) -> list[Scheme]:  # fmt: skip
        """The same meshes and steps for every solver, each with all that it says it can choose beside them."""
        return [
            Scheme(element, quadrature, IMPLICIT, (solver,), meshes, lambda mesh: steps, shared, own)
            for solver in solvers
            for shared, own in choices_of(solver)
        ]

    def _high(
        self, element: str, quadrature: str, meshes: tuple[Mesh, ...], steps: tuple[float, ...]
    ) -> list[Scheme]:
        """Our steps of fourth order."""
        steps = tuple(step for step in steps if step <= self.base.interval)
        return [
            Scheme(element, quadrature, HIGH, ("anctmm",), meshes, lambda mesh: steps, shared, own)
            for shared, own in choices_of("anctmm")
        ]

    def _finest(self) -> list[Scheme]:
        """What meets the smallest target errors."""
        return [
            replace(scheme, integrator=integrator, stretch="free")
            for integrator, of in FINEST_STEPS.items()
            for scheme in self._implicit("quintic", "full", self.finest, ("anctmm",), of)
        ]

    def _controlled(
        self, element: str, quadrature: str, meshes: tuple[Mesh, ...], tolerances: tuple[float, ...],
        integrators: tuple[str, ...] = (IMPLICIT, HIGH),
    ) -> list[Scheme]:  # fmt: skip
        """Steps that an error drives, by each method that also makes steps of one length with the element here."""
        return [
            Scheme(
                element, quadrature, integrator, ("anctmm",), meshes, lambda mesh: (),
                (("tolerance", tolerance), ("newton_tolerance", LOOSE)),
            )
            for integrator in ((IMPLICIT,) if element == "shear" else integrators)
            for tolerance in tolerances
        ]  # fmt: skip

    def _explicit(
        self, element: str, quadrature: str, meshes: tuple[Mesh, ...], peers: tuple[str, ...]
    ) -> list[Scheme]:
        steps = self._stable(element, quadrature, MOST_EXPLICIT)
        return [Scheme(element, quadrature, EXPLICIT, ("anctmm", *peers), meshes, steps)]

    def _stable(self, element: str, quadrature: str, most: float) -> Callable[[Mesh], tuple[float, ...]]:
        """The largest safe explicit step that divides the output's interval, and half of it: it hardly matters."""

        def steps(mesh: Mesh) -> tuple[float, ...]:
            base, options = self.base, {"element": element, "quadrature": quadrature}
            names = [body.name for body in base.scene.beams]
            by_body = mesh[0] if len(mesh) == 1 else dict(zip(names, mesh, strict=True))
            try:
                limit = stable_step(base.scene, by_body, options)
            except AnctmmError:  # the solver itself says what it cannot do
                return (base.interval,)
            if isinf(limit):  # nothing vibrates: only the error limits the steps
                return tuple(step for step in self.steps if base.duration / step <= most)
            largest = base.interval / ceil(base.interval / limit)
            work = sum(mesh) * base.duration / largest
            return tuple(largest / k for k in (1, 2) if k * work <= most)

        return steps

    def _few(self) -> tuple[Scheme, ...]:
        steps = self.quick_steps
        return (
            *self._implicit("cable", "lobatto", self.cable, CABLE_SOLVERS, steps),
            *self._high("cable", "lobatto", self.cable[-1:], QUICK_HIGH_STEPS),
            *self._controlled("cable", "lobatto", self.cable[1:2], QUICK_TOLERANCES, (IMPLICIT,)),
            Scheme(
                "cable",
                "reduced",
                EXPLICIT,
                ("anctmm",),
                self.cable[:1],
                self._stable("cable", "reduced", 1e6),
            ),
            *self._few_of_quintic(),
            *self._few_of_shear(),
        )

    def _few_of_quintic(self) -> list[Scheme]:
        """One run that is compared with cables."""
        if "quintic" not in self.beside:
            return []
        return [
            _scheme("quintic", "full", IMPLICIT, ("anctmm",), self.quintic[:1], self.quick_steps[-1:], LOOSE)
        ]

    def _few_of_shear(self) -> list[Scheme]:
        """Few runs that are compared with cables; where there are none, as many as of cables."""
        if self.cable or self.quintic:
            return (
                []
                if "shear" not in self.beside
                else [
                    _scheme(
                        "shear", "full", IMPLICIT, ("anctmm",), self.shear[:2], self.quick_steps[:1], LOOSE
                    )
                ]
            )
        return [
            *self._implicit("shear", "full", self.shear, SHEAR_SOLVERS, self.quick_steps),
            *self._controlled("shear", "full", self.shear[1:2], (3e-3,)),
            Scheme(
                "shear", "full", EXPLICIT, ("anctmm",), self.shear[:1], self._stable("shear", "full", 1e6)
            ),
        ]


def _scheme(
    element: str, quadrature: str, integrator: str, solvers: tuple[str, ...], meshes: tuple[Mesh, ...],
    steps: tuple[float, ...], newton: float,
) -> Scheme:  # fmt: skip
    return Scheme(
        element, quadrature, integrator, solvers, meshes, lambda mesh: steps, (("newton_tolerance", newton),)
    )


def ladders(quick: bool) -> list[Ladder]:
    """Of the two moving base scenes, each by hand; a quick run of them is of cables alone."""
    return [_four_bar(quick), _cantilever(quick)]


def _four_bar(quick: bool) -> Ladder:
    cable: tuple[Mesh, ...] = (
        (1, 3, 1), (1, 4, 1), (1, 6, 1), (2, 6, 2), (2, 8, 2), (2, 12, 2), (3, 10, 3), (4, 12, 4), (4, 16, 4),
        (6, 24, 6),
    )  # fmt: skip
    quintic: tuple[Mesh, ...] = ((1, 1, 1), (1, 2, 1), (1, 3, 1), (1, 4, 1), (2, 6, 2))
    shear: tuple[Mesh, ...] = ((2, 8, 2), (4, 16, 4), (8, 32, 8), (16, 64, 16))
    references: dict[str, Fine | Reference] = {
        "cable": finest((6, 24, 6), (4, 16, 4), 2.5e-4),
        "shear": _fine((32, 128, 32), (16, 64, 16), 2.5e-4, "full"),
    }
    if quick:
        cable, quintic = ((1, 3, 1), (2, 6, 2), (3, 10, 3)), ((1, 3, 1),)
        references = {
            "cable": _smooth((8, 32, 8), (6, 24, 6), 1e-3),
            "shear": _fine((16, 64, 16), (8, 32, 8), 1e-3, "full"),
        }
    return Ladder(
        four_bar(),
        cable,
        quintic,
        shear,
        ((1, 4, 1), (2, 8, 2)),
        ("global-dae",),
        references,
        FINE_STEP[quick],
        HIGH,
        targets=QUICK_TARGETS if quick else TARGETS,
        finest=((1, 3, 1), (1, 4, 1), (2, 6, 2), (2, 8, 2)),
        second=second_road((6, 24, 6), 2e-3),
        beside=(),
    )


def _cantilever(quick: bool) -> Ladder:
    cable: tuple[Mesh, ...] = ((4,), (6,), (8,), (12,), (16,), (24,), (32,), (48,), (64,))
    quintic: tuple[Mesh, ...] = ((2,), (3,), (4,), (6,), (8,), (12,), (16,), (24,))
    shear: tuple[Mesh, ...] = ((16,), (32,), (64,), (128,))
    frames: tuple[Mesh, ...] = ((16,), (32,), (64,), (128,))
    references: dict[str, Fine | Reference] = {
        "cable": finest((96,), (64,), 3.125e-5),
        "shear": _fine((512,), (256,), 1.25e-4, "full"),
    }
    if quick:
        cable, quintic = ((8,), (16,), (32,)), ((8,),)
        references = {
            "cable": _smooth((64,), (48,), 5e-4),
            "shear": _fine((256,), (128,), 1e-3, "full"),
        }
    peers = ("global-dae", "exudyn-cable")
    return Ladder(
        cantilever_fall(),
        cable,
        quintic,
        shear,
        ((8,), (16,)),
        peers,
        references,
        FINE_STEP[quick],
        HIGH,
        targets=QUICK_TARGETS if quick else TARGETS,
        frames=frames,
        finest=((8,), (16,), (24,), (32,), (40,)),
        second=second_road((64,), 1e-4),
        beside=(),
    )


def finest(mesh: Mesh, coarser: Mesh, dt: float) -> Fine:
    """By quintic cables whose clamps free the stretch and steps of fourth order: known to 1e-9 … 1e-8."""
    options = (("newton_tolerance", NEWTON),)
    return Fine(("anctmm", "global-dae"), mesh, coarser, dt, 2 * dt, HIGH, "full", "quintic", "free", options)


def second_road(mesh: Mesh, dt: float) -> Mapping[str, Fine]:
    """The global DAE's collocation at Gauss's points, order 6, of the same continuum."""
    return {"cable": replace(finest(mesh, mesh, dt), solvers=("global-dae",), coarser_mesh=None)}


def _smooth(mesh: Mesh, coarser: Mesh, dt: float) -> Fine:
    """By steps of fourth order, which leave an error of 1e-7 and less: what is left is the mesh's."""
    return Fine(("anctmm", "global-dae"), mesh, coarser, dt, 2 * dt, HIGH, "lobatto")


def _fine(mesh: Mesh, coarser: Mesh, dt: float, quadrature: str) -> Fine:
    return Fine(("anctmm", "global-dae"), mesh, coarser, dt, 2 * dt, IMPLICIT, quadrature)
