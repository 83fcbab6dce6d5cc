"""How all scenes of `anctmm check` are run: every element, integrator and option, by the solvers that have them.

Meshes and steps are coarse: the code is tested, not its accuracy, and it should not take long.
"""

from collections.abc import Callable, Iterable
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
#: Steps just below and just above the largest stable one of each scene, s: elements, ψ = φ, and that step (those of
#: the global DAE).
LIMITS: dict[str, tuple[Scene, Any, Any, float, float]] = {
    "cable": (small.BARE, 1, "cable", 0.5, 6.3036110e-3),
    "shear": (small.BARE, 1, "shear", 0.5, 8.3745481e-4),
    "damped-cable": (small.BARE_DAMPED, 1, {"bare": "cable", "beside": "shear"}, 0.5, 5.9162894e-3),
    "damped-shear": (small.BARE_DAMPED, 1, {"bare": "shear", "beside": "cable"}, 0.5, 5.2807896e-4),
    "joined-cable": (small.ANGLED_ROW, 2, "cable", 0.6, 2.7966353e-3),
    "joined-shear": (small.DRIVEN_ROW, 2, "shear", 0.7, 5.9354273e-4),
    "rigid": (small.RIGID_ROW, small.RIGID_MESH, small.RIGID, 0.5, 3.8416057e-3),
}
NEAR = 1e-3
Runs = dict[str, Run]


def all_watches() -> tuple[Watch, ...]:
    """All that `anctmm check` watches: base scenes and small ones."""
    parts = base_scenes, rows_of_beams, statics, limits, failing, mechanisms, read_besides, readable
    return tuple(watch for part in parts for watch in part())


def _watch(scene: Scene, runs: Runs, ends: str = "ok", solvers: tuple[str, ...] = OURS) -> Watch:
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


def controlled(tolerance: float, t_end: float, parts: int = 5, mesh: int = 2, **options: Any) -> Motion:
    """Steps by a tolerance, with so many outputs."""
    options = {"integrator": "generalized-alpha", "newton_tolerance": TIGHT, **options}
    return Discretisation(mesh, tolerance=tolerance, t_end=t_end, output_dt=t_end / parts, **options)


def each(kind: str, made: Callable[[str], Run], elements: Iterable[str] = ELEMENTS) -> Runs:
    """A run of each element, "cable-zhai"."""
    return {f"{element}-{kind}": made(element) for element in elements}


def both(mesh: Any = 2, explicitly: Iterable[str] = ELEMENTS) -> Runs:
    """Implicit runs of both elements, explicit ones of some."""
    runs = each("zhai", lambda element: explicit(mesh, element), explicitly)
    return runs | each("implicit", lambda element: implicit(mesh, element))


# --- base scenes -----------------------------------------------------------------------------------------------


def base_scenes() -> list[Watch]:
    """Base scenes × elements × integrators × solvers."""
    rest: list[tuple[tuple[str, ...], Runs]] = [
        (CABLE, {"cable-static": Static(8)}),
        (ROD, {"shear-static": Static(8, "shear")}),
    ]
    found = [
        (base.four_bar(), _mechanism(2.4)),
        (base.four_bar_moment(), _mechanism(1.2)),
        (base.cantilever_fall(), _fall()),
        *((base.cantilever_tip_force(load), rest) for load in base.TIP_FORCES),
        (base.cantilever_end_moment(base.END_MOMENT), rest),
    ]
    return [
        Watch(c.scene, tuple(c.probes), dict(runs), solvers) for c, some in found for solvers, runs in some
    ]


def _motion(mesh: Any, element: str, dt: float, t_end: float, output_dt: float, **options: Any) -> Motion:
    """Implicit steps."""
    options |= {"dt": dt, "t_end": t_end, "output_dt": output_dt}
    return Discretisation(mesh, element, newton_tolerance=TIGHT, **options)


def _fixed(mesh: Any, element: str, dt: float, t_end: float, output_dt: float) -> Motion:
    """Explicit steps."""
    return Discretisation(mesh, element, integrator="zhai", dt=dt, t_end=t_end, output_dt=output_dt)


def _mechanism(t_end: float) -> list[tuple[tuple[str, ...], Runs]]:
    """Explicit runs are cut short: the dense solver takes 60 µs a step. Exudyn has no explicit joints."""
    fixed = {element: _fixed(FOUR_BAR_MESH, element, 2.5e-5, 0.6, 0.05) for element in ELEMENTS}
    long = {element: _motion(FOUR_BAR_MESH, element, 5e-3, t_end, t_end / 12) for element in ELEMENTS}
    return [
        (ALL, {"cable-zhai": fixed["cable"]}),
        (PEERS, {"shear-zhai": fixed["shear"]}),
        (CABLE, {"cable-implicit": long["cable"]}),
        ((*ALL, "exudyn-reissner"), {"shear-implicit": long["shear"]}),
        (OURS, {"cable-forces": Forces(long["cable"])}),
    ]


