"""The rules for every solver, one function each. All scenes are made of one soft bar of 1 m."""

import copy
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields, replace
from functools import cache
from inspect import signature
from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import simpson

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import KINDS
from anctmm.errors import AnctmmError
from anctmm.model.drives import Quintic
from anctmm.model.scene import Beam, Clamp, Force, Load, Material, Pin, Point, Scene, Torque, Weld
from anctmm.model.sections import Rectangle
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers.capabilities import FEATURES, features_of
from reference.exact import euler_bernoulli_frequencies
from reference.exact import solve_static as exact_static
from studies.conformance import mechanisms
from studies.conformance.subject import BrokenRule, Measure, Rule, Subject, whole
from studies.engine.running.outcomes import not_installed

Array = NDArray[np.float64]

LOADS, INSTALLED, SIGNATURE = "loads", "installed", "signature"
SECTION, MATERIAL, LENGTH = Rectangle(0.05, 0.05), Material(E=1e7, density=1000.0), 1.0
EI, MASS = MATERIAL.E * SECTION.second_moment, MATERIAL.density * SECTION.area * LENGTH
GRAVITY = 9.81
FRACTIONS = (0.0, 0.3, 1.0)
TURN = 0.1  # rad, in 2 s
PULL = 50.0  # N/s


# --- scenes ------------------------------------------------------------------------------------------------


def bar(name: str = "bar", start: Point = (0.0, 0.0), angle: float = 0.0) -> Beam:
    """The bar, somewhere."""
    end = (start[0] + LENGTH * cos(angle), start[1] + LENGTH * sin(angle))
    return Beam(name, start, end, SECTION, MATERIAL)


def cantilever(gravity: float = GRAVITY, angle: float = 0.0, start: Point = (0.0, 0.0)) -> Scene:
    """Clamped, and let go in gravity; all of it turned and moved."""
    down = (gravity * sin(angle), -gravity * cos(angle))
    return Scene("cantilever", (bar(start=start, angle=angle),), (Clamp("bar.start"),), gravity=down)


def free(loads: tuple[Load, ...] = (), gravity: float = 0.0) -> Scene:
    """Held by nothing."""
    return Scene("free bar", (bar(),), loads=loads, gravity=(0.0, -gravity))


def jointed() -> Scene:
    """Two bars in a row, pinned to each other, the first one clamped."""
    second = bar("second", (LENGTH, 0.0))
    joints = (Clamp("bar.start"), Pin("bar.end", "second.start"))
    return Scene("jointed bars", (bar(), second), joints, gravity=(0.0, -GRAVITY))


def driven() -> Scene:
    """Turned by a driven clamp, so slowly that it hardly bends."""
    return Scene("driven bar", (bar(),), (Clamp("bar.start", angle=Quintic(turn=TURN, duration=2.0)),))


def pulled() -> Scene:
    """Free, pulled along its axis by a force that grows with time."""
    return free((Force("bar.end", lambda t: (PULL * t, 0.0 * t)),))


def branched(scene: Scene) -> Scene:
    """With a fork at the far end of the first bar: one more welded to it, another hinged."""
    fork = (bar("left", (LENGTH, 0.0), 0.8), bar("right", (LENGTH, 0.0), -0.8))
    joints = (Weld("bar.end", "left.start"), Pin("left.start", "right.start"))
    return replace(scene, bodies=(*scene.bodies, *fork), joints=(*scene.joints, *joints))


def looped(scene: Scene) -> Scene:
    """With a triangle beside it that hangs from a corner."""
    corner = (0.0, -LENGTH)
    sides = [bar(name, corner, angle) for name, angle in (("first", -pi / 3.0), ("last", -2.0 * pi / 3.0))]
    base = Beam("base", sides[1].end, sides[0].end, SECTION, MATERIAL)
    joints = (
        Pin("first.start", "last.start", grounded=True),
        Pin("first.end", "base.end"),
        Weld("last.end", "base.start"),
    )
    return replace(scene, bodies=(*scene.bodies, *sides, base), joints=(*scene.joints, *joints))


