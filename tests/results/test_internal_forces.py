"""Section forces, reactions and torques of drives, against exact statics, momentum and energy."""

from math import pi

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import ResultError, UnknownNameError
from reference import exudyn_reissner
from reference.exact.scenes import cantilever_static

ROD = at.Rectangle(0.02, 0.02)
RUBBER = at.Material(E=5e6, density=1100.0)
G = np.array([0.3, -9.81])


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def weight(beam):
    return beam.material.density * beam.section.area * beam.length * G


def integral(series, t):
    """By trapezoids, from the first output to each."""
    parts = 0.5 * (series[1:] + series[:-1]).T * np.diff(t)
    return np.concatenate([np.zeros((1, *series.shape[1:])), np.cumsum(parts.T, axis=0)])


@pytest.mark.parametrize(("elements", "allowed", "between"), [(16, 1e-6, 3e-5), (64, 1e-8, 5e-7)])
def test_a_cantilever_has_the_section_forces_of_the_exact_elastica(elements, allowed, between):
    """Force and moment everywhere; between nodes the direction of an element's axis is only of third order."""
    beam = at.Beam("beam", (0, 0), (0.5, 0), ROD, RUBBER)
    # across the clamped end: a clamp also holds the stretch, which costs orders where N does not vanish there
    force = np.array([0.0, -0.9])
    scene = at.Scene("elastica", [beam], [at.Clamp("beam.start")], [at.Force("beam.end", force)])
    rest, exact = at.solve_static(scene, mesh=elements), cantilever_static(scene)
    for fraction in (0.0, 0.013, 0.25, 0.5, 0.777, 0.875, 1.0):
        angle = exact.angle(fraction)
        tangent = np.array([np.cos(angle), np.sin(angle)])
        N, Q, M = rest.section_force("beam", fraction)[-1]
        node = (fraction * elements) % 1.0 == 0.0
        wanted = np.array([tangent @ force, cross(tangent, force)])
        assert np.abs(np.array([N, Q]) - wanted).max() < 0.9 * (allowed if node else between)
        assert abs(np.hypot(N, Q) - 0.9) < 1e-9
        arm = exact.position(1.0) - exact.position(fraction)
        assert abs(M - cross(arm, force)) < 0.45 * allowed
    reaction = rest.reaction(scene.joints[0])[-1]
    np.testing.assert_allclose(reaction[:2], -force, atol=1e-9)
    assert reaction[2] == pytest.approx(-cross(exact.position(1.0), force), abs=0.45 * allowed)


def swing(element="cable"):
    """A driven arm with a forearm on a pin, in a skew gravity, and a force at the elbow."""
    arm = at.Beam("arm", (0, 0), (0.3, 0.1), ROD, RUBBER)
    fore = at.Beam("fore", (0.3, 0.1), (0.5, -0.2), ROD, RUBBER)
    motor = at.Clamp("arm.start", angle=at.Quintic(turn=pi / 2, duration=0.2))
    elbow = at.Pin("arm.end", "fore.start")
    scene = at.Scene("swing", [arm, fore], [motor, elbow], [at.Force("arm.end", (0.0, 0.7))], gravity=G)
    return scene, at.solve(scene, mesh=2, element=element, dt=1e-3, t_end=0.2)


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_the_torque_of_a_drive_does_its_work(element):
    scene, found = swing(element)
    torque, t = found.reaction(scene.joints[0])[:, 2], found.t
    speed = np.array([scene.joints[0].angle(x)[1] for x in t])
    done = integral(torque * speed, t)
    np.testing.assert_allclose(done, found.energy.work, atol=2e-3 * np.abs(found.energy.work).max())


@pytest.mark.parametrize("element", ["cable", "shear"])
def test_a_section_is_in_equilibrium_from_both_sides(element):
    """What lies before a section holds it as well: its momentum, weight and the reaction at its start."""
    _, found = swing(element)
    held = found.reaction(found.scene.joints[0])
    start = found.section_force("arm", 0.0)
    tangent = np.stack([np.cos(found.angle("arm.start")), np.sin(found.angle("arm.start"))], axis=1)
    direction = np.array([0.3, 0.1]) / np.hypot(0.3, 0.1)
    turned = np.stack(
        [tangent[:, 0] * direction[0] - tangent[:, 1] * direction[1],
         tangent[:, 1] * direction[0] + tangent[:, 0] * direction[1]], axis=1
    )  # fmt: skip
    np.testing.assert_allclose(np.einsum("nc,nc->n", turned, -held[:, :2]), start[:, 0], atol=1e-9)
    np.testing.assert_allclose(-held[:, 2], start[:, 2], atol=1e-10)


