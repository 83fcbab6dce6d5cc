"""The conformance test: our solvers pass it, and each broken solver fails the one rule it breaks."""

import sys
from dataclasses import replace
from itertools import count
from types import ModuleType

import numpy as np
import pytest
from rich.console import Console

import anctmm as at
from anctmm.errors import PluginError
from anctmm.model.scene import Clamp
from anctmm.results.ended_early import nothing
from anctmm.solve import OFFER as OWN
from anctmm.solvers import registry
from anctmm.solvers.capabilities import FEATURES, Offer
from studies.conformance.check import (
    BROKEN,
    HOLDS,
    NOT_INSTALLED,
    NOT_OFFERED,
    NOT_RUN,
    conform,
    exit_code,
    passed,
    show,
)
from studies.conformance.rules import RULES, features_act, refuses_what_it_lacks
from studies.conformance.scenes import ACTING, DEMANDS, RUNS, WITHOUT, cantilever
from studies.conformance.subject import BrokenRule, Subject

OURS = ("anctmm", "global-dae", "global-dae-dense", "exudyn-cable", "exudyn-reissner")
#: Solvers in Python, which take minutes.
LONG = ("global-dae", "global-dae-dense")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.exhaustive] if n in LONG else []) for n in OURS]
)
def test_our_solvers_conform(name):
    findings = list(conform(name))
    if absent := [f.measured for f in findings if f.verdict == NOT_INSTALLED]:
        pytest.skip(absent[0])
    lacking = [f.rule for f in findings if f.verdict == NOT_OFFERED]
    assert name.startswith("exudyn") or lacking == []
    assert [f for f in findings if f.verdict not in (HOLDS, NOT_OFFERED)] == []
    assert len(findings) == len(RULES) + 1


def test_what_is_not_installed_is_said_and_no_rule_is_broken(monkeypatch):
    """Exudyn as it answers where it cannot be imported: exit code 2, nothing tested."""
    monkeypatch.setitem(sys.modules, "exudyn", None)
    for name in ("exudyn-cable", "exudyn-reissner"):
        findings = list(conform(name))
        verdicts = [f.verdict for f in findings]
        assert verdicts == [HOLDS, NOT_INSTALLED, *[NOT_RUN] * len(RULES)]
        assert "exudyn is not installed; pip install 'anctmm[peers]'" in findings[1].measured
        assert not passed(findings)
        assert exit_code(findings) == 4
    console = Console(record=True, width=200)
    show(name, findings, console)
    assert f"1 holds, {len(RULES)} not run, 1 not installed" in console.export_text()


def test_only_what_says_so_is_not_installed(plugged):
    """A solver that declines a scene for another reason breaks rules."""
    plugged(declines, rest, Offer())
    findings = list(conform("broken"))
    assert NOT_INSTALLED not in {f.verdict for f in findings}
    assert exit_code(findings) == 1


def test_opensees_conforms_in_what_it_offers():
    findings = list(conform("opensees"))
    if absent := [f.measured for f in findings if f.verdict == NOT_INSTALLED]:
        pytest.skip(absent[0])
    assert passed(findings)
    lacking = {f.rule for f in findings if f.verdict == NOT_OFFERED}
    assert lacking == {"energy", "integrators", "high order", "stability"}


def test_what_a_peer_lacks_is_shown_and_not_skipped():
    pytest.importorskip("elastica", reason="PyElastica (extra `peers`) is not installed")
    found = {f.rule: f for f in conform("pyelastica")}
    assert passed(found.values())
    lacking = {rule for rule, f in found.items() if f.verdict == NOT_OFFERED}
    assert lacking == {
        "integrators", "high order", "joints", "branches", "loops", "drives", "varying loads", "stability", "energy",
    }  # fmt: skip


# --- broken solvers: ours, with one thing wrong each ---------------------------------------------------------


class Moved:
    """A field whose positions are changed."""

    def __init__(self, of, change):
        self.of, self.change = of, change

    def position(self, fraction):
        return self.change(self.of.position(fraction))


def positions(answer, change, only=None):
    """An answer whose positions are changed."""
    fields = {n: Moved(f, change) if only in (None, n) else f for n, f in answer.fields.items()}
    return replace(answer, fields=fields)


def sound(scene, run):
    return at.solve(scene, run)


def rest(scene, **options):
    return at.solve_static(scene, **options)


def moved(change, only=None):
    """A solver whose positions are changed."""

    def solve(scene, run):
        return positions(at.solve(scene, run), change, only)

    return solve


def answering(change):
    """A solver whose answer is changed."""

    def solve(scene, run):
        return change(at.solve(scene, run))

    return solve


def solving(change):
    """A solver of another scene."""

    def solve(scene, run):
        return replace(at.solve(change(scene), run), scene=scene)

    return solve