def lengthened(scene: Scene) -> Scene:
    """With one more bar hinged to the end of the first."""
    second = jointed().bodies[1]
    return replace(
        scene, bodies=(*scene.bodies, second), joints=(*scene.joints, Pin("bar.end", "second.start"))
    )


def turning(scene: Scene) -> Scene:
    """With the clamp driven."""
    return replace(scene, joints=(*driven().joints, *scene.joints[1:]))


def as_it_is(scene: Scene) -> Scene:
    """Nothing is changed."""
    return scene


#: Changes of the cantilever and its run that make it need a feature. The order matters: clamps first.
DEMANDS: Mapping[str, tuple[Callable[[Scene], Scene], dict[str, Any]]] = {
    "drives": (turning, {}),
    "joints": (lengthened, {}),
    "branches": (branched, {}),
    "loops": (looped, {}),
    "damping": (mechanisms.damped, {}),
    "varying-loads": (lambda scene: replace(scene, loads=pulled().loads), {}),
    **{
        name: (as_it_is, {"mesh": 1 if kind.rigid else 8, "element": name})
        for name, kind in KINDS.items()
        if kind.optional
    },
    **{feature: (change, {}) for feature, change in mechanisms.DEMANDS.items()},
    "statics": (as_it_is, {}),
    "zhai": (as_it_is, {"integrator": "zhai"}),
    "generalized-alpha": (as_it_is, {"integrator": "generalized-alpha"}),
    "esdirk": (as_it_is, {"integrator": "esdirk", "dt": 1e-3}),
}


def demanding(features: Collection[str]) -> tuple[Scene, dict[str, Any]]:
    """A scene that needs features, and the options of its run."""
    scene, options = cantilever(), dict[str, Any]()
    for feature, (change, asked) in DEMANDS.items():
        if feature in features:
            scene, options = change(scene), options | asked
    return scene, options


# --- rules -------------------------------------------------------------------------------------------------


def called_as_asked(s: Subject) -> str:
    """Solve(scene, run); solve_static(scene, mesh=, element=, quadrature=)."""
    try:
        signature(s.solve).bind(cantilever(), s.run())
        if "statics" not in s.offer.lacks:
            signature(s.static).bind(cantilever(), mesh=8, element=s.element, quadrature="full")
    except TypeError as error:
        raise BrokenRule(f"cannot be called so: {error}") from None
    return f"solve({', '.join(signature(s.solve).parameters)})"


def answers(s: Subject) -> str:
    """A complete Solution of the given scene, with its cost."""
    scene = cantilever()
    found = s.motion(scene)
    n = len(found.t)
    cost = found.cost
    for name, holds, value in (
        ("scene", found.scene == scene, found.scene.name),
        ("solver", isinstance(found.solver, str) and bool(found.solver), found.solver),
        ("fields", set(found.fields) == {"bar"}, sorted(found.fields)),
        ("energy lengths", {np.shape(e) for e in vars(found.energy).values()} == {(n,)}, n),
        ("cost.cpu_s", cost.cpu_s >= 0.0, cost.cpu_s),
        ("cost.wall_s", cost.wall_s >= 0.0, cost.wall_s),
        ("cost.steps", cost.steps > 0, cost.steps),
        ("dofs", found.dofs > 0, found.dofs),
    ):
        if not holds:
            raise BrokenRule(f"{name} is {value!r}")
    return f"{cost.steps} steps, {found.dofs} coordinates, {1e3 * cost.cpu_s:.3g} ms"


