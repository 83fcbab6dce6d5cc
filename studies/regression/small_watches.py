"""How the small scenes are run: every element, integrator and option that the base scenes leave at its default."""

from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.scene import Beam, Probe, Scene
from studies.regression import small_mechanisms as mechanisms
from studies.regression import small_scenes as small
from studies.regression.readable import OF_CHAINS, OF_TREES
from studies.regression.scenes import ARC_LENGTH, FromRest, Run, Static, Watch, base_watches

TIGHT = 1e-12
ELEMENTS = "cable", "shear"
#: Steps just below and just above the largest stable one of each scene, s: elements, ψ = φ, and that step (those of
#: the global DAE, see `tests/of_studies/checks/test_small_scenes.py`).
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
    """What `anctmm check` watches: base scenes and small ones."""
    return (*base_watches(), *small_watches())


def small_watches() -> tuple[Watch, ...]:
    """Every small scene with its runs."""
    return (
        *_explicit(),
        *_implicit(),
        *_error_controlled(),
        *_static(),
        *_readable(),
        *_limits(),
        *_failing(),
        *_mechanisms(),
        *_high_order(),
    )


def explicit(mesh: Any, element: Any, steps: int = 60, dt: float = 4e-4, **options: Any) -> Run:
    """Explicit steps, ten between two outputs."""
    return Discretisation(
        mesh, element, integrator="zhai", dt=dt, t_end=steps * dt, output_dt=10 * dt, **options
    )


def implicit(mesh: Any, element: Any, steps: int = 25, dt: float = 2e-3, **options: Any) -> Run:
    """Implicit steps, five between two outputs."""
    options = {"newton_tolerance": TIGHT, **options}
    return Discretisation(mesh, element, dt=dt, t_end=steps * dt, output_dt=5 * dt, **options)


def _both(scene: Scene, mesh: Any = 2, explicitly: tuple[str, ...] = ELEMENTS) -> Watch:
    """Both elements implicitly, some explicitly."""
    runs = {f"{e}-zhai": explicit(mesh, e) for e in explicitly}
    runs |= {f"{e}-implicit": implicit(mesh, e) for e in ELEMENTS}
    return _watch(scene, runs)


def _watch(
    scene: Scene, runs: dict[str, Run], ends: str = "ok", solvers: tuple[str, ...] = ("anctmm",)
) -> Watch:
    probes: list[Probe] = [(b.name, fraction) for b in scene.beams for fraction in (0.0, 0.3, 1.0)]
    for b in scene.bodies:
        if not isinstance(b, Beam):
            probes += [f"{b.name}.{key}" for key in b.keys]
    return Watch(scene, tuple(probes), runs, solvers, ends)


def _explicit() -> tuple[Watch, ...]:
    mixed = {"zhai": explicit(small.MIXED_MESH, small.MIXED, dt=2e-4)}
    rules = {f"cable-{rule}-zhai": explicit(2, "cable", quadrature=rule) for rule in ("reduced", "lobatto")}
    other = {
        "cable-zhai-0.7": explicit(2, "cable", psi=0.7, phi=0.7),
        "shear-zhai-0.7": explicit(2, "shear", psi=0.7, phi=0.7),
        "cable-zhai-0.6-0.4": explicit(2, "cable", psi=0.6, phi=0.4, check_stability=False),
    }
    long = {f"{e}-zhai": explicit({"strip": 70, "tail": 3}, e, steps=20, dt=1e-4) for e in ELEMENTS}
    rigid = {"cable-zhai": explicit(small.RIGID_MESH, small.RIGID, dt=1e-3)}
    return (
        _both(small.driven_row(), {"one": 2, "two": 3, "beside": 1}),
        _both(small.driven_tail()),
        _both(small.straight_row(), {"one": 2, "two": 1, "three": 2}),
        # welds at an angle: of one element only, for others the kernels would have to be compiled, too
        _both(small.driven_end(), explicitly=("cable",)),
        _both(small.tree(), explicitly=("cable",)),
        _both(small.loop(), explicitly=("cable",)),
        _both(small.angled_row(), {"one": 1, "two": 3, "three": 2, "four": 1}, explicitly=("cable",)),
        _watch(small.options_row(), {**rules, **other}),
        _watch(small.mixed_row(), mixed),
        _watch(small.long_strip(), long),
        _watch(small.rigid_row(), rigid),
        _watch(small.rigid_pendulum(), {"zhai": explicit(1, "rigid", dt=1e-3)}),
    )


