"""The rules for every solver, one function each."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from functools import cached_property
from inspect import signature
from math import cos, sin, sqrt
from typing import Any

import numpy as np

import anctmm as at
from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError
from anctmm.model.needs import features_of as combined
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.solvers.capabilities import FEATURES, Offer, features_of
from anctmm.solvers.registry import Solver
from reference.exact import euler_bernoulli_frequencies
from reference.exact import solve_static as exact_static
from studies.conformance import scenes as made
from studies.conformance.scenes import EI, GRAVITY, LENGTH, MASS, cantilever

SIGNATURE = "signature"
FRACTIONS = (0.0, 0.3, 1.0)
PROBES = ("bar.end", ("bar", 0.5))
#: Part by which the effect of a feature may differ from that in another solver, on the same mesh.
ALLOWED = 0.2
#: Length of the motions that show an effect, s.
ACTED = 0.2
#: P L²/(E I) = 2 down, and an end moment the other way.
LOADS = at.Force("bar.end", (0.0, -2.0 * EI / LENGTH**2)), at.Torque("bar.end", 0.3 * EI / LENGTH)
PRESSED = cantilever(0.0, loads=LOADS)


class BrokenRule(Exception):
    """A rule is violated in a way that no number describes."""


@dataclass
class Subject:
    """A solver under test, its answers unchecked by the registry; equal runs are computed once."""

    name: str
    solve: Solver
    _found: dict[Any, Solution] = field(default_factory=dict)

    @cached_property
    def offer(self) -> Offer:
        """Its declared capabilities."""
        return registry.offer_of(self.solve)

    @property
    def element(self) -> str:
        """The element that the rules of motion use."""
        return next(iter(self.offer.limits), "cable")

    def run(self, **changes: Any) -> Discretisation:
        """Discretisation of a rule's run: implicit where there is a choice."""
        integrator = changes.get("integrator", self.offer.integrators[0])
        dt = 1e-3 if integrator == "generalized-alpha" else 2e-4
        usual = {"mesh": 8, "element": self.element, "integrator": integrator, "dt": dt}
        return Discretisation(**({**usual, "t_end": 0.4, "output_dt": 0.01} | changes))

    def motion(self, scene: Scene, **changes: Any) -> Solution:
        """Motion of a scene; BrokenRule if it is not whole."""
        run = self.run(**changes)
        if (scene, run) not in self._found:
            self._found[scene, run] = whole(self.solve(scene, run))
        return self._found[scene, run]

    def static(self, scene: Scene, **options: Any) -> Solution:
        """What its `solve_static` answers, asked for as in the studies."""
        usual = {"mesh": 8, "element": self.element, "quadrature": "full"}
        return registry.load_static(self.name, self.solve)(scene, **(usual | options))


def whole(answer: Solution) -> Solution:
    """The answer, if it is a whole run; else BrokenRule."""
    if not isinstance(answer, Solution):
        raise BrokenRule(f"the answer is a {type(answer).__name__}, no anctmm.Solution")
    if not answer.status.ok:
        raise BrokenRule(f"status {answer.status}")
    return answer


#: What a rule finds: a number, what is allowed and what the number is; or words where there is no number.
Found = tuple[float, float, str] | str
Test = Callable[[Subject], Found]


@dataclass(frozen=True)
class Rule:
    """One requirement on every solver; `needs` are features without which it does not apply."""

    name: str
    asks: str
    test: Test
    needs: tuple[str, ...] = ()


RULES: list[Rule] = []


def rule(name: str, asks: str, *needs: str) -> Callable[[Test], Test]:
    """Make a rule of a function."""

    def added(test: Test) -> Test:
        RULES.append(Rule(name, asks, test, needs))
        return test

    return added


def worst(off: dict[str, float], allowed: float, what: str) -> Found:
    """Of several numbers by name the largest."""
    name = max(off, key=off.__getitem__)
    return off[name], allowed, f"of {what}: {name}, the worst of {len(off)}"


# --- the interface -----------------------------------------------------------------------------------------


