"""Runs are stored when they are done, also those of scenes with functions of the user's; times are taken in turn."""

from dataclasses import replace

import numpy as np
import pytest

import anctmm as at
from anctmm.results.ended_early import nothing
from anctmm.results.status import Status
from studies.engine import provenance
from studies.engine.meshes import StudyError
from studies.engine.runner import Runner
from studies.engine.timing import least, settled
from studies.engine.trials import Trial

MASS = at.Scene("mass", [at.PointMass("m", 1.0, (0.0, 0.0))], gravity=(0.0, -9.81))


def trials(scene=MASS, steps=(0.1, 0.05), solver="stub"):
    return [Trial(scene, solver, (1,), dt=dt, t_end=1.0, output_dt=0.1) for dt in steps]


class Made:
    """A made-up solver that counts its calls, and says how long the first and the others of a setting take."""

    def __init__(self, first=1.5e-3, others=1e-4, stop=None):
        self.calls, self.first, self.others, self.stop = [], first, others, stop

    def __call__(self, scene, run):
        if run.t_end < 1.0:  # a warm-up
            return nothing("stub", scene, run, Status())
        if self.stop is not None and len(self.calls) >= self.stop:
            raise KeyboardInterrupt
        known = self.calls[-1:] == [run.dt]
        self.calls.append(run.dt)
        cost = self.others if known else self.first
        return nothing("stub", scene, run, Status()).with_cost(at.Cost(cost, cost, run.steps))


def stub(scene, run):
    """A made-up solver with an identity: its own attributes are no part of it."""
    stub.count.append(run.dt)
    return nothing("stub", scene, run, Status()).with_cost(at.Cost(1e-4, 1e-4, run.steps))


stub.count = []


def runner(store, solver=stub, **options):
    return Runner(store, resolve=lambda name: solver, **options)


def test_a_run_is_stored_and_not_done_again(tmp_path):
    first = runner(tmp_path).solve_many(trials())
    stub.count.clear()
    again = runner(tmp_path)
    assert [s.cost.steps for s in again.solve_many(trials())] == [s.cost.steps for s in first]
    assert (stub.count, again.computed) == ([], 0)
    assert len(runner(tmp_path).solve_many(trials(steps=(0.1, 0.02)))) == 2
    assert set(stub.count) == {0.02}


def test_runs_of_scenes_with_functions_of_the_users_are_stored_too(tmp_path):
    scenes = [
        replace(MASS, loads=(at.Force("m.center", lambda t, k=k: (k * t, 0.0)),)) for k in (1.0, 2.0, 1.0)
    ]
    for scene, computed in zip(scenes, (1, 1, 0), strict=True):
        one = runner(tmp_path)
        found = one.solve(trials(scene, (0.1,))[0])
        assert one.computed == computed
        assert found.scene is scene


def test_an_interrupt_loses_no_finished_run(tmp_path):
    made = Made(stop=4)
    one = Runner(tmp_path, resolve=lambda name: made)
    one.key = lambda trial: f"{trial.dt}"
    with pytest.raises(KeyboardInterrupt):
        one.solve_many(trials(steps=(0.1, 0.05, 0.02)))
    made.stop = None
    rest = Runner(tmp_path, resolve=lambda name: made)
    rest.key = one.key
    rest.solve_many(trials(steps=(0.1, 0.05, 0.02)))
    assert rest.computed == 1


def test_the_key_has_the_sources_and_the_versions(monkeypatch):
    one = runner(None)
    key = one.key(trials()[0])
    monkeypatch.setattr(provenance, "sources", lambda *packages: "edited")
    assert one.key(trials()[0]) != key
    monkeypatch.undo()
    monkeypatch.setattr(provenance, "software", lambda: "another numpy")
    assert one.key(trials()[0]) != key


def test_workers_give_the_same_bits(tmp_path):
    beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.01), at.Material(E=1e8, density=1000.0))
    scene = at.Scene("fall", [beam], [at.Clamp("b.start")], loads=[at.Force("b.end", lambda t: (0.0, -t))])
    wanted = [Trial(scene, "anctmm", mesh, dt=1e-2, t_end=0.1, output_dt=0.02) for mesh in ((1,), (2,))]
    alone, spread = Runner().solve_many(wanted), Runner(tmp_path, workers=2).solve_many(wanted)
    for one, other in zip(alone, spread, strict=True):
        assert np.array_equal(one.position("b.end"), other.position("b.end"))


def test_workers_beside_a_cluster_and_a_cluster_that_is_not_there():
    with pytest.raises(StudyError, match="one of them is allowed"):
        Runner(workers=2, cluster="tcp://host:8786")
    with pytest.raises(StudyError, match="cannot be reached"):
        Runner(cluster="nowhere").solve_many(trials(solver="anctmm"))


@pytest.mark.slow
def test_a_cluster_gives_the_same_answer(tmp_path):
    distributed = pytest.importorskip("distributed")
    wanted = [Trial(MASS, "anctmm", (1,), dt=0.05, t_end=1.0, output_dt=0.1)]
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        found = Runner(cluster=cluster.scheduler_address).solve_many(wanted)
    assert np.array_equal(found[0].position("m.center"), Runner().solve(wanted[0]).position("m.center"))


def test_whatever_fails_is_a_solution_with_that_status():
    found = runner(None, lambda scene, run: 1 / 0).solve(trials()[0])
    assert str(found.status) == "failed: ZeroDivisionError: division by zero"


def test_a_wrong_mesh_and_an_unknown_solver_have_a_status():
    wrong = Trial(MASS, "anctmm", (2, 2), dt=0.1, t_end=1.0)
    assert Runner().solve(wrong).status.code == "refused"
    assert "solver 'me' is not registered" in str(Runner().solve(replace(wrong, solver="me")).status)


# --- times ----------------------------------------------------------------------------------------------------


def test_times_in_turn_have_steps_alone_and_alternate():
    made = Made()
    one = Runner(resolve=lambda name: made)
    found = one.time_in_turn(trials())
    assert [[cost.cpu_s for cost in samples] for samples in found] == [[made.others] * 5] * 2
    assert made.calls == [0.1, 0.1, 0.05, 0.05] * 5  # of a short run the second call in a row is timed


def test_times_are_stored_with_their_machine(tmp_path, monkeypatch):
    one = runner(tmp_path, quick=True)
    one.time_in_turn(trials())
    stub.count.clear()
    runner(tmp_path, quick=True).time_in_turn(trials())
    assert stub.count == []
    monkeypatch.setenv(provenance.NAMED, "another machine")
    runner(tmp_path, quick=True).time_in_turn(trials())
    assert stub.count != []


def test_of_runs_in_turn_the_least_counts():
    numbers = [(3.0, 9.0, 2.0), (1.0, 4.0, 5.0), (2.0, 5.0, 3.0)]
    found = least([at.Cost(cpu, wall, 10, build_s=build) for cpu, wall, build in numbers])
    assert found == {"cpu_s": 1.0, "build_s": 2.0, "repeats": 3, "cpu_spread": 2.0}


@pytest.mark.parametrize(("short", "calls"), [(60.0, 2), (0.0, 1)])
def test_of_a_short_call_the_second_in_a_row_is_taken(short, calls):
    seen = []
    assert settled(lambda: seen.append(None) or len(seen), short) == calls
