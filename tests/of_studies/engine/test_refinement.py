"""Meshes and steps that the program chooses: estimates of errors hold against far finer runs."""

from functools import cache
from math import isinf, isnan, nan

import numpy as np
import pytest
from user_cases import DOUBLE_PENDULUM, FILES, PORTAL_FRAME, THREE_SUPPORTS, THROWN_CHAIN

import anctmm as at
from anctmm.errors import StabilityError, UnknownOptionError
from anctmm.results.ended_early import nothing
from anctmm.results.status import Status
from anctmm.solution import LagrangeField
from studies.cases import cases_in, find_case
from studies.engine.meshes import coarsest_mesh, stable_step
from studies.engine.refinement import Refinement, Setup
from studies.engine.runner import Runner
from studies.engine.values import Value, rounded, values_of

CASES = [(file, case.name) for file in FILES for case in cases_in(file)]


def levels(file, name=None, **options):
    return Refinement(find_case(file, name), Setup(**options), Runner(None))


@cache
def refined(file, name, target=3e-3, **options):
    return levels(file, name, **options).refined(target)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("file", "name"), CASES)
def test_the_estimated_error_holds(file, name):
    found = refined(file, name)
    assert found.reached
    assert found.error <= 3e-3
    far = found.levels.solution(found.i + 2, found.j + 3 * found.levels.refines_step)
    wrong = found.levels.difference(found.solution, far)
    assert 0.0 < wrong <= found.error
    assert found.error < 300.0 * wrong  # and is no mere bound


def wheel_on_a_spring():
    """A wheel on a rotational spring, let go under a torque, at whose axle alone it is looked."""
    wheel = at.RigidBody("wheel", 3.0, 0.02, (0.0, 0.0))
    scene = at.Scene(
        "wheel", [wheel], [at.Pin("wheel.center")], [at.Torque("wheel.center", 5.0)],
        connectors=[at.RotationalSpring("wheel.center", stiffness=40.0)],
    )  # fmt: skip
    return at.Case(scene, ["wheel.center"], t_end=0.2)


def test_of_a_probe_that_turns_and_does_not_move_the_angle_converges():
    """Its displacement is zero in all runs: the estimated error was 0, and the angle unknown by twice its size."""
    found = Refinement(wheel_on_a_spring(), Setup(), Runner(None)).refined(1e-2)
    t = found.solution.t
    exact = 5.0 / 40.0 * (1.0 - np.cos(np.sqrt(40.0 / 0.02) * t))
    wrong = np.sqrt(np.mean((found.solution.angle("wheel.center") - exact) ** 2)) / exact.max()
    assert found.reached
    assert 0.0 < wrong <= found.error <= 1e-2


def masses_on(**connector):
    """A mass between two springs and nothing else."""
    mass = at.PointMass("m", mass=0.1, position=(1.0, 0.0), velocity=(0.0, 0.3))
    return at.Scene("mass", [mass], connectors=[
        at.Spring("m.center", (0.0, 0.0), **connector), at.Spring("m.center", (2.0, 0.1), stiffness=80.0)])  # fmt: skip


def beam_on(tau=0.0, **connector):
    """A clamped beam with a spring or damper at its end."""
    beam = at.Beam("b", (0, 0), (1, 0), at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0, damping=tau))
    springs = [at.Spring("b.end", (1.0, 1.0), **connector)] if connector else []
    return at.Scene("beam", [beam], [at.Clamp("b.start")], gravity=(0, -9.81), connectors=springs)


@pytest.mark.parametrize(
    "scene",
    [
        masses_on(stiffness=4e5),
        masses_on(stiffness=10.0, damping=900.0),
        beam_on(stiffness=1e8),
        beam_on(stiffness=1.0, damping=300.0),
        beam_on(tau=1e-2),
        beam_on(tau=1e-2, stiffness=1e6),
    ],
)
def test_explicit_steps_that_are_chosen_are_stable(scene):
    """Springs, dampers and damping of materials shorten them, and are all there is where nothing bends."""
    place = "m.center" if scene.name == "mass" else "b.end"
    case = at.Case(scene, [place], t_end=2e-4, output_dt=1e-4)
    found = Refinement(case, Setup(integrator="zhai"), Runner(None))
    first = found.trial(0, 0)
    assert at.solve(first.scene, first.run()).status.ok
    limit = stable_step(scene, first.by_body, 1.0)
    too_long = at.Discretisation(mesh=first.by_body, integrator="zhai", dt=1.3 * limit, t_end=1.3 * limit)
    with pytest.raises(StabilityError):
        at.solve(scene, too_long)


