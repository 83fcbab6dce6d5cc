"""Settings shared by all tests: hypothesis tries the same examples each time, and no example has a time limit.

`--hypothesis-profile thorough` tries many new ones. There are three lengths: `pytest -m "not slow"`, `pytest`, and all
with `pytest -m ""`.
"""

import os
from contextlib import nullcontext

import pytest
from hypothesis import settings

from anctmm.jit.compiler.second_process import one_process
from anctmm.jit.direct import Checking
from anctmm.jit.interpreting import interpreted

settings.register_profile("steady", derandomize=True, deadline=None, max_examples=25)
settings.register_profile("thorough", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("steady")
Checking.on = True

#: Modules that a usual run leaves out as a whole: they compile kernels of several solvers, for many kinds of scenes,
#: run studies or commands, or hundreds of random scenes.
EXHAUSTIVE = {
    "checks": ["bench", "check", "check_of_cases", "conform", "energy_check", "small_scenes"],
    "discretise": ["interior_joints"],
    "integrators": ["connected", "damping", "divergence", "graph_histories", "graph_motion", "graph_properties",
                    "interrupted", "memory", "motion", "properties", "rates"],
    "model": ["typing"],
    "modes": ["modes", "modes_of_mechanisms"],
    "of_reference": ["global_dae", "junctions", "motor_law", "slider_crank"],
    "peers": ["exudyn", "exudyn_mechanisms", "peer_opensees", "peer_pyelastica"],
    "recursion": ["free_stretch", "graphs", "lines", "random_graphs", "rigid"],
    "statics": ["arc_length", "equilibrium_stability", "nonconservative_statics", "stabilised_statics"],
    "adaptive": ["alpha_cost", "damped_tolerance", "events", "promise", "stage_cost"],
}  # fmt: skip

#: Modules that `-m "not slow"` leaves out, too: what is left is for a look after each change.
SLOW = {
    "checks": ["precision_check"],
    "compiler": ["kernel_files", "second_process", "separate"],
    "discretise": ["kept_chains", "structure"],
    "elements": ["kinds", "quintic", "vector_instructions"],
    "commands": ["commands", "plugins"],
    "engine": ["processes", "refinement"],
    "files": ["one_compiler"],
    "forces": ["acting", "histories", "laws"],
    "golden": ["golden"],
    "implicit": ["esdirk", "implicit", "implicit_run", "stage_constraints"],
    "jit": ["announcing"],
    "modes": ["growth", "modes_of_motions"],
    "of_reference": ["agreement", "dae", "exact_mechanisms", "quintic_against_dae", "random_scenes"],
    "questions": ["gallery", "question_new_solver", "questions", "trade"],
    "recursion": ["driven_hinges", "kept_motions", "work_of_drives"],
    "results": ["export", "fields", "internal_forces", "pictures", "whole_turns"],
    "spine": ["agreement", "control", "own_joints", "small_motions"],
    "statics": ["static_start", "statics"],
    "adaptive": ["adaptive", "driven_mechanisms", "first_step", "free_turns", "held_structures", "impacts",
                 "stage_control", "stage_outputs", "step_choice"],
}  # fmt: skip

#: Modules whose kernels Python runs: a few steps of a few elements each, but of so many kinds of scenes that compiling
#: took most of their time. Their tests marked `compiled` are left out, and of other modules those marked `interpreted`
#: are run so, too; `jit/test_interpreting.py` holds that both give the same.
INTERPRETED = {
    "checks": ["constraint_check", "drive_check"],
    "discretise": ["as_written", "rigid_loops", "structure"],
    "forces": ["acting"],
    "implicit": ["balanced", "esdirk", "implicit_run", "stage_constraints"],
    "model": ["inputs", "mechanisms", "scene"],
    "modes": ["growth"],
    "recursion": ["constrained", "coupled", "kept_motions", "kept_places", "low_rank", "tip_mass", "work_of_drives"],
    "results": ["pictures", "whole_turns"],
    "statics": ["damped_flutter", "held", "load_work", "static_start"],
    "adaptive": ["driven_mechanisms", "free_turns", "held_structures", "stage_control", "stage_outputs", "step_choice"],
}  # fmt: skip


#: Modules that take longest, the longest first: no process is to begin with one when the others are done.
LONGEST = (
    "small_motions", "own_joints", "control", "wound_springs", "implicit", "esdirk", "stage_constraints",
    "stage_control", "second_process", "agreement", "exact_mechanisms", "adaptive", "growth", "returning",
    "dae", "transfer", "free_turns", "kept_motions", "explicit", "laws", "inputs", "pictures",
    "histories", "gallery", "whole_turns", "balanced", "exact", "contracts",
)  # fmt: skip


def listed(path, table):
    """Whether a table of modules by folder names a file."""
    return path.stem.removeprefix("test_") in table.get(path.parent.name, ())


def pytest_ignore_collect(collection_path, config):
    """Do not read, for `-m "not slow"`, modules of which it leaves out all: they took half of the time of reading.

    A plain run reads all, so that it sees what cannot be imported.
    """
    left_out = config.option.markexpr == "not slow" and (
        listed(collection_path, SLOW) or listed(collection_path, EXHAUSTIVE)
    )
    return left_out or None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Run kernels by Python where that takes less time, and compile in one process where another one runs tests."""
    by_python = "compiled" if listed(item.path, INTERPRETED) else "interpreted"
    marked = item.get_closest_marker(by_python) is not None
    beside = hasattr(item.config, "workerinput") and item.path.stem != "test_second_process"
    with (
        interpreted() if marked == (by_python == "interpreted") else nullcontext(),
        one_process() if beside else nullcontext(),
    ):
        return (yield)


def pytest_configure(config):
    """Several processes take the modules in the order of the tests, not those with most tests first.

    Each calls BLAS with one thread, unless told otherwise: threads that wait for a processor that another process has
    take up to 700 times the time of small matrices.
    """
    config.option.loadscopereorder = False
    if getattr(config.option, "numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@pytest.hookimpl(tryfirst=True)  # before marks choose
def pytest_collection_modifyitems(items):
    """Put the longest modules first. Mark the tests of long modules; what is exhaustive is slow, too."""
    place = {f"test_{name}": k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))
    for item in items:
        if listed(item.path, EXHAUSTIVE):
            item.add_marker(pytest.mark.exhaustive)
        if item.get_closest_marker("exhaustive") or listed(item.path, SLOW):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="module")
def browser():
    """A running Chromium, for tests marked `needs_chromium`."""
    from browser import Browser  # few modules need it

    started = Browser()
    yield started
    started.close()
