"""The study of extremes on scenes of a user's, against what is known of them exactly."""

import re
from math import sqrt

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, PORTAL_FRAME

import anctmm as at
from studies.cases import cases_in, find_cases
from studies.cli import app
from studies.engine.other_numbers import Change
from studies.engine.runner import Runner
from studies.engine.study import Options, find
from studies.engine.tables import Table
from studies.extremes.of_cases.base import Base
from studies.extremes.of_cases.growth import growth
from studies.extremes.of_cases.places import places
from studies.extremes.of_cases.stiffness import stiffness
from studies.extremes.of_cases.study import answers_of_case
from studies.report.folder import write

G = 9.81
SOFT = at.Material(E=2e8, density=1500.0)


def study(*cases, **options):
    return find("extremes")(Options(**({"quick": True} | options), cases=cases), Runner(None, repeats=1))


@pytest.fixture(scope="module")
def pendulum():
    case = cases_in(DOUBLE_PENDULUM)[0]
    return case, study(case)


def test_explicit_steps_hold_up_to_the_limit_and_not_beyond(pendulum):
    case, result = pendulum
    limits, margins = result.table("stable_step").frame, result.table("margin").frame
    assert list(limits["t"]) == pytest.approx(np.linspace(0.0, case.t_end, 6))
    mesh = dict(zip(("upper", "lower"), map(int, limits["elements"].iloc[0].split("/")), strict=True))
    with pytest.raises(at.errors.StabilityError, match="at most") as refused:
        at.solve(case.scene, mesh=mesh, integrator="zhai", dt=1e-3, t_end=case.t_end)
    limit = float(re.search(r"at most (\S+) s is stable", str(refused.value)).group(1))
    assert limits["stable_dt"].iloc[0] == pytest.approx(limit, rel=1e-5)
    below = margins["of_limit"] < 1.0
    assert margins["status"][below].eq("ok").all()
    assert (margins["error"][below] <= margins["uncertainty"][below]).all()
    assert margins["status"][~below].str.startswith("diverged").all()


def test_stiffer_beams_tend_to_rigid_bars_as_one_over_the_stiffness(pendulum):
    _, result = pendulum
    rows = result.table("stiffness").frame
    assert list(rows["factor"]) == [1.0, 1e2, 1e4]
    assert rows["ratio"].iloc[-1] == pytest.approx(100.0, rel=0.1)


def test_units_change_nothing_but_rounding(pendulum):
    _, result = pendulum
    rows = result.table("units").frame.set_index("value")
    assert rows["status"].eq("ok").all()
    assert (rows["measured"] <= rows["predicted"]).all()
    assert rows["same_bits"]["powers of two"]
    assert rows["measured"]["mm, t, s"] < 1e-12


def test_texts_and_files_are_of_this_scene(pendulum, tmp_path):
    _, result = pendulum
    texts = [
        *result.findings,
        *(n for t in result.tables for n in t.notes),
        *(p.caption for p in result.pictures),
    ]
    assert all("double-pendulum" in text for text in result.findings)
    assert not [t for t in texts if re.search("crank|coupler|follower|four-bar|cantilever", t)]
    folder = write(result, tmp_path)
    assert folder.name == "extremes-double-pendulum"
    assert {"growth.md", "margin.csv", "units.md", "growth_double-pendulum.svg"} <= {
        f.name for f in folder.iterdir()
    }


def test_a_disturbance_of_an_upright_pendulum_grows_as_theory_says():
    """A bar that stands on its pin falls as sinh λt, λ² = 3g/2L, by both solvers."""
    bar = at.Beam("bar", (0, 0), (0, 1), at.Circle(0.1), at.Material(E=5e7, density=1000.0))
    case = at.Case(at.Scene("upright", [bar], [at.Pin("bar.start")], gravity=(0, -G)), ["bar.end"], t_end=3.0)
    part, larger = growth(Base.of(case, Runner(None, repeats=1), quick=True))
    rows = part.tables[0].frame.set_index("what")
    rate = sqrt(1.5 * G)
    assert rows["rate"]["push, anctmm"] == pytest.approx(rate, rel=0.02)
    assert rows["rate"]["push, global-dae"] == pytest.approx(rate, rel=0.02)
    assert larger > 1e4


