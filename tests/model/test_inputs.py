"""No input ends in a bare exception: every constructor and function that users call, fed with everything there is.

What is refused raises an exception of `anctmm.errors` that names the thing, its value in short, and what is allowed, in
one line; what is accepted is in the tables here, so that nothing is taken for a number, a point or a name by accident.
"""

import datetime
from collections import namedtuple
from decimal import Decimal
from fractions import Fraction
from math import nan

import numpy as np
import pytest
from samples import SOFT, SQUARE, beam, scene_of

import anctmm as at
from anctmm.errors import AnctmmError, DegenerateBodyError, PropertyError, shown
from anctmm.model.velocities import RigidVelocity
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Energy
from reference import global_dae

# --- junk --------------------------------------------------------------------------------------------------


Pair = namedtuple("Pair", "x y")
#: One of each kind, by name.
JUNK = {
    "None": None, "True": True, "text": "1e9", "empty text": "", "bytes": b"12", "nan": nan, "inf": float("inf"),
    "numpy's nan": np.float64(nan), "complex": 1 + 2j, "negative": -1.0, "1e200": 1e200, "1e400": 10**400,
    "array of 3": np.ones(3), "array of texts": np.array(["1", "2"]), "square": np.ones((2, 2)),
    "list": [], "nested": [[1, 2], [3, 4]], "three": (1, 2, 3), "set": {0.0, 1.0}, "dict": {1: 2, 3: 4},
    "texts": ("1", "2"), "nans": (nan, 0.0), "nones": (None, None), "complexes": (1j, 0), "truths": (True, False),
    "date": datetime.date(2000, 1, 1), "type": dict, "object": object(), "two lines": "a\nb", "blank": " a",
    "long": "x" * 10_000,
}  # fmt: skip
NUMBERS = {
    "int": 3, "float": 0.25, "fraction": Fraction(1, 4), "decimal": Decimal("0.25"), "numpy's float": np.float32(0.25),
    "numpy's int": np.int16(3), "array of none": np.array(0.25),
}  # fmt: skip
PAIRS = {
    "tuple": (1.0, 2), "list": [1, 2.0], "array": np.array([1.0, 2.0]), "integers": np.array([1, 2]),
    "range": range(1, 3), "named": Pair(1, 2), "fractions": (Fraction(1), Decimal(2)),
}  # fmt: skip
FUNCTIONS = {
    "of nothing": lambda: 1.0,
    "of two": lambda a, b: 1.0,
    "raises": lambda t: 1 / 0,
    "gives None": lambda t: None,
    "gives a text": lambda t: "1",
    "gives nan": lambda t: nan,
    "gives nans": lambda t: (nan, nan, nan),
    "gives four": lambda t: (0.0, 0.0, 0.0, 0.0),
    "gives too much": lambda t: (1e200, 1e200, 1e200),
}

# --- where it is fed ---------------------------------------------------------------------------------------


def material(**given_):
    return at.Material(**{"E": 1e7, "density": 1e3, **given_})


def section(**given_):
    return at.Section(**{"area": 4e-4, "second_moment": 1e-8, "fourth_moment": 1e-12, **given_})


def body(**given_):
    usual = {"name": "a", "start": (0.0, 0.0), "end": (1.0, 0.0), "section": SQUARE, "material": SOFT}
    return at.Beam(**{**usual, **given_})


def scene(**given_):
    return at.Scene(**{"name": "s", "bodies": [body()], "joints": [at.Clamp("a.start")], **given_})


def run(**given_):
    return at.Discretisation(**{"mesh": 1, "dt": 0.25, "t_end": 0.5, **given_})


def solution():
    """A history of one bar at rest, made without a solver."""
    q = np.zeros((3, 2, 2, 2))
    q[:, 1, 0, 0] = q[:, :, 1, 0] = 1.0
    energy = Energy(*np.zeros((4, 3)))
    return at.Solution("s", scene(), run(), np.array([0.0, 0.25, 0.5]), {"a": HermiteField(q, 1.0)}, energy)


