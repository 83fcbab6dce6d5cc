"""What steps of second order with a tolerance cost beside the best fixed ones of the same error; what it promises.

The constants of the step control were chosen by the first seven cases and those with constraints.
"""

import pytest
from control_costs import CHOSEN_BY, CONSTRAINED, OTHERS, costs

import anctmm as at

#: Fixed steps tried, as parts of the interval of output, and bounds of Newton's iteration.
PARTS = (1, 2, 3, 4, 5, 6, 8, 11, 16, 23, 32, 45, 64, 90, 128, 181, 256)
BOUNDS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8)
#: Cost allowed over that of the best fixed step of the same error, the best of 102, and of cases that cost more; why,
#: stands in `anctmm.integrators.adaptive.step_control`. The aim is 1.3.
DEARER = 1.6
MORE = {
    "portal_frame": 2.2,
    "gantry_crane": 2.2,  # 1.75 with forces of damping that count as those of elasticity
    "squeezer": 2.35,
}


@pytest.fixture(scope="module", params=CHOSEN_BY | OTHERS | CONSTRAINED)
def measured(request):
    finest = ("generalized-alpha", 2048) if request.param in CONSTRAINED else ("esdirk", 64)
    return costs(request.param, "generalized-alpha", PARTS, BOUNDS, finest)


def test_the_error_is_at_most_three_times_the_one_asked_for(measured):
    assert measured.promised <= 3.0, measured.runs


def test_the_work_is_that_of_the_best_fixed_step_of_the_same_error(measured):
    assert max(measured.ratios) <= MORE.get(measured.name, DEARER), measured.ratios


@pytest.mark.parametrize(
    ("name", "part", "falls"),
    [
        ("portal_frame", 4, (3.8, 4.2)),
        ("three_supports", 4, (3.8, 4.2)),
        ("squeezer", 3, (3.8, 4.2)),
        ("gantry_crane", 3, (1.2, 2.0)),  # steps of 1e-3: parts of their error cancel
    ],
)
def test_where_a_tolerance_costs_more_fixed_steps_are_no_lucky_ones_but_of_the_crane(name, part, falls):
    """How far the error falls with half the step: by four where it is that of the order."""
    make, mesh, element = (CHOSEN_BY | CONSTRAINED)[name]
    case = make()
    run = {"t_end": case.duration, "output_dt": case.interval, "newton_tolerance": 1e-8}
    run |= {"mesh": mesh, "element": element} if case.scene.beams else {}
    fine = at.solve(case.scene, dt=case.interval / 16, integrator="esdirk", **run)
    one, half = (
        at.compare(at.solve(case.scene, dt=case.interval / k, **run), fine, case.probes).error
        for k in (part, 2 * part)
    )
    assert falls[0] < one / half < falls[1]
