"""Code of others leaves nothing behind in the process, whichever threads run it at the same time."""

import os
import signal
import sys
from dataclasses import replace
from threading import Event, Thread
from types import SimpleNamespace

import pytest

import anctmm as at
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


def in_compiled_code(*_):
    """What is left of Ctrl-C where a function in C returns although it has raised."""
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as error:
        raise SystemError("<built-in method SolveSystem> returned a result with an exception set") from error


def after_it(*_):
    """An error of one's own while an interruption is looked at."""
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt:
        raise ValueError("no file")  # noqa: B904


def test_ctrl_c_in_compiled_code_is_ctrl_c():
    with pytest.raises(KeyboardInterrupt), contained():
        in_compiled_code()
    with pytest.raises(ValueError, match="no file"), contained():
        after_it()
    with pytest.raises(SystemError, match="of its own"), contained():
        raise SystemError("of its own")


def test_ctrl_c_in_exudyn_is_ctrl_c(monkeypatch):
    """As its solver ends then in a function of C; and where it calls a law of the user."""
    exu = pytest.importorskip("exudyn")
    from reference import exudyn_cable
    from reference.exudyn.cable import Cables
    from reference.exudyn.run import ExudynAdapter

    beam = at.Beam("beam", (0, 0), (1, 0), at.Rectangle(0.02, 0.02), at.Material(E=1e7, density=1000.0))
    clamped = at.Scene("clamped", [beam], [at.Clamp("beam.start")])
    adapter = Cables(clamped, at.Discretisation(mesh=2))
    with pytest.raises(KeyboardInterrupt):
        adapter._solved(SimpleNamespace(exu=exu), in_compiled_code, None)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    solving, solved = [], ExudynAdapter._solved

    def marked(*arguments):
        solving.append(True)
        return solved(*arguments)

    def law(elongation, rate, t):
        if solving:
            os.kill(os.getpid(), signal.SIGINT)
        return 0.1 * elongation

    monkeypatch.setattr(ExudynAdapter, "_solved", marked)
    scene = replace(clamped, connectors=[at.Spring("beam.end", (1.0, 1.0), law=law)])
    try:
        with pytest.raises(KeyboardInterrupt):
            exudyn_cable.solve(scene, at.Discretisation(mesh=2, dt=1e-3, t_end=1.0))
    finally:
        signal.signal(signal.SIGINT, handler)
