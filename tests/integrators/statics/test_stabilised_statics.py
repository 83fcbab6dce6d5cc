"""Equilibria that plain Newton's iteration does not find: slack cables and mechanisms."""

import numpy as np
import pytest
from samples import KINDS, SOFT, SQUARE

from anctmm.model.scene import Beam, Material, Pin, Scene
from anctmm.model.sections import Rectangle
from anctmm.solve import solve_static
from reference import exact

SPAN, LENGTH, WEIGHT, AXIAL = 80.0, 100.0, 10.0, 1e7


def slack_cable(bending, low=(40.0, -30.0), end=(SPAN, 0.0)):
    """Two straight cables hinged to each other at a low point."""
    height = float(np.sqrt(12.0 * bending / AXIAL))
    section = Rectangle(1.0 / height, height)
    material = Material(AXIAL, WEIGHT / 9.81)
    bodies = [
        Beam("left", (0.0, 0.0), low, section, material),
        Beam("right", low, end, section, material),
    ]
    joints = [
        Pin("left.start", grounded=True),
        Pin("left.end", "right.start"),
        Pin("right.end", grounded=True),
    ]
    return Scene("slack", bodies, joints, gravity=(0.0, -9.81))


def miss(scene, rest):
    """Largest distance of either cable from the catenary, relative to the span."""
    left, right = scene.bodies
    whole = left.length + right.length
    shape = exact.Catenary(right.end, whole, WEIGHT, AXIAL)
    apart = []
    for body, before in ((left, 0.0), (right, left.length)):
        for fraction in (0.0, 0.13, 0.5, 0.77, 1.0):
            there = shape.position((before + fraction * body.length) / whole)
            apart.append(np.abs(rest.position(body.name, fraction)[-1] - there).max())
    return max(apart) / SPAN


@pytest.mark.parametrize("bending", [1e2, 1.0, 1e-2, 1e-4])
def test_a_slack_cable_hangs_in_a_catenary(bending):
    """Its bending stiffness keeps it away by a part that falls with it."""
    scene = slack_cable(bending)
    assert scene.body("left").length == pytest.approx(0.5 * LENGTH, rel=1e-15)
    rest = solve_static(scene, mesh=32)
    assert rest.status.ok, rest.status
    assert rest.stable.tolist()[-1]
    assert miss(scene, rest) < 1.2e-6 * max(bending, 0.1)


@pytest.mark.xfail(strict=True, reason="two load steps of a slack cable end without an equilibrium")
def test_supports_at_different_heights():
    """Twenty metres apart, a low point that is not the middle, and load steps."""
    scene = slack_cable(1e-3, low=(20.0, -30.0), end=(SPAN, 20.0))
    rest = solve_static(scene, mesh=64, load_steps=2)
    assert rest.status.ok, rest.status
    assert rest.t.tolist() == [0.0, 0.5, 1.0]
    assert miss(scene, rest) < 1e-6


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [1, 3])
def test_what_hangs_on_hinges_swings_down(kind, count):
    """A row of bars that starts horizontally: all hang below each other, stretched by their weight."""
    bodies = [Beam(f"b{i}", (float(i), 0.0), (i + 1.0, 0.0), SQUARE, SOFT) for i in range(count)]
    joints = [Pin("b0.start", grounded=True)]
    joints += [Pin(f"b{i}.end", f"b{i + 1}.start") for i in range(count - 1)]
    rest = solve_static(Scene("row", bodies, joints, gravity=(0.0, -9.81)), mesh=2, element=kind)
    assert rest.status.ok, rest.status
    assert "stabilised path" in rest.status.message
    tip = rest.position(f"b{count - 1}", 1.0)[-1]
    stretch = 0.5 * SOFT.density * 9.81 * count**2 / SOFT.E
    assert abs(tip[0]) < 1e-9
    assert tip[1] == pytest.approx(-count - stretch, rel=1e-5)


def test_a_catenary_is_that_of_its_equations():
    """Equilibrium of every piece and Hooke's law, by quadrature; and bad values are named."""
    shape = exact.Catenary((70.0, -5.0), 90.0, 12.0, 5e3)
    horizontal, vertical = shape.forces
    s = np.linspace(0.0, 90.0, 20_001)
    tension = np.hypot(horizontal, vertical - 12.0 * s)
    along = np.stack([np.full_like(s, horizontal), 12.0 * s - vertical]) / tension * (1.0 + tension / 5e3)
    assert np.trapezoid(along, s, axis=1) == pytest.approx([70.0, -5.0], rel=1e-7)
    assert shape.position(1.0) == pytest.approx([70.0, -5.0], rel=1e-12)
    assert shape.tension(0.5) == pytest.approx(tension[10_000], rel=1e-12)
    with pytest.raises(exact.catenary.PropertyError, match=r"end \(m\) is \(-1.0, 0.0\); x greater than 0"):
        exact.Catenary((-1.0, 0.0), 2.0, 1.0, 1.0)
    with pytest.raises(exact.catenary.PropertyError, match=r"catenary weight \(N/m\) is 0.0"):
        exact.Catenary((1.0, 0.0), 2.0, 0.0, 1.0)
