"""Branches, loops and shared ends: the global DAE and Exudyn's cables agree, and what must be kept is kept."""

from itertools import permutations

import numpy as np
import pytest
from random_graphs import Kinds, random_graph
from samples import KINDS, SOFT, SQUARE, refused

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import DiscretisationError
from anctmm.model.drives import Quintic
from anctmm.model.scene import Beam, Clamp, Force, Pin, Scene, Torque, Weld
from reference import exudyn_cable, global_dae
from reference.global_dae.layout import Layout
from reference.global_dae.stability import free_motions
from reference.global_dae.system import System

O = (0.0, 0.0)  # noqa: E741
DOWN = (0.0, -2.0)
TIGHT = {"newton_tolerance": 1e-12, "dt": 1e-3, "t_end": 0.05, "output_dt": 0.01}


def beam(name, start, end, velocity=None):
    return Beam(name, start, end, SQUARE, SOFT, velocity)


def fork(*joints, gravity=DOWN, first=Clamp("a.start")):  # noqa: B008 (frozen)
    """A Y of three beams that meet at the origin."""
    bodies = [beam("a", (0.0, -0.5), O), beam("b", O, (0.4, 0.3)), beam("c", (-0.4, 0.3), O)]
    loads = [Force("b.end", (0.3, 0.0)), Torque("c.start", 0.01)]
    return Scene("Y", bodies, [first, *joints], loads, gravity)


def field(start, end):
    """Velocities of a drift and a turn, m/s, and a bulge across the body that leaves its ends alone."""

    def velocity(s):
        x, y = ((1.0 - s) * p + s * q for p, q in zip(start, end, strict=True))
        bump = 16.0 * (s * (1.0 - s)) ** 2
        return 1.0 - 2.5 * y + 0.6 * bump, 0.5 + 2.5 * x - 0.4 * bump

    return velocity


def square(kind):
    """Four beams in a loop that floats and turns."""
    corners = [O, (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)]
    sides = [(corners[i], corners[(i + 1) % 4]) for i in range(4)]
    bodies = [beam(f"b{i}", *side, field(*side)) for i, side in enumerate(sides)]
    return Scene("square", bodies, [kind(f"b{i}.end", f"b{(i + 1) % 4}.start") for i in range(4)])


def tree(*joints):
    """Three beams and one more that float and turn."""
    lines = {
        "a": ((0.0, -0.5), O),
        "b": (O, (0.4, 0.3)),
        "c": (O, (-0.4, 0.3)),
        "d": ((0.4, 0.3), (0.8, 0.0)),
    }
    bodies = [beam(name, *line, field(*line)) for name, line in lines.items()]
    return Scene("tree", bodies, joints)


def grid(size=3, h=0.3):
    """Cells of beams, hinged at every third node and welded at the others, on two supports."""
    bodies, meeting = [], {}
    for i in range(size + 1):
        for j in range(size + 1):
            for k, l in ((i + 1, j), (i, j + 1)):  # noqa: E741
                if k <= size and l <= size:
                    name = f"{i}{j}-{k}{l}"
                    bodies.append(beam(name, (i * h, j * h), (k * h, l * h)))
                    meeting.setdefault((i, j), []).append(f"{name}.start")
                    meeting.setdefault((k, l), []).append(f"{name}.end")
    joints = []
    for (i, j), ends in meeting.items():
        kind = Pin if (i + j) % 3 == 1 else Weld
        joints.append(kind(*ends, grounded=(i, j) in ((0, 0), (size, 0))))
    return Scene("grid", bodies, joints, gravity=DOWN)


def gap(one, two, rows=slice(None)):
    """Largest distance of points of two solutions, m."""
    places = [(b.name, s) for b in one.scene.bodies for s in (0.0, 0.5, 1.0)]
    return max(np.abs(one.position(*p)[rows] - two.position(*p)[rows]).max() for p in places)


def system_of(scene, run):
    """Equations of a scene."""
    return System(Layout(scene, run))


def null_space(system):
    """Motions that the constraints allow in the reference."""
    return free_motions(system, system.layout.reference, system.constraints.parameters(0.0))


def way(solution):
    """Largest displacement, m."""
    places = [(b.name, s) for b in solution.scene.bodies for s in (0.0, 0.5, 1.0)]
    return max(np.ptp(solution.position(*place), axis=0).max() for place in places)


SCENES = {
    "Y welded": fork(Weld("a.end", "b.start", "c.end")),
    "Y hinged": fork(Pin("a.end", "b.start", "c.end")),
    "Y of both": fork(Weld("c.end", "a.end"), Pin("b.start", "c.end")),
    "Y turned": fork(Weld("a.end", "b.start", "c.end"), first=Clamp("a.end", Quintic(0.5, 0.04))),
    "Y driven at a weld": fork(
        Weld("b.start", "c.end"), Pin("b.start", "a.end"), first=Clamp("c.end", Quintic(1.0, 0.1))
    ),
    "square hinged": square(Pin),
    "square welded": square(Weld),
    "grid": grid(),
}


@pytest.mark.parametrize("name", SCENES)
def test_motion_equals_exudyn(name):
    scene = SCENES[name]
    own = global_dae.solve(scene, Discretisation(mesh=2, **TIGHT))
    peer = exudyn_cable.solve(scene, own.run, tolerances=(1e-10, 1e-10))
    assert (own.status.ok, peer.status.ok) == (True, True)
    assert way(own) > 1e-3
    assert gap(own, peer) < 1e-10


