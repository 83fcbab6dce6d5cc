"""How the scenes of `anctmm check` are run: every element, integrator and option, by the solvers that have them.

Meshes and steps are coarse: the code is tested, not its accuracy, and it should not take long.
"""

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.case import Case
from anctmm.model.scene import Beam, Probe, Scene
from studies import scenes as base
from studies.engine.meshes import Mesh, by_beam, by_length, longest_step
from studies.regression import small_scenes as small
from studies.regression.scenes import TIGHT, Motion, Read, Run, Static, Watch

Runs = dict[str, Run]
OURS = ("anctmm",)
PEERS = (*OURS, "global-dae")
ALL = (*PEERS, "global-dae-dense")
CABLE, ROD, SHEAR = (*PEERS, "exudyn-cable"), (*PEERS, "exudyn-reissner"), (*ALL, "exudyn-reissner")
CHAINS = ("transfer-plain", "transfer-riccati")
#: Meshes by the elements of each beam.
FOUR_BAR_MESH = {"crank": 2, "coupler": 8, "follower": 2}
ROW3 = {"one": 2, "two": 3, "beside": 1}
ROW4 = {"one": 1, "two": 3, "three": 2, "four": 1}


def fixed(
    integrator: str, mesh: Any, element: Any = "cable", steps: int = 25, dt: float = 2e-3, every: int = 5,
    **options: Any,
) -> Discretisation:  # fmt: skip
    """So many steps, `every` of them between two outputs."""
    options = {"dt": dt, "t_end": steps * dt, "output_dt": every * dt, **options}
    if integrator != "zhai":
        options = {"newton_tolerance": TIGHT, **options}
    return Discretisation(mesh, element, integrator=integrator, **options)


implicit, esdirk = partial(fixed, "generalized-alpha"), partial(fixed, "esdirk", steps=10)
explicit = partial(fixed, "zhai", steps=60, dt=4e-4, every=10)
still = partial(Static, load_steps=2)
readable = partial(explicit, 2, steps=20)  # a readable step takes a millisecond
#: By the word in the name of a run.
KINDS: dict[str, Any] = {"zhai": explicit, "implicit": implicit, "esdirk": esdirk, "static": still}


def named(names: str, mesh: Any = 2) -> Runs:
    """Runs by their names, such as "shear-static-forces": element (or cable), kind (or implicit), what is read."""
    found: Runs = {}
    for name in names.split():
        words = name.split("-")
        element = words.pop(0) if words[0] in ("cable", "shear", "quintic") else "cable"
        read: Any = words.pop() if words[-1] in ("forces", "modes") else ""
        kind = still if read == "modes" else KINDS[words[0]] if words else implicit
        found[name] = Read(read, (kind(mesh, element),)) if read else kind(mesh, element)
    return found


def controlled(
    tolerance: float, t_end: float, parts: int = 5, mesh: int = 2, **options: Any
) -> Discretisation:
    """Steps by a tolerance, with so many outputs."""
    options = {"integrator": "generalized-alpha", "newton_tolerance": TIGHT, **options}
    return Discretisation(mesh, tolerance=tolerance, t_end=t_end, output_dt=t_end / parts, **options)


def base_scenes() -> list[Watch]:
    """Base scenes × elements × integrators × solvers."""
    rest = [(CABLE, {"cable-static": Static(8)}), (ROD, {"shear-static": Static(8, "shear")})]
    found: list[tuple[Any, Any]] = [
        (base.four_bar(), _mechanism(480)),
        (base.four_bar_moment(), _mechanism(240)),
        (base.cantilever_fall(), _fall()),
        *((base.cantilever_tip_force(load), rest) for load in base.TIP_FORCES),
        (base.cantilever_end_moment(base.END_MOMENT), rest),
    ]
    return [Watch(c.scene, tuple(c.probes), runs, solvers) for c, some in found for solvers, runs in some]


