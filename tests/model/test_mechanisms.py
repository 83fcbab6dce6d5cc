"""Bodies, joints, connectors and loads of mechanisms: what they are, and what is refused by name."""

import numpy as np
import pytest
from samples import refused

import anctmm as at
from anctmm import errors
from anctmm.errors import JointGapError, SceneError, UnknownNameError
from anctmm.model.needs import MECHANISMS, needs
from anctmm.model.places import Place
from anctmm.solvers import registry
from studies.conformance.scenes import MECHANISMS as DEMANDS
from studies.conformance.scenes import cantilever

ROD, RUBBER = at.Circle(0.02), at.Material(E=5e6, density=1100.0)
QUINTIC = at.Quintic(0.1, 1.0)


def beam(name="a", start=(0.0, 0.0), end=(1.0, 0.0), **options):
    return at.Beam(name, start, end, ROD, RUBBER, **options)


def plate(name="p", **options):
    given = {"mass": 2.0, "inertia": 0.1, "center": (1.5, 0.5), "points": {"a": (1.0, 0.0), "b": (2.0, 0.0)}}
    return at.RigidBody(name, **(given | options))


def mass(name="m", position=(1.0, 0.0), **options):
    return at.PointMass(name, 0.5, position, **options)


def scene(*joints, bodies=None, **options):
    return at.Scene("s", bodies or [beam(), plate(), mass()], joints, **options)


# --- what they are -----------------------------------------------------------------------------------------


def test_places_of_every_kind():
    s = scene()
    found = {
        place: (s.place(place).key, s.place(place).position)
        for place in ("a.start", "a.end", ("a", 0.0), ("a", 1), ("a", 0.25), "p.center", "p.b", "m.center")
    }
    assert found == {
        "a.start": (0, (0.0, 0.0)),
        "a.end": (1, (1.0, 0.0)),
        ("a", 0.0): (0, (0.0, 0.0)),
        ("a", 1): (1, (1.0, 0.0)),
        ("a", 0.25): (0.25, (0.25, 0.0)),
        "p.center": ("center", (1.5, 0.5)),
        "p.b": ("b", (2.0, 0.0)),
        "m.center": ("center", (1.0, 0.0)),
    }
    assert isinstance(s.place("a.end").key, int)
    assert s.probe("p.a") == ("p", "a")
    assert s.probe("a.end") == ("a", 1.0)
    assert [b.name for b in s.beams] == ["a"]


def test_points_of_a_rigid_body_move_with_it():
    body = plate(velocity=(1.0, 2.0), spin=3.0)
    assert body.velocity_at("b") == (1.0 - 3.0 * -0.5, 2.0 + 3.0 * 0.5)
    assert Place(body, "b").velocity == body.velocity_at("b")
    assert body.extent == pytest.approx(np.hypot(0.5, 0.5))


def steady(t):
    return 10.0 * t, 10.0, 0.0


def test_a_mechanism_that_its_drive_moves_at_once_is_made_with_velocities():
    """A slider-crank of rigid bodies at a constant speed: a scene at rest is refused, and says what to do."""
    crank = at.RigidBody("crank", 1.0, 0.02, (0.1, 0.0), points={"o": (0.0, 0.0), "p": (0.0, 0.2)})
    rod = at.RigidBody("rod", 1.0, 0.02, (0.3, 0.1), points={"p": (0.0, 0.2), "q": (0.6, 0.0)})
    parts = {
        "name": "engine",
        "bodies": [crank, rod],
        "joints": [at.Clamp("crank.o", angle=steady), at.Pin("crank.p", "rod.p"), at.Slider("rod.q")],
        "loads": [at.Force("rod.q", (1.0, 0.0))],
        "gravity": (0.0, -1.0),
        "connectors": [at.RotationalSpring("rod.q", stiffness=1.0)],
    }
    with pytest.raises(
        JointGapError, match=r"crank.o' angle changes at 10 .*consistent_velocities.*name=…, bodies="
    ):
        at.Scene(**parts)
    made = at.consistent_velocities(**parts)
    assert made.body("crank").spin == pytest.approx(10.0)
    assert made.body("rod").velocity_at("p") == pytest.approx((-2.0, 0.0))
    assert made.body("rod").velocity_at("q")[1] == pytest.approx(0.0, abs=1e-12)
    assert (made.loads, made.gravity, len(made.connectors)) == (tuple(parts["loads"]), (0.0, -1.0), 1)
    found = at.solve(made, dt=1e-3, t_end=0.02)
    assert found.status.ok, found.status
    assert found.spin("crank") == pytest.approx(10.0, rel=1e-4)


