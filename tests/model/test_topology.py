"""Junctions found from the joints, and joints that do not fit each other."""

from itertools import permutations
from math import cos, sin

import pytest
from samples import beam

from anctmm.model.drives import Quintic
from anctmm.model.scene import Clamp, Pin, Scene, Weld
from anctmm.model.topology import Junction, junctions_of

O = (0.0, 0.0)  # noqa: E741
DRIVE = Quintic(1.0, 1.0)


def star(*joints, arms=6, velocity=None):
    """Bodies "a", "b", … that start at the origin, in as many directions."""
    bodies = [beam(name, O, (cos(k), sin(k)), velocity=velocity) for k, name in enumerate("abcdef"[:arms])]
    return Scene("star", bodies, joints)


def starts(*names):
    return tuple(f"{name}.start" for name in names)


def clamp_of(scene):
    """The junction of the first body's start, its ends by the names of the bodies."""
    hub = junctions_of(scene)[0]
    assert all(side == 0 for _, side in hub.ends)
    return ["".join(name for name, _ in group) for group in hub.groups], hub.grounded, list(hub.clamps)


CLAMP, DRIVEN = Clamp("b.start"), Clamp("c.start", DRIVE)
HUBS = {
    "free": ([], (["a"], False, [None])),
    "pin": ([Pin(*starts(*"abc"))], (["a", "b", "c"], False, [None] * 3)),
    "weld": ([Weld(*starts(*"fca"))], (["acf"], False, [None])),
    "two welded, a third hinged": (
        [Weld(*starts(*"ab")), Pin(*starts(*"bc"))],
        (["ab", "c"], False, [None] * 2),
    ),
    "two pairs hinged": (
        [Weld(*starts(*"ac")), Pin(*starts(*"ad")), Weld(*starts(*"db"))],
        (["ac", "bd"], False, [None] * 2),
    ),
    "welded through another": ([Weld(*starts(*"ab")), Weld(*starts(*"bc"))], (["abc"], False, [None])),
    "a clamp": ([CLAMP, Weld(*starts(*"ab")), Pin(*starts(*"ac"))], (["ab", "c"], True, [CLAMP, None])),
    "a driven clamp": ([Pin(*starts(*"ac")), DRIVEN], (["a", "c"], True, [None, DRIVEN])),
    "six": (
        [Weld(*starts(*"abc")), Pin(*starts(*"cdef"), grounded=True)],
        (["abc", "d", "e", "f"], True, [None] * 4),
    ),
}


@pytest.mark.parametrize("name", HUBS)
def test_junction_follows_from_its_joints_in_any_order(name):
    joints, expected = HUBS[name]
    for order in permutations(joints):
        assert clamp_of(star(*order)) == expected


def test_every_end_is_in_one_junction_in_the_order_of_the_bodies():
    s = star(Pin(*starts("b", "d")), Weld(*starts("d", "c")), arms=4)
    found = junctions_of(s)
    assert [j.ends[0] for j in found] == [("a", 0), ("a", 1), ("b", 0), ("b", 1), ("c", 1), ("d", 1)]
    assert found[0] == Junction(((("a", 0),),), False, (None,))
    assert found[2] == Junction(((("b", 0),), (("c", 0), ("d", 0))), False, (None, None))
    ends = [end for junction in found for end in junction.ends]
    assert sorted(ends) == [(b.name, side) for b in s.bodies for side in (0, 1)]
    again = Scene(s.name, s.bodies, s.joints[::-1])
    assert junctions_of(again) == found
