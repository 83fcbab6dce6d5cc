"""How the base scenes are run: every element and integrator, by the solvers that have them.

Meshes and steps are coarse: the code is tested, not its accuracy, and it should not take long.
"""

from anctmm.discretise.discretisation import Discretisation
from studies import scenes
from studies.regression.scenes import TIGHT, Forces, Motion, Run, Static, Watch
from studies.scenes import END_MOMENT, TIP_FORCES, BaseScene

FOUR_BAR_MESH = {"crank": 2, "coupler": 8, "follower": 2}
OURS = ("anctmm", "global-dae")
ALL = (*OURS, "global-dae-dense")
CABLE, ROD = (*OURS, "exudyn-cable"), (*OURS, "exudyn-reissner")


def base_watches() -> tuple[Watch, ...]:
    """Base scenes × elements × integrators × solvers."""
    statics = [*map(scenes.cantilever_tip_force, TIP_FORCES), scenes.cantilever_end_moment(END_MOMENT)]
    return (
        *_mechanism(scenes.four_bar()),
        *_mechanism(scenes.four_bar_moment()),
        *_fall(scenes.cantilever_fall()),
        *(watch for base in statics for watch in _rest(base)),
    )


def _watch(base: BaseScene, runs: dict[str, Run], solvers: tuple[str, ...]) -> Watch:
    return Watch(base.scene, base.probes, runs, solvers)


def _mechanism(base: BaseScene) -> tuple[Watch, ...]:
    """Explicit runs are cut short: the dense solver takes 60 µs a step. Exudyn has no explicit joints."""
    mesh, end = FOUR_BAR_MESH, base.duration

    def explicit(element: str) -> Motion:
        return Discretisation(mesh, element, integrator="zhai", dt=2.5e-5, t_end=0.6, output_dt=0.05)

    def implicit(element: str) -> Motion:
        return Discretisation(mesh, element, dt=5e-3, t_end=end, output_dt=end / 12, newton_tolerance=TIGHT)

    return (
        _watch(base, {"cable-zhai": explicit("cable")}, ALL),
        _watch(base, {"shear-zhai": explicit("shear")}, OURS),
        _watch(base, {"cable-implicit": implicit("cable")}, CABLE),
        _watch(base, {"shear-implicit": implicit("shear")}, (*ALL, "exudyn-reissner")),
        _watch(base, {"cable-forces": Forces(implicit("cable"))}, ("anctmm",)),
    )


def _fall(base: BaseScene) -> tuple[Watch, ...]:
    """The thickness mode of the thin section needs small explicit steps with shear elements: a shorter run."""

    def explicit(element: str, dt: float, t_end: float) -> Motion:
        return Discretisation(8, element, integrator="zhai", dt=dt, t_end=t_end, output_dt=t_end / 10)

    def implicit(element: str, quadrature: str = "full") -> Motion:
        return Discretisation(
            8, element, quadrature, dt=2e-3, t_end=1.0, output_dt=0.1, newton_tolerance=TIGHT
        )

    controlled = Discretisation(
        8, integrator="generalized-alpha", tolerance=1e-4, t_end=0.4, output_dt=0.05, newton_tolerance=TIGHT
    )
    rules: dict[str, Run] = {
        f"cable-{rule}-implicit": implicit("cable", rule) for rule in ("reduced", "lobatto")
    }
    return (
        _watch(base, {"cable-zhai": explicit("cable", 5e-5, 1.0)}, ALL),
        _watch(base, {"shear-zhai": explicit("shear", 2.5e-6, 0.2)}, OURS),
        _watch(base, {"cable-implicit": implicit("cable"), **rules}, CABLE),
        _watch(base, {"shear-implicit": implicit("shear")}, (*ALL, "exudyn-reissner")),
        _watch(base, {"cable-adaptive": controlled}, ("anctmm",)),
    )


def _rest(base: BaseScene) -> tuple[Watch, ...]:
    return (
        _watch(base, {"cable-static": Static(8)}, CABLE),
        _watch(base, {"shear-static": Static(8, "shear")}, ROD),
    )
