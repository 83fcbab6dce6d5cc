"""Explicit steps of scenes that keep few unknowns: their independent motions beside scalar blocks."""

from math import pi

import numpy as np
import pytest
from direct import assert_as_dense, by_split
from marks import exhaustive_where
from random_mechanisms import random_mechanism

import anctmm as at
from anctmm.discretise import kept
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.fitting import mass_matrix
from anctmm.discretise.kept_chains import forget
from anctmm.recursion.kept import motions
from anctmm.recursion.split import split_factors
from reference import global_dae

SECTION, MATERIAL = at.Rectangle(0.02, 0.01), at.Material(E=1e9, density=1000.0)
G = 9.81
TURN = at.Quintic(turn=2.0 * pi, duration=0.4)
DRIVEN = at.Clamp("crank.start", angle=TURN)
BETWEEN = {"crank": "cable", "coupler": "rigid", "follower": "cable"}
RIGID = {"crank": "rigid", "coupler": "cable", "follower": "rigid"}
ENDS = {
    "crank": ((0.0, 0.0), (0.2, 0.0)),
    "coupler": ((0.2, 0.0), (0.9, 0.4)),
    "follower": ((0.9, 0.4), (0.7, 0.0)),
}


def four_bar(first=DRIVEN, *more, ends=ENDS, joint=at.Pin):
    bodies = [at.Beam(name, *places, SECTION, MATERIAL) for name, places in ends.items()]
    joints = [
        first,
        joint("crank.end", "coupler.start"),
        at.Pin("coupler.end", "follower.start"),
        at.Pin("follower.end"),
    ]
    return at.Scene("four-bar", bodies, [*joints, *more], gravity=(0.0, -G))


def slider_crank(kind):
    block = [at.PointMass("block", 0.3, (0.8, 0.0))] if kind is at.Slider else []
    bodies = [
        at.RigidBody("crank", 1.0, 0.01, (0.1, 0.0), {"o": (0.0, 0.0), "e": (0.2, 0.0)}),
        at.Beam("rod", (0.2, 0.0), (0.8, 0.0), SECTION, MATERIAL),
        *block,
    ]
    joints = [at.Clamp("crank.o", angle=TURN), at.Pin("crank.e", "rod.start"), kind("rod.end")]
    joints += [at.Pin("rod.end", "block.center")] if block else []
    return at.Scene("slider-crank", bodies, joints, gravity=(0.0, -G))


def ring():
    """Four beams in a loop, no rigid body: one junction is kept, it hangs by a tail."""
    corners = [(0.0, 0.0), (0.4, 0.0), (0.4, 0.2), (0.4, 0.4)]
    bodies = [at.Beam(f"b{k}", corners[k], corners[(k + 1) % 4], SECTION, MATERIAL) for k in range(4)]
    bodies.append(at.Beam("tail", (0.4, 0.4), (0.6, 0.4), SECTION, MATERIAL))
    joints = [at.Pin(f"b{k}.end", f"b{(k + 1) % 4}.start") for k in (0, 2, 3)]
    joints += [at.Weld("b1.end", "b2.start"), at.Pin("b2.end", "tail.start"), at.Pin("tail.end")]
    return at.Scene("ring", bodies, joints, gravity=(0.0, -G))


SCENES = {
    "rigid crank and follower": (four_bar(), {"element": RIGID}),
    "welded coupler": (four_bar(joint=at.Weld), {"element": RIGID}),
    "three rigid bodies": (four_bar(), {"mesh": 1, "element": "rigid"}),
    "rigid coupler, driven beam": (four_bar(), {"element": BETWEEN}),
    "short driven beam": (four_bar(), {"mesh": {"crank": 1, "coupler": 1, "follower": 2}, "element": BETWEEN}),
    "shear coupler": (four_bar(), {"element": {**RIGID, "coupler": "shear"}, "scale": 0.2}),
    "shear and cable": (four_bar(), {"element": {**RIGID, "crank": "shear"}, "scale": 0.2}),
    "fixed crank": (four_bar(at.Clamp("crank.start")), {"element": RIGID}),
    "free crank": (four_bar(at.Pin("crank.start")), {"element": RIGID}),
    "slider-crank": (slider_crank(at.Slider), {"mesh": 3}),
    "prismatic": (slider_crank(at.Prismatic), {"mesh": 3}),
    "ring": (ring(), {}),
}  # fmt: skip


def cut(scene, element="cable", mesh=2, **options):
    """Options with so many elements of each beam, and one of each rigid one."""
    kinds = (
        element if isinstance(element, dict) else dict.fromkeys((beam.name for beam in scene.beams), element)
    )
    each = mesh if isinstance(mesh, dict) else dict.fromkeys(kinds, mesh)
    fine = {name: 1 if kind == "rigid" else each[name] for name, kind in kinds.items()}
    return {"mesh": fine or 1, "element": kinds or "cable", **options}


def marched(scene, steps=200, scale=1.0, solver=at.solve, **options):
    dt = 2e-5 * scale
    run = {"integrator": "zhai", "dt": dt, "t_end": steps * dt, "output_dt": steps * dt / 4}
    return solver(scene, **cut(scene, **options), **run)