def _fall() -> list[tuple[tuple[str, ...], Runs]]:
    """The thickness mode of the thin section needs small explicit steps with shear elements: a shorter run."""
    rules = {
        "cable-implicit": "full",
        "cable-reduced-implicit": "reduced",
        "cable-lobatto-implicit": "lobatto",
    }
    return [
        (ALL, {"cable-zhai": _fixed(8, "cable", 5e-5, 1.0, 0.1)}),
        (PEERS, {"shear-zhai": _fixed(8, "shear", 2.5e-6, 0.2, 0.02)}),
        (CABLE, {k: _motion(8, "cable", 2e-3, 1.0, 0.1, quadrature=rule) for k, rule in rules.items()}),
        ((*ALL, "exudyn-reissner"), {"shear-implicit": _motion(8, "shear", 2e-3, 1.0, 0.1)}),
        (OURS, {"cable-adaptive": controlled(1e-4, 0.4, 8, 8)}),
    ]


# --- small scenes ----------------------------------------------------------------------------------------------


def rows_of_beams() -> list[Watch]:
    """Explicit, implicit and adaptive runs, with every option of the integrators."""
    adaptive: Runs = {
        "cable-adaptive": controlled(1e-3, 0.1),
        "cable-esdirk-adaptive": controlled(1e-3, 0.1, integrator="esdirk"),
    }
    quintic: Runs = {"quintic-implicit": implicit(1, "quintic")}
    mixed: Runs = {"zhai": explicit(small.MIXED_MESH, small.MIXED, dt=2e-4)}
    long: Runs = each("zhai", lambda e: explicit({"strip": 70, "tail": 3}, e, steps=20, dt=1e-4))
    long |= each("implicit", lambda e: implicit({"strip": 66, "tail": 3}, e, steps=3))
    rows: list[tuple[Scene, Runs]] = [
        (small.DRIVEN_ROW, both(ROW3) | {"quintic-esdirk": esdirk(1, "quintic", 60, 1.25e-4)}),
        (small.DRIVEN_TAIL, both()),
        (small.STRAIGHT_ROW, both({"one": 2, "two": 1, "three": 2})),
        (small.DRIVEN_END, both(2, ["cable"]) | {"cable-adaptive": controlled(1e-2, 0.05)}),
        (small.TREE, both(2, ["cable"])),
        (small.LOOP, both(2, ["cable"]) | quintic | {"quintic-zhai": explicit(1, "quintic", dt=1e-4)}),
        (small.ANGLED_ROW, both(ROW4, ["cable"])),
        (small.OPTIONS, _options()),
        (small.MIXED_ROW, mixed | {"implicit": implicit(small.MIXED_MESH, small.MIXED)}),
        (small.LONG_STRIP, long),
        (small.RIGID_ROW, {"cable-zhai": explicit(small.RIGID_MESH, small.RIGID, dt=1e-3)}),
        (small.RIGID_PENDULUM, {"zhai": explicit(1, "rigid", dt=1e-3)}),
        (small.ROLLED, each("implicit", lambda e: implicit({"cable": 8, "shear": 4}[e], e, steps=10))),
        # short steps, so that a method of another order finds the same
        (small.FREED, quintic | {"cable-esdirk": esdirk(1, "cable", 60, 2.5e-4)}),
        (small.STICK, adaptive),
        (small.PULSE, adaptive),
    ]
    return [_watch(*row) for row in rows]


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


def statics() -> list[Watch]:
    """Equilibria, one of them unstable."""

    def runs(mesh: Any) -> Runs:
        return each("static", lambda element: Static(mesh, element, load_steps=2))

    rules: Runs = {f"cable-{r}-static": Static(3, "cable", r, load_steps=2) for r in ("reduced", "lobatto")}
    return [
        _watch(small.STICK, runs(3) | rules),
        _watch(small.ANGLED_STILL, runs(ROW4)),
        _watch(small.STANDING, {"mixed-static": Static(small.MIXED_MESH, small.MIXED, load_steps=2)}),
        _watch(small.LONG_STICK, runs(66)),
        _watch(small.held_up(60.0), {"static": Static(4)}),
        _watch(small.held_up(0.01), {"unstable": Static(4)}, "unstable"),
    ]


def readable() -> list[Watch]:
    """By the transfer matrices of the paper; few steps: a readable one takes a millisecond."""
    runs = each("readable", lambda element: explicit(2, element, steps=20))
    angled = {"cable-readable": runs["cable-readable"]}
    solvers = (*OURS, *CHAINS)
    return [
        _watch(small.DRIVEN_CHAIN, runs, "ok", solvers),
        _watch(small.DRIVEN_TAIL, runs, "ok", solvers),
        _watch(small.DRIVEN_END, angled, "ok", solvers),
        _watch(small.HELD_CHAIN, angled, "ok", solvers),
        _watch(small.DRIVEN_DAMPED, runs, "ok", CHAINS),
    ]


