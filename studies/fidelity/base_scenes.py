"""Kinds of element by body on the built-in scenes: how far each choice is from the richest, its cost, and rules."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf, log10, pi, sqrt
from typing import Any

import numba
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from anctmm.discretise.chain import Chain
from anctmm.integrators.zhai import advance, integrate
from anctmm.jit.compiler.addresses import named_in
from anctmm.jit.compiling import OPTIONS
from anctmm.model.scene import Beam
from anctmm.results.metrics import compare
from anctmm.validation import FrozenMapping
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Outcome, Reference
from studies.engine.running.rows import row
from studies.engine.running.trial import Mesh, Trial, mesh_label
from studies.engine.study import Options, Result, check_taken
from studies.engine.tables import ACCURACY, Table, cpu_time
from studies.fidelity.steps import MARGIN, stable_step, step_under
from studies.report.plots import PALETTE, Picture, floor, log_ticks, picture
from studies.scenes import BaseScene, cantilever_fall, four_bar

#: Kinds from the richest to the poorest.
KINDS = ("shear", "cable", "rigid")
#: Target errors of a model.
TARGETS = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3)
#: Damping of the run that shows what it costs, s.
TAU = 1e-5
#: Features and the function that only they need.
FEATURES = (
    ("damping", "damping_forces"),
    ("rigid bodies", "constrain_few"),
    ("shear elements", "shear_kernel"),
)
#: What the types of an explicit kernel say of features: damping, constraints, shear elements alone or with cables.
TYPES_OF_FEATURES = ("Damping", "Rows", "UniTuple(int64 x 2)", "UniTuple(int64 x 3)")
LEFT_OUT = "shear elements, and takes short motions on coarse meshes."
#: Verdict of a rule if the measured distance cannot be distinguished from 0.
UNKNOWN = "below the reference's uncertainty"
PHYSICS = (
    "All runs are explicit (Zhai), each at 0.9 of its own stability limit, at most a thousandth of the run: its model "
    "sets the step, and so the cost.",
    "A rigid body is a thin bar: no rotary inertia of its section, as the cable.",
)


@dataclass(frozen=True)
class Setting:
    """A scene of the study.

    Parameters
    ----------
    base : BaseScene
    mesh : mapping of str to tuple of int
        Elements of each body by the kind it may be, the richest first: shear elements, of second order, need more.
    rate : float
        Of the motion that a rigid model would follow, rad/s.
    held : tuple of bool
        Whether a body is clamped at one end (else it is pinned at both).
    """

    base: BaseScene
    mesh: Mapping[str, Mesh]
    rate: float
    held: tuple[bool, ...]

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds to choose from, the richest first."""
        return tuple(self.mesh)

    def of(self, kinds: Sequence[str]) -> Mesh:
        """The mesh of a combination of kinds."""
        return tuple(self.mesh[kind][i] for i, kind in enumerate(kinds))


def settings(quick: bool) -> tuple[Setting, ...]:
    """The base scenes, on meshes of like error: 2e-4 for the four-bar's links, 4e-5 for the cantilever.

    --quick shortens them and leaves out the shear element, whose steps are small.
    """
    bar, fall = four_bar(), cantilever_fall()
    turning = 1.875 * 2.0 * pi / 2.0  # the largest rate of the quintic that turns the crank once in 2 s
    falling = sqrt(1.5 * 9.81 / 2.0)  # of a rigid bar that falls: √(3g/2L)
    if quick:
        bar, fall = replace(bar, t_end=0.4, output_dt=0.02), replace(fall, t_end=0.2, output_dt=0.02)
        return (
            Setting(bar, {"cable": (1, 2, 1), "rigid": (1, 1, 1)}, turning, (True, False, False)),
            Setting(fall, {"cable": (4,), "rigid": (1,)}, falling, (True,)),
        )
    links: dict[str, Mesh] = {"shear": (16, 64, 16), "cable": (2, 8, 2), "rigid": (1, 1, 1)}
    beams: dict[str, Mesh] = {"shear": (256,), "cable": (64,), "rigid": (1,)}
    return (
        Setting(bar, links, turning, (True, False, False)),
        Setting(fall, beams, falling, (True,)),
    )


