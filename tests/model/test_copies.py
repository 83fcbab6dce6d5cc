"""Whatever the public face offers can be copied, kept and changed in one part, as values of Python are."""

import copy
import inspect
import pickle
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

import anctmm as at
from anctmm import errors

ROD, RUBBER = at.Circle(0.03), at.Material(E=5e6, density=1100.0, damping=1e-3)
BEAM = at.Beam("a", (0, 0), (1, 0), ROD, RUBBER, velocity=at.RigidVelocity((0, 0), (1, 0), (0, 0), 1.0))
BODY = at.RigidBody("r", 1.0, 2.0, (2, 0), {"p": (1, 0)}, velocity=(0.0, 1.0), spin=0.5)
DRIVE = at.Quintic(turn=1.0, duration=2.0)
SCENE = at.Scene("s", [replace(BEAM, velocity=None)], [at.Clamp("a.start", DRIVE)], gravity=(0, -9.81))
RUN = at.Discretisation(mesh={"a": 2}, element={"a": "shear"}, integrator=at.Zhai(psi=0.4), dt=1e-3)
T = np.linspace(0.0, 1.0, 3)
ENERGY, STATUS = at.Energy(T, T, T, T), at.Status("diverged", "why", 0.5, 7, "a", 0, (1.0, 2.0))
SOLUTION = at.Solution("anctmm", SCENE, RUN, T, {}, ENERGY, at.Cost(cpu_s=1.0), STATUS)

#: One or more of every class.
THINGS = [
    ROD, RUBBER, BEAM, BODY, DRIVE, SCENE, RUN, ENERGY, STATUS, SOLUTION,
    at.Campbell("s", T, T, T, T),
    at.Case(SCENE, ["a.end", ("a", 0.3)], t_end=1.0, note="a note"),
    at.Clamp("a.end", stretch="free"),
    at.Revolute("a.end", axis=(1.0, 0.0, 0.0)),
    at.Comparison(0.1, 0.2, {"a.end": 0.1}, 2.0, (STATUS, STATUS), 3),
    at.Cost(1.0, 2.0, 3),
    at.Discretisation(mesh=3, integrator=at.Esdirk(), tolerance=1e-3),
    at.Discretisation(mesh=3, psi=0.6, integrator="zhai", newton_tolerance=1e-9),
    at.Esdirk(),
    at.Force("a.end", (0, 1), follower=True),
    at.Force("a.end", at.Pulse(1.0, 2.0)),
    at.GeneralizedAlpha(0.5),
    at.History(abs, [0.5]),
    at.HistoryError(SOLUTION),
    at.Interrupted(SOLUTION),
    at.LineLoad("a", (0, 1)),
    at.Modes(SCENE, RUN, T, T, T, {"a": T.astype(complex)}, {"a": T}),
    at.Pin("a.start"),
    at.Pin("a.start", ("r", 0.5), grounded=True),
    at.PointMass("m", 1.0, (0, 0), (1, 0)),
    at.Prismatic("r.p", (3, 1), body="b", position=DRIVE),
    at.Pulse(1.0, 2.0),
    at.Rectangle(0.1, 0.3),
    at.RigidVelocity((0, 0), (1, 0), (0, 0), 1.0),
    at.RotationalSpring("a.start", "r.p", 1.0, 2.0, angle=0.1, preload=0.5),
    at.Section(1.0, 1.0, 2.0),
    at.Slider("r.p", (1, 7), position=DRIVE),
    at.Spring("a.start", (0, 1), 1.0, length=2.0),
    at.Torque("a.end", 1.0),
    at.Weld("a.start", "r.p"),
    at.Weld("a.start", "r.p", angle=DRIVE, stretch="free"),
    at.Weld("a.start", "r.p", "m.center", grounded=True),
    at.Zhai(0.4, 0.6),
]  # fmt: skip

