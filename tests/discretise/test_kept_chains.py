"""Chains kept between runs: the answers are the same, nothing that is written is shared, users' functions are asked."""

import gc
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest
from marks import interpreted_where
from samples import SOFT, SQUARE, beam

import anctmm as at
from anctmm.discretise import kept_chains
from anctmm.discretise.kept_chains import CHAINS, NODES, own
from anctmm.errors import MeshError, StabilityError
from anctmm.integrators import zhai
from anctmm.integrators.implicit import system as implicit_system
from anctmm.jit.copies import Copies
from anctmm.jit.interpreting import interpreted
from anctmm.solve import _checked_chain

ROW = [beam(), beam("b", (1.0, 0.0), (2.0, 0.0))]
DRIVEN = at.Clamp("a.start", angle=at.Quintic(turn=0.3, duration=0.05))
TORQUE = at.Torque("b.end", lambda t: 0.1 * t)
SCENES = {
    "hinged": at.Scene("hinged", ROW, [at.Pin("a.start"), at.Pin("a.end", "b.start")], gravity=(0.0, -9.81)),
    "driven": at.Scene("driven", ROW, [DRIVEN, at.Weld("a.end", "b.start")], [TORQUE]),
    "branching": at.Scene(
        "branching", [*ROW, beam("c", (1.0, 0.0), (1.0, 1.0))], [at.Weld("a.end", "b.start", "c.start")], gravity=(1, 0)
    ),
    "loop": at.Scene(
        "loop",
        [*ROW, beam("c", (2.0, 0.0), (1.0, 1.0)), beam("d", (1.0, 1.0), (0.0, 0.0))],
        [at.Pin(f"{one}.end", f"{two}.start") for one, two in ("ab", "bc", "cd", "da")],
        gravity=(0.0, -1.0),
    ),
}  # fmt: skip
#: No other scene of the suite or of `anctmm check` needs the kernels of this loop.
every_scene = pytest.mark.parametrize("name", interpreted_where(lambda name: name == "loop", SCENES))
RUNS = {
    "zhai": at.Discretisation(mesh=2, integrator="zhai", dt=1e-4, t_end=2e-3),
    "shear": at.Discretisation(mesh=2, element="shear", dt=1e-3, t_end=2e-2),
    "generalized-alpha": at.Discretisation(mesh=2, dt=1e-3, t_end=2e-2),
    "tolerance": at.Discretisation(mesh=2, integrator="generalized-alpha", tolerance=1e-3, t_end=2e-2),
}


@pytest.fixture(autouse=True)
def nothing_kept():
    kept_chains._chains.clear()


def numbers(solution):
    """All numbers of a solution, as bytes."""
    arrays = [solution.t, *vars(solution.energy).values(), *(f.coordinates for f in solution.fields.values())]
    return (
        [np.asarray(a).tobytes() for a in arrays],
        solution.status,
        solution.dofs,
        solution.cost.newton_iterations,
    )


@every_scene
@pytest.mark.parametrize("run", RUNS)
def test_a_second_run_is_the_first_one_again(name, run):
    first = at.solve(SCENES[name], RUNS[run])
    assert len(kept_chains._chains) == 1
    assert first.status.ok, first.status
    said = numbers(first)
    first.t[:] = -1.0  # what a user does to his answer is his own affair
    for field in first.fields.values():
        field.coordinates[:] = np.nan
    for series in vars(first.energy).values():
        series[:] = np.nan
    assert numbers(at.solve(SCENES[name], RUNS[run])) == said
    kept_chains._chains.clear()
    assert numbers(at.solve(SCENES[name], RUNS[run])) == said


@every_scene
@pytest.mark.parametrize("run", RUNS)
def test_a_scene_after_another_of_its_structure_gives_what_it_gives_alone(name, run):
    scene = SCENES[name]
    bodies = [replace(body, material=at.Material(E=4e5, density=800.0)) for body in scene.bodies]
    other = replace(scene, bodies=bodies, gravity=(1.0, -5.0))
    kept_chains.forget()
    at.solve(scene, RUNS[run])
    after = numbers(at.solve(other, RUNS[run]))
    kept_chains.forget()
    assert numbers(at.solve(other, RUNS[run])) == after


@every_scene
@pytest.mark.parametrize("run", RUNS)
def test_scenes_that_differ_in_stiffness_alone_give_what_they_give_alone(name, run):
    """What follows from places and masses is found for the first two of them, and copied for the others."""
    scene = SCENES[name]

    def stiffer(E):
        bodies = [
            replace(body, material=replace(body.material, E=E * body.material.E)) for body in scene.bodies
        ]
        return replace(scene, bodies=bodies)

    kept_chains.forget()
    after = [numbers(at.solve(stiffer(E), RUNS[run])) for E in (1.0, 1.1, 1.2, 1.3)][-1]
    kept_chains.forget()
    assert numbers(at.solve(stiffer(1.3), RUNS[run])) == after