def test_what_consistent_velocities_are_made_of_is_checked():
    still = scene(at.Pin("a.start"))
    with pytest.raises(SceneError, match="beside 'bodies'"):
        at.consistent_velocities(still, bodies=[beam()])
    with pytest.raises(SceneError, match="no bodies"):
        at.consistent_velocities(name="empty", bodies=[])
    with pytest.raises(UnknownNameError, match="body 'b' is not"):
        at.consistent_velocities(name="s", bodies=[beam()], joints=[at.Pin("b.end")])
    with pytest.raises(TypeError, match="bodies"):
        at.consistent_velocities(name="s")


# --- what is refused ---------------------------------------------------------------------------------------

S, P, U, K = errors.SceneError, errors.PropertyError, errors.UnknownNameError, errors.UnknownKindError
R, G, T = errors.RepeatedJointError, errors.JointGapError, errors.EndJoinedTwiceError
C = errors.ContradictingJointsError


def sprung(*connectors, bodies=None):
    return lambda: scene(bodies=bodies, connectors=connectors)


def law(value):
    return lambda: scene(connectors=[at.Spring("m.center", (0.0, 0.0), law=value)])


def raises(*arguments):
    raise ValueError("no law")


WRONG = {
    "a body without mass": (lambda: plate(mass=0.0), P, ["rigid body 'p' mass", "0.0", "greater than 0"]),
    "a body without a centre": (lambda: plate(center=None), P, ["center", "None", "of finite numbers"]),
    "a point that is not finite": (lambda: plate(points={"a": (0, np.nan)}), P, ["point 'a'", "nan", "finite"]),
    "a point with a dot": (lambda: plate(points={"a.b": (0, 0)}), P, ["'a.b'", "without a dot"]),
    "two bodies of one name": (
        lambda: scene(bodies=[beam("p"), plate()]), errors.DuplicateNameError, ["'p'", "2 times"]),
    "a point that is not there": (lambda: scene(at.Pin("p.c")), U, ["'p.c'", "'p.center', 'p.a', 'p.b'"]),
    "a fraction of a rigid body": (lambda: scene(at.Pin(("p", 0.5))), U, ["('p', 0.5)", "RigidBody"]),
    "the centre of a beam": (lambda: scene(at.Pin("a.center")), U, ["'a.center'", "Beam 'a'", "'a.start', 'a.end'"]),
    "a fraction beyond the end": (lambda: at.Pin(("a", 1.5)), P, ["fraction", "1.5", "[0, 1]"]),
    "a pin that parts": (lambda: scene(at.Pin("a.end", "p.b")), G, ["'a.end'", "'p.b'", "1 m apart"]),
    "a point pinned twice": (lambda: scene(at.Pin("p.a"), at.Pin("p.a")), R, ["Pin", "leave one out"]),
    "a clamped point mass": (lambda: scene(at.Clamp("m.center")), K, ["'m'", "direction", "Pin"]),
    "a point mass that does not turn": (lambda: scene(at.Prismatic("m.center")), K, ["'m'", "Slider"]),
    "a driven weld of three": (
        lambda: at.Weld("a.end", "p.a", "m.center", angle=QUINTIC), P, ["angle", "3 place(s)", "two"]),
    "a weld that starts turned": (
        lambda: scene(at.Weld("a.end", "p.a", angle=lambda t: (0.1, 0.0, 0.0))), P, ["weld", "0.1 rad", "t = 0"]),
    "a weld driven and fixed": (
        lambda: scene(at.Weld("a.end", "p.a", angle=QUINTIC), at.Weld("a.end", "p.a")), C, ["Weld", "'p.a'"]),
    "a line without direction": (lambda: at.Slider("a.end", (0.0, 0.0)), P, ["direction", "(0.0, 0.0)", "some length"]),
    "a line in no body": (lambda: scene(at.Slider("a.end", body="z")), U, ["'z'", "it has 'a', 'p', 'm'"]),
    "a line in a beam": (lambda: scene(at.Slider("p.a", body="a")), K, ["'a'", "Beam", "RigidBody"]),
    "a line in the same body": (lambda: scene(at.Slider("p.a", body="p")), R, ["'p'", "same body"]),
    "a position that starts elsewhere": (
        lambda: scene(at.Slider("a.end", position=lambda t: (0.2, 0.0, 0.0))), P, ["position", "0.2 m", "t = 0"]),
    "a slider of a held place": (lambda: scene(at.Pin("a.end"), at.Slider("a.end")), R, ["Slider", "Pin", "already"]),
    "two lines in one direction": (
        lambda: scene(at.Slider("a.end"), at.Prismatic("a.end", (-2.0, 0.0))), R, ["Slider", "already"]),
    "a driven line and another": (
        lambda: scene(at.Slider("a.end", position=QUINTIC), at.Slider("a.end", (0, 1))), C, ["Slider"]),
    "a torque on a point mass": (lambda: scene(loads=[at.Torque("m.center", 1.0)]), K, ["'m'", "does not turn"]),
    "a follower force on a point mass": (
        lambda: scene(loads=[at.Force("m.center", (1, 0), follower=True)]), K, ["'m'", "dead Force"]),
    "a line load on a rigid body": (lambda: scene(loads=[at.LineLoad("p", (0, 1))]), K, ["'p'", "RigidBody", "Beam"]),
    "a spring that does nothing": (lambda: at.Spring("a.end", "p.a"), P, ["spring from 'a.end' to 'p.a'", "law"]),
    "a negative stiffness": (lambda: at.Spring("a.end", "p.b", stiffness=-1.0), P, ["stiffness", "-1.0", "at least 0"]),
    "a law beside a stiffness": (
        lambda: at.Spring("a.end", "p.b", stiffness=1.0, law=max), P, ["law", "stiffness", "alone"]),
    "a spring to itself": (sprung(at.Spring("a.end", ("a", 1.0), stiffness=1)), R, ["'a.end'", "one place twice"]),
    "a spring within a rigid body": (
        sprung(at.Spring("p.a", "p.b", stiffness=1)), R, ["'p.a'", "'p.b'", "one rigid body"]),
    "a spring between places at one point": (
        sprung(at.Spring("a.end", "p.a", stiffness=1)), P, ["'a.end'", "'p.a'", "one point", "(1.0, 0.0)"]),
    "a spring to a place that is not there": (
        sprung(at.Spring("a.end", "p.z", stiffness=1)), U, ["'p.z'", "'p.a', 'p.b'"]),
    "a rotational spring of a point mass": (
        sprung(at.RotationalSpring("m.center", stiffness=1)), K, ["'m'", "does not turn"]),
    "a driven length that is negative": (
        sprung(at.Spring("m.center", (0, 0), stiffness=1, length=lambda t: (-1.0, 0.0))), P, ["-1.0 m", "at least 0"]),
    "a law of two arguments": (law(lambda e, r: 0.0), P, ["law", "raises TypeError", "(elongation, rate, t)"]),
    "a law that raises": (law(raises), P, ["law", "no law", "one finite number"]),
    "a law that is not finite": (law(lambda e, r, t: np.nan), P, ["law", "nan", "finite"]),
    "a connector that is a joint": (lambda: scene(connectors=[at.Pin("a.end")]), S, ["connectors", "Spring"]),
    "a fork of velocities": (
        lambda: scene(at.Pin("a.end", "m.center"), bodies=[beam(), mass(velocity=(1, 0))]), G,
        ["'a.end'", "'m.center'", "(1, 0)"]),
    "a held point that turns": (
        lambda: scene(at.Pin("p.a"), bodies=[plate(spin=1.0)]), G, ["'p.a'", "Pin", "(0.5, -0.5) m/s"]),
    "a driven clamp of a body at rest": (
        lambda: scene(at.Clamp("p.center", lambda t: (2 * t, 2.0, 0.0)), bodies=[plate()]), G,
        ["angle changes at 2", "(0, 0) 1/s", "consistent_velocities"]),
    "a slider of a body that leaves the line": (
        lambda: scene(at.Slider("m.center"), bodies=[mass(velocity=(1, 2))]), G,
        ["'m.center' moves at (1, 2) m/s", "off by 2"]),
    "a line that turns away": (
        lambda: scene(at.Slider("m.center", body="p"), bodies=[mass(), plate(spin=1.0)]), G,
        ["body='p'", "off by 0.5"]),
    "welded bodies that turn apart": (
        lambda: scene(at.Weld("p.a", "q.a"), bodies=[plate(), plate("q", spin=1.0, velocity=(-0.5, 0.5))]), G,
        ["'p.a'", "'q.a'", "Weld"]),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_does_not_fit_is_refused_by_name(name):
    build, error, words = WRONG[name]
    with refused(error, words, exactly=True):
        build()


FITTING = {
    "a plate that hangs": lambda: scene(at.Pin("p.a")),
    "a parallelogram with a third crank": lambda: scene(
        *(at.Pin(f"{c}.start") for c in "xyz"), *(at.Pin(f"{c}.end", f"q.{c}") for c in "xyz"),
        bodies=[
            *(beam(c, (k, 0), (k, 1)) for k, c in enumerate("xyz")),
            at.RigidBody("q", 1.0, 1.0, (1.0, 1.0), {c: (k, 1) for k, c in enumerate("xyz")}),
        ]),
    "two lines that cross": lambda: scene(at.Slider("a.end"), at.Slider("a.end", (1, 1))),
    "a block on a turning line": lambda: scene(at.Pin("p.b"), at.Slider("a.end", body="p")),
    "a line in two bodies": lambda: scene(
        at.Slider("m.center", body="p"), at.Slider("m.center", (0, 1)), bodies=[mass(), plate(), beam()]),
    "a body that turns about its pin": lambda: scene(
        at.Pin("p.a"), bodies=[plate(spin=2.0, velocity=(-1.0, 1.0))]),
    "a spring of no free length": lambda: scene(connectors=[at.Spring("m.center", (0, 0), stiffness=1, length=0)]),
    "a support under a beam": lambda: scene(at.Pin("a.start"), at.Slider(("a", 0.5)), at.Pin(("a", 0.75), "q.center"),
        bodies=[beam(), at.PointMass("q", 1.0, (0.75, 0.0))]),
}  # fmt: skip


@pytest.mark.parametrize("name", FITTING)
def test_what_fits_is_taken(name):
    assert FITTING[name]().bodies


# --- what roads cannot do ----------------------------------------------------------------------------------


@pytest.mark.parametrize("feature", DEMANDS)
def test_every_feature_is_needed_by_its_scene(feature):
    assert DEMANDS.keys() == MECHANISMS.keys() - {"own-joints"}  # shown by test_own_joints.py
    assert feature in dict(needs(DEMANDS[feature](cantilever())))


ROADS = ("anctmm", "global-dae", "exudyn-cable", "exudyn-reissner", "pyelastica", "opensees")
#: Roads that take every mechanism.
WHOLE = ("anctmm", "global-dae")


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha", "static"])
@pytest.mark.parametrize("road", ROADS)
def test_what_a_road_lacks_it_refuses_by_name(road, integrator):
    offer = registry.offer_of(registry.load(road))
    asked, lacks = "statics" if integrator == "static" else integrator, 0
    for feature, demand in DEMANDS.items():
        s = demand(cantilever())
        lacking = offer.lacking([asked, *(name for name, _ in needs(s))])
        if set(lacking) <= {*KNOWN}:
            continue
        lacks += 1
        message = refusal(s, road, integrator)
        things = [thing for name, thing in needs(s) if any(name in lack.split(" + ") for lack in lacking)]
        told = any(errors.shown(thing) in message for thing in things)
        assert told or (asked in lacking and f"integrator is {asked!r}" in message), (feature, message)
    assert (lacks == 0) == (road in WHOLE)


def refusal(s, road, integrator):
    """What a road says that it lacks."""
    solve = registry.load(road)
    try:
        if integrator == "static":
            status = registry.load_static(road, solve)(s, mesh=8).status
        else:
            status = solve(s, mesh=8, integrator=integrator, dt=1e-6, t_end=1e-6).status
    except errors.UnsupportedError as error:
        return str(error)
    assert status.code == "unsupported", status
    return status.message


#: Lacks of roads that have nothing to do with mechanisms.
KNOWN = ("zhai", "generalized-alpha", "statics", "stability", "energy")