@pytest.mark.interpreted
def test_of_a_push_that_drives_hold_no_growth_is_told():
    """Of a driven wheel the axle moved by 1e-77, which "grew 0.087 times", and by the other solver "nan times"."""
    wheel = at.RigidBody("wheel", 3.0, 0.02, (0.0, 0.0), points={"rim": (0.1, 0.0)})
    turn = at.Clamp("wheel.center", angle=at.Quintic(turn=1.0, duration=0.1))
    case = at.Case(at.Scene("driven", [wheel], [turn]), ["wheel.center"], t_end=0.1, output_dt=0.005)
    part, larger = growth(Base.of(case, Runner(None, repeats=1), quick=True))
    rows = part.tables[0].frame
    assert (rows["last"] < 1e-13).all()
    assert rows["growth"].isna().all()
    assert larger == 1.0
    assert "leaves no trace at the probes; by global-dae it leaves no trace" in part.learned[0]


@pytest.mark.interpreted
def test_a_steady_drift_grows_by_what_the_table_says():
    ball = at.Scene("ball", [at.PointMass("ball", mass=1.0, position=(0, 0))], gravity=(0, -G))
    case = at.Case(ball, ["ball.center"], t_end=0.5)
    part, larger = growth(Base.of(case, Runner(None, repeats=1), quick=True))
    assert larger == pytest.approx(7.0, abs=0.3)
    assert "a steady drift grows by 7" in part.tables[0].notes[0]


def test_an_equilibrium_has_no_steps_and_what_does_not_apply_says_so():
    rest = find_cases(PORTAL_FRAME, "portal-frame-at-rest")[0]
    assert {t.name for t in study(rest).tables} == {"units", "many_elements", "stiffness"}
    ball = at.Scene(
        "ball", [at.PointMass("ball", mass=1.0, position=(0, 0))], [], gravity=(0, -G),
        connectors=[at.Spring("ball.center", (0, 1.0), stiffness=30.0)],
    )  # fmt: skip
    result = study(at.Case(ball, ["ball.center"], t_end=1.0))
    for name in ("many_elements", "stiffness"):
        assert list(result.table(name).frame["status"]) == ["does not apply: there is no beam"]
    exact = 2.0 / sqrt(30.0)  # of the vertical motion
    assert result.table("stable_step").frame["stable_dt"].iloc[0] == pytest.approx(exact, rel=1e-6)


def slide(t):
    return 0.02 * np.sin(3 * t) ** 2, 0.06 * np.sin(6 * t), 0.36 * np.cos(6 * t)


def stretch(t):
    return 0.3 + 0.01 * np.sin(5 * t), 0.05 * np.cos(5 * t)


def everything(**spring):
    """A scene with every kind of body, joint, load and connector that has a dimension."""
    turning = at.RigidVelocity((0.1, 0.0), (0.5, 0.1), center=(0.0, 0.0), spin=2.0)
    rod = at.Beam("rod", (0.1, 0.0), (0.5, 0.1), at.Rectangle(0.01, 0.006), SOFT, turning)
    arm = at.Beam("arm", (0.0, 0.5), (0.3, 0.5), at.Rectangle(0.01, 0.006), SOFT)
    disc = at.RigidBody("disc", mass=0.3, inertia=4e-4, center=(0, 0), points={"rim": (0.1, 0.0)}, spin=2.0)
    block = at.RigidBody("block", mass=0.1, inertia=1e-4, center=(0.8, 0.0), velocity=(0.0, 0.0))
    ball = at.PointMass("ball", mass=0.2, position=(0.5, -0.2), velocity=(0.1, 0.3))
    return at.Scene(
        "everything", [disc, rod, arm, block, ball],
        [
            at.Pin("disc.center"), at.Pin("disc.rim", "rod.start"), at.Clamp("arm.start", angle=at.Quintic(0.3, 0.2)),
            at.Prismatic("block.center", (1, 0), position=slide),
        ],
        [
            at.Torque("disc.rim", 0.05), at.LineLoad("rod", (0.0, -2.0)),
            at.Force("arm.end", at.History(lambda t: (0.0, 0.5 * np.sin(9 * t)))),
        ],
        gravity=(0, -G),
        connectors=[
            at.Spring("rod.end", "ball.center", length=stretch, **({"stiffness": 30.0, "damping": 0.2} | spring)),
            at.Spring("ball.center", "block.center", stiffness=8.0, preload=0.3),
            at.RotationalSpring("disc.rim", stiffness=0.2, damping=1e-3, angle=0.1),
        ],
    )  # fmt: skip


