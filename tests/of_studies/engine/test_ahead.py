"""Kernels compiled in two processes before a sweep is timed: every kind of run once, and the same answers."""

import os
import threading
import time
from dataclasses import replace
from functools import partial

import pytest
from numpy.linalg import LinAlgError
from shared_sweep import cases, lines, numbers, runner

from studies.engine.running import ahead
from studies.engine.running.ahead import from_both_ends, helper, kinds, worthwhile
from studies.engine.running.pool import WorkerPool
from studies.scenes import four_bar

KINDS = ("cable", "quintic", "shear")


def of_all_kinds(count):
    """Cases of one scene with different elements: each kind needs kernels of its own."""
    return [replace(case, element=kind) for kind in KINDS for case in cases(count)]


def test_each_is_done_once_from_both_ends():
    first, second, met = [], [], threading.Barrier(2, timeout=60.0)

    def here(n):
        if not first:
            met.wait()
        first.append(n)

    def there(n):
        if not second:
            met.wait()
        second.append(n)

    from_both_ends(list(range(50)), here, there)
    assert first[0] == 0
    assert second[0] == 49
    assert first == sorted(first)
    assert second == sorted(second, reverse=True)
    assert sorted(first + second) == list(range(50))


def test_what_fails_stops_nobody():
    tried = []

    def fails(n):
        tried.append(n)
        raise ValueError(n)

    from_both_ends(range(20), fails, fails)
    assert sorted(tried) == list(range(20))


def test_whoever_interrupts_is_not_kept_waiting():
    """The other thread takes nothing more."""
    begun, go_on = threading.Event(), threading.Event()
    taken = []

    def here(n):
        begun.wait(60.0)
        raise KeyboardInterrupt

    def there(n):
        taken.append(n)
        begun.set()
        go_on.wait(60.0)

    with pytest.raises(KeyboardInterrupt):
        from_both_ends(range(20), here, there)
    go_on.set()
    assert taken == [19]


def test_of_each_kind_the_run_with_least_work_is_taken():
    every = of_all_kinds(5)
    assert kinds(reversed(every)) == [every[10], every[5], every[0]]
    controlled = replace(every[1], dt=float("nan"), options=(("tolerance", 1e-3),))
    assert kinds([every[0], controlled, every[2]]) == [every[0], controlled]
    renamed = replace(every[1], scene=replace(every[1].scene, name="another"))
    assert kinds([renamed, every[0]]) == [every[0]]
    assert len(kinds([replace(renamed, scene=four_bar().scene, mesh=(2,)), every[0]])) == 2


def test_a_sweep_with_a_helper_warms_up_every_kind_before_it_times_any(tmp_path):
    for name in ("alone", "both"):  # where the solver writes its log
        (tmp_path / name).mkdir()
    alone = runner(tmp_path / "alone").sweep(of_all_kinds(2))
    pool = WorkerPool(1)
    try:
        mine = runner(tmp_path / "both", beside=pool)
        both = mine.sweep(of_all_kinds(2))
        known = lines(tmp_path / "both" / "log")
        mine.sweep(of_all_kinds(2))
    finally:
        pool.shutdown()
    assert numbers(both) == numbers(alone)
    assert lines(tmp_path / "both" / "log") == known  # what is known is not warmed up again
    first = next(k for k, (what, *_) in enumerate(known) if what == "begun")
    by = {process for _, _, process in known[:first]}
    assert len(by) == 2
    assert {process for _, _, process in known[first:]} == {str(os.getpid())}
    assert len(known[:first]) >= len(KINDS)


def test_what_is_prepared_is_not_prepared_again(tmp_path):
    pool = WorkerPool(1)
    try:
        mine = runner(tmp_path, beside=pool)
        mine.prepare(of_all_kinds(2))
        known = lines(tmp_path / "log")
        assert len(known) == len(KINDS)
        mine.prepare(of_all_kinds(3))
    finally:
        pool.shutdown()
    assert lines(tmp_path / "log") == known


def by_whom(n, folder, meet=False):
    """A number with the process that computes it; it waits until another process has begun one, if they shall meet."""
    (folder / f"{n} {os.getpid()}").touch()
    while meet and len({one.name.split()[1] for one in folder.iterdir()}) < 2:
        time.sleep(0.01)
    if n == 3:
        raise LinAlgError("no third")
    return n, os.getpid()


@pytest.mark.parametrize("kept", ["", "code"])
def test_jobs_are_done_from_both_ends_and_each_once(kept, tmp_path):
    seen = tmp_path / "seen"
    seen.mkdir()
    jobs = [(f"job {n}", partial(by_whom, n, seen, meet=n in (0, 7)), str) for n in range(8)]
    pool = WorkerPool(1)
    try:
        mine = runner(tmp_path, beside=pool)
        found = mine.jobs(jobs, kept)
        again = mine.jobs(jobs, kept)
    finally:
        pool.shutdown()
    assert found[3] == "no third"
    numbers, by = zip(*(one for one in found if one != "no third"), strict=True)
    assert numbers == (0, 1, 2, 4, 5, 6, 7)
    assert by[0] == os.getpid() != by[-1]
    assert set(by) == {os.getpid(), by[-1]}
    assert [one[0] for one in again] == [one[0] for one in found]


def test_one_kind_alone_needs_no_helper(tmp_path):
    pool = WorkerPool(1)
    try:
        runner(tmp_path, beside=pool).sweep(cases(3))
        assert pool.processes == ()
    finally:
        pool.shutdown()


def test_a_helper_is_worth_while_where_no_kernel_is_kept_and_a_processor_is_free(tmp_path, monkeypatch):
    monkeypatch.setattr(ahead, "directory", lambda: tmp_path)
    monkeypatch.setattr(ahead, "processors", lambda: 2)
    assert worthwhile()
    with helper(True) as pool:
        assert isinstance(pool, WorkerPool)
    with helper(False) as none:
        assert none is None
    monkeypatch.setattr(ahead, "processors", lambda: 1)
    assert not worthwhile()
    monkeypatch.setattr(ahead, "processors", lambda: 2)
    (tmp_path / "one.kernel").touch()
    assert not worthwhile()
    with helper(True) as none:
        assert none is None
    monkeypatch.setattr(ahead, "directory", lambda: None)
    assert not worthwhile()
