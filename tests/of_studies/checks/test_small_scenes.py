"""What `anctmm check` watches beside the base scenes: small scenes that see the faults planted in the solver."""

import json
import subprocess
import sys

import planted
import pytest
from uncompiled import said_by

from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.lacking import LACKING
from anctmm.model.needs import MECHANISMS, needs
from studies.regression.scenes import FromRest, Static, tasks_of
from studies.regression.small_watches import LIMITS, small_watches

TASKS = tasks_of(small_watches())
KINDS = {fault.kind for fault in planted.faults()}


def test_a_planted_fault_of_each_kind_is_seen():
    """And none without a fault. The first of each kind; all are tried by `python tests/helpers/planting/planted.py`."""
    done = subprocess.run(
        [sys.executable, planted.__file__, "--first"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"seen {len(KINDS)} of {len(KINDS)}" in done.stdout


@pytest.fixture(scope="module")
def beside_dae():
    """Uncompiled, as the planted faults are tried: the kernels of another solver would take longer to compile."""
    return json.loads(said_by("processes/small_against_dae.py").splitlines()[-1])


def test_stored_histories_of_small_scenes_are_those_of_the_global_dae(beside_dae):
    """They are stored by the solver they watch: another one finds the same, wherever it takes the scene."""
    apart, _ = beside_dae
    assert len(apart) >= 45
    assert max(apart.values()) < 1e-9, max(apart, key=apart.get)


def test_stable_steps_end_where_the_global_dae_says(beside_dae):
    """The limits are those of another solver, which finds them from its own matrices."""
    _, ends = beside_dae
    assert set(ends) == set(LIMITS) - {"rigid"}
    assert all(codes == ["ok", "refused"] for codes in ends.values()), ends


def test_what_the_small_scenes_are_for_is_there():
    """Options that the base scenes leave at their defaults; each is asked for by name."""
    runs = [t.run for t in TASKS if isinstance(t.run, Discretisation)]
    bodies = [b for t in TASKS for b in t.scene.beams]
    assert {r.quadrature for r in runs} == {"full", "reduced", "lobatto"}
    assert {r.spectral_radius for r in runs} >= {0.0, 0.4, 0.9, 1.0}
    assert any(r.psi != r.phi for r in runs)
    assert any(r.tolerance is not None for r in runs)
    assert any(b.material.poisson > 0.0 for b in bodies)
    assert any(b.material.damping > 0.0 for b in bodies)
    assert any(t.scene.gravity[0] != 0.0 for t in TASKS)
    assert {t.ends for t in TASKS} >= {"ok", "refused", "diverged"}
    assert {name for t in TASKS for name, _ in needs(t.scene)} >= MECHANISMS.keys() - LACKING
    assert any(isinstance(t.run, FromRest) for t in TASKS)
    assert any(isinstance(t.run, Static) and t.run.path == "arclength" for t in TASKS)
