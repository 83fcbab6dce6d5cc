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


def _broken(x):
    raise ZeroDivisionError


@pytest.mark.parametrize(
    ("velocity", "at_x", "told"),
    [
        (_broken, 0.35, "beam 'b' velocity, a function, at 0.35 raises ZeroDivisionError"),
        (
            lambda x: (0.0, np.nan),
            0.35,
            "beam 'b' velocity at fraction 0.35 (m/s), y is nan; a finite number",
        ),
        (lambda x: None, 0.35, "beam 'b' velocity at fraction 0.35 (m/s) is None; a pair"),
        (None, 0.35, "beam 'b' velocity has no slope at fraction 0.35"),
    ],
    ids=["raises", "no number", "no pair", "no slope"],
)
def test_an_initial_velocity_is_told_by_the_beam_where_the_user_gave_it(velocity, at_x, told):
    """The joint at a quarter divides the beam: neither the name of the part nor its fractions are the user's."""

    def given(x):
        if velocity is not None and abs(x - at_x) < 1e-3:
            return velocity(x)
        return 0.0, 0.0 if velocity is not None else (-2.0 if x < at_x else 1.0) * abs(x - at_x) ** 0.5

    beam = at.Beam("b", (0.0, 0.0), (1.0, 0.0), SECTION, MATERIAL, velocity=given)
    guided = at.Scene("s", [beam], [at.Slider(INSIDE, (0.0, 1.0))])
    with pytest.raises(PropertyError) as error:
        at.solve(guided, mesh=20, dt=0.01, t_end=0.01)
    assert str(error.value).startswith(told)
    assert "from 0.25" not in str(error.value)
    assert str(error.value).count("is needed") == 1
