"""What others rely on: imports run downwards only, and the public face stays."""

import inspect
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

import anctmm as at
from reference import exudyn_cable, exudyn_reissner, global_dae

ROOT = Path(__file__).parents[1]
FACE = {
    "Beam", "Circle", "Clamp", "Comparison", "Cost", "Discretisation", "Energy", "Force", "History", "Material", "Pin",
    "Pulse", "Quintic", "Rectangle", "Scene", "Section", "Solution", "Status", "Torque", "Weld", "compare",
    "distance", "solve", "solve_static",
}  # fmt: skip
SOLVERS = (at, global_dae, exudyn_cable, exudyn_reissner)


def test_imports_run_downwards_only():
    command = [
        sys.executable,
        "-c",
        "from importlinter.cli import lint_imports_command as c; c()",
        "--no-cache",
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "7 kept, 0 broken" in done.stdout


def test_public_face():
    assert set(at.__all__) >= FACE
    assert sorted(at.__all__) == list(at.__all__)
    for name in at.__all__:
        thing = getattr(at, name)
        assert inspect.getdoc(thing), name
        assert thing.__module__.startswith("anctmm."), name


def test_solving_needs_no_reference_and_no_study():
    code = (
        "import sys, anctmm; print([m for m in sys.modules if m.split('.')[0] in ('reference', 'studies')])"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=ROOT, capture_output=True, text=True
    )
    assert (done.stdout.strip(), done.returncode) == ("[]", 0), done.stderr


@pytest.mark.parametrize("module", SOLVERS, ids=lambda m: m.__name__)
def test_every_solver_has_one_signature(module):
    for function in (module.solve, module.solve_static):
        parameters = inspect.signature(function).parameters
        assert list(parameters)[:2] == ["scene", "run"]
        assert parameters["run"].default is None
        assert parameters["options"].kind is inspect.Parameter.VAR_KEYWORD
    assert "load_steps" in inspect.signature(module.solve_static).parameters


@pytest.mark.parametrize("module", SOLVERS, ids=lambda m: m.__name__)
def test_every_solver_answers_with_the_same_class(module):
    beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.02), at.Material(E=1e9, density=1000.0))
    scene = at.Scene("s", [beam], [at.Clamp("b.start")], [at.Force("b.end", (0.0, -0.01))])
    for answer in (
        module.solve(scene, mesh=1, dt=1e-3, t_end=0.01, output_dt=5e-3),
        module.solve_static(scene, mesh=1, load_steps=2),
    ):
        assert type(answer) is at.Solution
        assert answer.status.ok
        assert answer.status == "ok"
        assert answer.t == pytest.approx([0.0, 0.5 * answer.t[-1], answer.t[-1]])
        assert answer.position("b", 0.5).shape == answer.displacement("b.end").shape == (3, 2)
        assert {f.name for f in fields(answer.energy)} == {
            "kinetic",
            "strain",
            "potential",
            "work",
            "dissipated",
        }
        assert {len(series) for series in vars(answer.energy).values()} == {3}
        assert answer.cost.cpu_s >= 0.0
        assert answer.cost.steps > 0
        assert answer.dofs > 0
