"""Exudyn as the peer: its element is ours, its integrators are known, and it says what it cannot do."""

import sys
from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from anctmm.errors import DiscretisationError, MeshError, UnknownOptionError
from anctmm.model.bodies import distance
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld
from anctmm.model.sections import Circle, Rectangle
from anctmm.results.metrics import compare
from reference import exudyn_cable, exudyn_reissner

pytest.importorskip("exudyn")

L, EI, EA = 2.0, 1e9 * 0.01 * 0.005**3 / 12, 1e9 * 0.01 * 0.005
RHO_A, G = 2000.0 * 0.01 * 0.005, 9.81
QUADRATURES = ("full", "reduced", "lobatto")
PEERS = (exudyn_cable, exudyn_reissner)


def beam(name="beam", start=(0.0, 0.0), end=(L, 0.0), poisson=0.0, velocity=None):
    return Beam(name, start, end, Rectangle(0.01, 0.005), Material(1e9, 2000.0, poisson), velocity)


def cantilever(*loads, gravity=0.0, angle=None, poisson=0.0):
    return Scene("cantilever", [beam(poisson=poisson)], [Clamp("beam.start", angle)], loads, (0.0, -gravity))


def four_bar(first, *loads):
    def link(name, start, end, diameter, mass, E):
        section = Circle(diameter)
        density = mass / (section.area * distance(start, end))
        return Beam(name, start, end, section, Material(E, density))

    A, B, D = (0.0, 0.0), (0.2, 0.0), (0.2 + 0.3 * sqrt(3), 0.0)
    C = (0.2 + 0.9 * cos(pi / 6), 0.9 * sin(pi / 6))
    bodies = [
        link("crank", A, B, 0.04, 0.6811, 1e9),
        link("coupler", B, C, 0.05, 2.474, 5e6),
        link("follower", C, D, 0.03, 1.470, 5e8),
    ]
    pins = [Pin("crank.end", "coupler.start"), Pin("coupler.end", "follower.start"), Pin("follower.end")]
    return Scene("four-bar", bodies, [first, *pins], loads)


def test_reissner_beam_tends_to_timoshenko():
    P, shear = 1e-6, 1e9 / 2.6 * 0.01 * 0.005
    scene = cantilever(Force("beam.end", (0.0, -P)), poisson=0.3)
    rest = exudyn_reissner.solve_static(scene, mesh=8, shear_factor=1e-4)
    exact = -P * L**3 / (3 * EI) - P * L / (1e-4 * shear)
    assert rest.position("beam", 1.0)[-1, 1] == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("peer", PEERS)
@pytest.mark.parametrize("first", ["angle", "moment"])
def test_four_bar(peer, first):
    driven = first == "angle"
    clamp, pin = Clamp("crank.start", Quintic(2 * pi, 2.0)), Pin("crank.start")
    scene = four_bar(clamp) if driven else four_bar(pin, Torque("crank.start", Pulse(2.0, 1.0)))
    run = peer.solve(scene, mesh={"crank": 2, "coupler": 8, "follower": 2}, dt=4e-3, t_end=2.4)
    assert run.status.ok, run.status
    assert run.cost.steps == 600
    for one, two in (("crank", "coupler"), ("coupler", "follower")):
        assert np.abs(run.position(one, 1.0) - run.position(two, 0.0)).max() < 1e-9
    assert np.abs(run.position("follower", 1.0) - run.position("follower", 1.0)[0]).max() < 1e-9
    if driven:
        after = run.position("crank", 1.0)[run.t > 2.0]
        assert np.abs(after - [0.2, 0.0]).max() < 1e-2


def test_drives_known_and_unknown_to_exudyn_are_the_same():
    """Quintic and Pulse are compiled into expressions; any other callable is set at each step."""
    quintic, pulse = Quintic(2 * pi, 2.0), Pulse(2.0, 1.0)
    options = {"mesh": 2, "dt": 2e-3, "t_end": 0.4, "output_dt": 0.1}
    pairs = [
        (four_bar(Clamp("crank.start", quintic)), four_bar(Clamp("crank.start", lambda t: quintic(t)))),
        (
            four_bar(Pin("crank.start"), Torque("crank.start", pulse), Force("crank.end", (0.0, 1.0))),
            four_bar(
                Pin("crank.start"),
                Torque("crank.start", lambda t: pulse(t)),
                Force("crank.end", lambda t: (0.0, 1.0)),
            ),
        ),
    ]
    for known, unknown in pairs:
        one, two = (exudyn_cable.solve(scene, **options) for scene in (known, unknown))
        assert one.status.ok
        assert two.status.ok
        assert compare(one, two, probes=["coupler.end"]).error < 1e-9


