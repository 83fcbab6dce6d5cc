"""Explicit steps of loops of pinned beams: kept places in scalar blocks."""

import numpy as np
import pytest
from direct import assert_as_dense, by_split
from graphs import MATERIAL, SECTION, grid, ladder, polygon, wheel

import anctmm as at
from anctmm.discretise import kept
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.kept_chains import forget
from anctmm.forces.actuation import Actuation, turn_clamps
from anctmm.forces.driving import drive_table
from anctmm.recursion.accelerations import by_blocks
from anctmm.recursion.riccati import mass_factors
from anctmm.recursion.split import split_factors
from reference import global_dae
from studies.benchmark.branched import Graph, add_ladder

TURN = at.Quintic(turn=0.2, duration=0.01)


def laden():
    """A ladder whose first rung is driven at a clamp; from it hang a tree with a straight weld, a mass and a spring."""
    g = add_ladder(Graph(SECTION, MATERIAL), 4)
    g.beam("a", (1.0, 1.0), (1.0, 2.0)).beam("b", (1.0, 2.0), (2.0, 3.0)).beam("c", (1.0, 2.0), (0.0, 3.0))
    base = g.scene("laden", at.Pin, at.Clamp("r0.start", angle=TURN), gravity=(0.0, -9.81))
    bodies = [
        *base.bodies,
        at.Beam("d", (2.0, 3.0), (3.0, 4.0), SECTION, MATERIAL),
        at.PointMass("m", 0.3, (2.0, 1.0)),
    ]
    joints = [*base.joints, at.Weld("b.end", "d.start"), at.Pin("u1.end", "m.center")]
    springs = [at.Spring("d.end", "r3.end", stiffness=50.0, damping=0.5)]
    loads = [at.Force("c.end", (1.0, -2.0)), at.Force("u2.start", (0.5, 0.0))]
    return at.Scene("laden", bodies, joints, loads, (0.0, -9.81), connectors=springs)


def rings():
    """Two squares that hang from the corner of a third one by a beam each: their stretches end where they begin."""
    g = Graph(SECTION, MATERIAL)
    for name, x, y in (("a", 0.0, 0.0), ("b", 2.0, 1.0), ("c", 2.0, -2.0)):
        corners = [(x, y), (x + 1.0, y), (x + 1.0, y + 1.0), (x, y + 1.0)]
        for k in range(4):
            g.beam(f"{name}{k}", corners[k], corners[(k + 1) % 4])
    g.beam("to b", (1.0, 0.0), (2.0, 1.0)).beam("to c", (1.0, 0.0), (2.0, -1.0))
    return g.scene("rings", at.Pin, gravity=(0.0, -9.81))


def apart():
    """Two ladders that nothing connects, and a chain."""
    one = add_ladder(Graph(SECTION, MATERIAL), 3).scene("one", at.Pin)
    g = Graph(SECTION, MATERIAL)
    for beam in one.bodies:
        (x, y), (z, w) = beam.start, beam.end
        g.beam(beam.name, (x, y), (z, w)).beam(f"{beam.name}'", (x, y + 3.0), (z, w + 3.0))
    g.beam("k0", (0.0, 7.0), (1.0, 7.0)).beam("k1", (1.0, 7.0), (2.0, 7.0))
    return g.scene("apart", at.Pin, at.Clamp("k0.start"), gravity=(0.0, -9.81))


SCENES = {
    "polygon": polygon(at.Pin), "grid": grid(at.Pin), "ladder": ladder(at.Pin), "laden": laden(), "rings": rings(),
    "apart": apart(),
}  # fmt: skip


def chain_of(name, element, mesh=2):
    bodies = SCENES[name].beams
    return Chain(
        SCENES[name], Discretisation(mesh=dict.fromkeys((b.name for b in bodies), mesh), element=element)
    )


@pytest.mark.parametrize("name", SCENES)
def test_loops_of_pinned_beams_keep_places(name):
    chain = chain_of(name, "cable")
    factors = split_factors(chain)
    assert chain.split
    assert factors.kept is None
    assert len(factors.places.x) == len(chain.plan.kept) == len(factors.places.matrix.inverse)


