"""Meshes and steps that the program chooses: estimates of errors hold against far finer runs."""

from functools import cache
from math import isinf, isnan

import numpy as np
import pytest
from user_cases import ARM, DOUBLE_PENDULUM, FILES, PORTAL_FRAME, THREE_SUPPORTS, THROWN_CHAIN

import anctmm as at
from anctmm.errors import StabilityError
from anctmm.results.ended_early import nothing
from anctmm.results.status import Status
from anctmm.solution import LagrangeField
from studies.cases import cases_in, find_case
from studies.engine.meshes import coarsest_mesh, longest_step, parts_of, stable_step
from studies.engine.refinement import STEP, Refinement
from studies.engine.runner import Runner
from studies.engine.values import values_of

CASES = [(file, case.name) for file in FILES for case in cases_in(file)]
ROD, STEEL = at.Rectangle(0.02, 0.01), at.Material(E=1e9, density=1500.0)


@cache
def refined(file, name=None, target=3e-3, **options):
    return Refinement(find_case(file, name), Runner(), **options).refined(target)


# --- meshes and steps -------------------------------------------------------------------------------------------


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


def test_a_mesh_with_a_pin_at_a_fifth_is_refined():
    found = Refinement(mast(0.2), Runner()).refined(1e-2)
    assert found.reached
    assert found.trial.mesh[0] % 5 == 0


def test_the_coarsest_mesh_goes_by_length():
    case = find_case("four-bar")
    assert coarsest_mesh(case, "cable") == (1, 2, 2)
    assert coarsest_mesh(case, "rigid") == (1, 1, 1)


def test_steps_divide_the_interval_of_output():
    case = mast(0.5)
    assert longest_step(case) == pytest.approx(case.interval)
    assert case.interval / longest_step(case, 3e-4) == pytest.approx(5.0)


def test_the_stable_step_is_that_of_a_known_oscillator():
    mass = at.PointMass("m", 2.0, (1.0, 0.0))
    spring = at.Spring("m.center", (0.0, 0.0), stiffness=800.0)
    scene = at.Scene("oscillator", [mass], [at.Slider("m.center", direction=(1, 0))], connectors=[spring])
    assert stable_step(scene, 1) == pytest.approx(2.0 / 20.0)


def masses_on(**connector):
    """A mass between two springs and nothing else."""
    mass = at.PointMass("m", mass=0.1, position=(1.0, 0.0), velocity=(0.0, 0.3))
    springs = [
        at.Spring("m.center", (0.0, 0.0), **connector),
        at.Spring("m.center", (2.0, 0.1), stiffness=80.0),
    ]
    return at.Case(at.Scene("mass", [mass], connectors=springs), ["m.center"], t_end=2e-4, output_dt=1e-4)


def beam_on(tau=0.0, **connector):
    """A clamped beam with a spring at its end."""
    beam = at.Beam("b", (0, 0), (1, 0), at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0, damping=tau))
    springs = [at.Spring("b.end", (1.0, 1.0), **connector)]
    scene = at.Scene("beam", [beam], [at.Clamp("b.start")], gravity=(0, -9.81), connectors=springs)
    return at.Case(scene, ["b.end"], t_end=2e-4, output_dt=1e-4)


@pytest.mark.parametrize(
    "case",
    [masses_on(stiffness=10.0, damping=900.0), beam_on(stiffness=1e8), beam_on(tau=1e-2, stiffness=1e6)],
)
def test_explicit_steps_that_are_chosen_are_stable(case):
    """Springs, dampers and damping of materials shorten them, and are all there is where nothing bends."""
    first = Refinement(case, Runner(), integrator="zhai").trial(0, 0)
    assert at.solve(first.scene, first.run()).status.ok
    limit = stable_step(case.scene, first.by_beam)
    too_long = at.Discretisation(mesh=first.by_beam, integrator="zhai", dt=1.3 * limit, t_end=1.3 * limit)
    with pytest.raises(StabilityError):
        at.solve(case.scene, too_long)


# --- estimates --------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.parametrize(("file", "name"), CASES)
def test_the_estimated_error_holds(file, name):
    found = refined(file, name)
    assert found.reached
    far = found.levels.solution(found.i + 2, found.j + 3 * found.levels.refines[STEP])
    wrong = found.levels.difference(found.solution, far)
    assert 0.0 < wrong <= found.error
    assert found.error < 300.0 * wrong  # and is no mere bound


@pytest.mark.parametrize(
    ("file", "name"), [pytest.param(*case, marks=pytest.mark.exhaustive) for case in CASES[1:]] + CASES[:1]
)
def test_every_printed_digit_holds(file, name):
    found, far = refined(file, name, 1e-2), refined(file, name, 2e-3)
    assert far.reached
    pairs = list(zip(values_of(found), values_of(far), strict=True))
    assert len(pairs) == 4 * len(found.levels.case.probes)
    for value, exact in pairs:
        assert (value.probe, value.quantity) == (exact.probe, exact.quantity)
        assert abs(value.value - exact.value) <= value.uncertainty + exact.uncertainty, value


def test_of_a_probe_that_turns_and_does_not_move_the_angle_converges():
    wheel = at.RigidBody("wheel", 3.0, 0.02, (0.0, 0.0))
    spring = at.RotationalSpring("wheel.center", stiffness=40.0)
    pin, torque = at.Pin("wheel.center"), at.Torque("wheel.center", 5.0)
    case = at.Case(at.Scene("w", [wheel], [pin], [torque], connectors=[spring]), ["wheel.center"], t_end=0.2)
    found = Refinement(case, Runner()).refined(1e-2)
    exact = 5.0 / 40.0 * (1.0 - np.cos(np.sqrt(40.0 / 0.02) * found.solution.t))
    wrong = np.sqrt(np.mean((found.solution.angle("wheel.center") - exact) ** 2)) / exact.max()
    assert found.reached
    assert 0.0 < wrong <= found.error <= 1e-2


