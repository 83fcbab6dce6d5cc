"""What every step calls of the forces is part of its caller: handing over all arrays took longer than one spring."""

import inspect
from importlib import import_module
from pkgutil import iter_modules

import numba
import pytest

import anctmm.forces
from anctmm.jit.deferred import Deferred

MODULES = [f"anctmm.forces.{module.name}" for module in iter_modules(anctmm.forces.__path__)]


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="there are no kernels without a compiler")
def test_no_step_hands_over_the_arrays_of_what_acts():
    kernels = {
        name: thing
        for module in MODULES
        for name, thing in vars(import_module(module)).items()
        if isinstance(thing, Deferred) and inspect.getmodule(thing.py_func).__name__ == module
    }
    assert {"set_loads", "work_done", "turn_clamps", "place_clamps", "add_connectors"} <= kernels.keys()
    for name, thing in kernels.items():
        options = thing.targetoptions
        assert options.get("forceinline") or options.get("inline") == "always", name