@pytest.mark.parametrize(("file", "name"), CASES)
def test_every_printed_digit_holds(file, name):
    found = refined(file, name)
    far = refined(file, name, 1e-4)
    assert far.reached
    pairs = list(zip(values_of(found), values_of(far), strict=True))
    assert len(pairs) == 4 * len(found.levels.case.probes)
    for value, exact in pairs:
        assert (value.probe, value.quantity) == (exact.probe, exact.quantity)
        assert abs(value.value - exact.value) <= value.uncertainty + exact.uncertainty, value


def test_shear_elements_and_explicit_steps_are_refined_too():
    found = refined(PORTAL_FRAME, "portal-frame-at-rest", 1e-3, element="shear")
    assert found.reached
    assert found.mesh.order == pytest.approx(2.0, abs=0.1)
    explicit = refined(THROWN_CHAIN, None, integrator="zhai")
    assert explicit.reached
    implicit = refined(THROWN_CHAIN, None)
    assert explicit.levels.difference(explicit.solution, implicit.solution) < 3e-3


def test_orders_are_those_of_theory():
    found = levels(PORTAL_FRAME, "portal-frame").refined(3e-5)
    assert found.mesh.order == pytest.approx(4.0, abs=1.0)
    assert found.step.order == pytest.approx(2.0, abs=0.3)


def test_what_is_given_is_not_refined():
    case, runner = find_case(DOUBLE_PENDULUM), Runner(None)
    found = Refinement(case, Setup(), runner, meshes=[(3,)]).refined(1e-2)
    assert found.trial.mesh == (3,)
    assert found.mesh.error == 0.0 < found.step.error <= 1e-2
    found = Refinement(case, Setup(), runner, steps=[5e-3]).refined(1e-1)
    assert found.trial.dt == 5e-3
    assert found.step.error == 0.0 < found.mesh.error <= 1e-1
    both = Refinement(case, Setup(), runner, meshes=[(3,)], steps=[5e-3]).refined(1e-2)
    assert both.levels.runs == 1
    assert all(isnan(value.uncertainty) for value in values_of(both))


def test_a_target_out_of_reach_is_told():
    case = find_case(THREE_SUPPORTS)
    found = Refinement(case, Setup(), Runner(None), most_work=3e3).refined(1e-6)
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


def test_where_longer_steps_fail_a_shorter_one_is_tried_on_the_same_mesh():
    """A finer mesh would need shorter steps again, and runs became too long before any error was known."""
    beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.01), at.Material(E=1e9, density=1000.0))
    case = at.Case(at.Scene("s", [beam], gravity=(0.0, -1.0)), ["b.end"], t_end=1.0, output_dt=0.1)
    runner = Runner(None, resolve=lambda name: fails_by_long_steps)
    found = Refinement(case, Setup(), runner, most_work=2e4).refined(1e-3)
    assert found.reached, found.reason
    mesh, step = found.trial.mesh[0], found.trial.dt
    assert found.error >= 0.0056 / mesh + 10.0 * step**2


def test_finer_meshes_that_end_early_are_told():
    """The reason was the length of a run alone, although no length would do."""

    def fails_on_finer_meshes(scene, run):
        if run.mesh > 4:
            return nothing("fake", scene, run, Status("diverged", "element 1 is turned inside out"))
        return fails_by_long_steps(scene, run)

    beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.01), at.Material(E=1e9, density=1000.0))
    case = at.Case(at.Scene("s", [beam], gravity=(0.0, -1.0)), ["b.end"], t_end=1.0, output_dt=0.1)
    runner = Runner(None, resolve=lambda name: fails_on_finer_meshes)
    found = Refinement(case, Setup(), runner, most_work=2e4).refined(1e-4)
    assert found.solution.status.ok
    assert "ends early (diverged: element 1 is turned inside out), and" in found.reason
    assert "elements times steps would be needed" in found.reason


def test_a_solver_that_cannot_do_a_scene_is_asked_once():
    found = levels(DOUBLE_PENDULUM, solver="pyelastica").refined(1e-2)
    assert not found.reached
    assert found.levels.runs == 1
    assert isinf(found.error)
    assert "unsupported" in found.reason
    assert isnan(found.reference.uncertainty)


def test_the_coarsest_mesh_goes_by_length():
    case = find_case("four-bar")
    assert coarsest_mesh(case, "cable") == (1, 2, 2)
    assert coarsest_mesh(case, "shear") == (1, 4, 3)
    assert coarsest_mesh(case, "rigid") == (1, 1, 1)


def test_rigid_bars_have_no_mesh_to_refine():
    found = levels(DOUBLE_PENDULUM, element="rigid", integrator="zhai").refined(1e-3)
    assert found.reached
    assert found.trial.mesh == (1, 1)
    assert found.mesh.error == 0.0 < found.step.error


