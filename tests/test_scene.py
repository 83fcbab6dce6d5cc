"""Scenes, drives and discretisations: what is refused, by which error, and that it names thing, value and remedy."""

import pickle
from dataclasses import FrozenInstanceError, astuple, replace
from math import inf, nan, pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples import SOFT, SQUARE, bar, row_scene

import anctmm as at
from anctmm import errors
from anctmm.discretisation import Discretisation, element_length
from anctmm.drives import Pulse, Quintic, tabulate
from anctmm.registry import load, names, solver
from anctmm.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld, distance
from anctmm.sections import Circle, Rectangle, Section
from studies.scenes import BASE_SCENES, four_bar

A, B, C = (0.0, 0.0), (1.0, 0.0), (2.0, 0.0)


def beam(name="a", start=A, end=B, section=SQUARE, material=SOFT, velocity=None):
    return Beam(name, start, end, section, material, velocity)


def scene(*joints, bodies=None, loads=(), gravity=(0.0, 0.0)):
    return Scene("s", bodies or [beam(), beam("b", B, C)], joints, loads, gravity)


def run(**options):
    return Discretisation(**{"mesh": 2, **options})


#: What is wrong: how to make it, the error's class, and what its message must hold.
BAD = {
    # bodies
    "length 0": (
        lambda: beam(end=A),
        errors.DegenerateBodyError,
        ["'a'", "length 0", "(0.0, 0.0)", "two distinct"],
    ),
    "no name": (lambda: beam(name=""), errors.PropertyError, ["name", "''", "non-empty"]),
    "name not text": (lambda: beam(name=3), errors.PropertyError, ["name", "3", "string"]),
    "start not a pair": (lambda: beam(start=(1.0,)), errors.PropertyError, ["'a' start", "(1.0,)", "pair"]),
    "end not finite": (lambda: beam(end=(nan, 0.0)), errors.PropertyError, ["'a' end", "nan", "finite"]),
    "section missing": (lambda: beam(section=0.1), errors.PropertyError, ["section", "0.1", "Section"]),
    "material missing": (
        lambda: beam(material=1e9),
        errors.PropertyError,
        ["material", "1000000000.0", "Material"],
    ),
    "velocity not a pair": (
        lambda: bar(velocity=lambda s: 1.0).body("bar").velocity_at(0.5),
        errors.PropertyError,
        ["'bar' velocity", "0.5", "1.0", "pair"],
    ),
    # properties
    "negative E": (lambda: Material(-1.0, 1.0), errors.PropertyError, ["E (Pa)", "-1.0", "greater than 0"]),
    "infinite E": (lambda: Material(inf, 1.0), errors.PropertyError, ["E (Pa)", "inf", "finite"]),
    "density 0": (lambda: Material(1.0, 0.0), errors.PropertyError, ["density", "0.0", "greater than 0"]),
    "density text": (lambda: Material(1.0, "x"), errors.PropertyError, ["density", "'x'", "finite number"]),
    "poisson ½": (lambda: Material(1.0, 1.0, 0.5), errors.PropertyError, ["poisson", "0.5", "[0, 0.5)"]),
    "poisson negative": (
        lambda: Material(1.0, 1.0, -0.1),
        errors.PropertyError,
        ["poisson", "-0.1", "[0, 0.5)"],
    ),
    "area nan": (lambda: Section(nan, 1.0, 1.0), errors.PropertyError, ["area", "nan", "finite"]),
    "moment negative": (
        lambda: Section(1.0, -1.0, 1.0),
        errors.PropertyError,
        ["second_moment", "-1.0", "greater"],
    ),
    "impossible J": (
        lambda: Section(1.0, 1.0, 0.5),
        errors.PropertyError,
        ["fourth_moment", "0.5", "I²/A = 1.0"],
    ),
    "diameter 0": (lambda: Circle(0.0), errors.PropertyError, ["diameter", "0.0", "greater than 0"]),
    "height negative": (
        lambda: Rectangle(1.0, -2.0),
        errors.PropertyError,
        ["height", "-2.0", "greater than 0"],
    ),
    "force not finite": (
        lambda: Force("a.end", (0, inf)),
        errors.PropertyError,
        ["'a.end'", "inf", "finite"],
    ),
    "force a number": (lambda: Force("a.end", 1.0), errors.PropertyError, ["'a.end'", "1.0", "pair"]),
    "torque a pair": (
        lambda: Torque("a.end", (1.0, 0.0)),
        errors.PropertyError,
        ["'a.end'", "(1.0, 0.0)", "finite"],
    ),
    "turn nan": (lambda: Quintic(nan, 1.0), errors.PropertyError, ["turn", "nan", "finite"]),
    "duration 0": (lambda: Pulse(1.0, 0.0), errors.PropertyError, ["duration", "0.0", "greater than 0"]),
    # scenes
    "no bodies": (lambda: Scene("s", []), errors.SceneError, ["'s'", "no bodies", "at least one"]),
    "two of one name": (
        lambda: scene(bodies=[beam(), beam()]),
        errors.DuplicateNameError,
        ["'a'", "2 times", "once is allowed"],
    ),
    "not a beam": (lambda: Scene("s", ["a"]), errors.SceneError, ["bodies", "'a'", "Beam"]),
    "not a joint": (lambda: scene("hinge"), errors.SceneError, ["joints", "'hinge'", "Pin, Weld, Clamp"]),
    "not a load": (lambda: scene(loads=[3.0]), errors.SceneError, ["loads", "3.0", "Force, Torque"]),
    "gravity a number": (lambda: scene(gravity=-9.81), errors.PropertyError, ["gravity", "-9.81", "pair"]),
    "unknown body": (lambda: scene(Pin("c.end")), errors.UnknownNameError, ["'c'", "'a', 'b'"]),
    "unknown end": (
        lambda: scene(Pin("a.middle")),
        errors.UnknownNameError,
        ["'a.middle'", "name.start", "name.end"],
    ),
    "end without body": (lambda: scene(Clamp("end")), errors.UnknownNameError, ["'end'", "name.start"]),
    "end not text": (lambda: scene(Pin(3)), errors.UnknownNameError, ["3", "name.start"]),
    "load on nothing": (
        lambda: scene(loads=[Torque("c.end", 1.0)]),
        errors.UnknownNameError,
        ["'c'", "'a', 'b'"],
    ),
    "unknown body asked for": (
        lambda: scene().body("c"),
        errors.UnknownNameError,
        ["'c'", "'s'", "'a', 'b'"],
    ),
    "probe beyond": (lambda: scene().probe(("a", 1.5)), errors.PropertyError, ["'a'", "1.5", "[0, 1]"]),
    "end joined twice": (
        lambda: scene(Pin("a.end", "b.start"), Clamp("a.end")),
        errors.EndJoinedTwiceError,
        ["'a.end'", "Clamp", "one joint"],
    ),
    "end joined to itself": (
        lambda: scene(Pin("a.end", "a.end")),
        errors.EndJoinedTwiceError,
        ["'a.end'", "one joint"],
    ),
    "three ends": (
        lambda: scene(
            Pin("a.end", "b.start", "c.start"), bodies=[beam(), beam("b", B, C), beam("c", B, (1, 1))]
        ),
        errors.BranchError,
        ["Pin", "3 ends", "at most two", "not supported"],
    ),
    "pin of nothing": (lambda: scene(Pin()), errors.SceneError, ["Pin", "0 end(s)"]),
    "weld of one end": (
        lambda: scene(Weld("a.end")),
        errors.SceneError,
        ["Weld", "1 end(s)", "two are needed"],
    ),
    "ends apart": (
        lambda: scene(Pin("a.start", "b.start")),
        errors.JointGapError,
        ["Pin", "(0.0, 0.0)", "(1.0, 0.0)", "1 m apart", "allowed"],
    ),
    "ends drift apart": (
        lambda: scene(Pin("a.end", "b.start"), bodies=[beam(velocity=lambda s: (s, 0.0)), beam("b", B, C)]),
        errors.JointGapError,
        ["velocities", "(1.0, 0.0)", "(0.0, 0.0)", "equal"],
    ),
    "held end moves": (
        lambda: bar([Pin("bar.start")], velocity=lambda s: (1.0, 0.0)),
        errors.JointGapError,
        ["'bar.start'", "(1.0, 0.0)", "(0, 0) is needed"],
    ),
    "loop": (
        lambda: scene(Pin("a.end", "b.start"), Pin("b.end", "a.start"), bodies=[beam(), beam("b", B, A)]),
        errors.ClosedLoopError,
        ["'a', 'b'", "loop", "ground or free end"],
    ),
    "angle a number": (
        lambda: scene(Clamp("a.start", 1.0)),
        errors.PropertyError,
        ["'a.start'", "1.0", "callable"],
    ),
    "angle of one value": (
        lambda: scene(Clamp("a.start", lambda t: t)),
        errors.PropertyError,
        ["'a.start' angle", "3 finite", "t = 0.0"],
    ),
    "angle not 0 at first": (
        lambda: scene(Clamp("a.start", lambda t: (1.0, 0.0, 0.0))),
        errors.PropertyError,
        ["'a.start'", "1.0 rad", "0 is needed"],
    ),
    # discretisations
    "mesh 0": (lambda: run(mesh=0), errors.MeshError, ["mesh", "0", "from 1 on"]),
    "mesh a fraction": (lambda: run(mesh=2.5), errors.MeshError, ["mesh", "2.5", "whole numbers"]),
    "mesh true": (lambda: run(mesh=True), errors.MeshError, ["mesh", "True"]),
    "mesh of a body 0": (lambda: run(mesh={"a": 0}), errors.MeshError, ["mesh", "{'a': 0}", "from 1 on"]),
    "mesh misses a body": (
        lambda: run(mesh={"a": 1}).of(scene()),
        errors.MeshError,
        ["{'a': 1}", "'a', 'b'"],
    ),
    "mesh of a stranger": (
        lambda: run(mesh={"a": 1, "b": 1, "c": 1}).of(scene()),
        errors.MeshError,
        ["mesh", "'c': 1", "no other"],
    ),
    "element misses a body": (
        lambda: run(element={"a": "cable"}).of(scene()),
        errors.MeshError,
        ["element", "'a', 'b'"],
    ),
    "unknown element": (
        lambda: run(element="rod"),
        errors.UnknownOptionError,
        ["element", "'rod'", "'cable', 'shear'"],
    ),
    "unknown element of a body": (
        lambda: run(element={"a": 1}),
        errors.UnknownOptionError,
        ["1", "'cable', 'shear'"],
    ),
    "unknown quadrature": (
        lambda: run(quadrature="exact"),
        errors.UnknownOptionError,
        ["quadrature", "'exact'", "'full', 'lobatto', 'reduced'"],
    ),
    "unknown integrator": (
        lambda: run(integrator="euler"),
        errors.UnknownOptionError,
        ["integrator", "'euler'", "'generalized-alpha', 'zhai'"],
    ),
    "dt 0": (lambda: run(dt=0.0), errors.StepError, ["dt (s)", "0.0", "greater than 0"]),
    "dt nan": (lambda: run(dt=nan), errors.StepError, ["dt (s)", "nan", "finite"]),
    "t_end negative": (lambda: run(t_end=-1.0), errors.StepError, ["t_end (s)", "-1.0", "greater than 0"]),
    "t_end no whole steps": (
        lambda: run(dt=0.3, t_end=1.0),
        errors.StepError,
        ["t_end", "1.0", "whole number of steps dt = 0.3", "0.8999999999999999"],
    ),
    "t_end below a step": (lambda: run(dt=1.0, t_end=0.1), errors.StepError, ["t_end", "0.1", "such as 1.0"]),
    "output_dt no whole steps": (
        lambda: run(dt=0.1, output_dt=0.25),
        errors.StepError,
        ["output_dt", "0.25", "whole number", "0.2"],
    ),
    "output_dt 0": (lambda: run(output_dt=0.0), errors.StepError, ["output_dt (s)", "0.0", "greater than 0"]),
    "spectral radius": (
        lambda: run(spectral_radius=1.1),
        errors.DiscretisationError,
        ["spectral_radius", "1.1", "[0, 1]"],
    ),
    "newton tolerance": (
        lambda: run(newton_tolerance=0.0),
        errors.DiscretisationError,
        ["newton_tolerance", "0.0", "(0, 0.01]"],
    ),
    "psi": (lambda: run(psi=inf), errors.DiscretisationError, ["psi", "inf", "finite"]),
    "unknown keyword": (
        lambda: at.solve(bar(), mesh=2, colour="red"),
        errors.DiscretisationError,
        ["'colour'", "unknown", "quadrature"],
    ),
    "run and keywords": (
        lambda: at.solve(bar(), run(), dt=1.0),
        errors.DiscretisationError,
        ["'dt'", "Discretisation or keywords"],
    ),
    "run of another kind": (lambda: at.solve(bar(), 5), errors.DiscretisationError, ["5", "Discretisation"]),
    "mesh missing": (lambda: at.solve(bar()), errors.MeshError, ["mesh is missing", "needed"]),
    "psi below ½": (
        lambda: at.solve(bar(), run(integrator="zhai", dt=1e-6, t_end=1e-6, psi=0.25)),
        errors.StabilityError,
        ["psi is 0.25", "phi is 0.5", "psi = phi >= 0.5", "check_stability=False"],
    ),
    "dt above the limit": (
        lambda: at.solve(bar(), run(integrator="zhai", dt=0.1)),
        errors.StabilityError,
        ["dt is 0.1", "at most", "rad/s", "'bar'", "check_stability=False"],
    ),
    "unknown solver": (
        lambda: solver("adams"),
        errors.UnknownSolverError,
        ["'adams'", "anctmm", "global-dae"],
    ),
    "load steps": (
        lambda: at.solve_static(bar(), mesh=1, load_steps=2.5),
        errors.DiscretisationError,
        ["load_steps", "2.5", "whole number from 1 on"],
    ),
    "no probes": (lambda: at.compare(None, None, []), errors.SolverError, ["probes", "at least one"]),
}


