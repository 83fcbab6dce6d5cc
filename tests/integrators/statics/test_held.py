"""Rigid bodies that joints leave no motion, and such that joints leave one: what statics call them."""

from itertools import pairwise
from math import cos, sin

import numpy as np
import pytest

import anctmm as at

G = (0.5, -9.0)


def plate():
    return at.RigidBody("b", 1.0, 0.1, (0, 0), points={"a": (-0.3, 0), "c": (0.5, 0), "d": (0.3, 0.2)})


SUPPORTS = {
    "simply": [at.Pin("b.a"), at.Slider("b.c", (1, 0))],
    "clamped": [at.Clamp("b.a")],
    "on three guides": [at.Slider("b.a", (1, 0)), at.Slider("b.c", (0, 1)), at.Slider("b.d", (1, 0))],
}
#: Of the first joint, by moments about a, or about the centre.
REACTIONS = {
    "simply": (-1.5, 11.0 - 4.1 / 0.8, 0.0),
    "clamped": (-1.5, 11.0, 4.1),
    "on three guides": (0.0, (11.0 - 0.8 / 0.3) / 2.0, 0.0),
}


@pytest.mark.parametrize("name", SUPPORTS)
def test_a_body_that_is_held_has_its_reactions_and_a_good_status(name):
    """The tangent of no motion was called singular, or divided by zero; rounding was called energy from nowhere."""
    scene = at.Scene("held", [plate()], SUPPORTS[name], [at.Force("b.d", (1.0, -2.0))], gravity=G)
    rest = at.solve_static(scene)
    assert rest.status.ok
    assert rest.stable.all()
    runs = [at.solve(scene, dt=2e-3, t_end=0.1, integrator=one) for one in ("generalized-alpha", "zhai")]
    for found in (rest, *runs):
        assert found.status.ok
        np.testing.assert_allclose(found.reaction(scene.joints[0])[-1], REACTIONS[name], atol=1e-9)


def test_constraints_that_repeat_each_other_leave_a_motion():
    """A third crank of a parallelogram takes no freedom: as many constraints as unknowns, and one motion."""
    cranks = [
        at.RigidBody(f"k{i}", 1.0, 0.1, (i, 0.5), points={"o": (i, 0.0), "e": (i, 1.0)}) for i in range(3)
    ]
    rod = at.RigidBody("rod", 1.0, 0.1, (1, 1), points={f"p{i}": (i, 1.0) for i in range(3)})
    joints = [at.Pin(f"k{i}.o") for i in range(3)] + [at.Pin(f"k{i}.e", f"rod.p{i}") for i in range(3)]
    rest = at.solve_static(at.Scene("parallel", [*cranks, rod], joints, gravity=(0, -1)))
    assert rest.status == "unstable"  # and would be stable were it held


def linkage(angle, number, gravity=(0, 0)):
    """A pendulum, or a four-bar that is no parallelogram, of rigid bars, turned by an angle."""
    corners = [(0, 0), (0, 0.2), (0.5, 0.3), (0.45, 0)]
    turned = [(cos(angle) * x - sin(angle) * y, sin(angle) * x + cos(angle) * y) for x, y in corners]
    bars = [
        at.RigidBody(f"k{i}", 0.5, 3e-3, np.mean([a, b], axis=0), points={"a": a, "b": b})
        for i, (a, b) in enumerate(pairwise(turned[: number + 1]))
    ]
    hinges = [at.Pin(f"k{i}.b", f"k{i + 1}.a") for i in range(number - 1)]
    last = [at.Pin(f"k{number - 1}.b")] if number == 3 else []
    return at.Scene("linkage", bars, [at.Pin("k0.a"), *hinges, *last], gravity=gravity)


@pytest.mark.parametrize("number", [1, 3])
@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_a_linkage_that_nothing_acts_on_is_a_mechanism_however_it_lies(angle, number):
    """It was called stable, unstable or singular by the angle it is drawn at: by rounding."""
    rest = at.solve_static(linkage(angle, number))
    assert rest.status == "singular"
    assert not rest.stable.any()
    hanging = at.solve_static(linkage(angle, 1, gravity=(9.81 * sin(-angle), 9.81 * cos(angle))))
    assert hanging.status.ok  # its weight pulls along the bar, away from the hinge
    assert hanging.stable.tolist() == [False, True]