def test_forces_jump_where_a_force_acts():
    trunk = at.Beam("trunk", (0, 0), (0.3, 0), ROD, RUBBER)
    twig = at.Beam("twig", (0.3, 0), (0.5, 0), ROD, RUBBER)
    force = np.array([0.2, -0.6])
    joint = at.Weld("trunk.end", "twig.start")
    scene = at.Scene(
        "jump", [trunk, twig], [at.Clamp("trunk.start"), joint], [at.Force("trunk.end", force)], gravity=G
    )
    rest = at.solve_static(scene, mesh=4)
    angle = rest.angle("trunk.end")[-1]
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    before, after = rest.section_force("trunk.end")[-1], rest.section_force("twig.start")[-1]
    np.testing.assert_allclose(before[:2] - after[:2], turn @ force, atol=1e-9)
    assert before[2] == pytest.approx(after[2], abs=1e-9)
    assert np.abs(rest.section_force("twig.end")[-1]).max() < 1e-9
    np.testing.assert_allclose(rest.reaction(joint)[-1, :2], weight(twig), atol=1e-8)


def test_what_cannot_be_known_is_refused_by_name():
    scene, found = swing()
    with pytest.raises(UnknownNameError, match=r"joint .*'nowhere.end'.* is not in scene 'swing'"):
        found.reaction(at.Pin("nowhere.end"))
    reissner = exudyn_reissner.solve(scene, mesh=2, dt=1e-3, t_end=0.01)
    with pytest.raises(ResultError, match="not known by solver 'exudyn-reissner': ANCF elements are needed"):
        reissner.section_force("arm.end")
    assert found.section_force("arm", [0.0, 0.5, 1.0]).shape == (len(found.t), 3, 3)


def bar_in_a_mechanism(element):
    """A crank as a beam of element "rigid", or as the rigid body that it is; joints, loads and springs act on it."""
    rod = at.Beam("rod", (0.3, 0.4), (0.8, 0.4), ROD, RUBBER)
    bead = at.PointMass("bead", 0.1, (0.075, 0.1))
    crank = at.Beam("crank", (0, 0), (0.3, 0.4), ROD, RUBBER)
    place, along = ("crank", 0.25), at.LineLoad("crank", (0.3, 0.1))
    if not element:
        m = 1100.0 * ROD.area * 0.5
        points = {"start": (0, 0), "end": (0.3, 0.4), "q": (0.075, 0.1)}
        crank = at.RigidBody("crank", m, m * 0.5**2 / 12.0, (0.15, 0.2), points=points)
        place, along = "crank.q", at.Force("crank.center", (0.15, 0.05))
    joints = [at.Pin("crank.start"), at.Weld("crank.end", "rod.start"), at.Slider("rod.end")]
    joints.append(at.Pin(place, "bead.center"))
    loads = [at.Force(place, (0.1, 0.2), follower=True), at.Torque("crank.end", 0.05), along]
    springs = [at.Spring("crank.end", (0, 0.8), 20.0), at.RotationalSpring("crank.start", stiffness=0.1)]
    return at.Scene("bar", [crank, rod, bead], joints, loads, gravity=G, connectors=springs)


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk", None])
def test_reactions_at_rigid_beams_are_those_of_rigid_bodies(integrator):
    """They were refused, as section forces are."""
    as_beam = {"mesh": 1, "element": {"crank": "rigid", "rod": "cable"}}
    if integrator is None:
        pair = [at.solve_static(bar_in_a_mechanism(True), **as_beam)]
        pair.append(at.solve_static(bar_in_a_mechanism(False), mesh=1))
    else:
        run = {"integrator": integrator, "dt": 2e-3, "t_end": 0.02, "output_dt": 2e-3}
        pair = [at.solve(bar_in_a_mechanism(True), **as_beam, **run)]
        pair.append(at.solve(bar_in_a_mechanism(False), mesh=1, **run))
    assert [s.status.code for s in pair] == ["ok", "ok"]
    for joints in zip(*(s.scene.joints for s in pair), strict=True):
        found, wanted = (s.reaction(joint) for s, joint in zip(pair, joints, strict=True))
        assert np.abs(wanted[-1]).max() > 0.1
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6)