def in_blocks(monkeypatch, scene, **options):
    """The same run by full blocks and the sparse system of what is kept."""
    forget()
    with monkeypatch.context() as patch:
        patch.setattr(kept, "FEW", -1)
        patch.setattr(kept.KeptUnknowns, "pinned", False)
        found = marched(scene, **options)
    forget()
    return found


def same(ours, other, allowed):
    assert ours.status.ok
    assert other.status.ok
    for body in ours.scene.bodies:
        for key in (0.0, 0.5, 1.0) if isinstance(body, at.Beam) else body.keys:
            path = ours.position(body.name, key)
            way = max(float(np.abs(path - path[0]).max()), 1e-4)
            assert np.abs(path - other.position(body.name, key)).max() < allowed * way
    size = max(np.abs(ours.energy.work).max(), ours.energy.kinetic.max(), 1e-9)
    assert np.abs(ours.energy.kinetic - other.energy.kinetic).max() < 10.0 * allowed * size
    return size


@pytest.mark.parametrize("name", exhaustive_where(lambda name: "shear" in name or name == "ring", SCENES))
def test_a_motion_is_that_of_full_blocks_and_of_the_global_dae(name, monkeypatch):
    scene, options = SCENES[name]
    chain = Chain(scene, Discretisation(**cut(scene, **{k: v for k, v in options.items() if k != "scale"})))
    assert chain.split
    assert chain.plan.kept
    ours = marched(scene, **options)
    blocks = in_blocks(monkeypatch, scene, **options)
    size = same(ours, blocks, 1e-9)
    assert np.abs(ours.energy.work - blocks.energy.work).max() < 1e-9 * size
    for joint in scene.joints:
        try:
            found, exact = ours.reaction(joint), blocks.reaction(joint)
        except at.errors.ResultError:  # of thin rigid bars they are not known
            continue
        assert np.abs(found - exact).max() < 1e-7 * max(np.abs(exact).max(), 1e-3)
    same(ours, marched(scene, solver=global_dae.solve, **options), 1e-9)


def keeping(seed, mesh):
    """Chain of a random mechanism that keeps unknowns; its test is skipped where it keeps none."""
    chain = Chain(random_mechanism(seed), Discretisation(mesh=mesh))
    if not chain.split or not chain.plan.kept:
        pytest.skip("no unknowns are kept, or in full blocks")
    return chain


def test_most_random_mechanisms_keep_unknowns():
    """Those of the next two tests are 43 and 15; the others are skipped."""
    chains = [Chain(random_mechanism(seed), Discretisation(mesh=2)) for seed in range(60)]
    kept = [bool(chain.split and chain.plan.kept) for chain in chains]
    assert sum(kept) >= 40
    assert sum(kept[::3]) >= 12


@pytest.mark.parametrize("seed", range(60))
def test_accelerations_are_those_of_the_dense_constrained_matrix(seed):
    chain = keeping(seed, mesh=1 + seed % 3)
    q = chain.bodies.reference()
    f = np.random.default_rng(seed).standard_normal(q.shape)
    f[chain.prescribed] = 0.0
    assert_as_dense(chain, f, by_split(chain, q, f))


@pytest.mark.parametrize("seed", range(0, 60, 3))
def test_random_mechanisms_move_as_by_full_blocks(seed, monkeypatch):
    scene = keeping(seed, mesh=2).scene
    same(marched(scene, steps=20), in_blocks(monkeypatch, scene, steps=20), 1e-9)


def test_what_repeats_another_constraint_changes_nothing(monkeypatch):
    """A third crank of a parallelogram, and a bar that the ground holds at both ends."""
    posts = [at.Beam(f"p{k}", (0.3 * k, 0.0), (0.3 * k, 0.2), SECTION, MATERIAL) for k in range(3)]
    bar = at.RigidBody("bar", 1.0, 0.05, (0.3, 0.2), {f"p{k}": (0.3 * k, 0.2) for k in range(3)})
    joints = [at.Pin(f"p{k}.start") for k in range(3)] + [at.Pin(f"p{k}.end", f"bar.p{k}") for k in range(3)]
    parallelogram = at.Scene("parallelogram", [*posts, bar], joints, gravity=(2.0, -G))
    held = at.Beam("held", (0.0, 0.0), (1.0, 0.0), SECTION, MATERIAL)
    still = at.Scene("held", [held], [at.Pin("held.start"), at.Pin("held.end")], gravity=(0.0, -G))
    for scene in (parallelogram, still):
        assert Chain(scene, Discretisation(mesh=1, element="rigid")).split
        options = {"mesh": 1, "element": "rigid", "scale": 10.0}
        same(marched(scene, **options), in_blocks(monkeypatch, scene, **options), 1e-9)


