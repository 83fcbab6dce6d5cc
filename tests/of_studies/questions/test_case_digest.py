"""Whether a measured table is of the case as it is now."""

from dataclasses import replace
from math import sin

import pytest
from typer.testing import CliRunner

import anctmm as at
from studies.cases import find_case
from studies.cli import app
from studies.engine.runner import Runner
from studies.engine.study import Options, find
from studies.report.folder import write
from studies.trade.case_digest import digest_of
from studies.trade.recommendation import recommend

FILE = """
import anctmm as at
MASS, LENGTH, PUSH, STEPS, PLACE, TURN = 1.0, 0.5, 2.0, 10, "center", 0.7
points = {"o": (0.0, 0.0), "e": (1.0, 0.0)}
body = at.RigidBody("body", MASS, 0.1, (LENGTH, 0.0), points=points)
def push(t):
    return 0.0, PUSH * t
def law(x, v, t):
    return TURN * x**3
spring = at.RotationalSpring("body.o", law=law)
scene = at.Scene("pendulum", [body], [at.Pin("body.o")], [at.Force("body.e", push)], (0.0, -9.81), [spring])
CASES = [at.Case(scene, probes=[f"body.{PLACE}"], t_end=0.1, output_dt=0.1 / STEPS, note="as it was")]
"""
CHANGES = {
    "a number of a body": ("= 1.0, 0.5", "= 1.0000001, 0.5"),
    "a place": ("LENGTH, 0.0", "LENGTH, 0.01"),
    "a function's global": ("2.0, 10", "2.1, 10"),
    "a law": ("TURN * x**3", "TURN * x**3 + 1e-3 * v"),
    "the outputs": ("2.0, 10", "2.0, 20"),
    "the length": ("t_end=0.1,", "t_end=0.2,"),
    "the probe": ('"center"', '"e"'),
    "gravity": ("-9.81", "-9.82"),
    "a connector more": ("[spring]", "[spring, spring]"),
}


def case_in(folder, text):
    (folder / "own.py").write_text(text)
    return find_case(str(folder / "own.py"))


def test_the_same_case_has_the_same_digest(tmp_path):
    digest = digest_of(case_in(tmp_path, FILE))
    assert digest_of(case_in(tmp_path, FILE)) == digest
    assert digest_of(case_in(tmp_path, FILE.replace("as it was", "told in other words"))) == digest
    # a computed number may differ in its last digits on another machine
    assert (
        digest_of(case_in(tmp_path, FILE.replace("LENGTH, 0.0)", "LENGTH * (1.0 + 1e-15), 0.0)"))) == digest
    )


@pytest.mark.parametrize("change", CHANGES)
def test_another_case_has_another(tmp_path, change):
    changed = FILE.replace(*CHANGES[change])
    assert changed != FILE
    assert digest_of(case_in(tmp_path, changed)) != digest_of(case_in(tmp_path, FILE))


def test_functions_are_told_by_what_they_answer():
    def of(size):
        rod, rubber = at.Circle(0.01), at.Material(1e7, 1e3)
        beam = at.Beam("b", (0, 0), (1, 0), rod, rubber, velocity=lambda s: (0.0, size * s))
        push = at.Force("b.end", at.History(lambda t: (sin(t), 0.0), [0.5]))
        return digest_of(at.Case(at.Scene("s", [beam], [at.Pin("b.start")], [push]), ["b.end"], 1.0))

    assert of(1.0) == of(1.0)
    assert of(1.0) != of(1.001)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A trade of the file as it is at first."""
    folder = tmp_path_factory.mktemp("trade")
    options = Options(
        quick=True, cases=(case_in(folder, FILE),), solvers=("anctmm",), integrator="zhai", error=1e-2
    )
    return folder, write(find("trade")(options, Runner(None, repeats=1)), folder)


def answered(folder, table):
    arguments = ["recommend", str(folder / "own.py"), "--table", str(table), "--error", "1e-2", "--no-rerun"]
    done = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
    return done.exit_code, done.output


@pytest.mark.exhaustive
def test_a_table_of_the_case_as_it_was_before_is_refused(measured):
    """It was answered from with the exit code 0."""
    folder, table = measured
    assert answered(folder, table)[0] == 0
    case_in(folder, FILE.replace("= 1.0, 0.5", "= 1.1, 0.5"))
    code, output = answered(folder, table)
    assert code == 2
    assert "was measured before scene 'pendulum', its probes or its times were changed" in output
    case_in(folder, FILE)
    assert answered(folder, table)[0] == 0


@pytest.mark.exhaustive
def test_tables_that_do_not_say_of_what_case_they_are_pass(measured):
    folder, table = measured
    of_now = recommend.read(table)
    changed = case_in(folder, FILE.replace("= 1.0, 0.5", "= 1.1, 0.5"))
    with pytest.raises(recommend.RecommendError, match="measures it anew"):
        recommend.check_case(of_now, changed)
    recommend.check_case(replace(of_now, references=of_now.references.drop(columns="case")), changed)
    case_in(folder, FILE)
    kept = recommend.kept()
    for name in set(kept.references["scene"]):
        recommend.check_case(kept, find_case(name))
