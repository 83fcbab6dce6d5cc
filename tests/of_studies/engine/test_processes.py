"""Jobs in several processes: all results, of whatever cannot be pickled, and what happens when a process ends early."""

import os
import signal
import time

import pytest

from studies.engine.running.processes import JobError, Lost, processors, side_by_side


@pytest.mark.parametrize("workers", [1, 2, 3, 40])
def test_every_job_is_done_once(workers):
    jobs = [lambda k=k: (k, os.getpid()) for k in range(12)]
    found = dict(side_by_side(jobs, workers))
    assert {k: result for k, (result, _) in found.items()} == {k: k for k in range(12)}
    others = {pid for _, pid in found.values()}
    assert len(others) <= min(workers, 12)
    assert (os.getpid() in others) == (workers == 1)


def test_jobs_run_at_the_same_time(tmp_path):
    """Each of two waits for the other."""

    def job(mine, other):
        (tmp_path / mine).touch()
        while not (tmp_path / other).exists():
            time.sleep(0.01)
        return mine

    assert sorted(r for _, r in side_by_side([lambda: job("a", "b"), lambda: job("b", "a")], 2)) == ["a", "b"]


def test_a_job_whose_process_ends_is_told_and_the_others_are_done():
    def killed():
        os.kill(os.getpid(), signal.SIGKILL)

    jobs = [killed, lambda: 1, lambda: os._exit(7), lambda: 2, lambda: 3]
    found = dict(side_by_side(jobs, 2))
    assert found == {0: Lost(-signal.SIGKILL), 1: 1, 2: Lost(7), 3: 2, 4: 3}
    assert "signal 9" in str(found[0])
    assert "exit code 7" in str(found[2])


@pytest.mark.parametrize("workers", [1, 2])
def test_an_exception_of_a_job_is_raised(workers):
    def broken():
        raise ValueError("a fault")

    with pytest.raises((ValueError, JobError), match="a fault"):
        list(side_by_side([broken, lambda: 1], workers))


def test_processes_end_with_the_iteration(tmp_path):
    def job(k):
        (tmp_path / str(k)).write_text(str(os.getpid()))
        time.sleep(60.0 if k else 0.0)

    results = side_by_side([lambda: job(0), lambda: job(1)], 2)
    assert next(results)[0] == 0
    while not (tmp_path / "1").exists() or not (tmp_path / "1").read_text():
        time.sleep(0.01)
    results.close()
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "1").read_text()), 0)


def test_there_is_a_processor():
    assert 1 <= processors() <= (os.cpu_count() or 1)