def field(make, name):
    """Makes a thing with one field given."""
    return lambda value: make(**{name: value})


#: Where, by the word its message must hold: what one value is given to, and which of the good values it takes.
NUMERIC = {
    **{f"material {n}": field(material, n) for n in ("E", "density", "poisson", "damping")},
    **{f"section {n}": field(section, n) for n in ("area", "second_moment", "fourth_moment")},
    "diameter": at.Circle,
    "width": lambda v: at.Rectangle(v, 1.0),
    "height": lambda v: at.Rectangle(1.0, v),
    "torque": lambda v: at.Torque("a.end", v),
    "turn": lambda v: at.Quintic(v, 1.0),
    "duration": lambda v: at.Pulse(1.0, v),
    "amplitude": lambda v: at.Pulse(v, 1.0),
    "spin": lambda v: RigidVelocity((0, 0), (1, 0), (0, 0), v),
    "fraction": lambda v: solution().position("a", v),
    **{n: field(run, n) for n in ("psi", "phi", "spectral_radius", "newton_tolerance", "dt", "t_end", "output_dt")},
    "tolerance": lambda v: at.Discretisation(mesh=1, tolerance=v),
}  # fmt: skip
POINTS = {
    "start": field(body, "start"),
    "end": field(body, "end"),
    "gravity": field(scene, "gravity"),
    "force": lambda v: at.Force("a.end", v),
    "distance from": lambda v: at.distance(v, (0.0, 0.0)),
    "distance to": lambda v: at.distance((0.0, 0.0), v),
    "center": lambda v: RigidVelocity((0, 0), (1, 0), v, 1.0),
    "velocity": lambda v: body(velocity=lambda s: v).velocity_at(0.5),
}
WHOLE = {
    "mesh": field(run, "mesh"),
    "mesh ": lambda v: run(mesh={"a": v}),
    "load_steps": lambda v: at.solve_static(scene(), mesh=1, load_steps=v),
}
NAMES = {"beam name": field(body, "name"), "scene name": field(scene, "name")}
FLAGS = {
    "pin grounded": lambda v: at.Pin("a.end", "b.start", grounded=v),
    "weld grounded": lambda v: at.Weld("a.end", "b.start", grounded=v),
    "check_stability": field(run, "check_stability"),
}
#: Nothing of the tables fits here.
OTHERS = {
    "section": field(body, "section"),
    "material": field(body, "material"),
    "bodies": field(scene, "bodies"),
    "bodies ": lambda v: scene(bodies=[v]),
    "joints": lambda v: scene(joints=[v]),
    "loads": lambda v: scene(loads=[v]),
    "end ": lambda v: scene(joints=[at.Clamp(v)]),
    "end  ": lambda v: scene(joints=[at.Pin(v)]),
    "end   ": lambda v: scene(joints=[at.Weld("a.start", v)]),
    "end    ": lambda v: scene(loads=[at.Force(v, (0.0, 1.0))]),
    "end     ": lambda v: scene().body_end(v),
    "body": lambda v: scene().body(v),
    "element": field(run, "element"),
    "element ": lambda v: run(element={"a": v}),
    "quadrature": field(run, "quadrature"),
    "integrator": field(run, "integrator"),
    "scene": lambda v: at.solve(v, mesh=1),
    "scene ": lambda v: at.solve_static(v, mesh=1),
    "scene       ": lambda v: run().of(v),
    "scene         ": at.consistent_velocities,
    "probe": lambda v: solution().displacement(v),
    "probe ": lambda v: at.compare(solution(), solution(), [v]),
    "body ": lambda v: solution().position(v, 0.5),
    "body  ": lambda v: solution().displacement((v, 0.5)),
    "solution": lambda v: at.compare(v, solution(), ["a.end"]),
    "reference": lambda v: at.compare(solution(), v, ["a.end"]),
}
#: None stands for nothing given.
OPTIONAL = {
    "run": lambda v: at.solve(scene(), v),
    "run ": lambda v: at.solve_static(scene(), v),
    "clamp": lambda v: scene(joints=[at.Clamp("a.start", v)]),
    "velocity": lambda v: scene(bodies=[body(velocity=v)]),
    "probes": lambda v: at.compare(solution(), solution(), v),
    "joints": field(scene, "joints"),
    "loads": field(scene, "loads"),
}
EVERYWHERE = {**NUMERIC, **POINTS, **WHOLE, **NAMES, **FLAGS, **OTHERS, **OPTIONAL}
#: Junk that a place takes all the same, and why: it is a number, a name, a callable or nothing there.
TAKEN = {
    **{n: {"negative"} for n in ("amplitude", "psi", "phi", "spin", "turn")}, "torque": {"negative", "type"},
    "gravity": {"None"},
    "fraction": {"array of 3", "list"}, "force": {"type", "array of 3", "three"},
    "clamp": {"None"}, "velocity": {"None", "type"},
    **{n: {"text"} for n in NAMES}, **{n: {"True"} for n in FLAGS}, "mesh": {"None"}, "load_steps": {"None"},
    "output_dt": {"None"}, "integrator": {"None"}, "tolerance": {"None"}, "joints": {"list"}, "loads": {"list"},
}  # fmt: skip


