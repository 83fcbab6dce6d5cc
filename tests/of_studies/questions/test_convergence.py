"""`anctmm study convergence`: observed orders, and digits that hold, of anybody's case."""

import numpy as np
import pytest
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, PORTAL_FRAME, THROWN_CHAIN

import anctmm as at
from studies.cases import find_case, find_cases
from studies.cli import app
from studies.convergence.study import run
from studies.engine.accuracy.refinement import Setup
from studies.engine.runner import Runner
from studies.engine.study import Options, StudyError, without_motion
from studies.single_run.study import run_case


def studied(cases, **options):
    return run(Options(cases=tuple(cases), **options), Runner(None, repeats=1))


@pytest.fixture(scope="module")
def frame():
    return studied(find_cases(PORTAL_FRAME), quick=True, error=1e-4)


def test_orders_are_those_of_theory(frame):
    meshes, steps = frame.table("mesh").frame, frame.table("step").frame
    moving = meshes[meshes["scene"] == "portal-frame"]
    assert 3.0 < moving["order"].max() < 5.0
    assert steps["order"].iloc[-1] == pytest.approx(2.0, abs=0.3)
    for _, rows in [*meshes.groupby("scene"), *steps.groupby("scene")]:
        assert np.isnan(rows["order"].iloc[0])
        assert (np.diff(rows["error"].iloc[:-1]) < 0.0).all()  # of the last it is an estimate
    assert set(steps["scene"]) == {"portal-frame"}  # the other is at rest


def test_values_at_rest_are_those_of_a_fine_mesh(frame):
    case = find_case(PORTAL_FRAME, "portal-frame-at-rest")
    fine = at.solve_static(case.scene, mesh=64).position("girder.start")[-1]
    values = frame.table("values").frame
    mine = values[(values["scene"] == case.name) & values["quantity"].isin(["x at rest", "y at rest"])]
    assert (np.abs(mine["value"].to_numpy() - fine) <= mine["uncertainty"].to_numpy()).all()
    assert len(mine) == 2


def test_both_elements_and_what_is_asked_for():
    case = [find_case(THROWN_CHAIN)]
    both = studied(case, error=1e-2)
    assert set(both.table("values").frame["element"]) == {"cable", "shear"}
    explicit = studied(case, error=1e-2, element="cable", integrator="zhai", solvers=("anctmm", "global-dae"))
    values = explicit.table("values").frame
    assert set(values["integrator"]) == {"zhai"}
    ours, theirs = (values[values["solver"] == s]["value"].to_numpy() for s in ("anctmm", "global-dae"))
    assert ours == pytest.approx(theirs, abs=1e-6)


def test_a_solver_with_elements_of_its_own_is_studied_once_by_their_name_and_order():
    """Cables of Exudyn had been told to be shear elements, and ended the study; its beams had two theories."""
    pytest.importorskip("exudyn")
    case = find_case(PORTAL_FRAME, "portal-frame-at-rest")
    found = studied([case], meshes=((2,), (4,), (8,)), solvers=("exudyn-cable", "exudyn-reissner"))
    rows = found.table("mesh").frame[["solver", "element"]].drop_duplicates()
    assert rows.to_numpy().tolist() == [["exudyn-cable", "cable"], ["exudyn-reissner", "reissner"]]
    assert all("(theory 4)" in said for said in found.findings)
    forces = found.table("forces").frame
    assert set(forces[forces["joint"].str.startswith("clamp")]["solver"]) == {"exudyn-cable"}


def test_another_element_than_the_one_named_is_told():
    pytest.importorskip("exudyn")
    case = find_case(PORTAL_FRAME, "portal-frame-at-rest")
    setup = Setup("exudyn-cable", element="shear")
    done = run_case(
        case, Runner(None, repeats=1), mesh=(4,), setup=setup, others=("anctmm", "exudyn-reissner")
    )
    assert "exudyn-cable, 4 cable elements" in done.setting
    assert [other.element for other in done.others] == ["shear", "reissner"]
    assert "with reissner elements" in done.others[1].told


def test_a_solver_that_cannot_is_a_finding():
    found = studied([find_case(DOUBLE_PENDULUM)], quick=True, solvers=("pyelastica",))
    assert "unsupported" in found.findings[0]
    assert found.table("values").frame.empty


def test_in_the_terminal(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["study", "convergence", THROWN_CHAIN, "--quick"], env={"COLUMNS": "90"})
    assert done.exit_code == 0, done.output
    assert "Values and their uncertainty: thrown-chain, anctmm, cable, generalized-alpha\n" in done.output
    assert "± " in done.output
    names = {p.name for p in (tmp_path / "results" / "convergence").iterdir()}
    assert names >= {"values.csv", "mesh.csv", "step.csv", "convergence_thrown-chain.svg"}


