"""Runs that fail: named by when, where and what to try, their history kept until then and shown as cut."""

from dataclasses import replace

import numpy as np
import pytest
from samples import bar, frequency_of

import anctmm as at
from anctmm.model.scene import Clamp, Force, Material
from anctmm.results.checks.divergence import checked, inside_out
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from reference import exudyn_cable, global_dae
from studies.scenes import cantilever_fall

RUBBER = Material(1e6, 1000.0)


def pushed():
    """A clamped bar whose end is pushed through itself."""
    return bar([Clamp("bar.start")], [Force("bar.end", lambda t: (-4e5 * t, 0.0))], material=RUBBER)


def pulled():
    """A clamped bar that stretches, so that its thickness modes become stiffer."""
    return bar([Clamp("bar.start")], [Force("bar.end", lambda t: (6e4 * t, 8e4 * t))], material=RUBBER)


def struck():
    """A clamped bar hit by a force that no step of 10 ms can follow."""
    return bar([Clamp("bar.start")], [Force("bar.end", lambda t: (0.0, 1e9 if t > 0.055 else 0.0))])


def stopped():
    """A clamped bar whose end is at a jump of a spring's law, at which no implicit step finds a force."""

    def stops(elongation, rate, t):
        return 3e4 if elongation > 0.0 else -3e4

    free = bar([Clamp("bar.start")])
    return replace(free, connectors=(at.Spring("bar.end", (0.6, -0.2), law=stops),))


EXPLICIT = {"integrator": "zhai", "element": "shear", "dt": 1e-5, "output_dt": 1e-2}
IMPLICIT = {"element": "shear", "dt": 1e-3, "output_dt": 1e-2}
ABOVE = {**EXPLICIT, "dt": 1.25e-4, "output_dt": 2.5e-2}
STEP = {"dt": 1e-2, "t_end": 0.1}
FALL = {"mesh": 2, "dt": 1e-2, "output_dt": 0.05}
#: What diverges: solver, scene, discretisation, and what its status must say.
DIVERGED = {
    "inverted, explicit": (at.solve, pushed, EXPLICIT, ["turned inside out at t = 0.03 s", "finer mesh"]),
    "inverted, implicit": (at.solve, pushed, IMPLICIT, []),
    "limit falls": (at.solve, pulled, ABOVE, ["lowers the largest stable step, to 0.00"]),
    "gradients": (at.solve, struck, STEP, []),
    "gradients, Exudyn": (exudyn_cable.solve, struck, STEP, ["gradients grew beyond 1000"]),
    "Newton": (at.solve, lambda: cantilever_fall().scene, FALL, ["Newton's iteration failed"]),
    "Newton, global": (global_dae.solve, stopped, {"dt": 1e-4, "output_dt": 1e-4}, ["Newton's iteration"]),
}


@pytest.mark.parametrize("what", DIVERGED)
def test_divergence_is_named_and_the_history_before_it_kept(what):
    solve, scene, options, words = DIVERGED[what]
    run = at.Discretisation(**{"mesh": 4, "t_end": 1.0} | options)
    found = solve(scene(), run)
    status, body = found.status, found.scene.bodies[0].name
    assert (status, status.body) == ("diverged", body)
    assert status.element in range(run.mesh)
    for word in [*words, "smaller dt", repr(body), f"element {status.element}"]:
        assert word in status.message
    assert status.time == pytest.approx(status.step * run.dt)
    assert 0 < len(found.t) < len(run.output_steps)
    assert found.t[-1] < status.time
    path = found.position(body, 1.0)
    assert len(path) == len(found.t) == len(found.energy.balance)
    assert np.isfinite(path).all()


# --- what is sound -----------------------------------------------------------------------------------------


def straight(vectors=3):
    """Coordinates of a straight row of four elements of length 1, (1, nodes, vectors, 2)."""
    q = np.zeros((1, 5, vectors, 2))
    q[0, :, 0, 0] = np.arange(5)
    q[0, :, 1, 0] = 1.0
    q[0, :, 2:, 1] = 1.0
    return q


@pytest.mark.parametrize("angle", [0.0, 2.5])
def test_elements_inside_out_are_found_however_they_lie(angle):
    """One whose far end lies before its near one, a director that points down, and an axis with a cusp."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    assert not inside_out(straight() @ turn, 1.0).any()
    folded = straight()
    folded[0, 3:, 0, 0] -= 1.6
    assert inside_out(folded @ turn, 1.0).tolist() == [[False, False, True, False]]
    mirrored = straight()
    mirrored[0, 2, 2] *= -1.0
    assert inside_out(mirrored @ turn, 1.0).tolist() == [[False, True, True, False]]
    cusp = straight(vectors=2)
    cusp[0, 4, 0, 0], cusp[0, 4, 1, 0] = 3.04, -1.1
    assert inside_out(cusp @ turn, 1.0).tolist() == [[False, False, False, True]]


def moving(q):
    """A solution with the coordinates of one body over time."""
    run = at.Discretisation(mesh=4, dt=0.1, t_end=0.1 * (len(q) - 1), integrator="zhai")
    times, energy = run.times(run.output_steps), Energy.unknown(len(q))
    return Solution("x", bar(), run, times, {"bar": HermiteField(q, 4.0)}, energy, Cost(), Status())


#: Kinetic and potential energy, and work: what is no divergence, and what is.
ENERGIES = {
    "falling": ([0.0, 1.0, 4.0, 9.0], [0.0, -1.0, -4.0, -9.0], [0.0] * 4, True),
    "driven": ([0.0, 1.0, 4.0, 9.0], [0.0] * 4, [0.0, 1.0, 4.0, 9.0], True),
    "damped": ([9.0, 4.0, 1.0, 0.0], [0.0] * 4, [0.0] * 4, True),
    # a stable step near its limit may show an energy of 5
    "vibrating": ([1.0, 5.0, 5.0, 1.0], [0.0] * 4, [0.0] * 4, True),
    "growing": ([1.0, 5.0, 8.0, 90.0], [0.0] * 4, [0.0] * 4, False),
}


@pytest.mark.parametrize("what", ENERGIES)
def test_energy_from_nowhere_is_told_from_work_and_exchange(what):
    kinetic, potential, work, ok = ENERGIES[what]
    energy = Energy(*(np.array(x) for x in (kinetic, [0.0] * 4, potential, work)))
    found = checked(replace(moving(np.repeat(straight(), 4, axis=0)), energy=energy))
    assert found.status == ("ok" if ok else "diverged")


def test_history_is_cut_before_the_first_fault():
    q = np.repeat(straight(), 6, axis=0)
    assert checked(moving(q)).status.ok
    q[4, 2, 2] *= -1.0
    cut = checked(moving(q))
    assert (cut.status, cut.status.step, cut.status.element) == ("diverged", 4, 1)
    assert len(cut.t) == len(cut.position("bar", 0.5)) == len(cut.energy.work) == 4


def test_a_stable_step_near_its_limit_is_no_divergence():
    """Cables that vibrate at their highest frequency alone show up to five times their energy at 0.9 of the limit."""
    body = replace(
        bar().bodies[0], start=(0.0, 0.0), end=(1.0, 0.0), velocity=lambda x: (1e-3 * np.sin(50.0 * x), 0.0)
    )
    scene = at.Scene("axial", [body], [Clamp("bar.start")])
    limit = 2.0 / frequency_of(scene)
    found = at.solve(scene, mesh=2, integrator="zhai", dt=0.9 * limit, t_end=1800 * limit)
    assert found.status.ok
    assert found.energy.balance.max() > 2.0 * found.energy.kinetic[0]