#: What the message may name in place of a place's last word.
WORDS = {
    "probe": ("probe", "end", "body"), "probes": ("probe", "end", "body"),
    "section second_moment": ("second_moment", "second moment"), "run": ("run", "mesh"), "dt": ("dt", "t_end"),
}  # fmt: skip


#: Junk of which messages show a part only, or what it did.
NOT_SHOWN = ("list", "nested", "square", "type")


def message_of(name, call, value):
    """Message of what is raised; None if nothing is. Only exceptions of `anctmm.errors` pass."""
    try:
        call(value)
    except AnctmmError as error:
        message = str(error)
        assert "\n" not in message
        assert len(message) < 900
        assert any(word in message for word in WORDS.get(name.strip(), (name.split()[-1],))), message
        return message
    return None


def texts(value):
    """A value, as a float where it is a number, and what stands in it, as messages may show them."""
    yield shown(value)
    if type(value) is int:
        yield f"{float(value):g}" if value < 10**300 else "inf"
    if isinstance(value, dict):
        yield from map(shown, value.values())
    if isinstance(value, np.ndarray | tuple | list | str | bytes | dict | memoryview):
        yield from map(shown, value)


@pytest.mark.parametrize("name", EVERYWHERE)
def test_junk_is_refused_by_name(name):
    """One test a place: a test of each value takes longer to collect and to report than to run."""
    errors = []
    for junk in JUNK:
        try:
            feed(name, junk)
        except Exception as error:
            error.add_note(f"given {junk} as {name}")
            errors.append(error)
    if errors:
        raise ExceptionGroup("not refused by name", errors)


def feed(name, junk):
    """Give junk to a place; an error unless it is refused as it should be, or taken for a reason."""
    value = JUNK[junk]
    message = message_of(name, EVERYWHERE[name], value)
    if (name.strip(), junk) == ("run", "None"):
        assert message is not None
        assert message.startswith("mesh is missing")
    elif (name, junk) == ("fraction", "None"):  # then the body's name is taken for a place
        assert message is not None
        assert message.startswith("place 'a' is no place of a body")
    elif message is None:
        assert junk in TAKEN.get(name, ())
    elif junk not in NOT_SHOWN:
        assert any(text in message for text in texts(value)), message


@pytest.mark.parametrize("name", NUMERIC)
@pytest.mark.parametrize("kind", NUMBERS)
def test_real_numbers_of_any_kind_are_numbers(name, kind):
    """They are kept as floats, or refused for their size alone."""
    message = message_of(name, NUMERIC[name], NUMBERS[kind])
    plain = message_of(name, NUMERIC[name], float(NUMBERS[kind]))
    assert (message is None) == (plain is None)