@pytest.mark.parametrize("name", ["Y welded", "grid"])
def test_equilibrium_equals_exudyn(name):
    own = global_dae.solve_static(SCENES[name], mesh=2, newton_tolerance=1e-12)
    peer = exudyn_cable.solve_static(SCENES[name], mesh=2)
    assert own.status.ok
    assert peer.status.ok
    assert way(own) > 1e-3
    assert gap(own, peer, -1) < 1e-8


@pytest.mark.parametrize("seed", range(8))
def test_random_graphs_equal_exudyn(seed):
    scene, run = random_graph(
        seed, Kinds(elements=("cable",)), dt=1e-3, output_dt=5e-3, newton_tolerance=1e-12
    )
    own, peer = global_dae.solve(scene, run), exudyn_cable.solve(scene, run, tolerances=(1e-10, 1e-10))
    assert (own.status.ok, peer.status.ok) == (True, True)
    assert way(own) > 1e-6 or null_space(system_of(scene, run)).shape[1] == 0
    assert gap(own, peer) < 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_random_structures_rest_where_exudyn_says(seed):
    scene, run = random_graph(seed, Kinds(structure=True, elements=("cable",)), newton_tolerance=1e-12)
    own, peer = global_dae.solve_static(scene, run), exudyn_cable.solve_static(scene, run)
    assert (own.status.ok, peer.status.ok) == (True, True)
    assert gap(own, peer, -1) < 1e-8


FLOATING = {
    "tree of pins": tree(Pin("a.end", "b.start", "c.start"), Pin("b.end", "d.start")),
    "tree of both": tree(Weld("a.end", "b.start"), Pin("c.start", "b.start"), Weld("b.end", "d.start")),
    "loop of pins": square(Pin),
    "loop of welds": square(Weld),
}


def momenta(solution):
    """Linear (steps, 2) and angular (steps,) momentum between outputs, which are those of all steps.

    p = m (q_{n+1} − q_n)/h, and q_n × p, which an explicit step of Störmer and Verlet keeps to rounding.
    """
    system = system_of(solution.scene, solution.run)
    fields = [solution.fields[b.name].coordinates for b in solution.scene.bodies]
    q = np.concatenate([f.reshape(len(solution.t), -1) for f in fields], axis=1)
    p = np.stack([system.mass @ step for step in np.diff(q, axis=0) / np.diff(solution.t)[0]])
    positions = system.layout.unit.reshape(-1, 2)[:, 0] == solution.scene.length
    q, p = (x.reshape(len(x), -1, 2) for x in (q[:-1], p))
    angular = (q[..., 0] * p[..., 1] - q[..., 1] * p[..., 0]).sum(axis=1)
    return p[:, positions].sum(axis=1), angular


@pytest.mark.parametrize("name", FLOATING)
@pytest.mark.parametrize("element", KINDS)
def test_floating_trees_and_loops_keep_momentum_in_explicit_steps(name, element):
    scene = FLOATING[name]
    run = Discretisation(mesh=2, element=element, integrator="zhai", dt=1e-5, t_end=5e-3)
    linear, angular = momenta(global_dae.solve(scene, run))
    assert np.abs(linear[0]).min() > 0.1
    assert np.ptp(linear, axis=0).max() < 1e-10 * np.abs(linear).max()
    assert abs(angular[0]) > 0.1
    assert np.ptp(angular) < 1e-10 * np.abs(angular).max()


@pytest.mark.parametrize("name", FLOATING)
def test_floating_trees_and_loops_keep_momentum_in_implicit_steps(name):
    """Linear momentum to Newton's tolerance; angular momentum in the second order of the step."""
    drift = []
    for dt in (1e-3, 5e-4):
        run = Discretisation(mesh=2, dt=dt, t_end=0.05, spectral_radius=1.0, newton_tolerance=1e-12)
        linear, angular = momenta(global_dae.solve(FLOATING[name], run))
        assert np.ptp(linear, axis=0).max() < 1e-8 * np.abs(linear).max()
        drift.append(np.ptp(angular) / np.abs(angular).max())
    assert drift[1] < 1e-2
    assert drift[1] < 0.6 * drift[0]


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
@pytest.mark.parametrize("element", KINDS)
def test_joints_of_many_ends_are_those_of_pairs_in_any_order(integrator, element):
    """Which ends a joint names first, and whether one joint or several hold them, is all the same."""
    dt = {"zhai": 1e-5, "generalized-alpha": 1e-3}[integrator]
    run = Discretisation(
        mesh=2, element=element, integrator=integrator, dt=dt, t_end=20 * dt, newton_tolerance=1e-12
    )
    ends = ("a.end", "b.start", "c.end")
    for kind in (Pin, Weld):
        usual = global_dae.solve(fork(kind(*ends)), run)
        for one, two, three in list(permutations(ends))[1::2]:
            same = fork(kind(one, two), kind(two, three))
            assert gap(usual, global_dae.solve(same, run)) < 1e-12
        assert gap(usual, global_dae.solve(fork(kind(*ends[::-1])), run)) < 1e-12


def test_weld_of_many_ends_needs_one_element_kind():
    scene = fork(Weld("a.end", "b.start", "c.end"))
    with refused(DiscretisationError, ("Weld", "'b'", "'cable'", "'c'", "'shear'")):
        global_dae.solve(scene, mesh=1, element={"a": "cable", "b": "cable", "c": "shear"})