def each(name, change):
    """A change of all bodies, joints, … of a scene."""
    return lambda scene: replace(scene, **{name: [change(part) for part in getattr(scene, name)]})


def stiffer(factor):
    def change(b):
        return (
            replace(b, material=replace(b.material, E=factor * b.material.E)) if isinstance(b, at.Beam) else b
        )

    return each("bodies", change)


def needs_more(scene, run, magic):
    return at.solve(scene, run)


def declines(scene, run):
    return nothing("declines", scene, run, at.Status("unsupported", "no beams today"))


def drops_the_end(scene, run):
    answer = at.solve(scene, run)
    n = len(answer.t) - (run.steps % run.stride != 0)
    cut = positions(answer, lambda p: p[:n])
    return replace(cut, t=answer.t[:n], energy=at.Energy(*(e[:n] for e in vars(answer.energy).values())))


def begins_elsewhere(scene, run):
    along = np.array([np.cos(scene.bodies[0].angle), np.sin(scene.bodies[0].angle)])
    return positions(at.solve(scene, run), lambda p: p + 1e-3 * along)


def prefers_a_direction(scene, run):
    return solving(stiffer(1.0 + 0.01 * np.sin(2.0 * scene.bodies[0].angle)))(scene, run)


CALLS = count()


def is_never_the_same(scene, run):
    noise = 1e-13 * next(CALLS)
    return positions(at.solve(scene, run), lambda p: p + noise)


def changes_its_input(scene, run):
    answer = at.solve(scene, run)
    object.__setattr__(run, "psi", 0.6)
    return answer


def takes_any_mesh(scene, run):
    return at.solve(scene, replace(run, mesh=8) if isinstance(run.mesh, dict) else run)


def throws_divergence(scene, run):
    answer = at.solve(scene, run)
    if not answer.status.ok:
        raise FloatingPointError(answer.status.message)
    return answer


def forgets_its_history(scene, run):
    answer = at.solve(scene, run)
    empty = {"t": answer.t[:0], "fields": {}, "energy": at.Energy.unknown(0)}
    return answer if answer.status.ok else replace(answer, **empty)


def steps_differently(scene, run):
    return (solving(stiffer(1.2)) if run.integrator == "zhai" else at.solve)(scene, run)


def steps_of_low_order(scene, run):
    """What is asked of high order is done by generalized-α."""
    return at.solve(
        scene, replace(run, integrator="generalized-alpha") if run.integrator == "esdirk" else run
    )


def rests_under_more(scene, mesh, **options):
    more = 1.0 + 1.6 / mesh  # less and less, but too much still with 32 elements
    heavier = each(
        "loads",
        lambda x: replace(x, value=tuple(more * np.array(x.value))) if isinstance(x, at.Force) else x,
    )
    return replace(at.solve_static(heavier(scene), mesh=mesh, **options), scene=scene)


def never_gains(scene, mesh, **options):
    return at.solve_static(stiffer(1.005)(scene), mesh=32, **options)


def begins_half_loaded(scene, **options):
    answer = at.solve_static(scene, **options)
    return replace(answer, t=0.5 + 0.5 * answer.t)


def calls_all_stable(scene, **options):
    return replace(at.solve_static(scene, **options), status=at.Status())


IS_TOO_STIFF = solving(stiffer(1.2))
#: Solver, rule that it breaks; offer and statics, where they are other ones.
BREAKERS = [
    (needs_more, "signature"),
    (answering(lambda a: replace(a, cost=at.Cost())), "answer"),
    (drops_the_end, "sampling"),
    (begins_elsewhere, "beginning"),
    (moved(lambda p: p[:1] + 1.0002 * (p - p[:1])), "units: m, s"),  # counts in feet
    (IS_TOO_STIFF, "units: Pa, kg"),
    (answering(lambda a: replace(a, energy=replace(a.energy, kinetic=2.0 * a.energy.kinetic))), "energy"),
    (prefers_a_direction, "rigid motion"),
    (is_never_the_same, "determinism"),
    (changes_its_input, "input"),
    (takes_any_mesh, "bad options"),
    (answering(lambda a: replace(a, status=at.Status())), "failure"),
    (throws_divergence, "failure"),
    (forgets_its_history, "failure"),
    (sound, "limits", Offer(lacks={"joints"})),
    (steps_differently, "integrators"),
    (steps_of_low_order, "high order", Offer(extras={"esdirk"})),
    (moved(lambda p: p + 1e-3, only="second"), "joints"),
    (moved(lambda p: p + 1e-3, only="right"), "branches"),
    (moved(lambda p: p + 1e-3, only="last"), "loops"),
    (solving(each("joints", lambda j: replace(j, angle=None) if isinstance(j, Clamp) else j)), "drives"),
    (solving(each("loads", lambda x: replace(x, value=x.value(0.2)) if callable(x.value) else x)), "varying loads"),
    (solving(lambda scene: replace(scene, connectors=())), "features"),
    (sound, "statics", OWN, rests_under_more),
    (sound, "convergence", OWN, never_gains),
    (sound, "load factors", OWN, begins_half_loaded),
    (sound, "stability", OWN, calls_all_stable),
]  # fmt: skip