def test_a_linkage_that_locks_is_told_as_by_full_blocks(monkeypatch):
    """A crank longer than its follower and coupler reach."""
    ends = {
        "crank": ((0.0, 0.0), (0.5, 0.0)),
        "coupler": ((0.5, 0.0), (0.8, 0.3)),
        "follower": ((0.8, 0.3), (0.6, 0.0)),
    }
    scene = four_bar(at.Clamp("crank.start", angle=at.Quintic(turn=3.0, duration=0.2)), ends=ends)
    options = {"mesh": 1, "element": "rigid", "scale": 50.0}
    ours, blocks = marched(scene, **options), in_blocks(monkeypatch, scene, **options)
    assert ours.status.code == blocks.status.code == "failed"
    assert ours.status.step == blocks.status.step
    assert "leave the bodies no admissible position" in ours.status.message
    assert "rigid body" in ours.status.message


def test_many_kept_unknowns_and_angled_welds_take_full_blocks():
    rows = [
        at.Beam(f"b{k}", (0.1 * k, 0.0), (0.1 * (k + 1), 0.0), SECTION, MATERIAL) for k in range(kept.FEW + 2)
    ]
    joints = [at.Pin("b0.start"), *(at.Pin(f"b{k}.end", f"b{k + 1}.start") for k in range(len(rows) - 1))]
    assert not Chain(at.Scene("row", rows, joints), Discretisation(mesh=1, element="rigid")).split
    few = at.Scene("row", rows[:3], joints[:3])
    assert Chain(few, Discretisation(mesh=1, element="rigid")).split
    bent = [
        at.Beam("c", (0.3, 0.0), (0.5, 0.1), SECTION, MATERIAL),
        at.Beam("d", (0.5, 0.1), (0.6, 0.0), SECTION, MATERIAL),
    ]
    welded = at.Scene(
        "bent", [*few.bodies, *bent], [*few.joints, at.Pin("b2.end", "c.start"), at.Weld("c.end", "d.start")]
    )
    element = {**dict.fromkeys(("b0", "b1", "b2"), "rigid"), "c": "cable", "d": "cable"}
    assert not Chain(welded, Discretisation(mesh=1, element=element)).split


def test_fields_have_unit_masses_and_hold_what_is_linear():
    chain = Chain(four_bar(), Discretisation(**cut(four_bar(), RIGID)))
    found = split_factors(chain).kept
    assert np.abs(chain.kept.constraints.linear @ found.basis).max() < 1e-12
    gram = found.fields @ (mass_matrix(chain.bodies) @ found.fields.T)
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-12


@pytest.mark.exhaustive
@pytest.mark.compiled
def test_joints_do_not_part_in_a_million_steps():
    scene, options = SCENES["three rigid bodies"]
    s = at.solve(scene, integrator="zhai", dt=1e-5, t_end=10.0, output_dt=0.5, **options)
    assert s.status.ok
    for one, two in (("crank", "coupler"), ("coupler", "follower")):
        apart = np.abs(s.position(one, 1.0) - s.position(two, 0.0)).max()
        assert apart < 3e-12
    assert np.abs(s.position("follower", 1.0) - s.position("follower", 1.0)[0]).max() < 1e-12


@pytest.mark.parametrize("name", [name for name in SCENES if name != "ring"])  # which keeps a place alone
def test_full_and_sparse_matrices_give_the_same_motions(name, monkeypatch):
    scene, options = SCENES[name]
    options = {key: value for key, value in options.items() if key != "scale"}
    run = Discretisation(**cut(scene, **options), integrator="zhai", dt=1e-5, t_end=1e-4)
    found = []
    for dense in (0, 10_000):
        monkeypatch.setattr(motions, "DENSE", dense)
        found.append(split_factors(Chain(scene, run)).kept)
    for one, two in zip(found[0][:5], found[1][:5], strict=True):
        assert np.abs(one - two).max() <= 1e-9 * np.abs(two).max()


def coupler_far_away(kind, place):
    """A rigid body that falls about a pin, and another one on a line in it."""
    x, y = place
    bodies = [
        at.RigidBody("coupler", 2.0, 0.05, (x + 0.45, y + 0.3), {"a": (x + 0.2, y + 0.1)}),
        at.RigidBody("slide", 0.5, 0.001, (x + 0.5, y + 0.4), {"a": (x + 0.5, y + 0.4)}),
    ]
    joints = [at.Pin("coupler.a"), kind("slide.a", (1, 1), body="coupler")]
    return at.Scene("far", bodies, joints, gravity=(0.0, -G))


@pytest.mark.parametrize("kind", [at.Slider, at.Prismatic])
def test_guides_in_rigid_bodies_stand_anywhere(kind):
    """Coordinates of 10 km made a guide seem to repeat other constraints: it was passed over, and the run failed."""
    options = {"t_end": 0.02, "output_dt": 0.01}
    other = at.solve(coupler_far_away(kind, (0.0, 0.0)), integrator="esdirk", dt=1e-3, **options)
    wanted = other.displacement("slide.center")
    for place in ((0.0, 0.0), (1e4, -1e4), (1e6, 2e6)):
        far = at.solve(coupler_far_away(kind, place), integrator="zhai", dt=1e-4, **options)
        assert far.status.ok, far.status
        off = np.abs(far.displacement("slide.center") - wanted).max()
        assert off < 1e-4 * np.abs(wanted).max()
