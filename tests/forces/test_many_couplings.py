"""Many springs between bodies: solutions by another sweep instead of kept columns, and by kept places."""

import numpy as np
import pytest

import anctmm as at
from anctmm.discretise import kept_chains
from anctmm.discretise.junctions import couplings
from anctmm.forces import stiffness

pytestmark = pytest.mark.interpreted
ROD, RUBBER = at.Rectangle(0.02, 0.02), at.Material(E=5e6, density=1100.0)


def swing():
    """A driven beam, a plate on two cranks, a guided mass, a follower force; springs that damp and turn couple them."""
    beam = at.Beam("beam", (0.0, 0.0), (0.6, 0.0), ROD, RUBBER)
    plate = at.RigidBody("plate", 0.4, 2e-3, (0.3, 0.4), points={"a": (0.2, 0.4), "b": (0.4, 0.4)})
    cranks = [
        at.RigidBody(f"crank{k}", 0.05, 2e-4, (x, 0.5), points={"top": (x, 0.6), "low": (x, 0.4)})
        for k, x in enumerate((0.2, 0.4))
    ]
    bob = at.PointMass("bob", 0.2, (0.8, 0.2))
    joints = [
        at.Clamp("beam.start", angle=at.Quintic(0.2, 0.05)),
        *(at.Pin(f"crank{k}.top") for k in (0, 1)),
        *(at.Pin(f"crank{k}.low", f"plate.{p}") for k, p in enumerate("ab")),
        at.Slider("bob.center", direction=(0.2, 1.0)),
    ]
    springs = [
        at.Spring(("beam", 0.5), "plate.a", stiffness=200.0, damping=0.5),
        at.Spring("beam.end", "plate.b", stiffness=150.0),
        at.Spring("beam.end", "bob.center", stiffness=300.0, length=0.2),
        at.RotationalSpring("plate.center", "beam.end", stiffness=0.5, damping=0.01),
    ]
    pull = at.Force("beam.end", (0.0, 1.0), follower=True)
    return at.Scene("swing", [beam, plate, *cranks, bob], joints, [pull], (0.0, -9.81), springs)


def answers(run):
    """The same by kept columns, by sweeps, and by kept places."""
    found = []
    for columns, rows in ((100, 100), (0, 100), (100, 0)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(stiffness, "FEW", columns)
            patch.setattr(couplings, "FEW", rows)
            patch.setattr(couplings, "DIVIDED", rows)
            kept_chains.forget()
            found.append(run())
    return found


@pytest.mark.parametrize(
    "options",
    [
        {"dt": 2e-3},
        {"dt": 2e-3, "integrator": "esdirk"},
        # what the iteration leaves depends on rounding
        {"tolerance": 1e-3, "integrator": "generalized-alpha", "newton_tolerance": 1e-11},
        {"tolerance": 1e-3, "integrator": "esdirk", "newton_tolerance": 1e-11},
    ],
    ids=str,
)
def test_motions_are_the_same(options):
    one, *others = answers(lambda: at.solve(swing(), mesh=2, t_end=0.03, output_dt=0.01, **options))
    assert one.status.ok
    for other in others:
        assert other.status.ok
        assert one.cost.steps == other.cost.steps
        assert one.cost.newton_iterations == pytest.approx(other.cost.newton_iterations, rel=0.01)
        for place in ("beam.end", "plate.b", "bob.center"):
            path = one.position(place)
            assert np.abs(path - other.position(place)).max() < 1e-9
            assert np.abs(path - path[0]).max() > 1e-3


def test_equilibria_reactions_and_modes_are_the_same():
    one, *others = answers(lambda: at.solve_static(swing(), mesh=2))
    joint = one.scene.joints[-1]
    for other in others:
        assert one.status == other.status
        assert np.abs(one.position("bob.center") - other.position("bob.center")).max() < 1e-9
        apart = np.abs(one.reaction(joint) - other.reaction(joint))
        assert apart.max() < 1e-6 * np.abs(one.reaction(joint)).max()
    one, *others = answers(lambda: at.modes(swing(), mesh=2, count=6))
    for other in others:
        assert np.abs(one.frequencies / other.frequencies - 1.0).max() < 1e-8
