"""A new solver is one module and one line of metadata, and then stands in `conform` and in studies."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import anctmm as at
from anctmm.solvers import registry
from studies.agreement.study import agreement
from studies.conformance.check import BROKEN, HOLDS, NOT_OFFERED, conform

MODULE = Path(__file__).parents[2] / "helpers" / "radau.py"


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The module in a package as pip leaves it."""
    (tmp_path / "small_radau.py").write_text(MODULE.read_text(encoding="utf-8"), encoding="utf-8")
    info = tmp_path / "small_radau-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: small_radau\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[anctmm.solvers]\nradau = small_radau:solve\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    assert "radau" in registry.names()
    return registry.solver("radau")


def double_pendulum():
    section, steel = at.Rectangle(0.02, 0.02), at.Material(2e11, 7800.0)
    bars = [
        at.Beam("upper", (0, 0), (0.5, 0), section, steel),
        at.Beam("lower", (0.5, 0), (0.9, 0.3), section, steel),
    ]
    joints = [at.Pin("upper.start"), at.Pin("upper.end", "lower.start")]
    return at.Scene("double pendulum", bars, joints, gravity=(0.0, -9.81))


def angles_by_lagrange(t):
    """Both angles from the x axis by Lagrange's equations, for bars of 0.5 m each and equal section."""

    def rates(t, y):
        a, b, p, q = y
        c, s = np.cos(a - b), np.sin(a - b)
        r, g = 0.5, 9.81
        M = r * r * np.array([[4 / 3, c / 2], [c / 2, 1 / 3]])
        f = np.array(
            [-r * r * s * q * q / 2 - 1.5 * g * r * np.cos(a), r * r * s * p * p / 2 - g * r * np.cos(b) / 2]
        )
        return [p, q, *np.linalg.solve(M, f)]

    found = solve_ivp(
        rates, (0, t[-1]), [0.0, np.arctan2(0.3, 0.4), 0.0, 0.0], t_eval=t, rtol=1e-11, atol=1e-12
    )
    return found.y[:2]


def test_a_rigid_double_pendulum_on_its_null_space(installed):
    run = at.Discretisation(
        1, "rigid", integrator="esdirk", dt=2e-3, t_end=1.0, output_dt=0.05, newton_tolerance=1e-12
    )
    found = installed(double_pendulum(), run)
    assert found.status.ok
    a, b = angles_by_lagrange(found.t)
    tip = 0.5 * np.stack([np.cos(a) + np.cos(b), np.sin(a) + np.sin(b)], axis=1)
    assert np.abs(found.position("lower.end") - tip).max() < 2e-6
    ours = at.solve(double_pendulum(), run)
    assert at.compare(ours, found, ["lower.end", "upper.end"]).error < 1e-5


@pytest.mark.usefixtures("installed")
def test_it_keeps_the_rules_of_all_solvers():
    found = {f.rule: f for f in conform("radau")}
    assert [f for f in found.values() if f.verdict == BROKEN] == []
    assert {f.verdict for f in found.values()} == {HOLDS, NOT_OFFERED}
    assert found["joints"].verdict == found["units: Pa, kg"].verdict == HOLDS


@pytest.mark.usefixtures("installed")
def test_it_stands_in_a_study():
    pairs = agreement(True, ["anctmm", "radau"], dt=1e-3)
    assert list(pairs["status"]) == ["ok"]  # the four-bar is driven, which it lacks
    assert pairs["same_element"].all()
    assert pairs["difference"].max() < 0.02
