"""Equilibria under forces that turn with their place, or beside laws that feed motions: damping tells, too."""

import pytest
from ziegler import growth, ziegler

import anctmm as at


@pytest.mark.parametrize(
    ("load", "damping", "kind"),
    [
        (1.8, 0.0, "ok"),
        (2.1, 0.0, "unstable"),
        (1.4, 0.01, "ok"),
        (1.5, 0.01, "unstable"),
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
        (8, 0.0, 19.8, "ok"),
        (8, 0.0, 20.3, "unstable"),
        (4, 5e-4, 10.0, "ok"),
        (4, 5e-4, 12.0, "unstable"),
        (16, 0.62, 25.0, "ok"),
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