def samples(s: Subject) -> Measure:
    """Outputs at the requested times, although the last interval is shorter."""
    asked = {"t_end": 0.05, "output_dt": 0.02}
    wanted = np.array([0.0, 0.02, 0.04, 0.05])
    found = s.motion(cantilever(), **asked)
    if np.shape(found.t) != wanted.shape:
        raise BrokenRule(
            f"{np.size(found.t)} outputs of shape {np.shape(found.t)}; {wanted.shape} are needed"
        )
    for fraction in FRACTIONS:
        shape = np.shape(found.position("bar", fraction))
        if shape != (len(wanted), 2):
            raise BrokenRule(
                f"positions at fraction {fraction} have the shape {shape}; {(len(wanted), 2)} is needed"
            )
    return Measure(float(np.abs(found.t - wanted).max() / wanted[-1]), 1e-9, "of t_end")


def begins_undeformed(s: Subject) -> Measure:
    """The first output is the scene as given."""
    scene = cantilever(angle=0.3, start=(0.2, -0.1))
    return Measure(_off_reference(s.motion(scene), scene), 1e-9, "of the length")


def falls_freely(s: Subject) -> Measure:
    """Metres and seconds: −½ g t²."""
    found = s.motion(free(gravity=GRAVITY))
    path = -0.5 * GRAVITY * found.t**2
    off = max(
        float(np.abs(found.displacement(("bar", f)) - np.outer(path, [0.0, 1.0])).max()) for f in FRACTIONS
    )
    return Measure(off / abs(path[-1]), 1e-6, "of the way")


def swings_in_time(s: Subject) -> Measure:
    """Pascals and kilograms: a small swing against the sum of the first two modes."""
    omega = euler_bernoulli_frequencies("clamped-free", 2, LENGTH, EI, MASS / LENGTH)
    wave = np.sqrt(omega / sqrt(EI * LENGTH / MASS))  # (βL)_k, at L = 1
    tip_times_mean = 4.0 / wave * (np.cos(wave) + np.cosh(wave)) / (np.sin(wave) + np.sinh(wave))
    gravity, t_end = 0.01, 1.2  # s: nearly a period
    found = s.motion(cantilever(gravity), mesh=16, t_end=t_end)
    modes = tip_times_mean * [1.0, -1.0] / omega**2 * (1.0 - np.cos(np.outer(found.t, omega)))
    tip, wanted = found.displacement("bar.end")[:, 1], -gravity * modes.sum(axis=1)
    return Measure(float(np.abs(tip - wanted).max() / np.abs(wanted).max()), 0.03, "of the way")


def keeps_energy(s: Subject) -> Measure:
    """Kinetic + strain + potential − work."""
    energy = s.motion(cantilever()).energy
    return Measure(float(np.abs(energy.balance).max() / energy.kinetic.max()), 0.01, "of the kinetic energy")


def turns(s: Subject) -> Measure:
    """A scene turned and moved has its history turned and moved."""
    angle, start = 0.7, (3.0, -2.0)
    plain, turned = s.motion(cantilever()), s.motion(cantilever(angle=angle, start=start))
    turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
    off = max(
        float(np.abs(plain.position("bar", f) @ turn.T + start - turned.position("bar", f)).max())
        for f in FRACTIONS
    )
    return Measure(off / LENGTH, 1e-6, "of the length")


def repeats(s: Subject) -> Measure:
    """The same question has the same answer, to the last digit."""
    first = s.motion(cantilever())
    again = whole(s.solve(cantilever(), s.run()))
    off = max(float(np.abs(first.position("bar", f) - again.position("bar", f)).max()) for f in FRACTIONS)
    return Measure(off / LENGTH, 0.0, "of the length")


def leaves_input_alone(s: Subject) -> str:
    """Scene and discretisation are as before."""
    scene, run = cantilever(), s.run(t_end=0.02)
    before = copy.deepcopy((scene, run))
    whole(s.solve(scene, run))
    for thing, old, kind in zip((scene, run), before, (Scene, Discretisation), strict=True):
        for name in (field.name for field in fields(kind)):
            was, value = getattr(old, name), getattr(thing, name)
            if value != was:
                raise BrokenRule(f"{type(thing).__name__}.{name} was {was!r} and is {value!r}")
    return "nothing changed"


