"""The conformance test: our solvers pass it, and each broken solver fails the one rule it breaks."""

import sys
from dataclasses import replace
from itertools import count
from types import ModuleType

import numpy as np
import pytest
from rich.console import Console

import anctmm as at
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
    show,
)
from studies.conformance.rules import RULES, BrokenRule, Subject, features_act, refuses_what_it_lacks
from studies.conformance.scenes import ACTING, DEMANDS, RUNS, WITHOUT, cantilever, same

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


@pytest.mark.parametrize("name", ["exudyn-cable", "exudyn-reissner"])
def test_what_is_not_installed_is_said_and_no_rule_is_broken(name, monkeypatch):
    monkeypatch.setitem(sys.modules, "exudyn", None)
    findings = list(conform(name))
    assert [f.verdict for f in findings] == [HOLDS, NOT_INSTALLED, *[NOT_RUN] * len(RULES)]
    assert "exudyn is not installed; pip install 'anctmm[peers]'" in findings[1].measured
    assert exit_code(findings) == 4
    console = Console(record=True, width=200)
    show(name, findings, console)
    assert f"1 holds, 1 not installed, {len(RULES)} not run" in console.export_text()


@pytest.mark.parametrize(
    ("name", "lacking"),
    [
        ("opensees", {"energy", "integrators", "high order", "stability"}),
        ("pyelastica", {"energy", "integrators", "high order", "joints", "stability"}),
    ],
)
def test_other_codes_conform_in_what_they_offer(name, lacking):
    findings = list(conform(name))
    if absent := [f.measured for f in findings if f.verdict == NOT_INSTALLED]:
        pytest.skip(absent[0])
    assert exit_code(findings) == 0
    assert {f.rule for f in findings if f.verdict == NOT_OFFERED} == lacking


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


def stiffer(factor):
    """A change of all beams of a scene."""

    def change(b):
        material = replace(b.material, E=factor * b.material.E) if isinstance(b, at.Beam) else None
        return replace(b, material=material) if material else b

    return lambda scene: replace(scene, bodies=[change(b) for b in scene.bodies])


def needs_more(scene, run, magic):
    return at.solve(scene, run)


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


def takes_any_mesh(scene, run):
    return at.solve(scene, replace(run, mesh=8) if isinstance(run.mesh, dict) else run)


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
    loads = [replace(x, value=more * np.array(x.value)) for x in scene.loads]
    return replace(at.solve_static(replace(scene, loads=loads), mesh=mesh, **options), scene=scene)


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
    (drops_the_end, "answer"),
    (begins_elsewhere, "answer"),
    (moved(lambda p: p[:1] + 1.0002 * (p - p[:1])), "units: m, s"),  # counts in feet
    (IS_TOO_STIFF, "units: Pa, kg"),
    (answering(lambda a: replace(a, energy=replace(a.energy, kinetic=2.0 * a.energy.kinetic))), "energy"),
    (prefers_a_direction, "rigid motion"),
    (is_never_the_same, "determinism"),
    (takes_any_mesh, "bad options"),
    (answering(lambda a: replace(a, status=at.Status())), "failure"),
    (forgets_its_history, "failure"),
    (sound, "limits", Offer(lacks={"joints"})),
    (sound, "limits", Offer(lacks=OWN.lacks | {"drives + varying-loads"})),
    (steps_differently, "integrators"),
    (steps_of_low_order, "high order", Offer(extras={"esdirk"})),
    (moved(lambda p: p + 1e-3, only="second"), "joints"),
    (moved(lambda p: p + 1e-3, only="right"), "joints"),
    (moved(lambda p: p + 1e-3, only="last"), "joints"),
    (solving(lambda scene: replace(scene, connectors=())), "features"),
    (sound, "statics", OWN, rests_under_more),
    (sound, "statics", OWN, begins_half_loaded),
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
    assert exit_code(findings) == 1
    not_run = sum(f.verdict == NOT_RUN for f in findings)
    assert not_run == (len(RULES) - 1 if rule == "signature" else 0)


@pytest.mark.parametrize("feature", ACTING)
def test_a_feature_that_is_ignored_is_named(feature):
    """A solver that claims all and drops one."""
    changed = DEMANDS[feature](cantilever())
    without = WITHOUT.get(feature, same)(cantilever())
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
    assert lacking == {"high order", "statics", "stability"}
    assert exit_code(found.values()) == 0


def test_nonsense_breaks_rules_and_no_more(plugged):
    plugged(lambda scene, run: None, rest, Offer())
    verdicts = {f.rule: f for f in conform("broken")}
    assert verdicts["answer"].measured == "the answer is a NoneType, no anctmm.Solution"
    assert verdicts["statics"].verdict == HOLDS


def test_every_feature_is_demanded_by_some_scene():
    # joints of a user's own are shown by test_own_joints.py
    assert FEATURES.keys() - {*DEMANDS, *RUNS} == {"energy", "stability", "own-joints"}


@pytest.mark.parametrize("name", [*OURS, "opensees", "pyelastica"])
def test_solvers_refuse_what_they_lack(name):
    subject = Subject(name, registry.load(name))
    refused = refuses_what_it_lacks(subject)
    assert [lack for lack in subject.offer.lacks if lack in {*DEMANDS, *RUNS} and lack not in refused] == []
    assert [lack for lack in subject.offer.lacks if " + " in lack and lack not in refused] == []