def _mechanism(steps: int) -> list[tuple[tuple[str, ...], Runs]]:
    """Explicit runs are cut short: the dense solver takes 60 µs a step. Exudyn has no explicit joints."""
    short = partial(explicit, FOUR_BAR_MESH, steps=24000, dt=2.5e-5, every=2000)
    long = partial(implicit, FOUR_BAR_MESH, steps=steps, dt=5e-3, every=steps // 12)
    return [
        (ALL, {"cable-zhai": short()}),
        (PEERS, {"shear-zhai": short("shear")}),
        (CABLE, {"cable-implicit": long()}),
        (SHEAR, {"shear-implicit": long("shear")}),
        (OURS, {"cable-forces": Read("forces", (long(),))}),
    ]


def _fall() -> list[tuple[tuple[str, ...], Runs]]:
    """The thickness mode of the thin section needs small explicit steps with shear elements: a shorter run."""
    long = partial(implicit, 8, steps=500, every=50)
    return [
        (ALL, {"cable-zhai": explicit(8, steps=20000, dt=5e-5, every=2000)}),
        (PEERS, {"shear-zhai": explicit(8, "shear", steps=80000, dt=2.5e-6, every=8000)}),
        (CABLE, {"cable-implicit": long()}),
        (CABLE, {f"cable-{rule}-implicit": long(quadrature=rule) for rule in ("reduced", "lobatto")}),
        (SHEAR, {"shear-implicit": long("shear")}),
        (OURS, {"cable-adaptive": controlled(1e-4, 0.4, 8, 8)}),
    ]


BOTH = "cable-zhai shear-zhai cable-implicit shear-implicit"
ONE = "cable-zhai cable-implicit shear-implicit"
MOVING = "zhai implicit"
#: Every option of the integrators.
OPTIONS: Runs = {
    "cable-zhai-0.7": explicit(2, psi=0.7, phi=0.7),
    "shear-zhai-0.7": explicit(2, "shear", psi=0.7, phi=0.7),
    "cable-zhai-0.6-0.4": explicit(2, psi=0.6, phi=0.4, check_stability=False),
    "cable-radius-0.4": implicit(2, spectral_radius=0.4),
    "shear-radius-0": implicit(2, "shear", spectral_radius=0.0),
    "cable-radius-1": implicit(2, spectral_radius=1.0),
}
#: Scenes with their runs that end well.
MOVED: list[tuple[Scene, Runs]] = [
    (small.DRIVEN_ROW, named(BOTH, ROW3) | named("forces shear-forces")),
    (small.DRIVEN_ROW, {"quintic-esdirk": esdirk(1, "quintic", steps=60, dt=1.25e-4)}),
    (small.DRIVEN_ROW, {"compared": Read("compared with", (implicit(ROW3), implicit(ROW3, "shear")))}),
    (small.DRIVEN_END, named(ONE) | {"cable-adaptive": controlled(1e-2, 0.05)}),
    (small.TREE, named(f"{ONE} forces")),
    (small.LOOP, named(ONE) | named("quintic-implicit quintic-forces", 1)),
    (small.LOOP, {"quintic-zhai": explicit(1, "quintic", dt=1e-4)}),
    (small.ANGLED_ROW, named(ONE, ROW4)),
    (small.ANGLED_STILL, named("cable-static shear-static", ROW4)),
    (small.ANGLED_STILL, named("cable-static-forces shear-static-forces")),
    (small.OPTIONS, OPTIONS),
    (small.MIXED_ROW, {"zhai": explicit(small.MIXED_MESH, small.MIXED, dt=2e-4)}),
    (small.MIXED_ROW, {"implicit": implicit(small.MIXED_MESH, small.MIXED)}),
    (small.RIGID_ROW, {"cable-zhai": explicit(small.RIGID_MESH, small.RIGID, dt=1e-3)}),
    (small.RIGID_ROW, {"forces": Read("forces", (explicit(small.RIGID_MESH, small.RIGID, dt=1e-3),))}),
    (small.STICK, named("cable-modes shear-modes quintic-modes")),
    (small.STICK, {"cable-adaptive": controlled(1e-3, 0.1)}),
    (small.STICK, {"cable-esdirk-adaptive": controlled(1e-3, 0.1, integrator="esdirk")}),
    (small.STICK, named("cable-static shear-static", 3)),
    (small.BLADE, {"modes": Read("modes", (Static(4),), spin=30.0)}),
    (small.LINKAGE, named(f"{MOVING} esdirk forces zhai-forces esdirk-forces")),
    (small.LINKAGE, {"adaptive": controlled(1e-2, 0.02, parts=4)}),
    (small.HELD, named("static static-forces modes")),
    (small.HELD, {"from-rest": Read("start=rest", (implicit(2, steps=20, dt=1e-3),))}),
    (small.GUIDED, named(f"{MOVING} forces")),
    (small.SLIDING, named(f"{MOVING} static forces")),
    (small.STRETCHED, named(f"{MOVING} static forces")),
    (small.STARTED, named("implicit")),
]
unchecked = partial(explicit, 2, check_stability=False)
#: Runs that no beam survives, found by each of the checks that look for it.
FAILING: list[tuple[Scene, str, Run, str]] = [
    (small.OPTIONS, "not-finite", unchecked(steps=1000, dt=4e-3, every=500), "diverged"),
    (small.OPTIONS, "too-large", unchecked(steps=100, dt=4e-3, every=5), "diverged"),
    (small.PULLED, "cable-stretched", implicit(2, steps=5), "diverged"),
    (small.PULLED, "shear-stalled", implicit(2, "shear", steps=5), "diverged"),
    (small.CRUSHED, "shear-inside-out", implicit(2, "shear", steps=20), "diverged"),
    (small.CRUSHED, "shear-inside-out-zhai", unchecked("shear"), "diverged"),
    (small.CRUSHED, "static-crushed", Static(2, "shear"), "diverged"),
    (small.BARE, "static-free", Static(2), "diverged"),
    (small.SPUN, "made-energy", implicit(4, steps=10, dt=0.01), "diverged"),
    (small.SPUN, "some-energy", implicit(4, steps=8, dt=0.007), "inaccurate"),
    (small.COLUMN, "unstable", Static(4), "unstable"),
    (small.LOCKED, "locked", explicit(1, "rigid", dt=1e-3), "failed"),
    (small.OPTIONS, "refused-psi-phi", explicit(2, psi=0.6, phi=0.5), "refused"),
]
#: The largest stable step of scenes, s, as the global DAE finds it: by elements and ψ = φ.
LIMITS: dict[str, tuple[Scene, Any, Any, float, float]] = {
    "cable": (small.BARE, 1, "cable", 0.5, 6.3036110e-3),
    "shear": (small.BARE, 1, "shear", 0.5, 8.3745481e-4),
    "joined-cable": (small.ANGLED_ROW, 2, "cable", 0.6, 2.7966353e-3),
    "joined-shear": (small.DRIVEN_ROW, 2, "shear", 0.7, 5.9354273e-4),
}
NEAR = 1e-3


def all_watches() -> tuple[Watch, ...]:
    """All that `anctmm check` watches: base scenes and small ones."""
    both: Runs = {"cable-readable": readable(), "shear-readable": readable("shear")}
    return (
        *base_scenes(),
        *(_watch(*row) for row in MOVED),
        *(_watch(scene, {name: run}, ends) for scene, name, run, ends in FAILING),
        *_limits(),
        _watch(small.DRIVEN_CHAIN, both, solvers=(*OURS, *CHAINS)),
        _watch(small.DRIVEN_END, {"cable-readable": readable()}, solvers=(*OURS, *CHAINS)),
    )


def _watch(scene: Scene, runs: Runs, ends: str = "ok", solvers: tuple[str, ...] = OURS) -> Watch:
    probes: list[Probe] = [(b.name, fraction) for b in scene.beams for fraction in (0.0, 0.3, 1.0)]
    probes += [f"{b.name}.{key}" for b in scene.bodies if not isinstance(b, Beam) for key in b.keys]
    return Watch(scene, tuple(probes), runs, solvers, ends)


def _limits() -> Iterator[Watch]:
    """Steps on both sides of the largest stable one."""
    for name, (scene, mesh, element, psi, limit) in LIMITS.items():
        for side, factor, ends in (("below", 1.0 - NEAR, "ok"), ("above", 1.0 + NEAR, "refused")):
            dt = float(f"{limit * factor:.5g}")
            run = Discretisation(mesh, element, integrator="zhai", dt=dt, t_end=4.0 * dt, psi=psi, phi=psi)
            yield _watch(scene, {f"{side}-limit-{name}": run}, ends)


#: Elements of the longest beam, steps between outputs, and samples of a stored history at most.
ELEMENTS, EVERY, SAMPLES = 4, 4, 20


def watches_of(cases: Iterable[Case], mesh: Mesh | None = None, dt: float | None = None) -> tuple[Watch, ...]:
    """A watch of each case, of one run of cables and implicit steps.

    `mesh` has elements of each beam, or one number for all; StudyError if it does not fit. `dt` is a step, s.
    """
    return tuple(Watch(c.scene, tuple(c.probes), {"cable": _run(c, mesh, dt)}, PEERS) for c in cases)


def _run(case: Case, given: Mesh | None, dt: float | None) -> Motion:
    mesh = by_beam(case.scene, given or by_length(case.scene, ELEMENTS, each=2) or (2,))
    if case.static:
        return Static(mesh)
    outputs = round(case.duration / case.interval)
    few = next(k for k in range(1, outputs + 1) if outputs % k == 0 and outputs // k <= SAMPLES)
    step, each = dt or longest_step(case) / EVERY, few * case.interval
    return Discretisation(mesh, newton_tolerance=TIGHT, dt=step, t_end=case.duration, output_dt=each)
