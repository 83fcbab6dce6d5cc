"""Scenes in space: beside the plane, published motions, conserved quantities, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from samples import RigidLink

import anctmm as at
from anctmm.errors import DiscretisationError, PropertyError, ResultError, SceneError, UnsupportedError
from anctmm.results.checks.divergence import checked

SOFT = at.Material(E=2e7, density=1000.0)
ROD = at.Circle(0.02)
#: A frame whose first two columns span a tilted plane.
FRAME = np.linalg.qr(np.array([[2.0, -1.0, 0.5], [1.0, 3.0, 0.2], [0.4, 0.3, 1.0]]))[0]
PLANE, NORMAL = FRAME[:, :2], FRAME[:, 2]
WAYS = {
    "explicit": {"integrator": "zhai", "dt": 5e-5},
    "generalized-alpha": {"integrator": "generalized-alpha", "dt": 1e-3, "newton_tolerance": 1e-12},
    "esdirk": {"integrator": "esdirk", "dt": 1e-3, "newton_tolerance": 1e-12},
}


def lifted(point):
    """A point of the plane in the tilted plane."""
    return tuple(PLANE @ np.asarray(point))


def cable(to, clamp):
    """A soft beam that falls with a mass at its end; `to` places what is of the plane."""
    joint = at.Clamp("arm.start") if clamp else at.Pin("arm.start")
    beam = at.Beam("arm", to((0.0, 0.0)), to((1.0, 0.3)), ROD, SOFT)
    mass = at.PointMass("mass", 0.1, to((1.0, 0.3)))
    spring = at.Spring("mass.center", to((0.5, 1.0)), stiffness=3.0, damping=0.1)
    force = at.Force("arm.end", lambda t: to((0.2 * np.sin(20.0 * t), 0.1)))
    joints = [joint, at.Pin("arm.end", "mass.center")]
    line = at.LineLoad("arm", to((0.1, 0.05)))
    return at.Scene("cable", [beam, mass], joints, [force, line], to((0.0, -9.81)), [spring])


def crank(to, flat):
    """A crank and a coupler, rigid, hinged."""

    def body(name, start, end, spin):
        middle = 0.5 * (np.array(start) + end)
        inertia = 0.1 if flat else FRAME @ np.diag([0.05, 0.06, 0.1]) @ FRAME.T
        points = {"a": to(start), "b": to(end)}
        turning = spin if flat else tuple(spin * NORMAL)
        velocity = np.array([-middle[1], middle[0]]) * spin
        return at.RigidBody(name, 1.2, inertia, to(middle), points, to(velocity), turning)

    def hinge(*places):
        return at.Pin(*places) if flat else at.Revolute(*places, axis=NORMAL)

    bodies = [body("crank", (0.0, 0.0), (0.3, 0.1), 4.0), body("coupler", (0.3, 0.1), (1.0, 0.0), 4.0)]
    joints = [hinge("crank.a"), hinge("crank.b", "coupler.a")]
    return at.Scene("crank", bodies, joints, gravity=to((0.0, -9.81)))


def same(point):
    return tuple(float(x) for x in point)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("clamp", [False, True], ids=["pinned", "clamped"])
def test_a_cable_in_a_tilted_plane_moves_as_in_the_plane(way, clamp):
    run = at.Discretisation(mesh=3, t_end=0.2, output_dt=0.05, **WAYS[way])
    flat, space = at.solve(cable(same, clamp), run), at.solve(cable(lifted, clamp), run)
    assert flat.status.ok, flat.status
    assert space.status.ok, space.status
    for place in ("arm.end", ("arm", 0.4)):
        assert np.abs(space.position(place) - flat.position(place) @ PLANE.T).max() < 1e-10
        assert np.abs(space.velocity(place) - flat.velocity(place) @ PLANE.T).max() < 1e-8
    for name in ("kinetic", "strain", "potential", "work"):
        assert getattr(space.energy, name) == pytest.approx(getattr(flat.energy, name), abs=1e-9)


@pytest.mark.parametrize("way", WAYS)
def test_rigid_bodies_with_parallel_hinges_move_as_in_the_plane(way):
    run = at.Discretisation(t_end=0.5, output_dt=0.1, **WAYS[way])
    flat, space = at.solve(crank(same, True), run), at.solve(crank(lifted, False), run)
    assert space.status.ok, space.status
    for place in ("crank.b", "coupler.b"):
        assert np.abs(space.position(place) - flat.position(place) @ PLANE.T).max() < 2e-4
    angle = flat.angle("coupler")
    R = space.rotation("coupler")
    turned = np.einsum("nij,j->ni", R, PLANE[:, 0]) @ PLANE
    assert np.abs(turned - np.stack([np.cos(angle), np.sin(angle)], axis=1)).max() < 1e-3
    assert np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() < 1e-10


def heavy_top(unit=1.0):
    """Benchmark of Brüls and Cardona: a fast top on a ball joint, flat, so that one vector of it has no mass.

    With another unit of length (m), the unit of time is its root, so that gravity is the same.
    """
    spin, center = np.array([0.0, 150.0, -4.61538]) / unit**0.5, np.array([0.0, unit, 0.0])
    moments = np.array([0.234375, 0.46875, 0.234375]) * unit**2
    body = at.RigidBody("top", 15.0, moments, center, {"tip": (0.0, 0.0, 0.0)}, np.cross(spin, center), spin)
    return at.Scene("heavy top", [body], [at.Pin("top.tip")], gravity=(0.0, 0.0, -9.81))


def test_the_heavy_top_with_a_tolerance():
    found = at.solve(heavy_top(), tolerance=1e-6, t_end=0.5, output_dt=0.1)
    assert found.status.ok, found.status
    path = found.position("top.center")
    assert np.abs(path[2] - (0.605550561, 0.598957682, -0.523983027)).max() < 1e-6
    assert np.abs(path[5] - (-0.702468297, -0.021165185, -0.711400258)).max() < 1e-5
    assert np.abs(np.linalg.norm(path, axis=1) - 1.0).max() < 1e-10


@pytest.mark.parametrize(
    "way", [{"tolerance": 1e-6}, {"integrator": "esdirk", "dt": 1e-3}], ids=["tolerance", "dt"]
)
@pytest.mark.parametrize("unit", [1e-4, 1e4])
def test_a_motion_in_space_does_not_depend_on_the_unit_of_length(way, unit):
    paths = []
    for x in (1.0, unit):
        steps = {name: value * x**0.5 if name == "dt" else value for name, value in way.items()}
        found = at.solve(heavy_top(x), **steps, t_end=0.1 * x**0.5, output_dt=0.02 * x**0.5)
        paths.append(found.position("top.center") / x)
    assert np.abs(paths[1] - paths[0]).max() < 1e-6


def bricard():
    """Library of computational benchmarks of IFToMM, A04: five bars and six hinges, one of whose rows is redundant."""
    nodes = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], dtype=float)
    axes = np.eye(3)[[1, 2, 0, 1, 2, 0]]
    bodies = []
    for k in range(5):
        start, end = nodes[k], nodes[k + 1]
        along = np.abs(end - start)
        moments = along * 0.02 / 12.0 + (1.0 - along) * 1.01 / 12.0
        points = {"a": start, "b": end}
        bodies.append(at.RigidBody(f"bar{k}", 1.0, moments, 0.5 * (start + end), points))
    joints = [at.Revolute("bar0.a", axis=axes[0])]
    joints += [at.Revolute(f"bar{k}.b", f"bar{k + 1}.a", axis=axes[k + 1]) for k in range(4)]
    joints += [at.Revolute("bar4.b", axis=axes[5])]
    return at.Scene("Bricard", bodies, joints, gravity=(0.0, -9.81, 0.0))


def test_bricards_mechanism_has_the_published_motion():
    found = at.solve(bricard(), tolerance=1e-5, t_end=1.0, output_dt=0.5)
    assert found.status.ok, found.status
    path = found.position("bar1.b")
    assert np.abs(path[1] - (0.774717808, -0.979815048, -0.199906159)).max() < 5e-5
    assert np.abs(path[2] - (0.274481319, -0.886707939, -0.462330003)).max() < 5e-5
    assert np.abs(found.energy.balance).max() < 1e-3


def test_angular_momentum_of_a_free_cable_is_kept():
    start, end = np.zeros(3), np.array([0.6, 0.0, 0.8])
    turning, bend = at.RigidVelocity(start, end, start, spin=(0.5, 2.0, -1.0)), np.array([0.3, -0.4, 0.2])
    beam = at.Beam("free", start, end, ROD, SOFT, velocity=lambda s: turning(s) + bend * s * s)
    scene = at.Scene("free cable", [beam])
    assert at.consistent_velocities(scene).body("free").velocity is None  # nothing drives it
    found = at.solve(scene, mesh=4, integrator="esdirk", dt=1e-3, t_end=0.2, output_dt=0.02)
    x, weights = np.polynomial.legendre.leggauss(5)
    total = 0.0
    for element in range(4):
        for part, weight in zip(x, weights, strict=True):
            place = ("free", (element + 0.5 * (1.0 + part)) / 4)
            total = total + weight * np.cross(found.position(place), found.velocity(place))
    assert found.velocity("free.end")[0] == pytest.approx(np.cross(turning.spin, end) + bend)
    assert np.abs(total - total[0]).max() < 1e-8 * np.abs(total[0]).max()
    assert np.abs(found.energy.balance).max() < 1e-4 * found.energy.kinetic[0]


def test_an_equilibrium_in_a_tilted_plane():
    flat, space = (at.solve_static(cable(to, True), mesh=4) for to in (same, lifted))
    assert space.status.ok, space.status
    assert np.abs(space.position("arm.end") - flat.position("arm.end") @ PLANE.T).max() < 1e-9
    moved = at.solve(cable(lifted, True), start=space, mesh=4, t_end=0.01, dt=1e-3)
    assert moved.status.ok


def test_a_joint_of_a_users_own_in_space():
    mass = at.PointMass("bob", 2.0, (1.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    scene = at.Scene("link", [mass], [RigidLink("bob.center", (0.0, 0.0, 0.0))], gravity=(0.0, 0.0, -9.81))
    found = at.solve(scene, integrator="esdirk", dt=1e-3, t_end=1.0, output_dt=0.1, newton_tolerance=1e-12)
    x, v = found.position("bob.center"), found.velocity("bob.center")
    assert np.abs(np.linalg.norm(x, axis=1) - 1.0).max() < 1e-10
    assert np.abs(np.cross(x, v)[:, 2] - 2.0).max() < 1e-6
    assert np.abs(0.5 * (v * v).sum(axis=1) + 9.81 * x[:, 2] - 2.0).max() < 1e-6


UP = at.Beam("up", (0, 0, 0), (0, 0, 1), ROD, SOFT)
BALL = at.RigidBody("ball", 1.0, (1.0, 1.0, 1.0), (0, 0, 1), {"a": (0, 0, 0)})
REFUSED = {
    "mixed": (lambda: at.Scene("s", [UP, at.PointMass("m", 1.0, (0, 0))]), SceneError, "2 components"),
    "gravity": (lambda: at.Scene("s", [UP], gravity=(0.0, -9.81)), PropertyError, "a triple"),
    "force": (lambda: at.Scene("s", [UP], loads=[at.Force("up.end", (1, 0))]), SceneError, "3 are needed"),
    "torque": (lambda: at.Scene("s", [UP], loads=[at.Torque("up.end", 1.0)]), UnsupportedError, "Torque"),
    "follower": (
        lambda: at.Scene("s", [UP], loads=[at.Force("up.end", (1, 0, 0), follower=True)]), UnsupportedError, "follower",
    ),
    "weld": (lambda: at.Scene("s", [UP, BALL], [at.Weld("up.start", "ball.a")]), UnsupportedError, "Weld"),
    "driven clamp": (
        lambda: at.Scene("s", [UP], [at.Clamp("up.start", lambda t: (0.0, 0.0, 0.0))]), UnsupportedError, "fixed clamp",
    ),
    "hinge of a beam": (
        lambda: at.Scene("s", [UP, BALL], [at.Revolute("up.start", "ball.a")]), UnsupportedError, "rigid bodies",
    ),
    "rectangle": (
        lambda: at.Scene("s", [at.Beam("up", (0, 0, 0), (0, 0, 1), at.Rectangle(0.1, 0.1), SOFT)]),
        UnsupportedError, "Circle",
    ),
    "damping": (
        lambda: at.Scene("s", [at.Beam("up", (0, 0, 0), (0, 0, 1), ROD, at.Material(1e6, 1e3, damping=0.1))]),
        UnsupportedError, "damping",
    ),
    "inertia": (lambda: at.RigidBody("b", 1.0, (1.0, 1.0, 3.0), (0, 0, 0)), PropertyError, "principal values"),
    "no axis": (lambda: at.Revolute("b.center", axis=(0, 0, 0)), PropertyError, "axis"),
    "hinge in the plane": (
        lambda: at.Scene("s", [at.RigidBody("b", 1.0, 1.0, (0, 0))], [at.Revolute("b.center")]),
        UnsupportedError, "Pin",
    ),
    "shear": (lambda: at.solve(at.Scene("s", [UP]), mesh=1, element="shear", t_end=1.0), DiscretisationError, "cable"),
    "modes": (lambda: at.modes(at.Scene("s", [UP]), mesh=1), UnsupportedError, "space"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_offered_in_space_is_refused_by_name(case):
    make, error, word = REFUSED[case]
    with pytest.raises(error, match=word):
        make()


PLANAR = {
    "angle": lambda found: found.angle("ball"),
    "spin": lambda found: found.spin("ball"),
    "table": lambda found: found.to_frame(["ball.a"]),
    "data set": lambda found: found.to_dataset(),
    "picture": lambda found: found.plot(),
    "animation": lambda found: found.animate("x.html"),
    "files": lambda found: found.to_vtk("x"),
}


@pytest.mark.parametrize("what", PLANAR)
def test_results_of_the_plane_are_refused_by_name(what):
    found = at.solve(at.Scene("s", [BALL], [at.Pin("ball.a")]), integrator="esdirk", t_end=0.01)
    with pytest.raises(ResultError, match="in space"):
        PLANAR[what](found)


@pytest.mark.parametrize("what", ["place", "axis"])
def test_a_joint_that_a_history_does_not_keep_is_found(what):
    joint = at.Revolute("ball.a", axis=(0.0, 0.0, 1.0)) if what == "axis" else at.Pin("ball.a")
    found = at.solve(
        at.Scene("s", [BALL], [joint], gravity=(0.0, -1.0, 0.0)), integrator="esdirk", t_end=0.01
    )
    assert found.status.ok
    field, wrong = found.fields["ball"], found.fields["ball"].coordinates.copy()
    if what == "place":
        wrong[5:, 0, 0] += 1e-2
    else:
        c, s = np.cos(0.1), np.sin(0.1)  # about x, through the place of the hinge
        wrong[5:] = wrong[5:] @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]).T
    moved = replace(found, fields={"ball": replace(field, coordinates=wrong)})
    status = checked(moved).status
    assert status.code == "failed"
    assert status.time == pytest.approx(found.t[5])
