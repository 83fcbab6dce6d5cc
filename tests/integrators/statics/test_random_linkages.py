"""Random linkages: an equilibrium is found wherever there is one, and it is one by independent equations."""

import numpy as np
import pytest
from random_linkages import Equations, random_linkage
from scipy.optimize import minimize

import anctmm as at

#: Of these no equilibrium was found: steps of the search left the joints open (constraints that repeat each other, or
#: springs that are strained at the start), or were the rounding of a free motion.
LOST = (205, 253, 299)
FLOATING = (258, 338)


@pytest.mark.parametrize("seed", [*range(40), *LOST, *FLOATING])
def test_an_equilibrium_is_found_wherever_there_is_one(seed):
    scene = random_linkage(seed)
    if scene is None:
        pytest.skip("no scene")
    found = at.solve_static(scene)
    if found.status.code == "diverged":
        assert "without end" in found.status.message
        assert falls_for_ever(scene)
    else:
        equations = Equations(scene)
        unbalanced, gap = equations.unbalanced(equations.of(found))
        assert unbalanced < 1e-4
        assert gap < 1e-9


def falls_for_ever(scene):
    """Whether a translation of all bodies keeps the joints, and works: all that a guide holds moves along its line."""
    equations = Equations(scene)
    for joint in scene.joints:
        if isinstance(joint, at.Slider):
            moved = equations.start.copy()
            moved[0::3] += 10.0 * joint.direction[0]
            moved[1::3] += 10.0 * joint.direction[1]
            falls = equations.energy(moved) - equations.energy(equations.start)
            return np.abs(equations.gaps(moved)).max() < 1e-12 and abs(falls) > 1e-6
    return False


@pytest.mark.parametrize("seed", [253, 258, 338])
def test_the_stable_equilibrium_is_a_minimum_of_the_energy(seed):
    """By sequential quadratic programming from the same start: 258 and 338 slide on a line that nothing pulls along."""
    scene = random_linkage(seed)
    equations = Equations(scene)
    rest = at.solve_static(scene, branch="stable")
    assert rest.status.code == ("ok" if seed == 253 else "singular")
    least = minimize(
        equations.energy, equations.of(rest), method="SLSQP",
        constraints=[{"type": "eq", "fun": equations.gaps}], options={"maxiter": 1000, "ftol": 1e-13},
    )  # fmt: skip
    assert equations.energy(equations.of(rest)) == pytest.approx(least.fun, abs=1e-6)
