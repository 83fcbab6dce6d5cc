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


@pytest.mark.parametrize("name", OURS)
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
    assert lacking == {"integrators", "high order", "stability"}


def test_what_a_peer_lacks_is_shown_and_not_skipped():
    pytest.importorskip("elastica", reason="PyElastica (extra `peers`) is not installed")
    found = {f.rule: f for f in conform("pyelastica")}
    assert passed(found.values())
    lacking = {rule for rule, f in found.items() if f.verdict == NOT_OFFERED}
    assert lacking == {
        "integrators", "high order", "joints", "branches", "loops", "drives", "varying loads", "stability",
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


def stiffer(scene, factor):
    bodies = [
        replace(b, material=replace(b.material, E=factor * b.material.E)) if isinstance(b, at.Beam) else b
        for b in scene.bodies
    ]
    return replace(scene, bodies=bodies)


def needs_more(scene, run, magic):
    return at.solve(scene, run)


def declines(scene, run):
    return nothing("declines", scene, run, at.Status("unsupported", "no beams today"))


def calls_all_stable(scene, **options):
    answer = at.solve_static(scene, **options)
    return replace(answer, status=at.Status())


def costs_nothing(scene, run):
    return replace(at.solve(scene, run), cost=at.Cost())


def drops_the_end(scene, run):
    answer = at.solve(scene, run)
    n = len(answer.t) - (run.steps % run.stride != 0)
    cut = positions(answer, lambda p: p[:n])
    return replace(cut, t=answer.t[:n], energy=at.Energy(*(e[:n] for e in vars(answer.energy).values())))


def begins_elsewhere(scene, run):
    along = np.array([np.cos(scene.bodies[0].angle), np.sin(scene.bodies[0].angle)])
    return positions(at.solve(scene, run), lambda p: p + 1e-3 * along)


def counts_in_feet(scene, run):
    return positions(at.solve(scene, run), lambda p: p[:1] + 1.0002 * (p - p[:1]))


def is_too_stiff(scene, run):
    return replace(at.solve(stiffer(scene, 1.2), run), scene=scene)


def makes_energy(scene, run):
    answer = at.solve(scene, run)
    return replace(answer, energy=replace(answer.energy, kinetic=2.0 * answer.energy.kinetic))


def prefers_a_direction(scene, run):
    factor = 1.0 + 0.01 * np.sin(2.0 * scene.bodies[0].angle)
    return replace(at.solve(stiffer(scene, factor), run), scene=scene)


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


def hides_divergence(scene, run):
    return replace(at.solve(scene, run), status=at.Status())


def throws_divergence(scene, run):
    answer = at.solve(scene, run)
    if not answer.status.ok:
        raise FloatingPointError(answer.status.message)
    return answer


def forgets_its_history(scene, run):
    answer = at.solve(scene, run)
    if answer.status.ok:
        return answer
    return replace(answer, t=answer.t[:0], fields={}, energy=at.Energy.unknown(0))


def steps_differently(scene, run):
    answer = at.solve(stiffer(scene, 1.2) if run.integrator == "zhai" else scene, run)
    return replace(answer, scene=scene)


def steps_of_low_order(scene, run):
    """What is asked of high order is done by generalized-α."""
    asked = replace(run, integrator="generalized-alpha") if run.integrator == "esdirk" else run
    return sound(scene, asked)


def opens_joints(scene, run):
    return positions(at.solve(scene, run), lambda p: p + 1e-3, only="second")


def opens_branches(scene, run):
    return positions(at.solve(scene, run), lambda p: p + 1e-3, only="right")


def opens_loops(scene, run):
    return positions(at.solve(scene, run), lambda p: p + 1e-3, only="last")


def ignores_drives(scene, run):
    fixed = [replace(j, angle=None) if isinstance(j, Clamp) else j for j in scene.joints]
    return replace(at.solve(replace(scene, joints=fixed), run), scene=scene)


def freezes_loads(scene, run):
    loads = [replace(x, value=x.value(0.2)) if callable(x.value) else x for x in scene.loads]
    return replace(at.solve(replace(scene, loads=loads), run), scene=scene)


def ignores_connectors(scene, run):
    return replace(at.solve(replace(scene, connectors=()), run), scene=scene)


def sound(scene, run):
    return at.solve(scene, run)


def rest(scene, **options):
    return at.solve_static(scene, **options)


def rests_under_more(scene, mesh, **options):
    more = 1.0 + 1.6 / mesh  # less and less, but too much still with 32 elements
    loads = [
        replace(x, value=tuple(more * np.array(x.value))) if isinstance(x, at.Force) else x
        for x in scene.loads
    ]
    return replace(at.solve_static(replace(scene, loads=loads), mesh=mesh, **options), scene=scene)


def never_gains(scene, mesh, **options):
    return at.solve_static(stiffer(scene, 1.005), mesh=32, **options)


def begins_half_loaded(scene, **options):
    answer = at.solve_static(scene, **options)
    return replace(answer, t=0.5 + 0.5 * answer.t)


BREAKERS = [
    (needs_more, rest, OWN, "signature"),
    (costs_nothing, rest, OWN, "answer"),
    (drops_the_end, rest, OWN, "sampling"),
    (begins_elsewhere, rest, OWN, "beginning"),
    (counts_in_feet, rest, OWN, "units: m, s"),
    (is_too_stiff, rest, OWN, "units: Pa, kg"),
    (makes_energy, rest, OWN, "energy"),
    (prefers_a_direction, rest, OWN, "rigid motion"),
    (is_never_the_same, rest, OWN, "determinism"),
    (changes_its_input, rest, OWN, "input"),
    (takes_any_mesh, rest, OWN, "bad options"),
    (hides_divergence, rest, OWN, "failure"),
    (throws_divergence, rest, OWN, "failure"),
    (forgets_its_history, rest, OWN, "failure"),
    (sound, rest, Offer(lacks={"joints"}), "limits"),
    (steps_differently, rest, OWN, "integrators"),
    (steps_of_low_order, rest, Offer(extras={"esdirk"}), "high order"),
    (opens_joints, rest, OWN, "joints"),
    (opens_branches, rest, OWN, "branches"),
    (opens_loops, rest, OWN, "loops"),
    (ignores_drives, rest, OWN, "drives"),
    (freezes_loads, rest, OWN, "varying loads"),
    (ignores_connectors, rest, OWN, "features"),
    (sound, rests_under_more, OWN, "statics"),
    (sound, never_gains, OWN, "convergence"),
    (sound, begins_half_loaded, OWN, "load factors"),
    (sound, calls_all_stable, OWN, "stability"),
]  # fmt: skip


@pytest.fixture
def plugged(monkeypatch):
    """Put a solver, its statics and its offer into a module of its own, registered as "broken"."""
    load = registry.load

    def plug(solve, static, offer):
        module = ModuleType("broken_solver")
        module.OFFER, module.solve_static = offer, static
        solve_there = type(solve)(solve.__code__, solve.__globals__, solve.__name__)
        solve_there.__module__ = module.__name__
        monkeypatch.setitem(sys.modules, module.__name__, module)
        monkeypatch.setattr(registry, "load", lambda name: solve_there if name == "broken" else load(name))

    return plug


@pytest.mark.parametrize(
    ("solve", "static", "offer", "rule"), BREAKERS, ids=lambda b: getattr(b, "__name__", None)
)
def test_a_broken_solver_fails_the_rule_it_breaks(plugged, solve, static, offer, rule):
    plugged(solve, static, offer)
    findings = list(conform("broken"))
    too_stiff = ["features"] if solve is is_too_stiff else []  # springs and loads do less to it
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
    assert {rule for *_, rule in BREAKERS} == {rule.name for rule in RULES}


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
    assert FEATURES.keys() - {*DEMANDS, *RUNS} == {"energy", "stability"}


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