def test_a_scene_without_beams_names_no_element(tmp_path, monkeypatch):
    """Tables and findings told of cables."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(
        "import anctmm as at\n"
        "body = at.RigidBody('body', 1.0, 0.1, (0.5, 0.0), points={'o': (0.0, 0.0)})\n"
        "scene = at.Scene('pendulum', [body], [at.Pin('body.o')], gravity=(0.0, -9.81))\n"
        "CASES = [at.Case(scene, probes=['body.center'], t_end=0.3)]\n"
    )
    done = CliRunner().invoke(app, ["study", "convergence", "own.py", "--quick"], env={"COLUMNS": "90"})
    assert done.exit_code == 0, done.output
    assert "Values and their uncertainty: pendulum, anctmm, generalized-alpha\n" in done.output
    assert "• pendulum, anctmm, generalized-alpha: " in done.output
    assert "cable" not in done.output
    assert "elements" not in done.output


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["convergence", THROWN_CHAIN, "--elements", "4", "--dt", "1e-3"],
            "is 4/4/4 alone, and --dt one step: nothing",
        ),
        (
            ["convergence", THROWN_CHAIN, "--elements", "4/4,8"],
            "has '4/4'; scene 'thrown-chain' needs 1 or 3",
        ),
        (
            ["convergence", THROWN_CHAIN, "--elements", "4,4/8/8"],
            "more elements of each beam of 'thrown-chain'",
        ),
        (["convergence", THROWN_CHAIN, "--elements", "4,8", "--dt", "3e-3"], "3"),
        (
            ["convergence", THROWN_CHAIN, "--elements", "4,8", "--dt", "1e-3", "--error", "1e-3"],
            "--error is 0.001 beside --elements and --dt",
        ),
        (
            ["convergence", PORTAL_FRAME, "--case", "portal-frame-at-rest", "--dt", "1e-3"],
            "'portal-frame-at-rest', a static equilibrium, which has no step",
        ),
        (
            ["convergence", PORTAL_FRAME, "--case", "portal-frame-at-rest", "--integrator", "esdirk"],
            "--integrator chooses the steps of motions; portal-frame-at-rest is a static equilibrium",
        ),
        (["convergence", THROWN_CHAIN, "--element", "cabel"], "element is 'cabel'; allowed are"),
        (["convergence", THROWN_CHAIN, "--error", "-1"], "--error has '-1'"),
        (["convergence", THROWN_CHAIN, "--case", "arm"], "'arm' and is unknown"),
        (["convergence", "--case", "arm"], "--case is 'arm' without a file"),
        (["convergence", "nowhere.py"], "no such file"),
        (["agreement", THROWN_CHAIN], "study 'agreement' takes no scene: it compares all"),
        (["extremes", "--error", "1e-3"], "takes no --error"),
    ],
)
def test_what_is_wrong_is_named(arguments, said):
    done = CliRunner().invoke(app, ["study", *arguments], env={"COLUMNS": "200"})
    assert (done.exit_code, said in " ".join(done.output.split())) == (2, True), done.output


def test_meshes_and_steps_are_those_asked_for():
    """Of any spacing: 1-2-5 steps, and meshes that are not doubled."""
    case = [find_case(THROWN_CHAIN)]
    meshes, steps = ((2,), (3,), (5,)), (1e-3, 4e-4, 2e-4)
    found = studied(case, element="cable", meshes=meshes, steps=steps)
    assert found.table("mesh").frame["elements"].tolist() == ["2/2/2", "3/3/3", "5/5/5"]
    assert found.table("step").frame["dt"].tolist() == [1e-3, 4e-4, 2e-4]
    assert found.table("values").frame["uncertainty"].notna().all()
    fine = at.solve(case[0].scene, mesh=16, dt=2.5e-5, t_end=0.3, output_dt=0.01)
    for row in found.table("values").frame.to_dict("records"):
        if row["quantity"].startswith(("x", "y")):
            exact = fine.position(row["probe"])[-1, "xy".index(row["quantity"][0])]
            assert abs(row["value"] - exact) <= row["uncertainty"]


def test_one_mesh_asked_for_leaves_the_step_to_be_refined():
    found = studied([find_case(DOUBLE_PENDULUM)], element="cable", meshes=((4,),), error=1e-2)
    assert found.table("mesh").frame.empty
    assert len(found.table("step").frame) > 1
    assert "of the step alone; the mesh is the one given" in found.findings[0]
    assert found.table("values").frame["uncertainty"].isna().all()  # nothing is known of the mesh


def test_errors_do_not_grow_from_coarse_to_fine(frame):
    for table in ("mesh", "step"):
        for _, rows in frame.table(table).frame.groupby("scene"):
            assert (np.diff(rows["error"]) <= 0.0).all()


def test_the_function_refuses_what_nothing_converges_over():
    with pytest.raises(StudyError, match="nothing converges"):
        studied([find_case(THROWN_CHAIN)], meshes=((4,),), steps=(1e-3,))


def test_what_is_rounding_has_no_digits():
    """A cart that its rail keeps from turning, and whose forces all pass through its centre of mass."""
    cart = at.RigidBody("cart", mass=1.0, inertia=0.01, center=(0.0, 0.0), points={"hook": (-0.1, 0.0)})
    rod = at.RigidBody("rod", mass=0.3, inertia=1e-3, center=(0.3, -0.4), points={"pivot": (0.0, 0.0)})
    joints = [at.Prismatic("cart.center", direction=(1.0, 0.0)), at.Pin("cart.center", "rod.pivot")]
    spring = at.Spring("cart.hook", (-1.0, 0.0), stiffness=30.0, length=0.8)
    scene = at.Scene("cart", [cart, rod], joints, connectors=[spring], gravity=(0.0, -9.81))
    case = at.Case(scene, ["cart.center", "rod.center"], t_end=0.2, output_dt=0.01)
    found = studied([case], error=1e-3)
    values, forces = found.table("values").frame, found.table("forces").frame
    angle = values[(values["probe"] == "cart.center") & values["quantity"].str.startswith("angle")]
    assert angle["uncertainty"].between(1e-14, 1e-12).all()
    assert len(angle)
    moment = forces[forces["quantity"].str.contains("moment")]
    assert (moment["value"].abs() < moment["uncertainty"]).all()
    assert 0.0 < moment["uncertainty"].max() < 1e-9
    force = forces[forces["quantity"].str.contains("largest force")]
    assert set(force["joint"]) == {"prismatic cart.center", "pin cart.center, rod.pivot"}
    assert (force["uncertainty"] < 0.05 * force["value"]).all()


@pytest.mark.interpreted
def test_of_a_rigid_equilibrium_nothing_is_to_be_refined():
    """It had 'an estimated error of 0 ()', and `run` said that mesh and step were given."""
    bar = at.RigidBody("bar", 2.0, 0.17, (0.5, 0.0), points={"o": (0.0, 0.0), "tip": (1.0, 0.0)})
    hinge = at.RotationalSpring("bar.o", stiffness=300.0)
    scene = at.Scene("rest", [bar], [at.Pin("bar.o")], connectors=[hinge], gravity=(0, -9.81))
    case = at.Case(scene, ["bar.tip"], t_end=None)
    result = studied([case], quick=True)
    said = "there is no mesh or step to refine"
    assert result.findings == (f"rest, anctmm, static: {said}.",)
    assert result.answers[0].take.endswith(f"{said}.")
    assert said in run_case(case, Runner(None)).error
    free = at.Scene("unloaded", [bar], [at.Pin("bar.o")], connectors=[hinge])
    answers = studied([at.Case(free, ["bar.tip"], t_end=None)], quick=True).answers
    assert not [a for a in answers if "largest force" in a.question]  # of 0 N


@pytest.mark.interpreted
@pytest.mark.parametrize("stretch", ["held", "free"])
def test_a_mesh_of_first_order_is_told_what_makes_it_so(stretch):
    """An arch under its crown's load took 512 elements a beam, where 8 are as good if its clamps free the stretch."""
    section, stuff = at.Rectangle(0.02, 0.01), at.Material(E=2e9, density=1500.0)
    left = at.Beam("left", (0, 0), (0.5, 0.2), section, stuff)
    right = at.Beam("right", (0.5, 0.2), (1, 0), section, stuff)
    crown = at.Weld("left.end", "right.start", stretch=stretch)
    joints = [at.Clamp("left.start", stretch=stretch), crown, at.Clamp("right.end", stretch=stretch)]
    scene = at.Scene("arch", [left, right], joints, [at.Force("left.end", (5.0, -60.0))])
    case = at.Case(scene, ["left.end"], t_end=None)
    result = studied([case], quick=True, error=1.0, meshes=((4,), (8,), (16,)))
    assert ('stretch="free" in them removes it' in result.findings[0]) == (stretch == "held")


def test_an_integrator_does_nothing_for_the_cases_that_rest():
    cases = [find_case(PORTAL_FRAME, name) for name in ("portal-frame", "portal-frame-at-rest")]
    said = [
        "portal-frame-at-rest: --integrator chooses the steps of motions, and it is a static equilibrium."
    ]
    assert without_motion(cases, Options(integrator="esdirk")) == said
    assert without_motion(cases, Options()) == []
    with pytest.raises(StudyError, match="portal-frame-at-rest is a static equilibrium: leave it out"):
        without_motion(cases[1:], Options(integrator="esdirk"))