@pytest.mark.parametrize("what", BAD)
def test_refused_with_thing_value_and_what_is_allowed(what):
    make, kind, words = BAD[what]
    with pytest.raises(errors.AnctmmError) as caught:
        make()
    assert type(caught.value) is kind
    message = str(caught.value)
    assert [w for w in words if w not in message] == []
    assert "\n" not in message


def test_errors_are_also_pythons_own():
    for ours, python in [
        (errors.SceneError, ValueError),
        (errors.DiscretisationError, ValueError),
        (errors.UnknownNameError, KeyError),
        (errors.SolverError, RuntimeError),
    ]:
        assert issubclass(ours, errors.AnctmmError)
        assert issubclass(ours, python)


# --- drives ------------------------------------------------------------------------------------------------


def complex_free_derivative(f, t, h=1e-5):
    return (f(t - 2 * h) - 8 * f(t - h) + 8 * f(t + h) - f(t + 2 * h)) / (12 * h)


def test_quintic_turns_from_rest_to_rest():
    drive = Quintic(turn=3.0, duration=2.0)
    t = np.array([-1.0, 0.0, 1.0, 2.0, 3.0])
    angle, rate, acceleration = drive(t)
    assert angle == pytest.approx([0.0, 0.0, 1.5, 3.0, 3.0], abs=1e-15)
    assert rate == pytest.approx([0.0, 0.0, 3.0 * 1.875 / 2.0, 0.0, 0.0], abs=1e-15)
    assert acceleration == pytest.approx(np.zeros(5), abs=1e-15)