@pytest.mark.parametrize(
    "wrong", [{"element": "cabel"}, {"integrator": "rk4"}, {"solver": "me"}, {"quadrature": "x"}]
)
def test_unknown_names_are_refused(wrong):
    ((name, value),) = wrong.items()
    with pytest.raises(UnknownOptionError, match=f"{name} is '{value}'; allowed are "):
        Setup(**wrong)


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (0.123456, 3e-4, "0.1235"),
        (-123.456, 2.0, "-123"),
        (0.363052, 9.6e-5, "0.3631"),
        (13272.0, 1e3, "13000"),
        (-1801.0, 96.0, "-1800"),
        (6.0, 10.0, "10"),
        (0.0, 1e-3, "0.000"),
        (1.0, 0.0, "1"),
        (3.2e-9, 1e-11, "3.20e-09"),
        (123456789.0, 1e3, "1.23457e+08"),
        (0.5, 1e-15, "0.500000000000"),
    ],
)
def test_digits(value, uncertainty, text):
    assert rounded(value, uncertainty) == text


@pytest.mark.parametrize(
    ("value", "uncertainty", "count"),
    [
        (3.39, 0.04, 2),
        (0.2649, 5e-4, 3),
        (-58.0, 4.0, 1),
        (46.0, 40.0, 0),
        (0.9, 1.0, 0),
        (1.0, 0.0, 12),
        (2.0, nan, None),
    ],
)
def test_digits_that_hold_are_counted(value, uncertainty, count):
    """As many as can be written down: rounded to them, a number is wrong by half a unit at most."""
    assert Value("p", "x", "m", value, uncertainty).digits == count


def test_a_value_without_uncertainty_says_so_by_having_none():
    assert Value("p", "x", "m", 0.123456789).text == "0.123457 m"
    assert Value("p", "x", "m", 0.123456789, 2e-4).text == "0.1235 ± 0.0002 m"


def test_a_case_at_rest_has_no_step():
    found = refined(PORTAL_FRAME, "portal-frame-at-rest")
    assert found.step.error == 0.0
    assert isnan(found.trial.dt)
    scene = found.levels.case.scene
    exact = at.solve_static(scene, mesh=64)
    assert found.solution.position("girder.start")[-1] == pytest.approx(
        exact.position("girder.start")[-1], rel=3e-3
    )


def test_a_place_that_rests_by_symmetry_has_no_error_of_its_own():
    """Its displacement is rounding, and was what its difference is relative to: no mesh was fine enough."""
    section, material = at.Rectangle(0.02, 0.01), at.Material(E=1e9, density=1500.0)
    halves = [
        at.Beam("l", (-0.7, 0.0), (0.0, 0.3), section, material),
        at.Beam("r", (0.0, 0.3), (0.7, 0.6), section, material),
    ]
    joints = [at.Clamp("l.start"), at.Weld("l.end", "r.start"), at.Clamp("r.end")]
    loads = [at.Force(("l", 0.5), (3.0, 7.0)), at.Force(("r", 0.5), (-3.0, -7.0))]
    case = at.Case(at.Scene("sym", halves, joints, loads=loads), ["l.end", ("l", 0.5)], t_end=None)
    found = Refinement(case, Setup(), Runner(None)).refined(1e-2)
    assert found.reached, found.reason
    exact = at.solve_static(case.scene, mesh=128).displacement(("l", 0.5))[-1]
    assert found.solution.displacement(("l", 0.5))[-1] == pytest.approx(exact, rel=1e-2)


def test_rigid_bodies_and_point_masses_take_no_elements():
    plate = at.RigidBody(
        "plate", mass=0.5, inertia=3.3e-3, center=(0.6, 0.0), points={"a": (0.5, 0.0), "b": (0.7, 0.0)}
    )
    arm = at.Beam("arm", (0, 0), (0.5, 0), at.Circle(0.01), at.Material(E=1e9, density=2000.0))
    joints = [at.Clamp("arm.start"), at.Pin("arm.end", "plate.a")]
    scene = at.Scene("arm and plate", [arm, plate], joints, gravity=(0.0, -9.81))
    case = at.Case(scene, ["arm.end", "plate.b"], t_end=0.1, output_dt=0.01)
    found = Refinement(case, Setup(), Runner(None)).refined(1e-2)
    assert found.reached
    assert len(found.trial.mesh) == 1
    assert {value.probe for value in values_of(found)} == {"arm.end", "plate.b"}
    spring = at.Spring("bob.center", (0.0, 0.0), stiffness=50.0)
    bob = at.Scene("bob", [at.PointMass("bob", 1.0, (1.0, 0.0))], connectors=[spring], gravity=(0.0, -9.81))
    found = Refinement(at.Case(bob, ["bob.center"], t_end=0.5), Setup(), Runner(None)).refined(1e-3)
    assert found.reached
    assert found.mesh.error == 0.0 < found.step.error
