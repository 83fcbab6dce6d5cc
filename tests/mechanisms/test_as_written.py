"""Beams are cut at joints between their ends; messages name what the user wrote, and none of the parts."""

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import PropertyError

SECTION, MATERIAL = at.Rectangle(0.02, 0.01), at.Material(E=1e8, density=1000.0)
B = at.Beam("b", (0.0, 0.0), (1.0, 0.0), SECTION, MATERIAL)
X = at.Beam("x", (0.25, 0.0), (0.25, 0.4), SECTION, MATERIAL)
INSIDE = ("b", 0.25)
JOINTS = [at.Pin("b.start"), at.Pin(INSIDE, "x.start")]
FIXED = {"mesh": 4, "dt": 0.01, "t_end": 0.05}
STEPS = {
    "fixed": FIXED,
    "tolerance": {
        "mesh": 4,
        "tolerance": 1e-2,
        "t_end": 0.05,
        "output_dt": 0.01,
        "integrator": "generalized-alpha",
    },
}


def failing(width):
    """A history that raises after 0.02 s."""

    def history(t):
        if (np.asarray(t) > 0.02).any():
            raise ZeroDivisionError
        return tuple(np.zeros_like(t) for _ in range(width))

    return history


def scene(joints=JOINTS, loads=(), connectors=(), bodies=(B, X)):
    return at.Scene("s", bodies, joints, loads, (0.0, -9.81), connectors)


FAILING = {
    "clamp ('b', 0.25) angle": scene([at.Clamp(INSIDE, angle=failing(3))]),
    "slider ('b', 0.25) position": scene([at.Slider(INSIDE, position=failing(3))]),
    "weld of (('b', 0.25), 'x.start') angle": scene(
        [at.Clamp("b.start"), at.Weld(INSIDE, "x.start", angle=failing(3))]
    ),
    "force on ('b', 0.25)": scene(loads=[at.Force(INSIDE, failing(2))]),
    "force on ('b', 0.3)": scene(loads=[at.Force(("b", 0.3), failing(2))]),
    "line load on 'b'": scene(loads=[at.LineLoad("b", failing(2))]),
    "spring from ('b', 0.25) to the point (0.3, 1.0) length": scene(
        connectors=[at.Spring(INSIDE, (0.3, 1.0), stiffness=1.0, length=failing(2))]
    ),
    "rotational spring from 'b.end' to 'x.start' angle": scene(
        connectors=[at.RotationalSpring("b.end", "x.start", stiffness=1.0, angle=failing(2))]
    ),
}


@pytest.mark.parametrize("how", STEPS)
@pytest.mark.parametrize("what", FAILING)
def test_a_history_that_fails(how, what):
    with pytest.raises(PropertyError) as told:
        at.solve(FAILING[what], **STEPS[how])
    assert str(told.value).startswith(f"{what}: the history gave no")