def test_orders_are_those_of_theory():
    found = refined(PORTAL_FRAME, "portal-frame-at-rest", 1e-3, element="shear")
    assert found.reached
    assert found.mesh.order == pytest.approx(2.0, abs=0.1)
    case, steps = find_case(ARM), [2.5e-4, 1.25e-4, 6.25e-5]
    moving = Refinement(case, Runner(), meshes=[(4,)], steps=steps).refined(1e-1)
    assert moving.step.order == pytest.approx(2.0, abs=0.3)


@pytest.mark.exhaustive
def test_explicit_and_implicit_steps_tend_to_one_motion():
    explicit, implicit = refined(THROWN_CHAIN, integrator="zhai"), refined(THROWN_CHAIN)
    assert explicit.reached
    assert explicit.levels.difference(explicit.solution, implicit.solution) < 3e-3


def test_what_is_given_is_not_refined():
    case, runner = find_case(DOUBLE_PENDULUM), Runner()
    found = Refinement(case, runner, meshes=[(3,)]).refined(1e-1)
    assert found.trial.mesh == (3,)
    assert found.mesh.error == 0.0 < found.step.error <= 1e-1
    found = Refinement(case, runner, steps=[5e-3]).refined(1e-1)
    assert found.trial.dt == 5e-3
    assert found.step.error == 0.0 < found.mesh.error <= 1e-1
    both = Refinement(case, runner, meshes=[(3,)], steps=[5e-3]).refined(1e-2)
    assert len(both.levels.solutions) == 1
    assert all(isnan(value.uncertainty) for value in values_of(both))


def test_a_target_out_of_reach_is_named():
    found = Refinement(find_case(THREE_SUPPORTS), Runner(), most_work=3e3).refined(1e-6)
    assert not found.reached
    assert found.error > 1e-6
    assert "more than 3e+03 elements times steps" in found.reason
    assert found.solution.status.ok


def fails_by_long_steps(scene, run):
    """A mass whose error is of first order in the mesh; on finer meshes it needs shorter steps."""
    elements = run.mesh
    if run.dt * elements > 0.02:
        return nothing("fake", scene, run, Status("diverged", "Newton's iteration failed"))
    t = run.times(run.output_steps)
    path = np.outer(t * (1.0 + 0.0056 / elements + 10.0 * run.dt**2), (1.0, 0.0))
    line = LagrangeField(np.stack([path, path + np.array([1.0, 0.0])], axis=1))
    cost = at.Cost(0.0, 0.0, run.steps)
    return at.Solution("fake", scene, run, t, {"b": line}, at.Energy.unknown(len(t)), cost, dofs=1)


def made_up(solver, target):
    beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.01), STEEL)
    case = at.Case(at.Scene("s", [beam], gravity=(0.0, -1.0)), ["b.end"], t_end=1.0, output_dt=0.1)
    return Refinement(case, Runner(resolve=lambda name: solver), most_work=2e4).refined(target)


def test_where_longer_steps_fail_a_shorter_one_is_tried_on_the_same_mesh():
    found = made_up(fails_by_long_steps, 1e-3)
    assert found.reached, found.reason
    assert found.error >= 0.0056 / found.trial.mesh[0] + 10.0 * found.trial.dt**2


def test_finer_meshes_that_end_early_are_named():
    def fails_on_finer_meshes(scene, run):
        if run.mesh > 4:
            return nothing("fake", scene, run, Status("diverged", "element 1 is turned inside out"))
        return fails_by_long_steps(scene, run)

    found = made_up(fails_on_finer_meshes, 1e-4)
    assert found.solution.status.ok
    assert "diverged: element 1 is turned inside out" in found.reason


def test_a_solver_that_cannot_do_a_scene_is_run_once():
    found = refined(DOUBLE_PENDULUM, solver="pyelastica")
    assert (found.reached, found.known, len(found.levels.solutions)) == (False, False, 1)
    assert isinf(found.error)
    assert "unsupported" in found.reason


def test_rigid_bars_have_no_mesh_to_refine():
    found = refined(DOUBLE_PENDULUM, target=1e-2, element="rigid")
    assert found.reached
    assert found.trial.mesh == (1, 1)
    assert found.mesh.error == 0.0 < found.step.error


def test_a_case_at_rest_has_no_step():
    found = refined(PORTAL_FRAME, "portal-frame-at-rest")
    assert found.step.error == 0.0
    assert isnan(found.trial.dt)
    exact = at.solve_static(found.levels.case.scene, mesh=64).position("girder.start")[-1]
    assert found.solution.position("girder.start")[-1] == pytest.approx(exact, rel=3e-3)


def test_a_place_that_rests_by_symmetry_has_no_error_of_its_own():
    """Its displacement is rounding, and what its difference is relative to would be as well."""
    halves = [
        at.Beam("l", (-0.7, 0.0), (0.0, 0.3), ROD, STEEL),
        at.Beam("r", (0.0, 0.3), (0.7, 0.6), ROD, STEEL),
    ]
    joints = [at.Clamp("l.start"), at.Weld("l.end", "r.start"), at.Clamp("r.end")]
    loads = [at.Force(("l", 0.5), (3.0, 7.0)), at.Force(("r", 0.5), (-3.0, -7.0))]
    case = at.Case(at.Scene("sym", halves, joints, loads=loads), ["l.end", ("l", 0.5)], t_end=None)
    found = Refinement(case, Runner()).refined(1e-2)
    assert found.reached, found.reason