def trials(options: Options) -> list[Trial]:
    """Runs of all kinds that the study needs, by a step that is not looked for."""
    return [
        case_of(setting, kinds, 1e-6)
        for setting in settings(options.quick)
        for kinds in product(setting.kinds, repeat=len(setting.base.scene.beams))
    ]


def run(options: Options, runner: Runner) -> Result:
    """Run the study; meshes, steps and solvers are its own."""
    check_taken(options, "fidelity")
    chosen = settings(options.quick)
    runner.prepare(trials(options))
    studied = [_study(s, runner) for s in chosen]
    frame = pd.concat([s.frame for s in studied], ignore_index=True)
    cheapest = _cheapest(frame)
    rules = pd.concat([_rules(s, found) for s, found in zip(chosen, studied, strict=True)], ignore_index=True)
    absent = _absent(chosen[-1], runner)
    tables = (
        Table("accuracy", "Every choice of kinds by body: distance to the richest model", frame, _notes()),
        cpu_time([r for s in studied for r in s.rows], PHYSICS),
        Table(
            "cheapest", "The cheapest model under a target modelling error", cheapest,
            _cheapest_notes(),
        ),
        Table("rule", "A rule of thumb beside what was measured", rules, _rule_notes()),
        Table("absent", "What a feature costs when it is absent", absent, _absent_notes()),
    )  # fmt: skip
    findings = tuple(_findings(cheapest, rules, absent))
    return Result(
        name="fidelity",
        title="Fidelity: model only what a scene requires",
        question="Which body must be modelled how finely, and what is saved where less will do?",
        findings=findings,
        assumptions=(*PHYSICS, *dict.fromkeys(a for s in chosen for a in s.base.assumptions)),
        tables=tables,
        pictures=(_picture(frame),),
        answers=findings[:1],
        left_out=LEFT_OUT if options.quick else "",
    )


@dataclass(frozen=True)
class Studied:
    """Runs of one scene."""

    rows: list[dict[str, Any]]
    frame: pd.DataFrame


def _study(setting: Setting, runner: Runner) -> Studied:
    """Every combination, measured against the richest on twice its mesh, known to that last refinement."""
    combinations = list(product(setting.kinds, repeat=len(setting.base.scene.beams)))
    limits = [stable_step(setting.base.scene, setting.of(kinds), kinds) for kinds in combinations]
    cases = [case_of(setting, kinds, limit) for kinds, limit in zip(combinations, limits, strict=True)]
    twice = tuple(2 * n for n in cases[0].mesh)
    limit = stable_step(setting.base.scene, twice, combinations[0])
    finest = replace(cases[0], mesh=twice, dt=step_under(setting.base, MARGIN * limit))
    *outcomes, best = runner.sweep([*cases, finest])
    richest, probes = best.solution, setting.base.probes
    name = f"{'/'.join(combinations[0])} {mesh_label(twice)} dt={finest.dt:.3g}"
    reference = Reference(
        name,
        lambda s: compare(s, richest, probes).error,
        compare(outcomes[0].solution, richest, probes).error,
        richest,
    )
    rows = [_row(o, reference, k) for o, k in zip(outcomes, combinations, strict=True)]
    frame = pd.DataFrame(rows).reindex(columns=list(ACCURACY)).assign(stable_dt=limits)
    return Studied(rows, frame)


def _row(outcome: Outcome, reference: Reference, kinds: Sequence[str]) -> dict[str, Any]:
    return {**row(outcome, reference), "element": "/".join(kinds)}


