"""Automatic meshes put nodes where joints act; explicit limits are those of the solver."""

import pytest

import anctmm as at
from studies.engine.meshes import coarsest_mesh, halfway, longest_step, parts_of, stable_step
from studies.engine.refinement import Refinement, Setup
from studies.engine.runner import Runner

ROD, STEEL = at.Rectangle(0.02, 0.01), at.Material(E=1e9, density=1500.0)


def mast(fraction):
    boom = at.Beam("boom", (0, 0), (1, 0), ROD, STEEL)
    strut = at.Beam("strut", (fraction, 0.0), (fraction, -0.4), ROD, STEEL)
    joints = [at.Clamp("boom.start"), at.Pin(("boom", fraction), "strut.start")]
    return at.Case(at.Scene("mast", [boom, strut], joints, gravity=(0, -9.81)), ["boom.end"], t_end=0.1)


@pytest.mark.parametrize(
    ("fraction", "parts"), [(0.2, 5), (0.5, 2), (1 / 3, 3), (0.35, 20), (0.123456789, 1)]
)
def test_a_mesh_has_a_node_at_each_joint(fraction, parts):
    case = mast(fraction)
    assert parts_of(case.scene, case.scene.beams[0]) == parts
    assert coarsest_mesh(case, "cable")[0] % parts == 0


def test_meshes_halfway_keep_the_nodes():
    assert halfway(mast(0.2), (10, 2)) == (15, 3)
    assert halfway(mast(0.2), (5, 1)) is None


def test_a_pin_at_a_fifth_is_refined():
    found = Refinement(mast(0.2), Setup(), Runner()).refined(1e-2)
    assert found.reached
    assert found.trial.mesh[0] % 5 == 0


def test_steps_divide_the_interval_of_output():
    case = mast(0.5)
    assert longest_step(case) == pytest.approx(case.interval)
    assert case.interval / longest_step(case, 3e-4) == pytest.approx(5.0)


def test_the_stable_step_is_that_of_a_known_oscillator():
    mass = at.PointMass("m", 2.0, (1.0, 0.0))
    spring = at.Spring("m.center", (0.0, 0.0), stiffness=800.0)
    scene = at.Scene("oscillator", [mass], [at.Slider("m.center", direction=(1, 0))], connectors=[spring])
    assert stable_step(scene, 1, 1.0) == pytest.approx(2.0 / 20.0, rel=0.02)
    assert stable_step(scene, 1, 0.01) == float("inf")