@every_scene
@pytest.mark.parametrize(
    ("run", "system"), [("zhai", zhai._system), ("generalized-alpha", implicit_system.new_system)]
)
def test_what_runs_share_is_never_written(name, run, system):
    at.solve(SCENES[name], RUNS[run])
    (chain,) = kept_chains._chains.values()
    with own(chain, system) as one, own(chain, system) as two:
        pairs = list(zip(arrays_of(one), arrays_of(two), strict=True))
        shared = [(a, a.copy()) for a, b in pairs if np.shares_memory(a, b)]
        first = [a.tobytes() for a, _ in pairs]
    assert shared
    facts = [(a, a.copy()) for a in arrays_of(tuple(vars(chain).values()))]
    solution = at.solve(SCENES[name], RUNS[run])
    for now, before in [*shared, *facts]:
        assert now.tobytes() == before.tobytes()
    with own(chain, system) as again:
        arrays = list(arrays_of(again))
        assert any(now is a for now in arrays for a, b in pairs if not np.shares_memory(a, b))
        assert [now.tobytes() for now in arrays] == first
    answers = [
        solution.t,
        *vars(solution.energy).values(),
        *(f.coordinates for f in solution.fields.values()),
    ]
    assert not any(np.shares_memory(a, b) for a in answers for b in arrays)


def test_arrays_of_a_run_that_an_exception_ended_are_not_taken_again():
    copies = Copies((np.zeros(3),))
    with pytest.raises(KeyboardInterrupt), copies.one() as (array,):
        raise KeyboardInterrupt
    with copies.one() as (other,):
        assert other is not array
        other[:] = 1.0
    with copies.one() as (third,):
        assert third is other
        assert not third.any()


def arrays_of(thing):
    """All arrays of nested tuples, dictionaries and lists."""
    if isinstance(thing, np.ndarray):
        yield thing
    elif isinstance(thing, dict):
        yield from arrays_of(tuple(thing.values()))
    elif isinstance(thing, tuple | list):
        for part in thing:
            yield from arrays_of(part)


PLATE = at.RigidBody("plate", 0.5, 3e-3, (1.1, 0.1), {"a": (1.0, 0.0), "b": (1.2, 0.2)})
BASED = at.Scene("plate", [beam(), PLATE], [DRIVEN, at.Pin("a.end", "plate.a")], gravity=(0.0, -9.81))
SPRING = at.Spring("plate.b", (1.5, 0.5), stiffness=3.0, damping=0.1)
#: The same scene with some of its numbers changed.
CHANGED = {
    "stiffness": {"bodies": [replace(beam(), material=replace(SOFT, E=2.0 * SOFT.E)), PLATE]},
    "density": {"bodies": [replace(beam(), material=replace(SOFT, density=2.0 * SOFT.density)), PLATE]},
    "damping": {"bodies": [replace(beam(), material=replace(SOFT, damping=1e-3)), PLATE]},
    "length": {"bodies": [replace(beam(), start=(-0.5, 0.0)), PLATE]},
    "mass": {"bodies": [beam(), replace(PLATE, mass=0.7)]},
    "inertia": {"bodies": [beam(), replace(PLATE, inertia=5e-3)]},
    "center": {"bodies": [beam(), replace(PLATE, center=(1.2, 0.0))]},
    "spin": {"bodies": [beam(), replace(PLATE, velocity=(-0.01, 0.01), spin=0.1)]},
    "drive": {"joints": [replace(DRIVEN, angle=at.Quintic(turn=0.5, duration=0.05)), BASED.joints[1]]},
    "spring": {"connectors": [SPRING]},
    "points": {
        "bodies": [beam(), replace(PLATE, points={"a": (1.0, 0.0), "b": (1.3, 0.0)})],
        "connectors": [SPRING],
    },
    "load": {"loads": [at.Force("plate.b", lambda t: (0.0, -t))]},
}


@pytest.mark.parametrize("run", ["zhai", "generalized-alpha"])
def test_scenes_that_differ_in_any_number_give_what_they_give_alone(run):
    scenes = [BASED, *(replace(BASED, **changed) for changed in CHANGED.values())]
    with interpreted():
        kept_chains.forget()
        together = [numbers(at.solve(scene, RUNS[run])) for scene in [*scenes, *scenes]]
        for scene, one, again in zip(scenes, together[: len(scenes)], together[len(scenes) :], strict=True):
            kept_chains.forget()
            assert numbers(at.solve(scene, RUNS[run])) == one == again
    assert len({tuple(said[0]) for said in together}) == len(scenes)


@pytest.mark.parametrize("run", ["zhai", "generalized-alpha"])
def test_solutions_share_no_array(run):
    with interpreted():
        scenes = [BASED, BASED, replace(BASED, **CHANGED["stiffness"])]
        found = [list(arrays_in(at.solve(scene, RUNS[run]))) for scene in scenes]
    for k, one in enumerate(found):
        for other in found[k + 1 :]:
            assert not any(np.shares_memory(a, b) for a in one for b in other)


