"""When fixed steps renew the matrix of Newton's iteration: what solutions cost beside the best that could be done."""

import numpy as np
import pytest

import anctmm as at
from anctmm.integrators.implicit.renewal import AGE, RARELY, new_wear, worn
from anctmm.jit.compiling import uncompiled
from reference import global_dae
from studies import scenes

SOLUTIONS = 2000


def simulated(price, corrections, renews, solutions=SOLUTIONS):
    """Cost of solutions, and matrices renewed before one, where `renews` tells whether to renew before the next one.

    corrections: of solution number, and age of the matrix; and whether it is renewed on the way.
    """
    new, total, renewals, age = True, 0.0, 0, 0
    for k in range(solutions):
        age = 0 if new else age + 1
        count, within = corrections(k, age)
        total += count + price * (new + within)
        renewals += int(new)
        new = renews(age, new, count, int(new) + within)
        age = 0 if within else age
    return total, renewals


def spent(price, corrections, solutions=SOLUTIONS):
    """The same by the rule."""
    wear = new_wear(price)

    def renews(_, new, count, renewals):
        return bool(uncompiled(worn)(new, count, renewals, wear))

    return simulated(price, corrections, renews, solutions)


def best(price, corrections):
    """Cost with the best number of solutions between two renewals."""
    lengths = (*range(1, 60), SOLUTIONS)
    return min(simulated(price, corrections, lambda age, *_, n=n: age + 1 >= n)[0] for n in lengths)


def growing(slope):
    """A matrix that gets older: corrections grow in proportion to its age."""
    return lambda _, age: (1 + int(slope * age), 0)


def coarse(_, age):
    """Large steps: all but a new matrix is renewed on the way."""
    return (2, 0) if age == 0 else (4, 1)


def sudden(last):
    """A matrix that does for so many solutions, and then suddenly is no good."""
    return lambda _, age: (2, 0) if age <= last else (8, 1)


@pytest.mark.parametrize("price", [3.2, 7.2])
@pytest.mark.parametrize(
    ("corrections", "over"),
    [
        (growing(0.0), 1.01),
        (growing(0.01), 1.15),
        (growing(0.1), 1.15),
        (growing(0.5), 1.15),
        (growing(2.0), 1.2),
        (coarse, 1.05),
        (sudden(3), 1.05),
        (sudden(20), 1.1),
    ],
)
def test_the_cost_is_nearly_that_of_the_best_number_of_solutions_with_a_matrix(price, corrections, over):
    total, _ = spent(price, corrections)
    assert total <= over * best(price, corrections)


def test_single_dear_solutions_renew_no_matrix_that_is_good():
    rng = np.random.default_rng(1)
    noise = rng.random(SOLUTIONS) < 0.1
    total, renewals = spent(3.2, lambda k, age: (2 if noise[k] and age else 1, 0))
    assert renewals < 100
    assert total < 1.3 * SOLUTIONS


def test_a_motion_that_becomes_calm_is_noticed():
    def corrections(k, age):
        return coarse(k, age) if k < 500 else (1, 0)

    stormy, _ = spent(3.2, coarse, 500)
    total, _ = spent(3.2, corrections)
    assert total - stormy < SOLUTIONS - 500 + 4.2 * RARELY


def test_a_solution_with_a_new_matrix_that_wanders_is_followed_by_another_new_one():
    wear = new_wear(3.2)
    assert uncompiled(worn)(True, 9, 3, wear)
    assert not uncompiled(worn)(True, 2, 1, wear)
    assert wear[AGE] == 0.0


@pytest.mark.parametrize(
    ("options", "before", "now"),
    [
        ({"mesh": 8, "dt": 5e-3, "newton_tolerance": 1e-3}, (814, 215), (480, 200)),
        ({"mesh": 8, "dt": 2.5e-4, "newton_tolerance": 1e-3}, (6675, 61), (4300, 120)),
        ({"mesh": 8, "dt": 1e-3, "newton_tolerance": 1e-3, "integrator": "esdirk"}, (9700, 128), (5600, 280)),
    ],
)
def test_a_falling_beam_takes_fewer_corrections(options, before, now):
    """Before: with a renewal only where corrections fell slowly, or after six of them."""
    case = scenes.cantilever_fall()
    found = at.solve(case.scene, t_end=case.duration, output_dt=case.interval, **options)
    assert found.status.ok
    counts = found.cost.newton_iterations, found.cost.factorizations
    assert counts[0] <= now[0] < before[0]
    assert counts[1] <= now[1]


def test_the_global_dae_renews_its_factors_by_the_same_rule():
    case = scenes.cantilever_fall()
    run = {
        "mesh": 8,
        "dt": 5e-3,
        "newton_tolerance": 1e-5,
        "t_end": case.duration,
        "output_dt": case.interval,
    }
    found = global_dae.solve(case.scene, **run)
    assert found.status.ok
    assert found.cost.newton_iterations <= 650  # 861 before, and 351 new factors
    assert found.cost.factorizations <= 200
