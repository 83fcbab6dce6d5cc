"""A solver that is one module and one entry point stands in the studies beside all others."""

import numpy as np
import pytest

import anctmm as at
from anctmm.solvers import registry
from studies import convergence
from studies.engine.runner import Runner
from studies.engine.study import Options
from studies.trade.study import run


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The module as an installed package: its metadata name the solver."""
    info = tmp_path / "null_space-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: null-space\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{registry.GROUP}]\nnull-space = null_space:solve\n")
    monkeypatch.syspath_prepend(tmp_path)


def pendulum():
    upper = at.RigidBody("upper", 1.0, 0.02, (0.25, 0.0), points={"o": (0.0, 0.0), "p": (0.5, 0.0)})
    lower = at.RigidBody("lower", 0.5, 0.01, (0.5, -0.2), points={"p": (0.5, 0.0), "q": (0.5, -0.4)})
    scene = at.Scene(
        "pendulum", [upper, lower], [at.Pin("upper.o"), at.Pin("upper.p", "lower.p")], gravity=(0, -9.81)
    )
    return at.Case(scene, ["lower.q"], t_end=0.2, output_dt=0.01)


def test_a_solver_of_one_module_is_in_the_trade_and_in_the_convergence_study(installed):
    case = pendulum()
    options = Options(quick=True, cases=(case,), solvers=("anctmm", "null-space"))
    result = run(options, Runner(quick=True))
    equal = result.table("at_equal_error").frame
    assert set(equal["solver"]) == {"anctmm", "null-space"}
    assert equal["status"].eq("ok").all()
    found = convergence.run(Options(quick=True, cases=(case,), solvers=("anctmm", "null-space")), Runner())
    values = found.table("values").frame.pivot(index="quantity", columns="solver", values="value")
    uncertainty = found.table("values").frame["uncertainty"].max()
    both = values.dropna()
    assert len(both) >= 3
    assert np.abs(both["anctmm"] - both["null-space"]).max() <= 2.0 * uncertainty