def refuses_what_does_not_fit(s: Subject) -> str:
    """A mesh of another scene's bodies is an error that names them."""
    run = s.run(mesh={"nobody": 8})
    try:
        found = s.solve(cantilever(), run)
    except AnctmmError as error:
        if "nobody" not in str(error):
            raise BrokenRule(f"{type(error).__name__} does not name 'nobody': {error}") from None
        return type(error).__name__
    raise BrokenRule(f"answered with status {found.status}; an error of anctmm.errors is needed")


def tells_divergence(s: Subject) -> str:
    """A run that cannot end well has a status that says so, and its history until then."""
    if "zhai" in s.offer.lacks:
        scene, run = cantilever(gravity=1e12), s.run(dt=0.1, t_end=10.0, output_dt=0.1)
    else:
        scene = cantilever()
        run = s.run(integrator="zhai", dt=5e-3, t_end=2.0, output_dt=5e-3, check_stability=False)
    found = s.solve(scene, run)
    asked = run.times(run.output_steps)
    n, status = len(found.t), found.status
    if status.code not in ("diverged", "failed"):
        raise BrokenRule(f"status {status}; 'diverged' or 'failed' is needed")
    if not status.message or status.time is None:
        raise BrokenRule(
            f"status {status.code!r} has message {status.message!r} and time {status.time!r}; both are needed"
        )
    if not 1 <= n < len(asked) or not np.allclose(found.t, asked[:n], rtol=1e-9, atol=1e-12):
        raise BrokenRule(f"{n} of {len(asked)} outputs are stored; those before the failure are needed")
    if not all(np.isfinite(found.position("bar", f)).all() for f in FRACTIONS):
        raise BrokenRule("the stored history is not finite")
    return f"{status.code} at {status.time:.3g} s, {n} outputs kept"


def refuses_what_it_lacks(s: Subject) -> str:
    """Asked for what it lacks, it says so."""
    refused = []
    for lack in sorted(s.offer.lacks - {"statics"}):
        features = features_of(lack)
        if not DEMANDS.keys() >= set(features):
            continue
        status = _asked_for(s, features)
        if status.code != "unsupported" or not status.message:
            meaning = ", ".join(FEATURES[feature] for feature in features)
            raise BrokenRule(f"lacks {lack!r} ({meaning}), but answers with status {status}")
        refused.append(lack)
    return f"{', '.join(refused)} refused" if refused else "lacks nothing"


def _asked_for(s: Subject, features: Collection[str]) -> Status:
    """How a solver answers what needs features."""
    scene, options = demanding(features)
    try:
        if "statics" in features:
            return s.static(scene, **{"mesh": 8, "element": s.element} | options).status
        return s.solve(scene, s.run(**{"t_end": 0.02} | options)).status
    except AnctmmError as error:
        return Status("unsupported", str(error))


def integrators_agree(s: Subject) -> Measure:
    """Explicit and implicit steps make one motion."""
    a, b = (
        s.motion(cantilever(), integrator=i).displacement("bar.end") for i in ("generalized-alpha", "zhai")
    )
    return Measure(float(np.abs(a - b).max() / np.abs(a).max()), 2e-3, "of the way")


def order_is_high(s: Subject) -> Measure:
    """Steps of high order: halved, they leave an eighth of the difference or less where vibrations are resolved."""
    runs = [s.motion(cantilever(), mesh=2, integrator="esdirk", dt=dt) for dt in (2e-3, 1e-3, 5e-4)]
    one, two, three = (run.displacement("bar.end") for run in runs)
    differences = np.abs(one - two).max(), np.abs(two - three).max()
    return Measure(float(differences[1] / max(differences[0], 1e-300)), 0.125, "of the difference before")


def joints_hold(s: Subject) -> Measure:
    """Pinned ends stay together."""
    found = s.motion(jointed())
    gap = np.abs(found.position("bar", 1.0) - found.position("second", 0.0)).max()
    return Measure(float(gap) / LENGTH, 1e-6, "of the length")