def case_of(setting: Setting, kinds: Sequence[str], limit: float) -> Trial:
    """The run of a combination below its stability limit."""
    names = [body.name for body in setting.base.scene.beams]
    element: Any = FrozenMapping(zip(names, kinds, strict=True))
    return Trial(
        setting.base.scene, "anctmm", setting.of(kinds), element, "full", "zhai",
        step_under(setting.base, MARGIN * limit), setting.base.duration, setting.base.interval,
        (("check_stability", False),),  # the limit is known
    )  # fmt: skip


def _cheapest(frame: pd.DataFrame) -> pd.DataFrame:
    """For each scene and target error the cheapest combination that meets it."""
    lines = []
    for scene, runs in frame.groupby("scene", sort=False):
        richest = runs.iloc[0]
        for target in TARGETS:
            good = runs[(runs["error"] <= target) & (runs["status"] == "ok")]
            line = {"scene": scene, "target_error": target, "known_to": richest["reference_error"]}
            if good.empty:
                lines.append(line | {"status": "no model on these meshes"})
                continue
            best = good.sort_values("cpu_s").iloc[0]
            lines.append(
                line
                | {k: best[k] for k in ("element", "error", "dt", "cpu_s", "build_s")}
                | {"gain": richest["cpu_s"] / best["cpu_s"], "status": "ok"}
            )
    columns = [
        "scene",
        "target_error",
        "element",
        "error",
        "known_to",
        "dt",
        "cpu_s",
        "build_s",
        "gain",
        "status",
    ]
    return pd.DataFrame(lines).reindex(columns=columns)


def lowest_frequency(body: Beam, held: bool, carried: float = 0.0) -> float:
    """First bending frequency of a body pinned at both ends, or clamped at one with a mass (kg) at the other, rad/s."""
    s, m = body.section, body.material
    mass, stiffness = m.density * s.area * body.length, m.E * s.second_moment / body.length**3
    if held:  # the stiffness at its end, and as much of its own mass as makes this exact without another
        return sqrt(3.0 * stiffness / (3.0 / 1.8751041**4 * mass + carried))
    return pi**2 * sqrt(stiffness / mass)


def _rules(setting: Setting, studied: Studied) -> pd.DataFrame:
    """Estimates of what is lost where one body alone is made poorer, beside the distances measured."""
    lines = []
    richest, bodies = setting.kinds[0], setting.base.scene.beams
    masses = [b.material.density * b.section.area * b.length for b in bodies]
    for i, (body, held) in enumerate(zip(bodies, setting.held, strict=True)):
        height = sqrt(12.0 * body.section.second_moment / body.section.area)
        carried = sum(masses) - masses[i]
        ratio = setting.rate / lowest_frequency(body, held, carried)
        bending = min(1.0, ratio**2)
        thickness = (1.0 + 2.0 * (1.0 + body.material.poisson)) * (height / body.length) ** 2
        estimates = {"rigid": bending, "cable": bending * pi**2 / 12.0 * thickness}
        for kind in setting.kinds[1:]:
            kinds = "/".join(kind if j == i else richest for j in range(len(setting.base.scene.beams)))
            found = studied.frame[studied.frame["element"] == kinds].iloc[0]
            lines.append({
                "scene": setting.base.scene.name, "body": body.name, "instead_of": richest, "kind": kind,
                "slenderness": body.length / height, "frequency_ratio": ratio, "estimate": estimates[kind],
                "error": found["error"], "reference_error": found["reference_error"],
                "verdict": _verdict(estimates[kind], found["error"], found["reference_error"]),
            })  # fmt: skip
    return pd.DataFrame(lines)


def _verdict(estimate: float, error: float, uncertainty: float) -> str:
    """Whether a rule's estimate is of the size of what was measured, as far as that is known."""
    if error <= 2.0 * uncertainty:
        return UNKNOWN if estimate <= 3.0 * uncertainty else "pessimistic"
    off = abs(log10(estimate / error))
    return "agrees within 3" if off <= log10(3.0) else "agrees within 10" if off <= 1.0 else "misleads"


