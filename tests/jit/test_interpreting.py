"""Kernels run by Python give what compiled ones give, and nothing is compiled for them."""

import numpy as np
import pytest
from numba.core import config
from samples import beam

import anctmm as at
from anctmm.discretise.kept_chains import forget
from anctmm.jit.announcing import compiling
from anctmm.jit.interpreting import interpreted, mode

pytestmark = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")

RUNS = {
    "explicit": {"integrator": "zhai", "dt": 1e-5, "t_end": 3e-4},
    "implicit": {"dt": 1e-3, "t_end": 1e-2},
    "tolerance": {"integrator": "generalized-alpha", "tolerance": 1e-3, "t_end": 5e-3},
}


def scene(mechanism):
    """Two hinged beams under gravity; with a plate, a spring and a follower force."""
    bodies = [beam(), beam("b", (1.0, 0.0), (2.0, 0.5))]
    joints = [at.Pin("a.start"), at.Pin("a.end", "b.start")]
    if not mechanism:
        return at.Scene("bars", bodies, joints, gravity=(0.0, -9.81))
    plate = at.RigidBody("plate", mass=1.0, inertia=0.1, center=(2.0, 1.0), points={"corner": (2.0, 0.5)})
    return at.Scene(
        "mechanism",
        [*bodies, plate],
        [*joints, at.Pin("b.end", "plate.corner")],
        [at.Force(("a", 0.5), (0.0, -2.0), follower=True)],
        connectors=[at.Spring("plate.corner", (2.0, 2.0), stiffness=50.0, damping=0.1)],
        gravity=(0.0, -9.81),
    )


@pytest.mark.exhaustive
@pytest.mark.parametrize("mechanism", [False, True])
@pytest.mark.parametrize("run", RUNS)
def test_motions_by_python_are_those_of_the_compiler(mechanism, run):
    moving, found = scene(mechanism), []
    for by_python in (True, False):
        forget()
        kernels, mode.on = compiling.kernels, by_python
        try:
            found.append(at.solve(moving, mesh=2, output_dt=RUNS[run]["t_end"], **RUNS[run]))
        finally:
            mode.on = False
        assert found[-1].status.ok, found[-1].status
        assert not by_python or compiling.kernels == kernels
    for end in ("a.end", "b.end"):
        by_python, compiled = (s.displacement(end) for s in found)
        assert np.abs(by_python - compiled).max() < 1e-10
        assert np.abs(compiled).max() > 1e-8
    assert np.abs(found[0].energy.balance - found[1].energy.balance).max() < 1e-9


def test_equilibria_by_python_are_those_of_the_compiler():
    hanging = at.Scene("bar", [beam()], [at.Clamp("a.start")], gravity=(0.0, -9.81))
    with interpreted():
        by_python = at.solve_static(hanging, mesh=2).position("a.end")[-1]
    assert np.abs(by_python - at.solve_static(hanging, mesh=2).position("a.end")[-1]).max() < 1e-10


def test_the_compiler_is_back_after_an_error():
    def fail():
        assert mode.on
        raise RuntimeError("here")

    with pytest.raises(RuntimeError, match="here"), interpreted():
        fail()
    assert not mode.on