@rule(SIGNATURE, "it has the signature of all solvers")
def called_as_asked(s: Subject) -> Found:
    """Solve(scene, run); solve_static(scene, mesh=, element=, quadrature=)."""
    try:
        signature(s.solve).bind(cantilever(), s.run())
        if "statics" not in s.offer.lacks:
            static = registry.load_static(s.name, s.solve)
            signature(static).bind(cantilever(), mesh=8, element=s.element, quadrature="full")
    except TypeError as error:
        raise BrokenRule(f"cannot be called so: {error}") from None
    return f"solve({', '.join(signature(s.solve).parameters)})"


@rule("answer", "a complete Solution of the scene, from the start as given, at the requested times")
def answers(s: Subject) -> Found:
    """Also where the last interval is shorter."""
    scene, wanted = cantilever(angle=0.3, start=(0.2, -0.1)), np.array([0.0, 0.02, 0.04, 0.05])
    found = s.motion(scene, t_end=0.05, output_dt=0.02)
    n, cost = len(wanted), found.cost
    if np.shape(found.t) != (n,) or np.abs(found.t - wanted).max() > 1e-9 * wanted[-1]:
        raise BrokenRule(f"outputs are at {found.t}; {wanted} are needed")
    wrong = {
        "scene": found.scene != scene,
        "solver": not (isinstance(found.solver, str) and found.solver),
        "fields": set(found.fields) != {"bar"},
        "positions": {np.shape(found.position("bar", f)) for f in FRACTIONS} != {(n, 2)},
        "energy lengths": {np.shape(e) for e in vars(found.energy).values()} != {(n,)},
        "cost": not (cost.cpu_s >= 0.0 and cost.wall_s >= 0.0 and cost.steps > 0),
        "dofs": not found.dofs > 0,
    }
    if names := ", ".join(name for name, value in wrong.items() if value):
        raise BrokenRule(f"{names} of the Solution are missing or wrong")
    off = _largest(found.position("bar", f)[0] - scene.beams[0].position_at(f) for f in FRACTIONS)
    return off / LENGTH, 1e-9, "of the length at the start"


@rule("determinism", "the same again")
def repeats(s: Subject) -> Found:
    first, again = s.motion(cantilever()), whole(s.solve(cantilever(), s.run()))
    off = _largest(first.position("bar", f) - again.position("bar", f) for f in FRACTIONS)
    return off / LENGTH, 0.0, "of the length"


@rule("bad options", "a mesh that does not fit is an error naming it")
def refuses_a_mesh_that_does_not_fit(s: Subject) -> Found:
    try:
        found = s.solve(cantilever(), s.run(mesh={"nobody": 8}))
    except AnctmmError as error:
        if "nobody" not in str(error):
            raise BrokenRule(f"{type(error).__name__} does not name 'nobody': {error}") from None
        return type(error).__name__
    raise BrokenRule(f"answered with status {found.status}; an error of anctmm.errors is needed")


@rule("failure", "divergence: a status that says so, and the history until then")
def reports_divergence(s: Subject) -> Found:
    if "zhai" in s.offer.lacks:
        scene, run = cantilever(gravity=1e12), s.run(dt=0.1, t_end=10.0, output_dt=0.1)
    else:
        scene = cantilever()
        run = s.run(integrator="zhai", dt=5e-3, t_end=2.0, output_dt=5e-3, check_stability=False)
    found = s.solve(scene, run)
    asked, n, status = run.times(run.output_steps), len(found.t), found.status
    if status.code not in ("diverged", "failed") or not status.message or status.time is None:
        raise BrokenRule(f"status {status}; 'diverged' or 'failed' with a message and a time is needed")
    if not (1 <= n < len(asked) and np.allclose(found.t, asked[:n], rtol=1e-9, atol=1e-12)):
        raise BrokenRule(f"{n} of {len(asked)} outputs are stored; those before the failure are needed")
    if not all(np.isfinite(found.position("bar", f)).all() for f in FRACTIONS):
        raise BrokenRule("the stored history is not finite")
    return f"{status.code} at {status.time:.3g} s, {n} outputs stored"