@pytest.mark.parametrize("peer", PEERS)
@pytest.mark.parametrize("bend", [0.0, 1.0])
def test_weld_at_any_angle_and_bodies_in_either_direction(peer, bend):
    corner, tip = (1.0, 0.0), (1.0 + cos(bend), sin(bend))

    def scene(reverse):
        ends = (tip, corner) if reverse else (corner, tip)
        weld = Weld("one.end", "two.end" if reverse else "two.start")
        bodies = [beam("one", (0.0, 0.0), corner), beam("two", *ends)]
        return Scene("bent", bodies, [Clamp("one.start"), weld], gravity=(0.0, -G))

    along, back = (peer.solve_static(scene(r), mesh=4) for r in (False, True))
    assert along.position("two", 1.0)[-1] == pytest.approx(back.position("two", 0.0)[-1], abs=1e-9)
    assert along.position("two", 0.25)[-1] == pytest.approx(back.position("two", 0.75)[-1], abs=1e-9)
    if bend == 0.0:
        whole = peer.solve_static(cantilever(gravity=G), mesh=8)
        assert along.position("two", 1.0)[-1] == pytest.approx(whole.position("beam", 1.0)[-1], abs=1e-9)
    moving = peer.solve(scene(True), mesh=4, dt=1e-3, t_end=0.2, output_dt=0.1)
    assert moving.status.ok
    assert np.abs(moving.position("one", 1.0) - moving.position("two", 1.0)).max() < 1e-9


@pytest.mark.parametrize("peer", PEERS)
def test_free_and_pinned_bodies_in_one_scene(peer):
    """A thrown, spinning beam keeps its momenta; a pendulum beside it keeps its pivot."""
    thrown = beam("thrown", (0.0, 1.0), (1.0, 1.0), velocity=lambda s: (0.5, 2.0 + 4.0 * (s - 0.5)))
    scene = Scene("two", [thrown, beam("hung", (0, 0), (1, 0))], [Pin("hung.start")], gravity=(0.0, -G))
    run = peer.solve(scene, mesh=2, spectral_radius=1.0, dt=1e-3, t_end=0.1, output_dt=0.01)
    assert run.status.ok, run.status
    middle = 0.5 * (run.position("thrown", 0.0) + run.position("thrown", 1.0))
    t = run.t
    assert middle == pytest.approx(np.column_stack([0.5 + 0.5 * t, 1 + 2 * t - G * t**2 / 2]), abs=2e-5)
    turn = np.arctan2(*(run.position("thrown", 1.0) - middle)[-1, ::-1])
    assert turn == pytest.approx(0.4, abs=1e-4)
    assert np.abs(run.position("hung", 0.0)).max() < 1e-10


@pytest.mark.parametrize("peer", PEERS)
def test_unsupported_scenes_say_why(peer):
    free = cantilever()
    free = Scene("free", free.bodies, [Clamp("beam.start", stretch="free")])
    for scene, more, named in (
        (cantilever(), {"integrator": "zhai"}, "generalized-alpha alone"),
        (free, {}, "stretch"),
    ):
        answer = peer.solve(scene, mesh=2, dt=1e-5, t_end=1e-3, **more)
        assert answer.status == "unsupported"
        assert named in answer.status.message
        assert len(answer.t) == 0
        assert answer.cost.steps == 0


def test_scenes_that_call_python_are_known():
    known = four_bar(Clamp("crank.start", Quintic(2 * pi, 2.0)))
    assert not exudyn_cable.python_callbacks(known)
    assert exudyn_cable.python_callbacks(
        four_bar(Clamp("crank.start", lambda t: (0.0 * t, 0.0 * t, 0.0 * t)))
    )


def test_without_exudyn(monkeypatch):
    monkeypatch.setitem(sys.modules, "exudyn", None)
    for peer in PEERS:
        for answer in (peer.solve(cantilever(), mesh=2), peer.solve_static(cantilever(), mesh=2)):
            assert answer.status == "unsupported"
            assert "pip install 'anctmm[peers]'" in answer.status.message


def test_bad_options_raise_before_any_work():
    scene = cantilever(gravity=G)
    with pytest.raises(UnknownOptionError, match="quadrature"):
        exudyn_cable.solve(scene, mesh=2, quadrature="none")
    with pytest.raises(MeshError, match="beam"):
        exudyn_cable.solve(scene, mesh={"rod": 2})
    with pytest.raises(DiscretisationError, match="relative tolerance"):
        exudyn_cable.solve(scene, mesh=2, tolerances=(0.0, 1e-9))
    with pytest.raises(DiscretisationError, match="load_steps"):
        exudyn_cable.solve_static(scene, mesh=2, load_steps=0)
    with pytest.raises(DiscretisationError, match="order"):
        exudyn_reissner.solve(scene, mesh=2, order=3)


def test_newton_that_fails_keeps_the_history_until_then():
    answer = exudyn_cable.solve(cantilever(gravity=1e5 * G), mesh=8, dt=0.05, t_end=1.0)
    assert answer.status == "failed"
    assert 0.0 < answer.status.time < 1.0
    assert "smaller dt" in answer.status.message
    assert 1 < len(answer.t) < 21
    assert answer.t[-1] < answer.status.time
    assert np.isfinite(answer.position("beam", 1.0)).all()


def test_forces_are_those_of_cables_whatever_element_is_named():
    """Reactions of a solution that named shear elements raised an error of NumPy."""
    scene = cantilever(Force("beam.end", (0.0, -1.0)))
    cables, asked = (exudyn_cable.solve_static(scene, mesh=4, element=e) for e in ("cable", "shear"))
    assert asked.run.element == "cable"
    support = asked.reaction(scene.joints[0])
    assert np.array_equal(support, cables.reaction(scene.joints[0]))
    assert support[-1, 1] == pytest.approx(1.0, abs=1e-6)