def _absent(setting: Setting, runner: Runner) -> pd.DataFrame:
    """A plain run beside the same with a feature: compiled functions, and CPU time."""
    kinds = ("cable",) * len(setting.base.scene.beams)
    bodies = (replace(b, material=replace(b.material, damping=TAU)) for b in setting.base.scene.beams)
    damped = replace(setting.base.scene, bodies=tuple(bodies))
    present = replace(case_of(setting, kinds, stable_step(damped, setting.of(kinds), kinds)), scene=damped)
    plain = replace(present, scene=setting.base.scene)
    with_damping, without = runner.sweep([present, plain])
    key = runner.key(plain)
    seen = runner.remember(key and f"functions of a plain run|{key}", lambda: compiled_functions(plain))
    lines = [
        {
            "feature": feature, "function": function, "in_a_plain_run": seen[function],
            "common_function_found": seen["strain_energy"], "cpu_s_absent": _cpu(without),
            "cpu_s_present": _cpu(with_damping) if feature == "damping" else float("nan"),
            "status": str(without.solution.status),
        }
        for feature, function in FEATURES
    ]  # fmt: skip
    return pd.DataFrame(lines)


def _cpu(outcome: Outcome) -> float:
    return float(np.median([c.cpu_s for c in outcome.costs])) if outcome.costs else float("nan")


def compiled_functions(case: Trial) -> dict[str, bool]:
    """Whether functions that only a feature needs are in the code compiled for a run without any.

    The kernel of the steps, and those that it calls, are compiled anew: code from the cache cannot be looked into.
    `strain_energy`, which every run needs, shows that functions can be found there by their names.

    Parameters
    ----------
    case : Trial
        Of a scene of cables without damping.
    """
    integrate(Chain(case.scene, case.run()))
    plain = next(types for types in advance.signatures if not any(f in str(types) for f in TYPES_OF_FEATURES))
    code = _compiled_anew(advance.py_func, plain)
    return {name: name in code for name in ("strain_energy", *(function for _, function in FEATURES))}


def _compiled_anew(function: Callable[..., Any], types: tuple[Any, ...]) -> str:
    """LLVM's text of a kernel, and of the separate kernels that it calls."""
    anew = numba.njit(function, **OPTIONS)
    anew.compile(types)
    code = str(anew.inspect_llvm(types))
    called = named_in(code)
    return "\n".join([code, *(_compiled_anew(one.kernel.py_func, one.types) for one in called)])


def _notes() -> tuple[str, ...]:
    return (
        "element: kinds of the bodies in the scene's order; a scene's first row is its richest model. Each kind is on "
        "the mesh it needs: shear elements, of second order, on a finer one.",
        "error: over the probes, the largest of RMS in time of |u − u_ref| / max in time of |u_ref|; the reference is "
        "the richest model on twice its mesh. It holds all: model, mesh and step.",
        "reference_error: what that last doubling changed (the error of the first row). A third of it is left, so "
        "distances below are not told from 0.",
        "stable_dt: 2/ω_max of the linearised scene, s.",
    )


def _cheapest_notes() -> tuple[str, ...]:
    return (
        "known_to: what the last doubling of the richest model's mesh changed.",
        "gain: CPU time of the richest model over that of the cheapest, each on its mesh and at its own step.",
    )


def _rule_notes() -> tuple[str, ...]:
    return (
        "One body alone is made poorer, the others stay as rich as can be; error is what that changes, measured.",
        "frequency_ratio: Ω/ω₁, Ω the largest rate of the motion and ω₁ the body's first bending frequency: pinned at "
        "both ends, or clamped at one and carrying the mass of all other bodies at the other.",
        "estimate, rigid: (Ω/ω₁)², at most 1: the elastic deflection against the path, so the part of bending in it.",
        "estimate, cable: of that part, what rotary inertia and shear take in a first mode between pins (Timoshenko), "
        "π²/12 (1 + 2(1 + ν)) (h/L)², h = √(12 I/A), L/h the slenderness.",
        "verdict: within which factor they agree, or that one cannot tell.",
    )


