"""Values of two probes are told apart."""

import pytest

import anctmm as at
from studies.convergence.joint_forces import at_joints
from studies.engine.accuracy.digits import at_probes
from studies.engine.place_texts import place_texts

NEAR = 0.5, 0.5000001


def test_places_have_six_digits_where_these_tell_them_apart():
    third = 1.0 / 3.0
    assert place_texts(["b.end", ("b", third), ("c", third)]) == {
        "b.end": "b.end",
        ("b", third): "b at 0.333333",
        ("c", third): "c at 0.333333",
    }
    assert list(place_texts([("b", x) for x in NEAR]).values()) == ["b at 0.5", "b at 0.5000001"]


@pytest.mark.interpreted
def test_values_and_forces_of_near_places_have_names_of_their_own():
    """Both were those of "bar at 0.5"."""
    bar = at.Beam("bar", (0, 0), (1, 0), at.Circle(0.02), at.Material(E=1e7, density=1e3))
    springs = [at.Spring(("bar", x), (0.5, 1.0), stiffness=1.0) for x in NEAR]
    scene = at.Scene("bar", [bar], [at.Pin("bar.start")], connectors=springs)
    case = at.Case(scene, [("bar", x) for x in NEAR], t_end=0.01)
    found = at.solve(scene, mesh={"bar": 1}, element="rigid", dt=0.005, t_end=0.01)
    assert found.status.ok
    rows = [
        (value.probe, value.quantity) for read in (at_probes, at_joints) for value, _ in read(found, case)
    ]
    assert len(set(rows)) == len(rows)
    assert {name for name, _ in rows} >= {"bar at 0.5", "bar at 0.5000001", "spring bar at 0.5000001"}