@given(st.floats(0.1, 1.9))
def test_rates_of_the_quintic_are_its_derivatives(t):
    drive = Quintic(turn=3.0, duration=2.0)
    for k in (0, 1):
        slope = complex_free_derivative(lambda x, k=k: drive(x)[k], t)
        assert drive(t)[k + 1] == pytest.approx(slope, abs=1e-8)


def test_pulse_rises_and_falls():
    pulse = Pulse(2.0, 4.0)
    assert pulse(np.array([-1.0, 0.0, 1.0, 2.0, 4.0, 9.0])) == pytest.approx([0, 0, 1, 2, 0, 0], abs=1e-15)


def scalar_only(t):
    return (1.0, t) if t > 0.5 else (0.0, -t)


def swapped_on_arrays(t):
    """Right for one time, and another thing for three."""
    return np.array([t, 2.0 * t]) if np.ndim(t) == 0 else np.zeros((2, len(t)))


@pytest.mark.parametrize("history", [scalar_only, swapped_on_arrays, lambda t: (t, 1.0), lambda t: [t**2, t]])
def test_histories_are_tabulated_as_if_asked_time_by_time(history):
    t = np.linspace(0.0, 1.0, 7)
    expected = np.array([history(float(x)) for x in t])
    assert np.array_equal(tabulate("load", history, t, 2), expected)