def _implicit() -> tuple[Watch, ...]:
    other = {
        "cable-radius-0.4": implicit(2, "cable", spectral_radius=0.4),
        "shear-radius-0": implicit(2, "shear", spectral_radius=0.0),
        "cable-radius-1": implicit(2, "cable", spectral_radius=1.0),
        "cable-reduced": implicit(2, "cable", quadrature="reduced"),
        "cable-loose": implicit(2, "cable", newton_tolerance=1e-5),
        "shear-loose": implicit(2, "shear", newton_tolerance=1e-5),
    }
    long = {f"{e}-implicit": implicit({"strip": 66, "tail": 3}, e, steps=3) for e in ELEMENTS}
    return (
        _watch(small.options_row(), other),
        _watch(small.mixed_row(), {"implicit": implicit(small.MIXED_MESH, small.MIXED)}),
        _watch(small.long_strip(), long),
        _watch(
            small.rolled(),
            {f"{e}-implicit": implicit(mesh, e, steps=10) for e, mesh in (("cable", 8), ("shear", 4))},
        ),
    )


def _high_order() -> tuple[Watch, ...]:
    """Quintic cables, and steps of fourth order: short ones, so that a method of another order finds the same."""

    def short(element: str, dt: float) -> Run:
        return implicit(1, element, steps=60, dt=dt, integrator="esdirk")

    quintic = {"quintic-zhai": explicit(1, "quintic", dt=1e-4), "quintic-implicit": implicit(1, "quintic")}
    return (
        _watch(small.loop(), quintic),
        _watch(
            small.freed(),
            {"quintic-implicit": implicit(1, "quintic"), "cable-esdirk": short("cable", 2.5e-4)},
        ),
        _watch(small.driven_row(), {"quintic-esdirk": short("quintic", 1.25e-4)}),
    )


def _error_controlled() -> tuple[Watch, ...]:
    def run(
        element: Any, tolerance: float = 1e-3, t_end: float = 0.1, integrator: str = "generalized-alpha"
    ) -> Run:
        return Discretisation(
            2,
            element,
            integrator=integrator,
            tolerance=tolerance,
            t_end=t_end,
            output_dt=t_end / 5,
            newton_tolerance=TIGHT,
        )

    return (
        _watch(
            small.stick(),
            {"cable-adaptive": run("cable"), "cable-esdirk-adaptive": run("cable", integrator="esdirk")},
        ),
        _watch(small.pulse(), {"cable-adaptive": run("cable")}),
        _watch(small.driven_end(), {"cable-adaptive": run("cable", 1e-2, 0.05)}),
    )


def _static() -> tuple[Watch, ...]:
    def runs(mesh: Any = 2, **options: Any) -> dict[str, Run]:
        return {f"{e}-static": Static(mesh, e, load_steps=2, **options) for e in ELEMENTS}

    rules: dict[str, Run] = {
        f"cable-{rule}-static": Static(3, "cable", rule, load_steps=2) for rule in ("reduced", "lobatto")
    }
    return (
        _watch(small.stick(), {**runs(3), **rules}),
        _watch(small.angled_still(), runs({"one": 1, "two": 3, "three": 2, "four": 1})),
        _watch(small.standing(), {"mixed-static": Static(small.MIXED_MESH, small.MIXED, load_steps=2)}),
        _watch(small.long_stick(), runs(66)),
    )