def test_welds_lines_and_rigid_bodies_that_are_kept_are_more_than_places():
    rails = ladder(at.Pin, 12)
    bar = at.RigidBody("bar", 1.0, 0.05, (0.0, 0.5), {"a": (0.0, 0.0)})
    others = [
        ladder(at.Weld, 12),
        at.Scene("guided", rails.bodies, [*rails.joints, at.Slider("r3.end", direction=(1.0, 0.0))]),
        at.Scene("rigid", [*rails.bodies, bar], [*rails.joints, at.Pin("r0.start", "bar.a")]),
    ]
    for scene in others:
        assert not Chain(
            scene, Discretisation(mesh=dict.fromkeys((b.name for b in scene.beams), 2))
        ).kept.pinned
    assert not Chain(wheel(), Discretisation(mesh=2)).kept.pinned
    assert Chain(rails, Discretisation(mesh=2)).kept.pinned


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("name", SCENES)
def test_accelerations_are_those_of_full_blocks_and_of_the_dense_matrix(name, element):
    chain = chain_of(name, element)
    q = chain.bodies.reference()
    f = np.random.default_rng(1).standard_normal(q.shape)
    found = []
    for how in (by_split, in_full_blocks):
        actuation = Actuation(chain.scene, chain.bodies)
        clamps = actuation.clamps()
        turn_clamps(clamps, drive_table(chain, actuation, np.array([0.004]))[0])
        found.append((how(chain, q, f, clamps), clamps.reaction.copy()))
    (a, reaction), (exact, force) = found
    assert np.abs(a - exact).max() < 1e-11 * np.abs(exact).max()
    assert np.abs(reaction - force).max(initial=0.0) < 1e-11 * np.abs(force).max(initial=1.0)
    f[chain.prescribed] = 0.0
    assert_as_dense(chain, f, by_split(chain, q, f))


def in_full_blocks(chain, q, f, clamps):
    a = np.empty_like(q)
    by_blocks(q, f, chain.bodies.tables(), clamps, mass_factors(chain), np.empty_like(q), a)
    return a


@pytest.mark.parametrize("name", ["laden", "rings"])
def test_a_motion_is_that_of_full_blocks_and_of_the_global_dae(name, monkeypatch):
    scene = SCENES[name]
    run = {
        "mesh": dict.fromkeys((b.name for b in scene.beams), 2),
        "integrator": "zhai",
        "dt": 1e-4,
        "t_end": 4e-3,
    }
    ours = at.solve(scene, **run)
    forget()
    with monkeypatch.context() as patch:
        patch.setattr(kept, "FEW", -1)
        patch.setattr(kept.KeptUnknowns, "pinned", False)
        blocks = at.solve(scene, **run)
    forget()
    dae = global_dae.solve(scene, **run)
    assert ours.status.ok
    for body in scene.beams:
        path = ours.position(body.name, 1.0)
        for other in (blocks, dae):
            assert np.abs(path - other.position(body.name, 1.0)).max() < 1e-12
    for joint in scene.joints:
        found, exact = ours.reaction(joint), blocks.reaction(joint)
        assert np.abs(found - exact).max() < 1e-8 * max(np.abs(exact).max(), 1.0)
    assert np.abs(ours.energy.work - blocks.energy.work).max() < 1e-11 * max(
        np.abs(blocks.energy.work).max(), 1e-3
    )


@pytest.mark.parametrize("stiff", ["one", "other"])
def test_a_loop_that_diverges_beside_others_is_told(stiff):
    """What is not finite in one of several loops that nothing connects is seen."""
    bodies = []
    for beam in apart().beams:
        of_other = beam.name.endswith("'")
        E = 1e14 if of_other == (stiff == "other") and beam.name[0] != "k" else 1e8
        bodies.append(at.Beam(beam.name, beam.start, beam.end, SECTION, at.Material(E=E, density=1000.0)))
    loads = [at.Force(end, (3.0, 1.0)) for end in ("r2.end", "r2'.end", "k1.end")]
    scene = at.Scene("apart", bodies, apart().joints, loads, gravity=(0.0, -9.81))
    with np.errstate(all="ignore"):
        s = at.solve(
            scene, mesh=2, integrator="zhai", dt=1e-4, t_end=1e-2, output_dt=1e-2, check_stability=False
        )
    assert s.status.code == "diverged"
    assert s.status.step < 100
    assert s.status.body.endswith("'") == (stiff == "other")