def test_tabulated_history_of_one_value():
    t = np.linspace(0.0, 1.0, 5)
    assert tabulate("load", lambda t: 3.0, t, 1).tolist() == [[3.0]] * 5
    assert tabulate("load", abs, np.empty(0), 1).shape == (0, 1)


@pytest.mark.parametrize(
    ("history", "words"),
    [
        (lambda t: (1.0, 2.0, 3.0), ["hub", "2 finite", "t = 0.0"]),
        (
            lambda t: (1.0 / (0.5 - t), 0.0) if t != 0.5 else (inf, 0.0),
            ["hub", "[inf, 0.0]", "t = 0.5 s", "finite"],
        ),
        (lambda t: 1 / 0, ["hub", "division by zero"]),
    ],
)
def test_histories_that_fail_say_where(history, words):
    with pytest.raises(errors.PropertyError) as caught:
        tabulate("hub", history, np.linspace(0.0, 1.0, 5), 2)
    assert [w for w in words if w not in str(caught.value)] == []


# --- topology ----------------------------------------------------------------------------------------------


def order(of):
    return [[(link.body, link.reversed) for link in chain] for chain in of.chains()]


def test_chain_is_derived_from_the_joints():
    chain = [("crank", False), ("coupler", False), ("follower", False)]
    assert order(four_bar().scene) == [chain]