def _readable() -> tuple[Watch, ...]:
    """Few steps: a readable one takes a millisecond."""
    runs = {f"{e}-readable": explicit(2, e, steps=20) for e in ELEMENTS}
    angled = {"cable-readable": explicit(2, "cable", steps=20)}
    solvers = ("anctmm", *OF_CHAINS)
    return (
        _watch(small.driven_chain(), runs, solvers=solvers),
        _watch(small.driven_tail(), runs, solvers=solvers),
        _watch(small.driven_end(), angled, solvers=solvers),
        _watch(small.held_chain(), angled, solvers=solvers),
        _watch(small.driven_chain(damping=2e-4), runs, solvers=tuple(OF_CHAINS)),
        _watch(small.tree(), angled, solvers=("anctmm", *OF_TREES)),
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
    """What no beam does, found by each of the checks that look for it."""
    unchecked: dict[str, Any] = {"integrator": "zhai", "check_stability": False}
    controlled: dict[str, Any] = {"integrator": "generalized-alpha", "tolerance": 1e-2}
    row, line, pulled, pushed = small.options_row(), small.straight_row(), small.pulled(), small.pushed()
    crushed = small.crushed()
    runs: list[tuple[Scene, str, Run]] = [
        (row, "not-finite", Discretisation(2, dt=4e-3, t_end=4.0, output_dt=2.0, **unchecked)),
        (row, "too-large", Discretisation(2, dt=4e-3, t_end=0.4, output_dt=0.02, **unchecked)),
        (
            line,
            "energy",
            Discretisation(3, dt=1.57e-3, t_end=1.57e-3 * 90, output_dt=1.57e-3 * 5, **unchecked),
        ),
        (pulled, "cable-stretched", implicit(2, "cable", steps=5)),
        (pulled, "stretched-adaptive", Discretisation(2, t_end=0.01, output_dt=0.002, **controlled)),
        (pulled, "shear-stalled", implicit(2, "shear", steps=5)),
        (pushed, "cable-inside-out", implicit(2, "cable", steps=10, dt=2e-2)),
        (crushed, "shear-inside-out", implicit(2, "shear", steps=20)),
        (crushed, "shear-inside-out-zhai", explicit(2, "shear", check_stability=False)),
        (small.wound(), "static-inside-out", Static(1, "cable", load_steps=8)),
        (crushed, "static-crushed", Static(2, "shear")),
        (small.bare(), "static-free", Static(2, "cable")),
    ]
    long_steps = {
        "made-energy": (implicit(4, "cable", steps=10, dt=0.01), "diverged"),
        "some-energy": (implicit(4, "cable", steps=8, dt=0.007), "inaccurate"),
    }
    return (
        *(_watch(scene, {name: run}, "diverged") for scene, name, run in runs),
        *(_watch(small.spun(), {name: run}, ends) for name, (run, ends) in long_steps.items()),
        _watch(small.column(), {"unstable": Static(4, "cable")}, "unstable"),
        _watch(small.locked(), {"locked": explicit(1, "rigid", dt=1e-3)}, "failed"),
    )


def _mechanisms() -> tuple[Watch, ...]:
    """Bodies, guides, connectors and loads of mechanisms, all of cables, so that less is compiled."""
    linkage, guided = mechanisms.linkage(), mechanisms.guided()
    moving = {"zhai": explicit(2, "cable"), "implicit": implicit(2, "cable")}
    careful = Discretisation(
        2, integrator="generalized-alpha", tolerance=1e-2, t_end=0.02, output_dt=0.005, newton_tolerance=TIGHT
    )
    released = FromRest(2, dt=1e-3, t_end=0.02, output_dt=0.005, newton_tolerance=TIGHT)
    return (
        _watch(linkage, {**moving, "adaptive": careful}),
        _watch(guided, moving),
        _watch(mechanisms.sliding(), {**moving, "static": Static(2, load_steps=2)}),
        _watch(mechanisms.guides(), moving),
        _watch(mechanisms.wheel(), moving),
        _watch(mechanisms.parallel(), moving),
        _watch(mechanisms.stretched(), {**moving, "static": Static(2, load_steps=2)}),
        _watch(mechanisms.held(), {"static": Static(2, load_steps=2), "from-rest": released}),
        _watch(mechanisms.lattice(), {"implicit": implicit(1, "cable")}),
        _watch(mechanisms.slack(), {"static": Static(1, load_steps=1)}),
        _watch(mechanisms.truss(), {"path": Static(1, load_steps=8, path=ARC_LENGTH)}),
    )
