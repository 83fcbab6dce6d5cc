"""Code of others leaves nothing behind in the process, whichever threads run it at the same time."""

import os
import sys
from threading import Event, Thread

import pytest

from anctmm.solvers.foreign_code import ProcessExit, contained

LIMIT = 60.0


REAL = os._exit


def exit_is_refused():
    if os._exit is REAL:  # it would end the tests
        return False
    with pytest.raises(ProcessExit, match=r"os\._exit"):
        os._exit(7)
    return True


def state():
    return os._exit, sys.stdout, sys.stderr, os.getcwd()


@pytest.mark.parametrize("first_out", ["first in", "last in"])
def test_threads_at_once_leave_the_process_as_it_was(first_out, tmp_path):
    """Whoever ends first, the other's code is contained to its end, and nothing of both is left."""
    before, changed = state(), Event()
    may_end = {"first in": Event(), "last in": Event()}
    refused = {}

    def others(name):
        with contained():
            os.chdir(tmp_path)
            sys.stdout = sys.stderr = None
            changed.set()
            assert may_end[name].wait(LIMIT)
            refused[name] = exit_is_refused()

    threads = {}
    for name in may_end:
        threads[name] = Thread(target=others, args=(name,))
        threads[name].start()
        assert changed.wait(LIMIT)
        changed.clear()
    for name in sorted(may_end, key=lambda name: name != first_out):
        may_end[name].set()
        threads[name].join(LIMIT)
    assert refused == dict.fromkeys(may_end, True)
    assert state() == before


def test_contexts_in_each_other_bring_back_what_each_has_found(tmp_path):
    before = state()
    with contained():
        os.chdir(tmp_path)
        with contained():
            os.chdir("/")
        assert os.getcwd() == str(tmp_path)
        assert exit_is_refused()
    assert state() == before


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_a_process_that_code_of_others_starts_ends_as_it_likes():
    with contained():
        child = os.fork()
        if child == 0:
            os._exit(7)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
