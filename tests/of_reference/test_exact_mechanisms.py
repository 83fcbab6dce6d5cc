"""Mechanisms of rigid bodies beside closed forms, equations of their own and published values.

All integrators here are of second order; what is compared to 1e-6 or better is extrapolated from steps h, h/2, h/4, …
by Richardson's rule.
"""

from itertools import pairwise

import numpy as np
import pytest

from reference import global_dae
from reference.exact.andrews import PUBLISHED, andrews_squeezer, angles_of
from reference.exact.mechanisms import OffsetDoublePendulum


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
    [("generalized-alpha", (60, 120, 240)), ("zhai", (60, 120, 240))],
)
def test_double_pendulum_with_offset_centres(integrator, steps):
    exact = OffsetDoublePendulum()
    found = runs(exact.scene(), steps, integrator, t_end=0.5, outputs=5)
    error = [np.abs(s.position("two.tip") - exact.tip(s.t)).max() for s in found]
    assert 3.5 < error[0] / error[1] < 4.5
    limit = extrapolated([s.position("two.tip") for s in found], integrator)
    assert np.abs(limit - exact.tip(found[0].t)).max() < 1e-7


def test_andrews_squeezer_meets_its_published_angles():
    scene = andrews_squeezer()
    found = global_dae.solve(
        scene, integrator="esdirk", dt=0.03 / 200, t_end=0.03, output_dt=0.003, newton_tolerance=1e-12
    )
    angles = angles_of({b.name: found.angle(f"{b.name}.center") for b in scene.bodies})
    for name, published in PUBLISHED.items():
        assert angles[name][-1] == pytest.approx(published, abs=1e-6)
