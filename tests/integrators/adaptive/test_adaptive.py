"""Error-controlled steps: the achieved error in time against a fine reference of the same mesh."""

import numpy as np
import pytest
from random_graphs import Kinds, random_graph

import anctmm as at
from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import StepError
from reference import global_dae
from studies import scenes

CASES = {
    "cantilever": (scenes.cantilever_fall, 8, "shear"),
    "four-bar": (scenes.four_bar, {"crank": 2, "coupler": 8, "follower": 2}, "cable"),
}


@pytest.mark.parametrize("name", CASES)
def test_errors_are_within_five_tolerances(name):
    """A tighter tolerance takes more steps and closes the balance of energy."""
    build, mesh, element = CASES[name]
    base = build()
    steps = {"t_end": base.t_end, "output_dt": 0.01, "integrator": "generalized-alpha"}
    options = {"mesh": mesh, "element": element, **steps}
    reference = at.solve(base.scene, dt=5e-5, **options)
    runs = {
        t: at.solve(base.scene, tolerance=t, newton_tolerance=1e-8, **options) for t in (1e-2, 1e-3, 1e-4)
    }
    for tolerance, run in runs.items():
        assert run.status.ok
        assert at.compare(run, reference, base.probes).error <= 5.0 * tolerance
    assert runs[1e-4].cost.steps > runs[1e-2].cost.steps
    lost = [np.abs(run.energy.balance).max() for run in runs.values()]
    assert lost[2] < lost[0]


@pytest.mark.parametrize("seed", range(300, 303))
def test_motions_of_random_graphs_meet_their_tolerance(seed):
    scene, run = random_graph(seed, Kinds(bodies=(2, 8)))
    steps = {"t_end": 0.02, "output_dt": 5e-3, "newton_tolerance": 1e-12, "integrator": "generalized-alpha"}
    found, fine = (
        at.solve(scene, Discretisation(run.mesh, run.element, **how, **steps))
        for how in ({"tolerance": 1e-4}, {"dt": 2.5e-5})
    )
    places = [(b.name, s) for b in scene.bodies for s in (0.0, 0.4, 1.0)]
    one, two = (np.stack([s.displacement(p) for p in places]) for s in (found, fine))
    assert found.status.ok
    assert np.abs(one - two).max() < 5e-4 * max(np.abs(two).max(), 1e-3)


def test_tolerance_beside_a_step_or_an_explicit_integrator_is_refused():
    with pytest.raises(StepError, match=r"dt is 0\.001 s beside tolerance 0\.01"):
        Discretisation(mesh=1, tolerance=1e-2, dt=1e-3)
    with pytest.raises(StepError, match="integrator 'zhai'"):
        Discretisation(mesh=1, tolerance=1e-2, integrator="zhai")
    with pytest.raises(StepError, match="tolerance is 0"):
        Discretisation(mesh=1, tolerance=0.0)
    with pytest.raises(StepError, match="does not choose its steps"):
        global_dae.solve(scenes.four_bar().scene, mesh=1, tolerance=1e-2)


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
@pytest.mark.parametrize(("output_dt", "times"), [(0.04, [0.0, 0.04, 0.08, 0.1]), (0.3, [0.0, 0.1])])
def test_the_last_output_is_at_the_end_though_intervals_do_not_fill_the_run(integrator, output_dt, times):
    """As with a fixed step; a break of a load lies at an output, and another one in the shorter interval."""
    pushes = at.History(lambda t: (0.0, 0.0 if t < 0.08 else 2.0 if t < 0.09 else 3.0), breaks=(0.08, 0.09))
    mass = at.PointMass("m", 2.0, (0.0, 0.0))
    scene = at.Scene("pushed", [mass], loads=[at.Force("m.center", pushes)])
    found = at.solve(scene, tolerance=1e-5, t_end=0.1, output_dt=output_dt, integrator=integrator)
    assert found.status.ok, found.status
    np.testing.assert_allclose(found.t, times, rtol=1e-15)
    pushed = found.t > 0.085
    np.testing.assert_allclose(found.velocity("m.center")[pushed, 1], 0.01 + 0.015, rtol=1e-9)
    np.testing.assert_allclose(found.velocity("m.center")[~pushed, 1], 0.0, atol=1e-12)


def test_a_motion_that_blows_up_is_named_and_its_history_kept():
    base = scenes.cantilever_fall()
    jump = [at.Force("beam.end", lambda t: (0.0, -1e9 if t > 0.1 else 0.0))]
    scene = at.Scene("torn", base.scene.bodies, base.scene.joints, jump)
    run = at.solve(scene, mesh=2, integrator="generalized-alpha", tolerance=1e-3, t_end=0.5, output_dt=0.01)
    assert (run.status, run.status.body) == ("diverged", "beam")
    assert 0.09 <= run.status.time <= 0.2
    assert run.t[-1] <= run.status.time + 0.01
