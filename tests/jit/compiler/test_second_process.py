"""Compiling in two processes: the same kernels, none compiled twice, and one process where two cannot be."""

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from samples import beam

import anctmm as at
from anctmm.discretise import kept_chains
from anctmm.integrators import zhai
from anctmm.integrators.implicit import run as implicit_run
from anctmm.jit.compiler import second_process
from anctmm.jit.compiler.kernel_files import directory

SCRIPT = """
import os, sys, time
import numpy as np
from anctmm.jit.compiler.second_process import Parts, Task
from anctmm.jit.compiler import second_process
from small_kernels import inner, outer
x = np.arange(5.0)
parts = Parts([Task(inner, (x, 1.0))])
{change}
with second_process.side_by_side(lambda: parts):
    print(outer(x), sum(inner.stats.cache_hits.values()), sum(outer.stats.cache_hits.values()))
assert not second_process._open
try:
    print(os.waitpid(-1, os.WNOHANG))
except ChildProcessError:
    print("no child")
"""
#: What is changed before the run.
ALONE = "second_process._worthwhile = lambda: False"
BESIDE = "second_process._worthwhile = lambda: True"
#: The first process goes on when the second one has done all.
AFTER = f"""{BESIDE}
tell = second_process._tell
def done(second, tasks):
    told = tell(second, tasks)
    second.stdin.close()
    second.wait()
    return told
second_process._tell = done
"""
BY_PYTHON = "parts = Parts([Task(inner, (x, 1.0)), Task(outer, (x,), by_python=True)])"
BEFORE = """parts = Parts([Task(inner, (x, 1.0))], lambda: [Task(outer, (x,), by_python=True)])
with second_process.side_by_side(lambda: parts):
    inner(x, 1.0)
    print(len(outer.overloads))
"""
FAILING = {
    "cannot start": "sys.executable = '/nowhere/python'",
    "has no executable": "sys.executable = None",
    "fails": "second_process._PROGRAM = 'raise SystemExit(3)'",
    "dies": "second_process._PROGRAM = 'import os; os.kill(os.getpid(), 9)'",
    "does nothing": "second_process._PROGRAM = 'import time; time.sleep(600)'",
}


#: The second process holds the lock of what the first one reaches next, and does no more.
STOPPED = f"""{BESIDE}
second_process.PATIENCE = 0.5
second_process._PROGRAM = (
    "import pickle, sys, time; sys.path[:], name = pickle.load(sys.stdin.buffer)\\n"
    "from importlib import import_module; from anctmm.jit.files.one_compiler import alone\\n"
    "[(module, kernel, types, _)] = pickle.load(sys.stdin.buffer)\\n"
    "with alone(getattr(import_module(module), kernel)._cache.file_of(types)): time.sleep(600)"
)
tell = second_process._tell
def held(second, tasks):
    told = tell(second, tasks)
    file = inner._cache.file_of(second_process._types(tasks[0].arguments))
    while not second_process.is_taken(file):
        time.sleep(0.01)
    return told
second_process._tell = held
"""