def hanging(count, ratio=1.0, redundant=False):
    """Plates in a row that swing, each `ratio` times as heavy as the one before; from a body that three pins hold."""
    plates = [
        at.RigidBody(
            f"p{k}", 0.1 * ratio**k, 1e-4 * ratio**k, (0.1 * k + 0.05, 0.02),
            points={"a": (0.1 * k, 0.0), "b": (0.1 * k + 0.1, 0.0)},
        )
        for k in range(count)
    ]  # fmt: skip
    joints = [at.Pin("p0.a"), *(at.Pin(f"p{k}.b", f"p{k + 1}.a") for k in range(count - 1))]
    if redundant:
        points = {"a": (0.0, 0.0), "b": (0.1, 0.1), "c": (-0.1, 0.1), "d": (0.2, 0.3)}
        plates.append(at.RigidBody("ceiling", 10.0, 0.1, (0.0, 0.1), points=points))
        joints[0] = at.Pin("p0.a", "ceiling.a")
        joints += [at.Pin(f"ceiling.{point}") for point in "bcd"]
    return at.Scene("hanging", plates, joints, gravity=tuple(G))


@pytest.mark.parametrize("redundant", [False, True])
@pytest.mark.parametrize(("count", "ratio"), [(8, 1.0), (8, 0.1), (60, 1.0), (40, 0.7)])
def test_a_chain_bears_what_hangs_from_it(count, ratio, redundant):
    """By sums of forces from the free end on."""
    scene = hanging(count, ratio, redundant)
    found = at.solve(scene, dt=1e-3, t_end=5e-3, output_dt=1e-3)
    assert found.status.ok
    bodies = scene.bodies[:count]
    needed = [body.mass * (found.fields[body.name].accelerations[:, 0] - G) for body in bodies]
    beyond = np.cumsum(needed[::-1], axis=0)[::-1]
    beyond[1:] *= -1.0  # at a joint of two bodies the first one gets the opposite
    for joint, wanted in zip(scene.joints[:count], beyond, strict=True):
        got = found.reaction(joint)
        assert np.abs(got[:, 2]).max() < 1e-12 * np.abs(beyond).max()
        assert np.abs(got[:, :2] - wanted).max() < 1e-4 * np.abs(wanted).max()


def test_redundant_joints_have_finite_reactions_with_the_right_sum():
    """Rigid cranks all of one shape hold one beam: a third one and any more repeat what two do."""
    cranks = [
        at.RigidBody(f"c{k}", 0.1, 1e-4, (0.1 * k, 0.05), points={"a": (0.1 * k, 0.0), "b": (0.1 * k, 0.1)})
        for k in range(20)
    ]
    tops = {f"t{k}": (0.1 * k, 0.1) for k in range(20)}
    bar = at.RigidBody("bar", 1.0, 0.3, (0.95, 0.1), points={**tops, "tip": (2.0, 0.1)})
    bob = at.RigidBody("bob", 0.2, 1e-4, (2.0, 0.05), points={"a": (2.0, 0.1)})
    feet = [at.Pin(f"c{k}.a") for k in range(20)]
    hinges = [at.Pin(f"c{k}.b", f"bar.t{k}") for k in range(20)]
    scene = at.Scene(
        "comb", [*cranks, bar, bob], [*feet, *hinges, at.Pin("bar.tip", "bob.a")], gravity=tuple(G)
    )
    found = at.solve(scene, dt=1e-3, t_end=5e-3)
    assert found.status.ok
    needed = {b.name: b.mass * (found.fields[b.name].accelerations[:, 0] - G) for b in scene.bodies}
    on_bob = -found.reaction(scene.joints[-1])[:, :2]
    assert np.abs(on_bob - needed["bob"]).max() < 1e-6 * np.abs(needed["bob"]).max()
    held, whole = sum(found.reaction(joint)[:, :2] for joint in feet), sum(needed.values())
    assert np.abs(held - whole).max() < 1e-6 * np.abs(whole).max()
    sizes = [np.abs(found.reaction(joint)).max() for joint in [*feet, *hinges]]
    assert max(sizes) < 10.0 * np.abs(whole).max()
