"""How the small scenes are run: every element, integrator and option that the base scenes leave at its default."""

from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.scene import Beam, Probe, Scene
from studies.regression import small_mechanisms as mechanisms
from studies.regression import small_scenes as small
from studies.regression.base_watches import base_watches
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
CHAIN_SOLVERS = ("transfer-plain", "transfer-riccati")
#: Meshes by the elements of each beam.
ROW3 = {"one": 2, "two": 3, "beside": 1}
ROW4 = {"one": 1, "two": 3, "three": 2, "four": 1}
#: Steps just below and just above the largest stable one of each scene, s: elements, ψ = φ, and that step (those of
#: the global DAE).
LIMITS: dict[str, tuple[Scene, Any, Any, float, float]] = {
    "cable": (small.bare(), 1, "cable", 0.5, 6.3036110e-3),
    "shear": (small.bare(), 1, "shear", 0.5, 8.3745481e-4),
    "damped-cable": (small.bare_damped(), 1, small.BARE_CABLE, 0.5, 5.9162894e-3),
    "damped-shear": (small.bare_damped(), 1, small.BARE_SHEAR, 0.5, 5.2807896e-4),
    "joined-cable": (small.angled_row(), 2, "cable", 0.6, 2.7966353e-3),
    "joined-shear": (small.driven_row(), 2, "shear", 0.7, 5.9354273e-4),
    "rigid": (small.rigid_row(), small.RIGID_MESH, small.RIGID, 0.5, 3.8416057e-3),
}
NEAR = 1e-3


def all_watches() -> tuple[Watch, ...]:
    """All that `anctmm check` watches: base scenes and small ones."""
    return (*base_watches(), *small_watches())


def small_watches() -> tuple[Watch, ...]:
    """Every small scene with its runs."""
    return (
        *_explicit(),
        *_implicit(),
        *_high_order(),
        *_error_controlled(),
        *_static(),
        *_readable(),
        *_limits(),
        *_failing(),
        *_mechanisms(),
        *_read_besides(),
    )


def explicit(mesh: Any, element: Any, steps: int = 60, dt: float = 4e-4, **options: Any) -> Motion:
    """Explicit steps, ten between two outputs."""
    return Discretisation(
        mesh, element, integrator="zhai", dt=dt, t_end=steps * dt, output_dt=10 * dt, **options
    )


def implicit(mesh: Any, element: Any, steps: int = 25, dt: float = 2e-3, **options: Any) -> Motion:
    """Implicit steps, five between two outputs."""
    options = {"newton_tolerance": TIGHT, **options}
    return Discretisation(mesh, element, dt=dt, t_end=steps * dt, output_dt=5 * dt, **options)


def controlled(element: Any, tolerance: float, t_end: float, method: str = "generalized-alpha") -> Motion:
    """Steps by a tolerance."""
    return Discretisation(
        2, element, integrator=method, tolerance=tolerance, t_end=t_end, output_dt=t_end / 5, newton_tolerance=TIGHT
    )  # fmt: skip


def _watch(
    scene: Scene, runs: dict[str, Run], ends: str = "ok", solvers: tuple[str, ...] = ("anctmm",)
) -> Watch:
    probes: list[Probe] = [(b.name, fraction) for b in scene.beams for fraction in (0.0, 0.3, 1.0)]
    probes += [f"{b.name}.{key}" for b in scene.bodies if not isinstance(b, Beam) for key in b.keys]
    return Watch(scene, tuple(probes), runs, solvers, ends)


def _both(scene: Scene, mesh: Any = 2, explicitly: tuple[str, ...] = ELEMENTS) -> Watch:
    """Both elements implicitly, some explicitly."""
    runs: dict[str, Run] = {f"{e}-zhai": explicit(mesh, e) for e in explicitly}
    return _watch(scene, runs | {f"{e}-implicit": implicit(mesh, e) for e in ELEMENTS})


