"""Natural modes about motions: drives that stand still, that turn the scene steadily, and all others."""

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import DiscretisationError

STEEL = at.Material(E=2e11, density=1500.0)
TURN, MOVE, REST = 0.7, 0.1, 2.0


class Steady:
    """From rest to a constant rate."""

    def __init__(self, rate, duration=0.2):
        self.rate, self.duration = rate, duration

    def __call__(self, t):
        x = np.clip(np.asarray(t) / self.duration, 0.0, 1.0)
        grown = self.duration * (x**3 - 0.5 * x**4) + np.maximum(t - self.duration, 0.0)
        return (
            self.rate * grown,
            self.rate * (3 * x**2 - 2 * x**3),
            6 * self.rate / self.duration * (x - x**2),
        )


def nothing(t):
    return 0.0 * t, 0.0 * t, 0.0 * t


def beam(name, start, end, turn=0.0):
    ends = [complex(*place) * np.exp(1j * turn) for place in (start, end)]
    return at.Beam(name, *((z.real, z.imag) for z in ends), at.Rectangle(0.02, 0.02), STEEL)


def box(name, center, **points):
    return at.RigidBody(name, mass=1.0, inertia=0.02, center=center, points=points)


def clamped(law, turn, move, stretch="held"):
    return [beam("a", (0, 0), (1, 0))], [at.Clamp("a.start", angle=law, stretch=stretch)]


def clamped_box(law, turn, move):
    bodies = [box("h", (0, 0), p=(0.1, 0)), beam("a", (0.1, 0), (1, 0))]
    return bodies, [at.Clamp("h.center", angle=law), at.Weld("h.p", "a.start")]


def hinged(law, turn, move, stretch="held"):
    bodies = [beam("b", (-1, 0), (0, 0)), beam("a", (0, 0), (1, 0), turn)]
    return bodies, [at.Clamp("b.start"), at.Weld("b.end", "a.start", angle=law, stretch=stretch)]


def hinged_box(law, turn, move):
    bodies = [beam("b", (-1, 0), (0, 0)), box("h", (0.3 * np.cos(turn), 0.3 * np.sin(turn)), p=(0, 0))]
    return bodies, [at.Clamp("b.start"), at.Weld("b.end", "h.p", angle=law)]


def slid(law, turn, move):
    bodies = [beam("a", (move, 0), (1 + move, 0))]
    return bodies, [at.Slider("a.start", (1, 0), position=law), at.Slider("a.end", (1, 0))]


def guided(law, turn, move):
    return [beam("a", (0, move), (1, move))], [at.Prismatic("a.start", (0, 1), position=law)]


def guided_in_a_body(law, turn, move, kind=at.Prismatic):
    bodies = [beam("b", (-1, 0), (0, 0)), box("h", (0, 0), p=(0.1, 0)), box("k", (0.4 + move, 0))]
    guide = kind("k.center", (1, 0), body="h", position=law)
    return bodies, [at.Clamp("b.start"), at.Weld("b.end", "h.center"), guide]


def at_the_end(scene, end, spectral_radius=0.0, dt=0.02, **run):
    integrator = at.GeneralizedAlpha(spectral_radius=spectral_radius)
    found = at.solve(scene, mesh=2, dt=dt, t_end=end, integrator=integrator, **run)
    assert found.status.ok
    return found


#: By what is driven: the scene, and whether by an angle.
KINDS = {
    "clamp": (clamped, True),
    "clamp, stretch free": (lambda *a: clamped(*a, stretch="free"), True),
    "clamp of a box": (clamped_box, True),
    "hinge": (hinged, True),
    "hinge, stretch free": (lambda *a: hinged(*a, stretch="free"), True),
    "hinge of a box": (hinged_box, True),
    "slider": (slid, False),
    "prismatic": (guided, False),
    "prismatic in a box": (guided_in_a_body, False),
    "slider in a box": (lambda *a: guided_in_a_body(*a, kind=at.Slider), False),
}


@pytest.mark.parametrize("kind", KINDS)
def test_drives_that_have_come_to_rest_are_held_where_they_are(kind):
    """As of the same scene, built where its drive has led it."""
    make, turns = KINDS[kind]
    drive = at.Quintic(turn=TURN if turns else MOVE, duration=REST)
    moved = at.Scene("moved", *make(drive, 0.0, 0.0))
    there = at.Scene("there", *make(nothing, TURN, MOVE))
    found = at.modes(moved, mesh=2, count=4, about=at_the_end(moved, 1.5 * REST)).frequencies
    exact = at.modes(there, mesh=2, count=4).frequencies
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-4)
    if "in a box" in kind or "hinge" in kind:  # the place matters
        start = at.modes(moved, mesh=2, count=4).frequencies
        assert (np.abs(start - exact) > 1e-3 * exact)[exact > 1e-3].any()


@pytest.mark.parametrize("kind", ["clamp", "clamp, stretch free", "clamp of a box"])
def test_a_clamp_that_turns_steadily_spins_the_scene(kind):
    """A motion that has come near the steady spin has its modes, Coriolis and centrifugal forces included."""
    make, speed = KINDS[kind][0], 40.0
    scene = at.Scene("spun", *make(Steady(speed), 0.0, 0.0))
    about = at_the_end(scene, 1.2, dt=1e-3)
    found = at.modes(scene, mesh=2, count=4, about=about).frequencies
    exact = at.modes(at.Scene("steady", *make(None, 0.0, 0.0)), mesh=2, count=4, spin=speed).frequencies
    held = at.modes(scene, mesh=2, count=4).frequencies
    np.testing.assert_allclose(found, exact, rtol=5e-5)  # what is left of the start
    assert np.abs(held / exact - 1.0).max() > 1e-3


def with_what_stands_still():
    """Scenes whose drive moves steadily and that do not move with it, and what stands in the way."""
    arm = beam("a", (0, 0), (1, 0))
    spun, moved = at.Clamp("a.start", angle=Steady(2.0)), at.Slider("a.start", (1, 0), position=Steady(0.3))
    spring = at.Spring("a.end", (2.0, 0.5), stiffness=1.0)
    tip = box("t", (1, 0))
    yield at.Scene("s", [arm], [spun], gravity=(0, -9.81)), "gravity or loads"
    yield at.Scene("s", [arm], [spun], connectors=[spring]), "Spring.*stands still"
    yield at.Scene("s", [arm], [moved, at.Slider("a.end", (0, 1))]), "against each other or the ground"
    yield (
        at.Scene("s", [arm, tip], [spun, at.Weld("a.end", "t.center", angle=Steady(1.0))]),
        "against each other",
    )
    for make in (hinged, hinged_box, guided_in_a_body):
        yield at.Scene("s", *make(Steady(0.5), 0.0, 0.0)), "against each other"


@pytest.mark.parametrize(("scene", "words"), list(with_what_stands_still()))
def test_motions_without_modes_are_refused_by_name(scene, words):
    about = at_the_end(scene, 0.4)
    with pytest.raises(DiscretisationError, match=f"about ends at t = 0.4 s, where .* changes by .*{words}"):
        at.modes(scene, mesh=2, about=about)


@pytest.mark.parametrize("kind", KINDS)
def test_drives_that_speed_up_are_refused(kind):
    make, turns = KINDS[kind]
    scene = at.Scene("fast", *make(at.Quintic(turn=TURN if turns else MOVE, duration=REST), 0.0, 0.0))
    with pytest.raises(DiscretisationError, match=r"per second, so that.*no modes; end the motion"):
        at.modes(scene, mesh=2, about=at_the_end(scene, 0.8))