def arrays_in(solution):
    """All arrays of a solution."""
    yield from arrays_of([solution.t, *vars(solution.energy).values()])
    for field in solution.fields.values():
        yield from arrays_of([thing for thing in vars(field).values() if thing is not None])


def test_runs_side_by_side_do_not_meet():
    wanted = {run: numbers(at.solve(SCENES["driven"], RUNS[run])) for run in ("zhai", "generalized-alpha")}
    kept_chains._chains.clear()
    found, barrier = [], threading.Barrier(4)

    def work(run):
        barrier.wait()
        for _ in range(10):
            found.append(numbers(at.solve(SCENES["driven"], RUNS[run])) == wanted[run])

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        threads = [threading.Thread(target=work, args=(run,)) for run in (*wanted, *wanted)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert found == [True] * 40


def test_functions_of_the_user_are_asked_in_each_run():
    size = [1.0]
    load = at.Force("bar.end", lambda t: (0.0, size[0]))
    bar = at.Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT)
    scene = at.Scene("bar", [bar], [at.Clamp("bar.start")], [load])
    one = at.solve(scene, RUNS["zhai"]).position("bar", 1.0)[-1, 1]
    size[0] = 2.0
    assert at.solve(scene, RUNS["zhai"]).position("bar", 1.0)[-1, 1] == pytest.approx(2.0 * one, rel=1e-6)

    speed = [1.0]
    moving = at.Scene("moving", [replace(bar, velocity=lambda s: (speed[0], 0.0))])
    assert at.solve(moving, RUNS["zhai"]).energy.kinetic[0] == pytest.approx(0.5 * 0.4, rel=1e-6)
    speed[0] = 2.0
    assert at.solve(moving, RUNS["zhai"]).energy.kinetic[0] == pytest.approx(2.0 * 0.4, rel=1e-6)


def test_equal_scenes_and_other_runs_are_told_apart():
    scene = SCENES["hinged"]
    same = replace(scene)
    assert same == scene
    assert at.solve(same, RUNS["zhai"]).scene is same
    assert at.solve(scene, RUNS["zhai"]).scene is scene
    assert len(at.solve(scene, replace(RUNS["zhai"], t_end=1e-3)).t) == 11
    assert len(at.solve(scene, RUNS["zhai"]).t) == 21


def test_what_is_refused_is_refused_again():
    run = replace(RUNS["zhai"], dt=1e-2, t_end=0.1)
    for _ in range(2):
        with pytest.raises(StabilityError):
            at.solve(SCENES["hinged"], run)
    for _ in range(2):
        with pytest.raises(MeshError):
            at.solve(SCENES["hinged"], replace(RUNS["zhai"], mesh={"nobody": 2}))


def test_few_and_small_ones_are_kept():
    scene, long = SCENES["hinged"], replace(RUNS["zhai"], mesh=NODES, check_stability=False)
    kept_chains.chain_of(scene, long, _checked_chain)
    assert not kept_chains._chains
    kept_chains.chain_of(scene, replace(RUNS["zhai"], dt=1e-6, t_end=0.1), _checked_chain)
    assert not kept_chains._chains
    for k in range(CHAINS + 3):
        kept_chains.chain_of(scene, replace(RUNS["zhai"], mesh=k + 1), _checked_chain)
        assert 1 <= len(kept_chains._chains) <= CHAINS


def test_a_copy_shares_nothing_but_what_shared_before():
    whole = np.arange(24.0).reshape(4, 6)
    one = np.array([1.0 + 2.0j])
    turned = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    thing = (
        whole,
        (whole.ravel(), whole[1:3, 2:], whole[:, ::2], turned, turned.T, one.real, np.zeros((0, 3))),
        3,
        None,
        whole,
    )
    with Copies(thing).one() as copy:
        pass
    for old, new in zip(arrays_of(thing), arrays_of(copy), strict=True):
        assert np.array_equal(old, new)
        assert (old.shape, old.strides, old.dtype) == (new.shape, new.strides, new.dtype)
        assert not np.shares_memory(old, new)
    assert copy[2:4] == (3, None)
    copy[0][2, 4] = -1.0
    assert copy[1][0][16] == copy[1][1][1, 2] == copy[1][2][2, 2] == copy[4][2, 4] == -1.0
    copy[1][3][1, 2] = -2.0
    assert copy[1][4][2, 1] == -2.0


def test_nothing_stays_of_scenes_long_gone():
    counted = sum(type(thing) is at.Scene for thing in gc.get_objects())
    for k in range(3 * CHAINS):
        at.solve(replace(SCENES["hinged"], name=f"s{k}"), RUNS["zhai"])
    gc.collect()
    assert sum(type(thing) is at.Scene for thing in gc.get_objects()) <= counted + CHAINS + 1