@pytest.mark.parametrize("name", POINTS)
@pytest.mark.parametrize("kind", PAIRS)
def test_ordered_pairs_of_any_kind_are_points(name, kind):
    assert message_of(name, POINTS[name], PAIRS[kind]) is None


# --- functions ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", FUNCTIONS)
def test_functions_that_answer_nothing_useful_are_told_before_any_work(what):
    call = FUNCTIONS[what]
    for name, make in {
        "force": lambda: scene(loads=[at.Force("a.end", call)]),
        "angle": lambda: scene(joints=[at.Clamp("a.start", call)]),
        "velocity": lambda: scene(bodies=[body(velocity=call)]),
        "torque on 'a.end'": lambda: scene(loads=[at.Torque("a.end", call)]),
    }.items():
        with pytest.raises(PropertyError) as caught:
            make()
        message = str(caught.value)
        assert "\n" not in message
        assert name in message


def later(values):
    """A history that is zero at first and gives something else, or raises, after 0.012 s."""

    def history(t):
        if np.ndim(t):
            raise TypeError("one time, please")
        if t < 0.012:
            return (0.0,) * values[0]
        return values[1]()

    return history


LATE = {
    "nan": lambda: (nan, 0.0, 0.0),
    "raises": lambda: 1 / 0,
    "text": lambda: "x",
    "exits": lambda: (_ for _ in ()).throw(SystemExit(0)),
}
ROADS = {"anctmm": at.solve, "global-dae": global_dae.solve}


@pytest.mark.parametrize("road", ROADS)
@pytest.mark.parametrize("what", LATE)
@pytest.mark.parametrize("driven", [False, True])
def test_functions_that_fail_later_are_told_with_their_time(road, what, driven):
    clamp = at.Clamp("a.start", later((3, LATE[what])) if driven else None)
    loads = [] if driven else [at.Force("a.end", later((2, LATE[what])))]
    with pytest.raises(PropertyError, match=r"(angle|load on|force on).*at t = 0\.0(15|2) s"):
        ROADS[road](scene(joints=[clamp], loads=loads), mesh=1, dt=5e-3, t_end=0.02)


# --- dubious scenes ----------------------------------------------------------------------------------------


BAR, DOWN = [beam()], (0.0, -1.0)
START = [at.Force("a.start", (1.0, 1.0)), at.Torque("a.start", 1.0)]
THRICE = [at.Clamp("a.start"), at.Pin("a.end", "b.start", grounded=True), at.Clamp("b.end")]
DUBIOUS = {
    "free": scene_of(bodies=BAR),
    "held nowhere, pushed": scene_of(bodies=BAR, loads=[at.Force("a.end", (0.0, 1.0))]),
    "clamped at both ends": scene_of(at.Clamp("a.start"), at.Clamp("a.end"), bodies=BAR, gravity=DOWN),
    "pinned at both ends": scene_of(at.Pin("a.start"), at.Pin("a.end"), bodies=BAR, gravity=DOWN),
    "loaded where it is held": scene_of(at.Clamp("a.start"), bodies=BAR, loads=START),
    "one upon the other": scene_of(at.Pin("a.start"), at.Pin("b.start"), bodies=[beam(), beam("b")]),
    "held thrice": scene_of(*THRICE, gravity=DOWN),
}


def test_a_beam_without_length_is_refused():
    with pytest.raises(DegenerateBodyError, match=r"length \(m\) is 0.0"):
        body(end=(0.0, 0.0))


@pytest.mark.parametrize("what", DUBIOUS)
@pytest.mark.parametrize(
    "road",
    [*ROADS, "statics"],
)
def test_dubious_scenes_run_or_say_why_not(what, road):
    if road == "statics":
        found = at.solve_static(DUBIOUS[what], mesh=2)
        free = what in ("held nowhere, pushed",)
        assert not (free and found.status.ok)
    else:
        found = ROADS[road](DUBIOUS[what], mesh=2, dt=1e-3, t_end=5e-3)
        assert found.status.ok, found.status
    assert found.status.ok or found.status.message
