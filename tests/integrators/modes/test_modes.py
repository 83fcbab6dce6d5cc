"""Natural modes against exact frequencies, published blades, and small vibrations in runs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import anctmm as at
from anctmm.errors import DiscretisationError, SceneError
from reference.exact.frequencies import axial_frequencies, euler_bernoulli_frequencies

L, SLENDER = 1.0, at.Rectangle(5e-3, 5e-3)
STEEL = at.Material(E=2e11, density=7800.0)
JOINTS = {
    "clamped-free": [at.Clamp("bar.start")],
    "pinned-pinned": [at.Pin("bar.start"), at.Pin("bar.end")],
    "free-free": [],
}


def bar(joints=(), material=STEEL, **options):
    return at.Scene("bar", [at.Beam("bar", (0, 0), (0.6, 0.8), SLENDER, material)], joints, **options)


def exact(ends, count):
    EI, rhoA = STEEL.E * SLENDER.second_moment, STEEL.density * SLENDER.area
    return euler_bernoulli_frequencies(ends, count, L, EI, rhoA) / (2.0 * np.pi)


@pytest.mark.parametrize("ends", JOINTS)
def test_the_first_ten_modes_of_a_bar(ends):
    found = {n: at.modes(bar(JOINTS[ends]), mesh=n, count=13).frequencies for n in (40, 80, 280)}
    rigid = 3 if ends == "free-free" else 0
    assert (found[80][:rigid] < 1e-3 * found[80][rigid]).all()
    errors = {n: np.abs(f[rigid : rigid + 10] / exact(ends, 10) - 1.0) for n, f in found.items()}
    assert errors[280].max() < 1.5e-7
    order = np.log2(errors[40][5:] / errors[80][5:])
    assert (order > 3.8).all()


def test_axial_modes_converge_at_first_order_where_a_clamp_holds_the_stretch():
    """A clamp holds the whole gradient, and so the strain, which is largest there in this mode."""
    thick = at.Rectangle(0.1, 0.1)
    scene = at.Scene("bar", [at.Beam("bar", (0, 0), (1, 0), thick, STEEL)], [at.Clamp("bar.start")])
    wanted = axial_frequencies("clamped-free", 1, 1.0, STEEL.E * thick.area, STEEL.density * thick.area)
    errors = [
        np.abs(2 * np.pi * at.modes(scene, mesh=n, count=6).frequencies / wanted[0] - 1.0).min()
        for n in (16, 32)
    ]
    assert 1.8 < errors[0] / errors[1] < 2.2
    assert errors[1] < 4e-3


def test_shapes_are_normal_modes():
    found = at.modes(bar(JOINTS["clamped-free"]), mesh=8, count=3)
    shape = found.displacement("bar", np.linspace(0, 1, 41))
    assert shape.shape == (3, 41, 2)
    np.testing.assert_allclose(shape[:, 0], 0.0, atol=1e-12)
    assert np.abs(shape).max() == pytest.approx(0.8, abs=0.3)
    across = shape @ np.array([-0.8, 0.6])
    gram = np.abs(across @ across.conj().T)
    assert (gram - np.diag(np.diag(gram))).max() < 0.06 * gram.max()
    assert [int((np.diff(np.sign(a.real[2:])) != 0).sum()) for a in across] == [0, 1, 2]
    assert "Hz" in repr(found)


@pytest.mark.parametrize("joints", [JOINTS["clamped-free"], []])
def test_damping_of_one_material_is_that_of_each_oscillator(joints):
    tau = 2e-4
    soft = at.Material(E=2e11, density=7800.0, damping=tau)
    free = at.modes(bar(joints), mesh=6, count=6)
    found = at.modes(bar(joints, soft), mesh=6, count=6)
    moving = free.frequencies > 1.0
    assert moving.sum() >= 3
    omega = 2.0 * np.pi * free.frequencies[moving]
    ratio = 0.5 * tau * omega
    np.testing.assert_allclose(found.damping[moving], ratio, rtol=1e-5)
    np.testing.assert_allclose(
        found.frequencies[moving], free.frequencies[moving] * np.sqrt(1.0 - ratio**2), rtol=1e-6
    )


@pytest.mark.parametrize(
    ("gamma", "flap"), [(0.0, 3.5160), (1.0, 3.6817), (2.0, 4.1373), (5.0, 6.4495), (10.0, 11.2023)]
)
def test_a_spinning_blade_has_the_published_lag_frequency(gamma, flap):
    """Wright, Smith, Thresher & Wang 1982: flap at the dimensionless speed γ; in the plane λ² = flap² − γ²."""
    thin = at.Rectangle(1e-3, 1e-3)  # the published blade does not stretch
    unit = np.sqrt(STEEL.E * thin.second_moment / (STEEL.density * thin.area)) / L**2
    blade = at.Scene("blade", [at.Beam("blade", (0, 0), (0.6, 0.8), thin, STEEL)], [at.Clamp("blade.start")])
    found = at.modes(blade, mesh=24, count=1, spin=gamma * unit)
    assert 2.0 * np.pi * found.frequencies[0] / unit == pytest.approx(np.sqrt(flap**2 - gamma**2), rel=1e-4)
    assert found.damping[0] == pytest.approx(0.0, abs=1e-6)


def test_a_bent_beam_vibrates_as_it_does_in_a_run():
    """The frequency about an equilibrium, from zeros of a small vibration around it."""
    rubber = at.Material(E=5e6, density=1100.0)
    beam = at.Beam("beam", (0, 0), (0.4, 0), at.Rectangle(0.01, 0.01), rubber)
    held = at.Scene("held", [beam], [at.Clamp("beam.start")], gravity=(0, -9.81))
    rest = at.solve_static(held, mesh=3)
    assert rest.angle("beam.end")[-1] < -0.5
    slow = at.modes(held, mesh=3, count=5, about=rest)
    straight = at.modes(held, mesh=3, count=1)
    assert abs(slow.frequencies[0] / straight.frequencies[0] - 1.0) > 0.01
    pushed = at.Scene(
        "pushed", [beam], [at.Clamp("beam.start")], [at.Force("beam.end", (0, 1e-4))], gravity=(0, -9.81)
    )
    start = at.solve_static(pushed, mesh=3)
    run = at.solve(held, mesh=3, dt=1e-3, t_end=round(4.0 / slow.frequencies[0], 2), start=start)
    y = run.position("beam.end")[:, 1] - rest.position("beam.end")[-1, 1]

    def left(lowest):
        """What cosines and sines of the modes' frequencies leave of the motion."""
        phases = 2.0 * np.pi * np.outer(run.t, [lowest, *slow.frequencies[1:]])
        table = np.concatenate([np.cos(phases), np.sin(phases)], axis=1)
        return float(np.sum((y - table @ np.linalg.lstsq(table, y, rcond=None)[0]) ** 2))

    guess = slow.frequencies[0]
    found = minimize_scalar(
        left, bounds=(0.98 * guess, 1.02 * guess), method="bounded", options={"xatol": 1e-7}
    )
    assert left(found.x) < 1e-3 * float(np.sum(y**2))
    assert found.x == pytest.approx(guess, rel=1e-4)


def test_wrong_questions_are_refused_by_name():
    scene = bar([at.Clamp("bar.start")])
    for options, words in [
        ({"count": 0}, "count is 0"),
        ({"count": 500}, "count is 500.*has 8 free motions"),
        ({"spin": float("nan")}, "spin"),
        ({"about": 3}, "about is 3"),
        ({"about": at.solve_static(scene, mesh=3)}, "another mesh"),
        (
            {"about": at.solve_static(replace(scene, gravity=(0, -1.0)), mesh=2)},
            "other gravity than scene 'bar'",
        ),
        ({"element": {"bar": "rigid"}, "mesh": 1}, "nothing that can move"),
    ]:
        with pytest.raises(DiscretisationError, match=words):
            at.modes(scene, **{"mesh": 2, **options})
    heavy = bar([at.Clamp("bar.start")], gravity=(0, -9.81))
    with pytest.raises(DiscretisationError, match="gravity or loads"):
        at.modes(heavy, mesh=2, spin=1.0)
    with pytest.raises(DiscretisationError, match="held by 2 joints"):
        at.modes(bar(JOINTS["pinned-pinned"]), mesh=2, spin=1.0)
    with pytest.raises((SceneError, DiscretisationError)):
        at.modes(None)