def _explicit() -> tuple[Watch, ...]:
    rules = {f"cable-{rule}-zhai": explicit(2, "cable", quadrature=rule) for rule in ("reduced", "lobatto")}
    options: dict[str, Run] = {
        **rules,
        "cable-zhai-0.7": explicit(2, "cable", psi=0.7, phi=0.7),
        "shear-zhai-0.7": explicit(2, "shear", psi=0.7, phi=0.7),
        "cable-zhai-0.6-0.4": explicit(2, "cable", psi=0.6, phi=0.4, check_stability=False),
    }
    long: dict[str, Run] = {
        f"{e}-zhai": explicit({"strip": 70, "tail": 3}, e, steps=20, dt=1e-4) for e in ELEMENTS
    }
    return (
        _both(small.driven_row(), ROW3),
        _both(small.driven_tail()),
        _both(small.straight_row(), {"one": 2, "two": 1, "three": 2}),
        # welds at an angle: of one element only, for others the kernels would have to be compiled, too
        _both(small.driven_end(), explicitly=("cable",)),
        _both(small.tree(), explicitly=("cable",)),
        _both(small.loop(), explicitly=("cable",)),
        _both(small.angled_row(), ROW4, explicitly=("cable",)),
        _watch(small.options_row(), options),
        _watch(small.mixed_row(), {"zhai": explicit(small.MIXED_MESH, small.MIXED, dt=2e-4)}),
        _watch(small.long_strip(), long),
        _watch(small.rigid_row(), {"cable-zhai": explicit(small.RIGID_MESH, small.RIGID, dt=1e-3)}),
        _watch(small.rigid_pendulum(), {"zhai": explicit(1, "rigid", dt=1e-3)}),
    )


def _implicit() -> tuple[Watch, ...]:
    options: dict[str, Run] = {
        "cable-radius-0.4": implicit(2, "cable", spectral_radius=0.4),
        "shear-radius-0": implicit(2, "shear", spectral_radius=0.0),
        "cable-radius-1": implicit(2, "cable", spectral_radius=1.0),
        "cable-reduced": implicit(2, "cable", quadrature="reduced"),
        "cable-loose": implicit(2, "cable", newton_tolerance=1e-5),
        "shear-loose": implicit(2, "shear", newton_tolerance=1e-5),
    }
    long: dict[str, Run] = {f"{e}-implicit": implicit({"strip": 66, "tail": 3}, e, steps=3) for e in ELEMENTS}
    rolled: dict[str, Run] = {
        f"{e}-implicit": implicit(mesh, e, steps=10) for e, mesh in (("cable", 8), ("shear", 4))
    }
    return (
        _watch(small.options_row(), options),
        _watch(small.mixed_row(), {"implicit": implicit(small.MIXED_MESH, small.MIXED)}),
        _watch(small.long_strip(), long),
        _watch(small.rolled(), rolled),
    )


def _high_order() -> tuple[Watch, ...]:
    """Quintic cables, and steps of fourth order: short ones, so that a method of another order finds the same."""

    def short(element: str, dt: float) -> Motion:
        return implicit(1, element, steps=60, dt=dt, integrator="esdirk")

    implicitly: dict[str, Run] = {"quintic-implicit": implicit(1, "quintic")}
    return (
        _watch(small.loop(), {"quintic-zhai": explicit(1, "quintic", dt=1e-4), **implicitly}),
        _watch(small.freed(), {**implicitly, "cable-esdirk": short("cable", 2.5e-4)}),
        _watch(small.driven_row(), {"quintic-esdirk": short("quintic", 1.25e-4)}),
    )


def _error_controlled() -> tuple[Watch, ...]:
    cable, esdirk = controlled("cable", 1e-3, 0.1), controlled("cable", 1e-3, 0.1, "esdirk")
    return (
        _watch(small.stick(), {"cable-adaptive": cable, "cable-esdirk-adaptive": esdirk}),
        _watch(small.pulse(), {"cable-adaptive": cable, "cable-esdirk-adaptive": esdirk}),
        _watch(small.driven_end(), {"cable-adaptive": controlled("cable", 1e-2, 0.05)}),
    )


