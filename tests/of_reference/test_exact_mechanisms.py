"""Mechanisms of rigid bodies beside closed forms, equations of their own and published values.

All integrators here are of second order; what is compared to 1e-6 or better is extrapolated from steps h, h/2, h/4, …
by Richardson's rule.
"""

from itertools import pairwise

import numpy as np
import pytest

import anctmm as at
from reference import global_dae
from reference.exact.andrews import PUBLISHED, andrews_squeezer, angles_of
from reference.exact.mechanisms import OffsetDoublePendulum, Oscillator, slider_crank


def extrapolated(values, integrator="generalized-alpha"):
    """Limit of values at steps h, h/2, h/4, …: errors have even powers of h, of Zhai's all from the second on."""
    values = [np.asarray(v) for v in values]
    for order in range(1, len(values)):
        factor = 2.0 ** (order + 1) if integrator == "zhai" else 4.0**order
        values = [(factor * b - a) / (factor - 1.0) for a, b in pairwise(values)]
    return values[0]


def runs(scene, steps, integrator="generalized-alpha", t_end=1.0, outputs=10, **options):
    found = [
        global_dae.solve(
            scene, mesh=1, integrator=integrator, spectral_radius=1.0, newton_tolerance=1e-13, dt=t_end / n,
            t_end=t_end, output_dt=t_end / outputs, **options,
        )
        for n in steps
    ]  # fmt: skip
    assert all(s.status.ok for s in found), [str(s.status) for s in found]
    return found


@pytest.mark.parametrize(
    ("integrator", "steps"),
    [("generalized-alpha", (125, 250, 500, 1000)), ("zhai", (125, 250, 500, 1000))],
)
def test_double_pendulum_with_offset_centres(integrator, steps):
    exact = OffsetDoublePendulum()
    found = runs(exact.scene(), steps, integrator, t_end=1.0, outputs=5)
    error = [np.abs(s.position("two.tip") - exact.tip(s.t)).max() for s in found]
    assert 3.5 < error[0] / error[1] < 4.5
    limit = extrapolated([s.position("two.tip") for s in found], integrator)
    assert np.abs(limit - exact.tip(found[0].t)).max() < 1e-8


@pytest.mark.parametrize("kind", ["mass_on_a_line", "torsion_pendulum"])
@pytest.mark.parametrize("integrator", ["generalized-alpha", "zhai"])
def test_damped_oscillators(integrator, kind):
    exact = Oscillator()
    found = runs(getattr(exact, kind)(), (60, 120, 240, 480), integrator, t_end=0.4, outputs=4)
    body = "m.center" if kind == "mass_on_a_line" else "b.o"
    paths = [s.position(body)[:, 0] if kind == "mass_on_a_line" else s.angle(body) for s in found]
    error = [np.abs(x - exact.motion(s.t)).max() for x, s in zip(paths, found, strict=True)]
    assert error[0] < 2e-4
    assert 3.7 < error[0] / error[1] < 4.3
    assert np.abs(extrapolated(paths, integrator) - exact.motion(found[0].t)).max() < 1e-9


def test_slider_crank_of_rigid_bodies_keeps_its_closed_form():
    crank, rod = 0.2, 0.7
    turn = at.Quintic(turn=7.0, duration=0.8)
    bodies = [
        at.RigidBody("crank", 1.0, 0.01, (0.1, 0.0), {"o": (0.0, 0.0), "p": (crank, 0.0)}),
        at.RigidBody("rod", 1.0, 0.04, (crank + 0.3, 0.0), {"p": (crank, 0.0), "q": (crank + rod, 0.0)}),
        at.PointMass("slider", 0.4, (crank + rod, 0.0)),
    ]
    joints = [
        at.Clamp("crank.o", angle=turn), at.Pin("crank.p", "rod.p"), at.Pin("rod.q", "slider.center"),
        at.Slider("slider.center"),
    ]  # fmt: skip
    scene = at.Scene("slider-crank", bodies, joints, gravity=(0, -9.81))
    for integrator in ("generalized-alpha", "zhai"):
        (found,) = runs(scene, (800,), integrator, t_end=0.8, outputs=40)
        path = found.position("slider.center")
        exact = slider_crank(crank, rod, np.array([turn(t)[0] for t in found.t]))
        assert np.abs(path[:, 0] - exact).max() < 1e-11
        assert np.abs(path[:, 1]).max() < 1e-13


def test_andrews_squeezer_meets_its_published_angles():
    scene = andrews_squeezer()
    found = runs(scene, (250, 500, 1000), t_end=0.03, outputs=50)
    ends = [angles_of({b.name: s.angle(f"{b.name}.center") for b in scene.bodies}) for s in found]
    for name, published in PUBLISHED.items():
        values = [angles[name][-1] for angles in ends]
        assert extrapolated(values) == pytest.approx(published, abs=1e-6)
