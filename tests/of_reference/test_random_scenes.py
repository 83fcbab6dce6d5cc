"""Random scenes: no answer is "ok" and wrong. Graphs and mechanisms against the global DAE, graphs against Exudyn.

A thousand are tried by `python tests/helpers/scenes/random_against.py`.
"""

import pytest
from random_against import AGREE, WRONG, judge
from random_graphs import asked_graph

from anctmm.model.topology import junctions_of


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("peer", "count", "kind"),
    [
        ("global-dae", 60, "graphs"),
        ("global-dae", 40, "mechanisms"),
        ("exudyn-cable", 20, "graphs"),
    ],
)
def test_no_answer_is_ok_and_wrong(peer, count, kind):
    found = [judge(seed, peer, kind) for seed in range(count)]
    assert [verdict for verdict in found if verdict.verdict == WRONG] == []
    locked = kind == "mechanisms"  # many mechanisms that are drawn lock, and say so
    assert sum(verdict.verdict == AGREE for verdict in found) >= (0.5 if locked else 0.75) * count, found


def test_graphs_are_drawn_of_every_kind():
    drawn = [asked_graph(seed) for seed in range(60)]
    junctions = [j for a in drawn for j in junctions_of(a.scene)]
    joints = [j for a in drawn for j in a.scene.joints]
    loads = [load for a in drawn for load in a.scene.loads]
    bodies = [b for a in drawn for b in a.scene.bodies]
    assert {type(j).__name__ for j in joints} == {"Pin", "Weld", "Clamp"}
    assert {(type(load).__name__, callable(load.value)) for load in loads} == {
        (kind, varies) for kind in ("Force", "Torque") for varies in (True, False)
    }
    assert any(getattr(j, "angle", None) for j in joints)
    assert any(b.velocity for b in bodies)
    assert any(b.material.damping for b in bodies)
    assert any(b.material.poisson for b in bodies)
    assert any(len(j.ends) > 2 for j in junctions)
    assert {a.run.integrator for a in drawn} == {"zhai", "generalized-alpha"}
    assert any(a.run.tolerance for a in drawn)
    assert any(len(a.scene.bodies) + 1 > len(junctions_of(a.scene)) for a in drawn)
    assert {kind for a in drawn for kind in a.run.element.values()} == {"cable", "shear"}
    by_exudyn = [asked_graph(seed, "exudyn-cable") for seed in range(9)]
    assert {kind for a in by_exudyn for kind in a.run.element.values()} == {"cable"}