def _absent_notes() -> tuple[str, ...]:
    return (
        "function: what only this feature calls. in_a_plain_run: whether it is in the code compiled for a run of "
        "cables without damping; what is not there costs nothing.",
        f"cpu_s_present: the same run with the feature (damping τ = {TAU:g} s), at the same step.",
    )


def _findings(cheapest: pd.DataFrame, rules: pd.DataFrame, absent: pd.DataFrame) -> Iterator[str]:
    for scene, lines in cheapest.groupby("scene", sort=False):
        found = lines[lines["status"] == "ok"].drop_duplicates("element", keep="last")
        said = "; ".join(
            f"down to {r['target_error']:g} {r['element']} ({_gain(r['gain'])}, off by {r['error']:.2g})"
            for r in found.to_dict("records")
        )
        yield f"{scene}, cheapest kinds under a target modelling error: {said or 'none on these meshes'}."
    known = rules[rules["verdict"] != UNKNOWN]
    good = known[known["verdict"].str.startswith("agrees")]
    yield (
        f"The rule of thumb agrees within a factor of ten with {len(good)} of {len(known)} distances that stand out "
        f"from the reference's uncertainty."
    )
    ratio = absent["cpu_s_present"].iloc[0] / absent["cpu_s_absent"].iloc[0]
    inside = absent[absent["in_a_plain_run"]]["feature"].tolist()
    yield (
        f"Absent features leave {'traces: ' + ', '.join(inside) if inside else 'no trace'} in the machine code of a "
        f"plain run; damping, present, takes {ratio:.2g} times its time."
    )


def _gain(ratio: float) -> str:
    return "the richest" if ratio == 1.0 else f"{ratio:.3g} times faster than the richest"


def _picture(frame: pd.DataFrame) -> Picture:
    """Distance against CPU time, a panel a scene."""
    scenes = list(frame.groupby("scene", sort=False))

    def draw(figure: Figure) -> None:
        for axes, (scene, runs) in zip(
            figure.subplots(1, len(scenes), squeeze=False)[0], scenes, strict=True
        ):
            shown = runs[(runs["error"] > 0.0) & (runs["cpu_s"] > 0.0)].sort_values("cpu_s")
            best = shown[shown["error"] < shown["error"].cummin().shift(fill_value=inf)]
            axes.plot(
                shown["cpu_s"], shown["error"], "o", color=PALETTE[0], markerfacecolor="none", markersize=5
            )
            axes.plot(best["cpu_s"], best["error"], "o-", color=PALETTE[1], markersize=5, linewidth=1.0)
            axes.margins(x=0.2)
            for point in best.to_dict("records"):
                low = point["error"] < 3.0 * runs["reference_error"].max()  # there the floor has its own text
                axes.annotate(
                    "".join(kind[0] for kind in point["element"].split("/")).upper(),
                    (point["cpu_s"], point["error"]), xytext=(4, 4) if low else (-4, -3), textcoords="offset points",
                    fontsize=7.5, ha="left" if low else "right", va="bottom" if low else "top",
                )  # fmt: skip
            axes.set(
                xscale="log",
                yscale="log",
                xlabel="CPU time (s)",
                ylabel="distance to the richest model",
                title=str(scene),
            )
            if not shown.empty:
                floor(axes, runs["reference_error"])
                log_ticks(axes.xaxis, *axes.get_xlim())
                log_ticks(axes.yaxis, *axes.get_ylim())

    caption = (
        "Every choice of kinds by body (S shear, C cable, R rigid, in the scene's order): distance to the richest "
        "model against CPU time; the line joins those that nothing cheaper beats."
    )
    return picture("fidelity", caption, draw, (7.2, 3.8))
