"""Facts of a structure: scenes alike share them, whatever their numbers, and they are those that each would find."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from odd_graphs import LAYOUTS, held
from random_acting import asked_mechanism
from random_graphs import random_graph
from random_mechanisms import random_mechanism
from samples import beam

import anctmm as at
from anctmm.discretise import kept_chains
from anctmm.discretise.chain import Chain
from anctmm.discretise.junctions.segments import _inside
from anctmm.discretise.junctions.structure import ELEMENTS, shared
from anctmm.errors import MeshError
from anctmm.model.kept import BODIES, PREFIX, facts_alike
from anctmm.model.needs import features_of
from anctmm.model.scene import unchecked_scene
from anctmm.recursion.branches import branches
from anctmm.recursion.kept.loops import loops
from anctmm.recursion.riccati import links
from anctmm.results.checks.constraints import constraints_of
from anctmm.results.checks.mechanisms import is_mechanism

SHARED = [name for name, what in vars(Chain).items() if isinstance(what, shared)]
SEEDS = range(40)
SOFTER = at.Material(E=3e5, density=700.0)


@pytest.fixture(autouse=True)
def nothing_kept():
    kept_chains.forget()


def bent(scene, factor):
    """The same structure: other lengths and other angles between bodies, sections and materials, another gravity, and
    no loads.
    """

    def point(x):
        return factor * x[0] + 0.4 * x[1] * x[1], factor * x[1] - 0.3 * x[0] * x[0]

    def body(one):
        match one:
            case at.Beam():
                section = at.Circle(0.007)
                return replace(
                    one, start=point(one.start), end=point(one.end), section=section, material=SOFTER
                )
            case at.RigidBody():
                points = {key: point(x) for key, x in one.points.items()}
                return replace(one, mass=3.0 * one.mass, center=point(one.center), points=points)
            case at.PointMass():
                return replace(one, mass=2.0 * one.mass, position=point(one.position))

    return unchecked_scene(scene.name, map(body, scene.bodies), scene.joints, [], (0.3, -2.0), [])


def facts(chain):
    """All that chains alike have in common."""
    kept = loops(chain, branches(chain))
    pattern = (
        ()
        if kept is None
        else (kept.begin, kept.end, kept.start, kept.unknowns, kept.shared, kept.own, kept.cross)
    )
    matrix = () if kept is None else (kept.matrix.above_row, kept.matrix.left_column, kept.matrix.dual)
    return (
        {name: getattr(chain, name) for name in SHARED},
        tuple(branches(chain)), links(chain).link, links(chain).known, pattern, matrix,
        _inside(chain.scene), dict(features_of(chain.parts)),
        () if is_mechanism(chain.parts) else tuple(constraints_of(chain.parts)),
    )  # fmt: skip


def same(one, two):
    """Whether nested things are equal."""
    if isinstance(one, np.ndarray):
        return one.dtype == two.dtype and one.shape == two.shape and np.array_equal(one, two)
    if isinstance(one, dict):
        return list(one) == list(two) and all(map(same, one.values(), two.values()))
    if isinstance(one, tuple | list):
        return len(one) == len(two) and all(map(same, one, two))
    return one == two


def mechanism(seed):
    return random_mechanism(seed, inside=True, welds=seed % 2 == 0), at.Discretisation(mesh=2)


def with_loads(seed):
    return asked_mechanism(seed).scene, at.Discretisation(mesh=4)


def odd(seed):
    scenes = [
        one for layout in LAYOUTS.values() for kind in (at.Pin, at.Weld) for _, one in held(layout, kind)
    ]
    return scenes[seed * len(scenes) // len(SEEDS)], at.Discretisation(mesh=1)


@pytest.mark.parametrize("draw", [random_graph, mechanism, with_loads, odd])
def test_facts_shared_are_those_found_alone(draw):
    assert {"plan", "vertices", "prescribed", "held", "link", "onward"} <= set(SHARED)
    met = 0
    for seed in SEEDS:
        scene, run = draw(seed)
        kept_chains.forget()
        first = Chain(scene, run)
        facts(first)
        other = Chain(bent(scene, 1.7), run)
        assert other.facts is first.facts or other.parts is not other.scene
        found = facts(other)
        met += other.plan is first.plan
        kept_chains.forget()
        assert same(found, facts(Chain(bent(scene, 1.7), run))), seed
    assert met > len(SEEDS) / 2


ROW = [beam(), beam("b", (1.0, 0.0), (2.0, 0.0))]


def test_another_structure_shares_nothing():
    scene = at.Scene("row", ROW, [at.Pin("a.start"), at.Pin("a.end", "b.start")])
    run = at.Discretisation(mesh=2)
    chain = Chain(scene, run)
    others = [
        (replace(scene, joints=[at.Pin("a.start"), at.Weld("a.end", "b.start")]), run),
        (replace(scene, joints=[at.Clamp("a.start"), at.Pin("a.end", "b.start")]), run),
        (
            replace(scene, bodies=[ROW[0], replace(ROW[1], name="c")], joints=[at.Pin("a.end", "c.start")]),
            run,
        ),
        (replace(scene, bodies=[ROW[1], ROW[0]]), run),
        (scene, replace(run, mesh=3)),
        (scene, replace(run, element="shear")),
        (scene, replace(run, mesh={"a": 1, "b": 2})),
    ]
    known = [chain.facts]
    for other in others:
        found = Chain(*other).facts
        assert all(found is not one for one in known)
        known.append(found)
    assert Chain(replace(scene, gravity=(1.0, 0.0)), run).facts is chain.facts


def test_large_scenes_and_histories_without_a_hash_keep_nothing():
    run = at.Discretisation(mesh=ELEMENTS + 1)
    assert Chain(at.Scene("long", [beam()]), run).facts is not Chain(at.Scene("long", [beam()]), run).facts
    many = [at.PointMass(f"m{k}", 1.0, (float(k), 0.0)) for k in range(BODIES + 1)]
    assert facts_alike(at.Scene("many", many)) is not facts_alike(at.Scene("many", many))

    class Turn:
        __hash__ = None

        def __call__(self, t):
            return 0.0 * t, 0.0 * t, 0.0 * t

    one, two = (
        at.Scene("odd", [beam()], [at.Clamp("a.start", angle=Turn())], gravity=(0, -1)) for _ in range(2)
    )
    assert facts_alike(one) is not facts_alike(two)
    assert facts_alike(one) is facts_alike(one)
    assert at.solve(one, mesh=1, dt=1e-3, t_end=2e-3).status.ok


def test_what_is_stored_of_a_scene_has_no_facts():
    scene = at.Scene("row", ROW, [at.Pin("a.end", "b.start")])
    at.solve(scene, mesh=1, dt=1e-3, t_end=2e-3)
    assert any(name.startswith(PREFIX) for name in vars(scene))
    again = pickle.loads(pickle.dumps(scene))
    assert again == scene
    assert not any(name.startswith(PREFIX) for name in vars(again))


def test_options_of_equal_value_and_another_type_are_checked_for_themselves():
    scene = at.Scene("one", [beam()])
    assert (
        at.solve(scene, mesh=1, dt=1e-3, t_end=2e-3).run is at.solve(scene, mesh=1, dt=1e-3, t_end=2e-3).run
    )
    with pytest.raises(MeshError):
        at.solve(scene, mesh=True, dt=1e-3, t_end=2e-3)
    assert at.solve(scene, mesh={"a": 1}, dt=1e-3, t_end=2e-3).status.ok