def branches_hold(s: Subject) -> Measure:
    """Three ends at one place stay together, and two of them, welded, at their angle."""
    found = s.motion(branched(cantilever()))
    return _kept_together(found, [("bar", 1.0), ("left", 0.0), ("right", 0.0)])


def loops_hold(s: Subject) -> Measure:
    """A triangle that swings about a corner stays closed."""
    found = s.motion(looped(cantilever()))
    corners = [
        [("first", 1.0), ("base", 1.0)],
        [("last", 1.0), ("base", 0.0)],
        [("first", 0.0), ("last", 0.0)],
    ]
    return max((_kept_together(found, corner) for corner in corners), key=lambda m: m.value)


def _kept_together(found: Solution, places: list[tuple[str, float]]) -> Measure:
    """Largest distance of places that are one, at any time."""
    one, *others = (found.position(*place) for place in places)
    gap = max(float(np.abs(other - one).max()) for other in others)
    return Measure(gap / LENGTH, 1e-6, "of the length")


def drives_drive(s: Subject) -> Measure:
    """A driven clamp takes the bar along."""
    found = s.motion(driven(), t_end=2.0, output_dt=0.1)
    tip = found.displacement("bar.end")[-1]
    wanted = LENGTH * np.array([cos(TURN) - 1.0, sin(TURN)])
    return Measure(float(np.linalg.norm(tip - wanted) / np.linalg.norm(wanted)), 0.1, "of the way")


def loads_vary(s: Subject) -> Measure:
    """A force that grows with time moves the mass centre by its double integral."""
    found = s.motion(pulled())
    fractions = np.linspace(0.0, 1.0, 65)
    moved = simpson([found.displacement(("bar", f))[:, 0] for f in fractions], x=fractions, axis=0)
    way = PULL * found.t**3 / (6.0 * MASS)
    return Measure(float(np.abs(moved - way).max() / way[-1]), 1e-3, "of the way")


def mechanisms_act(s: Subject) -> Measure | str:
    """Bodies, guides, connectors and loads that it claims are not ignored."""
    return mechanisms.features_act(s, cantilever())


def rests_exactly(s: Subject) -> Measure:
    """Large deflection under a tip force and a moment against the exact rod that it says it tends to."""
    limits = s.offer.limits
    errors = {element: _rest_error(s, element, 32) for element in limits}
    worst = max(errors, key=errors.__getitem__)
    return Measure(
        errors[worst], 0.01, f"of the way, {worst} from {limits[worst]}, the worst of {len(errors)}"
    )


def gains_by_elements(s: Subject) -> Measure:
    """More elements are nearer to it."""
    errors = [(_rest_error(s, element, 8), _rest_error(s, element, 32)) for element in s.offer.limits]
    return Measure(
        max(fine / max(coarse, 1e-6) for coarse, fine in errors),
        0.5,
        "of the error of a quarter of the elements",
    )


def loads_grow(s: Subject) -> Measure:
    """Statics: load factors from 0 to 1, from the scene as given."""
    found = s.rest(loaded(), 8, s.element)
    if found.t[0] != 0.0 or abs(found.t[-1] - 1.0) > 1e-12:
        raise BrokenRule(f"load factors from {found.t[0]:g} to {found.t[-1]:g}")
    return Measure(_off_reference(found, loaded()), 1e-9, "of the length")


def tells_stability(s: Subject) -> str:
    """A clamped column under a load on its tip: stable well below Euler's load, unstable well above."""
    euler = np.pi**2 * EI / (4.0 * LENGTH**2)
    for factor, wanted in ((0.7, "ok"), (1.5, "unstable")):
        loads = (Force("bar.end", (-factor * euler, 0.0)),)
        column = Scene("column", (bar(),), (Clamp("bar.start"),), loads)
        status = s.static(column, mesh=8, element=s.element, quadrature="full").status
        if status.code != wanted:
            raise BrokenRule(f"status {status} at {factor} times Euler's load; {wanted!r} is needed")
    return "ok at 0.7, unstable at 1.5 times Euler's load"


