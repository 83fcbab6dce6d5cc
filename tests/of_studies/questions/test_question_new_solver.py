"""A solver that is one module and one entry point stands in the studies beside all others."""

import pytest

import anctmm as at
from anctmm.solvers import registry
from studies import convergence
from studies.engine.runner import Runner
from studies.engine.study import Options
from studies.trade.study import run

MODULE = """
import anctmm as at

def solve(scene, run):
    return at.solve(scene, run)
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The module as an installed package: its metadata name the solver."""
    (tmp_path / "another_solver.py").write_text(MODULE)
    info = tmp_path / "another_solver-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: another_solver\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{registry.GROUP}]\nanother = another_solver:solve\n")
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("installed")
def test_a_solver_of_one_module_is_in_the_trade_and_in_the_convergence_study():
    bar = at.RigidBody("bar", 1.0, 0.02, (0.25, 0.0), points={"o": (0.0, 0.0), "p": (0.5, 0.0)})
    scene = at.Scene("pendulum", [bar], [at.Pin("bar.o")], gravity=(0, -9.81))
    case = at.Case(scene, ["bar.p"], t_end=0.05, output_dt=0.01)
    options = Options(quick=True, cases=(case,), solvers=("anctmm", "another"))
    equal = run(options, Runner(quick=True)).table("at_equal_error").frame
    assert set(equal["solver"]) == {"anctmm", "another"}
    assert equal["status"].eq("ok").all()
    found = convergence.run(options, Runner()).table("values").frame
    values = found.pivot(index="quantity", columns="solver", values="value").dropna()
    assert len(values) >= 3
    assert (values["anctmm"] - values["another"]).abs().max() <= 2.0 * found["uncertainty"].max()