def answer(change, cache):
    """What a process prints that calls a kernel, kept in a directory, for the first time."""
    paths = os.pathsep.join(
        filter(None, [str(Path(__file__).parents[2] / "helpers"), os.environ.get("PYTHONPATH")])
    )
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(change=change)],
        env=os.environ | {"ANCTMM_CACHE": str(cache), "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert all("compil" in line for line in done.stderr.splitlines()), done.stderr
    return done.stdout


def test_what_a_second_process_compiles_is_not_compiled_here(tmp_path):
    assert answer(ALONE, tmp_path / "one") == "60.0 0 0\nno child\n"
    assert answer(AFTER, tmp_path / "two") == "60.0 1 0\nno child\n"
    for of in (tmp_path / "one", tmp_path / "two"):
        assert {f.name.partition("-")[0] for f in of.rglob("*.kernel")} == {
            "small_kernels.inner",
            "small_kernels.outer",
        }


def test_a_second_process_compiles_what_python_calls(tmp_path):
    assert answer(f"{AFTER}\n{BY_PYTHON}", tmp_path) == "60.0 0 1\nno child\n"


def test_the_first_process_compiles_its_own_part_before_what_it_reaches(tmp_path):
    assert answer(f"{BESIDE}\n{BEFORE}", tmp_path / "two").startswith("1\n60.0 ")
    assert answer(f"{ALONE}\n{BEFORE}", tmp_path / "one").startswith("0\n60.0 ")


def test_both_processes_at_once_give_the_same(tmp_path):
    assert answer(BESIDE, tmp_path).splitlines()[0].split()[0] == "60.0"


@pytest.mark.parametrize("how", FAILING)
def test_whatever_becomes_of_the_second_process_the_answer_is_the_same(how, tmp_path):
    assert answer(f"{BESIDE}; {FAILING[how]}", tmp_path) == "60.0 0 0\nno child\n"


def test_a_second_process_that_holds_a_kernel_and_stops_is_not_waited_for_long(tmp_path):
    assert answer(STOPPED, tmp_path) == "60.0 0 0\nno child\n"


SCENES = {
    "hinged": ([at.Pin("a.start"), at.Pin("a.end", "b.start")], []),
    "driven": ([at.Clamp("a.start", at.Quintic(1.0, 1.0)), at.Pin("a.end", "b.start")], [at.Torque("b.end", 1.0)]),
    "triangle": ([at.Pin("a.end", "b.start"), at.Pin("b.end", "c.start"), at.Pin("c.end", "a.start")], []),
    "spring": ([at.Pin("a.start"), at.Pin("a.end", "b.start")], []),
    "plate": ([at.Pin("a.start"), at.Pin("a.end", "b.start"), at.Pin("b.end", "plate.corner")], []),
}  # fmt: skip


@pytest.mark.parametrize(
    ("integrator", "module"),
    [("zhai", zhai), ("generalized-alpha", implicit_run), ("esdirk", implicit_run)],
    ids=["zhai", "generalized-alpha", "esdirk"],
)
@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("cable", "hinged"),
        pytest.param("shear", "driven", marks=pytest.mark.exhaustive),
        pytest.param("cable", "triangle", marks=pytest.mark.exhaustive),
        pytest.param("cable", "spring", marks=pytest.mark.exhaustive),
        ("cable", "plate"),
    ],
)
def test_what_a_second_process_is_given_is_what_the_steps_call(kind, name, integrator, module, monkeypatch):
    """Else it would work in vain, and in every process again."""
    if integrator == "esdirk" and name == "plate":
        pytest.skip("what is asked for is that of generalized-alpha there, and its steps compile for long")
    joints, loads = SCENES[name]
    bodies = [beam(), beam("b", (1.0, 0.0), (1.0, 1.0))]
    bodies += [beam("c", (1.0, 1.0), (0.0, 0.0))] if name == "triangle" else []
    plate = at.RigidBody("plate", mass=1.0, inertia=0.1, center=(1.0, 1.5), points={"corner": (1.0, 1.0)})
    bodies += [plate] if name == "plate" else []
    springs = [at.Spring("b.end", (2.0, 2.0), stiffness=1.0)] if name == "spring" else []
    asked = []

    @contextmanager
    def watched(parts):
        asked.extend(parts().shared)
        yield

    monkeypatch.setattr(module, "side_by_side", watched)
    kept_chains._chains.clear()
    found = at.solve(
        at.Scene(name, bodies, joints, loads, connectors=springs),
        mesh=2,
        integrator=integrator,
        dt=1e-5,
        t_end=2e-5,
        element=kind,
    )
    assert found.status.ok, found.status
    assert asked
    if directory() is not None:
        unknown = [
            task.kernel.py_func.__name__
            for task in asked
            if not second_process._known(task.kernel, second_process._types(task.arguments))
        ]
        assert not unknown


def test_a_warm_process_starts_no_second_one(monkeypatch):
    scene = at.Scene("one", [beam()], [at.Pin("a.start")])
    at.solve(scene, mesh=2, integrator="zhai", dt=1e-5, t_end=2e-5)
    monkeypatch.setattr(
        second_process, "_start", lambda tasks: pytest.fail(f"{len(tasks)} kernels asked for")
    )
    monkeypatch.setattr(second_process, "_worthwhile", lambda: True)
    kept_chains._chains.clear()
    assert at.solve(scene, mesh=2, integrator="zhai", dt=1e-5, t_end=2e-5).status.ok


@pytest.mark.parametrize(
    ("processors", "load", "expected"), [(1, 0.0, False), (2, 0.5, True), (2, 2.5, False), (8, 2.5, True)]
)
def test_a_second_process_is_started_where_a_processor_is_free(processors, load, expected, monkeypatch):
    monkeypatch.setattr(second_process, "_processors", lambda: processors)
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0), raising=False)
    assert second_process._worthwhile() is expected


@pytest.mark.parametrize("program", ["", None, "/opt/bin/another-program"])
def test_another_program_with_python_inside_is_not_started(program, monkeypatch):
    monkeypatch.setattr(second_process, "_processors", lambda: 2)
    monkeypatch.setattr(os, "getloadavg", lambda: (0.0, 0.0, 0.0), raising=False)
    assert second_process._worthwhile()
    monkeypatch.setattr(sys, "executable", program)
    assert not second_process._worthwhile()


def test_arguments_have_types():
    assert len(second_process._types((1, 2.0, np.zeros(3), None, True))) == 5
