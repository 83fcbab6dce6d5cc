"""Reactions and tensions in space: beside statics, the plane, and the momentum and moment of momentum of motions."""

import numpy as np
import pytest
from samples import RigidLink
from test_space import PLANE, WAYS, bricard, cable, crank, lifted, same

import anctmm as at

ROD, SOFT = at.Circle(0.02), at.Material(E=2e7, density=1000.0)
G = np.array([0.3, -1.0, -9.0])
NORMAL = np.cross(*PLANE.T)


def integral(series, t):
    """By trapezoids, from the first output to each."""
    parts = 0.5 * (series[1:] + series[:-1]) * np.diff(t)[:, None]
    return np.concatenate([np.zeros((1, series.shape[1])), np.cumsum(parts, axis=0)])


def along(found, name, elements):
    """Positions and velocities at Gauss points of a beam, each (n, 3), with the masses there."""
    beam = found.scene.beam(name)
    points, weights = np.polynomial.legendre.leggauss(5)
    for element in range(elements):
        for x, w in zip(points, weights, strict=True):
            place = (name, (element + 0.5 * (1.0 + x)) / elements)
            v = None if found.static else found.velocity(place)
            yield found.position(place), v, 0.5 * w * beam.mass / elements


def momenta(found, elements):
    """Momentum and moment of momentum about the origin, (n, 6)."""
    total = np.zeros((len(found.t), 6))
    for body in found.scene.bodies:
        if isinstance(body, at.Beam):
            parts = list(along(found, body.name, elements))
        else:
            place = f"{body.name}.center"
            parts = [(found.position(place), found.velocity(place), body.mass)]
        for r, v, m in parts:
            total += m * np.hstack([v, np.cross(r, v)])
        if isinstance(body, at.RigidBody):
            field, R = found.fields[body.name], found.rotation(body.name)
            spin = 0.5 * np.cross(field.coordinates[:, 1:], field.velocities[:, 1:]).sum(axis=1)
            total[:, 3:] += np.einsum("nij,jk,nlk,nl->ni", R, np.array(body.inertia), R, spin)
    return total


def at_origin(place, force):
    """A force, (n, 3), or with its moment, (n, 6), as force and moment about the origin."""
    moment = np.cross(place, force[:, :3])
    return np.hstack([force[:, :3], moment + (force[:, 3:] if force.shape[1] == 6 else 0.0)])


def outside(found, elements, joints, loads=()):
    """Force and moment about the origin of weights, given forces at places, and joints to the ground, (n, 6)."""
    total = np.zeros((len(found.t), 6))
    for body in found.scene.bodies:
        if isinstance(body, at.Beam):
            parts = [(r, m) for r, _, m in along(found, body.name, elements)]
        else:
            parts = [(found.position(f"{body.name}.center"), body.mass)]
        for r, m in parts:
            total += at_origin(r, np.broadcast_to(m * np.array(found.scene.gravity), r.shape))
    for place, force in loads:
        total += at_origin(found.position(place), force)
    for joint in joints:
        reaction = found.reaction(joint)
        assert reaction.shape == (len(found.t), 6)
        assert np.isfinite(reaction).all()
        total += at_origin(found.position(joint.places[0]), reaction)
    return total


def test_a_pin_bears_the_weight_of_a_hanging_cable():
    rope = at.Beam("rope", (0, 0, 0), G / np.linalg.norm(G), ROD, SOFT)
    pin = at.Pin("rope.start")
    found = at.solve_static(at.Scene("rope", [rope], [pin], gravity=G), mesh=4)
    assert found.status.ok, found.status
    wanted = -found.t[:, None] * rope.mass * np.concatenate([G, np.zeros(3)])
    assert np.abs(found.reaction(pin) - wanted).max() < 1e-9 * rope.mass * 10.0


def test_a_clamp_balances_a_bent_cantilever():
    beam = at.Beam("beam", (0.1, 0.2, 0.3), (0.8, 0.5, 0.3), ROD, SOFT)
    clamp, force = at.Clamp("beam.start"), np.array([0.1, 0.4, -0.3])
    scene = at.Scene("beam", [beam], [clamp], [at.Force("beam.end", force)], gravity=G)
    found = at.solve_static(scene, mesh=4)
    assert found.status.ok, found.status
    last = found.t == 1.0
    total = outside(found, 4, [clamp], [("beam.end", np.broadcast_to(force, (len(found.t), 3)))])
    assert np.abs(found.reaction(clamp)[last, 3:]).max() > 0.5
    assert np.abs(total[last]).max() < 1e-8