#: One part of what takes no part by its name, or whose parts depend on each other, changed.
CHANGES = {
    at.Circle: {"diameter": 0.5},
    at.Rectangle: {"height": 0.5},
    at.Pin: {"ends": ("x.start", "y.end")},
    at.Weld: {"ends": ("x.start", ("y", 0.25)), "stretch": "free"},
    at.Clamp: {"end": "x.start"},
    at.Slider: {"direction": (0.0, 1.0)},
    at.RigidBody: {"points": {"q": (5.0, 6.0)}},
    at.Section: {"area": 2.0},
    at.Scene: {"gravity": (1.0, 0.0)},
    at.Case: {"t_end": 2.0, "output_dt": 0.1},
}

WAYS = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda thing: pickle.loads(pickle.dumps(thing)),
    "replace": lambda thing: replace(thing) if is_dataclass(thing) else thing,
}


def parts(thing):
    """All that makes it, of any depth, as values that can be compared."""
    if isinstance(thing, np.ndarray):
        return thing.dtype.str, thing.shape, thing.tobytes()
    if isinstance(thing, BaseException):
        return type(thing), str(thing), parts(vars(thing))
    if isinstance(thing, dict):
        return [(key, parts(value)) for key, value in thing.items()]
    if isinstance(thing, list | tuple):
        return [parts(value) for value in thing]
    if is_dataclass(thing):
        return type(thing), [(f.name, parts(getattr(thing, f.name))) for f in fields(thing)]
    return type(thing), repr(thing)


def test_every_public_class_is_here():
    public = {getattr(at, name) for name in at.__all__ if inspect.isclass(getattr(at, name))}
    assert {type(thing) for thing in THINGS} == public - {
        at.Joint,
        at.Simulator,
    }  # a base, and what runs a scene


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("thing", THINGS, ids=lambda thing: type(thing).__name__)
def test_copies_are_the_same(thing, way):
    made = WAYS[way](thing)
    assert parts(made) == parts(thing)
    if way != "copy" and type(thing) in CHANGES:
        assert made == thing
        assert hash(made) == hash(thing)


@pytest.mark.parametrize("thing", [t for t in THINGS if type(t) in CHANGES], ids=lambda t: type(t).__name__)
def test_one_part_is_replaced(thing):
    changes = CHANGES[type(thing)]
    made = replace(thing, **changes)
    assert {name: getattr(made, name) for name in changes} == changes
    derived = {at.Circle: {"diameter"}, at.Rectangle: {"width", "height"}}.get(type(thing))
    kept = (derived or {f.name for f in fields(thing) if f.init}) - changes.keys()
    assert {name: parts(getattr(made, name)) for name in kept} == {
        name: parts(getattr(thing, name)) for name in kept
    }


def test_a_changed_shape_has_the_moments_of_the_new_one():
    assert replace(ROD, diameter=0.5) == at.Circle(0.5)
    assert replace(at.Rectangle(0.1, 0.3), width=0.2) == at.Rectangle(0.2, 0.3)
    with pytest.raises((ValueError, TypeError), match="area"):
        replace(ROD, area=1.0)


def test_places_are_given_once():
    assert at.Pin(ends=["a.start", "b.start"]) == at.Pin("a.start", "b.start")
    with pytest.raises(errors.PropertyError, match="one by one or as ends"):
        at.Weld("a.start", ends=["b.start"])
    with pytest.raises(errors.PropertyError, match="a list of places is needed"):
        at.Pin(ends="a.start")


@pytest.mark.parametrize(
    "kind",
    [
        kind
        for kind in vars(errors).values()
        if inspect.isclass(kind) and issubclass(kind, errors.AnctmmError)
    ],
    ids=lambda kind: kind.__name__,
)
def test_errors_are_kept(kind):
    made = pickle.loads(pickle.dumps(kind("what is wrong")))
    assert (type(made), str(made)) == (kind, str(kind("what is wrong")))
