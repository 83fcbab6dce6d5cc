"""Settings shared by all tests: hypothesis tries the same examples each time, and no example has a time limit.

`--hypothesis-profile thorough` tries many new ones. `-m "not slow"` leaves out what takes more than some seconds.
"""

from contextlib import nullcontext

import pytest
from hypothesis import settings

from anctmm.jit.interpreting import interpreted

settings.register_profile("steady", derandomize=True, deadline=None, max_examples=25)
settings.register_profile("thorough", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("steady")

#: Modules that are slow as a whole: they compile kernels of several solvers, for many kinds of scenes, run studies or
#: commands, or hundreds of random scenes.
SLOW = {
    "discretise": ["interior_joints"],
    "integrators": ["arc_length", "connected", "damped_tolerance", "damping", "divergence", "equilibrium_stability",
                    "events", "graph_histories", "graph_motion", "graph_properties", "interrupted", "memory", "modes",
                    "modes_of_mechanisms", "motion", "nonconservative_statics", "promise", "properties", "rates",
                    "stabilised_statics"],
    "model": ["typing"],
    "of_reference": ["exudyn", "exudyn_mechanisms", "motor_law", "slider_crank", "foreign_kinds", "global_dae",
                     "junctions", "peer_opensees",
                     "peer_pyelastica", "times"],
    "of_studies": ["bench", "check", "check_of_cases", "cluster", "command_lines", "conform", "convergence",
                   "every_study", "extremes", "extremes_of_cases", "failures", "fidelity", "fidelity_of_cases",
                   "high_order", "interruption", "page", "plugins", "progress", "recommend_anywhere", "refinement",
                   "report_of_cases", "single_run", "small_scenes", "studies", "sweeps", "trade", "trade_of_cases",
                   "width"],
    "recursion": ["free_stretch", "graphs", "lines", "random_graphs", "rigid"],
    "results": ["energy_check"],
}  # fmt: skip


#: Modules whose kernels Python runs: a few steps of a few elements each, but of so many kinds of scenes that compiling
#: took most of their time. Their tests marked `compiled` are left out; `jit/test_interpreting.py` holds that both give
#: the same.
INTERPRETED = {
    "discretise": ["kept_chains", "rigid_loops", "structure"],
    "forces": ["acting"],
    "integrators": ["esdirk", "modes_of_motions", "stage_control", "static_start", "step_choice"],
    "model": ["inputs", "mechanisms", "scene"],
    "of_reference": ["acting_against_dae"],
    "recursion": ["constrained", "low_rank"],
    "results": ["constraint_check", "internal_forces", "pictures"],
}  # fmt: skip


def listed(item, table):
    """Whether a table of modules by folder names a test's."""
    return item.path.stem.removeprefix("test_") in table.get(item.path.parent.name, ())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Run kernels by Python where that takes less time."""
    with (
        interpreted()
        if listed(item, INTERPRETED) and not item.get_closest_marker("compiled")
        else nullcontext()
    ):
        return (yield)


def pytest_collection_modifyitems(items):
    """Mark the tests of slow modules."""
    for item in items:
        if listed(item, SLOW):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="module")
def browser():
    """A running Chromium, for tests marked `needs_chromium`."""
    from browser import Browser  # few modules need it

    started = Browser()
    yield started
    started.close()