def test_units_are_changed_of_every_kind_of_thing():
    case = at.Case(everything(), ["rod.end", "ball.center", "arm.end"], t_end=0.2, output_dt=0.02)
    part = places(Base.of(case, Runner(None, repeats=1), quick=True), 10.0)
    rows = part.tables[0].frame.set_index("value")
    assert rows["status"].eq("ok").all(), rows["status"]
    assert rows["same_bits"]["powers of two"]
    assert (rows["measured"] <= rows["predicted"]).all()


def test_forces_of_a_guide_in_a_rigid_body_are_the_same_far_away():
    """Reactions were wrong by a half at all of these places, and no table said so."""
    arm = at.RigidBody("arm", 1.0, 0.02, (0.2, 0.0), {"hinge": (0.0, 0.0), "track": (0.1, 0.0)})
    cart = at.PointMass("cart", 1.0, (0.1, 0.0))
    guide = at.Slider("cart.center", (1, 0), body="arm", position=at.Quintic(0.05, 0.1))
    scene = at.Scene("cart", [arm, cart], [at.Pin("arm.hinge"), guide], gravity=(0.0, -G))
    case = at.Case(scene, ["cart.center"], t_end=0.1, output_dt=0.01)
    rows = places(Base.of(case, Runner(None, repeats=1), quick=False), 10.0).tables[0].frame
    far = rows["what"] == "place"
    assert far.sum() == 3
    assert rows["status"].eq("ok").all(), rows["status"]
    assert (rows["reactions"][far] < 5e-3).all(), rows
    assert rows["reactions"][~far].isna().all()


def test_laws_in_si_units_are_said_not_to_apply():
    scene = everything(stiffness=0.0, damping=0.0, law=lambda x, v, t: 30.0 * x + 0.2 * v)
    assert Change(place=(5.0, 0.0)).scene(scene).connectors[0].law is scene.connectors[0].law
    case = at.Case(scene, ["rod.end"], t_end=0.1, output_dt=0.01)
    base = Base.of(case, Runner(None, repeats=1), quick=True)
    rows = places(base, 1.0).tables[0].frame.set_index("value")["status"]
    assert rows["mm, t, s"] == "does not apply: a spring has a law in SI units"
    assert rows.iloc[-1] == "ok"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["study", "extremes", DOUBLE_PENDULUM, "--dt", "1e-3"], "takes no --dt: it goes to the limits"),
        (["study", "extremes", DOUBLE_PENDULUM, "--error", "1e-3"], "takes no --error"),
        (["study", "extremes", PORTAL_FRAME, "--case", "nothing"], "'nothing' and is unknown"),
    ],
)
def test_what_is_wrong_is_named(arguments, words):
    done = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
    assert (done.exit_code, words in " ".join(done.output.split())) == (2, True), done.output


def test_a_frame_at_rest_approaches_one_of_rigid_bars():
    """Three clamped and welded rigid bars stay where they are: stiff ones differ the less, the larger their modulus."""
    case = cases_in(PORTAL_FRAME)[1]
    table = stiffness(Base.of(case, Runner(None, repeats=1), quick=True)).tables[0].frame
    assert list(table["status"]) == ["ok"] * 3
    assert table["measured"].iloc[0] == pytest.approx(1.0)
    assert (table["measured"] * table["factor"]).iloc[1:].to_numpy() == pytest.approx(0.873, rel=2e-2)


def test_each_case_has_answers_of_its_own():
    moving, resting = cases_in(PORTAL_FRAME)
    limits = pd.DataFrame([
        {"scene": moving.name, "stable_dt": 2e-4, "status": "ok"},
        {"scene": moving.name, "stable_dt": 1e-4, "status": "ok"},
        {"scene": "another", "stable_dt": 1e-9, "status": "ok"},
    ])  # fmt: skip
    learned = (
        f"{moving.name}: a disturbance of 1e-10 grows 3 times.",
        f"{moving.name}: the largest stable explicit step is 0.1 ms over all of the motion.",
        f"{resting.name}, units and place: results differ by 7e-09 at most.",
    )
    tables = [Table("stable_step", "Steps", limits)]
    step, growth = answers_of_case(moving, learned, tables)
    assert (step.question, step.figure) == (f"{moving.name}: how long may an explicit step be?", "0.1 ms")
    assert growth.take == "A disturbance of 1e-10 grows 3 times."
    (rest,) = answers_of_case(resting, learned, tables)
    assert rest.take == "Units and place: results differ by 7e-09 at most."
