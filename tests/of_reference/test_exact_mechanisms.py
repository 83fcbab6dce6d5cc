"""A mechanism of rigid bodies beside published values."""

import pytest

from reference import global_dae
from reference.exact.andrews import PUBLISHED, andrews_squeezer, angles_of


def test_andrews_squeezer_meets_its_published_angles():
    scene = andrews_squeezer()
    found = global_dae.solve(
        scene, integrator="esdirk", dt=0.03 / 200, t_end=0.03, output_dt=0.003, newton_tolerance=1e-12
    )
    angles = angles_of({b.name: found.angle(f"{b.name}.center") for b in scene.bodies})
    for name, published in PUBLISHED.items():
        assert angles[name][-1] == pytest.approx(published, abs=1e-6)