@rule("limits", "it refuses by name what it lacks")
def refuses_what_it_lacks(s: Subject) -> Found:
    refused = []
    for lack in sorted(s.offer.lacks - {"statics"}):
        features = features_of(lack)
        if not {*made.DEMANDS, *made.RUNS} >= set(features):
            continue
        status = _asked_for(s, features)
        if status.code != "unsupported" or not status.message:
            meaning = ", ".join(FEATURES[feature] for feature in features)
            raise BrokenRule(f"lacks {lack!r} ({meaning}), but answers with status {status}")
        refused.append(lack)
    return f"{', '.join(refused)} refused" if refused else "lacks nothing"


def _asked_for(s: Subject, features: Collection[str]) -> Status:
    """Status of a run that needs features."""
    scene, options = cantilever(), dict[str, Any]()
    for feature in (f for f in (*made.DEMANDS, *made.RUNS) if f in features):
        scene = made.DEMANDS.get(feature, made.same)(scene)
        options |= made.RUNS.get(feature, {})
    try:
        if "statics" in features:
            return s.static(scene, **options).status
        return s.solve(scene, s.run(**{"t_end": 0.02} | options)).status
    except AnctmmError as error:
        return Status("unsupported", str(error))


# --- motions -----------------------------------------------------------------------------------------------


@rule("units: m, s", "a free bar falls by g t²/2")
def falls_freely(s: Subject) -> Found:
    found = s.motion(cantilever(joints=()))
    path = np.outer(-0.5 * GRAVITY * found.t**2, [0.0, 1.0])
    off = _largest(found.displacement(("bar", f)) - path for f in FRACTIONS)
    return off / abs(path[-1, 1]), 1e-6, "of the way"


@rule("units: Pa, kg", "a small swing is that of its first two modes")
def swings_in_time(s: Subject) -> Found:
    omega = euler_bernoulli_frequencies("clamped-free", 2, LENGTH, EI, MASS / LENGTH)
    wave = np.sqrt(omega / sqrt(EI * LENGTH / MASS))  # (βL)_k, at L = 1
    tip_times_mean = 4.0 / wave * (np.cos(wave) + np.cosh(wave)) / (np.sin(wave) + np.sinh(wave))
    gravity, t_end = 0.01, 1.2  # s: nearly a period
    found = s.motion(cantilever(gravity), mesh=16, t_end=t_end)
    modes = tip_times_mean * [1.0, -1.0] / omega**2 * (1.0 - np.cos(np.outer(found.t, omega)))
    tip, wanted = found.displacement("bar.end")[:, 1], -gravity * modes.sum(axis=1)
    return float(np.abs(tip - wanted).max() / np.abs(wanted).max()), 0.03, "of the way"


@rule("energy", "none is created or lost", "energy")
def keeps_energy(s: Subject) -> Found:
    energy = s.motion(cantilever()).energy
    return float(np.abs(energy.balance).max() / energy.kinetic.max()), 0.01, "of the kinetic energy"


@rule("rigid motion", "rotated and moved scenes have histories rotated and moved alike")
def turns(s: Subject) -> Found:
    angle, start = 0.7, (3.0, -2.0)
    plain, turned = s.motion(cantilever()), s.motion(cantilever(angle=angle, start=start))
    turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
    off = _largest(plain.position("bar", f) @ turn.T + start - turned.position("bar", f) for f in FRACTIONS)
    return off / LENGTH, 1e-6, "of the length"


@rule("integrators", "both integrators give the same motion", "zhai", "generalized-alpha")
def integrators_agree(s: Subject) -> Found:
    runs = (s.motion(cantilever(), integrator=i) for i in ("generalized-alpha", "zhai"))
    a, b = (run.displacement("bar.end") for run in runs)
    return float(np.abs(a - b).max() / np.abs(a).max()), 2e-3, "of the way"


@rule("high order", "the order of the steps is observed", "esdirk")
def order_is_high(s: Subject) -> Found:
    """Halved steps leave an eighth of the difference or less where vibrations are resolved."""
    runs = [s.motion(cantilever(), mesh=2, integrator="esdirk", dt=dt) for dt in (2e-3, 1e-3, 5e-4)]
    one, two, three = (run.displacement("bar.end") for run in runs)
    before, after = np.abs(one - two).max(), np.abs(two - three).max()
    return float(after / max(before, 1e-300)), 0.125, "of the difference before"


