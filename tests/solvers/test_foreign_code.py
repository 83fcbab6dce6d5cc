"""Code of others cannot end the program, and Ctrl-C in it is Ctrl-C."""

import os
import signal
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest

import anctmm as at
from anctmm.solvers.foreign_code import ProcessExit, contained


def test_an_attempt_to_end_the_program_is_an_exception():
    with pytest.raises(ProcessExit, match=r"sys\.exit\(3\)"), contained():
        sys.exit(3)


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