RULES = (
    Rule(SIGNATURE, "it has the signature of all solvers", called_as_asked),
    Rule("answer", "a complete Solution of the scene, with its cost", answers),
    Rule("sampling", "the requested times, first and last included", samples),
    Rule("beginning", "the first output is the scene as given", begins_undeformed),
    Rule("units: m, s", "a free bar falls by g t²/2", falls_freely),
    Rule("units: Pa, kg", "a small swing is that of its first two modes", swings_in_time),
    Rule("energy", "none is created or lost", keeps_energy, ("energy",)),
    Rule("rigid motion", "rotated and moved scenes have histories rotated and moved alike", turns),
    Rule("determinism", "the same again", repeats),
    Rule("input", "scene and discretisation are not changed", leaves_input_alone),
    Rule("bad options", "a mesh that does not fit is an error naming it", refuses_what_does_not_fit),
    Rule("failure", "divergence: a status that says so, and the history until then", tells_divergence),
    Rule("limits", "it refuses by name what it lacks", refuses_what_it_lacks),
    Rule(
        "integrators",
        "both integrators give the same motion",
        integrators_agree,
        ("zhai", "generalized-alpha"),
    ),
    Rule("high order", "the order of the steps is observed", order_is_high, ("esdirk",)),
    Rule("joints", "pinned ends stay together", joints_hold, ("joints",)),
    Rule("branches", "three ends at one place stay together", branches_hold, ("branches",)),
    Rule("loops", "a swinging triangle stays closed", loops_hold, ("loops",)),
    Rule("drives", "a turning clamp rotates the bar", drives_drive, ("drives",)),
    Rule("varying loads", "a growing force moves the mass centre", loads_vary, ("varying-loads",)),
    Rule(
        "features",
        "bodies, guides, connectors, loads and damping do what they do in another solver",
        mechanisms_act,
    ),
    Rule("statics", "32 elements against the exact rod", rests_exactly, ("statics",)),
    Rule("convergence", "32 elements are more accurate than 8", gains_by_elements, ("statics",)),
    Rule("load factors", "statics go from 0 to 1", loads_grow, ("statics",)),
    Rule("stability", "a column is unstable above Euler's load", tells_stability, ("statics", "stability")),
)


# --- helpers -----------------------------------------------------------------------------------------------


def loaded() -> Scene:
    """The static scene: P L²/(E I) = 2 down, and an end moment the other way."""
    loads = (Force("bar.end", (0.0, -2.0 * EI / LENGTH**2)), Torque("bar.end", 0.3 * EI / LENGTH))
    return Scene("loaded cantilever", (bar(),), (Clamp("bar.start"),), loads)


@cache
def _exact_tip(limit: str) -> Array:
    return exact_static(loaded(), limit).displacement("bar.end")[-1]


def _rest_error(s: Subject, element: str, mesh: int) -> float:
    exact = _exact_tip(s.offer.limits[element])
    found = s.rest(loaded(), mesh, element).displacement("bar.end")[-1]
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def missing(s: Subject) -> str:
    """What a solver says is not installed, without which it can do nothing; empty if it says no such thing."""
    try:
        status = s.solve(cantilever(), s.run(t_end=0.02)).status
    except Exception:  # whatever a broken solver does is for the rules to find
        return ""
    return status.message if isinstance(status, Status) and not_installed(status) else ""


def _off_reference(found: Solution, scene: Scene) -> float:
    (body,) = scene.beams
    start, end = np.array(body.start), np.array(body.end)
    return max(
        float(np.abs(found.position("bar", f)[0] - ((1.0 - f) * start + f * end)).max()) / LENGTH
        for f in FRACTIONS
    )