@rule("joints", "ends that are joined stay together, also three of them and in a loop", "joints")
def stay_together(s: Subject) -> Found:
    """Largest distance of places that are one, at any time."""
    gaps = {}
    for feature in (f for f in made.MEETING if not s.offer.lacking({f})):
        found = s.motion(made.DEMANDS[feature](cantilever()))
        pairs = made.MEETING[feature]
        gaps[feature] = _largest(found.position(*a) - found.position(*b) for a, b in pairs) / LENGTH
    return worst(gaps, 1e-6, "the length")


@rule("features", "drives, bodies, guides, connectors, loads and damping do what they do in another solver")
def features_act(s: Subject) -> Found:
    """Compare the effect of each declared feature with that in another solver; BrokenRule names those that differ."""
    name = "global-dae" if s.name == "anctmm" else "anctmm"
    other = Subject(name, registry.load(name))
    found = {feature: _difference(s, other, feature) for feature in sorted(made.ACTING)}
    known = {feature: off for feature, off in found.items() if off is not None}
    if wrong := ", ".join(f"{feature} ({off:.2g})" for feature, off in known.items() if not off <= ALLOWED):
        raise BrokenRule(f"effects differ by more than {ALLOWED:g} of them from another solver's: {wrong}")
    return worst(known, ALLOWED, "the effect") if known else "lacks all of them"


def _difference(s: Subject, other: Subject, feature: str) -> float | None:
    """Relative difference of the effect of a feature; None where it is lacking with each integrator."""
    changes = made.DEMANDS[feature], made.WITHOUT.get(feature, made.same)
    scenes = [change(cantilever()) for change in changes]
    needed = {feature, *combined(scenes[0])}
    integrator = next((i for i in s.offer.integrators if not s.offer.lacking({*needed, i})), None)
    if integrator is None:
        return None
    theirs = [s.motion(scene, integrator=integrator, t_end=ACTED) for scene in scenes]
    ours = [other.motion(scene, element="cable", t_end=ACTED) for scene in scenes]
    a, b = (np.array([x.displacement(p) - y.displacement(p) for p in PROBES]) for x, y in (theirs, ours))
    return float(np.abs(a - b).max() / np.abs(b).max())


# --- statics -----------------------------------------------------------------------------------------------


@rule("statics", "32 elements against the exact rod, loads from 0 to 1", "statics")
def rests_exactly(s: Subject) -> Found:
    """Large deflection under a tip force and a moment, against the limit that the solver declares."""
    errors = {}
    for element, limit in s.offer.limits.items():
        exact = exact_static(PRESSED, limit).displacement("bar.end")[-1]
        found = whole(s.static(PRESSED, mesh=32, element=element))
        if found.t[0] != 0.0 or abs(found.t[-1] - 1.0) > 1e-12:
            raise BrokenRule(f"load factors from {found.t[0]:g} to {found.t[-1]:g}")
        off = np.linalg.norm(found.displacement("bar.end")[-1] - exact)
        errors[f"{element} from {limit}"] = float(off / np.linalg.norm(exact))
    return worst(errors, 0.01, "the way")


@rule("stability", "a column is unstable above Euler's load", "statics", "stability")
def reports_stability(s: Subject) -> Found:
    euler = np.pi**2 * EI / (4.0 * LENGTH**2)
    for factor, wanted in ((0.7, "ok"), (1.5, "unstable")):
        load = at.Force("bar.end", (-factor * euler, 0.0))
        status = s.static(cantilever(0.0, loads=(load,))).status
        if status.code != wanted:
            raise BrokenRule(f"status {status} at {factor} times Euler's load; {wanted!r} is needed")
    return "ok at 0.7, unstable at 1.5 times Euler's load"


def _largest(differences: Any) -> float:
    """The largest component of several arrays of one shape; NaN if one is NaN."""
    return float(np.abs(list(differences)).max())
