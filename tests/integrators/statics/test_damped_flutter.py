"""Equilibria under forces that turn with their place, or beside laws that feed motions: damping tells, too."""

import numpy as np
import pytest

import anctmm as at


def ziegler(load, damping):
    """Two bars of 1 m with masses of 2 and 1 kg, springs of 1 N m and dampers at the hinges, a force along the second.

    Ziegler 1952: without damping it flutters from 2.086 N on, with little from 1.464 N on.
    """
    bars = [
        at.RigidBody(name, mass, 1e-9, (x, 0.0), {"hinge": (x - 1.0, 0.0)})
        for name, mass, x in (("a", 2.0, 1.0), ("b", 1.0, 2.0))
    ]
    springs = [
        at.RotationalSpring(*ends, stiffness=1.0, damping=damping)
        for ends in (("a.hinge",), ("a.hinge", "b.hinge"))
    ]
    follower = at.Force("b.center", (-load, 0.0), follower=True)
    joints = [at.Pin("a.hinge"), at.Pin("a.center", "b.hinge")]
    return at.Scene("ziegler", bars, joints, [follower], connectors=springs)


def growth(load, damping):
    """Largest real part of the rates of its small motions, 1/s."""
    mass, turns = np.array([[3.0, 1.0], [1.0, 1.0]]), np.array([[2.0, -1.0], [-1.0, 1.0]])
    stiffness = turns + load * np.array([[-1.0, 1.0], [0.0, 0.0]])
    lower = [-np.linalg.solve(mass, stiffness), -damping * np.linalg.solve(mass, turns)]
    return np.linalg.eigvals(np.block([[np.zeros((2, 2)), np.eye(2)], lower])).real.max()


@pytest.mark.parametrize(
    ("load", "damping", "kind"),
    [
        (1.8, 0.0, "ok"),
        (2.1, 0.0, "unstable"),
        (1.4, 0.01, "ok"),
        (1.5, 0.01, "unstable"),
        (2.08, 0.3, "unstable"),
        (2.3, 3.0, "ok"),
    ],
)
def test_damping_takes_part_in_flutter(load, damping, kind):
    assert (growth(load, damping) > 1e-9) == (kind == "unstable")
    rest = at.solve_static(ziegler(load, damping))
    assert rest.status.code == kind, rest.status
    assert rest.stable[-1] == (kind == "ok")


@pytest.mark.parametrize(
    ("mesh", "damping", "load", "kind"),
    [
        (4, 0.0, 15.0, "ok"),
        (4, 5e-4, 10.0, "ok"),
        (4, 5e-4, 12.0, "unstable"),
        (16, 5e-4, 12.0, "unstable"),
        (16, 0.125, 15.0, "unstable"),
        (16, 0.62, 25.0, "ok"),
        (64, 0.125, 9.0, "ok"),
    ],
)
def test_a_column_of_damped_material_flutters_from_less_load(mesh, damping, load, kind):
    """Beck's column: 20.05 EI/L² without damping, 10.94 EI/L² with little of Kelvin's and Voigt's (Bolotin 1963).

    With much of it most motions do not swing, and from some on it holds the column.
    """
    section = at.Rectangle(0.01, 0.01)
    column = at.Beam("c", (0.0, 0.0), (0.0, 1.0), section, at.Material(1e8, 1000.0, damping=damping))
    force = at.Force("c.end", (0.0, -load * 1e8 * section.second_moment), follower=True)
    rest = at.solve_static(at.Scene("beck", [column], [at.Clamp("c.start")], [force]), mesh=mesh)
    assert rest.status.code == kind, rest.status


@pytest.mark.parametrize("feeding", [-0.1, 0.1])
def test_a_law_that_feeds_a_motion_makes_it_unstable(feeding):
    def law(elongation, rate, t):
        return 10.0 * elongation + feeding * rate

    mass = at.PointMass("m", 1.0, (1.0, 0.0))
    springs = [at.Spring("m.center", (0.0, 0.0), law=law), at.Spring("m.center", (1.0, 1.0), stiffness=5.0)]
    rest = at.solve_static(at.Scene("fed", [mass], gravity=(0.0, -1.0), connectors=springs))
    assert rest.status.code == ("unstable" if feeding < 0.0 else "ok"), rest.status
    assert at.modes(rest.scene, about=rest).unstable.any() == (feeding < 0.0)
