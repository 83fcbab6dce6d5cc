"""The new equations and steps beside the old ones: the same histories, for every joint, load, connector and element."""

from typing import Any

import numpy as np
import pytest

import anctmm as at
from anctmm.discretise.discretisation import Discretisation
from anctmm.integrators import fixed
from anctmm.system.system import System
from tests.spine.scenes import SCENES

#: Steps of each integrator, and the difference of positions over the length of the scene that is rounding.
STEPS: dict[str, tuple[dict[str, Any], float]] = {
    "zhai": ({"dt": 2e-5, "t_end": 0.02, "output_dt": 0.004}, 1e-11),
    "generalized-alpha": ({"dt": 2e-3, "t_end": 0.06, "output_dt": 0.012, "newton_tolerance": 1e-12}, 1e-9),
    "esdirk": ({"dt": 4e-3, "t_end": 0.06, "output_dt": 0.012, "newton_tolerance": 1e-12}, 1e-9),
}


def both(scene: at.Scene, run: Discretisation) -> tuple[at.Solution, at.Solution]:
    """The solution by the new steps, and that by the old ones."""
    return fixed.integrate(System(scene, run)), at.solve(scene, run)


def place(scene: at.Scene) -> str:
    """Where histories are compared."""
    return "b.center" if isinstance(scene.body("b"), at.PointMass) else "b.end"


@pytest.mark.parametrize("integrator", STEPS)
@pytest.mark.parametrize("name", SCENES)
def test_histories_agree(name: str, integrator: str) -> None:
    scene, (steps, rounding) = SCENES[name](), STEPS[integrator]
    mesh = 4 if scene.beams else None
    new, old = both(scene, Discretisation(mesh=mesh, integrator=integrator, **steps))
    assert new.status.ok, new.status
    assert len(new.t) == len(old.t)
    where = place(scene)
    assert np.abs(new.position(where) - old.position(where)).max() <= rounding * scene.length
    speed = np.abs(old.velocity(where)).max() + 1.0
    assert np.abs(new.velocity(where) - old.velocity(where)).max() <= 1e3 * rounding * speed
    for series in ("kinetic", "strain", "potential"):
        a, b = getattr(new.energy, series), getattr(old.energy, series)
        assert np.abs(a - b).max() <= 1e3 * rounding * (1.0 + np.abs(b).max())


@pytest.mark.parametrize("element", ["shear", "quintic"])
@pytest.mark.parametrize("integrator", STEPS)
def test_elements_agree(element: str, integrator: str) -> None:
    scene, (steps, rounding) = SCENES["pendulum"](), STEPS[integrator]
    steps = {**steps, "dt": 1e-5} if integrator == "zhai" else steps
    new, old = both(scene, Discretisation(mesh=2, element=element, integrator=integrator, **steps))
    assert np.abs(new.position("b.end") - old.position("b.end")).max() <= rounding * scene.length


def test_reactions_agree() -> None:
    scene = SCENES["fork"]()
    new, old = both(scene, Discretisation(mesh=4, integrator="zhai", **STEPS["zhai"][0]))
    for joint in scene.joints:
        a, b = new.reaction(joint), old.reaction(joint)
        assert np.abs(a - b).max() <= 1e-8 * np.abs(b).max()