def limits() -> list[Watch]:
    """Steps on both sides of the largest stable one, and others that are refused."""
    found = [_watch(small.OPTIONS, {"refused-psi-phi": explicit(2, psi=0.6, phi=0.5)}, "refused")]
    for name, (scene, mesh, element, psi, limit) in LIMITS.items():
        for side, sign, ends in (("below", -1.0, "ok"), ("above", 1.0, "refused")):
            dt = float(f"{limit * (1.0 + sign * NEAR):.5g}")
            run = Discretisation(mesh, element, integrator="zhai", dt=dt, t_end=4.0 * dt, psi=psi, phi=psi)
            found.append(_watch(scene, {f"{side}-limit-{name}": run}, ends))
    return found


def failing() -> list[Watch]:
    """Runs that no beam survives, found by each of the checks that look for it."""

    def unchecked(mesh: int, dt: float, t_end: float, output_dt: float) -> Motion:
        times: dict[str, Any] = {"dt": dt, "t_end": t_end, "output_dt": output_dt}
        return Discretisation(mesh, integrator="zhai", check_stability=False, **times)

    adaptive = controlled(1e-2, 0.01, newton_tolerance=Discretisation.newton_tolerance)
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
        *(_watch(scene, {name: run}, "diverged") for scene, name, run in diverging),
        _watch(small.SPUN, {"some-energy": implicit(4, steps=8, dt=0.007)}, "inaccurate"),
        _watch(small.COLUMN, {"unstable": Static(4)}, "unstable"),
        _watch(small.LOCKED, {"locked": explicit(1, "rigid", dt=1e-3)}, "failed"),
    ]


def mechanisms() -> list[Watch]:
    """Bodies, guides, connectors and loads of mechanisms, all of cables."""
    moving: Runs = {"zhai": explicit(2), "implicit": implicit(2)}
    static: Runs = {"static": Static(2, load_steps=2)}
    accurate: Runs = {"esdirk": esdirk(2)}
    released = FromRest(Discretisation(2, dt=1e-3, t_end=0.02, output_dt=0.005, newton_tolerance=TIGHT))
    adaptive = controlled(1e-2, 0.02, parts=4)
    return [
        _watch(small.LINKAGE, {**moving, **accurate, "adaptive": adaptive}),
        *(_watch(s, moving) for s in (small.GUIDED, small.GUIDES, small.WHEEL, small.parallel())),
        *(_watch(s, moving | static) for s in (small.SLIDING, small.STRETCHED)),
        _watch(small.driven_plate(), moving | accurate),
        _watch(small.HELD, static | {"from-rest": released}),
        _watch(small.LATTICE, {"implicit": implicit(1)}),
        _watch(small.SLACK, {"static": Static(1, load_steps=1)}),
        _watch(small.TRUSS, {"path": Static(1, load_steps=8, path=ARC_LENGTH)}),
    ]


def read_besides() -> list[Watch]:
    """Forces, frequencies, consistent velocities and comparisons."""
    forces: Runs = {"forces": Forces(implicit(2))}
    more: Runs = {"zhai-forces": Forces(explicit(2)), "esdirk-forces": Forces(esdirk(2))}
    shear: Runs = {
        "shear-forces": Forces(implicit(2, "shear")),
        "compared": Compared(implicit(ROW3), implicit(ROW3, "shear")),
    }
    held: Runs = {"static-forces": Forces(Static(2, load_steps=2))}
    scenes = small.GUIDED, small.SLIDING, small.GUIDES, small.WHEEL, small.STRETCHED, small.TREE

    def modes(element: str) -> Run:
        return Frequencies(Static(2, element, load_steps=2), at_rest=True)

    return [
        _watch(small.LINKAGE, forces | more),
        *(_watch(scene, forces) for scene in (*scenes, small.driven_plate())),
        _watch(small.DRIVEN_ROW, forces | shear),
        _watch(small.RIGID_ROW, {"forces": Forces(explicit(small.RIGID_MESH, small.RIGID, dt=1e-3))}),
        _watch(small.LOOP, {"quintic-forces": Forces(implicit(1, "quintic"))}),
        _watch(small.ANGLED_STILL, each("static-forces", lambda e: Forces(Static(2, e, load_steps=2)))),
        _watch(small.HELD, held | {"modes": modes("cable")}),
        _watch(small.STICK, each("modes", modes, (*ELEMENTS, "quintic"))),
        _watch(small.BLADE, {"modes": Frequencies(Static(4), spin=30.0)}),
        _watch(small.held_up(60.0), {"modes": Frequencies(Static(4), at_rest=True)}),
        _watch(small.STARTED, {"velocities": StartVelocities()}),
    ]
