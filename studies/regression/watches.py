"""How all scenes of `anctmm check` are run: every element, integrator and option, by the solvers that have them.

Meshes and steps are coarse: the code is tested, not its accuracy, and it should not take long.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.scene import Beam, Probe, Scene
from studies import scenes as base
from studies.regression import small_scenes as small
from studies.regression.scenes import (
    ARC_LENGTH,
    TIGHT,
    Compared,
    Forces,
    Frequencies,
    FromRest,
    Motion,
    Run,
    StartVelocities,
    Static,
    Watch,
)

ELEMENTS = "cable", "shear"
OURS = ("anctmm",)
PEERS = (*OURS, "global-dae")
ALL = (*PEERS, "global-dae-dense")
CABLE, ROD = (*PEERS, "exudyn-cable"), (*PEERS, "exudyn-reissner")
CHAINS = ("transfer-plain", "transfer-riccati")
#: Meshes by the elements of each beam.
FOUR_BAR_MESH = {"crank": 2, "coupler": 8, "follower": 2}
ROW3 = {"one": 2, "two": 3, "beside": 1}
ROW4 = {"one": 1, "two": 3, "three": 2, "four": 1}
BARE = {"cable": {"bare": "cable", "beside": "shear"}, "shear": {"bare": "shear", "beside": "cable"}}
#: Steps just below and just above the largest stable one of each scene, s: elements, ψ = φ, and that step (those of
#: the global DAE).
LIMITS: dict[str, tuple[Scene, Any, Any, float, float]] = {
    "cable": (small.BARE, 1, "cable", 0.5, 6.3036110e-3),
    "shear": (small.BARE, 1, "shear", 0.5, 8.3745481e-4),
    "damped-cable": (small.BARE_DAMPED, 1, BARE["cable"], 0.5, 5.9162894e-3),
    "damped-shear": (small.BARE_DAMPED, 1, BARE["shear"], 0.5, 5.2807896e-4),
    "joined-cable": (small.ANGLED_ROW, 2, "cable", 0.6, 2.7966353e-3),
    "joined-shear": (small.DRIVEN_ROW, 2, "shear", 0.7, 5.9354273e-4),
    "rigid": (small.RIGID_ROW, small.RIGID_MESH, small.RIGID, 0.5, 3.8416057e-3),
}
NEAR = 1e-3
Runs = dict[str, Run]
#: A scene, its runs by name, how they end, and their solvers.
Row = (
    tuple[Scene, Mapping[str, Run]]
    | tuple[Scene, Mapping[str, Run], str]
    | tuple[Scene, Mapping[str, Run], str, tuple[str, ...]]
)


def all_watches() -> tuple[Watch, ...]:
    """All that `anctmm check` watches: base scenes and small ones."""
    return (*base_watches(), *small_watches())


def small_watches() -> tuple[Watch, ...]:
    """Every small scene with its runs."""
    parts = rows_of_beams(), statics(), limits(), failing(), mechanisms(), read_besides(), readable()
    return tuple(_watch(*row) for part in parts for row in part)


def _watch(scene: Scene, runs: Mapping[str, Run], ends: str = "ok", solvers: tuple[str, ...] = OURS) -> Watch:
    probes: list[Probe] = [(b.name, fraction) for b in scene.beams for fraction in (0.0, 0.3, 1.0)]
    probes += [f"{b.name}.{key}" for b in scene.bodies if not isinstance(b, Beam) for key in b.keys]
    return Watch(scene, tuple(probes), runs, solvers, ends)


# --- runs ------------------------------------------------------------------------------------------------------


def explicit(mesh: Any, element: Any = "cable", steps: int = 60, dt: float = 4e-4, **options: Any) -> Motion:
    """Explicit steps, ten between two outputs."""
    times: dict[str, Any] = {"dt": dt, "t_end": steps * dt, "output_dt": 10 * dt}
    return Discretisation(mesh, element, integrator="zhai", **times, **options)


def implicit(mesh: Any, element: Any = "cable", steps: int = 25, dt: float = 2e-3, **options: Any) -> Motion:
    """Implicit steps, five between two outputs."""
    options = {"newton_tolerance": TIGHT, **options}
    return Discretisation(mesh, element, dt=dt, t_end=steps * dt, output_dt=5 * dt, **options)


def esdirk(mesh: Any, element: Any = "cable", steps: int = 10, dt: float = 2e-3) -> Motion:
    """Implicit steps of fourth order."""
    return implicit(mesh, element, steps, dt, integrator="esdirk")


def controlled(tolerance: float, t_end: float, method: str = "generalized-alpha", **options: Any) -> Motion:
    """Steps by a tolerance."""
    options = {"output_dt": t_end / 5, "newton_tolerance": TIGHT, **options}
    return Discretisation(2, integrator=method, tolerance=tolerance, t_end=t_end, **options)


def each(kind: str, made: Callable[[str], Run], elements: Iterable[str] = ELEMENTS) -> Runs:
    """A run of each element, "cable-zhai"."""
    return {f"{element}-{kind}": made(element) for element in elements}


def both(mesh: Any = 2, explicitly: Iterable[str] = ELEMENTS) -> Runs:
    """Implicit runs of both elements, explicit ones of some."""
    runs = each("zhai", lambda element: explicit(mesh, element), explicitly)
    return runs | each("implicit", lambda element: implicit(mesh, element))


# --- base scenes -----------------------------------------------------------------------------------------------


def base_watches() -> tuple[Watch, ...]:
    """Base scenes × elements × integrators × solvers."""
    found = []
    for case, runs in (
        (base.four_bar(), _mechanism(2.4)),
        (base.four_bar_moment(), _mechanism(1.2)),
        (base.cantilever_fall(), _fall()),
        *((base.cantilever_tip_force(load), _rest()) for load in base.TIP_FORCES),
        (base.cantilever_end_moment(base.END_MOMENT), _rest()),
    ):
        found += [Watch(case.scene, case.probes, some, solvers) for solvers, some in runs]
    return tuple(found)


def _mechanism(t_end: float) -> list[tuple[tuple[str, ...], Runs]]:
    """Explicit runs are cut short: the dense solver takes 60 µs a step. Exudyn has no explicit joints."""

    def fixed(element: str) -> Motion:
        times: dict[str, Any] = {"dt": 2.5e-5, "t_end": 0.6, "output_dt": 0.05}
        return Discretisation(FOUR_BAR_MESH, element, integrator="zhai", **times)

    def long(element: str) -> Motion:
        times: dict[str, Any] = {"dt": 5e-3, "t_end": t_end, "output_dt": t_end / 12}
        return Discretisation(FOUR_BAR_MESH, element, newton_tolerance=TIGHT, **times)

    return [
        (ALL, {"cable-zhai": fixed("cable")}),
        (PEERS, {"shear-zhai": fixed("shear")}),
        (CABLE, {"cable-implicit": long("cable")}),
        ((*ALL, "exudyn-reissner"), {"shear-implicit": long("shear")}),
        (OURS, {"cable-forces": Forces(long("cable"))}),
    ]


def _fall() -> list[tuple[tuple[str, ...], Runs]]:
    """The thickness mode of the thin section needs small explicit steps with shear elements: a shorter run."""

    def fixed(element: str, dt: float, t_end: float) -> Motion:
        return Discretisation(8, element, integrator="zhai", dt=dt, t_end=t_end, output_dt=t_end / 10)

    def long(element: str, rule: str = "full") -> Motion:
        return Discretisation(8, element, rule, dt=2e-3, t_end=1.0, output_dt=0.1, newton_tolerance=TIGHT)

    careful = Discretisation(
        8, integrator="generalized-alpha", tolerance=1e-4, t_end=0.4, output_dt=0.05, newton_tolerance=TIGHT
    )
    rules = {f"cable-{rule}-implicit": long("cable", rule) for rule in ("reduced", "lobatto")}
    return [
        (ALL, {"cable-zhai": fixed("cable", 5e-5, 1.0)}),
        (PEERS, {"shear-zhai": fixed("shear", 2.5e-6, 0.2)}),
        (CABLE, {"cable-implicit": long("cable"), **rules}),
        ((*ALL, "exudyn-reissner"), {"shear-implicit": long("shear")}),
        (OURS, {"cable-adaptive": careful}),
    ]


def _rest() -> list[tuple[tuple[str, ...], Runs]]:
    return [(CABLE, {"cable-static": Static(8)}), (ROD, {"shear-static": Static(8, "shear")})]


# --- small scenes ----------------------------------------------------------------------------------------------


def rows_of_beams() -> list[Row]:
    """Explicit, implicit and adaptive runs, with every option of the integrators."""
    long = {"strip": 70, "tail": 3}, {"strip": 66, "tail": 3}
    adaptive: Runs = {
        "cable-adaptive": controlled(1e-3, 0.1),
        "cable-esdirk-adaptive": controlled(1e-3, 0.1, "esdirk"),
    }
    quintic: Runs = {"quintic-implicit": implicit(1, "quintic")}
    return [
        (small.DRIVEN_ROW, both(ROW3) | {"quintic-esdirk": esdirk(1, "quintic", 60, 1.25e-4)}),
        (small.DRIVEN_TAIL, both()),
        (small.STRAIGHT_ROW, both({"one": 2, "two": 1, "three": 2})),
        (small.DRIVEN_END, both(2, ["cable"]) | {"cable-adaptive": controlled(1e-2, 0.05)}),
        (small.TREE, both(2, ["cable"])),
        (small.LOOP, both(2, ["cable"]) | quintic | {"quintic-zhai": explicit(1, "quintic", dt=1e-4)}),
        (small.ANGLED_ROW, both(ROW4, ["cable"])),
        (small.OPTIONS, _options()),
        (small.MIXED_ROW, {"zhai": explicit(small.MIXED_MESH, small.MIXED, dt=2e-4)}),
        (small.MIXED_ROW, {"implicit": implicit(small.MIXED_MESH, small.MIXED)}),
        (small.LONG_STRIP, each("zhai", lambda e: explicit(long[0], e, steps=20, dt=1e-4))),
        (small.LONG_STRIP, each("implicit", lambda e: implicit(long[1], e, steps=3))),
        (small.RIGID_ROW, {"cable-zhai": explicit(small.RIGID_MESH, small.RIGID, dt=1e-3)}),
        (small.RIGID_PENDULUM, {"zhai": explicit(1, "rigid", dt=1e-3)}),
        (small.ROLLED, each("implicit", lambda e: implicit({"cable": 8, "shear": 4}[e], e, steps=10))),
        # short steps, so that a method of another order finds the same
        (small.FREED, quintic | {"cable-esdirk": esdirk(1, "cable", 60, 2.5e-4)}),
        (small.STICK, adaptive),
        (small.PULSE, adaptive),
    ]


def _options() -> Runs:
    return {
        "cable-reduced-zhai": explicit(2, quadrature="reduced"),
        "cable-lobatto-zhai": explicit(2, quadrature="lobatto"),
        "cable-zhai-0.7": explicit(2, psi=0.7, phi=0.7),
        "shear-zhai-0.7": explicit(2, "shear", psi=0.7, phi=0.7),
        "cable-zhai-0.6-0.4": explicit(2, psi=0.6, phi=0.4, check_stability=False),
        "cable-radius-0.4": implicit(2, spectral_radius=0.4),
        "shear-radius-0": implicit(2, "shear", spectral_radius=0.0),
        "cable-radius-1": implicit(2, spectral_radius=1.0),
        "cable-reduced": implicit(2, quadrature="reduced"),
        "cable-loose": implicit(2, newton_tolerance=1e-5),
        "shear-loose": implicit(2, "shear", newton_tolerance=1e-5),
    }


def statics() -> list[Row]:
    """Equilibria, one of them unstable."""

    def runs(mesh: Any) -> Runs:
        return each("static", lambda element: Static(mesh, element, load_steps=2))

    rules = {f"cable-{r}-static": Static(3, "cable", r, load_steps=2) for r in ("reduced", "lobatto")}
    return [
        (small.STICK, runs(3) | rules),
        (small.ANGLED_STILL, runs(ROW4)),
        (small.STANDING, {"mixed-static": Static(small.MIXED_MESH, small.MIXED, load_steps=2)}),
        (small.LONG_STICK, runs(66)),
        (small.held_up(60.0), {"static": Static(4)}),
        (small.held_up(0.01), {"unstable": Static(4)}, "unstable"),
    ]


def readable() -> list[Row]:
    """By the transfer matrices of the paper; few steps: a readable one takes a millisecond."""
    runs = each("readable", lambda element: explicit(2, element, steps=20))
    angled = {"cable-readable": runs["cable-readable"]}
    solvers = (*OURS, *CHAINS)
    return [
        (small.DRIVEN_CHAIN, runs, "ok", solvers),
        (small.DRIVEN_TAIL, runs, "ok", solvers),
        (small.DRIVEN_END, angled, "ok", solvers),
        (small.HELD_CHAIN, angled, "ok", solvers),
        (small.DRIVEN_DAMPED, runs, "ok", CHAINS),
    ]


def limits() -> list[Row]:
    """Steps on both sides of the largest stable one, and others that are refused."""
    rows: list[Row] = []
    for name, (scene, mesh, element, psi, limit) in LIMITS.items():
        for side, sign, ends in (("below", -1.0, "ok"), ("above", 1.0, "refused")):
            dt = float(f"{limit * (1.0 + sign * NEAR):.5g}")
            run = Discretisation(mesh, element, integrator="zhai", dt=dt, t_end=4.0 * dt, psi=psi, phi=psi)
            rows.append((scene, {f"{side}-limit-{name}": run}, ends))
    return [*rows, (small.OPTIONS, {"refused-psi-phi": explicit(2, psi=0.6, phi=0.5)}, "refused")]


def failing() -> list[Row]:
    """Runs that no beam survives, found by each of the checks that look for it."""

    def unchecked(mesh: int, dt: float, t_end: float, output_dt: float) -> Motion:
        times: dict[str, Any] = {"dt": dt, "t_end": t_end, "output_dt": output_dt}
        return Discretisation(mesh, integrator="zhai", check_stability=False, **times)

    adaptive = Discretisation(2, integrator="generalized-alpha", tolerance=1e-2, t_end=0.01, output_dt=0.002)
    diverging: list[tuple[Scene, str, Run]] = [
        (small.OPTIONS, "not-finite", unchecked(2, 4e-3, 4.0, 2.0)),
        (small.OPTIONS, "too-large", unchecked(2, 4e-3, 0.4, 0.02)),
        (small.STRAIGHT_ROW, "energy", unchecked(3, 1.57e-3, 1.57e-3 * 90, 1.57e-3 * 5)),
        (small.PULLED, "cable-stretched", implicit(2, steps=5)),
        (small.PULLED, "stretched-adaptive", adaptive),
        (small.PULLED, "shear-stalled", implicit(2, "shear", steps=5)),
        (small.PUSHED, "cable-inside-out", implicit(2, steps=10, dt=2e-2)),
        (small.CRUSHED, "shear-inside-out", implicit(2, "shear", steps=20)),
        (small.CRUSHED, "shear-inside-out-zhai", explicit(2, "shear", check_stability=False)),
        (small.WOUND, "static-inside-out", Static(1, load_steps=8)),
        (small.CRUSHED, "static-crushed", Static(2, "shear")),
        (small.BARE, "static-free", Static(2)),
        (small.SPUN, "made-energy", implicit(4, steps=10, dt=0.01)),
    ]
    return [
        *((scene, {name: run}, "diverged") for scene, name, run in diverging),
        (small.SPUN, {"some-energy": implicit(4, steps=8, dt=0.007)}, "inaccurate"),
        (small.COLUMN, {"unstable": Static(4)}, "unstable"),
        (small.LOCKED, {"locked": explicit(1, "rigid", dt=1e-3)}, "failed"),
    ]


def mechanisms() -> list[Row]:
    """Bodies, guides, connectors and loads of mechanisms, all of cables."""
    moving: Runs = {"zhai": explicit(2), "implicit": implicit(2)}
    static: Runs = {"static": Static(2, load_steps=2)}
    accurate: Runs = {"esdirk": esdirk(2)}
    released = FromRest(2, dt=1e-3, t_end=0.02, output_dt=0.005, newton_tolerance=TIGHT)
    return [
        (small.LINKAGE, {**moving, **accurate, "adaptive": controlled(1e-2, 0.02, output_dt=0.005)}),
        *((scene, moving) for scene in (small.GUIDED, small.GUIDES, small.WHEEL, small.parallel())),
        *((scene, moving | static) for scene in (small.SLIDING, small.STRETCHED)),
        (small.driven_plate(), moving | accurate),
        (small.HELD, static | {"from-rest": released}),
        (small.LATTICE, {"implicit": implicit(1)}),
        (small.SLACK, {"static": Static(1, load_steps=1)}),
        (small.TRUSS, {"path": Static(1, load_steps=8, path=ARC_LENGTH)}),
    ]


def read_besides() -> list[Row]:
    """Forces, frequencies, consistent velocities and comparisons."""
    forces: Runs = {"forces": Forces(implicit(2))}
    both: Runs = {"zhai-forces": Forces(explicit(2)), "esdirk-forces": Forces(esdirk(2))}
    compared = Compared(implicit(ROW3), implicit(ROW3, "shear"))
    at_rest = Static(2, load_steps=2)
    scenes = small.GUIDED, small.SLIDING, small.GUIDES, small.WHEEL, small.STRETCHED, small.TREE

    def modes(element: str) -> Run:
        return Frequencies(Static(2, element, load_steps=2), at_rest=True)

    return [
        (small.LINKAGE, forces | both),
        *((scene, forces) for scene in (*scenes, small.driven_plate())),
        (small.DRIVEN_ROW, forces | {"shear-forces": Forces(implicit(2, "shear")), "compared": compared}),
        (small.RIGID_ROW, {"forces": Forces(explicit(small.RIGID_MESH, small.RIGID, dt=1e-3))}),
        (small.LOOP, {"quintic-forces": Forces(implicit(1, "quintic"))}),
        (small.ANGLED_STILL, each("static-forces", lambda e: Forces(Static(2, e, load_steps=2)))),
        (small.HELD, {"static-forces": Forces(at_rest), "modes": modes("cable")}),
        (small.STICK, each("modes", modes, (*ELEMENTS, "quintic"))),
        (small.BLADE, {"modes": Frequencies(Static(4), spin=30.0)}),
        (small.held_up(60.0), {"modes": Frequencies(Static(4), at_rest=True)}),
        (small.STARTED, {"velocities": StartVelocities()}),
    ]
