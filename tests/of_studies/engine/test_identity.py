"""Two values share an identity only if they compute the same; users' functions count by their code."""

import functools
import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest

import anctmm as at
from studies.engine.identity import identity
from studies.scenes import four_bar

FACTOR = 3.0


def push(t):
    return FACTOR * t, 0.0


def made(source, name="f"):
    """A function of a user's file, as such files are run."""
    space = {"__name__": "<run_path>", "np": np}
    exec(source, space)
    return space[name]


DIFFERENT = {
    "code": ("def f(t): return t + 1", "def f(t): return t - 1"),
    "constant": ("def f(t): return 2.0 * t", "def f(t): return 2.5 * t"),
    "default": ("def f(t, a=1): return a * t", "def f(t, a=2): return a * t"),
    "closure": (
        "def g(a): return lambda t: a * t\nf = g(1)", "def g(a): return lambda t: a * t\nf = g(2)",
    ),
    "global": ("a = 1\ndef f(t): return a * t", "a = 2\ndef f(t): return a * t"),
    "global array": ("a = np.ones(3)\ndef f(t): return a @ a", "a = np.zeros(3)\ndef f(t): return a @ a"),
    "another function": (
        "def g(t): return t\ndef f(t): return g(t)", "def g(t): return -t\ndef f(t): return g(t)",
    ),
    "attribute of a method": (
        "class A:\n def __init__(self, k): self.k = k\n def __call__(self, t): return self.k * t\nf = A(1)",
        "class A:\n def __init__(self, k): self.k = k\n def __call__(self, t): return self.k * t\nf = A(2)",
    ),
    "code of a class": (
        "class A:\n def __call__(self, t): return t\nf = A()",
        "class A:\n def __call__(self, t): return -t\nf = A()",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", DIFFERENT)
def test_what_a_function_computes_is_its_identity(what):
    one, other = DIFFERENT[what]
    assert identity(made(one)) == identity(made(one))
    assert identity(made(one)) != identity(made(other))


def test_comments_do_not_count_and_a_recursive_function_has_an_identity():
    assert identity(made("def f(t): return t")) == identity(made("# mine\n\ndef f(t):\n    return t"))
    assert identity(made("def f(n): return 1 if n < 1 else n * f(n - 1)"))


@dataclass(frozen=True)
class Data:
    x: float
    law: object = None


def test_data_count_with_all_digits():
    assert identity(Data(0.1 + 0.2)) != identity(Data(0.3))
    assert identity(Data(1.0, functools.partial(push, 2))) != identity(Data(1.0, functools.partial(push, 3)))
    assert identity({1, 2, 3}) == identity({3, 2, 1})
    assert identity(np.arange(3)) != identity(np.arange(3.0))


def test_a_scene_is_the_same_in_another_process():
    case = four_bar()
    code = "from studies.scenes import four_bar as f; from studies.engine.identity import identity as i; print(i(f()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == identity(case)
    stiffer = replace(case.scene.bodies[0], material=at.Material(E=2e9, density=1.0))
    scene = replace(case.scene, bodies=(stiffer, *case.scene.bodies[1:]))
    assert identity(replace(case, scene=scene)) != identity(case)