@pytest.mark.parametrize(
    ("kind", "way"),
    [*((kind, way) for kind in ("pinned", "clamped") for way in [*WAYS, "static"]), ("rigid", "esdirk")],
)
def test_a_scene_in_a_tilted_plane_has_the_turned_reactions(kind, way):
    make = [crank(same, True), crank(lifted, False)] if kind == "rigid" else None
    scenes = make or [cable(to, kind == "clamped") for to in (same, lifted)]
    if way == "static":
        flat, space = (at.solve_static(scene, mesh=3) for scene in scenes)
    else:
        run = {"mesh": 3, "t_end": 0.1, "output_dt": 0.02}
        flat, space = (at.solve(scene, **run, **WAYS[way]) for scene in scenes)
    for one, other in zip(flat.scene.joints, space.scene.joints, strict=True):
        wanted, got = flat.reaction(one), space.reaction(other)
        allowed = (2e-4 if kind == "rigid" else 1e-8) * max(1.0, np.abs(wanted).max())
        assert np.abs(got[:, :3] - wanted[:, :2] @ PLANE.T).max() < allowed
        assert np.abs(got[:, 3:] - np.outer(wanted[:, 2], NORMAL)).max() < allowed
    for one, other in zip(flat.scene.connectors, space.scene.connectors, strict=True):
        assert np.abs(space.tension(other) - flat.tension(one)).max() < 1e-8


def test_reactions_change_the_momenta_of_a_cable_and_a_body():
    """A clamped cable carries a body on a ball joint, which a spring to the ground and a force pull."""
    ground, force = np.array([0.5, 1.0, 0.7]), np.array([0.5, -0.2, 0.8])
    beam = at.Beam("arm", (0, 0, 0), (0.5, 0.2, 0.1), ROD, SOFT)
    inertia = np.array([[0.02, 0.002, 0.0], [0.002, 0.03, 0.001], [0.0, 0.001, 0.025]])
    body = at.RigidBody(
        "bob", 0.8, inertia, (0.6, 0.2, 0.3), {"a": (0.5, 0.2, 0.1), "b": (0.8, 0.1, 0.2)}, spin=(0.5, 1.0, 2.0),
        velocity=np.cross((0.5, 1.0, 2.0), (0.1, 0.0, 0.2)),
    )  # fmt: skip
    clamp, pin = at.Clamp("arm.start"), at.Pin("arm.end", "bob.a")
    spring = at.Spring("bob.b", tuple(ground), stiffness=10.0, damping=0.5)
    scene = at.Scene("arm", [beam, body], [clamp, pin], [at.Force("bob.b", force)], G, [spring])
    found = at.solve(scene, mesh=2, integrator="esdirk", dt=1e-3, t_end=0.1, newton_tolerance=1e-12)
    assert found.status.ok, found.status
    way = ground - found.position("bob.b")
    pull = found.tension(spring)[:, None] * way / np.linalg.norm(way, axis=1, keepdims=True)
    change = integral(outside(found, 2, [clamp], [("bob.b", pull + force)]), found.t)
    moved = momenta(found, 2)
    assert np.abs(moved - moved[0] - change).max() < 1e-4 * np.abs(change).max()
    assert np.abs(found.reaction(pin)[:, :3]).max() > 1.0
    assert np.abs(found.reaction(pin)[:, 3:]).max() < 1e-12


def test_redundant_hinges_in_space_have_finite_reactions_with_the_right_sum():
    scene = bricard()
    found = at.solve(scene, integrator="esdirk", dt=5e-3, t_end=0.3, newton_tolerance=1e-12)
    assert found.status.ok, found.status
    change, moved = (
        integral(outside(found, 0, [scene.joints[0], scene.joints[5]]), found.t),
        momenta(found, 0),
    )
    assert np.abs(moved - moved[0] - change).max() < 1e-4 * np.abs(change).max()
    weight = 5 * 9.81
    assert max(np.abs(found.reaction(joint)).max() for joint in scene.joints) < 3.0 * weight


def test_the_force_in_a_link_of_a_users_own():
    mass = at.PointMass("bob", 2.0, (1.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    link = RigidLink("bob.center", (0.0, 0.0, 0.0))
    found = at.solve(
        at.Scene("link", [mass], [link], gravity=G), integrator="esdirk", dt=1e-3, t_end=0.3, output_dt=0.1
    )
    x, v = found.position("bob.center"), found.velocity("bob.center")
    size = -2.0 * ((v * v).sum(axis=1) + x @ G)
    assert np.abs(found.reaction(link)[:, :3] - size[:, None] * x).max() < 1e-4
    assert np.abs(found.reaction(link)[:, 3:]).max() == 0.0