@given(st.permutations([0, 1, 2, 3]), st.sets(st.integers(0, 3)), st.permutations([0, 1, 2]))
def test_chain_does_not_depend_on_lists_or_directions(listed, turned, joints):
    links = [("pin", 0.3), ("weld", 0.2), ("pin", -0.5)]
    usual = row_scene("free", links, "clamp", turned=turned)
    bodies = [usual.bodies[i] for i in listed]
    other = Scene("row", bodies, [usual.joints[i] for i in (3, *joints)])
    (chain,) = order(other)
    if chain[0][0] != "b0":  # it starts at the first listed body that is at an end
        chain = [(name, not side) for name, side in reversed(chain)]
    assert chain == [(f"b{i}", i in turned) for i in range(4)]


def test_bodies_without_joints_are_chains_of_their_own():
    free = [beam("a"), beam("b", B, C), beam("c", (0, 1), (1, 1)), beam("d", (1, 1), (2, 1))]
    s = scene(Pin("d.start", "c.end"), Clamp("b.end"), bodies=free)
    assert order(s) == [[("a", False)], [("b", False)], [("c", False), ("d", False)]]
    inboard = s.chains()[2][1].inboard
    assert inboard is s.chains()[2][0].outboard is s.joints[0]


# --- frozen values -----------------------------------------------------------------------------------------


def test_scenes_and_runs_are_values():
    for base in BASE_SCENES:
        assert base().scene == base().scene
        assert hash(base().scene) == hash(base().scene)
        assert pickle.loads(pickle.dumps(base().scene)) == base().scene
    one, two = (run(mesh={"a": 2, "b": 3}, element={"a": "cable", "b": "shear"}) for _ in range(2))
    assert one == two
    assert hash(one) == hash(two)
    with pytest.raises(FrozenInstanceError):
        one.dt = 1.0
    assert replace(one, dt=0.5).steps == 2


def test_properties_of_bodies():
    b = beam("b", (1.0, 1.0), (4.0, 5.0))
    assert (b.length, distance(b.start, b.end)) == (5.0, 5.0)
    assert b.angle == pytest.approx(np.arctan2(4.0, 3.0))
    assert element_length(b, 4) == 1.25
    lam, G = Material(1.0, 1.0, 0.25).lame
    assert (lam, G) == pytest.approx((0.4, 0.4))
    assert Circle(2.0).area == pytest.approx(pi)
    assert astuple(Rectangle(2.0, 3.0)) == (6.0, 4.5, 2.0 * 3.0**5 / 80)


def test_probes():
    s = scene()
    assert s.probe("b.end") == ("b", 1.0)
    assert s.probe("b.start") == ("b", 0.0)
    assert s.probe(("a", 0.25)) == ("a", 0.25)


def test_gap_of_a_pin_may_be_rounding_far_from_the_origin():
    far = 1e6 * sqrt(2.0)
    bodies = [beam("a", (far, 0.0), (far + 1.0, 0.0)), beam("b", (far + 1.0 + 2e-10, 0.0), (far + 2.0, 0.0))]
    assert len(scene(Pin("a.end", "b.start"), bodies=bodies).chains()) == 1


@pytest.mark.parametrize(
    ("options", "kept"),
    [
        ({"dt": 0.1, "t_end": 0.5}, [0, 1, 2, 3, 4, 5]),
        ({"dt": 0.1, "t_end": 0.5, "output_dt": 0.2}, [0, 2, 4, 5]),
        ({"dt": 0.1, "t_end": 0.4, "output_dt": 0.2}, [0, 2, 4]),
        ({"dt": 0.1, "t_end": 0.3, "output_dt": 5.0}, [0, 3]),
        ({"dt": 1e-6, "t_end": 1.0, "output_dt": 0.5}, [0, 500_000, 1_000_000]),
    ],
)
def test_outputs_hold_both_ends(options, kept):
    r = run(**options)
    assert r.output_steps.tolist() == kept
    t = r.times(r.output_steps)
    assert t[0] == 0.0
    assert t[-1] == options["t_end"]


def test_solvers_are_found_by_name():
    assert {"anctmm", "global-dae", "global-dae-dense", "exudyn-cable", "exudyn-reissner"} <= set(names())
    assert load("anctmm") is solver("anctmm").__wrapped__ is at.solve
