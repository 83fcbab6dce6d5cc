"""Loops over elements are vectorised within the kernels of steps, too, and not only by themselves."""

import os
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest
from marks import exhaustive_where
from numba.core import config

from anctmm.discretise.discretisation import INTEGRATORS

SCRIPT = Path(__file__).parents[1] / "helpers" / "processes" / "vector_instructions.py"
#: Where the compiler left a loop scalar within its caller: explicit steps of shear elements took 2.7 times as long.
LOST = ("shear", "zhai")


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize(
    "case", exhaustive_where(lambda case: case != LOST, product(("cable", "quintic", "shear"), INTEGRATORS))
)
def test_steps_have_all_vector_operations_of_the_forces(case, tmp_path):
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *case],
        env=os.environ | {"ANCTMM_CACHE": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    within, alone, gathered = map(int, done.stdout.split())
    assert within >= alone > 50
    assert gathered == 0  # forces took three times as long where the coordinates of neighbours were gathered
