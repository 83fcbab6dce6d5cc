"""Slopes of laws, by which modes and statics linearise them: those of sharp laws, too."""

from math import cos, exp, pi, sin, sqrt, tanh

import pytest

import anctmm as at

STIFFNESS, RATIO = 1e4, 0.1
SHARP = pytest.mark.xfail(strict=True, reason="slopes of sharp laws are found over one fixed distance")
CROSSOVERS = [1e-2, 1e-3, pytest.param(1e-4, marks=SHARP), pytest.param(1e-8, marks=SHARP)]


def held(kind, law):
    """A mass of 1 kg on a guide, or a wheel of 1 kg m² on a pin, and a connector to the ground."""
    if kind == "spring":
        bodies, joints = [at.PointMass("body", 1.0, (1.0, 0.0))], [at.Slider("body.center", (1, 0))]
        connector = at.Spring("body.center", (0.0, 0.0), law=law)
    else:
        bodies, joints = [at.RigidBody("body", 1.0, 1.0, (0.0, 0.0))], [at.Pin("body.center")]
        connector = at.RotationalSpring("body.center", law=law)
    return at.Scene("held", bodies, joints, connectors=[connector])


@pytest.mark.parametrize("small", CROSSOVERS)
@pytest.mark.parametrize("kind", ["spring", "rotational spring"])
def test_smoothed_friction_damps_by_its_slope_at_rest(kind, small):
    friction = RATIO * 2.0 * sqrt(STIFFNESS) * small

    def law(elongation, rate, t):
        return STIFFNESS * elongation + friction * tanh(rate / small)

    found = at.modes(held(kind, law), count=1)
    assert found.damping[0] == pytest.approx(RATIO, rel=1e-6)
    assert 2 * pi * found.frequencies[0] == pytest.approx(sqrt(STIFFNESS * (1 - RATIO**2)), rel=1e-6)


@pytest.mark.parametrize("small", CROSSOVERS)
@pytest.mark.parametrize("kind", ["spring", "rotational spring"])
def test_a_spring_that_soon_gives_way_vibrates_by_its_slope_at_rest(kind, small):
    force = STIFFNESS * small

    def law(elongation, rate, t):
        return force * tanh(elongation / small)

    assert 2 * pi * at.modes(held(kind, law), count=1).frequencies[0] == pytest.approx(
        sqrt(STIFFNESS), rel=1e-6
    )


#: Laws of a stretch x, at rest, their slopes by x there, and how exact they must be.
LAWS = {
    "smooth": (lambda x, v, t: exp(x) - 1.0 + 3.0 * sin(x), 4.0, 1e-9),
    "with a preload that costs digits": (lambda x, v, t: 1e6 + 50.0 * x, 50.0, 1e-4),
    "a contact nearly closed": (lambda x, v, t: 40.0 * max(x + 1e-7, 0.0), 40.0, 1e-9),
    "a contact nearly open": (lambda x, v, t: 40.0 * max(x - 1e-7, 0.0) + x, 1.0, 1e-9),
    "a wave of a small length": (lambda x, v, t: 1e-4 * sin(1e5 * x) + cos(0.0 * x) - 1.0, 10.0, 1e-7),
}


SOFT = ("smooth", "with a preload that costs digits")


@pytest.mark.parametrize("name", [n if n in SOFT else pytest.param(n, marks=SHARP) for n in LAWS])
def test_slopes_of_laws_of_many_kinds(name):
    law, slope, exact = LAWS[name]
    square = (2 * pi * at.modes(held("spring", law), count=1).frequencies[0]) ** 2
    assert square == pytest.approx(slope, rel=exact)


@SHARP
def test_a_drag_does_not_damp_at_rest():
    """Its slope 2 c |v| is 0 there: no distance shows it exactly, and the smallest is the best."""
    found = at.modes(held("spring", lambda x, v, t: 100.0 * x + 10.0 * abs(v) * v), count=1)
    assert abs(found.damping[0]) < 1e-9
