"""Settings shared by all tests: hypothesis tries the same examples each time, and no example has a time limit.

`--hypothesis-profile thorough` tries many new ones. `pytest -m "not slow"` is a look after each change, `pytest` runs
all but hundreds of random scenes, and `pytest -m ""` those, too.
"""

import os
import sys
from pathlib import Path
from subprocess import Popen

import pytest
from hypothesis import settings

from studies.command_line.compiling import compile_kernels

settings.register_profile("steady", derandomize=True, deadline=None, max_examples=25)
settings.register_profile("thorough", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("steady")

HELPERS = Path(__file__).parent / "helpers"
#: Modules that `-m "not slow"` leaves out: long runs, many scenes, other codes, commands and studies.
SLOW = {
    "adaptive": ["events", "promises"],
    "checks": ["bench", "check", "check_of_cases", "conform"],
    "commands": ["commands", "plugins"],
    "engine": ["processes", "refinement"],
    "golden": ["golden"],
    "implicit": ["esdirk"],
    "integrators": ["memory", "motion", "properties"],
    "model": ["typing"],
    "modes": ["growth", "modes_of_motions"],
    "of_reference": ["agreement", "dae", "junctions", "motor_law",
                     "quintic_against_dae", "random_scenes", "slider_crank"],
    "peers": ["exudyn", "exudyn_mechanisms", "peer_opensees", "peer_pyelastica"],
    "questions": ["gallery", "question_new_solver", "questions", "trade"],
    "results": ["dissipated", "pictures"],
    "statics": ["arc_length", "equilibrium_stability", "turns_of_equilibria"],
}  # fmt: skip

#: Modules that take longest, the longest first: no process is to begin with one when the others are done.
LONGEST = ("refinement", "questions", "commands", "exact", "check", "dae")


def pytest_configure(config):
    """Several processes take the modules in the order of the tests, not those with most tests first.

    Each calls BLAS with one thread, unless told otherwise: threads that wait for a processor that another process has
    take up to 700 times the time of small matrices.
    """
    config.option.loadscopereorder = False
    if getattr(config.option, "numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@pytest.hookimpl(tryfirst=True)  # before the processes start
def pytest_sessionstart(session):
    """Compile kernels before a full run by several processes, which would each compile the same ones."""
    option = session.config.option
    if (
        getattr(option, "numprocesses", None)
        and option.markexpr == "not exhaustive"
        and not option.collectonly
    ):
        with Popen([sys.executable, "-m", "compiling"], cwd=HELPERS):
            compile_kernels()


@pytest.hookimpl(tryfirst=True)  # before marks choose
def pytest_collection_modifyitems(items):
    """Put the longest modules first, and mark the tests of slow modules. What is exhaustive is slow, too."""
    place = {f"test_{name}": k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))
    for item in items:
        listed = item.path.stem.removeprefix("test_") in SLOW.get(item.path.parent.name, ())
        if listed or item.get_closest_marker("exhaustive"):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="module")
def browser():
    """A running Chromium, for tests marked `needs_chromium`."""
    from browser import Browser  # few modules need it

    started = Browser()
    yield started
    started.close()
