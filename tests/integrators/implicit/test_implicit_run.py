"""Accelerations at t = 0: those that the stepping kernel finds, and those of the recursion with the mass alone."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from samples import SQUARE, chain_of

from anctmm.forces.actuation import Actuation
from anctmm.forces.driving import drive_table
from anctmm.integrators import generalized_alpha
from anctmm.integrators.implicit import run as implicit_run
from anctmm.integrators.implicit import system as implicit_system
from anctmm.integrators.implicit.run import balance
from anctmm.integrators.implicit.system import new_system
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque


@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_a_run_starts_with_mass_times_acceleration_equal_to_force(single, monkeypatch):
    material = Material(1e7, 1000.0, damping=1e-3)
    bodies = [Beam(n, (x, 0.0), (x + 1.0, 0.0), SQUARE, material) for n, x in (("a", 0.0), ("b", 1.0))]
    joints = [
        Clamp("a.start", lambda t: (2.5 * t**2 + t**3 / 6, 5 * t + t**2 / 2, 5 + t)),
        Pin("a.end", "b.start"),
    ]
    loads = [Torque("b.end", 0.5), Force("b.end", lambda t: (2.0 + t, -1.0))]
    chain = chain_of(
        Scene("two", bodies, joints, loads, (0.0, -9.81)), mesh=4, element="cable", dt=1e-3, t_end=1e-3
    )

    found = []
    start = implicit_run.start

    def watched(chain, system, solve):
        start(chain, system, solve)
        state = system.state
        found.append((state.q.copy(), state.v.copy(), state.a.copy(), state.w.copy()))

    monkeypatch.setattr(implicit_run, "start", watched)
    monkeypatch.setattr(implicit_system, "single_will_do", lambda chain: single)
    assert generalized_alpha.integrate(chain).status.ok

    monkeypatch.undo()
    actuation, system, now = Actuation(chain.scene, chain.bodies), new_system(chain), np.zeros(1)
    state = system.state
    drives, values = drive_table(chain, actuation, now)[0], actuation.load_table(now)[0]
    balance(system, drives, values)
    assert len(found) == 1
    size = np.abs(state.w).max()
    assert size > 5.0
    for q, v, a, w in found:
        assert_allclose(w, state.w, rtol=0, atol=1e-11 * size)
        assert np.array_equal(a, w)
        assert_allclose(q, state.q, rtol=0, atol=1e-15)
        assert_allclose(v, state.v, rtol=0, atol=1e-15)