def _static() -> tuple[Watch, ...]:
    def runs(mesh: Any) -> dict[str, Run]:
        return {f"{e}-static": Static(mesh, e, load_steps=2) for e in ELEMENTS}

    rules: dict[str, Run] = {
        f"cable-{rule}-static": Static(3, "cable", rule, load_steps=2) for rule in ("reduced", "lobatto")
    }
    return (
        _watch(small.stick(), {**runs(3), **rules}),
        _watch(small.angled_still(), runs(ROW4)),
        _watch(small.standing(), {"mixed-static": Static(small.MIXED_MESH, small.MIXED, load_steps=2)}),
        _watch(small.long_stick(), runs(66)),
        _watch(mechanisms.held_up(60.0), {"static": Static(4)}),
        _watch(mechanisms.held_up(0.01), {"unstable": Static(4)}, "unstable"),
    )


def _readable() -> tuple[Watch, ...]:
    """Few steps: a readable one takes a millisecond."""
    runs: dict[str, Run] = {f"{e}-readable": explicit(2, e, steps=20) for e in ELEMENTS}
    angled = {"cable-readable": runs["cable-readable"]}
    solvers = ("anctmm", *CHAIN_SOLVERS)
    return (
        _watch(small.driven_chain(), runs, solvers=solvers),
        _watch(small.driven_tail(), runs, solvers=solvers),
        _watch(small.driven_end(), angled, solvers=solvers),
        _watch(small.held_chain(), angled, solvers=solvers),
        _watch(small.driven_chain(damping=2e-4), runs, solvers=CHAIN_SOLVERS),
    )


def _limits() -> tuple[Watch, ...]:
    watches = []
    for name, (scene, mesh, element, psi, limit) in LIMITS.items():
        for side, sign, ends in (("below", -1.0, "ok"), ("above", 1.0, "refused")):
            dt = float(f"{limit * (1.0 + sign * NEAR):.5g}")
            run = Discretisation(mesh, element, integrator="zhai", dt=dt, t_end=4.0 * dt, psi=psi, phi=psi)
            watches.append(_watch(scene, {f"{side}-limit-{name}": run}, ends))
    unequal = explicit(2, "cable", psi=0.6, phi=0.5)
    return (*watches, _watch(small.options_row(), {"refused-psi-phi": unequal}, "refused"))


def _failing() -> tuple[Watch, ...]:
    """Runs that no beam survives, found by each of the checks that look for it."""

    def unchecked(mesh: int, dt: float, t_end: float, output_dt: float) -> Motion:
        return Discretisation(
            mesh, integrator="zhai", dt=dt, t_end=t_end, output_dt=output_dt, check_stability=False
        )

    adaptive = Discretisation(2, integrator="generalized-alpha", tolerance=1e-2, t_end=0.01, output_dt=0.002)
    row, pulled, crushed = small.options_row(), small.pulled(), small.crushed()
    diverging: list[tuple[Scene, str, Run]] = [
        (row, "not-finite", unchecked(2, 4e-3, 4.0, 2.0)),
        (row, "too-large", unchecked(2, 4e-3, 0.4, 0.02)),
        (small.straight_row(), "energy", unchecked(3, 1.57e-3, 1.57e-3 * 90, 1.57e-3 * 5)),
        (pulled, "cable-stretched", implicit(2, "cable", steps=5)),
        (pulled, "stretched-adaptive", adaptive),
        (pulled, "shear-stalled", implicit(2, "shear", steps=5)),
        (small.pushed(), "cable-inside-out", implicit(2, "cable", steps=10, dt=2e-2)),
        (crushed, "shear-inside-out", implicit(2, "shear", steps=20)),
        (crushed, "shear-inside-out-zhai", explicit(2, "shear", check_stability=False)),
        (small.wound(), "static-inside-out", Static(1, "cable", load_steps=8)),
        (crushed, "static-crushed", Static(2, "shear")),
        (small.bare(), "static-free", Static(2, "cable")),
    ]
    return (
        *(_watch(scene, {name: run}, "diverged") for scene, name, run in diverging),
        _watch(small.spun(), {"made-energy": implicit(4, "cable", steps=10, dt=0.01)}, "diverged"),
        _watch(small.spun(), {"some-energy": implicit(4, "cable", steps=8, dt=0.007)}, "inaccurate"),
        _watch(small.column(), {"unstable": Static(4, "cable")}, "unstable"),
        _watch(small.locked(), {"locked": explicit(1, "rigid", dt=1e-3)}, "failed"),
    )