@pytest.fixture
def plugged(monkeypatch):
    """Put a solver, its statics and its offer into a module of its own, registered as "broken"."""
    load = registry.load

    def plug(solve, static, offer):
        module = ModuleType("broken_solver")
        module.OFFER, module.solve_static = offer, static
        solve_there = type(solve)(solve.__code__, solve.__globals__, solve.__name__, None, solve.__closure__)
        solve_there.__module__ = module.__name__
        monkeypatch.setitem(sys.modules, module.__name__, module)
        monkeypatch.setattr(registry, "load", lambda name: solve_there if name == "broken" else load(name))

    return plug


@pytest.mark.parametrize("breaker", BREAKERS, ids=lambda breaker: breaker[1])
def test_a_broken_solver_fails_the_rule_it_breaks(plugged, breaker):
    solve, rule, offer, static = *breaker, *(OWN, rest)[len(breaker) - 2 :]
    plugged(solve, static, offer)
    findings = list(conform("broken"))
    too_stiff = ["features"] if solve is IS_TOO_STIFF else []  # springs and loads do less to it
    assert [f.rule for f in findings if f.verdict == BROKEN] == [rule, *too_stiff]
    assert not passed(findings)
    not_run = sum(f.verdict == NOT_RUN for f in findings)
    assert not_run == (len(RULES) - 1 if rule == "signature" else 0)


@pytest.mark.parametrize("feature", sorted(ACTING))
def test_a_feature_that_is_ignored_is_named(feature):
    """A solver that claims all and drops one."""
    changed = ACTING[feature](cantilever())
    without = WITHOUT.get(feature, lambda scene: scene)(cantilever())
    broken = Subject("broken", lambda scene, run: at.solve(without if scene == changed else scene, run))
    with pytest.raises(BrokenRule, match=feature):
        features_act(broken)


def test_every_rule_has_a_solver_that_breaks_it():
    assert {rule for _, rule, *_ in BREAKERS} == {rule.name for rule in RULES}


def test_a_missing_solve_static_is_broken_until_it_is_declared(plugged):
    plugged(sound, None, OWN)
    found = {f.rule: f for f in conform("broken")}
    assert found["signature"].verdict == BROKEN
    assert "no solve_static beside it" in found["signature"].measured
    plugged(sound, None, Offer(lacks=OWN.lacks | {"statics"}))
    found = {f.rule: f for f in conform("broken")}
    lacking = {r for r, f in found.items() if f.verdict == NOT_OFFERED}
    assert lacking == {"high order", "statics", "convergence", "load factors", "stability"}
    assert passed(found.values())


def test_nonsense_breaks_rules_and_no_more(plugged):
    plugged(lambda scene, run: None, rest, Offer())
    verdicts = {f.rule: f for f in conform("broken")}
    assert verdicts["answer"].measured == "the answer is a NoneType, no anctmm.Solution"
    assert verdicts["statics"].verdict == HOLDS


def test_a_solver_that_cannot_be_loaded_has_one_row(monkeypatch):
    def load(name):
        raise PluginError(f"solver {name!r} of package p cannot be loaded: ImportError: x")

    monkeypatch.setattr(registry, "load", load)
    (finding,) = conform("theirs")
    assert (finding.rule, finding.verdict) == ("loads", BROKEN)
    assert "'theirs' of package p" in finding.measured


def test_every_feature_is_demanded_by_some_scene():
    # joints of a user's own are shown by test_own_joints.py
    assert FEATURES.keys() - {*DEMANDS, *RUNS} == {"energy", "stability", "own-joints"}


@pytest.mark.parametrize("name", [*OURS, "opensees", "pyelastica"])
def test_solvers_refuse_what_they_lack(name):
    subject = Subject(name, registry.load(name))
    refused = refuses_what_it_lacks(subject)
    assert [lack for lack in subject.offer.lacks if lack in {*DEMANDS, *RUNS} and lack not in refused] == []
    assert [lack for lack in subject.offer.lacks if " + " in lack and lack not in refused] == []


def test_a_combination_that_is_answered_breaks_the_rule(plugged):
    plugged(sound, rest, Offer(lacks=OWN.lacks | {"drives + varying-loads"}))
    with pytest.raises(
        BrokenRule, match=r"lacks 'drives \+ varying-loads' \(clamps that turn, loads that vary"
    ):
        refuses_what_it_lacks(Subject("broken", registry.load("broken")))