def _mechanisms() -> tuple[Watch, ...]:
    """Bodies, guides, connectors and loads of mechanisms, all of cables, so that less is compiled."""
    moving: dict[str, Run] = {"zhai": explicit(2, "cable"), "implicit": implicit(2, "cable")}
    static: dict[str, Run] = {"static": Static(2, load_steps=2)}
    esdirk: dict[str, Run] = {"esdirk": implicit(2, "cable", steps=10, integrator="esdirk")}
    careful = Discretisation(
        2, integrator="generalized-alpha", tolerance=1e-2, t_end=0.02, output_dt=0.005, newton_tolerance=TIGHT
    )
    released = FromRest(2, dt=1e-3, t_end=0.02, output_dt=0.005, newton_tolerance=TIGHT)
    return (
        _watch(mechanisms.linkage(), {**moving, **esdirk, "adaptive": careful}),
        _watch(mechanisms.guided(), moving),
        _watch(mechanisms.sliding(), {**moving, **static}),
        _watch(mechanisms.guides(), moving),
        _watch(mechanisms.wheel(), moving),
        _watch(mechanisms.parallel(), moving),
        _watch(mechanisms.stretched(), {**moving, **static}),
        _watch(mechanisms.driven_plate(), {**moving, **esdirk}),
        _watch(mechanisms.held(), {**static, "from-rest": released}),
        _watch(mechanisms.lattice(), {"implicit": implicit(1, "cable")}),
        _watch(mechanisms.slack(), {"static": Static(1, load_steps=1)}),
        _watch(mechanisms.truss(), {"path": Static(1, load_steps=8, path=ARC_LENGTH)}),
    )


def _read_besides() -> tuple[Watch, ...]:
    """Forces, frequencies, consistent velocities and comparisons."""
    moving: dict[str, Run] = {"forces": Forces(implicit(2, "cable"))}
    both: dict[str, Run] = {"zhai-forces": Forces(explicit(2, "cable")), **moving}
    static: dict[str, Run] = {f"{e}-static-forces": Forces(Static(2, e, load_steps=2)) for e in ELEMENTS}
    modes: dict[str, Run] = {
        f"{e}-modes": Frequencies(Static(2, e, load_steps=2), at_rest=True) for e in (*ELEMENTS, "quintic")
    }
    return (
        _watch(
            mechanisms.linkage(),
            {**both, "esdirk-forces": Forces(implicit(2, "cable", steps=10, integrator="esdirk"))},
        ),
        *(
            _watch(scene, moving)
            for scene in (
                mechanisms.guided(),
                mechanisms.sliding(),
                mechanisms.guides(),
                mechanisms.wheel(),
                mechanisms.driven_plate(),
                mechanisms.stretched(),
                small.driven_row(),
                small.tree(),
            )
        ),
        _watch(small.rigid_row(), {"forces": Forces(explicit(small.RIGID_MESH, small.RIGID, dt=1e-3))}),
        _watch(small.loop(), {"quintic-forces": Forces(implicit(1, "quintic"))}),
        _watch(small.driven_row(), {"shear-forces": Forces(implicit(2, "shear"))}),
        _watch(small.angled_still(), static),
        _watch(
            mechanisms.held(),
            {"static-forces": Forces(Static(2, load_steps=2)), "modes": modes["cable-modes"]},
        ),
        _watch(small.stick(), modes),
        _watch(mechanisms.blade(), {"modes": Frequencies(Static(4), spin=30.0)}),
        _watch(mechanisms.held_up(60.0), {"modes": Frequencies(Static(4), at_rest=True)}),
        _watch(mechanisms.started(), {"velocities": StartVelocities()}),
        _watch(
            small.driven_row(),
            {"compared": Compared(implicit(ROW3, "cable"), implicit(ROW3, "shear"))},
        ),
    )
